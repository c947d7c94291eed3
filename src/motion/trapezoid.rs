//! Trapezoidal velocity profiles.
//!
//! Part of the [`Governor`], exec level. At the end of a stretch the velocity satisfies
//! `v^2 <= headroom + 2 A left`, where `left` depends on the length of the stretch itself. Units: mm, s. Cost on AVR:
//! 1,500 cycles a stretch, 2,500 for one that ends a block or brakes.

use super::exec::SEGMENT_S;
use super::float::{OCTAVE, below, greater, least, lesser, log, ratio, scaled, some};
use super::governor::{Governor, Stretch, same};
use crate::math::sqrt;

/// If two logarithms differ by more than this, their comparison is certain.
const PLAIN: i32 = OCTAVE / 5;

/// The least worthwhile gain of the velocity's square, about a third of it, as a logarithm.
const SCARCE: i32 = 3 * (OCTAVE / 8);

/// Returns the longest stretch, s, where most stretches are `nominal` seconds long. The limit keeps a feedhold prompt:
/// it begins after the stretches that have been handed out.
#[inline(always)]
pub(super) fn longest(nominal: f32) -> f32 {
    1.5 * nominal
}

impl Governor {
    /// Returns the next stretch, in a block with `left` mm to go at up to `cruise` mm/s. Its duration is about that of
    /// [`Governor::take`].
    #[inline(never)]
    pub fn stretch(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        if self.stays(cruise, headroom) {
            self.steadily(left)
        } else {
            self.change(left, cruise, headroom)
        }
    }

    /// Returns the next stretch, which takes the duration of [`Governor::take_exactly`], or less if it ends the block.
    #[inline(never)]
    pub fn part(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        let (v, seconds) = (self.velocity, self.nominal);
        if self.stays(cruise, headroom) {
            let way = v * seconds;
            return match below(way, left) {
                true => Stretch { seconds, distance: way, ends: false },
                false => Stretch { seconds: ratio(left, v), distance: left, ends: true },
            };
        }
        let headroom = greater(headroom, 0.0);
        // Mostly the stretch plainly covers all of a short block.
        if some(v) && log(v) + log(seconds) > log(left) + PLAIN {
            let stretch = self.finish(left, cruise, headroom);
            if !below(seconds, stretch.seconds) {
                return stretch;
            }
            self.velocity = v;
        }
        let (next, distance) = self.changed(left, cruise, headroom);
        if below(distance, left) && some(distance) {
            self.velocity = next;
            return Stretch { seconds, distance, ends: false };
        }
        let stretch = self.finish(left, cruise, headroom);
        Stretch { seconds: least(stretch.seconds, seconds), ..stretch }
    }

    /// Returns the next stretch, at the present velocity.
    #[inline(always)]
    fn steadily(&self, left: f32) -> Stretch {
        let (v, seconds, longest) = (self.velocity, self.nominal, self.longest);
        // Logarithms mostly decide whether the stretch reaches the end of the block.
        let beyond = log(v) + log(longest) - log(left);
        if beyond > PLAIN || beyond > -PLAIN && below(left, v * longest) {
            return Stretch { seconds: ratio(left, v), distance: left, ends: true };
        }
        Stretch { seconds, distance: v * seconds, ends: false }
    }

    /// Returns the next stretch, with another velocity at its end. Out of line, because it saves more registers.
    #[inline(never)]
    fn change(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        // Rounding may put a stop before the end of the block.
        let headroom = if headroom.is_sign_negative() { 0.0 } else { headroom };
        let (v, seconds, longest) = (self.velocity, self.nominal, self.longest);
        // Logarithms mostly decide that a single stretch covers the block.
        if log(v) + log(longest) < log(left) + PLAIN && below(v * longest, left) {
            let (next, distance) = self.changed(left, cruise, headroom);
            if distance + 0.5 * seconds * next < left && distance > 0.0 {
                self.velocity = next;
                return Stretch { seconds, distance, ends: false };
            }
        }
        self.finish(left, cruise, headroom)
    }

    /// Returns the velocity at the end of a stretch of nominal duration, and the distance until then.
    #[inline(always)]
    fn changed(&self, left: f32, cruise: f32, headroom: f32) -> (f32, f32) {
        let (v, seconds, accel) = (self.velocity, self.nominal, self.accel);
        let gain = accel * seconds;
        let half = 0.5 * seconds;
        // An override may have lowered the feed below the velocity.
        let next = greater(lesser(v + gain, cruise), v - gain);
        let distance = (v + next) * half;
        let twice = accel + accel;
        if next * next <= headroom + twice * (left - distance) {
            return (next, distance);
        }
        let b = 0.5 * gain;
        let square = greater(b * b + headroom + twice * left - gain * v, 0.0);
        let next = sqrt(square) - b;
        // Braking a little harder than the limit makes up for rounding.
        let least = v - gain * 1.005;
        let next = greater(lesser(next, cruise), greater(least, 0.0));
        (next, (v + next) * half)
    }

    /// Whether the velocity is kept. Either it is the limit; or stretches are longer because CPU time is short, and the
    /// velocity is so near to the limit at the end of the block that a gain would soon be lost again.
    #[inline(always)]
    fn stays(&mut self, cruise: f32, headroom: f32) -> bool {
        let v = self.velocity;
        if !same(self.squared, v) {
            (self.squared, self.square) = (v, v * v);
        }
        let square = self.square;
        if below(headroom, square) || !some(v) {
            return false;
        }
        same(v, cruise) || self.spares && below(v, cruise) && log(headroom) < log(square) + SCARCE
    }

    /// Returns `next`, or the least velocity that can be reached at the end from `v`, if that is above `next` by more
    /// than rounding: an override has lowered the limit too late. `gain` is by how much the square of the velocity
    /// can fall.
    #[inline(never)]
    pub(super) fn slowest(&self, v: f32, gain: f32, next: f32) -> f32 {
        let least = sqrt(greater(v * v - gain, 0.0));
        if least > next + self.accel * SEGMENT_S { least } else { next }
    }

    /// Returns the whole remainder of a block in one stretch.
    #[inline(never)]
    fn finish(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        let (v, nominal) = (self.velocity, self.nominal);
        let gain = scaled(self.accel * left, 1);
        let square = v * v + gain;
        let next = least(sqrt(least(square, headroom)), cruise);
        let late = below(next, v) && (self.late || below(cruise, v));
        let next = if late { self.slowest(v, gain, next) } else { next };
        self.velocity = next;
        let sum = v + next;
        let mut seconds = 2.0 * nominal;
        if below(cruise, v)
            || log(sum) + log(nominal) > log(left) + PLAIN
            || below(left, sum * nominal)
        {
            seconds = ratio(scaled(left, 1), sum);
        } else if square > 0.0 {
            // From standstill to standstill, or nearly so, with a peak between.
            let peak = sqrt(0.5 * (square + next * next));
            if peak < cruise {
                seconds = (peak + peak - sum) / self.accel;
            } else {
                let ramps = (cruise + cruise - sum) / self.accel;
                // The distance that the ramps lose against the cruise velocity, times the acceleration. The mean
                // velocity of a ramp is that of its ends.
                let slower =
                    0.5 * ((cruise - v) * (cruise - v) + (cruise - next) * (cruise - next));
                seconds = (left + slower / self.accel) / cruise;
                seconds = greater(seconds, ramps);
            }
        }
        Stretch { seconds, distance: left, ends: true }
    }
}
