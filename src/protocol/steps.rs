//! Settings by owner and name, and steps per millimetre, which Kerf keeps as a step angle, microsteps and the travel in a turn.

use super::Machine;
use crate::config::name::token;
use crate::config::{Owner, Setting};

/// Steps per millimetre in thousandths, times what `sa` and `tr` are kept as, for one microstep: 360 degrees, 10^4, 10^6 and 10^3.
const STEPS: u64 = 360 * 10_000_000_000_000;

/// The setting of an owner with this name.
#[inline(never)]
#[small]
pub fn named(owner: Owner, token: [u8; 4]) -> Option<Setting> {
    Setting::find(&owner.prefix().with_token(token)).filter(|found| found.owner() == owner)
}

/// The steps per millimetre of a motor in thousandths, if the travel in a turn is `by` as it is kept; or that travel, if there are `by` steps
/// per millimetre, in thousandths.
#[small]
pub fn turned(machine: &mut impl Machine, motor: u8, by: i32) -> i32 {
    let mut read = |token| {
        let setting = named(Owner::Motor(motor), token);
        setting.map_or(0, |setting| machine.setting(setting)).unsigned_abs()
    };
    let (angle, microsteps) = (read(token("sa")), read(token("mi")));
    let divisor = (u64::from(angle) * u64::from(by.unsigned_abs())).max(1);
    let quotient = (STEPS * u64::from(microsteps) + divisor / 2) / divisor;
    i32::try_from(quotient).unwrap_or(i32::MAX)
}
