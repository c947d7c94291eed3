//! The machine on the host.

use kerf::hal::imp::{Machine, gpio, pwm};

use crate::side::Side;

impl Side for Machine {
    fn send(&mut self, bytes: &[u8]) {
        Machine::send(self, bytes);
    }

    fn send_aux(&mut self, bytes: &[u8]) {
        Machine::send_aux(self, bytes);
    }

    fn set_aux_cts(&mut self, stop: bool) {
        Machine::set_aux_cts(self, stop);
    }

    fn stops_aux(&self) -> bool {
        self.aux_rts()
    }

    fn heard_aux(&mut self) -> Vec<u8> {
        self.received_aux()
    }

    fn set_baud(&mut self, baud: u32) {
        Machine::set_baud(self, baud);
    }

    fn run_ms(&mut self, ms: u64) {
        Machine::run_ms(self, ms);
    }

    fn heard(&mut self) -> Vec<u8> {
        self.received()
    }

    fn set_input(&mut self, input: usize, closed: bool) {
        Machine::set_input(self, input, closed);
    }

    fn wire(&mut self, switches: &[(usize, i64, bool)], _: u32) {
        switches.iter().for_each(|(input, step, opens)| self.set_near(*input, *step, *opens));
    }

    fn turn_spindle(&mut self, rpm: f64, pulses: u32) {
        Machine::turn_spindle(self, rpm, pulses as u16);
    }

    fn steps(&self) -> [i64; 4] {
        self.emitted().position
    }

    fn outputs(&self) -> (u8, f64) {
        (gpio::outputs(), f64::from(pwm::output().1) / 1_000.0)
    }
}
