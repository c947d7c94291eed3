//! A printing host: each line has a number and a checksum, and waits for the `ok` of the line before.

use anyhow::{Result, bail};

use crate::machine::Machine;
use crate::report::Rejected;

/// Time between two looks for an answer, ms.
const LOOK_MS: u64 = 100;

/// The host.
#[derive(Default)]
pub struct Session {
    number: i64,
    partial: Vec<u8>,
    /// Lines that came and were not looked at.
    heard: Vec<String>,
    answered: usize,
    rejected: Vec<Rejected>,
    strays: Vec<String>,
    starts: usize,
    late: u64,
}

/// What comes unasked and is no fault.
const NOTICES: [&str; 3] = ["echo:busy: processing", " T:", "{\"r\":{\"fv\":"];

impl Session {
    pub fn new() -> Self {
        Self::default()
    }

    /// Lines answered.
    pub fn answered(&self) -> usize {
        self.answered
    }

    /// Lines that were not carried out.
    pub fn take_rejected(&mut self) -> Vec<Rejected> {
        std::mem::take(&mut self.rejected)
    }

    /// Lines that no line has asked for.
    pub fn strays(&self) -> &[String] {
        &self.strays
    }

    /// How often the firmware has started since it was booted.
    pub fn starts(&self) -> usize {
        self.starts.saturating_sub(1)
    }

    /// How often steps came late, as the firmware tells.
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Runs until the firmware says `start`, then a little for the line to fall silent.
    pub fn boot(&mut self, machine: &mut Machine, timeout_ms: u64) -> Result<()> {
        let end = machine.cycle() + machine.cycles(timeout_ms);
        while self.starts == 0 {
            if machine.cycle() >= end {
                bail!("no start within {timeout_ms} ms of reset");
            }
            self.run_for_ms(machine, LOOK_MS)?;
        }
        self.run_for_ms(machine, LOOK_MS)
    }

    /// Tells the number that lines count from.
    pub fn set_number(&mut self, machine: &mut Machine, timeout_ms: u64) -> Result<()> {
        self.number = 0;
        self.say(machine, 0, "M110", timeout_ms)?;
        self.answered = 0;
        // The port has been told in TinyG's dialect until here.
        self.strays.clear();
        Ok(())
    }

    /// Says a line, that of this number in the file, and waits for its `ok`.
    pub fn say(
        &mut self,
        machine: &mut Machine,
        line: usize,
        text: &str,
        timeout_ms: u64,
    ) -> Result<()> {
        let framed = format!("N{} {text}", self.number);
        let sum = framed.bytes().fold(0, |sum, byte| sum ^ byte);
        machine.send(format!("{framed}*{sum}\n").as_bytes());
        self.number += 1;
        let end = machine.cycle() + machine.cycles(timeout_ms);
        loop {
            machine.run_until_line(end)?;
            self.listen(machine);
            for heard in std::mem::take(&mut self.heard) {
                if heard == "ok" {
                    self.answered += 1;
                    return Ok(());
                }
                self.rejected.push(Rejected { line, text: format!("{text}: {heard}"), status: 1 });
            }
            if machine.cycle() >= end {
                bail!("no ok within {} s for line {line}, {text}", timeout_ms / 1_000);
            }
        }
    }

    /// Runs the machine for a time. What it tells meanwhile was not asked for.
    pub fn run_for_ms(&mut self, machine: &mut Machine, ms: u64) -> Result<()> {
        machine.run_for_ms(ms)?;
        self.listen(machine);
        self.strays.append(&mut self.heard);
        Ok(())
    }

    fn listen(&mut self, machine: &mut Machine) {
        for byte in machine.receive() {
            if byte != b'\n' {
                self.partial.push(byte);
                continue;
            }
            let line = String::from_utf8_lossy(&std::mem::take(&mut self.partial)).into_owned();
            self.hear(line);
        }
    }

    fn hear(&mut self, line: String) {
        match line.trim_end() {
            "start" => self.starts += 1,
            "echo:steps came late" => self.late += 1,
            line if NOTICES.iter().any(|notice| line.starts_with(notice)) => {}
            _ => self.heard.push(line),
        }
    }
}
