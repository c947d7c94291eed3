//! Names in requests and responses: settings, values, groups and actions.

#[cfg(feature = "drivers")]
use super::value::FIRST_DRIVER;
use super::value::{
    Form, PROBE_STATE, PROBED, SHIFT, SINGLE_COUNT, SINGLES, Single, Source, VECTOR_COUNT, VECTORS,
    Vector, place_form, vector_value,
};
use crate::capability::Capability;
#[cfg(feature = "drivers")]
use crate::config::drive::DRIVERS;
use crate::config::name::{LONGEST, Name, axis_letter, axis_of, padded};
use crate::config::rows::{find_row, row_name, value_name};
use crate::config::table::Kind;
use crate::config::{Fixed, Owner, Setting};
use crate::gcode::tables::TableRow;
use crate::machine::Alarm;
use crate::progmem::Text;
#[cfg(feature = "sd")]
use crate::protocol::files::Files;
use crate::protocol::{Machine, Value};
use crate::units::AXES;
use crate::{named, plain, progmem};

const FIRST_SINGLE: u16 = Setting::NUMBERS as u16;
const FIRST_VECTOR: u16 = FIRST_SINGLE + SINGLE_COUNT as u16;

/// The number of the first token for the interpreter's tables. Only tokens below it may be in the status report.
const FIRST_ROW: u16 = 512;

/// A setting or a value, identified by a number.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Token(u16);

/// What a token stands for.
pub enum Subject {
    /// A setting.
    Setting(Setting),
    /// A value with a name of its own.
    Single(Single),
    /// A member of a vector: the index of the vector, the vector, and the index of the member.
    Member(u8, Vector, u8),
    /// A value of the interpreter's tables.
    TableRow(TableRow, u8),
}

/// The value of a token, ready to be written.
#[derive(Clone, Copy)]
pub enum Shown {
    /// A number.
    Number(Fixed),
    /// A string.
    Text(Text),
    /// 32 bits.
    Data(i32),
}

#[small]
impl Token {
    /// Returns the token for row `row` of the group `sys`.
    pub const fn system(row: u8) -> Token {
        Token(row as u16)
    }

    /// Whether the value is only in EEPROM, and therefore takes too long to read for the status report.
    pub fn is_far(self) -> bool {
        self.0 >= FIRST_ROW || self.setting().is_some_and(Setting::is_cold)
    }

    /// Returns the number of the token, which is below 512 unless the token is [far](Self::is_far).
    pub const fn number(self) -> u16 {
        self.0
    }

    /// Returns the token with a number that [`Token::number`] returned.
    pub const fn numbered(number: u16) -> Token {
        Token(number)
    }

    /// Returns the token of a setting.
    fn of_setting(setting: Setting) -> Token {
        Token(setting.number().into())
    }

    /// Returns the token of a row of [`SINGLES`].
    pub const fn single(index: u8) -> Token {
        Token(FIRST_SINGLE + index as u16)
    }

    /// Returns the token of a member of a vector.
    const fn member(vector: u8, index: u8) -> Token {
        Token(FIRST_VECTOR + (vector * AXES as u8 + index) as u16)
    }

    /// Returns the token of a value in the interpreter's tables.
    fn row(row: TableRow, axis: u8) -> Token {
        Token(FIRST_ROW + u16::from(row.number()) * AXES as u16 + u16::from(axis))
    }

    /// Returns the setting or value called `name`; `None` if there is none. About 3,000 cycles on AVR; 8,000 for a
    /// name that begins like those of the interpreter's tables.
    pub fn find(name: &Name) -> Option<Token> {
        let setting = || Setting::find(name).map(Token::of_setting);
        let single = name.row_name(0).and_then(|token| SINGLES.slice().find(token));
        single
            .map(Token::single)
            .or_else(|| Token::find_member(name))
            .or_else(|| Token::find_row(name))
            .or_else(setting)
    }

    fn find_member(name: &Name) -> Option<Token> {
        let (letter, group) = name.bytes().split_last()?;
        let number = find_vector(&Name::new().with(group)?)?;
        let vector = VECTORS.at(usize::from(number))?;
        let index = match usize::from(vector.members) {
            AXES => axis_of(*letter)?,
            _ => letter.checked_sub(b'1')?,
        };
        (index < vector.members).then(|| Token::member(number, index))
    }

    #[inline(never)]
    fn find_row(name: &Name) -> Option<Token> {
        let (letter, row) = name.bytes().split_last()?;
        let axis = axis_of(*letter)?;
        let row = find_row(&Name::new().with(row)?)?;
        row.has(axis).then(|| Token::row(row, axis))
    }

    /// Returns what the token stands for; `None` if its number is unused.
    pub fn subject(self) -> Option<Subject> {
        let number = self.0;
        if let Some(setting) = self.setting() {
            return Some(Subject::Setting(setting));
        }
        if number < FIRST_VECTOR {
            let index = number.checked_sub(FIRST_SINGLE)?;
            return SINGLES.at(usize::from(index)).map(Subject::Single);
        }
        if number < FIRST_ROW {
            let (number, index) = vector_index((number - FIRST_VECTOR) as u8);
            return VECTORS
                .at(usize::from(number))
                .filter(|vector| index < vector.members)
                .map(|vector| Subject::Member(number, vector, index));
        }
        let (row, axis) = by_axis((number - FIRST_ROW) as u8);
        TableRow::from_number(row).map(|row| Subject::TableRow(row, axis))
    }

    /// Returns the setting; `None` if the token is not a setting.
    pub fn setting(self) -> Option<Setting> {
        u8::try_from(self.0).ok().and_then(Setting::from_number)
    }

    /// Returns the full name of the token.
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
            Some(Subject::TableRow(row, axis)) => value_name(row, axis),
            None => Name::new(),
        }
    }

    /// Returns the present value of the token.
    pub fn read(self, machine: &mut impl Machine) -> Shown {
        let inches = machine.inches();
        let (source, form) = match self.subject() {
            Some(Subject::Setting(setting)) => {
                let row = setting.row();
                return match row.kind {
                    Kind::Text => Shown::Text(setting.text()),
                    Kind::Data | Kind::Job => Shown::Data(machine.setting(setting)),
                    _ => {
                        let value = machine.setting(setting);
                        Shown::Number(machine.settings().show(setting, value, inches))
                    }
                };
            }
            Some(Subject::Single(single)) => (single.source, single.form),
            Some(Subject::Member(number, vector, index)) => {
                (vector_value(number, index), vector.form(index))
            }
            Some(Subject::TableRow(row, axis)) => {
                (Source::Of(Value::TableRow(row, axis)), place_form(axis))
            }
            None => (Source::State, Form::Count),
        };
        Shown::Number(form.show(source.read(machine), inches))
    }
}

/// Splits a number into a group of six, and the index in that group.
#[small]
fn by_axis(number: u8) -> (u8, u8) {
    (number / AXES as u8, number % AXES as u8)
}

/// Returns the vector, and the member of it. The last vector may have more members than there are axes.
#[small]
fn vector_index(offset: u8) -> (u8, u8) {
    let number = (offset / AXES as u8).min(VECTOR_COUNT as u8 - 1);
    (number, offset - number * AXES as u8)
}

#[small]
fn find_vector(name: &Name) -> Option<u8> {
    VECTORS.slice().find(name.row_name(0)?)
}

/// The number of entries of the default status report.
pub const DEFAULT_REPORT: usize = 11;

progmem! {
    /// posx posy posz posa feed vel unit coor dist frmo stat.
    pub static DEFAULT_TOKENS: [Token; DEFAULT_REPORT] = [
        Token::member(1, 0), Token::member(1, 1), Token::member(1, 2), Token::member(1, 3),
        Token::single(3), Token::single(2), Token::single(9), Token::single(10),
        Token::single(14), Token::single(15), Token::single(4),
    ];

    static ACTIONS: [Verb; ACTION_COUNT] = [
        verb("gc", Operation::Block),
        verb("clear", Operation::Clear),
        verb("clr", Operation::Clear),
        verb("alarm", Operation::Raise(Alarm::Alarm)),
        verb("shutd", Operation::Raise(Alarm::Shutdown)),
        verb("panic", Operation::Raise(Alarm::Panic)),
        verb("me", Operation::Energize),
        verb("md", Operation::Release),
        verb("test", Operation::Test),
        verb("prog", Operation::Program),
        verb("qf", Operation::Flush),
        verb("defa", Operation::Defaults),
        verb("h", Operation::Help),
        verb("help", Operation::Help),
        verb("txt", Operation::Text),
        verb("tid", Operation::Id),
        verb("msg", Operation::Message),
        verb("er", Operation::Exception),
        verb("jogx", Operation::Jog),
        verb("jogy", Operation::Jog),
        verb("jogz", Operation::Jog),
        verb("joga", Operation::Jog),
        verb("boot", Operation::Boot),
        verb("reset", Operation::Reset),
        #[cfg(feature = "sd")]
        verb("sdl", Operation::Files(Files::List)),
        #[cfg(feature = "sd")]
        verb("sdr", Operation::Files(Files::Run)),
        #[cfg(feature = "sd")]
        verb("sdd", Operation::Files(Files::Delete)),
        #[cfg(feature = "sd")]
        verb("sdw", Operation::Files(Files::Write)),
        #[cfg(feature = "sd")]
        verb("sdx", Operation::Files(Files::Drop)),
    ];
}

/// The number of actions.
const ACTION_COUNT: usize = 24 + if Capability::Sd.is_built_in() { 5 } else { 0 };

/// The name of an action, padded with zeros, and its operation.
#[derive(Clone, Copy)]
struct Verb {
    token: [u8; LONGEST],
    action: Operation,
}

named! { Verb, 5 }

const fn verb(name: &str, action: Operation) -> Verb {
    Verb { token: padded(name), action }
}

/// An action that a request may ask for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Operation {
    /// `gc`: run a block of G-code.
    Block,
    /// `clear`, `clr`: ends the alarm.
    Clear,
    /// `alarm`, `shutd`, `panic`: raises an alarm.
    Raise(Alarm),
    /// `me`: power motors.
    Energize,
    /// `md`: take power from motors.
    Release,
    /// `test`: run a built-in job.
    Test,
    /// `prog`: writes or shows the stored program.
    Program,
    /// `qf`: flushes the queue.
    Flush,
    /// `defa`: restore the defaults.
    Defaults,
    /// `h`, `help`: gives a hint on help.
    Help,
    /// `txt`: carries out a line of text mode.
    Text,
    /// `tid`: no action; the value is sent back.
    Id,
    /// `msg`: no action; the text is sent back.
    Message,
    /// `er`: send an exception report.
    Exception,
    /// `jogx` and so on: move an axis.
    Jog,
    /// `boot`: start the boot loader.
    Boot,
    /// `reset`: restarts the machine.
    Reset,
    /// `sdl` and so on: files of the SD card.
    #[cfg(feature = "sd")]
    Files(Files),
}

/// A name that stands for several settings or values.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Group {
    /// `sys`, `1` to `4`, `x` to `c`, `p1`, `uda` to `udd`, `jid`.
    Settings(Owner),
    /// `pos` and similar groups, by their index in [`VECTORS`].
    Vector(u8),
    /// `g54`, `g28`, `tt1` and similar groups.
    TableRow(TableRow),
    /// A group of a single token.
    One(Token),
    /// `sr`, `srs`: the tokens of the status report.
    Report,
}

#[small]
impl Group {
    /// `ofs`.
    pub const OFFSETS: Group = Group::Vector(2);
    /// `tof`.
    pub const TOOL_OFFSETS: Group = Group::Vector(4);
    /// `g92`.
    pub const SHIFT: Group = Group::Vector(SHIFT);

    fn find(name: &Name) -> Option<Group> {
        if name.is(plain!("sys")) {
            return Some(Group::Settings(Owner::System));
        }
        if name.is(plain!("sr")) || name.is(plain!("srs")) {
            return Some(Group::Report);
        }
        if let Some(owner) = Owner::called(name) {
            return Some(Group::Settings(owner));
        }
        find_vector(name).map(Group::Vector).or_else(|| find_row(name).map(Group::TableRow))
    }

    /// Returns the prefix of the members' names.
    pub fn prefix(self) -> Name {
        match self {
            Group::Settings(owner) => owner.prefix(),
            Group::Vector(number) => VECTORS
                .at(usize::from(number))
                .map_or(Name::new(), |vector| Name::new().with_token(vector.token)),
            Group::TableRow(row) => row_name(row),
            Group::Report | Group::One(_) => Name::new(),
        }
    }

    /// Returns the first member from index `from` on, and its index; `None` if there is none.
    pub fn member(self, from: u8, machine: &mut impl Machine) -> Option<(u8, Token)> {
        match self {
            #[cfg(feature = "drivers")]
            Group::Settings(Owner::Drivers) if from >= Owner::Drivers.rows() => {
                let driver = from - Owner::Drivers.rows();
                (usize::from(driver) < DRIVERS)
                    .then(|| (from, Token::single(FIRST_DRIVER + driver)))
            }
            Group::Settings(owner) => (from..owner.rows())
                .find_map(|row| Some((row, Token::of_setting(Setting::of(owner, row)?)))),
            Group::Vector(PROBED) if from == 0 => Some((0, Token::single(PROBE_STATE))),
            Group::Vector(number) => {
                let index = if number == PROBED { from - 1 } else { from };
                let members = VECTORS.at(usize::from(number))?.members;
                (index < members).then(|| (from, Token::member(number, index)))
            }
            Group::TableRow(row) => {
                let axis = (from..AXES as u8).find(|&axis| row.has(axis))?;
                Some((axis, Token::row(row, axis)))
            }
            Group::One(token) => (from == 0).then_some((0, token)),
            Group::Report => machine.memory().tinyg.token(from).map(|token| (from, token)),
        }
    }
}

/// Returns every name that has a meaning at the top level of a request, for tests and documents: settings and values
/// by their full names, and actions.
#[cfg(feature = "std")]
#[small]
pub fn names() -> std::vec::Vec<std::string::String> {
    let text = |bytes: &[u8]| std::string::String::from_utf8_lossy(bytes).into_owned();
    let tokens = (0..FIRST_ROW + u16::from(crate::gcode::tables::ROWS) * AXES as u16).map(Token);
    let tokens = tokens.filter(|token| Token::find(&token.name()) == Some(*token));
    let actions = ACTIONS.get().map(|verb| text(&verb.token).trim_end_matches('\0').into());
    tokens.map(|token| text(token.name().bytes())).chain(actions).collect()
}

/// What a name in a request means.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Target {
    /// A setting or value.
    Token(Token),
    /// An action.
    Operation(Operation),
    /// Several settings or values.
    Group(Group),
    /// The name is unknown.
    Unknown,
}

/// Returns what `name` means with the `prefix` of a group.
#[small]
pub fn resolve(prefix: Name, name: &[u8]) -> Target {
    let Some(full) = prefix.with(name) else { return Target::Unknown };
    // Actions are searched first because they are few: some senders put a `tid` into each line.
    let verb = ACTIONS.slice().find(full.padded());
    if let Some(verb) = verb.and_then(|verb| ACTIONS.at(verb.into())) {
        return Target::Operation(verb.action);
    }
    if let Some(token) = Token::find(&full) {
        return Target::Token(token);
    }
    Group::find(&full).map_or(Target::Unknown, Target::Group)
}

#[cfg(test)]
mod tests;
