//! Where the motors are when the axes have arrived: exact integers, from absolute positions.
//!
//! Owned by the line builder. A motor's position is its axis' position times the ratio of two integers,
//! rounded to the nearest step, half away from zero: what [`StepRatio::steps`] says. A short move starts
//! from the position before and what rounding left there, which gives the same with small numbers.

use super::divide::quotient;
use crate::config::StepRatio;
use crate::units::Length;

/// A motor at the end of the last block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Motor {
    /// Position, steps.
    pub steps: i32,
    /// `position * num - steps * den`: what rounding has taken off.
    rest: i32,
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
        Self { steps, rest: rest as i32 }
    }

    /// The motor after its axis has gone `travel` to `position`. Cost: 500 for short moves.
    pub fn moved(&self, ratio: StepRatio, travel: i32, position: Length) -> Self {
        self.near(ratio, travel, position).unwrap_or_else(|| Self::at(ratio, position))
    }

    /// As long as 32 and 16 bits will do.
    fn near(&self, ratio: StepRatio, travel: i32, position: Length) -> Option<Self> {
        let den = u16::try_from(ratio.den).ok().filter(|den| *den < 0x4000)?;
        let num = u16::try_from(ratio.num).ok()?;
        let way = u16::try_from(travel.unsigned_abs()).ok()?;
        let way = u32::from(way) * u32::from(num);
        if way >> 30 != 0 {
            return None;
        }
        let way = if travel < 0 { -(way as i32) } else { way as i32 };
        // The rest is below `den` in size.
        let sum = self.rest + way;
        let size = sum.unsigned_abs() + u32::from(den / 2);
        if (size >> 16) as u16 >= den {
            return None;
        }
        let whole = i32::from(quotient(size, den));
        let whole = if sum < 0 { -whole } else { whole };
        let mut next = Self {
            steps: self.steps.checked_add(whole)?,
            rest: sum - whole.wrapping_mul(den.into()),
        };
        // Half a step goes away from zero, not away from where it was.
        let twice = next.rest + next.rest;
        if twice == i32::from(den) && position.0 > 0 {
            next.steps += 1;
            next.rest -= i32::from(den);
        } else if -twice == i32::from(den) && position.0 < 0 {
            next.steps -= 1;
            next.rest += i32::from(den);
        }
        Some(next)
    }
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
                motor = motor.moved(ratio, travel, position);
                prop_assert_eq!(motor.steps, ratio.steps(position));
                prop_assert_eq!(motor, Motor::at(ratio, position));
            }
        }
    }
}
