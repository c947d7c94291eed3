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

#[test]
fn mistakes_are_explained() {
    let file = Path::new("examples/square.gcode");
    for (args, want) in [
        (["--machine", "crane"], "no machine crane; there are careful, router"),
        (["--zero", "1,2"], "1,2 is no place: X,Y,Z"),
        (["--set", "{xvm:-1}"], "{xvm:-1}: "),
    ] {
        let output = check(file, &args);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && text.contains(want), "{text}");
    }
}
