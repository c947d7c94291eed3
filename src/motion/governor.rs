//! The governor is the velocity generator: it decides how fast the machine goes in the next few milliseconds.
//!
//! Owned by exec, which calls it for each stretch. Exec passes the distance left in the block, its velocity limit, and
//! the square of the velocity that is allowed at its end (`headroom`), from the
//! [speed constraints](super::speed_constraints). The governor goes as fast as the limits allow, and can always slow
//! down in time for all that is queued. A ramp continues over any number of blocks. A limit that changes (more blocks, a
//! lower feed) applies from the present velocity on.
//!
//! Velocities are those of trapezoids (`trapezoid`, and `halt` for a hold). What limits jerk comes behind
//! ([`smooth`](super::smooth)). With means a stretch is never longer than what is left of the sample
//! ([`Governor::part`]); without, a stretch has a nominal duration, and is longer or shorter near the end of a block
//! ([`Governor::stretch`]).
//!
//! Units: mm, s (degrees for a rotary-only move). Cost on AVR: 1,500 to 2,500 cycles a stretch.

use super::float::some;
use super::trapezoid::longest;

/// A part of a block: all that is left of it, or less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// How long it takes, s.
    pub seconds: f32,
    /// How far it goes, mm; to the end of the block if `ends`.
    pub distance: f32,
    /// Whether the stretch is the last of the block.
    pub ends: bool,
}

/// The acceleration that stands for no limit, mm/s^2. It is above that of any machine, and keeps floats in range.
pub const ACCEL_MOST: f32 = 1e6;

/// Whether two limits, or two velocities, are equal. Cost: 15.
pub(super) fn same(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits()
}

/// The velocity generator: the velocity along the path at the end of the last stretch.
#[derive(Debug, Default)]
#[repr(C)]
pub struct Governor {
    /// mm/s.
    pub(super) velocity: f32,
    /// Acceleration limit of the block that runs, mm/s^2.
    pub(super) accel: f32,
    /// A velocity; `square` is its square.
    pub(super) squared: f32,
    pub(super) square: f32,
    /// Nominal duration of a stretch, s; and the longest duration.
    pub(super) nominal: f32,
    pub(super) longest: f32,
    /// Whether CPU time is short: the machine does not speed up where it would soon have to slow down again.
    pub(super) spares: bool,
    /// Whether an override has ever changed feeds: a limit that comes from a feed may then be too near to be kept.
    pub(super) late: bool,
}

impl Governor {
    /// At rest.
    pub const fn new() -> Self {
        Self {
            velocity: 0.0,
            accel: 0.0,
            squared: 0.0,
            square: 0.0,
            nominal: 0.0,
            longest: 0.0,
            spares: false,
            late: false,
        }
    }

    /// Velocity, mm/s, at the end of the last stretch.
    #[inline(always)]
    pub fn velocity(&self) -> f32 {
        self.velocity
    }

    /// Multiplies the velocity, because distances along the path count for this much more from here on.
    pub fn rescale(&mut self, ratio: f32) {
        self.velocity *= ratio;
    }

    /// The acceleration limit of the block that runs, mm/s^2.
    pub fn accel(&self) -> f32 {
        self.accel
    }

    /// Whether the machine stands still.
    #[inline(always)]
    pub fn is_at_rest(&self) -> bool {
        !some(self.velocity)
    }

    /// Puts the machine at a standstill.
    pub fn stop(&mut self) {
        self.velocity = 0.0;
    }

    /// Begins a block with this limit, mm/s^2.
    #[inline(always)]
    pub fn begin(&mut self, accel: f32) {
        self.accel = accel;
    }

    /// Takes into account that an override has changed the feeds of the running block and of those ahead.
    pub fn change_feed(&mut self) {
        self.late = true;
    }

    /// Sets the duration of the next stretch, s. It is longer by up to a half near the end of a block.
    #[inline(always)]
    pub fn take(&mut self, seconds: f32) {
        (self.nominal, self.longest) = (seconds, longest(seconds));
        self.spares = false;
    }

    /// Sets the duration of the next stretch, s, where CPU time is short: a stretch near the end of a block is no longer
    /// than that, and velocities change less often.
    #[inline(always)]
    pub fn take_long(&mut self, seconds: f32) {
        (self.nominal, self.longest) = (seconds, seconds);
        self.spares = true;
    }

    /// Sets the longest duration of the next stretch, s: what is left of a sample.
    #[inline(always)]
    pub fn take_exactly(&mut self, seconds: f32) {
        (self.nominal, self.longest) = (seconds, seconds);
        self.spares = false;
    }
}
