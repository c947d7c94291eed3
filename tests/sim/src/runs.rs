//! What a sender needs of a board, simulated or emulated.

use anyhow::Result;

use crate::machine::Machine;

/// A board that runs, and the sender's end of its line.
pub trait Runs {
    /// Its time, in cycles of its clock.
    fn cycle(&self) -> u64;
    /// Cycles in so many milliseconds.
    fn cycles(&self, ms: u64) -> u64;
    /// Runs to a cycle, or to the end of the next line that it says.
    fn run_until_line(&mut self, cycle: u64) -> Result<()>;
    /// Puts bytes on the line.
    fn send(&mut self, bytes: &[u8]);
    /// Puts a byte on the line ahead of those that wait.
    fn send_now(&mut self, byte: u8);
    /// Takes what it has said.
    fn receive(&mut self) -> Vec<u8>;
    /// The sender goes on at this rate.
    fn set_baud(&mut self, baud: u32);
    /// Bytes that came at another rate than the sender's.
    fn garbled(&self) -> u64;
    /// The cycle of the last step, if there was one.
    fn last_step(&self) -> Option<u64>;
}

impl Runs for Machine {
    fn cycle(&self) -> u64 {
        Machine::cycle(self)
    }

    fn cycles(&self, ms: u64) -> u64 {
        Machine::cycles(self, ms)
    }

    fn run_until_line(&mut self, cycle: u64) -> Result<()> {
        Ok(Machine::run_until_line(self, cycle)?)
    }

    fn send(&mut self, bytes: &[u8]) {
        Machine::send(self, bytes);
    }

    fn send_now(&mut self, byte: u8) {
        Machine::send_now(self, byte);
    }

    fn receive(&mut self) -> Vec<u8> {
        Machine::receive(self)
    }

    fn set_baud(&mut self, baud: u32) {
        Machine::set_baud(self, baud);
    }

    fn garbled(&self) -> u64 {
        self.wire().garbled()
    }

    fn last_step(&self) -> Option<u64> {
        self.recorder().last_step()
    }
}
