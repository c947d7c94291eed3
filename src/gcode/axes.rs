//! The meaning of axis words, which depends on the mode of the axis. Converts lengths to angles in radius mode.

use kerf_macros::small;

use super::decimal::Decimal;
pub(super) use super::decimal::Exact as Value;
use super::decimal::Exact;
use super::modal::Units;
use super::setup::{AxisMode, Setup};
use crate::status::Status;
use crate::units::{FIRST_ROTARY, Length};

/// Returns the length that a word gives, without regard to the mode of an axis.
#[inline(never)]
#[small]
pub(super) fn length(word: &Decimal, units: Units) -> Result<Exact, Status> {
    match units {
        Units::Inch => word.inch(),
        Units::Mm => word.mm(),
    }
}

/// Returns the value of an axis word. `None` if the axis is disabled.
pub(super) fn value(
    word: &Decimal,
    axis: u8,
    units: Units,
    setup: &impl Setup,
) -> Result<Option<Exact>, Status> {
    match setup.mode(axis) {
        AxisMode::Disabled => Ok(None),
        AxisMode::Radius => angle(length(word, units)?, setup.radius(axis)).map(Some),
        // Degrees do not depend on G20 and G21.
        _ if usize::from(axis) >= FIRST_ROTARY => word.mm().map(Some),
        _ => length(word, units).map(Some),
    }
}

/// Units of angle for a unit of length at a radius of 1 nm (10^6 * 180 / pi), times [`SCALE`].
const UNITS: i64 = 3_666_929_889;
/// With this scale [`UNITS`] has 32 bits, so its product with any length fits 63 bits.
const SCALE: i64 = 64;
/// The scale of [`Exact::rest`].
const REST: i64 = 10_000;

/// Returns the angle of an arc of this `length` on a circle of `radius` nm. Error 110 beyond the range.
///
/// The computation uses integers and the remainder of the length, so that incremental moves add up exactly. Cost: three
/// 64-bit divisions, 15,000 cycles on AVR.
#[inline(never)]
#[small]
fn angle(length: Exact, radius: u32) -> Result<Exact, Status> {
    let divisor = i64::from(radius.max(1)) * SCALE;
    let product = i64::from(length.units.0) * UNITS;
    let whole = product.div_euclid(divisor);
    let left = (product - whole * divisor) * REST + i64::from(length.rest) * UNITS;
    let rest = (left + divisor / 2).div_euclid(divisor);
    let carry = (rest + REST / 2).div_euclid(REST);
    let units = whole.checked_add(carry).and_then(|units| i32::try_from(units).ok());
    let units = Length(units.ok_or(Status::OutOfRange)?);
    Ok(Exact { units, rest: (rest - carry * REST) as i16 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn angle_of(units: i32, rest: i16, radius: u32) -> Option<(i32, i16)> {
        let angle = angle(Exact { units: Length(units), rest }, radius).ok()?;
        Some((angle.units.0, angle.rest))
    }

    #[test]
    fn lengths_on_a_circumference() {
        // 1 mm at 0.198944 mm is 288 degrees; 6.2832 mm at 1 mm is a turn and a little.
        assert_eq!(angle_of(10_000, 0, 198_944), Some((2_879_995, 3_512)));
        assert_eq!(angle_of(62_832, 0, 1_000_000), Some((3_600_008, 4_185)));
        assert_eq!(angle_of(-62_832, 0, 1_000_000), Some((-3_600_008, -4_185)));
        assert_eq!(angle_of(0, 0, 1), Some((0, 0)));
        assert_eq!(angle_of(0, 1, 1_000), Some((6, -2_704)));
        assert_eq!(angle_of(i32::MAX, 0, 1), None);
        assert!(angle_of(i32::MIN, 5_000, u32::MAX).is_some());
    }

    proptest! {
        #[test]
        fn angles_are_right_to_a_ten_thousandth(
            units in -200_000_000i32..200_000_000, rest in -5_000i16..=5_000,
            radius in 1_000u32..2_000_000_000,
        ) {
            let exact = (f64::from(units) + f64::from(rest) * 1e-4) * 1e6 * 180.0
                / core::f64::consts::PI / f64::from(radius);
            match angle_of(units, rest, radius) {
                Some((units, rest)) => {
                    let error = f64::from(units) + f64::from(rest) * 1e-4 - exact;
                    prop_assert!(error.abs() <= 1e-4 + exact.abs() * 1e-10, "{error}");
                    prop_assert!((-5_000..=5_000).contains(&rest));
                }
                None => prop_assert!(exact.abs() > 2e9),
            }
        }
    }
}
