//! What a conversation needs of a machine, on the host or on the simulated chip.
#![allow(dead_code)]

/// A machine and the sender's end of its line.
pub trait Side {
    /// Puts bytes on the line.
    fn send(&mut self, bytes: &[u8]);
    /// Puts bytes on the line of the second port.
    fn send_aux(&mut self, bytes: &[u8]);
    /// Whether it greets in TinyG's dialect; else in grbl's alone.
    fn speaks_tinyg(&self) -> bool {
        true
    }
    /// Drives the pin with which its sender holds the machine back.
    fn set_aux_cts(&mut self, stop: bool);
    /// Whether the machine stops that sender by the other pin.
    fn stops_aux(&self) -> bool;
    /// The sender's end changes its rate.
    fn set_baud(&mut self, baud: u32);
    /// Lets time pass.
    fn run_ms(&mut self, ms: u64);
    /// The bytes heard since the last call.
    fn heard(&mut self) -> Vec<u8>;
    /// The bytes heard on the second port since the last call.
    fn heard_aux(&mut self) -> Vec<u8>;
    /// The contact at an input closes or opens; see `kerf::boards::inputs`.
    fn set_input(&mut self, input: usize, closed: bool);
    /// The contact at each of these inputs is closed while the motor of its axis is at or beyond a step, or
    /// open (`true`). The encoder of the spindle gives so many pulses a turn, 0 if there is none.
    fn wire(&mut self, switches: &[(usize, i64, bool)], pulses: u32);
    /// The spindle turns at so many turns a minute, whatever its outputs say.
    fn turn_spindle(&mut self, rpm: f64, pulses: u32);
    /// Where the motors are, in steps.
    fn steps(&self) -> [i64; 4];
    /// The outputs that are on, as bits of `kerf::boards::outputs`; and what part of its period the spindle's
    /// pulse-width output is high.
    fn outputs(&self) -> (u8, f64);
}
