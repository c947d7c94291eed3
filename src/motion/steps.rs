//! Where the motors are when the axes have arrived: exact integers, from absolute positions.
//!
//! Owned by the line builder. A motor's position is its axis' position times the ratio of two integers,
//! rounded to the nearest step, half away from zero: what [`StepRatio::steps`] says. A short move starts
//! from the position before and what rounding left there, which gives the same with small numbers.

use kerf_macros::small;

use super::block::{FRACTIONS, PARTS_LOG2};
use super::divide::{product, quotient_remainder};
use crate::config::StepRatio;
use crate::units::Length;

/// A motor at the end of the last block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Motor {
    /// Position, steps.
    pub steps: i32,
    /// `position * num - steps * den`: what rounding has taken off.
    rest: i32,
    /// That, in parts of a step ([`PARTS_LOG2`]), rounded down, within [`FRACTIONS`].
    pub fraction: i8,
}

impl Motor {
    /// A motor whose axis is at `position`. Cost: 1,000 to 5,000.
    #[inline(never)]
    pub fn at(ratio: StepRatio, position: Length) -> Self {
        let steps = ratio.steps(position);
        // Modulo 2^32, of which the result is the lesser half.
        let rest = (position.0 as u32)
            .wrapping_mul(ratio.num)
            .wrapping_sub((steps as u32).wrapping_mul(ratio.den));
        // Beyond the range of steps there is no rest, and no short way from there.
        let saturated = steps.unsigned_abs() >= i32::MAX as u32;
        if saturated {
            return Self::counted(steps);
        }
        let rest = rest as i32;
        Self { steps, rest, fraction: fraction(rest, ratio.den) }
    }

    /// A motor that is at this step, wherever between two its axis may be.
    pub fn counted(steps: i32) -> Self {
        Self { steps, rest: i32::MIN, fraction: 0 }
    }

    /// Its axis has gone `travel` to `position`. Cost: 400 for short moves.
    #[inline(never)]
    pub fn go(&mut self, ratio: StepRatio, travel: i32, position: Length) {
        if !self.go_near(ratio, travel, position) {
            *self = Self::at(ratio, position);
        }
    }

    /// As long as 32 and 16 bits will do; false, and nothing done, otherwise.
    #[inline(always)]
    fn go_near(&mut self, ratio: StepRatio, travel: i32, position: Length) -> bool {
        let way = travel.unsigned_abs();
        let (num, den, rest) = (ratio.num as u16, ratio.den as u16, self.rest as i16);
        if (ratio.num | ratio.den | way) >> 16 != 0 || i32::from(rest) != self.rest {
            return false;
        }
        if den >= 0x4000 || rest.unsigned_abs() >= den {
            return false;
        }
        // As if it went forward. With half a step for rounding, and one so that it is positive.
        let back = travel < 0;
        let half = den / 2;
        let more = (den + half).wrapping_add_signed(if back { -rest } else { rest });
        let sum = product(way as u16, num) + u32::from(more);
        if (sum >> 16) as u16 >= den {
            return false;
        }
        let (whole, over) = quotient_remainder(sum, den);
        let mut steps = i32::from(whole) - 1;
        let mut rest = over as i16 - half as i16;
        // Half a step goes away from zero, not to where it goes.
        if over == 0 && den & 1 == 0 && (position.0 < 0) != back {
            steps -= 1;
            rest = half as i16;
        }
        if back {
            (steps, rest) = (-steps, -rest);
        }
        self.steps = self.steps.wrapping_add(steps);
        self.rest = rest.into();
        self.fraction = fraction_near(self.rest as i16, den);
        true
    }
}

/// The same for a denominator below 2^14. Cost: 80.
#[inline(never)]
#[small]
fn fraction_near(rest: i16, den: u16) -> i8 {
    let mut over = if rest < 0 { rest.wrapping_add_unsigned(den) } else { rest } as u16;
    let mut parts = if rest < 0 { -1 } else { 0 };
    for _ in 0..PARTS_LOG2 {
        over = over.wrapping_mul(2);
        parts *= 2;
        if over >= den {
            over = over.wrapping_sub(den);
            parts += 1;
        }
    }
    parts.clamp(FRACTIONS.0, FRACTIONS.1)
}

/// `rest / den`, at most half, in parts of a step. Cost: 200.
#[inline(never)]
#[small]
fn fraction(rest: i32, den: u32) -> i8 {
    // From the step before, so that it is positive.
    let mut over = if rest < 0 { rest.wrapping_add_unsigned(den) } else { rest } as u32;
    let mut parts = if rest < 0 { -1 } else { 0 };
    for _ in 0..PARTS_LOG2 {
        over = over.wrapping_mul(2);
        parts *= 2;
        if over >= den {
            over = over.wrapping_sub(den);
            parts += 1;
        }
    }
    parts.clamp(FRACTIONS.0, FRACTIONS.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn is_the_absolute_position(
            num in 0u32..5_000, den in 1u32..5_000, start in -3_000_000..3_000_000i32,
            moves in prop::collection::vec(-70_000..70_000i32, 1..50),
        ) {
            let ratio = StepRatio { num, den };
            let mut position = Length(start);
            let mut motor = Motor::at(ratio, position);
            for travel in moves {
                position.0 += travel;
                motor.go(ratio, travel, position);
                prop_assert_eq!(motor.steps, ratio.steps(position));
                prop_assert_eq!(motor, Motor::at(ratio, position));
                let exact = f64::from(position.0) * f64::from(num) / f64::from(den);
                let off = exact - f64::from(motor.steps) - f64::from(motor.fraction) / 16.0;
                // Rounded down but where it is nearly half a step; beyond the range there is none.
                let near = (-0.0626..0.1251).contains(&off) || exact.abs() > 2e9;
                prop_assert!(near, "{off} steps off");
            }
        }
    }
}
