//! A sender opens the simulated board like any serial port, and talks to the firmware.

mod common;

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, Command, Stdio};

use common::image;
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

#[test]
fn a_sender_opens_the_port_and_moves_the_machine() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kerf-sim"));
    command.arg("serve").arg("--elf").arg(image(&MEGA2560_GRBL)).stdout(Stdio::piped());
    let mut server = Server(command.spawn().unwrap());
    let mut path = String::new();
    BufReader::new(server.0.stdout.as_mut().unwrap()).read_line(&mut path).unwrap();

    let mut port = OpenOptions::new().read(true).write(true).open(path.trim()).unwrap();
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
