//! Exact conversion between lengths and steps of a motor.
//!
//! Source of the method: continued fractions. The convergents of the steps per unit end in the reduced fraction. The
//! last convergent that fits 32 bits is the best approximation that does. It is within half a step over the whole
//! range of a [`Length`].

use kerf_macros::small;

use crate::hal::arithmetic;
use crate::units::Length;

/// Steps per unit of [`Length`], as the fraction `num` / `den`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StepRatio {
    /// The steps of a length of `den` units.
    pub num: u32,
    /// The length in units of 0.0001 mm; never 0.
    pub den: u32,
}

impl StepRatio {
    /// The ratio of a motor that never steps.
    pub const NONE: StepRatio = StepRatio { num: 0, den: 1 };

    /// Returns the ratio of a motor with `angle` (0.0001 degree a full step), `travel` (0.000001 mm a turn) and
    /// `microsteps`: 360 * microsteps / (angle * travel). About 20,000 cycles on AVR.
    pub fn new(angle: i32, travel: i32, microsteps: u8) -> StepRatio {
        let (Ok(angle), Ok(travel)) = (u32::try_from(angle), u32::try_from(travel)) else {
            return StepRatio::NONE;
        };
        // 360 degrees over 1e-4 * 1e-6 are 3.6e12 steps a mm, and 1e4 units are a mm.
        let steps = 360_000_000 * u64::from(microsteps);
        StepRatio::nearest(steps, u64::from(angle) * u64::from(travel))
    }

    fn nearest(mut steps: u64, mut units: u64) -> StepRatio {
        if units == 0 {
            return StepRatio::NONE;
        }
        let (mut last, mut this) = (StepRatio { num: 0, den: 1 }, (1u32, 0u32));
        while units != 0 {
            let whole = u32::try_from(steps / units);
            let next = |this: u32, last: u32| {
                whole.ok().and_then(|w| this.checked_mul(w)).and_then(|v| v.checked_add(last))
            };
            let (Some(num), Some(den)) = (next(this.0, last.num), next(this.1, last.den)) else {
                break;
            };
            last = StepRatio { num: this.0, den: this.1 };
            this = (num, den);
            (steps, units) = (units, steps % units);
        }
        if this.1 == 0 {
            return StepRatio { num: u32::MAX, den: 1 };
        }
        StepRatio { num: this.0, den: this.1 }
    }

    /// Returns how often the steps of one unit have to be halved until they are one or less; 15 for more than 14.
    #[inline(never)]
    #[small]
    pub fn octaves(self) -> u8 {
        let (mut den, mut octaves) = (self.den, 0);
        while den < self.num && octaves < 15 {
            den = den.saturating_add(den);
            octaves += 1;
        }
        octaves
    }

    /// Returns the length of `steps`, rounded half away from zero. `None` for a motor that never steps, or if the
    /// length is out of range.
    ///
    /// About 1,100 cycles on AVR.
    pub fn length(self, steps: i32) -> Option<Length> {
        if self.num == 0 {
            return None;
        }
        let product = u64::from(steps.unsigned_abs()) * u64::from(self.den);
        let units = wide(product + u64::from(self.num / 2), self.num)?;
        let units = i32::try_from(units).ok()?;
        Some(Length(if steps < 0 { -units } else { units }))
    }

    /// Returns the steps for `length`, rounded half away from zero, saturating.
    ///
    /// About 800 cycles on AVR while the product fits 32 bits, else 1,100.
    #[small]
    pub fn steps(self, length: Length) -> i32 {
        let units = length.0.unsigned_abs();
        let half = self.den / 2;
        let steps = match units.checked_mul(self.num).and_then(|p| p.checked_add(half)) {
            Some(product) => product / self.den,
            None => {
                let product = u64::from(units) * u64::from(self.num) + u64::from(half);
                wide(product, self.den).unwrap_or(u32::MAX)
            }
        };
        let steps = steps.min(i32::MAX as u32) as i32;
        if length.0 < 0 { -steps } else { steps }
    }
}

/// Returns `a / b`; `None` if it does not fit 32 bits.
fn wide(a: u64, b: u32) -> Option<u32> {
    (((a >> 32) as u32) < b).then(|| arithmetic::wide_quotient(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec;

    /// Computes the steps by the definition, in wide integers.
    fn oracle(angle: i32, travel: i32, microsteps: u8, length: i32) -> i128 {
        let num = 360_000_000 * i128::from(microsteps) * i128::from(length.unsigned_abs());
        let den = i128::from(angle) * i128::from(travel);
        ((2 * num + den) / (2 * den)).min(i32::MAX.into()) * i128::from(length.signum())
    }

    #[test]
    fn steps_and_lengths_agree() {
        let screw = StepRatio::new(18_000, 1_250_000, 8);
        assert_eq!(screw.length(-1280), Some(Length(-10_000)));
        assert_eq!(screw.length(1), Some(Length(8)));
        assert_eq!(StepRatio::NONE.length(5), None);
    }

    #[test]
    fn screws_and_belts_are_exact() {
        assert_eq!(StepRatio::new(18_000, 1_250_000, 8), StepRatio { num: 16, den: 125 });
        assert_eq!(StepRatio::new(0, 1_250_000, 8), StepRatio::NONE);
        assert_eq!(StepRatio::new(18_000, 0, 8), StepRatio::NONE);
        assert_eq!(StepRatio::new(1, 1, 255), StepRatio { num: u32::MAX, den: 1 });
        let screw = StepRatio::new(18_000, 1_250_000, 8);
        assert_eq!(screw.steps(Length(10_000)), 1280);
        assert_eq!(screw.steps(Length(4)), 1);
        assert_eq!(screw.steps(Length(-4)), -1);
        assert_eq!(screw.steps(Length(3)), 0);
        assert_eq!(screw.steps(Length(i32::MIN)), -274_877_907);
    }

    proptest! {
        #[test]
        fn wide_division_is_division(a: u64, b in 1u32..) {
            prop_assert_eq!(wide(a, b), u32::try_from(a / u64::from(b)).ok());
            let small = a % (u64::from(b) << 32);
            prop_assert_eq!(wide(small, b).map(u64::from), Some(small / u64::from(b)));
        }

        #[test]
        fn equals_the_wide_result(
            angle in prop::sample::select(vec![18_000, 9_000, 75_000, 36_000, 1_800]),
            travel in 1_000..400_000_000i32, microsteps in 1u8..=255, length: i32,
        ) {
            let ratio = StepRatio::new(angle, travel, microsteps);
            let expected = oracle(angle, travel, microsteps, length);
            let exact = i128::from(ratio.num) * i128::from(angle) * i128::from(travel)
                == 360_000_000 * i128::from(microsteps) * i128::from(ratio.den);
            let error = (i128::from(ratio.steps(Length(length))) - expected).abs();
            prop_assert!(error <= i128::from(!exact), "{ratio:?} off by {error}");
        }

        #[test]
        fn any_motor_is_within_a_step(
            angle in 100..4_000_000i32, travel in 1_000..2_000_000_000i32, microsteps in 1u8..=255,
            length in -1_000_000_000..1_000_000_000i32,
        ) {
            let steps = StepRatio::new(angle, travel, microsteps).steps(Length(length));
            let error = (i128::from(steps) - oracle(angle, travel, microsteps, length)).abs();
            prop_assert!(error <= 1);
        }
    }
}
