//! What a printing host is answered: lines that say more than their code does, numbers that are no good, refusals.

use crate::reprap::Host;

/// Sends a line, and returns all that is heard until nothing comes any more.
fn hear(host: &mut Host, line: &str) -> String {
    host.machine.send(format!("{line}\n").as_bytes());
    host.machine.run_ms(100);
    host.quiet()
}

/// A line whose rest is not carried out is an error: no move gets lost behind an `ok`.
#[test]
fn no_move_is_dropped_behind_another_code() {
    let mut host = Host::boot(0);
    host.ask("G91");
    let mut at = host.steps();
    // Names and texts; stops that are carried out with the move behind them; and a stop at once.
    let others = [23, 28, 30, 32, 117, 118, 6, 60, 112];
    let codes = (0..1_000).filter(|number| !others.contains(number));
    let codes = codes.map(|number| format!("M{number}"));
    let others =
        ["T0", "G4 P1", "G4", "G10", "G11", "G10 P0", "G28", "G29", "G161", "M0 P1", "M110 N5"];
    for code in codes.chain(others.map(String::from)) {
        for rest in ["G1 X0.1", "X0.1 G1", "g0y1", "(G) G3 X1 I1"] {
            let line = format!("{code} {rest}");
            let answer = host.ask(&line);
            let now = host.steps();
            assert!(now != at || answer.contains("Error:"), "{line}: {answer}");
            at = now;
        }
    }
    for line in [
        "M105 M104 S50",
        "M400 X5",
        "M27 G1 X5",
        "m105 y1",
        "M114 Z1",
        "M82 X1",
        "M110 N0 X1",
        "T0 M104 S50",
        "G4 P1 M104 S50",
    ] {
        assert!(host.ask(line).contains("Error:"), "{line}");
    }
    for line in [
        "M117 G1 X5",
        "M118 G1 X5",
        "M84 X Y",
        "M105 ; G1 X5",
        "M400 (G1 X5)",
        "M84 S5",
        "M205 X8 Y8",
        "M207 S1 Z0.2",
        "M115 U3.13",
        "M220 S100",
        "T0",
    ] {
        let answer = host.ask(line);
        assert!(!answer.contains("Error:") && !answer.contains("echo:a"), "{line}: {answer}");
    }
    assert_eq!(host.steps(), at);
    // A text for people is no code.
    host.machine.send(b"M0 Use M3 bolts, X first\n");
    host.machine.run_ms(100);
    assert!(host.quiet().contains("//action:paused"));
    host.ask("M108");
}

/// What is wrong with a number is said, and nothing is changed by it.
#[test]
fn numbers_that_are_no_good_are_refused() {
    let mut host = Host::boot(0);
    let (range, malformed) = ("number out of range, not carried out", "malformed, not carried out");
    for (line, why) in [
        ("G4 P-5", range),
        ("G4 S-1", range),
        ("G4 S3000000 P500", range),
        ("G4 P99999999999", range),
        ("G4 Sx", range),
        ("M155 S-1", range),
        ("M155 S99999999999", range),
        ("M155 Sx", range),
        ("M113 S-1", range),
        ("M113 S99999999999", range),
        ("M113 Sx", range),
        ("M220 S99999999999", range),
        ("M220 Sx", range),
        ("M221 S99999999999", range),
        ("M207 S99999999999", range),
        ("M208 Sx", range),
        ("M302 S99999999999", range),
        ("M302 Px", range),
        ("M110 N99999999999", range),
        ("$he1p=1e9", range),
        ("$he1p=99999999999", range),
        ("$uda0=4294967296", range),
        ("$uda0=0x100000000", malformed),
        ("$xvm=", malformed),
        ("$xvm=1,5", malformed),
        ("$xvm=x", malformed),
    ] {
        let answer = host.ask(line);
        assert!(answer.ends_with(&format!("{why}\nok\n")), "{line}: {answer}");
    }
    assert_eq!(host.ask("M155 S0"), "ok\n");
    assert_eq!(host.ask("M113"), "echo:M113 S2\nok\n");
    // The number of the line counts as that of any other.
    assert_eq!(host.send(0, "M110 N0"), "ok\n");
    assert!(host.send(1, "M110 N99999999999").contains("out of range"));
    assert_eq!(host.send(2, "M400"), "ok\n");
    assert!(host.send(50, "M110 N99999999999").contains("Resend: 3"));
}

/// Each `Error:` says what is wrong.
#[test]
fn every_error_has_a_text() {
    let mut host = Host::boot(0);
    let lines = [
        "G81",
        "G81 X1 Y1 Z-1 R1",
        "G17.5",
        "G53",
        "G43",
        "G10 L2",
        "G2",
        "G2 X1",
        "G38.2 Z1",
        "G76",
        "G95",
        "G96",
        "G41",
        "G64 P",
        "G54.1",
        "M3",
        "M104 S9999",
        "M106 S-1",
    ];
    let mut bare = Vec::new();
    let words = ["", " X1", " X1 R1", " P1", " S-1", " Sx"];
    let codes = (0..200).map(|n| format!("G{n}")).chain(lines.map(String::from));
    for code in codes {
        for rest in words {
            let line = format!("{code}{rest}");
            let answer = host.ask(&line);
            if answer.lines().any(|said| said == "Error:not carried out" || said == "Error:") {
                bare.push(line);
            }
            if answer.contains("Error:alarm") || answer.contains("Error:stopped") {
                host.ask("M999");
            }
        }
    }
    assert!(bare.is_empty(), "{bare:?}");
}

/// An axis without a number is at 0, as it is where no axis is named.
#[test]
fn g92_of_a_bare_axis_sets_it_to_0() {
    let mut host = Host::boot(0);
    host.ask("G1 X1 Y2 Z3 E4 F6000");
    host.ask("M400");
    assert_eq!(host.ask("G92 X"), "ok\n");
    assert!(host.ask("M114").starts_with("X:0.000 Y:2.000 Z:3.000 E:4.000 "));
    assert_eq!(host.ask("G92 X5 y E ; Z"), "ok\n");
    assert!(host.ask("M114").starts_with("X:5.000 Y:0.000 Z:3.000 E:0.000 "));
    assert_eq!(host.ask("g92 z"), "ok\n");
    assert!(host.ask("M114").starts_with("X:5.000 Y:0.000 Z:0.000 E:0.000 "));
    assert!(host.ask("G92 Xfoo").contains("Error:malformed"));
    assert!(host.ask("G92 X1.2.3").contains("Error:malformed"));
}

/// A profile is taken over anew, and a value that M92 has lent is stored by its name although it is in force already.
#[test]
fn a_setting_is_stored_although_it_has_the_value() {
    let mut host = Host::boot(0);
    assert!(host.ask("$mch=3").ends_with("ok\n"));
    let before = host.ask("$xvm");
    assert_eq!(host.ask("$xvm=123"), "ok\n");
    assert!(host.ask("$mch=3").ends_with("ok\n"));
    assert_eq!(host.ask("$xvm"), before);
    let stored = host.ask("M92");
    assert_eq!(host.ask("M92 X90"), "ok\n");
    // Names show what is in force, as M503 does.
    let turn = host.ask("$1tr");
    assert_eq!(host.ask("M501"), "ok\n");
    assert_eq!(host.ask("M92"), stored);
    assert_ne!(host.ask("$1tr"), turn);
    assert_eq!(host.ask("M92 X90"), "ok\n");
    let lent = turn.lines().next().unwrap().trim_start_matches("echo:").trim().to_string();
    assert_eq!(host.ask(&lent), "ok\n");
    assert_eq!(host.ask("M501"), "ok\n");
    assert_eq!(host.ask("$1tr"), turn);
    assert!(host.ask("M92").contains(" X90.000 "));
}

/// What has gone wrong with a line is told once: by its answer, or by the message of the alarm.
#[test]
fn a_failure_is_told_once() {
    let mut host = Host::boot(0);
    for moves in [false, true, true, false] {
        if moves {
            host.machine.send(b"G91\nG1 X100 F600\nG1 X100\n");
            host.machine.run_ms(300);
            host.quiet();
        }
        let heard = hear(&mut host, "M112");
        assert_eq!(heard.matches("Error:").count(), 1, "{heard}");
        assert_eq!(heard.matches("ok\n").count(), 1, "{heard}");
        // An answer is an answer, although the alarm is on already.
        let heard = hear(&mut host, "M112");
        assert!(heard.ends_with("ok\n") && heard.matches("Error:").count() <= 1, "{heard}");
        assert!(hear(&mut host, "G1 X1").starts_with("Error:stopped"));
        assert_eq!(host.ask("M999"), "ok\n");
    }
    // The switch of Z never closes.
    for _ in 0..2 {
        let mut heard = host.ask("G28 Z");
        host.machine.run_ms(500);
        heard += &host.quiet();
        let errors = heard.lines().filter(|line| line.starts_with("Error:")).collect::<Vec<_>>();
        assert_eq!(errors, ["Error:homing failed"], "{heard}");
        assert!(heard.ends_with("Error:homing failed\nok\n"), "{heard}");
        host.ask("M999");
    }
}

/// A comment or a text may look like the end of one line and the beginning of another. The line is asked for again a
/// few times, and then runs.
#[test]
fn a_remark_that_looks_like_a_line_end_is_taken() {
    let mut host = Host::boot(0);
    host.ask("G91");
    assert_eq!(host.send(3, "M110 N3"), "ok\n");
    let long = format!("M117 50*2 N7 {}", "x".repeat(250));
    let lines = [
        "G1 X0.1 ; a*5 N5",
        "M117 50*2 N7 nozzle",
        "M118 50*2N7",
        "G1 X0.1 ; *5N5",
        "$nix=*",
        "M777 a*b",
        "G1 X0.1*7",
        &long,
        "G1 X0.1 (a*1 N9)",
    ];
    for (n, line) in lines.into_iter().enumerate() {
        let mut asked = 0;
        while host.send(n as i32 + 4, line).contains("Resend: ") {
            asked += 1;
            assert!(asked < 8, "{line}");
        }
    }
    assert_eq!(host.steps()[0], 3 * 128);
}
