//! Motors that move less far than the dominant one: their increments and rounding errors.

use super::super::divide::{quotient, quotient_remainder};
use crate::dda::STEP;
use crate::hal::arithmetic::product;

/// A motor that moves but does not step on every tick of the dominant one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Minor {
    /// The distance of the motor in the block, in parts of a step or in whole steps.
    pub way: u16,
    /// Travel in a tick, rounded down; `remainder` is the rounding error, in 1 / most.
    pub increment: u16,
    pub remainder: u16,
    /// The distance in the line less that in segments so far, in phase units / most.
    pub owed: i32,
}

impl Minor {
    /// Whether the motor has no distance to go, and owes nothing.
    pub(super) fn stands(&self) -> bool {
        self.way == 0 && self.owed == 0
    }

    /// Returns the increment for the next `ticks`, and updates `owed`.
    pub(super) fn advance(&mut self, ticks: u16, most: u16) -> u16 {
        let unit = product(ticks, most);
        let half = (unit / 2) as i32;
        let mut owed = self.owed + product(ticks, self.remainder) as i32;
        let mut increment = self.increment;
        if owed > half {
            let more = if owed - (unit as i32) <= half { 1 } else { rounded(owed as u32, unit) };
            let more = more.min(STEP - increment);
            increment += more;
            owed -= product_wide(unit, more);
        } else if owed < -half {
            let less =
                if owed + (unit as i32) >= -half { 1 } else { rounded(owed.unsigned_abs(), unit) };
            let less = less.min(increment);
            increment -= less;
            owed += product_wide(unit, less);
        }
        self.owed = owed;
        increment
    }
}

/// Returns `way * step / most`, rounded down, and the remainder.
#[inline(never)]
pub(super) fn share(way: u16, step: u16, most: u16) -> (u16, u16) {
    quotient_remainder(product(way, step), most)
}

/// Returns `way * step / most`, rounded to the nearest.
#[inline(never)]
pub(super) fn even(way: u16, step: u16, most: u16) -> u16 {
    quotient(product(way, step) + u32::from(most / 2), most)
}

/// Returns `owed / unit`, rounded. Needed only when a debt coincides with a short segment.
#[inline(never)]
fn rounded(owed: u32, unit: u32) -> u16 {
    ((owed + unit / 2) / unit) as u16
}

fn product_wide(unit: u32, times: u16) -> i32 {
    match times {
        0 => 0,
        1 => unit as i32,
        _ => (unit * u32::from(times)) as i32,
    }
}
