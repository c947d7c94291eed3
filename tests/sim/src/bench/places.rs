//! The position of a motor over time, computed from its steps.

use crate::machine::Machine;

/// The times of a motor's steps, s, each with the motor's position at that time, mm.
pub struct Places(Vec<(f64, f64)>);

impl Places {
    /// Takes all steps in the log. A step comes when the motor is in the middle between two full positions.
    pub fn of(machine: &Machine, motor: u8, per_mm: f64) -> Self {
        let clock = f64::from(machine.board().clock_hz);
        let mut place = 0.0;
        let steps = machine.recorder().log().iter().filter(|s| s.motor == motor).map(|s| {
            place += if s.positive { 1.0 } else { -1.0 };
            let middle = place - if s.positive { 0.5 } else { -0.5 };
            (s.cycle as f64 / clock, middle / per_mm)
        });
        Self(steps.collect())
    }

    /// Time of the first step and of the last, s. `None` if there are no steps.
    pub fn span(&self) -> Option<(f64, f64)> {
        self.0.first().zip(self.0.last()).map(|(first, last)| (first.0, last.0))
    }

    /// Returns the position at a time, s, interpolated between two steps. There must be at least two steps.
    pub fn at(&self, t: f64) -> f64 {
        let next = self.0.partition_point(|(s, _)| *s < t).clamp(1, self.0.len() - 1);
        let ((a, x), (b, y)) = (self.0[next - 1], self.0[next]);
        x + (y - x) * ((t - a) / (b - a)).clamp(0.0, 1.0)
    }

    /// Returns the positions at intervals of so many seconds within a span.
    pub fn every(&self, seconds: f64, (from, to): (f64, f64)) -> Vec<f64> {
        let count = ((to - from) / seconds) as usize;
        (0..count).map(|n| self.at(from + n as f64 * seconds)).collect()
    }
}
