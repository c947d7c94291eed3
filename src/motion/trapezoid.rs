//! The velocity generator without a jerk limit: trapezoidal velocity profiles.
//!
//! Called by [`Governor::stretch`], exec level. At the end of a stretch the velocity satisfies
//! `v^2 <= headroom + 2 A left`, where `left` depends on the length of the stretch itself. Units: mm, s. Cost on AVR:
//! 1,500 cycles a stretch, 2,500 for one that ends a block or brakes.

use super::exec::SEGMENT_S;
use super::float::{OCTAVE, below, greater, least, lesser, log, ratio, scaled, some};
use super::governor::{Governor, Stretch, same};
use super::slice::longest;
use crate::math::sqrt;

/// If two logarithms differ by more than this, their comparison is certain.
const PLAIN: i32 = OCTAVE / 5;

/// The least worthwhile gain of the velocity's square, about a third of it, as a logarithm.
const SCARCE: i32 = 3 * (OCTAVE / 8);

impl Governor {
    /// Returns the next stretch, of about [`SEGMENT_S`], or twice that where the governor
    /// [`spares`](Governor::spares) velocity.
    #[inline(never)]
    pub(super) fn trapezoid(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        if self.stays(cruise, headroom) {
            self.steadily(left)
        } else {
            self.change(left, cruise, headroom)
        }
    }

    /// Returns the next stretch, at the present velocity.
    #[inline(always)]
    fn steadily(&self, left: f32) -> Stretch {
        let v = self.velocity;
        let (seconds, longest) = self.nominal();
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
        let v = self.velocity;
        let (seconds, longest) = self.nominal();
        // Logarithms mostly decide that a single stretch covers the block.
        if log(v) + log(longest) < log(left) + PLAIN && below(v * longest, left) {
            let gain = self.limits.accel * seconds;
            let half = 0.5 * seconds;
            // An override may have lowered the feed below the velocity.
            let mut next = greater(lesser(v + gain, cruise), v - gain);
            let mut distance = (v + next) * half;
            let twice = self.limits.accel + self.limits.accel;
            if next * next > headroom + twice * (left - distance) {
                let b = 0.5 * gain;
                next = sqrt(b * b + headroom + twice * left - gain * v) - b;
                // Braking a little harder than the limit makes up for rounding.
                let least = v - gain * 1.005;
                next = greater(lesser(next, cruise), greater(least, 0.0));
                distance = (v + next) * half;
            }
            if distance + half * next < left && distance > 0.0 {
                self.velocity = next;
                return Stretch { seconds, distance, ends: false };
            }
        }
        self.finish(left, cruise, headroom)
    }

    /// Returns the nominal and the longest duration of a stretch, s.
    #[inline(always)]
    fn nominal(&self) -> (f32, f32) {
        if self.spares {
            const TWICE: f32 = 2.0 * SEGMENT_S;
            (TWICE, longest(TWICE))
        } else {
            (SEGMENT_S, longest(SEGMENT_S))
        }
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
        if least > next + self.limits.accel * SEGMENT_S { least } else { next }
    }

    /// Returns the whole remainder of a block in one stretch.
    #[inline(never)]
    fn finish(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        let v = self.velocity;
        let (nominal, _) = self.nominal();
        let gain = scaled(self.limits.accel * left, 1);
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
                seconds = (peak + peak - sum) / self.limits.accel;
            } else {
                let ramps = (cruise + cruise - sum) / self.limits.accel;
                // The distance that the ramps lose against the cruise velocity, times the acceleration. The mean
                // velocity of a ramp is that of its ends.
                let slower =
                    0.5 * ((cruise - v) * (cruise - v) + (cruise - next) * (cruise - next));
                seconds = (left + slower / self.limits.accel) / cruise;
                seconds = greater(seconds, ramps);
            }
        }
        Stretch { seconds, distance: left, ends: true }
    }
}
