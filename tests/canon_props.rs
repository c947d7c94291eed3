//! Properties of canonical commands: written as plain G-code and read again they are unchanged.

use kerf::canon::{Canon, Reader, commands};
use kerf::gcode::command::Feed;
use kerf::gcode::setup::Usual;
use proptest::prelude::*;
use proptest::sample::{select, subsequence};

use crate::plain::plain;

/// A number with two decimals, so that no arc has a radius beyond the precision of a float.
fn number() -> impl Strategy<Value = String> {
    (-200i32..200, 0u32..100).prop_map(|(whole, part)| format!("{whole}.{part:02}"))
}

/// Some of these letters, each with a number.
fn words(letters: &'static str) -> impl Strategy<Value = String> {
    let all: Vec<char> = letters.chars().collect();
    let most = all.len();
    (subsequence(all, 1..=most), prop::collection::vec(number(), most)).prop_map(
        |(letters, numbers)| {
            letters
                .iter()
                .zip(numbers)
                .map(|(letter, number)| format!("{letter}{number} "))
                .collect()
        },
    )
}

/// One of the parts between the bars.
fn any_of(parts: &'static str) -> impl Strategy<Value = &'static str> {
    select(parts.split('|').collect::<Vec<_>>())
}

/// A move, in half of the cases in modes of its own.
fn movement() -> impl Strategy<Value = String> {
    let modes = any_of("||||G90|G91|G20|G21|G93|G94|G95 M3 S50|G53|G61.1|G64|G17|G18|G19");
    let straight =
        (any_of("G0|G1|G1|"), words("XYZABC")).prop_map(|(code, to)| format!("{code} {to}"));
    let circle = (any_of("G17|G18|G19"), words("IJK"), any_of("|P1|P3|Z2|X2 A3"))
        .prop_map(|(plane, center, more)| format!("{plane} G2 {center} {more}"));
    let radius = (any_of("G2|G3"), words("XYZ"), 150u16..999, any_of("|-"), any_of("|P2|C5"))
        .prop_map(|(code, to, radius, sign, more)| format!("{code} {to} R{sign}{radius} {more}"));
    // Half a circle, and a little more than half.
    let half = (-90i16..90, 1i16..90, any_of("G2|G3"), any_of("|P1|Z3|.001")).prop_map(
        |(i, j, code, more)| {
            let [more, slack] = if more == ".001" { ["", "1"] } else { [more, "0"] };
            format!("G91.1 G91 G17 {code} X{} Y{}.00{slack} I{i} J{j} {more}", 2 * i, 2 * j)
        },
    );
    let any = prop_oneof![4 => straight, 1 => circle, 1 => radius, 1 => half];
    (modes, any, 1u16..3000).prop_map(|(modes, move_, feed)| format!("{modes} {move_} F{feed}"))
}

fn cycle() -> impl Strategy<Value = String> {
    let code = any_of("G73|G81|G82|G83|G84|G85|G86|G88|G89|");
    let parts = (code, words("XY"), -9i16..0, 0i16..30, any_of("G90|G91"), any_of("G98|G99|"));
    (parts, any_of("L3|L2||")).prop_map(|((code, to, depth, retract, mode, back), more)| {
        let own = match code {
            "G73" | "G83" => "Q1.5",
            "G82" | "G86" | "G88" | "G89" => "P.5",
            "G84" => "M3 S9",
            _ => "",
        };
        format!("G94 {mode} {back} {code} {to} Z{depth} R{retract} {own} {more} F100")
    })
}

fn line() -> impl Strategy<Value = String> {
    let others = any_of(
        "G28|G30|G28 X3|G30 Y2 Z1|G28.1|G30.1|G10 L2 P1 X5|G10 L20 P0 Y5|G54|G55|G92 X3 C5|G92.1|\
         G92.2|G92.3|G43.1 Z5|G49|T3 M6|T0 M6|M3 S100|M4 S2000|M5|S33|M7|M8|M9|G4 P.5|G4 P0|M0|M1|M2|\
         G38.2 X5 F9|G38.5 Z-7 F9|G28.3 X9|G28.2 X0|G28.4 Y0 Z0|(MSG, so it is)|/X9|G80|G98",
    );
    prop_oneof![5 => movement(), 2 => cycle(), 3 => others.prop_map(String::from)]
}

/// A command; for a move, with its rate and whether it stops at its end. A command that only sets these is left out.
type Told = (Canon, Option<Feed>, bool);

fn told(commands: Vec<Canon>) -> Vec<Told> {
    let (mut rate, mut exact) = (None, false);
    let mut told = Vec::new();
    for command in commands {
        match command {
            Canon::Rate(feed) => rate = Some(feed),
            Canon::ExactStop(on) => exact = on,
            Canon::Traverse(_) => told.push((command, None, exact)),
            Canon::Feed(_) | Canon::Arc(..) | Canon::Probe(..) => told.push((command, rate, exact)),
            other => told.push((other, None, false)),
        }
    }
    told
}

/// Whether two commands agree. Rates have eight decimals; everything else is exact.
fn same(a: &Told, b: &Told) -> bool {
    let near = |a: f32, b: f32| (a - b).abs() <= 1e-5 * a;
    let rates = match (a.1, b.1) {
        (Some(Feed::PerMinute(a)), Some(Feed::PerMinute(b))) => near(a, b),
        (Some(Feed::Minutes(a)), Some(Feed::Minutes(b))) => near(a, b),
        (a, b) => a.is_none() && b.is_none(),
    };
    a.0 == b.0 && a.2 == b.2 && rates
}

/// Returns the commands of the lines that are accepted, and how many lines are refused.
fn accepted(lines: &[String]) -> (Vec<Canon>, usize) {
    let mut reader = Reader::new(Usual);
    let (mut all, mut refused) = (Vec::new(), 0);
    for line in lines {
        match reader.read(line.as_bytes()) {
            Ok(()) => all.extend(&mut reader),
            Err(_) => refused += 1,
        }
    }
    (all, refused)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn what_is_printed_reads_the_same(lines in prop::collection::vec(line(), 1..60)) {
        let (first, _) = accepted(&lines);
        let text = plain(&first);
        let again = match commands(&text, Usual) {
            Ok(again) => again,
            Err(refusal) => return Err(TestCaseError::fail(format!("{refusal}\n{text}"))),
        };
        let (first, again) = (told(first), told(again));
        for (a, b) in first.iter().zip(&again) {
            prop_assert!(same(a, b), "{:?}\n{:?}\n{}", a, b, text);
        }
        prop_assert_eq!(first.len(), again.len());
    }

    /// Most lines must be accepted, because otherwise the property above would say nothing.
    #[test]
    fn most_lines_are_taken(lines in prop::collection::vec(line(), 60)) {
        let (_, refused) = accepted(&lines);
        prop_assert!(refused < 40, "{}", refused);
    }
}
