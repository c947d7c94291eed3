//! The quick way and the general way through the interpreter are one.

use std::string::String;

use proptest::prelude::*;

use crate::gcode::command::Commands;
use crate::gcode::interpreter::Interpreter;
use crate::gcode::setup::Usual;

/// Lines that are usual, or almost.
fn line() -> impl Strategy<Value = String> {
    let word = prop_oneof![
        8 => "[XYZABCxyz][-+]?[0-9]{0,5}(\\.[0-9]{0,5})?",
        4 => "[XYZ]-?[0-9]{1,3}\\.[0-9]{1,4}",
        4 => "[Gg]-?0?[0-3](\\.[01])?",
        2 => "[FfNn][0-9]{0,10}(\\.[0-9]{0,3})?",
        1 => "G(20|21|90|91|92|93|94)|F-?0|M2|\\(note\\)|;|/|%|\t|\u{0}| |[1.]",
    ];
    let gap = prop_oneof![4 => "", 1 => " {1,2}"];
    prop::collection::vec((gap, word), 0..6)
        .prop_map(|words| words.into_iter().map(|(gap, word)| gap + &word).collect())
}

fn both_ways(interpreter: &mut Interpreter, line: &[u8]) -> bool {
    let mut general = *interpreter;
    let (mut out, mut expected) = (Commands::default(), Commands::default());
    let is_usual = { *interpreter }.usual(line, true, &Usual, &mut Commands::default());
    let done = interpreter.interpret(line, &Usual, &mut out);
    assert_eq!(done, general.general(line, &Usual, &mut expected), "{line:?}");
    assert_eq!((*interpreter, out), (general, expected), "{line:?}");
    is_usual
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]
    #[test]
    fn both_ways_lead_to_the_same(lines in prop::collection::vec(line(), 1..12)) {
        let mut interpreter = Interpreter::new();
        for line in lines {
            both_ways(&mut interpreter, line.as_bytes());
        }
    }
}

#[test]
fn what_is_usual() {
    let mut interpreter = Interpreter::new();
    for line in ["G0X1", "g1 x12.345 y-3.21 f800", "N99 X.5 Y-0", "A1.2345 F.5 G00", " X65529 Z1."]
    {
        assert!(both_ways(&mut interpreter, line.as_bytes()), "{line}");
    }
    for line in
        ["", "G1", "G2X1I1", "X1X2", "X.", "X1.23456", "X99999", "X1;", "X1\0", "N1N1X1", "F-1X1"]
    {
        assert!(!both_ways(&mut interpreter, line.as_bytes()), "{line}");
    }
    assert!(!interpreter.usual(b"N1X1", false, &Usual, &mut Commands::default()));
    for (line, usual) in [("G91", false), ("G0X.5", true), ("X.00001", false), ("X1", false)] {
        assert_eq!(both_ways(&mut interpreter, line.as_bytes()), usual, "{line}");
    }
    both_ways(&mut interpreter, b"G90");
    for mode in ["G20", "G93"] {
        let mut interpreter = interpreter;
        both_ways(&mut interpreter, mode.as_bytes());
        assert!(!both_ways(&mut interpreter, b"G0X1"), "{mode}");
    }
    // At the ends of the range.
    for line in ["G92X-65000", "G0X60000", "G92X-65000", "G0X60000", "G92X-65000", "G0X60000"] {
        both_ways(&mut interpreter, line.as_bytes());
    }
}
