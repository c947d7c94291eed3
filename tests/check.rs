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
    // A feedhold, a reset, the end of the job, a flush, and a feed override in another encoding than UTF-8.
    let acts: [&[u8]; 5] = [b"(stop!)", b"\x18", b"\x04", b"G0 Y1 %", b"(\x91high\x92)"];
    for (n, act) in acts.into_iter().enumerate() {
        for dialect in ["tinyg", "grbl"] {
            let job_text = [b"G0 X1\n", act, b"\nG1 X2 F500\n"].concat();
            let name = format!("acts-{n}-{dialect}.gcode");
            let (text, ok) = judged(&name, &job_text, &["--dialect", dialect]);
            // In grbl's dialect % has no effect.
            let harmless = dialect == "grbl" && act.ends_with(b"%");
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
    let lines = ["?", "$G", "$$", "$xvm=5", "h", "{ej:0}", "{\"baud\":9600}", "$H", "$HX"];
    for (n, line) in lines.into_iter().enumerate() {
        for dialect in ["tinyg", "grbl"] {
            // In grbl's dialect a line of JSON and the letter H are no G-code, and refused.
            let refused = dialect == "grbl" && line.starts_with(['h', '{']);
            let name = format!("no-g-code-{n}-{dialect}.gcode");
            let job_text = format!("G0 X1\n{line}\nG0 X2\n");
            let (text, ok) = judged(&name, job_text.as_bytes(), &["--dialect", dialect]);
            assert_eq!(ok, !refused, "{text}");
            assert!(text.contains("\nline 2: "), "{text}");
            assert!(text.lines().any(|l| l.starts_with("X ") && l.contains(" 2.000 ")), "{text}");
        }
    }
    let (text, _) = judged("looks.gcode", b"$H\nG0 X1\n", &[]);
    assert!(text.starts_with("dialect grbl (line 1 "), "{text}");
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
    // A line without F has that of the line before, 1,500 mm/min in the first one: 40 mm take 1.6 s.
    let (text, ok) = judged("no-f.gcode", b"M104 S0\nG1 X40\n", &["--machine", "printer"]);
    assert!(ok && text.contains("time 0:00:01.6"), "{text}");
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
