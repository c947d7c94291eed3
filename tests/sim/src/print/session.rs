//! A printing host. Each line has a number and a checksum, and waits for the `ok` of the line before it.

use anyhow::{Result, bail};

use super::reading;
use crate::machine::Machine;
use crate::report::Rejected;

/// Time between two checks for an answer, ms.
const LOOK_MS: u64 = 100;

/// The host.
#[derive(Default)]
pub struct Session {
    number: i64,
    partial: Vec<u8>,
    /// Lines that have come and were not examined yet.
    heard: Vec<String>,
    answered: usize,
    rejected: Vec<Rejected>,
    /// What the firmware has said to lines that it has not refused.
    told: Vec<String>,
    strays: Vec<String>,
    starts: usize,
    late: u64,
}

/// Unsolicited lines that are no fault.
const NOTICES: [&str; 3] = ["echo:busy: processing", " T:", "{\"r\":{\"fv\":"];

/// Whether the firmware refuses a line by saying this. A print goes on after other lines that it passes over, but not
/// after a move.
fn refuses(heard: &str, line: &str) -> bool {
    heard.starts_with("Error:") || heard.starts_with("echo:") && reading::moves(line)
}

impl Session {
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of lines answered.
    pub fn answered(&self) -> usize {
        self.answered
    }

    /// Takes the lines that the firmware has refused.
    pub fn take_rejected(&mut self) -> Vec<Rejected> {
        std::mem::take(&mut self.rejected)
    }

    /// Takes what the firmware has said to lines that it has not refused, each with the number of the line.
    pub fn take_told(&mut self) -> Vec<String> {
        std::mem::take(&mut self.told)
    }

    /// Lines from the firmware that belong to no request.
    pub fn strays(&self) -> &[String] {
        &self.strays
    }

    /// How often the firmware has restarted since it was booted.
    pub fn starts(&self) -> usize {
        self.starts.saturating_sub(1)
    }

    /// How often steps came late, as the firmware reports.
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Runs until the firmware says `start`, then a little longer until the line is silent.
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

    /// Sends the number from which lines count.
    pub fn set_number(&mut self, machine: &mut Machine, timeout_ms: u64) -> Result<()> {
        self.number = 0;
        self.say(machine, 0, "M110", timeout_ms)?;
        self.answered = 0;
        // Until here the firmware has sent lines in TinyG's dialect.
        self.strays.clear();
        Ok(())
    }

    /// Sends a line, which has this number in the file, and waits for its `ok`.
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
                if heard == "ok" || heard.starts_with("ok ") {
                    self.answered += 1;
                    return Ok(());
                }
                if refuses(&heard, text) {
                    let text = format!("{text}: {heard}");
                    self.rejected.push(Rejected { line, text, status: 1 });
                } else if line > 0 {
                    self.told.push(format!("line {line}: {heard}"));
                }
            }
            if machine.cycle() >= end {
                bail!("no ok within {} s for line {line}, {text}", timeout_ms / 1_000);
            }
        }
    }

    /// Runs the machine for a time. Lines that come meanwhile are unsolicited.
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
