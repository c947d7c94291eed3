//! What limits a straight move: feed, velocities and acceleration of its axes, step rates of its motors.
//!
//! Called by the line builder. Units: mm, s.

use kerf_macros::small;

use super::block::PARTS_LOG2;
use super::divide::quotient;
use super::dynamics::{Axis, Dynamics};
use super::exec::BLOCK_S_MIN;
use super::float::{below, least, scaled, some};
use super::governor::ACCEL_MOST;
use super::junction::{self, ONE};
use super::path::Path;
use super::short::{self, Log, Short};
use crate::boards::MOTORS;
use crate::gcode::command::Feed;
use crate::hal::SHORT_SHARE;
use crate::hal::arithmetic::product;

/// Highest velocity, mm/s, above that of any machine; higher ones are clamped to it.
const CRUISE_MOST: f32 = 1e5;
/// Lowest velocity, mm/s; lower ones are clamped to it.
const CRUISE_LEAST: f32 = 1e-6;
/// The logarithm of [`BLOCK_S_MIN`], with a margin for the error of rough logarithms.
const BLOCK_S_LOG: i16 = -10 * short::OCTAVE;

/// The feed of the last move, and its velocity: most moves have the feed of the move before.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LastFeed {
    /// mm/min.
    feed: f32,
    /// mm/s.
    velocity: f32,
}

impl LastFeed {
    /// Converts `feed` from mm/min to mm/s, clamped so that divisions stay in the range of floats. Cost: 20; 300 for
    /// another feed than the last.
    #[inline(always)]
    fn per_second(&mut self, feed: f32) -> f32 {
        if self.feed.to_bits() != feed.to_bits() {
            *self = Self { feed, velocity: within(times(feed, 1.0 / 60.0)) };
        }
        self.velocity
    }
}

/// Not inlined: otherwise the product would be computed where it is not needed.
#[inline(never)]
fn times(a: f32, b: f32) -> f32 {
    a * b
}

/// Half a step, in parts of a step.
const HALF_STEP: u16 = 1 << (PARTS_LOG2 - 1);

/// The logarithm of [`SHORT_SHARE`].
const SHORT_SHARE_LOG: i16 = if SHORT_SHARE < 1.0 { -174 } else { 0 };
const _: () = assert!(SHORT_SHARE == 0.625 || SHORT_SHARE == 1.0, "a share with another logarithm");
/// More than the error of a sum of three logarithms.
const SPARE: i16 = 24;

impl Path {
    /// Returns the axes that move, each with an upper bound of the size of its part of the heading ([`part`]). Ends
    /// with the last axis that moves.
    #[inline(always)]
    fn axes<'a>(&'a self, dynamics: &'a Dynamics) -> impl Iterator<Item = (u16, &'a Axis)> {
        let mut left = self.moved;
        let mut all = self.heading.unit.iter().zip(&dynamics.axes);
        core::iter::from_fn(move || {
            while left != 0 {
                let moves = left & 1 != 0;
                left >>= 1;
                let (u, axis) = all.next()?;
                if moves {
                    return Some((part(*u), axis));
                }
            }
            None
        })
    }

    /// Applies the feed and the velocity limit of every axis that moves.
    #[inline(never)]
    pub(super) fn limit(&mut self, feed: Option<Feed>, last: &mut LastFeed, dynamics: &Dynamics) {
        self.cruise = match feed {
            Some(Feed::PerMinute(feed)) if !some(self.stretch) => last.per_second(feed),
            _ => self.unusual_velocity(feed, last),
        };
        // An override may double a feed.
        self.top = if feed.is_some() { scaled(self.cruise, 1) } else { self.cruise };
        let mut left = self.moved;
        for (u, axis) in self.heading.unit.iter().zip(&dynamics.axes) {
            if left & 1 != 0 {
                let velocity = if feed.is_some() { axis.feed } else { axis.velocity };
                // Most axes are slower than the path.
                if below(velocity, self.top) && some(velocity) {
                    self.top = slower(self.top, *u, velocity);
                }
            }
            left >>= 1;
            if left == 0 {
                break;
            }
        }
        if below(self.top, self.cruise) {
            self.cruise = self.top;
        }
    }

    /// Returns the velocity, mm/s, of a traverse, of a move with an inverse time feed, or of one that mixes lengths and
    /// angles.
    #[inline(never)]
    #[small]
    fn unusual_velocity(&self, feed: Option<Feed>, last: &mut LastFeed) -> f32 {
        within(match feed {
            Some(Feed::PerMinute(feed)) => last.per_second(feed) * self.stretch,
            Some(Feed::Minutes(time)) if some(time) => self.length / (time * 60.0),
            _ => CRUISE_MOST,
        })
    }

    /// Limits the acceleration, and sets the junction deviation. Cost: 350 where all axes that move have the
    /// same limits.
    #[inline(never)]
    pub(super) fn limit_change(&mut self, dynamics: &Dynamics) {
        let slowest = match self.like_one(dynamics) {
            Some((unit, &Axis { accel, jerk, deviation, .. })) if !some(self.stretch) => {
                self.heading.deviation = deviation;
                Slowest { unit, least: accel, accel, jerk, mixed: false }
            }
            _ => self.look_at_all(dynamics),
        };
        self.slowest = (slowest.least, slowest.jerk);
        self.mixed = slowest.mixed;
        self.accel = Short::new(ACCEL_MOST);
        if slowest.least != Short::ZERO {
            self.accel = over(slowest.accel, slowest.unit).min(self.accel);
        }
    }

    /// Returns an axis whose limits are those of all axes that move, with the greatest part of the heading; `None` if
    /// the axes have different limits.
    #[inline(always)]
    fn like_one<'a>(&'a self, dynamics: &'a Dynamics) -> Option<(u16, &'a Axis)> {
        let (mut most, mut first) = (0, None);
        for (u, axis) in self.axes(dynamics) {
            most = u.max(most);
            let like: &Axis = first.get_or_insert(axis);
            if !axis.is_like(like) {
                return None;
            }
        }
        first.map(|axis| (most, axis))
    }

    /// Returns what limits a move of axes with different limits, and sets the junction deviation.
    #[inline(never)]
    fn look_at_all(&mut self, dynamics: &Dynamics) -> Slowest {
        let mut slowest = Slowest::default();
        let stretches = some(self.stretch);
        let (mut deviation, mut differ) = (None, false);
        for (u, axis) in self.axes(dynamics) {
            differ |= *deviation.get_or_insert(axis.deviation) != axis.deviation;
            // In a move of lengths and angles together, each limit is converted to one along the path.
            let along = |limit| if limit == Short::ZERO { limit } else { over(limit, u) };
            if stretches {
                slowest.look(ONE as u16, along(axis.accel), along(axis.jerk));
            } else {
                slowest.look(u, axis.accel, axis.jerk);
            }
        }
        self.heading.deviation = if differ {
            junction::mean_deviation(&self.heading.unit, dynamics)
        } else {
            deviation.unwrap_or_default()
        };
        slowest
    }

    /// Whether no motor moves half a step, no axis travels 3.3 mm, and the move takes less time than exec needs to
    /// prepare the next one. Cost: 10; 400 if no motor moves half a step.
    #[inline(always)]
    pub(super) fn is_brief(&self) -> bool {
        self.most < HALF_STEP && self.is_short_of_time()
    }

    #[inline(never)]
    #[small]
    fn is_short_of_time(&self) -> bool {
        let near = |way: &i32| i16::try_from(*way).is_ok();
        !self.whole_steps && self.travel.iter().all(near) && self.is_too_fast()
    }

    /// Keeps motors within the step rate that all motors that move can have together. Chords of arcs, and blocks short
    /// enough for parts of a step, get the share [`SHORT_SHARE`] of that rate.
    /// Gives every block at least the time that exec needs ([`BLOCK_S_MIN`]).
    ///
    /// Cost: 300 where logarithms decide; 1,000 for a feed beyond the limit, or just below it. Velocities between the
    /// feed and the top, which matter under an override only, may be limited to up to a seventh less than the motors
    /// can do.
    #[inline(never)]
    pub(super) fn limit_steps(&mut self, rates: &[f32; MOTORS], chord: bool) {
        if self.most < HALF_STEP {
            return self.limit_time();
        }
        let rate = rates[usize::from(self.moving) - 1];
        let short = chord || !self.whole_steps;
        let octaves = if self.whole_steps { 0 } else { i16::from(PARTS_LOG2) };
        // Inlined: this saves 20 cycles for each logarithm.
        let log = |x| Short::new(x).log().0;
        let (top, length) = (log(self.top), log(self.length));
        let share = if short { SHORT_SHARE_LOG } else { 0 };
        let most = Log::of(self.most).0 - octaves * short::OCTAVE;
        let limit = log(rate) + length - most + share - SPARE;
        if top + SPARE > limit {
            if log(self.cruise) + SPARE > limit {
                self.limit_rate(if short { rate * SHORT_SHARE } else { rate }, octaves as i8);
            } else {
                self.top = least(self.top, Log(limit).power().get());
            }
        }
        if top + BLOCK_S_LOG > length {
            self.top = least(self.top, self.length * (1.0 / BLOCK_S_MIN));
        }
        if below(self.top, self.cruise) {
            self.cruise = self.top;
        }
    }

    /// Keeps the motor that moves farthest within a step rate, which is not 0. The motor's distance is in units of
    /// `2^-octaves` steps.
    #[inline(never)]
    #[small]
    fn limit_rate(&mut self, rate: f32, octaves: i8) {
        let most = scaled(f32::from(self.most), -octaves);
        let way = rate * self.length;
        if below(way, self.top * most) {
            self.top = way / most;
        }
    }

    /// Whether the block, at its top velocity, takes less time than exec needs to prepare the next one.
    #[inline(never)]
    fn is_too_fast(&self) -> bool {
        below(self.length, self.top * BLOCK_S_MIN)
    }

    /// Gives a block at least the time that exec needs. Cost: 300.
    #[inline(never)]
    #[small]
    fn limit_time(&mut self) {
        if self.is_too_fast() {
            self.top = self.length * (1.0 / BLOCK_S_MIN);
            self.cruise = least(self.cruise, self.top);
        }
    }
}

/// Returns `top`, or less if an axis with this part of the heading and this velocity limit requires that.
#[inline(never)]
fn slower(top: f32, u: i16, velocity: f32) -> f32 {
    let u = float(part(u));
    if below(velocity, u * top) { within(velocity / u) } else { top }
}

/// Returns an upper bound of the size of a part of the heading, at most [`ONE`].
#[inline(always)]
fn part(u: i16) -> u16 {
    (u.unsigned_abs() + 2).min(ONE as u16)
}

/// Returns `cruise` within [`CRUISE_LEAST`] and [`CRUISE_MOST`]. Cost: 40.
#[inline(never)]
fn within(cruise: f32) -> f32 {
    if below(cruise, CRUISE_LEAST) { CRUISE_LEAST } else { least(cruise, CRUISE_MOST) }
}

/// Returns a limit along the path: the limit of an axis over its part `u` of the heading; neither is 0. Cost: 230,
/// where a division of floats takes 700.
#[inline(never)]
pub(super) fn over(limit: Short, u: u16) -> Short {
    let (mantissa, mut power) = limit.parts();
    let above = u16::from(mantissa) << 7 | 0x8000;
    let mut below = u;
    power = power.wrapping_sub(1);
    while below & 0x8000 == 0 && below != 0 {
        below <<= 1;
        power = power.wrapping_add(1);
    }
    // The quotient less one, because a mantissa leaves out its leading 1.
    let mut rest = above.wrapping_sub(below);
    if above < below {
        rest = rest.wrapping_add(above);
        power = power.wrapping_sub(1);
    }
    Short::of_parts(quotient(u32::from(rest) << 8, below) as u8, power)
}

/// Returns a part of a heading as a float.
fn float(u: u16) -> f32 {
    scaled(f32::from(u), -14)
}

/// The axis that limits the acceleration, and the least limits of all axes.
#[derive(Default)]
pub(super) struct Slowest {
    /// Limit of the axis that limits most; `unit` is its part of the heading.
    pub(super) accel: Short,
    pub(super) unit: u16,
    pub(super) least: Short,
    pub(super) jerk: Short,
    /// Whether limits differ, or an axis has no acceleration limit.
    pub(super) mixed: bool,
}

impl Slowest {
    /// Takes in the limits of an axis with this part of the heading. Cost: 130.
    #[inline(never)]
    pub(super) fn look(&mut self, u: u16, accel: Short, jerk: Short) {
        if jerk != self.jerk {
            self.mixed |= self.unit != 0;
            if jerk != Short::ZERO && (self.jerk == Short::ZERO || jerk < self.jerk) {
                self.jerk = jerk;
            }
        }
        if accel == Short::ZERO {
            self.mixed = true;
            return;
        }
        if self.least == Short::ZERO || accel < self.least {
            self.least = accel;
        }
        let slower = if self.accel == Short::ZERO {
            true
        } else if accel == self.accel {
            self.unit < u
        } else {
            self.mixed = true;
            is_slower(accel, self.unit, self.accel, u)
        };
        if slower {
            self.accel = accel;
            self.unit = u;
        }
    }
}

/// Whether `a / u` is below `b / v`, compared as `a * v` and `b * u`; none of them is 0. Exact. Cost: 90, and 10 for
/// each power of two between `a` and `b`.
#[inline(never)]
fn is_slower(a: Short, v: u16, b: Short, u: u16) -> bool {
    let whole = |(mantissa, _): (u8, u8), by| product(u16::from(mantissa) | 0x100, by);
    let (a, b) = (a.parts(), b.parts());
    let (left, right) = (whole(a, v), whole(b, u));
    if a.1 >= b.1 {
        // `left << n < right`, without an overflow.
        shifted(right.wrapping_sub(1), a.1 - b.1) >= left
    } else {
        shifted(left, b.1 - a.1) < right
    }
}

/// Returns `n`, which has 24 bits, without its lowest `bits` bits.
#[inline(always)]
fn shifted(n: u32, bits: u8) -> u32 {
    if bits < 24 { n >> bits } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn over_is_a_division(limit in 1e-3f32..1e7, u in 1..=ONE as u16) {
            let limit = Short::new(limit);
            let exact = limit.get() / float(u);
            prop_assert_eq!(over(limit, u), Short::new(exact));
        }

        #[test]
        fn the_slower_axis_is_told_exactly(
            a in 1e-3f32..1e7,
            times in prop_oneof![Just(1.0f32), 0.5f32..2.0, 1e-7f32..1e7],
            v in 1..=ONE as u16,
            u in 1..=ONE as u16,
        ) {
            let (a, b) = (Short::new(a), Short::new(a * times));
            let exact = |limit: Short, by: u16| f64::from(limit.get()) * f64::from(by);
            prop_assert_eq!(is_slower(a, v, b, u), exact(a, v) < exact(b, u));
            prop_assert!(!is_slower(a, v, a, v));
        }
    }
}
