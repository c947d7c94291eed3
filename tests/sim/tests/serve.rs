//! A sender opens the simulated board like any serial port, and talks to the firmware.

mod common;

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Lines, Read, Write};
use std::process::{Child, Stdio};

use common::{image, kerf_sim};
use kerf::boards::MEGA2560_GRBL;

/// Ends the server however the test ends.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The first line that is no automatic report.
fn next(lines: &mut Lines<BufReader<File>>) -> String {
    let is_report = |line: &String| line.starts_with("{\"sr\":") || line.starts_with("{\"qr\":");
    lines.map(Result::unwrap).find(|line| !is_report(line)).unwrap()
}

/// Starts a server; its first line is the port.
fn serve(more: &[&str]) -> (Server, File) {
    let mut command = kerf_sim();
    command.arg("serve").arg("--elf").arg(image(&MEGA2560_GRBL)).args(more);
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut server = Server(command.spawn().unwrap());
    let mut path = String::new();
    BufReader::new(server.0.stdout.as_mut().unwrap()).read_line(&mut path).unwrap();
    let port = OpenOptions::new().read(true).write(true).open(path.trim()).unwrap();
    (server, port)
}

#[test]
fn who_opens_the_port_is_told_that_the_board_resets() {
    let mut command = kerf_sim();
    command.arg("serve").arg("--elf").arg(image(&MEGA2560_GRBL));
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut server = Server(command.spawn().unwrap());
    let mut path = String::new();
    BufReader::new(server.0.stdout.as_mut().unwrap()).read_line(&mut path).unwrap();
    let _port = OpenOptions::new().read(true).write(true).open(path.trim()).unwrap();
    let mut said = String::new();
    BufReader::new(server.0.stderr.as_mut().unwrap()).read_line(&mut said).unwrap();
    assert!(said.contains("the board resets, as a real one does"), "{said}");
}

/// Also of a server that somebody has started by `cargo xtask serve`, which it takes the place of.
#[cfg(unix)]
#[test]
fn who_ends_the_process_ends_the_board_and_its_link() {
    let link = std::env::temp_dir().join(format!("kerf-serve-{}.tty", std::process::id()));
    let (mut server, port) = serve(&["--link", link.to_str().unwrap()]);
    assert!(link.is_symlink());
    let pid = server.0.id().to_string();
    assert!(std::process::Command::new("kill").arg(&pid).status().unwrap().success());
    assert!(server.0.wait().unwrap().success());
    drop(port);
    assert!(!link.is_symlink());
}

/// Ends a server's standard input; what it says then, and whether it is content.
fn end(server: &mut Server) -> (String, bool) {
    drop(server.0.stdin.take());
    let mut text = String::new();
    server.0.stdout.as_mut().unwrap().read_to_string(&mut text).unwrap();
    (text, server.0.wait().unwrap().success())
}

#[test]
fn it_is_told_whether_the_machine_is_where_the_job_ends() {
    let job = std::env::temp_dir().join(format!("kerf-serve-{}.gcode", std::process::id()));
    std::fs::write(&job, "G1 X10 F500\n").unwrap();
    for (sent, content) in [("g1x10f800\n", true), ("g1x9.99f800\n", false)] {
        let (mut server, mut port) = serve(&["--speed", "max", "--expect", job.to_str().unwrap()]);
        let mut lines = BufReader::new(port.try_clone().unwrap()).lines();
        assert!(next(&mut lines).contains("SYSTEM READY"));
        port.write_all(sent.as_bytes()).unwrap();
        while !lines.next().unwrap().unwrap().contains("\"stat\":3") {}
        let (text, ok) = end(&mut server);
        assert_eq!((ok, text.contains("result: OK")), (content, content), "{text}");
    }
    std::fs::remove_file(job).unwrap();
}

#[test]
fn what_is_sent_before_the_firmware_listens_is_kept() {
    let (_server, mut port) = serve(&[]);
    port.write_all(b"{fb:n}\n").unwrap();
    let mut lines = BufReader::new(port.try_clone().unwrap()).lines();
    assert!(next(&mut lines).contains("SYSTEM READY"));
    port.write_all(b"{fv:n}\n").unwrap();
    assert!(next(&mut lines).starts_with(r#"{"r":{"fb":440.20},"f":[1,0,"#));
}

#[test]
fn a_sender_opens_the_port_and_moves_the_machine() {
    let (_server, mut port) = serve(&[]);
    let mut lines = BufReader::new(port.try_clone().unwrap()).lines();
    assert!(next(&mut lines).ends_with(r#""msg":"SYSTEM READY"},"f":[1,0,0]}"#));
    port.write_all(b"{fb:n}\n").unwrap();
    assert_eq!(next(&mut lines), r#"{"r":{"fb":440.20},"f":[1,0,7]}"#);
    port.write_all(b"g1x10f500\n").unwrap();
    assert_eq!(next(&mut lines), r#"{"r":{},"f":[1,0,7]}"#);
    while !lines.next().unwrap().unwrap().contains("\"stat\":3") {}
    port.write_all(b"?\n").unwrap();
    assert_eq!(next(&mut lines), "X position:         10.000 mm");
    assert_eq!(lines.nth(9).unwrap().unwrap(), "Machine state:       Stop");
    assert_eq!(lines.next().unwrap().unwrap(), "tinyg [mm] ok> ");
}
