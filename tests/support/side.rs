//! What a conversation needs of a machine, on the host or on the simulated chip.
#![allow(dead_code)]

/// A machine, and the sender's end of its line.
pub trait Side {
    /// Puts bytes on the line.
    fn send(&mut self, bytes: &[u8]);
    /// Puts bytes on the line of the second port.
    fn send_aux(&mut self, bytes: &[u8]);
    /// Returns the first of its dialects, whose greeting comes last: `dialect-tinyg`, `dialect-grbl` or
    /// `dialect-reprap`.
    fn first_dialect(&self) -> &'static str {
        "dialect-tinyg"
    }
    /// Drives the pin with which the second port's sender holds the machine back.
    fn set_aux_cts(&mut self, stop: bool);
    /// Whether the machine stops the second port's sender by its own pin.
    fn stops_aux(&self) -> bool;
    /// Changes the rate of the sender's end.
    fn set_baud(&mut self, baud: u32);
    /// Lets time pass.
    fn run_ms(&mut self, ms: u64);
    /// The bytes heard since the last call.
    fn heard(&mut self) -> Vec<u8>;
    /// The bytes heard on the second port since the last call.
    fn heard_aux(&mut self) -> Vec<u8>;
    /// Closes or opens the contact at an input; see `kerf::boards::inputs`.
    fn set_input(&mut self, input: usize, closed: bool);
    /// Wires switches and the spindle's encoder. The contact at each of these inputs is closed while the motor of its
    /// axis is at or beyond a step; if the last field is `true` it is open there. The encoder of the spindle gives
    /// `pulses` pulses a turn, 0 for no encoder.
    fn wire(&mut self, switches: &[(usize, i64, bool)], pulses: u32);
    /// Turns the spindle at `rpm` turns a minute, whatever its outputs say.
    fn turn_spindle(&mut self, rpm: f64, pulses: u32);
    /// Returns the positions of the motors, in steps.
    fn steps(&self) -> [i64; 4];
    /// Returns the outputs that are on, as bits of `kerf::boards::outputs`, and the duty cycle of the spindle's
    /// pulse-width output.
    fn outputs(&self) -> (u8, f64);
}
