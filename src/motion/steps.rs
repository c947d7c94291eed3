//! Motor positions at the end of a block: exact integers, from absolute positions of the axes.
//!
//! Owned by the line builder. A motor's position is the position of its axis times the ratio of two integers. It is
//! stored to 1/16 step, with the exact remainder below that. Rounded to the nearest step, half away from zero, it is
//! equal to [`StepRatio::steps`]. A short move starts from the last position and its remainder. The result is exact
//! too, and takes only small numbers and a single division.

use kerf_macros::small;

use super::block::{FRACTIONS, PARTS_LOG2};
use super::divide::quotient_remainder;
use crate::config::StepRatio;
use crate::hal::arithmetic::product;
use crate::units::Length;

/// Parts of a step.
const PARTS: u8 = 1 << PARTS_LOG2;

/// Half a step, in parts.
const HALF: i8 = PARTS as i8 / 2;

/// The remainder is not known.
const NONE: u16 = u16::MAX;

/// The most parts of a short distance: with the rounding at both ends, the distance fits 16 bits.
const PARTS_MAX: u16 = 0x7EFF;

/// A number of steps that is more than [`PARTS_MAX`], whatever the fraction at the start.
const STEPS_MAX: u16 = (PARTS_MAX >> PARTS_LOG2) + 3;

/// A motor at the end of the last block.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    /// Position plus half a step, in steps, rounded down.
    steps: i32,
    /// The remainder below `part`, in units of 1 / (parts * den); [`NONE`] if it does not fit.
    rest: u16,
    /// The remainder below `steps`, in parts, rounded down.
    part: u8,
    /// The position to which blocks have moved the motor, in parts, measured from half a step before `steps`.
    told: i8,
}

impl Default for Motor {
    fn default() -> Self {
        Self::counted(0)
    }
}

impl Motor {
    /// Returns a motor whose axis is at `position`. Cost: 1,500.
    #[inline(never)]
    #[small]
    pub fn at(ratio: StepRatio, position: Length) -> Self {
        let steps = ratio.steps(position);
        // Beyond the range of steps no remainder is known, and no short distance starts there.
        if steps.unsigned_abs() >= i32::MAX as u32 {
            return Self::counted(steps);
        }
        // Modulo 2^32: the result fits an `i32`.
        let rest = (position.0 as u32)
            .wrapping_mul(ratio.num)
            .wrapping_sub((steps as u32).wrapping_mul(ratio.den)) as i32;
        // In 32 bits. The bits lost from a large denominator do not matter, because no remainder is known then.
        let octaves = if ratio.den < 1 << 26 { 0 } else { 6 };
        let (rest, den) = (rest >> octaves, ratio.den >> octaves);
        // At least 0: the remainder is at most half of the denominator.
        let mut rest = (rest * i32::from(PARTS) + den as i32 * i32::from(HALF)) as u32;
        let mut part = 0;
        while rest >= den && part < PARTS - u8::from(octaves != 0) {
            rest -= den;
            part += 1;
        }
        let rest = if rest < 0x4000 { rest as u16 } else { NONE };
        // `part` is a whole step where half a step has been rounded away from zero.
        let mut motor = Self {
            steps: steps + i32::from(part >> PARTS_LOG2),
            rest,
            part: part % PARTS,
            told: 0,
        };
        motor.told = motor.tell(position);
        motor
    }

    /// Returns a motor at this step; its axis may be between two steps.
    pub fn counted(steps: i32) -> Self {
        Self { steps, rest: NONE, part: HALF as u8, told: HALF }
    }

    /// The step at which the motor is, rounded.
    pub fn steps(&self) -> i32 {
        self.steps.wrapping_add((self.told >> PARTS_LOG2).into())
    }

    /// Redefines the axis' position as `position`. The motor does not move.
    #[small]
    pub fn rename(&mut self, ratio: StepRatio, position: Length) {
        let fraction = self.told & (PARTS as i8 - 1);
        *self = Self::at(ratio, position);
        self.told = (self.told & !(PARTS as i8 - 1)) + fraction;
    }

    /// Moves the axis by `travel` to `position`. Returns the distance of the motor in parts of a step, or `None`, with
    /// nothing done, if it does not fit. Cost: 400 for short moves.
    #[inline(never)]
    pub fn go(&mut self, ratio: StepRatio, travel: i32, position: Length) -> Option<i16> {
        if let Some(way) = self.go_near(ratio, travel, position) {
            return Some(way);
        }
        self.go_far(ratio, travel, position)
    }

    /// Moves the axis where 32 and 16 bits are enough for the arithmetic. Returns `None`, with nothing done,
    /// otherwise.
    #[inline(always)]
    fn go_near(&mut self, ratio: StepRatio, travel: i32, position: Length) -> Option<i16> {
        let way = travel.unsigned_abs();
        let (num, den, rest) = (ratio.num as u16, ratio.den as u16, self.rest);
        if (ratio.num | ratio.den | way) >> 16 != 0 || den >= 0x4000 || rest >= den {
            return None;
        }
        let way = product(way as u16, num);
        // Keeps the sum below 2^31.
        if (way >> 24) as u8 >= 4 {
            return None;
        }
        // Positions are rounded down, so a negative distance is rounded up.
        let back = travel < 0;
        let more = if back { den - 1 - rest } else { rest };
        let sum = (way << PARTS_LOG2) + u32::from(more);
        if (sum >> 16) as u16 >= den {
            return None;
        }
        let (parts, over) = quotient_remainder(sum, den);
        if parts > PARTS_MAX {
            return None;
        }
        let from = i16::from(self.part);
        let to = if back { from - parts as i16 } else { from + parts as i16 };
        self.rest = if back { den - 1 - over } else { over };
        self.part = to as u8 % PARTS;
        self.steps = self.steps.wrapping_add((to >> PARTS_LOG2).into());
        let told = self.tell(position);
        let before = core::mem::replace(&mut self.told, told);
        Some((to & !(i16::from(PARTS) - 1)) + i16::from(told) - i16::from(before))
    }

    /// Moves the axis as [`Motor::go`] does, for distances of any size. Cost: 2,000; 300 if the distance is too long by
    /// more than rounding.
    #[inline(never)]
    #[small]
    fn go_far(&mut self, ratio: StepRatio, travel: i32, position: Length) -> Option<i16> {
        let way = u64::from(travel.unsigned_abs()) * u64::from(ratio.num);
        if way > u64::from(ratio.den) * u64::from(STEPS_MAX) {
            return None;
        }
        let to = Self::at(ratio, position);
        let steps = to.steps.checked_sub(self.steps)?;
        let way = steps.checked_mul(PARTS.into())? + i32::from(to.told) - i32::from(self.told);
        if way.unsigned_abs() > u32::from(PARTS_MAX) {
            return None;
        }
        *self = to;
        Some(way as i16)
    }

    /// Moves the axis to `position` in whole steps, and returns how many.
    #[inline(never)]
    #[small]
    pub fn stride(&mut self, ratio: StepRatio, position: Length) -> i64 {
        let from = self.steps();
        let fraction = self.told;
        *self = Self::at(ratio, position);
        let to = self.steps();
        self.told = (self.told & !(PARTS as i8 - 1)) + (fraction & (PARTS as i8 - 1));
        i64::from(to) - i64::from(from)
    }

    /// Undoes the last move of `way` parts, so that the axis is at `position` again.
    #[inline(never)]
    #[small]
    pub fn put_back(&mut self, ratio: StepRatio, position: Length, way: i16) {
        let (steps, told) = (self.steps, self.told);
        *self = Self::at(ratio, position);
        let parts = steps.wrapping_sub(self.steps).wrapping_mul(PARTS.into());
        self.told = parts.wrapping_add(i32::from(told) - i32::from(way)) as i8;
    }

    /// Returns the position, in parts, to which blocks move the motor: the exact one, kept so far from half a step that
    /// rounding errors cannot lead to another step.
    #[inline(always)]
    fn tell(&self, position: Length) -> i8 {
        const LEAST: u8 = (FRACTIONS.0 + HALF) as u8;
        const MOST: u8 = (FRACTIONS.1 + HALF) as u8;
        match self.part {
            // Half a step is rounded away from zero.
            0 if self.rest == 0 && position.0 < 0 => MOST as i8 - PARTS as i8,
            part => part.clamp(LEAST, MOST) as i8,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(motor: &Motor) -> (i32, u16, u8, i8) {
        (motor.steps, motor.rest, motor.part, motor.told)
    }

    proptest! {
        #[test]
        fn is_the_absolute_position(
            num in 0u32..5_000, den in 1u32..5_000, start in -3_000_000..3_000_000i32,
            moves in prop::collection::vec(-70_000..70_000i32, 1..50),
        ) {
            let ratio = StepRatio { num, den };
            let mut position = Length(start);
            let mut motor = Motor::at(ratio, position);
            let mut place = i64::from(motor.steps) * 16 + i64::from(motor.told) - 8;
            for travel in moves {
                position.0 += travel;
                let before = motor;
                match motor.go(ratio, travel, position) {
                    Some(way) => {
                        place += i64::from(way);
                        let mut back = motor;
                        back.put_back(ratio, Length(position.0 - travel), way);
                        prop_assert_eq!(of(&back), of(&before));
                    }
                    None => {
                        prop_assert_eq!(of(&motor), of(&before));
                        place += 16 * motor.stride(ratio, position);
                    }
                }
                prop_assert_eq!(motor.steps(), ratio.steps(position));
                prop_assert_eq!((place + 8).div_euclid(16), i64::from(motor.steps()));
                let fresh = Motor::at(ratio, position);
                let told = of(&motor).3;
                prop_assert_eq!(of(&motor), (fresh.steps, fresh.rest, fresh.part, told));
                let exact = f64::from(position.0) * f64::from(num) / f64::from(den);
                let off = exact - f64::from(fresh.steps) - f64::from(fresh.told - 8) / 16.0;
                // Rounded down, except near half a step. Beyond the range of steps nothing is checked.
                let near = (-0.0626..0.1251).contains(&off) || exact.abs() > 2e9;
                prop_assert!(near, "{off} steps off");
            }
        }
    }
}
