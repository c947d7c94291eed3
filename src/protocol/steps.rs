//! Settings by owner and name, and steps per millimetre. Kerf keeps a step angle, microsteps and the travel per turn
//! instead.

use super::Machine;
use crate::config::name::token;
use crate::config::{Owner, Setting};

/// The product of `sa` and `tr` (both scaled as kept) with the steps per millimetre (in thousandths), for one
/// microstep: 360 degrees times 10^4, 10^6 and 10^3.
const STEPS: u64 = 360 * 10_000_000_000_000;

/// Returns the setting of an owner with this name; `None` if there is none.
#[inline(never)]
#[small]
pub fn named(owner: Owner, token: [u8; 4]) -> Option<Setting> {
    Setting::find(&owner.prefix().with_token(token)).filter(|found| found.owner() == owner)
}

/// Returns the steps per millimetre of a motor, in thousandths, if `by` is the travel per turn, scaled as kept. Works
/// both ways: if `by` is the steps per millimetre, in thousandths, returns the travel per turn. Returns 0, which no
/// setting accepts, if the result is out of range.
#[small]
pub fn turned(machine: &mut impl Machine, motor: u8, by: i32) -> i32 {
    let mut read = |token| {
        let setting = named(Owner::Motor(motor), token);
        setting.map_or(0, |setting| machine.setting(setting)).unsigned_abs()
    };
    let (angle, microsteps) = (read(token("sa")), read(token("mi")));
    let divisor = (u64::from(angle) * u64::from(by.unsigned_abs())).max(1);
    let quotient = (STEPS * u64::from(microsteps) + divisor / 2) / divisor;
    i32::try_from(quotient).unwrap_or(0)
}
