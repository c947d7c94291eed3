//! Slices: under a jerk limit the governor computes velocities for a few milliseconds at a time, independently of the
//! ends of blocks.
//!
//! Called by [`Governor::stretch`](super::governor::Governor::stretch), exec level. A stretch is a slice, or the part
//! of a slice that lies in the running block; the remainder of the slice belongs to the blocks that follow. So the
//! mathematics of a ramp is done once for each slice, however short blocks are. A block that ends within the slice
//! costs one multiplication. Near the end of a block slices are made longer or shorter, so that a stretch is much
//! shorter than a slice only if its block is.
//!
//! Units: mm, s.

use super::constraint::Ahead;
use super::exec::SEGMENT_S;
use super::float::{below, greater, less, ratio, scaled, some};
use super::governor::{Governor, Stretch, same};

/// The remainder of a slice: computed, but not handed out yet.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rest {
    pub seconds: f32,
    pub distance: f32,
    /// Seconds per millimetre, once a part has been handed out.
    inverse: f32,
}

impl Rest {
    pub const NONE: Self = Self { seconds: 0.0, distance: 0.0, inverse: 0.0 };
}

/// The parameters of the next slice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Distance from the present state to the end of the block, mm.
    pub left: f32,
    /// Velocity limit, mm/s.
    pub cruise: f32,
    /// Duration of the slice, s.
    pub seconds: f32,
}

/// The fine ticks of a steady velocity end 2 to this power stretches before a ramp begins.
const FAR_LOG2: i8 = 3;

/// Returns the longest stretch, s, where most stretches are `nominal` seconds long. The limit keeps a feedhold prompt:
/// it begins after the stretches that have been handed out.
#[inline(always)]
pub(super) fn longest(nominal: f32) -> f32 {
    if same(nominal, SEGMENT_S) { 1.5 * SEGMENT_S } else { 2.0 * SEGMENT_S }
}

/// The distance that rounding may leave at a standstill, mm. It needs no ramp of its own.
const ROUNDING: f32 = 5e-4;

impl Governor {
    /// Returns the next stretch, in slices of about `nominal` seconds.
    #[inline(never)]
    pub(super) fn smooth(
        &mut self,
        left: f32,
        cruise: f32,
        ahead: &impl Ahead,
        nominal: f32,
    ) -> Stretch {
        if self.is_within_slice(left) {
            return self.part(left);
        }
        if let Some(stretch) = self.steady(left, cruise, nominal) {
            return stretch;
        }
        if self.halting {
            self.halting = false;
            self.leave_ramp();
        }
        (self.scanned, self.far) = (false, false);
        let mut span = Span { left, cruise, seconds: nominal };
        for _ in 0..2u8 {
            if !self.wanted(left, nominal, &mut span) || !self.slice(&span, ahead) {
                break;
            }
            if self.scanned || same(span.seconds, nominal) {
                break;
            }
        }
        self.cut(left)
    }

    /// Returns a stretch at the feed, if the machine is at the feed and is known to be able to keep it; else `None`.
    /// The stretch is not cut from a slice; it covers all of a short block. Cost: 700, 1,200 at the end of a block.
    #[inline(always)]
    fn steady(&mut self, left: f32, cruise: f32, nominal: f32) -> Option<Stretch> {
        let velocity = self.velocity;
        let free = self.ramp.is_none() && !some(self.alpha) && !some(self.rest.seconds);
        if !free || self.halting || !same(velocity, cruise) {
            return None;
        }
        let slice = velocity * nominal;
        let ends = below(left, velocity * longest(nominal));
        let distance = if ends {
            left
        } else if below(left, scaled(slice, 1)) {
            scaled(left, -1)
        } else {
            slice
        };
        let at = self.potential(distance);
        // Twice the distance must be known to be clear, so that the next scan comes before its answer can require a
        // ramp.
        if !self.is_clear(velocity, scaled(at, 1)) {
            return None;
        }
        self.far = !below(self.clear.distance, scaled(at, FAR_LOG2));
        self.clear.distance -= at;
        self.clear.age += 1;
        let seconds = if same(distance, slice) { nominal } else { ratio(distance, velocity) };
        Some(Stretch { seconds, distance, ends })
    }

    /// Returns a stretch of a feedhold.
    #[inline(never)]
    pub(super) fn smooth_halt(&mut self, left: f32, nominal: f32) -> Stretch {
        if self.is_within_slice(left) {
            return self.part(left);
        }
        if !self.halting {
            self.halt_ramp();
        }
        for _ in 0..2u8 {
            if self.ramp.is_none() {
                break;
            }
            let mut span = Span { left, cruise: 0.0, seconds: nominal };
            if !self.wanted(left, nominal, &mut span) {
                break;
            }
            self.follow(span.seconds);
        }
        self.cut(left)
    }

    /// Whether the block ends within the slice.
    #[inline(always)]
    fn is_within_slice(&self, left: f32) -> bool {
        below(left, self.rest.distance)
    }

    /// Whether another slice is needed, because otherwise the stretch would be too short, or leave too little of the
    /// block. Sets in `span` the distance to the end of the block, and the duration of the slice if it is not
    /// `nominal`. Cost: 200, 1,000 near the end of a block.
    #[inline(never)]
    fn wanted(&self, left: f32, nominal: f32, span: &mut Span) -> bool {
        let Rest { seconds, distance, .. } = self.rest;
        let velocity = self.velocity;
        let slice = velocity * nominal;
        if !some(seconds) && some(velocity) && below(scaled(slice, 1), left) {
            // The block is long, so the slice has its nominal duration.
            return true;
        }
        let more = left - distance;
        span.left = more;
        if !below(self.little(), more) {
            return !below(0.0, distance);
        }
        // Slices are longer while the CPU is short of time. Such a slice is continued over a remainder of the block of
        // up to two thirds of a slice; a usual one over up to half a slice.
        let usual = same(nominal, SEGMENT_S);
        let enough = if usual { scaled(more, 1) } else { more + scaled(more, -1) };
        let much = !below(enough, slice);
        if much && !below(scaled(seconds, 1), nominal) {
            return false;
        }
        if much && below(more, scaled(slice, 1)) {
            // Makes the slice end about where the block does.
            let time = ratio(more, velocity);
            let long = !below(time, longest(nominal));
            span.seconds = if long { scaled(time, -1) } else { time };
        }
        true
    }

    /// Returns the distance that counts as zero, mm.
    #[inline(always)]
    fn little(&self) -> f32 {
        if some(self.velocity) { scaled(self.velocity, -13) } else { ROUNDING }
    }

    /// Whether a block without a jerk limit begins with the remainder of a slice. Drops a remainder below the rounding
    /// error.
    pub(super) fn has_rest(&mut self) -> bool {
        if some(self.rest.seconds) && !below(self.little(), self.rest.distance) {
            self.rest = Rest::NONE;
        }
        some(self.rest.seconds)
    }

    /// Adds a computed slice of `distance` mm; `at` is this distance as brake potential.
    #[inline(always)]
    pub(super) fn add(&mut self, seconds: f32, distance: f32, at: f32) {
        self.clear.distance -= at;
        self.clear.age = self.clear.age.saturating_add(1);
        if some(self.rest.seconds) {
            self.rest.seconds += seconds;
            self.rest.distance += distance;
        } else {
            self.rest = Rest { seconds, distance, inverse: 0.0 };
        }
    }

    /// Returns the part of the computed slices that lies in the block.
    #[inline(never)]
    pub(super) fn cut(&mut self, left: f32) -> Stretch {
        let Rest { seconds, distance, .. } = self.rest;
        let more = left - distance;
        if below(self.little(), more) {
            self.rest = Rest::NONE;
            // A stretch that ended a block may have taken slightly more than was computed. If a stop left no slice to
            // make up for it, the remainder is negative, and counts as zero.
            let (seconds, distance) = (greater(seconds, 1e-6), greater(distance, 0.0));
            return Stretch { seconds, distance, ends: false };
        }
        if !some(self.velocity) && !less(more, -ROUNDING) {
            self.rest = Rest::NONE;
            return Stretch { seconds: greater(seconds, 1e-6), distance: left, ends: true };
        }
        // Rounding may make the remainder slightly negative.
        self.rest.inverse = ratio(seconds, distance);
        self.part(left)
    }

    /// Hands out a stretch of `left` mm, which ends the block, from the slice.
    #[inline(always)]
    fn part(&mut self, left: f32) -> Stretch {
        let seconds = left * self.rest.inverse;
        self.rest.seconds -= seconds;
        self.rest.distance -= left;
        Stretch { seconds, distance: left, ends: true }
    }
}
