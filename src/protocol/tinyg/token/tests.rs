use super::*;
use crate::capability::Capability;
use crate::config::groups::system;
use crate::gcode::tables::ROWS;
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
    let small = FIRST_VECTOR + 96 + 8;
    let rows = FIRST_ROW..FIRST_ROW + u16::from(ROWS) * 6;
    for token in (0..small).chain(rows).map(Token) {
        match token.subject() {
            None => continue,
            Some(Subject::TableRow(row, axis)) if !row.has(axis) => continue,
            Some(_) => {}
        }
        assert_eq!(Token::find(&token.name()), Some(token), "{}", text(token));
        count += 1;
    }
    assert_eq!(
        count,
        system::COUNT
            + 32
            + 3 * 16
            + 19
            + 2 * 9
            + 44
            + 48
            + 2 * 6
            + 2
            + 6 * 4
            + 9
            + 11 * 6
            + 10 * 2
            + 10
            + 5
            + 16
            + 5
            + if Capability::Printer.is_built_in() { 16 + 6 } else { 0 }
            + if Capability::Drivers.is_built_in() { 15 + 4 } else { 0 }
            + if Capability::Shaping.is_built_in() { 5 } else { 0 }
            + if Capability::Sd.is_built_in() { 3 } else { 0 }
    );
    for bad in [
        "g53x", "g54d", "tt1y", "tt11z", "posd", "pwr5", "pwr0", "pos", "homd", "pwra", "velo",
        "in0", "in9", "ina", "",
    ] {
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
    assert_eq!(resolved("pwr"), Target::Group(Group::Vector(6)));
    assert_eq!(resolved("G59"), Target::Group(Group::TableRow(TableRow::system(5))));
    assert_eq!(resolve(name("g59"), b"1x"), resolved("g591x"));
    assert_eq!(resolved("CLEAR"), Target::Operation(Operation::Clear));
    assert_eq!(resolved("sr"), Target::Group(Group::Report));
    assert_eq!(resolved("toolong"), Target::Unknown);
    assert_eq!(resolved("5"), Target::Unknown);
    assert_eq!(resolve(name("x"), b"vm"), resolved("xvm"));
    assert_eq!(resolve(name("x"), "".to_string().as_bytes()), resolved("x"));
}

#[test]
fn no_action_is_called_as_a_value_is() {
    for i in 0..ACTIONS.len() {
        let Verb { token, action } = ACTIONS.at(i).unwrap();
        let name = Name::beginning(token.split(|byte| *byte == 0).next().unwrap());
        assert_eq!(Token::find(&name), None, "{action:?}");
    }
}
