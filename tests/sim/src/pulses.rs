//! What the registers of a 16-bit timer say of the pulses on one of its pins (data sheet, 17.9 to 17.11).

use kerf::boards::Pwm;

use crate::machine::Machine;

/// Pulses on a pin.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pulses {
    /// How many a second; 0 for none.
    pub hertz: f64,
    /// The part of its period that the pin is high.
    pub share: f64,
}

impl Machine {
    /// The pulses that the spindle is driven by: none on a board without the output, or while the timer does not
    /// drive its pin, which is low or high then as of its port.
    pub fn pulses(&self) -> Pulses {
        let Some(pwm) = self.board().pwm else { return Pulses { hertz: 0.0, share: 0.0 } };
        let drives = self.peek(pwm.pin().port.address() as u16 - 1) >> pwm.pin().bit & 1 != 0;
        assert!(drives, "the pin of the pulses is no output");
        self.timed(pwm).unwrap_or_else(|| Pulses {
            hertz: 0.0,
            share: f64::from(u8::from(self.is_high(pwm.pin()))),
        })
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
        // Phase and frequency correct up to ICR, cleared on the way up: the only mode that is known here.
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
