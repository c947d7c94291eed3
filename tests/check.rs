//! `kerf check`, with files as the post-processors of CAM programs write them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Returns the folder of this build, in which the program lies. It is computed at run time, because the checkout may
/// have been moved.
fn target() -> PathBuf {
    let test = std::env::current_exe().expect("a path");
    test.ancestors().nth(2).expect("target/debug/deps/check").to_owned()
}

fn check(file: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(target().join("kerf"));
    command.arg("check").arg(file).args(more).output().expect("it runs")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Writes a job to a file of its own.
fn job(name: &str, text: &str) -> PathBuf {
    let folder = target().join("check");
    fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(name);
    fs::write(&path, text).expect("a file");
    path
}

#[test]
fn files_as_posts_write_them_run() {
    let files = fs::read_dir("tests/cam").expect("tests/cam");
    let mut paths: Vec<_> = files.map(|file| file.expect("a file").path()).collect();
    paths.sort();
    assert_eq!(paths.len(), 12);
    for path in paths {
        let output = check(&path, &["--machine", "router"]);
        let text = said(&output);
        let is_good = output.status.success() && text.contains(" 0 refused");
        assert!(is_good, "{}:\n{text}", path.display());
    }
}

#[test]
fn it_tells_time_and_room() {
    let output = check(Path::new("examples/bracket.gcode"), &["--machine", "router"]);
    let text = said(&output);
    assert!(output.status.success(), "{text}");
    assert!(text.contains("586 lines, 0 refused"), "{text}");
    let x = text.lines().find(|line| line.starts_with('X')).expect("X");
    let x: Vec<_> = x.split_whitespace().collect();
    assert_eq!(x, ["X", "0.000", "81.500", "81.500", "0.000", "to", "290.000"]);
    let turned = ["--machine", "router", "--set", "{1po:1}"];
    assert_eq!(said(&check(Path::new("examples/bracket.gcode"), &turned)), text);
    // 60 mm at 600 mm/min, plus two short ramps.
    let output = check(&job("time.gcode", "G1 X60 F600\n"), &["--machine", "router"]);
    assert!(said(&output).contains("time 0:00:06.0"), "{}", said(&output));
}

#[test]
fn refused_lines_are_told_with_their_cure() {
    let file = job("refused.gcode", "G0 X1\n\nG5 X2\nG41 D1\nG1 X3\nM30\n");
    let output = check(&file, &[]);
    let text = said(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("line 3: G5 X2\n    status 131 Gcode command unsupported\n"), "{text}");
    assert!(text.contains("line 4: G41 D1\n"), "{text}");
    assert!(text.contains("    do:  Put an F on the line."), "{text}");
    assert!(text.contains("5 lines, 3 refused") && text.ends_with("result: FAILED\n"), "{text}");
}

#[test]
fn what_does_not_fit_is_told() {
    let file = job("large.gcode", "G0 X100\nG0 Z-10\nG0 Z0\n");
    let fits = |zero: &str| check(&file, &["--machine", "router", "--zero", zero]);
    assert!(fits("100,0,-20").status.success());
    let output = fits("200,0,-20");
    let text = said(&output);
    let x = text.lines().find(|line| line.starts_with('X')).expect("X");
    assert!(!output.status.success() && x.ends_with("does not fit"), "{text}");
    let output = check(&job("huge.gcode", "G0 X300\n"), &["--machine", "router"]);
    assert!(!output.status.success(), "{}", said(&output));
}

#[test]
fn what_needs_a_hand_or_a_switch_is_passed_over() {
    let text = "M0\nT1 M6\nG38.2 Z-1 F100\nG28.2 X0\nG0 X1\nM30\n";
    let output = check(&job("hand.gcode", text), &["--machine", "router"]);
    let text = said(&output);
    assert!(output.status.success(), "{text}");
    assert!(text.contains("line 4: homing is taken for done"), "{text}");
    assert!(text.contains("status 250 Probe cycle failed: it cannot be tried here"), "{text}");
}

/// Returns what is said of a job, and whether it is OK.
fn judged(name: &str, job_text: &[u8], more: &[&str]) -> (String, bool) {
    let path = job(name, "");
    fs::write(&path, job_text).expect("a file");
    let output = check(&path, more);
    (said(&output), output.status.success())
}

#[test]
fn characters_that_act_at_once_are_told_at_their_line() {
    // A feedhold, a reset, the end of the job, a percent sign, and a feed override in another encoding than UTF-8.
    let acts: [&[u8]; 5] = [b"(stop!)", b"\x18", b"\x04", b"G0 Y1 %", b"(\x91high\x92)"];
    for (n, act) in acts.into_iter().enumerate() {
        for dialect in ["tinyg", "grbl"] {
            let job_text = [b"G0 X1\n", act, b"\nG1 X2 F500\n"].concat();
            let name = format!("acts-{n}-{dialect}.gcode");
            let (text, ok) = judged(&name, &job_text, &["--dialect", dialect]);
            // % has an effect in a hold alone.
            let harmless = act.ends_with(b"%");
            assert_eq!((ok, text.contains("\nline 2: ")), (harmless, !harmless), "{text}");
            assert!(text.contains("3 lines, 0 refused") && text.contains("2.000"), "{text}");
        }
    }
    // For a printing host they are text, and within a comment % is text for each dialect.
    let (text, ok) = judged("acts-print.gcode", b"M104 S0\nM117 Hi! 50%\nG1 X2\n", &[]);
    assert!(ok && text.starts_with("dialect reprap (line 1 heats"), "{text}");
    let (text, ok) = judged("comment.gcode", "(50 % caf\u{e9} ~)\nG0 X2\n".as_bytes(), &[]);
    assert!(ok, "{text}");
}

#[test]
fn what_is_no_g_code_is_told_and_never_waited_for() {
    // Whether a line is carried out, refused, or not tried, in TinyG's dialect and in grbl's.
    let lines = [
        ("?", ["not tried", "not tried"]),
        ("$G", ["status 100", ""]),
        ("$$", ["", ""]),
        ("$xvm=500", ["", ""]),
        ("$100=", ["status 100", "error:"]),
        // In grbl's dialect the answer says how to go on.
        ("h", ["not tried", ""]),
        ("[h]", ["status", "error:"]),
        ("{ej:0}", ["not tried", "error:"]),
        ("{\"baud\":9600}", ["not tried", "error:"]),
        ("$baud=1", ["not tried", "not tried"]),
        ("$H", ["status 100", "homing is taken for done"]),
        ("{home:1}", ["homing is taken for done", "error:"]),
        ("{gc:\"g28.2 x0\"}", ["homing is taken for done", "error:"]),
        ("{gc:\"g0 x1\"}", ["", "error:"]),
        // What acts without a line is answered with none.
        ("~", ["", ""]),
        ("\x05", ["", ""]),
        ("\x11", ["", "error:"]),
        ("{test:1}", ["End of file", "error:"]),
    ];
    for (n, (line, all)) in lines.into_iter().enumerate() {
        for (dialect, told) in ["tinyg", "grbl"].into_iter().zip(all) {
            let name = format!("no-g-code-{n}-{dialect}.gcode");
            let job_text = format!("G0 X1\n{line}\nG0 X2\n");
            let (text, ok) = judged(&name, job_text.as_bytes(), &["--dialect", dialect]);
            assert_eq!(ok, !told.starts_with("status") && !told.starts_with("error"), "{text}");
            assert_eq!(text.contains("\nline 2: "), !told.is_empty(), "{text}");
            assert!(text.contains(told) && text.contains("3 lines, "), "{text}");
            assert!(!text.contains("not answered"), "{text}");
        }
    }
}

#[test]
fn a_file_is_of_the_dialect_that_its_first_command_selects() {
    for (line, dialect) in [
        ("$H", "grbl"),
        ("$HX", "grbl"),
        ("$X", "grbl"),
        ("$G", "grbl"),
        ("$#", "grbl"),
        ("$$", "grbl"),
        ("$110=800", "grbl"),
        ("$J=X1 F100", "grbl"),
        ("$xvm=500", "tinyg"),
        ("$clear", "tinyg"),
        ("$x", "tinyg"),
        ("{xvm:500}", "tinyg"),
        ("$", "tinyg"),
        ("; generated by PrusaSlicer 2.7.1", "reprap"),
        (";FLAVOR:Marlin", "reprap"),
        ("M104 S0", "reprap"),
        ("(M104 S0)", "tinyg"),
        // CAM programs' comments.
        ("; Type:         Pocket", "tinyg"),
        (";header_type: cnc", "tinyg"),
        ("; Layer C00", "tinyg"),
        ("G92 X0", "tinyg"),
    ] {
        let (text, _) = judged("looks.gcode", format!("G21\n{line}\n$H\n").as_bytes(), &[]);
        let of_first = text.starts_with(&format!("dialect {dialect} (line 2 "));
        // If it decides nothing, the next one does.
        let of_next = text.starts_with("dialect grbl (line 3 ") && dialect == "tinyg";
        assert!(
            of_first || of_next && !line.starts_with(['{', '$']) || line == "$",
            "{line}: {text}"
        );
    }
}

#[test]
fn what_ends_a_job_or_has_the_rest_ignored_is_told_at_its_line() {
    let of_tinyg = [
        "{alarm:n}",
        "{\"shutd\":n}",
        "{panic:n}",
        "{chk:1}",
        "{\"chk\":true}",
        "{reset:1}",
        "{boot:1}",
        "{defa:1}",
        "{txt:\"$chk=1\"}",
        "{sr:n,alarm:n}",
        "$alarm",
        "$chk=1",
        "$chk 1",
        "$reset=1",
    ];
    let of_grbl = ["$SLP", "$slp", "$C", "$c", "$RST=*", "$RST=$", "$RST=#", "$ SLP"];
    let of_print = ["M112", "N5 M112*34"];
    let all = of_tinyg.map(|line| ("tinyg", line)).into_iter();
    let all = all.chain(of_grbl.map(|line| ("grbl", line)));
    for (dialect, line) in all.chain(of_print.map(|line| ("reprap", line))) {
        let job_text = format!("G0 X1\n{line}\nG0 X2\n");
        let (text, ok) = judged("ends.gcode", job_text.as_bytes(), &["--dialect", dialect]);
        assert!(
            !ok && text.contains("\nline 2: ") && text.contains("3 lines, 0 refused"),
            "{text}"
        );
        // The lines behind it are seen all the same.
        assert!(text.lines().any(|l| l.starts_with("X ") && l.contains(" 2.000 ")), "{text}");
    }
    // To ask does nothing.
    for line in ["{chk:n}", "{chk:0}", "{boot:n}", "$chk", "{reset:n}"] {
        let job_text = format!("G0 X1\n{line}\nG0 X2\n");
        let (text, ok) = judged("asks.gcode", job_text.as_bytes(), &["--dialect", "tinyg"]);
        assert!(ok, "{text}");
    }
}

#[test]
fn text_behind_a_percent_sign_or_a_question_is_seen() {
    for line in ["%G0X50", "% G0X50", "%%G0 X50", "?G0X50", " ??G0X50", "G0 X50 %", "%\rG0X50\r"] {
        for dialect in ["tinyg", "grbl"] {
            let job_text = format!("%\n{line}\n%\n");
            let (text, ok) = judged("behind.gcode", job_text.as_bytes(), &["--dialect", dialect]);
            assert!(ok, "{line}: {text}");
            assert!(text.lines().any(|l| l.starts_with("X ") && l.contains(" 50.000 ")), "{text}");
        }
    }
    // A name is no G-code. What is neither is refused.
    assert!(judged("name.gcode", b"%prog1\nG0 X1\n%\n", &[]).1);
    assert!(!judged("dashes.gcode", b"%-----\nG0 X1\n%\n", &[]).1);
}

#[test]
fn a_line_is_as_long_as_the_port_takes_it() {
    const LONGEST: usize = 254;
    for dialect in ["tinyg", "grbl"] {
        for length in [LONGEST - 1, LONGEST, LONGEST + 1, LONGEST + 60] {
            let rest = length - "G0 X1".len();
            let comment = format!("({})", "c".repeat(rest - 2));
            for line in [
                format!("G0 X1{}", " ".repeat(rest)),
                format!("G0 X1{}", "\t".repeat(rest)),
                format!("G0 X1{comment}"),
                format!("{comment}G0 X1"),
                format!("G0{}X1", " ".repeat(rest + 1)),
                format!(";{}", "c".repeat(length - 1)),
            ] {
                let job_text = format!("{line}\r\nG0 X2\r\n");
                let (text, ok) = judged("long.gcode", job_text.as_bytes(), &["--dialect", dialect]);
                assert_eq!(ok, length <= LONGEST, "{length}: {line:?}\n{text}");
            }
            // The port leaves out what is before a line.
            let job_text = format!("{}G0 X1\n{}\n", " ".repeat(length), " ".repeat(length));
            let (text, ok) = judged("before.gcode", job_text.as_bytes(), &["--dialect", dialect]);
            assert!(ok, "{text}");
        }
        // Many long lines in a row lose nothing.
        let line = format!("({})\nG1 X1 F200\nX0\n", "c".repeat(LONGEST - 2)).repeat(20);
        let (text, ok) = judged("many.gcode", line.as_bytes(), &["--dialect", dialect]);
        assert!(ok, "{text}");
    }
}

#[test]
fn a_long_dwell_is_counted_and_not_waited_for() {
    for (dialect, line, time) in [
        ("tinyg", "G4 P100000", "27:46:40"),
        ("tinyg", "N5 g04 (P1) p 100000.5 (P2)", "27:46:4"),
        ("grbl", "G4P4000000", "1111:06:40"),
        ("reprap", "G4 P100000000", "27:46:40"),
        ("reprap", "G4 S100000", "27:46:40"),
        ("tinyg", "G4 P61", "0:01:01"),
        ("tinyg", "G4 P59", "0:00:59"),
    ] {
        let job_text = format!("G0 X1\n{line}\nG0 X2\n");
        let (text, ok) = judged("dwell.gcode", job_text.as_bytes(), &["--dialect", dialect]);
        assert!(ok && text.contains(&format!("time {time}")), "{line}: {text}");
    }
    // One that is refused takes no time.
    let (text, ok) = judged("refused-dwell.gcode", b"G4 P5000000\nG4 P100000 X1\nG0 X1\n", &[]);
    assert!(!ok && text.contains("2 refused") && text.contains("time 0:00:00"), "{text}");
}

/// A setting that takes the answers away, whatever it is, does not make the dry run wait for ever.
#[test]
fn a_line_that_is_never_answered_is_refused() {
    let (text, ok) = judged("silent.gcode", b"G0 X1\n{gc:\"h\"}\n{psw:0}\nG0 X2\n", &[]);
    assert!(!ok && text.contains("4 lines, "), "{text}");
    assert!(text.lines().any(|l| l.starts_with("X ") && l.contains(" 2.000 ")), "{text}");
}

#[test]
fn every_line_behind_a_wait_for_the_spindle_is_seen() {
    let job_text = b"G0 X20 Z2\nM3 S300\nG95 F0.1\nG1 Z-1\nG33 Z-4 K1\nG0 X21\nZ2\n\
        G76 P1 Z-4 I-1 J0.3 K0.5\nG33.1 Z-4 K1\nG74.1\nG0 X90\nM30\n";
    let (text, ok) = judged("turned.gcode", job_text, &["--machine", "lathe"]);
    assert!(!ok && text.contains("line 10: G74.1\n    status 131"), "{text}");
    assert!(text.contains("12 lines, 1 refused") && !text.contains("alarm"), "{text}");
    assert!(text.lines().any(|l| l.starts_with('X') && l.ends_with("does not fit")), "{text}");
    // A spindle that nothing has switched on is an alarm. The lines behind it are seen all the same.
    let job_text = b"G0 Z2\nG33 Z-4 K1\nG0 X1\nG74.1\nG0 X90\nZ0\nM30\n";
    let (text, ok) = judged("still.gcode", job_text, &["--machine", "lathe"]);
    assert!(!ok && text.contains("7 lines, ") && text.contains("line 4: G74.1"), "{text}");
    assert!(text.contains("an alarm, at this line or one before it"), "{text}");
    assert!(text.lines().any(|l| l.starts_with('X') && l.ends_with("does not fit")), "{text}");
}

#[test]
fn a_print_is_judged_as_a_print() {
    let output = check(Path::new("examples/print.gcode"), &["--machine", "printer"]);
    let text = said(&output);
    assert!(output.status.success(), "{text}");
    assert!(text.contains("1825 lines, 0 refused") && text.contains("without heating"), "{text}");
    // What a print passes over is told, what it would lack is refused.
    let job_text =
        b";FLAVOR:Marlin\nM109 S200\nG28\nG92 E0\nG1 X5 E1\nM777\nM104 S0\nM190 S50\nG29\n\
        M0\nG1 X6 E2\nM104 S900\nM109 S20\n";
    let (text, ok) = judged("print.gcode", job_text, &["--machine", "printer"]);
    assert!(!ok && text.starts_with("dialect reprap (line 1 is a slicer's comment)"), "{text}");
    assert!(text.contains("12 lines, 2 refused"), "{text}");
    for told in ["line 6: Unknown command: \"M777\"", "line 9: not tried", "line 3: homing"] {
        assert!(text.contains(told), "{text}");
    }
    assert!(text.contains("line 11: G1 X6 E2\n    echo: cold extrusion"), "{text}");
    assert!(text.contains("line 12: M104 S900\n    Error:"), "{text}");
    // A line without F has that of the line before, 1,500 mm/min in the first one: 42 mm take 1.68 s, and a ramp.
    let (text, ok) = judged("no-f.gcode", b"M104 S0\nG1 X42\n", &["--machine", "printer"]);
    assert!(ok && text.contains("time 0:00:01.7"), "{text}");
    let (text, ok) = judged("no-f.nc", b"G1 X40\nG1 X20 F1200\n", &["--machine", "router"]);
    assert!(!ok && text.contains(", without the refused lines"), "{text}");
}

#[test]
fn homing_sets_the_position() {
    for (dialect, home) in [("tinyg", "G28.2 X0 Y0 Z0"), ("grbl", "$H"), ("reprap", "G28")] {
        let job_text = format!("G21\nG1 X20 F900\n{home}\nG91\nG0 X30\n");
        let args = ["--dialect", dialect, "--machine", "router"];
        let (text, ok) = judged(&format!("home-{dialect}.gcode"), job_text.as_bytes(), &args);
        assert!(ok && text.contains("line 3: homing is taken for done"), "{text}");
        let x: Vec<_> =
            text.lines().find(|l| l.starts_with('X')).unwrap().split_whitespace().collect();
        assert_eq!(x[1..3], ["0.000", "30.000"], "{text}");
    }
}

#[test]
fn mistakes_are_explained() {
    let file = Path::new("examples/square.gcode");
    for (args, want) in [
        (["--machine", "crane"], "no machine crane; there are careful, router"),
        (["--dialect", "klipper"], "no dialect klipper; there are tinyg, grbl, reprap"),
        (["--zero", "1,2"], "1,2 is no place: X,Y,Z"),
        (["--set", "{xvm:-1}"], "{xvm:-1}: "),
    ] {
        let output = check(file, &args);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && text.contains(want), "{text}");
    }
}
