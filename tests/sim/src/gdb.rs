//! A GDB stub: GDB's remote protocol over TCP, for `kerf-sim serve --gdb PORT`.
//!
//! While the debugger has the machine halted, simulated time stands still. Breakpoints are checked after each
//! instruction. Addresses are those of avr-gdb: flash from 0, data from 0x800000.

use std::collections::HashSet;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};

use anyhow::{Context, Result};
use kerf_sim::Machine;

/// First address of the data space.
const DATA: u32 = 0x80_0000;
/// The byte with which a debugger halts a running machine.
const BREAK: u8 = 3;
/// The stop reply for a breakpoint or a step.
const TRAPPED: &str = "S05";
/// Most bytes that one request may read.
const MOST: u32 = 0x400;

/// The server that a debugger connects to.
pub struct Gdb {
    listener: TcpListener,
    client: Option<TcpStream>,
    heard: Vec<u8>,
    breakpoints: HashSet<u32>,
    halted: bool,
}

impl Gdb {
    /// Listens for a debugger at a TCP port of this computer.
    pub fn listen(port: u16) -> Result<Self> {
        let listener = TcpListener::bind(("127.0.0.1", port));
        let listener = listener.with_context(|| format!("port {port} is taken"))?;
        listener.set_nonblocking(true)?;
        let (client, heard) = (None, Vec::new());
        Ok(Gdb { listener, client, heard, breakpoints: HashSet::new(), halted: false })
    }

    /// Returns the TCP port. If port 0 was requested, it is the one that the system has chosen.
    pub fn port(&self) -> Result<u16> {
        Ok(self.listener.local_addr()?.port())
    }

    /// Accepts a connection and handles requests of the debugger.
    pub fn turn(&mut self, machine: &mut Machine) -> Result<()> {
        if let Ok((client, _)) = self.listener.accept() {
            client.set_nonblocking(true)?;
            client.set_nodelay(true)?;
            // A debugger that attaches finds the machine halted.
            (self.client, self.halted) = (Some(client), true);
            self.heard.clear();
            self.breakpoints.clear();
        }
        let Some(client) = &mut self.client else { return Ok(()) };
        let mut bytes = [0; 1024];
        match client.read(&mut bytes) {
            Ok(0) => self.leave(),
            Ok(n) => self.heard.extend(&bytes[..n]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => self.leave(),
        }
        while let Some(packet) = self.packet() {
            self.carry_out(&packet, machine)?;
        }
        Ok(())
    }

    fn leave(&mut self) {
        (self.client, self.halted) = (None, false);
        self.breakpoints.clear();
    }

    /// Runs the machine to a cycle, or to a breakpoint; not at all while it is halted.
    pub fn run_until(&mut self, machine: &mut Machine, cycle: u64) -> Result<()> {
        if self.halted {
            return Ok(());
        }
        if self.breakpoints.is_empty() {
            return Ok(machine.run_until(cycle)?);
        }
        while machine.cycle() < cycle {
            machine.step(cycle)?;
            if self.breakpoints.contains(&machine.pc()) {
                self.halted = true;
                self.say(TRAPPED);
                break;
            }
        }
        Ok(())
    }

    /// Whether the debugger has halted the machine.
    pub fn is_halted(&self) -> bool {
        self.halted
    }

    /// Returns the next packet: the text between `$` and `#`, or a break. `None` if no whole packet has come.
    fn packet(&mut self) -> Option<String> {
        loop {
            let begin = self.heard.iter().position(|byte| matches!(byte, b'$' | &BREAK))?;
            self.heard.drain(..begin);
            if self.heard[0] == BREAK {
                self.heard.remove(0);
                return Some(String::from(char::from(BREAK)));
            }
            let end = self.heard.iter().position(|byte| *byte == b'#')?;
            if self.heard.len() < end + 3 {
                return None;
            }
            let packet: Vec<u8> = self.heard.drain(..end + 3).collect();
            self.write(b"+");
            if let Ok(text) = std::str::from_utf8(&packet[1..end]) {
                return Some(text.to_string());
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) {
        if let Some(client) = &mut self.client {
            // A write error is ignored. A closed connection is detected at the next read.
            let _ = client.write_all(bytes);
        }
    }

    fn say(&mut self, text: &str) {
        let sum = text.bytes().fold(0u8, u8::wrapping_add);
        self.write(format!("${text}#{sum:02x}").as_bytes());
    }

    fn carry_out(&mut self, packet: &str, machine: &mut Machine) -> Result<()> {
        let (verb, rest) = packet.split_at(1);
        let answer = match verb {
            "\x03" => {
                self.halted = true;
                TRAPPED.to_string()
            }
            "?" => TRAPPED.to_string(),
            "g" => registers(machine),
            "p" => hex(rest).map_or_else(error, |number| register(machine, number)),
            "m" => range(rest).map_or_else(error, |(from, count)| memory(machine, from, count)),
            "M" => write(machine, rest).map_or_else(error, |()| "OK".to_string()),
            "c" => {
                self.halted = false;
                return Ok(());
            }
            "s" => {
                machine.step(machine.cycle() + 1)?;
                TRAPPED.to_string()
            }
            "Z" | "z" => {
                match (rest.as_bytes().first(), range(rest.get(2..).unwrap_or_default())) {
                    (Some(b'0' | b'1'), Some((at, _))) => {
                        let set = verb == "Z";
                        if set {
                            self.breakpoints.insert(at)
                        } else {
                            self.breakpoints.remove(&at)
                        };
                        "OK".to_string()
                    }
                    // An empty answer means "not supported". GDB then steps instead of setting watchpoints.
                    _ => String::new(),
                }
            }
            "H" => "OK".to_string(),
            "D" | "k" => {
                self.say("OK");
                self.leave();
                return Ok(());
            }
            "q" if rest.starts_with("Supported") => format!("PacketSize={MOST:x}"),
            "q" if rest.starts_with("Attached") => "1".to_string(),
            // An empty answer means "not supported".
            _ => String::new(),
        };
        self.say(&answer);
        Ok(())
    }
}

fn error() -> String {
    "E01".to_string()
}

fn hex(text: &str) -> Option<u32> {
    u32::from_str_radix(text, 16).ok()
}

/// Parses an address and a length.
fn range(text: &str) -> Option<(u32, u32)> {
    let (from, count) = text.split_once(',')?;
    let count = count.split([':', ';']).next()?;
    Some((hex(from)?, hex(count)?))
}

fn digits(bytes: impl IntoIterator<Item = u8>) -> String {
    bytes.into_iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The registers R0 to R31, SREG, the stack pointer and the program counter, in GDB's order.
fn registers(machine: &Machine) -> String {
    (0..=34).map(|number| register(machine, number)).collect()
}

fn register(machine: &Machine, number: u32) -> String {
    match number {
        0..=31 => digits([machine.peek(number as u16)]),
        32 => digits([machine.sreg()]),
        33 => digits(machine.sp().to_le_bytes()),
        34 => digits(machine.pc().to_le_bytes()),
        _ => error(),
    }
}

/// Returns bytes of flash or of the data space; bytes that do not exist read as 0.
fn memory(machine: &Machine, from: u32, count: u32) -> String {
    let byte = |at: u32| match at.checked_sub(DATA) {
        Some(at) => u16::try_from(at).ok().and_then(|at| machine.data(at)).unwrap_or(0),
        None => machine.flash(at),
    };
    digits((from..from.saturating_add(count.min(MOST))).map(byte))
}

/// Writes to RAM; writes to flash are ignored.
fn write(machine: &mut Machine, text: &str) -> Option<()> {
    let ((from, count), bytes) = (range(text)?, text.split_once(':')?.1);
    for n in 0..count {
        let at = u16::try_from(from.checked_sub(DATA)? + n).ok()?;
        let at_text = 2 * n as usize;
        machine.data(at)?;
        machine.poke(at, u8::from_str_radix(bytes.get(at_text..at_text + 2)?, 16).ok()?);
    }
    Some(())
}
