//! The program as its user sees it.

use std::fs::{self, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};

use crate::common::{self, build, kerf_sim};

fn scratch(name: &str, text: &str) -> PathBuf {
    let path = common::scratch(name);
    fs::write(&path, text).unwrap();
    path
}

fn run(elf: &Path, job: &Path, more: &[&str]) -> Output {
    kerf_sim().arg("run").arg("--elf").arg(elf).arg(job).args(more).output().unwrap()
}

#[test]
fn run_reports_and_traces() {
    let elf = build("echo.c");
    let job = scratch("good.gcode", "G0 X1\nG0 X0\nM30\n");
    let (report, vcd) = (scratch("good.json", ""), scratch("good.vcd", ""));
    let files = ["--report", report.to_str().unwrap(), "--vcd", vcd.to_str().unwrap()];
    let output = run(&elf, &job, &files);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}");
    assert_eq!(text.lines().last(), Some("result: OK"));
    let report: serde_json::Value = serde_json::from_slice(&fs::read(report).unwrap()).unwrap();
    assert_eq!(report["motors"][0]["total"], 160);
    let vcd = vcd::Parser::new(BufReader::new(fs::File::open(vcd).unwrap()));
    let rises = vcd.filter(|c| matches!(c, Ok(vcd::Command::ChangeScalar(_, vcd::Value::V1))));
    assert_eq!(rises.count(), 160 + 1, "160 steps and one change of direction");
}

#[test]
fn run_fails_when_the_job_does() {
    let output = run(&build("echo.c"), &scratch("bad.gcode", "REJECT\n"), &["--quiet"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.starts_with(b"result: FAILED (1 of 1 lines"));
}

#[test]
fn mistakes_are_explained() {
    let elf = build("echo.c");
    let job = scratch("some.gcode", "G0 X1\n");
    let blank = scratch("blank.gcode", "\n%\n");
    let text = scratch("text.elf", "no program");
    let cases: [(&Path, &Path, &[&str], &str); 5] = [
        (Path::new("/nowhere.elf"), &job, &[], "cannot read /nowhere.elf"),
        (
            &elf,
            &job,
            &["--board", "ramps14"],
            "jobs are sent in TinyG's or grbl's dialect, which the board ramps14 lacks",
        ),
        (&text, &job, &[], "text.elf is not an AVR program"),
        (&elf, &blank, &[], "blank.gcode has no lines to send"),
        (
            &elf,
            &job,
            &["--board", "uno"],
            "no board uno; there are mega2560-grbl, mega2560-grbl-lathe, mega2560-lathe, pico, pico6, picobob, \
             picocnc, picohal, ramps14, ramps14-cnc, skr-pico",
        ),
    ];
    for (elf, job, more, want) in cases {
        let output = run(elf, job, more);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(want), "{want:?} is not in {said}");
    }
}

/// A server, which ends when the test ends, however that happens.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn serve_resets_on_opening() {
    let mut command = kerf_sim();
    command.arg("serve").arg("--elf").arg(build("echo.c")).stdout(Stdio::piped());
    let mut server = Server(command.spawn().unwrap());
    let mut path = String::new();
    BufReader::new(server.0.stdout.as_mut().unwrap()).read_line(&mut path).unwrap();
    for _ in 0..2 {
        let mut port = OpenOptions::new().read(true).write(true).open(path.trim()).unwrap();
        let mut lines = BufReader::new(port.try_clone().unwrap()).lines();
        assert!(lines.next().unwrap().unwrap().contains("SYSTEM READY"));
        port.write_all(b"G0 X1\n{stat:n}\n").unwrap();
        assert_eq!(lines.next().unwrap().unwrap(), r#"{"r":{},"f":[1,0,7]}"#);
        assert!(lines.next().unwrap().unwrap().contains("stat"));
        drop((lines, port));
        // The server must see the port closed before it is opened again.
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
}
