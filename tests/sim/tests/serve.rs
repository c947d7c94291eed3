//! A sender opens the simulated board like any serial port, and talks to the firmware.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Lines, Read, Write};
use std::process::{Child, Stdio};

use kerf::boards::MEGA2560_GRBL;

use crate::common::{image, kerf_sim};

/// A server, which ends when the test ends, however that happens.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Returns the first line that is no automatic report.
fn next(lines: &mut Lines<BufReader<File>>) -> String {
    // Reports, and the greeting for senders of the other dialect.
    let others = ["{\"sr\":", "{\"qr\":", "Grbl 1.1h"];
    let is_other = |line: &String| {
        line.trim_end().is_empty() || others.iter().any(|other| line.starts_with(other))
    };
    lines.map(Result::unwrap).find(|line| !is_other(line)).unwrap()
}

/// Starts a server. Its first line names the port.
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

/// Also applies to a server that was started by `cargo xtask serve`, because it replaces that process.
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

/// Ends a server's standard input. Returns what the server then prints, and whether it reports success.
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
        // TinyG's dialect from now on.
        port.write_all(b"{}\n").unwrap();
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
fn behind_a_boot_loader_what_is_sent_early_is_lost() {
    let (_server, mut port) = serve(&["--boot-loader", "--speed", "max"]);
    port.write_all(b"{fb:n}\n").unwrap();
    let mut lines = BufReader::new(port.try_clone().unwrap()).lines();
    assert!(next(&mut lines).contains("SYSTEM READY"));
    port.write_all(b"{fv:n}\n").unwrap();
    assert!(next(&mut lines).starts_with(r#"{"r":{"fv":0.970}"#));
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

/// A debugger, with the functions that are needed here.
struct Debugger(std::net::TcpStream);

impl Debugger {
    fn ask(&mut self, packet: &str) -> String {
        let sum = packet.bytes().fold(0u8, u8::wrapping_add);
        self.0.write_all(format!("${packet}#{sum:02x}").as_bytes()).unwrap();
        self.hear()
    }

    /// Returns the text between `$` and `#`.
    fn hear(&mut self) -> String {
        let mut text = Vec::new();
        let mut byte = [0];
        while text.len() < 3 || text[text.len() - 3] != b'#' {
            self.0.read_exact(&mut byte).unwrap();
            if byte[0] != b'+' || !text.is_empty() {
                text.push(byte[0]);
            }
        }
        String::from_utf8(text[1..text.len() - 3].to_vec()).unwrap()
    }
}

#[test]
fn a_debugger_halts_the_board_and_looks_into_it() {
    let mut command = kerf_sim();
    command
        .arg("serve")
        .arg("--elf")
        .arg(image(&MEGA2560_GRBL))
        .args(["--gdb", "0", "--speed", "max"]);
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut server = Server(command.spawn().unwrap());
    let said = BufReader::new(server.0.stdout.as_mut().unwrap()).lines().nth(1).unwrap().unwrap();
    let port: u16 = said.strip_prefix("gdb: ").unwrap().parse().unwrap();
    let mut debugger = Debugger(std::net::TcpStream::connect(("127.0.0.1", port)).unwrap());
    assert!(debugger.ask("qSupported:swbreak+").starts_with("PacketSize="));
    assert_eq!(debugger.ask("?"), "S05");
    // The machine is halted. There are 32 registers, SREG, two bytes of the stack pointer and four of the program
    // counter.
    let registers = debugger.ask("g");
    assert_eq!((registers.len(), debugger.ask("g")), (2 * 39, registers));
    // The tick of the millisecond, vector 21, comes again and again.
    let tick: u32 = 21 * 4;
    assert_eq!(debugger.ask(&format!("Z0,{tick:x},2")), "OK");
    for _ in 0..3 {
        assert_eq!(debugger.ask("c"), "S05");
        let pc = debugger.ask("p22");
        let pc = u32::from_str_radix(&pc, 16).unwrap().swap_bytes();
        assert_eq!(pc, tick);
    }
    assert_eq!(debugger.ask("s"), "S05");
    assert_ne!(debugger.ask("p22"), format!("{:08x}", u32::swap_bytes(tick)));
    // RAM can be read and written, flash read.
    assert_eq!(debugger.ask("M8021f0,2:abcd"), "OK");
    assert_eq!(debugger.ask("m8021f0,2"), "abcd");
    assert_eq!(debugger.ask("m0,4").len(), 8);
    assert_eq!(debugger.ask("D"), "OK");
}
