//! The interface of a board, simulated or emulated, to a sender.

use anyhow::Result;

use crate::machine::Machine;

/// A board that runs, and the sender's end of its serial line.
pub trait Runs {
    /// The current time, in cycles of its clock.
    fn cycle(&self) -> u64;
    /// Cycles in so many milliseconds.
    fn cycles(&self, ms: u64) -> u64;
    /// Runs to a cycle, or to the end of the next line that the firmware sends.
    fn run_until_line(&mut self, cycle: u64) -> Result<()>;
    /// Queues bytes on the line.
    fn send(&mut self, bytes: &[u8]);
    /// Queues a byte ahead of the bytes that still wait.
    fn send_now(&mut self, byte: u8);
    /// Takes the bytes that the firmware has sent.
    fn receive(&mut self) -> Vec<u8>;
    /// Changes the speed of the sender's side.
    fn set_baud(&mut self, baud: u32);
    /// Number of bytes that came at another speed than the sender's.
    fn garbled(&self) -> u64;
    /// The cycle of the last step, if there was one.
    fn last_step(&self) -> Option<u64>;
    /// Lets what is driven by the pulses of a timer follow them, if there is such a thing.
    fn follow_pulses(&mut self) {}
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

    fn follow_pulses(&mut self) {
        Machine::follow_pulses(self);
    }
}
