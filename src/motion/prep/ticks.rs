//! Ticks of a stretch: their number, and the phase units of each, in integers.

use super::{LIMIT_MAX, PART, PART_LOG2};
use crate::dda::STEP_LOG2;
use crate::hal::arithmetic::product;

/// Whether a debt is only rounding: at most half of 1/16 step.
#[inline(always)]
pub(super) fn is_little(debt: i32) -> bool {
    debt.wrapping_add(i32::from(PART / 2)) as u32 >> PART_LOG2 == 0
}

/// Returns a debt, which is no more than some steps, in 1/16 step, rounded.
#[inline(always)]
pub(super) fn parts_of(debt: i32) -> i16 {
    (debt as i16).wrapping_add((PART / 2) as i16) >> PART_LOG2
}

#[inline(never)]
#[small]
pub(super) fn times(a: i16, b: u16) -> i32 {
    let size = product(a.unsigned_abs(), b) as i32;
    if a < 0 { -size } else { size }
}

/// Returns `1 << n`, up to a step. Cost: 15, where the compiler makes a loop of six cycles a bit.
#[inline(always)]
pub(super) fn bit(n: u8) -> u16 {
    let pair = if n & 2 != 0 { 4 } else { 1 };
    let nibble: u8 = if n & 1 != 0 { pair << 1 } else { pair };
    let byte = if n & 4 != 0 { nibble << 4 } else { nibble };
    if n & 8 != 0 { u16::from(byte) << 8 } else { byte.into() }
}

/// Periods are computed in 1/32 tick, if a tick has at least 32 phase units. This is the exponent of 32.
pub(super) const FINE: u8 = 5;

/// Converts a limit of ticks to parts of a tick, including those of a last incomplete tick.
const fn limit_in_parts(limit: u16) -> u16 {
    limit << FINE | ((1 << FINE) - 1)
}

const _: () = assert!(limit_in_parts(LIMIT_MAX) >> FINE == LIMIT_MAX);

/// Divides a travel into ticks, no more than `limit` if steps allow. Returns the travel in parts of a tick, and the
/// exponent of a tick. Cost: 100.
#[inline(never)]
pub(super) fn coarsen(travel: u32, limit: u16) -> (u32, u8) {
    let limit = limit_in_parts(limit);
    if travel <= u32::from(limit) {
        return coarsen_little(travel, limit);
    }
    let (mut fine, mut shift) = (travel, FINE);
    if fine >> 8 > u32::from(limit) {
        (fine, shift) = (fine >> 8, FINE + 8);
    }
    while fine > 0xFFFF && shift < STEP_LOG2 {
        fine >>= 1;
        shift += 1;
    }
    if fine > 0xFFFF {
        return (fine, shift);
    }
    let mut few = fine as u16;
    while few > limit && shift < STEP_LOG2 {
        few >>= 1;
        shift += 1;
    }
    (few.into(), shift)
}

/// Divides a travel that needs ticks of less than [`FINE`] bits only: its phase units are the parts.
#[inline(never)]
#[small]
fn coarsen_little(travel: u32, limit: u16) -> (u32, u8) {
    let (limit, mut ticks, mut shift) = (limit >> FINE, travel as u16, 0);
    while ticks > limit && shift < FINE {
        ticks >>= 1;
        shift += 1;
    }
    (travel, shift)
}

/// Returns a travel in parts of ticks that have `shift` bits.
#[inline(never)]
#[small]
pub(super) fn finer(travel: u32, shift: u8) -> u32 {
    travel >> shift.saturating_sub(FINE)
}

/// Returns the whole ticks in `fine` parts. Cost: 25.
#[inline(always)]
pub(super) fn whole_ticks(fine: u32, shift: u8) -> u32 {
    if shift < FINE { fine >> shift } else { fine >> FINE }
}

/// Returns the exponent of the grid to which the end of a stretch is aligned: a tick, or more in a long stretch, up
/// to an eighth of the stretch and up to a step.
pub(super) fn grain(ticks: u32, shift: u8) -> u8 {
    let mut grain = shift;
    let mut eighth = ticks >> 4;
    while eighth != 0 && grain < STEP_LOG2 {
        eighth >>= 1;
        grain += 1;
    }
    grain
}
