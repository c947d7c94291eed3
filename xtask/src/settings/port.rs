//! A serial port, accessed by the system's own means.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use super::session::Line;
use crate::process::run;

/// The rate of a board after a reset.
const RATE: &str = "115200";
/// Longest time from a reset to the greeting.
const GREETING: Duration = Duration::from_secs(5);
/// Longest time of an answer.
const ANSWER: Duration = Duration::from_secs(5);
/// An open port.
pub struct Port {
    port: File,
    heard: Receiver<String>,
}

impl Port {
    /// Opens a port, and waits for the greeting in case the board resets.
    pub fn open(path: &Path) -> Result<Port> {
        let name = path.display();
        let port = OpenOptions::new().read(true).write(true).open(path);
        let port = port.with_context(|| format!("cannot open {name}"))?;
        set_up(path)?;
        let mut reader = port.try_clone()?;
        let (sender, heard) = channel();
        thread::spawn(move || {
            let (mut line, mut bytes) = (Vec::new(), [0; 256]);
            while let Ok(n @ 1..) = reader.read(&mut bytes) {
                for byte in &bytes[..n] {
                    match byte {
                        // Flow control characters may stand between lines.
                        b'\r' | 0x11 | 0x13 => {}
                        b'\n' => {
                            let text = String::from_utf8_lossy(&line).into_owned();
                            line.clear();
                            if sender.send(text).is_err() {
                                return;
                            }
                        }
                        byte => line.push(*byte),
                    }
                }
            }
        });
        let mut port = Port { port, heard };
        // A board that did not reset sends no greeting.
        port.wait(GREETING, |line| line.contains("SYSTEM READY"));
        Ok(port)
    }

    /// Returns the next line that `is_meant` accepts; `None` when the time is over.
    fn wait(&mut self, longest: Duration, is_meant: impl Fn(&str) -> bool) -> Option<String> {
        let end = Instant::now() + longest;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let line = self.heard.recv_timeout(left).ok()?;
            if is_meant(&line) {
                return Some(line);
            }
        }
    }
}

impl Line for Port {
    fn ask(&mut self, line: &str) -> Option<String> {
        self.port.write_all(format!("{line}\n").as_bytes()).ok()?;
        self.wait(ANSWER, |line| line.starts_with("{\"r\":") || line.starts_with("{r:"))
    }

    fn restart(&mut self) -> Result<(), String> {
        self.port.write_all(b"{reset:1}\n").map_err(|error| error.to_string())?;
        let greeting = self.wait(GREETING, |line| line.contains("SYSTEM READY"));
        // A board that is silent (`jv` 0) sends no greeting either.
        drop(greeting);
        Ok(())
    }
}

/// Sets the rate and the mode of the line.
fn set_up(path: &Path) -> Result<()> {
    if cfg!(windows) {
        let mode = format!("{}: BAUD={RATE} PARITY=N DATA=8 STOP=1", path.display());
        return run(Command::new("cmd").args(["/C", "mode", &mode]));
    }
    let flag = if cfg!(target_os = "linux") { "-F" } else { "-f" };
    run(Command::new("stty").arg(flag).arg(path).args([RATE, "raw", "-echo", "cs8", "-cstopb"]))
}
