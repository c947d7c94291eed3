//! The path of a straight move: its length and its direction.
//!
//! Called by the line builder. Works in integers of 15 bits where these are exact enough, at a third of the cycles of
//! floats. The length of a long move decides how evenly its steps come, so it is computed in floats.
//!
//! Units: input in those of [`Length`], output in mm (or degrees).

use kerf_macros::small;

use super::divide::Size;
use super::float::{below, brief_product};
use super::junction::{Heading, ONE};
use super::short::Short;
use crate::hal::arithmetic::product;
use crate::math::sqrt;
use crate::units::{FIRST_ROTARY, Length, PerAxis};

/// The largest component of a normalized travel is at least this.
const MOST: u32 = 1 << 14;

/// The result of measuring a move.
pub(super) enum Way {
    None,
    Near,
    /// The travel exceeds the range of [`Length`].
    Far,
}

/// The path of a move, and its limits. Filled in place, because copying it costs as much as a multiplication of floats.
#[derive(Default)]
pub(super) struct Path {
    /// Travel of each axis, in units of [`Length`].
    pub(super) travel: PerAxis<i32>,
    /// Length of the path, mm.
    pub(super) length: f32,
    /// Travel of each axis for a unit of length.
    pub(super) heading: Heading,
    /// The length of the rotary axes' path (degrees) over that of the linear axes' path (mm), if both move and the
    /// ratio is above 1; else 0.
    pub(super) stretch: f32,
    /// The axes that move: a bit for each, the first axis lowest.
    pub(super) moved: u8,
    /// The distance of the motor that moves farthest, in parts of a step; `moving` is the number of motors that move.
    pub(super) most: u16,
    pub(super) moving: u8,
    /// Whether `most` is in whole steps.
    pub(super) whole_steps: bool,
    pub(super) cruise: f32,
    /// The highest velocity under any override, at most twice the feed, mm/s.
    pub(super) top: f32,
    pub(super) accel: Short,
    /// The least acceleration limit and the least jerk limit of the axes that move, 0 for none.
    pub(super) slowest: (Short, Short),
    /// Whether axes that move may have other limits than `slowest`.
    pub(super) mixed: bool,
}

impl Path {
    /// Measures length and direction, to 0.01 %; exact for a single axis.
    ///
    /// The length is that of the linear axes' path, or of the rotary axes' path (degrees) if that is longer. The feed
    /// applies to the linear axes where they move, so it is multiplied by [`Self::stretch`] where the length is that of
    /// the rotary axes.
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
        // Long moves are measured exactly, so that their steps are even; there is time for it.
        self.length = if shift > 0 {
            length_of(&self.travel)
        } else {
            let power = if size.is_twice { 127 + 14 } else { 127 + 15 };
            brief_product(composed(size.length, power + i16::from(shift)), 1e-4)
        };
        Way::Near
    }

    /// Measures a move of one axis, or of none; `way` is the size of its travel.
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

/// Reduces the travel to 15 bits and a sign. Returns the power of two that restores it. `bits` is the union of the
/// sizes.
#[inline(never)]
fn normalize(unit: &mut PerAxis<i16>, travel: &PerAxis<i32>, bits: u32) -> i8 {
    if bits >= 2 * MOST {
        return normalize_far(unit, travel, bits);
    }
    // Everything is 16 bits wide here.
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

/// As [`normalize`], for travel of more than 15 bits; slower.
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

/// Returns the square of a vector's length.
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

/// Returns the length of a move, mm: that of the linear axes or of the rotary ones, whichever is longer.
#[inline(never)]
fn length_of(travel: &PerAxis<i32>) -> f32 {
    let (linear, rotary) = travel.split_at(FIRST_ROTARY);
    let (linear, rotary) = (exact_norm(linear), exact_norm(rotary));
    1e-4 * if below(linear, rotary) { rotary } else { linear }
}

/// Returns the length of the rotary axes' path over that of the linear axes' path.
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

/// Returns a component of a vector in the units of a heading, rounded down by less than 2. `reciprocal` is that of the
/// vector's length, in 2^-30. Cost: 45.
#[inline(never)]
fn share(part: i16, reciprocal: u16) -> i16 {
    let share = (product(part.unsigned_abs(), reciprocal) >> 16) as i16;
    if part < 0 { -share } else { share }
}

/// Returns a float from its first 16 bits and the exponent that applies if the top bit is 1. The top bit may be 0, but
/// then the next bit is 1. Cost: 30.
#[inline(never)]
pub(super) fn composed(bits: u16, power: i16) -> f32 {
    let (mantissa, power) =
        if bits >= 0x8000 { (bits << 1, power) } else { (bits << 2, power - 1) };
    f32::from_bits(u32::from(power as u16) << 23 | u32::from(mantissa) << 7)
}
