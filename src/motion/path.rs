//! The way of a straight move: how long it is, and in which direction.
//!
//! Called by the line builder. In integers of 15 bits where these are exact enough, a third of the cycles of
//! floats: the length of a long move, which decides how evenly its steps come, is a float's.
//!
//! Units: those of [`Length`] on the way in, mm (or degrees) on the way out.

use kerf_macros::small;

use super::divide::Size;
use super::float::{below, brief_product};
use super::junction::{Heading, ONE};
use super::short::Short;
use crate::hal::arithmetic::product;
use crate::math::sqrt;
use crate::units::{FIRST_ROTARY, Length, PerAxis};

/// The longest part of a way is to have at least as many units.
const MOST: u32 = 1 << 14;

/// Whether there is a way.
pub(super) enum Way {
    None,
    Near,
    /// More than [`Length`] holds.
    Far,
}

/// The way from here to there, and what limits it. Filled in place: to move it costs as much as a
/// multiplication of floats.
#[derive(Default)]
pub(super) struct Path {
    /// Travel of each axis, in units of [`Length`].
    pub(super) travel: PerAxis<i32>,
    /// mm.
    pub(super) length: f32,
    /// Travel of each axis for a unit of length.
    pub(super) heading: Heading,
    /// How much longer the way of the rotary axes is than that of the linear ones, if it is; else 0.
    pub(super) stretch: f32,
    /// The axes that move: a bit for each, the first axis lowest.
    pub(super) moved: u8,
    /// How far the motor goes that goes farthest, in parts of a step, and how many motors move.
    pub(super) most: u16,
    pub(super) moving: u8,
    /// `most` is in whole steps.
    pub(super) whole_steps: bool,
    pub(super) cruise: f32,
    /// What the machine could do, at most twice the feed, mm/s.
    pub(super) top: f32,
    pub(super) accel: Short,
    pub(super) jerk: Short,
    /// The least acceleration and jerk of the axes that move, 0 for none.
    pub(super) slowest: (Short, Short),
    /// They may not be those of all axes that move.
    pub(super) mixed: bool,
}

impl Path {
    /// Length and direction. 0.01 % exact, for a single axis exact.
    ///
    /// The length is that of the linear axes, or of the rotary ones (degrees) if these have the longer
    /// way; the feed, which is that of the linear axes where they move, is more by as much.
    #[inline(never)]
    pub(super) fn measure(&mut self, from: &PerAxis<Length>, to: &PerAxis<Length>) -> Way {
        let mut all = 0u32;
        let mut bit = 1u8;
        for ((travel, from), to) in self.travel.iter_mut().zip(from).zip(to) {
            if from != to {
                let Some(way) = to.0.checked_sub(from.0) else {
                    return Way::Far;
                };
                *travel = way;
                all |= way.unsigned_abs();
                self.moved |= bit;
            }
            bit <<= 1;
        }
        if self.moved & self.moved.wrapping_sub(1) == 0 {
            return self.measure_axis(all);
        }
        let shift = normalize(&mut self.heading.unit, &self.travel, all);
        let (linear, rotary) = self.heading.unit.split_at(FIRST_ROTARY);
        let mut square = square(linear);
        if self.moved >> FIRST_ROTARY != 0 {
            let turn = self::square(rotary);
            if turn > square {
                square = turn;
                if self.moved & ((1 << FIRST_ROTARY) - 1) != 0 {
                    self.stretch = stretch(&self.travel);
                }
            }
        }
        let size = Size::of_square(square);
        for u in &mut self.heading.unit {
            if *u != 0 {
                *u = share(*u, size.reciprocal);
            }
        }
        // Long moves have the time to be measured exactly, and their steps come evenly.
        self.length = if shift > 0 {
            length_of(&self.travel)
        } else {
            let power = if size.is_twice { 127 + 14 } else { 127 + 15 };
            brief_product(composed(size.length, power + i16::from(shift)), 1e-4)
        };
        Way::Near
    }

    /// Length and direction of a move of one axis, or of none; `way` is the size of its travel.
    #[inline(never)]
    fn measure_axis(&mut self, way: u32) -> Way {
        if self.moved == 0 {
            return Way::None;
        }
        for (unit, &way) in self.heading.unit.iter_mut().zip(&self.travel) {
            if way != 0 {
                *unit = if way < 0 { -ONE } else { ONE };
            }
        }
        self.length = way as f32 * 1e-4;
        Way::Near
    }
}

/// The travel in 15 bits and a sign, and the power of two that takes it back. `bits` is the union of
/// the sizes.
#[inline(never)]
fn normalize(unit: &mut PerAxis<i16>, travel: &PerAxis<i32>, bits: u32) -> i8 {
    if bits >= 2 * MOST {
        return normalize_far(unit, travel, bits);
    }
    // All 16 bits wide.
    let (mut bits, mut shift) = (bits as u16, 0i8);
    while bits < MOST as u16 {
        bits <<= 1;
        shift += 1;
    }
    for (unit, &way) in unit.iter_mut().zip(travel) {
        let mut way = way as i16;
        if way != 0 {
            for _ in 0..shift {
                way <<= 1;
            }
        }
        *unit = way;
    }
    -shift
}

/// [`normalize`] for travel of more than 15 bits: there is time.
#[inline(never)]
#[small]
fn normalize_far(unit: &mut PerAxis<i16>, travel: &PerAxis<i32>, mut bits: u32) -> i8 {
    let mut shift = 0i8;
    while bits >= 2 * MOST {
        bits >>= 1;
        shift += 1;
    }
    for (unit, &way) in unit.iter_mut().zip(travel) {
        *unit = if way == 0 { 0 } else { (way >> shift) as i16 };
    }
    shift
}

/// The square of a vector's length.
#[inline(never)]
fn square(vector: &[i16]) -> u32 {
    let mut sum = 0u32;
    for &term in vector {
        let size = term.unsigned_abs();
        if size != 0 {
            sum += product(size, size);
        }
    }
    sum
}

/// The length of a move, mm: that of the linear axes or of the rotary ones, whichever is longer.
#[inline(never)]
fn length_of(travel: &PerAxis<i32>) -> f32 {
    let (linear, rotary) = travel.split_at(FIRST_ROTARY);
    let (linear, rotary) = (exact_norm(linear), exact_norm(rotary));
    1e-4 * if below(linear, rotary) { rotary } else { linear }
}

/// How much longer the way of the rotary axes is than that of the linear ones.
#[inline(never)]
fn stretch(travel: &PerAxis<i32>) -> f32 {
    let (linear, rotary) = travel.split_at(FIRST_ROTARY);
    exact_norm(rotary) / exact_norm(linear)
}

#[inline(never)]
fn exact_norm(travel: &[i32]) -> f32 {
    let mut sum = 0.0;
    for &way in travel {
        sum += way as f32 * way as f32;
    }
    sqrt(sum)
}

/// A part of the whole, given by that one's reciprocal in 2^-30, in the units of a heading; rounded down, by less than 2.
/// Cost: 45.
#[inline(never)]
fn share(part: i16, reciprocal: u16) -> i16 {
    let share = (product(part.unsigned_abs(), reciprocal) >> 16) as i16;
    if part < 0 { -share } else { share }
}

/// A float from its first 16 bits, the top one of which may be 0, but not the next one as well, and its
/// exponent if it is not. Cost: 30.
#[inline(never)]
pub(super) fn composed(bits: u16, power: i16) -> f32 {
    let (mantissa, power) =
        if bits >= 0x8000 { (bits << 1, power) } else { (bits << 2, power - 1) };
    f32::from_bits(u32::from(power as u16) << 23 | u32::from(mantissa) << 7)
}
