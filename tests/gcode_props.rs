//! Properties of G-code: nothing panics, a refused line leaves no trace, numbers and units are exact.

use kerf::gcode::Interpreter;
use kerf::gcode::arc::Chords;
use kerf::gcode::command::{Commands, Motion};
use kerf::gcode::number::decimal;
use kerf::gcode::setup::Usual;
use kerf::gcode::steps::{Step, Steps};
use kerf::units::{Length, PerAxis};
use proptest::prelude::*;

/// Lines that are nearly G-code, and often are G-code.
fn line() -> impl Strategy<Value = String> {
    let word = prop_oneof![
        8 => "[GgXYZIJ](0|1|2|3|-?[0-9]{1,3}(\\.[0-9]{0,6})?)",
        4 => "G(0|1|2|3|4|17|18|19|20|21|28\\.3|80|90|91|92|92\\.1|93|94|61\\.1)",
        4 => "G(10|28|30|28\\.[1-4]|38\\.[2-5]|43|43\\.[12]|49|5[3-9]|59\\.[1-3]|7[36]|[78]|33|8[1-9]|9[5-9]|9[01]\\.1|92\\.[23])",
        4 => "[DELPQRIJKH](0|1|2|3|10|20|0?\\.5|-1)",
        2 => "[ABCFKPRNST]-?[0-9]{1,7}(\\.[0-9]{0,9})?",
        2 => "M(0|1|2|[3-9]|30|60|4[89]|4[89]\\.[12]|50|50\\.1|51)",
        1 => "[A-Z]|\\(MSG [a-z]*\\)|;[a-z]*|/|%|[XYZ]-?[0-9]{1,12}",
    ];
    prop::collection::vec(word, 0..7).prop_map(|words| words.join(" "))
}

/// A plain move, with a blank between its words.
fn plain_move() -> impl Strategy<Value = String> {
    let word = "[XYZ]-?[0-9]\\.[0-9]{1,4}";
    prop_oneof![
        word.prop_map(|word| format!("G0 {word}")),
        word.prop_map(|word| format!("G1 {word} F3000")),
        Just("G91 G1 X1 Y2 F3000".into()),
        Just("G91 G2 X1 Y1 R2 F3000".into()),
        Just("G90 G4 P0.1".into()),
    ]
}

/// A comment, with others in it.
fn comment() -> impl Strategy<Value = String> {
    "[ -\\x27*-~]{0,9}"
        .prop_recursive(3, 8, 2, |inner| {
            (inner.clone(), "[a-z ]{0,3}", inner)
                .prop_map(|(a, between, b)| format!("({a}){between}({b})"))
        })
        .prop_map(|text| format!("({text})"))
}

/// A line that a file may have around its moves, and that does nothing.
pub fn idle_line() -> impl Strategy<Value = String> {
    let line = prop_oneof![
        Just(String::new()),
        Just("%".into()),
        "%(prog|[0-9]{4}|pocket|_N_PART_MPF|Gear)[0-9]?[.]nc",
        "(N[0-9]{1,3} ?)?[oO] ?[0-9]{1,5}( [(]PART[)])?",
        "[;(][a-z(]{0,9}",
        "/[GXY0-9 ]{0,9}",
    ];
    (prop_oneof![3 => Just(""), 1 => Just("\u{FEFF}")], line)
        .prop_map(|(mark, line)| format!("{mark}{line}"))
}

/// A move, and the same with more around it: a mark of UTF-8, a number, comments, blanks.
pub fn dressed_move() -> impl Strategy<Value = (String, String)> {
    let mark = prop_oneof![4 => Just(""), 1 => Just("\u{FEFF}"), 1 => Just("  \u{FEFF} ")];
    let number = prop_oneof![Just(String::new()), "N[0-9]{1,4} ?"];
    let between =
        prop_oneof![3 => Just(" ".to_string()), 1 => Just("\t".to_string()), 2 => comment()];
    let back = prop_oneof![
        Just(String::new()),
        comment(),
        Just("; (end".to_string()),
        " {0,3}",
        Just("(open".to_string())
    ];
    (plain_move(), mark, number, between, back).prop_map(|(line, mark, number, between, back)| {
        let text = format!("{mark}{number}{}{back}", line.replacen(' ', &between, 1));
        (line, text)
    })
}

/// Interprets a line and checks what must hold for every line.
fn interpret(interpreter: &mut Interpreter, line: &[u8]) -> Commands {
    let before = *interpreter;
    let mut out = Commands::default();
    match interpreter.interpret(line, &Usual, &mut out) {
        Ok(info) => {
            if let Some((start, end)) = info.message {
                assert!(line.get(usize::from(start)..usize::from(end)).is_some());
            }
        }
        Err(_) => {
            // A refused line may change only the axis that is to blame.
            let mut expected = before;
            expected.blame(interpreter.blamed());
            assert_eq!(*interpreter, expected);
            assert_eq!(out, Commands::default());
        }
    }
    out
}

/// Returns where the steps of a line lead, and whether all steps were executed: some holes are drilled in a million
/// pecks.
fn carried_out(commands: &Commands, mut at: PerAxis<Length>) -> (PerAxis<Length>, bool) {
    let mut steps = Steps::default();
    for _ in 0..10_000 {
        match (steps.next(commands, &at), &commands.motion) {
            (None, _) => return (at, true),
            (Some(Step::Line(target, _) | Step::SetPosition(target)), _) => at = target,
            (Some(Step::Thread), motion) => at = steps.end_of_pass(motion, &at),
            (Some(Step::Arc), Motion::Arc { target, .. })
            | (Some(Step::Probe), Motion::Probe { target, .. }) => at = *target,
            _ => {}
        }
    }
    (at, false)
}

proptest! {
    #[test]
    fn any_bytes_give_a_result(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        interpret(&mut Interpreter::new(), &bytes);
    }

    #[test]
    fn any_program_gives_results(lines in prop::collection::vec(line(), 0..30)) {
        let mut interpreter = Interpreter::new();
        for line in lines {
            let start = *interpreter.position();
            let out = interpret(&mut interpreter, line.as_bytes());
            match out.motion {
                Motion::Arc { target, arc, .. } => {
                    let last = Chords::new(&start, &target, &arc, 0.01).take(5_000).last();
                    prop_assert!(last.is_some());
                }
                Motion::Home { .. } => continue,
                _ => {}
            }
            let (end, all) = carried_out(&out, start);
            prop_assert!(!all || end == *interpreter.position(), "{:?}", out);
        }
    }

    /// What CAM programs write around the moves changes no move.
    #[test]
    fn harmless_text_changes_nothing(
        moves in prop::collection::vec((idle_line(), dressed_move(), "\r?"), 1..12),
    ) {
        let (mut plain, mut full) = (Interpreter::new(), Interpreter::new());
        for (idle, (line, text), end) in moves {
            let (idle, text) = (idle + &end, text + &end);
            let mut out = Commands::default();
            let read = full.interpret(idle.as_bytes(), &Usual, &mut out);
            prop_assert!(read.is_ok() && out.is_empty(), "{idle:?}: {read:?} {out:?}");
            let read = full.interpret(text.as_bytes(), &Usual, &mut out);
            prop_assert!(read.is_ok(), "{text:?}: {read:?}");
            let expected = interpret(&mut plain, line.as_bytes());
            prop_assert_eq!(Commands { line: 0, ..out }, expected, "{:?}", text);
            prop_assert_eq!(full.position(), plain.position());
        }
    }

    #[test]
    fn what_is_printed_reads_back(
        whole in any::<u32>(), decimals in 0u32..100_000_000, places in 0usize..=8,
        negative: bool, blanks: bool,
    ) {
        let kept = decimals / 10u32.pow(8 - places as u32) * 10u32.pow(8 - places as u32);
        let digits = &format!("{kept:08}")[..places];
        let mut text = format!("{}{whole}.{digits}", if negative { "-" } else { "" });
        if blanks {
            text = text.chars().flat_map(|digit| [' ', digit]).collect();
        }
        let (rest, value) = decimal(text.as_bytes()).unwrap();
        prop_assert!(rest.is_empty());
        prop_assert_eq!(value.whole, whole);
        prop_assert_eq!(u32::from(value.frac) * 10_000 + u32::from(value.tail), kept);
        prop_assert_eq!(value.negative, negative && (whole, kept) != (0, 0));
    }

    #[test]
    fn lengths_are_rounded_exactly(whole in 0u32..8_000, decimals in 0u32..10_000_000, negative: bool) {
        let text = format!("{}{whole}.{decimals:07}", if negative { "-" } else { "" });
        let (_, value) = decimal(text.as_bytes()).unwrap();
        let magnitude = i128::from(whole) * 10_000_000 + i128::from(decimals);
        let written = if negative { -magnitude } else { magnitude };
        // In ten-thousandths of a unit of length: 10 are 1e-7 mm, 254 are 1e-7 inch.
        for (exact, scale) in [(value.mm(), 10), (value.inch(), 254)] {
            let exact = exact.unwrap();
            prop_assert_eq!(i128::from(exact.units.0) * 10_000 + i128::from(exact.rest), written * scale);
            let halves = (magnitude * scale + 5_000) / 10_000;
            prop_assert_eq!(i128::from(exact.units.0).abs(), halves);
        }
    }

    /// Incremental moves in alternating units end at the exact sum.
    #[test]
    fn units_may_alternate(moves in prop::collection::vec((any::<bool>(), -2_000_000i64..2_000_000), 1..200)) {
        let mut interpreter = Interpreter::new();
        let mut out = Commands::default();
        interpreter.interpret(b"G91 G0", &Usual, &mut out).unwrap();
        let mut sum = 0i64;
        for (inch, millionths) in moves {
            let (code, scale) = if inch { (20, 2_540) } else { (21, 100) };
            let sign = if millionths < 0 { "-" } else { "" };
            let size = millionths.abs();
            let line = format!("G{code} X{sign}{}.{:06}", size / 1_000_000, size % 1_000_000);
            interpreter.interpret(line.as_bytes(), &Usual, &mut out).unwrap();
            sum += millionths * scale;
        }
        let error = i64::from(interpreter.position()[0].0) * 10_000 - sum;
        prop_assert!(error.abs() <= 5_000, "{error}");
    }
}
