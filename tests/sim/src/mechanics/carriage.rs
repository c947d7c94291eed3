//! A carriage between two hard ends.

use super::build::{Axis, Switch};

/// The position of a carriage and the switches that it works. Positions are in steps from the lower hard end.
pub struct Carriage {
    motor: usize,
    reversed: bool,
    second: Option<(usize, bool)>,
    steps_per_mm: f64,
    /// The position of the upper hard end; `None` without hard ends.
    travel: Option<i64>,
    steps: i64,
    lost: u64,
    /// For the switch at each end: the position from which on it is worked, and the position from which on it lets
    /// go.
    min: Option<(i64, i64)>,
    max: Option<(i64, i64)>,
    /// Whether the switches at the lower and the upper end are worked.
    ends: [bool; 2],
}

impl Axis {
    /// Converts a position to steps from the lower hard end.
    pub(super) fn steps(&self, position: f64) -> i64 {
        steps(position, self.steps_per_mm)
    }
}

/// Converts a length to steps.
fn steps(length: f64, steps_per_mm: f64) -> i64 {
    (length * steps_per_mm).round() as i64
}

impl Carriage {
    /// A carriage at its start.
    pub fn new(axis: &Axis) -> Self {
        let place = |switch: &Switch, sign: f64| {
            (axis.steps(switch.at), axis.steps(switch.at + sign * switch.hysteresis))
        };
        let mut carriage = Carriage {
            motor: axis.motor,
            reversed: axis.reversed,
            second: axis.second,
            steps_per_mm: axis.steps_per_mm,
            travel: axis.travel.is_finite().then(|| axis.steps(axis.travel)),
            steps: axis.steps(axis.start),
            lost: 0,
            min: axis.min.as_ref().map(|s| place(s, 1.0)),
            max: axis.max.as_ref().map(|s| place(s, -1.0)),
            ends: [false; 2],
        };
        carriage.find_ends();
        carriage
    }

    /// Returns the position in millimetres from the lower hard end.
    pub fn position(&self) -> f64 {
        self.steps as f64 / self.steps_per_mm
    }

    /// Returns the position in steps from the lower hard end.
    pub fn steps(&self) -> i64 {
        self.steps
    }

    /// Converts a position to steps from the lower hard end.
    pub fn steps_at(&self, position: f64) -> i64 {
        steps(position, self.steps_per_mm)
    }

    /// Steps that were lost at hard ends.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Whether the switches at the lower and the upper end are worked.
    pub fn ends(&self) -> [bool; 2] {
        self.ends
    }

    /// Takes a step of a motor.
    pub fn step(&mut self, motor: usize, positive: bool) {
        let reversed = match self.second {
            _ if motor == self.motor => self.reversed,
            Some((second, reversed)) if motor == second => reversed,
            _ => return,
        };
        let next = self.steps + if positive != reversed { 1 } else { -1 };
        match self.travel {
            Some(travel) if !(0..=travel).contains(&next) => self.lost += 1,
            _ => self.steps = next,
        }
        self.find_ends();
    }

    fn find_ends(&mut self) {
        let at = self.steps;
        let [min, max] = &mut self.ends;
        *min = self.min.is_some_and(|(on, off)| at <= if *min { off } else { on });
        *max = self.max.is_some_and(|(on, off)| at >= if *max { off } else { on });
    }
}
