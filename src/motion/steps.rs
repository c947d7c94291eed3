//! Where the motors are when the axes have arrived: exact integers, from absolute positions.
//!
//! Owned by the line builder. A motor's position is its axis' position times the ratio of two integers, known to
//! 1/16 step and what is left of that. Rounded to the nearest step, half away from zero, it is what [`StepRatio::steps`] says.
//! A short move starts from the position before and what was left there, which gives the same with small numbers, in one
//! division.

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

/// No rest is known.
const NONE: u16 = u16::MAX;

/// The most parts of a short way: with what rounding adds at both ends it fits 16 bits.
const PARTS_MAX: u16 = 0x7EFF;

/// More steps than [`PARTS_MAX`] wherever the way begins.
const STEPS_MAX: u16 = (PARTS_MAX >> PARTS_LOG2) + 3;

/// A motor at the end of the last block.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    /// Position plus half a step, in steps, rounded down.
    steps: i32,
    /// What that leaves, in units of 1 / (parts * den); [`NONE`] if it does not fit.
    rest: u16,
    /// What that leaves, in parts.
    part: u8,
    /// Where blocks have taken the motor to, from half a step before `steps`, in parts.
    told: i8,
}

impl Default for Motor {
    fn default() -> Self {
        Self::counted(0)
    }
}

impl Motor {
    /// A motor whose axis is at `position`. Cost: 1,500.
    #[inline(never)]
    #[small]
    pub fn at(ratio: StepRatio, position: Length) -> Self {
        let steps = ratio.steps(position);
        // Beyond the range of steps there is no rest, and no short way from there.
        if steps.unsigned_abs() >= i32::MAX as u32 {
            return Self::counted(steps);
        }
        // Modulo 2^32, of which the result is the lesser half.
        let rest = (position.0 as u32)
            .wrapping_mul(ratio.num)
            .wrapping_sub((steps as u32).wrapping_mul(ratio.den)) as i32;
        // In 32 bits; what that takes off a large denominator is no matter, for then no rest is known.
        let octaves = if ratio.den < 1 << 26 { 0 } else { 6 };
        let (rest, den) = (rest >> octaves, ratio.den >> octaves);
        // At least 0, for the rest is half of it at most.
        let mut rest = (rest * i32::from(PARTS) + den as i32 * i32::from(HALF)) as u32;
        let mut part = 0;
        while rest >= den && part < PARTS - u8::from(octaves != 0) {
            rest -= den;
            part += 1;
        }
        let rest = if rest < 0x4000 { rest as u16 } else { NONE };
        // Half a step away from zero.
        let mut motor = Self {
            steps: steps + i32::from(part >> PARTS_LOG2),
            rest,
            part: part % PARTS,
            told: 0,
        };
        motor.told = motor.tell(position);
        motor
    }

    /// A motor that is at this step, wherever between two its axis may be.
    pub fn counted(steps: i32) -> Self {
        Self { steps, rest: NONE, part: HALF as u8, told: HALF }
    }

    /// The step that it is at, rounded.
    pub fn steps(&self) -> i32 {
        self.steps.wrapping_add((self.told >> PARTS_LOG2).into())
    }

    /// The axis' position is called `position` from now on. The motor does not move.
    #[small]
    pub fn rename(&mut self, ratio: StepRatio, position: Length) {
        let fraction = self.told & (PARTS as i8 - 1);
        *self = Self::at(ratio, position);
        self.told = (self.told & !(PARTS as i8 - 1)) + fraction;
    }

    /// Moves the axis by `travel` to `position`. The way of the motor, in parts of a step; `None`, and nothing done, if that does not fit.
    /// Cost: 400 for short moves.
    #[inline(never)]
    pub fn go(&mut self, ratio: StepRatio, travel: i32, position: Length) -> Option<i16> {
        if let Some(way) = self.go_near(ratio, travel, position) {
            return Some(way);
        }
        self.go_far(ratio, travel, position)
    }

    /// Moves the axis where 32 and 16 bits are enough for the arithmetic; `None`, and nothing done, otherwise.
    #[inline(always)]
    fn go_near(&mut self, ratio: StepRatio, travel: i32, position: Length) -> Option<i16> {
        let way = travel.unsigned_abs();
        let (num, den, rest) = (ratio.num as u16, ratio.den as u16, self.rest);
        if (ratio.num | ratio.den | way) >> 16 != 0 || den >= 0x4000 || rest >= den {
            return None;
        }
        let way = product(way as u16, num);
        // So that the sum is below 2^31.
        if (way >> 24) as u8 >= 4 {
            return None;
        }
        // Rounded down, so up if it goes back.
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

    /// Moves the axis as [`Motor::go`] does, for ways of any size. Cost: 2,000; 300 if it is too far by more than rounding.
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

    /// Takes back a way in parts, the one gone last, to `position`.
    #[inline(never)]
    #[small]
    pub fn put_back(&mut self, ratio: StepRatio, position: Length, way: i16) {
        let (steps, told) = (self.steps, self.told);
        *self = Self::at(ratio, position);
        let parts = steps.wrapping_sub(self.steps).wrapping_mul(PARTS.into());
        self.told = parts.wrapping_add(i32::from(told) - i32::from(way)) as i8;
    }

    /// Where blocks are to take it to: where it is, but so far from half a step that rounding cannot tell of another one.
    #[inline(always)]
    fn tell(&self, position: Length) -> i8 {
        const LEAST: u8 = (FRACTIONS.0 + HALF) as u8;
        const MOST: u8 = (FRACTIONS.1 + HALF) as u8;
        match self.part {
            // Half a step goes away from zero.
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
                // Rounded down but where it is nearly half a step; beyond the range there is none.
                let near = (-0.0626..0.1251).contains(&off) || exact.abs() > 2e9;
                prop_assert!(near, "{off} steps off");
            }
        }
    }
}
