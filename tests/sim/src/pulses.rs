//! The pulses on a timer's pin, computed from the registers of the timer (data sheet, 17.9 to 17.11).

use kerf::boards::{Pin, Pwm};

use crate::machine::Machine;

/// The first register of timer 2.
const TCCR2A: u16 = 0xB0;

/// Pulses on a pin.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pulses {
    /// Pulses in a second; 0 for none.
    pub hertz: f64,
    /// Duty cycle: the share of its period in which the pin is high.
    pub share: f64,
}

impl Machine {
    /// Returns the pulses that drive the spindle. There are none on a board without the output, nor while the timer
    /// does not drive its pin. The pin then has the level of its port.
    pub fn pulses(&self) -> Pulses {
        let Some(pwm) = self.board().pwm else { return Pulses { hertz: 0.0, share: 0.0 } };
        let drives = self.peek(pwm.pin().port.address() as u16 - 1) >> pwm.pin().bit & 1 != 0;
        assert!(drives, "the pin of the pulses is no output");
        self.timed(pwm).unwrap_or_else(|| Pulses {
            hertz: 0.0,
            share: f64::from(u8::from(self.is_high(pwm.pin()))),
        })
    }

    /// Returns the share of time that an output is high: the duty cycle of timer 2 while the timer drives the pin,
    /// else 0 or 1 from the port.
    pub fn power_at(&self, pin: Pin) -> f64 {
        let is_output = self.peek(pin.port.address() as u16 - 1) >> pin.bit & 1 != 0;
        let (a, b) = (self.peek(TCCR2A), self.peek(TCCR2A + 1));
        let connection = pin.channel().map_or(0, |channel| a >> (6 - 2 * channel) & 3);
        if !is_output || connection == 0 {
            return f64::from(u8::from(is_output && self.is_high(pin)));
        }
        // Counts up to 255 and down again, clears on the way up, and runs: the only mode that is supported here.
        assert_eq!((a & 3, connection), (1, 0b10), "TCCR2A {a:#x}");
        assert!(b & 7 != 0 && b & 8 == 0, "TCCR2B {b:#x}");
        let compare = self.peek(TCCR2A + 3 + u16::from(pin.channel().unwrap_or(0)));
        f64::from(compare) / 255.0
    }

    fn timed(&self, pwm: Pwm) -> Option<Pulses> {
        let base = pwm.address() as u16;
        let (a, b) = (self.peek(base), self.peek(base + 1));
        let (top, compare) = (base + 6, base + 8 + 2 * u16::from(pwm.channel));
        let (top, compare) = (self.peek_word(top), self.peek_word(compare));
        let clock = [0, 1, 8, 64, 256, 1_024].get(usize::from(b & 7)).copied()?;
        let connection = a >> (6 - 2 * pwm.channel) & 3;
        if clock == 0 || connection == 0 {
            return None;
        }
        // Phase and frequency correct up to ICR, cleared on the way up: the only mode that is supported here.
        assert_eq!(
            (a & 3, b >> 3 & 3, connection),
            (0, 0b10, 0b10),
            "TCCRnA {a:#x}, TCCRnB {b:#x}"
        );
        let counts = 2.0 * f64::from(top) * f64::from(clock);
        let hertz = f64::from(self.board().clock_hz) / counts;
        Some(Pulses { hertz, share: (f64::from(compare) / f64::from(top)).min(1.0) })
    }
}
