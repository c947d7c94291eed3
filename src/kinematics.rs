//! Kinematics: what a motor drives, which is one axis, or X and Y together.
//!
//! On a CoreXY machine two motors move X and Y with one or two shared belts. The coordinate of the first motor is the
//! sum of X and Y, the coordinate of the second is their difference. Both coordinates are lengths, so a motor's steps
//! follow from its coordinate as on any other machine. The setting `ma` says what a motor drives: an axis by its
//! number, [`SUM`] or [`DIFFERENCE`]. The limits of axes remain those of X and Y. The step rate is limited for each
//! motor.
//!
//! The line builder calls these functions. In an image without the capability each motor drives one axis, and the
//! functions cost nothing. Sums saturate. Moves to places where a sum would saturate are refused before
//! ([`Setup::reach`](crate::gcode::setup::Setup::reach)).

use crate::capability::Capability;
use crate::status::Status;
use crate::units::{Length, PerAxis};

/// The motor drives X + Y.
pub const SUM: u8 = 6;
/// The motor drives X - Y.
pub const DIFFERENCE: u8 = 7;
/// The motor drives nothing.
pub const NOTHING: u8 = u8::MAX;

/// Whether a motor drives X and Y together.
#[inline(always)]
pub const fn is_shared(drives: u8) -> bool {
    Capability::CoreXy.is_built_in() && (drives == SUM || drives == DIFFERENCE)
}

/// Refuses [`SUM`] and [`DIFFERENCE`] in an image without the capability.
#[inline(always)]
pub const fn check(drives: i32) -> Result<(), Status> {
    if drives == SUM as i32 || drives == DIFFERENCE as i32 {
        return Capability::CoreXy.check();
    }
    Ok(())
}

/// Whether the motor turns when this axis alone moves.
pub fn turns(drives: u8, axis: u8) -> bool {
    drives == axis || axis < 2 && is_shared(drives)
}

/// Returns the axis under whose name a sender that knows only axes sees the motor: X for [`SUM`], Y for [`DIFFERENCE`],
/// as the motors are wired.
pub const fn stands_for(drives: u8) -> u8 {
    if is_shared(drives) { drives - SUM } else { drives }
}

/// Returns a motor's coordinate when the axes are at `place`. `None` if the motor drives nothing.
#[inline(always)]
pub fn place(drives: u8, place: &PerAxis<Length>) -> Option<Length> {
    if is_shared(drives) {
        let [x, y, ..] = *place;
        return Some(Length(join(drives, x.0, y.0)));
    }
    place.get(usize::from(drives)).copied()
}

/// Like [`place()`], but not inlined. For code that need not be fast.
#[inline(never)]
#[small]
pub fn place_of(drives: u8, at: &PerAxis<Length>) -> Option<Length> {
    place(drives, at)
}

/// Returns how far a motor's coordinate goes when the axes go by `travel`, in units of [`Length`]. `None` if the motor
/// drives nothing.
#[inline(always)]
pub fn travel(drives: u8, travel: &PerAxis<i32>) -> Option<i32> {
    if is_shared(drives) {
        let [x, y, ..] = *travel;
        return Some(join(drives, x, y));
    }
    travel.get(usize::from(drives)).copied()
}

/// Returns the coordinate of X or Y, computed from the coordinates of the two motors. Rounded down to a unit.
pub fn axis(axis: usize, sum: Length, difference: Length) -> Length {
    let (sum, difference) = (i64::from(sum.0), i64::from(difference.0));
    let twice = if axis == 0 { sum + difference } else { sum - difference };
    // Half the sum of two 32-bit numbers fits 32 bits.
    Length((twice >> 1) as i32)
}

#[inline(always)]
fn join(drives: u8, x: i32, y: i32) -> i32 {
    if drives == SUM { x.saturating_add(y) } else { x.saturating_sub(y) }
}

#[cfg(test)]
#[cfg(feature = "corexy")]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::units::AXES;

    #[test]
    fn a_motor_of_an_axis_is_where_the_axis_is() {
        let at = [1, 2, 3, 4, 5, 6].map(Length);
        for axis in 0..AXES as u8 {
            assert_eq!(place(axis, &at), Some(Length(i32::from(axis) + 1)));
            assert_eq!(travel(axis, &at.map(|length| length.0)), Some(i32::from(axis) + 1));
        }
        assert_eq!((place(8, &at), place(NOTHING, &at)), (None, None));
    }

    #[test]
    fn an_axis_turns_its_own_motors() {
        assert!(turns(0, 0) && turns(2, 2) && !turns(0, 1) && !turns(NOTHING, 0));
        assert!(turns(SUM, 0) && turns(SUM, 1) && !turns(SUM, 2));
        assert!(turns(DIFFERENCE, 0) && turns(DIFFERENCE, 1) && !turns(DIFFERENCE, 2));
    }

    proptest! {
        #[test]
        fn axes_follow_from_motors(x in -1_000_000_000..1_000_000_000, y in -1_000_000_000..1_000_000_000) {
            let at = [x, y, 0, 0, 0, 0].map(Length);
            let (sum, difference) = (place(SUM, &at).unwrap(), place(DIFFERENCE, &at).unwrap());
            prop_assert_eq!((axis(0, sum, difference).0, axis(1, sum, difference).0), (x, y));
        }

        #[test]
        fn nothing_overflows(x: i32, y: i32) {
            let at = [x, y, 0, 0, 0, 0];
            for drives in [SUM, DIFFERENCE] {
                prop_assert_eq!(travel(drives, &at), place(drives, &at.map(Length)).map(|place| place.0));
            }
            axis(1, Length(x), Length(y));
        }
    }
}
