//! Names on the wire: settings, values, groups and actions.

use super::machine::Machine;
use super::value::{
    Form, SINGLE_COUNT, SINGLES, Single, VECTOR_COUNT, VECTORS, Value, Vector, vector_value,
};
use crate::config::name::{Name, axis_letter, axis_of};
use crate::config::table::Kind;
use crate::config::{Fixed, Owner, Setting};
use crate::progmem;
use crate::progmem::Text;
use crate::text;
use crate::units::AXES;

const FIRST_SINGLE: u8 = Setting::NUMBERS;
const FIRST_VECTOR: u8 = FIRST_SINGLE + SINGLE_COUNT as u8;

/// A setting or a value, in one byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Token(u8);

/// What a token is.
pub enum Subject {
    /// A setting.
    Setting(Setting),
    /// A value with a name of its own.
    Single(Single),
    /// A member of a vector: the vector's number, the vector, the member's number.
    Member(u8, Vector, u8),
}

/// A token's value, ready to be written.
#[derive(Clone, Copy)]
pub enum Shown {
    /// A number.
    Number(Fixed),
    /// A string.
    Text(Text),
}

impl Token {
    /// The token of row `row` of the group `sys`.
    pub const fn system(row: u8) -> Token {
        Token(row)
    }

    /// Its number.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// The token of a number that [`Token::number`] returned.
    pub const fn of_number(number: u8) -> Token {
        Token(number)
    }

    /// The token of a value in the table of [`SINGLES`].
    const fn single(index: u8) -> Token {
        Token(FIRST_SINGLE + index)
    }

    /// The token of a vector's member.
    const fn member(vector: u8, index: u8) -> Token {
        Token(FIRST_VECTOR + vector * AXES as u8 + index)
    }

    /// The setting or value called `name`. Up to 20,000 cycles on AVR.
    pub fn find(name: &Name) -> Option<Token> {
        let setting = || Setting::find(name).map(|s| Token(s.number()));
        let single = || {
            let found = |i: &usize| SINGLES.at(*i).is_some_and(|s| name.matches(0, s.token));
            (0..SINGLE_COUNT).find(found).map(|i| Token::single(i as u8))
        };
        single().or_else(|| Token::find_member(name)).or_else(setting)
    }

    fn find_member(name: &Name) -> Option<Token> {
        let (letter, group) = name.bytes().split_last()?;
        let group = Name::new().with(group)?;
        let number = (0..VECTOR_COUNT as u8).find(|&v| is_vector(&group, v))?;
        let vector = VECTORS.at(usize::from(number))?;
        let index = match usize::from(vector.members) {
            AXES => axis_of(*letter)?,
            _ => letter.checked_sub(b'1')?,
        };
        (index < vector.members).then(|| Token::member(number, index))
    }

    /// What it is.
    pub fn subject(self) -> Option<Subject> {
        if self.0 < FIRST_SINGLE {
            return Setting::from_number(self.0).map(Subject::Setting);
        }
        if self.0 < FIRST_VECTOR {
            return SINGLES.at(usize::from(self.0 - FIRST_SINGLE)).map(Subject::Single);
        }
        let (number, index) = self.vector_index();
        VECTORS.at(usize::from(number)).map(|vector| Subject::Member(number, vector, index))
    }

    fn vector_index(self) -> (u8, u8) {
        let offset = self.0 - FIRST_VECTOR;
        // The last one may have more members.
        let number = (offset / AXES as u8).min(VECTOR_COUNT as u8 - 1);
        (number, offset - number * AXES as u8)
    }

    /// The setting it is, if it is one.
    pub fn setting(self) -> Option<Setting> {
        Setting::from_number(self.0)
    }

    /// Its full name.
    pub fn name(self) -> Name {
        match self.subject() {
            Some(Subject::Setting(setting)) => setting.name(),
            Some(Subject::Single(single)) => Name::new().with_token(single.token),
            Some(Subject::Member(_, vector, index)) => {
                let axis = usize::from(vector.members) == AXES;
                let letter = if axis { axis_letter(index) } else { b'1' + index };
                let group = Name::new().with_token(vector.token);
                group.with(&[letter]).unwrap_or(group)
            }
            None => Name::new(),
        }
    }

    /// Its value now.
    pub fn read(self, machine: &mut impl Machine) -> Shown {
        let inches = machine.inches();
        let (value, form) = match self.subject() {
            Some(Subject::Setting(setting)) => {
                return match setting.row().kind {
                    Kind::Text => Shown::Text(text!("0000-KERF")),
                    _ => Shown::Number(machine.settings().show(setting, inches)),
                };
            }
            Some(Subject::Single(single)) => (single.value, single.form),
            Some(Subject::Member(number, vector, index)) => {
                (vector_value(number, index), vector.form(index))
            }
            None => (Value::State, Form::Count),
        };
        Shown::Number(form.show(machine.value(value), inches))
    }
}

fn is_vector(name: &Name, vector: u8) -> bool {
    VECTORS.at(usize::from(vector)).is_some_and(|v| name.matches(0, v.token))
}

/// The reports that a machine sends before anyone asks for others.
pub const DEFAULT_REPORT: usize = 11;

progmem! {
    /// posx posy posz posa feed vel unit coor dist frmo stat.
    pub static DEFAULT_TOKENS: [Token; DEFAULT_REPORT] = [
        Token::member(1, 0), Token::member(1, 1), Token::member(1, 2), Token::member(1, 3),
        Token::single(3), Token::single(2), Token::single(9), Token::single(10),
        Token::single(14), Token::single(15), Token::single(4),
    ];

    static ACTIONS: [(Text, Action); 9] = [
        (text!("gc"), Action::Block),
        (text!("clear"), Action::Clear),
        (text!("clr"), Action::Clear),
        (text!("me"), Action::Energize),
        (text!("md"), Action::Release),
        (text!("test"), Action::Test),
        (text!("defa"), Action::Defaults),
        (text!("h"), Action::Help),
        (text!("help"), Action::Help),
    ];
}

/// What a request may have done.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Action {
    /// `gc`: run a block of G-code.
    Block,
    /// `clear`, `clr`: end the alarm.
    Clear,
    /// `me`: power motors.
    Energize,
    /// `md`: take power from motors.
    Release,
    /// `test`: run a built-in job.
    Test,
    /// `defa`: restore the defaults.
    Defaults,
    /// `h`, `help`: tell about settings.
    Help,
}

/// Names that stand for several.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Group {
    /// `sys`, `1` to `4`, `x` to `c`.
    Settings(Owner),
    /// `pos` and its like, by their number in [`VECTORS`].
    Vector(u8),
    /// `sr`: the tokens of the status report.
    Report,
}

impl Group {
    /// `ofs`.
    pub const OFFSETS: Group = Group::Vector(2);
    /// `tof`.
    pub const TOOL_OFFSETS: Group = Group::Vector(4);

    fn find(name: &Name) -> Option<Group> {
        if name.is(text!("sys")) {
            return Some(Group::Settings(Owner::System));
        }
        if name.is(text!("sr")) {
            return Some(Group::Report);
        }
        if name.bytes().len() == 1 {
            return Owner::of_letter(name.first()).map(Group::Settings);
        }
        (0..VECTOR_COUNT as u8).find(|&v| is_vector(name, v)).map(Group::Vector)
    }

    /// What comes before the names of its members.
    pub fn prefix(self) -> Name {
        match self {
            Group::Settings(owner) => owner.prefix(),
            Group::Vector(number) => VECTORS
                .at(usize::from(number))
                .map_or(Name::new(), |vector| Name::new().with_token(vector.token)),
            Group::Report => Name::new(),
        }
    }

    /// The member behind number `from` and its number, if there is one.
    pub fn member(self, from: u8, machine: &mut impl Machine) -> Option<(u8, Token)> {
        match self {
            Group::Settings(owner) => (from..owner.rows())
                .find_map(|row| Some((row, Token(Setting::of(owner, row)?.number())))),
            Group::Vector(number) => {
                let members = VECTORS.at(usize::from(number))?.members;
                (from < members).then(|| (from, Token::member(number, from)))
            }
            Group::Report => machine.report().token(from).map(|token| (from, token)),
        }
    }
}

/// What a name in a request means.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Target {
    /// A setting or value.
    Token(Token),
    /// Something to do.
    Action(Action),
    /// Several settings or values.
    Group(Group),
    /// Nothing.
    Unknown,
}

/// What `name` means behind `prefix`, a group's.
pub fn resolve(prefix: Name, name: &[u8]) -> Target {
    let Some(full) = prefix.with(name) else { return Target::Unknown };
    if let Some(token) = Token::find(&full) {
        return Target::Token(token);
    }
    let action = |i| ACTIONS.at(i).filter(|(text, _)| full.is(*text));
    if let Some((_, action)) = (0..ACTIONS.len()).find_map(action) {
        return Target::Action(action);
    }
    Group::find(&full).map_or(Target::Unknown, Target::Group)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::{String, ToString};
    use std::vec::Vec;

    fn name(text: &str) -> Name {
        Name::new().with(text.as_bytes()).unwrap()
    }

    fn text(token: Token) -> String {
        String::from_utf8(token.name().bytes().to_vec()).unwrap()
    }

    #[test]
    fn every_token_has_a_name_that_finds_it() {
        let mut count = 0;
        for number in 0..=u8::MAX {
            let token = Token(number);
            let beyond = FIRST_VECTOR + 34..FIRST_VECTOR + 36;
            if token.subject().is_none() || beyond.contains(&number) || number >= FIRST_VECTOR + 44
            {
                continue;
            }
            assert_eq!(Token::find(&token.name()), Some(token), "{}", text(token));
            count += 1;
        }
        assert_eq!(count, 31 + 28 + 3 * 15 + 16 + 2 * 9 + 31 + 34 + 8);
        for bad in ["posd", "pwr5", "pwr0", "pos", "homd", "pwra", "velo", "in0", "in9", "ina", ""]
        {
            assert_eq!(Token::find(&name(bad)), None, "{bad}");
        }
    }

    #[test]
    fn the_default_report_is_as_documented() {
        let names: Vec<String> = DEFAULT_TOKENS.get().into_iter().map(text).collect();
        assert_eq!(names.join(" "), "posx posy posz posa feed vel unit coor dist frmo stat");
    }

    #[test]
    fn names_mean_what_they_should() {
        let resolved = |text: &str| resolve(Name::new(), text.as_bytes());
        assert_eq!(resolved("x"), Target::Group(Group::Settings(Owner::Axis(0))));
        assert_eq!(resolved("N"), Target::Token(Token::single(0)));
        assert_eq!(resolved("4"), Target::Group(Group::Settings(Owner::Motor(3))));
        assert_eq!(resolved("pwr"), Target::Group(Group::Vector(5)));
        assert_eq!(resolved("CLEAR"), Target::Action(Action::Clear));
        assert_eq!(resolved("sr"), Target::Group(Group::Report));
        assert_eq!(resolved("toolong"), Target::Unknown);
        assert_eq!(resolved("5"), Target::Unknown);
        assert_eq!(resolve(name("x"), b"vm"), resolved("xvm"));
        assert_eq!(resolve(name("x"), "".to_string().as_bytes()), resolved("x"));
    }
}
