//! The fast path and the slow path of the interpreter give equal results.

use std::string::String;

use proptest::prelude::*;

use crate::gcode::command::Commands;
use crate::gcode::fast_path::Writer;
use crate::gcode::interpreter::Interpreter;
use crate::gcode::setup::Usual;
use crate::units::Length;

/// Lines for the fast path, and lines that it just declines.
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
    let mut slow = *interpreter;
    let (mut out, mut expected) = (Commands::default(), Commands::default());
    let is_fast =
        { *interpreter }.fast_path(line, Writer::Numbers, &Usual, &mut Commands::default());
    let done = interpreter.interpret(line, &Usual, &mut out);
    assert_eq!(done, slow.slow_path(line, &Usual, &mut expected), "{line:?}");
    assert_eq!((*interpreter, out), (slow, expected), "{line:?}");
    is_fast
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
fn what_is_fast() {
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
    assert!(!interpreter.fast_path(b"N1X1", Writer::Plain, &Usual, &mut Commands::default()));
    for (line, fast) in [("G91", false), ("G0X.5", true), ("X.00001", false), ("X1", false)] {
        assert_eq!(both_ways(&mut interpreter, line.as_bytes()), fast, "{line}");
    }
    both_ways(&mut interpreter, b"G90");
    for mode in ["G20", "G93"] {
        let mut interpreter = interpreter;
        both_ways(&mut interpreter, mode.as_bytes());
        assert!(!both_ways(&mut interpreter, b"G0X1"), "{mode}");
    }
    // Both paths agree at the ends of the range.
    for line in ["G92X-65000", "G0X60000", "G92X-65000", "G0X60000", "G92X-65000", "G0X60000"] {
        both_ways(&mut interpreter, line.as_bytes());
    }
}

/// Lines of printing hosts: each as the host sends it, and as the slow path expects it.
fn printed() -> impl Strategy<Value = (String, String)> {
    let digits = || "-?[0-9]{0,5}(\\.[0-9]{0,6})?";
    let word = prop_oneof![
        6 => ("[XYZxyz]", "-?[0-9]{1,3}(\\.[0-9]{0,4})?").prop_map(|(letter, number)| letter + &number),
        5 => ("[EeA]", digits()).prop_map(|(letter, number)| letter + &number),
        1 => "F[0-9]{1,5}",
        1 => "N1|;|E|E1E2|M2",
    ];
    ("G[01] ", prop::collection::vec(word, 1..5)).prop_map(|(code, words)| {
        let line = code + &words.join(" ");
        let slow = line.replace("G0", "G1").replace(['E', 'e'], "A");
        (line, slow.split(';').next().unwrap().into())
    })
}

#[cfg(feature = "dialect-reprap")]
proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]
    #[test]
    fn lines_of_printing_hosts_lead_to_the_same(
        lines in prop::collection::vec((printed(), 0..20u8), 1..12),
    ) {
        let mut interpreter = Interpreter::new();
        interpreter.begin_printing();
        for ((line, words), mode) in lines {
            match mode {
                0 => interpreter.set_relative(true),
                1 => interpreter.set_relative(false),
                2 | 3 => {
                    let text = if mode == 2 { "G91" } else { "G90" };
                    let _ = interpreter.interpret(text.as_bytes(), &Usual, &mut Commands::default());
                }
                _ => {}
            }
            let mut slow = interpreter;
            let (mut out, mut expected) = (Commands::default(), Commands::default());
            if interpreter.fast_path(line.as_bytes(), Writer::Prints, &Usual, &mut out) {
                let done = slow.slow_path(words.as_bytes(), &Usual, &mut expected);
                prop_assert!(done.is_ok(), "{} {:?}", line, done);
                prop_assert_eq!((interpreter, out), (slow, expected), "{}", line);
            } else {
                prop_assert_eq!(interpreter, slow);
                let _ = interpreter.slow_path(words.as_bytes(), &Usual, &mut out);
            }
        }
    }
}

#[cfg(feature = "dialect-reprap")]
#[test]
fn what_is_fast_of_a_printing_host() {
    let mut interpreter = Interpreter::new();
    interpreter.begin_printing();
    let is_fast = |interpreter: &mut Interpreter, line: &str| {
        interpreter.fast_path(line.as_bytes(), Writer::Prints, &Usual, &mut Commands::default())
    };
    for line in ["G1 X10.125 Y3 E0.12345 F1800", "G0 X3 F9000", "G1 E-2.5", "X3 E.00004", "G1 E5"] {
        assert!(is_fast(&mut interpreter, line), "{line}");
    }
    interpreter.set_relative(true);
    for line in ["G1 X1 E0.12345", "G1 X2 E0.00004", "G1 X3 E0.00004", "G1 E-0.00009"] {
        assert!(is_fast(&mut interpreter, line), "{line}");
    }
    for line in ["G1 X1 E0.123456", "G28", "G1 E123456", "N3 G1 X1", "G1 X1 ; wall", "G2 X1 I1"] {
        assert!(!is_fast(&mut interpreter, line), "{line}");
    }
    interpreter.set_flow(900);
    assert!(!is_fast(&mut interpreter, "G1 X1"));
}

/// M83 stays in force when a line with G90 or G91 is refused.
#[cfg(feature = "dialect-reprap")]
#[test]
fn a_line_that_is_refused_leaves_the_extruder_its_mode() {
    let mut interpreter = Interpreter::new();
    interpreter.begin_printing();
    interpreter.set_relative(true);
    for (line, done) in [("G90 G2 X1 I0 J0", false), ("G1 A1 F60", true), ("G1 A1", true)] {
        let is_done = interpreter.interpret(line.as_bytes(), &Usual, &mut Commands::default());
        assert_eq!(is_done.is_ok(), done, "{line}");
    }
    assert_eq!(interpreter.position()[3], Length(20_000));
}
