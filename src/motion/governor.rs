//! The governor, which generates velocities: how fast the machine goes in the next few milliseconds.
//!
//! Owned by exec, which asks [`Governor::stretch`] for one stretch after the other: with the distance left in
//! the block, its velocity limit, and what is ahead ([`Ahead`]). It goes as fast as it may, always able
//! to slow down in time for all that is queued. It does not care where blocks begin and end, so a ramp goes on over any number
//! of them, and a limit that changes (more blocks, a lower feed) is taken up from where it is.
//!
//! Units: mm, s (degrees for a rotary-only move).
//!
//! Without a jerk limit its velocities are those of trapezoids (`trapezoid`). With one it works in slices
//! (`slice`, `rise`), with ramps that are laid out once (`ramp`), and looks at what is ahead at most once for a stretch
//! (`constraint`). The work for a stretch has a bound in every state.
//!
//! Cost on AVR: 1,500 to 2,500 cycles a stretch without a jerk limit. With one 500 for a block that is over within the slice,
//! 1,200 at the feed, 3,500 in a ramp; at worst some 19,000, with a scan and a ramp that is laid out.

pub use super::constraint::Ahead;
use super::constraint::Clear;
use super::exec::SEGMENT_S;
use super::float::{below, greater, scaled, some};
use super::ramp::{Phase, Ramp};
use super::rise::MARGIN_FIRST;
use super::slice::Rest;
use super::speed_constraints::kappa;
use crate::math::sqrt;

/// A part of a block, all of it that is left or less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// How long it takes, s.
    pub seconds: f32,
    /// How far it goes, mm; to the end of the block if `ends`.
    pub distance: f32,
    /// The stretch is the last of the block.
    pub ends: bool,
}

/// An acceleration limit no machine has: stands for none, and keeps floats in range.
pub const ACCEL_MOST: f32 = 1e6;

/// A jerk limit that takes the acceleration to its limit in less is none: stretches are no shorter.
pub(super) const JERK_TIME_MIN: f32 = 0.001;

/// The jerk to put into a block, 0 for none; `accel` is its acceleration. Neither is negative. Cost: 160.
pub fn effective_jerk(jerk: f32, accel: f32) -> f32 {
    if some(jerk) && below(jerk * JERK_TIME_MIN, accel) { jerk } else { 0.0 }
}

/// Whether two limits are equal, or one velocity is the other. Cost: 15.
pub(super) fn same(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits()
}

/// Limits of the block that runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub(super) struct Limits {
    /// mm/s^2.
    pub accel: f32,
    /// mm/s^3, 0 for none.
    pub jerk: f32,
    /// `accel^2 / 2 jerk`, mm/s.
    pub kappa: f32,
    /// `jerk / accel`: how much alpha may change in a second.
    pub pace: f32,
    /// `accel / jerk`: the seconds that takes from 0 to 1.
    pub build: f32,
    /// `sqrt(8 kappa)`.
    pub root: f32,
}

impl Limits {
    /// In floats what follows from the two limits; only they without a jerk limit. Cost: 2,700 with one.
    pub fn new(accel: f32, jerk: f32) -> Self {
        let mut limits = Self { accel, jerk, ..Self::NONE };
        if some(jerk) {
            limits.kappa = kappa(accel, jerk);
            limits.pace = jerk / accel;
            limits.build = accel / jerk;
            limits.root = sqrt(scaled(limits.kappa, 3));
        }
        limits
    }

    const NONE: Self = Self { accel: 0.0, jerk: 0.0, kappa: 0.0, pace: 0.0, build: 0.0, root: 0.0 };
}

/// Velocity and acceleration along the path, at the end of what has been worked out.
#[derive(Debug, Default)]
#[repr(C)]
pub struct Governor {
    // What is used most comes first: the CPU reaches 64 bytes from a pointer.
    /// mm/s.
    pub(super) velocity: f32,
    pub(super) limits: Limits,
    /// What of the last slice has not been handed out.
    pub(super) rest: Rest,
    /// The acceleration as a share of its limit, with a jerk limit. From 0 to 1 unless a ramp runs, which knows it.
    pub(super) alpha: f32,
    /// Something ahead has changed that a ramp does not know.
    pub(super) changed: bool,
    /// The ramp is that of a feedhold.
    pub(super) halting: bool,
    /// What is ahead has been looked at for this stretch, or a ramp has been laid out, which takes as long.
    pub(super) scanned: bool,
    /// The velocity is steady, and no ramp begins for a while.
    pub(super) far: bool,
    /// Without a jerk limit: a velocity, and its square.
    pub(super) squared: f32,
    pub(super) square: f32,
    /// Without a jerk limit: stretches are twice as long, and a velocity that would soon be lost again is not gained.
    pub(super) spares: bool,
    /// No time for looks ahead.
    pub(super) hurry: bool,
    /// No time for looks at the end of an acceleration.
    pub(super) tight: bool,
    /// Slices until it is worth another try to go faster.
    pub(super) wait: u8,
    /// Slices until it is worth while to go faster by little.
    pub(super) calm: u8,
    /// Slices by which the next scan looks further than it has to.
    pub(super) margin: u8,
    /// A scan has not found what it asked for: the acceleration is about to end.
    pub(super) closing: bool,
    /// Counts slices of a ramp.
    pub(super) turn: u8,
    /// An override has changed feeds, ever: a limit that a feed makes may be too near to be kept.
    pub(super) late: bool,
    /// What is known of what is ahead.
    pub(super) clear: Clear,
    pub(super) ramp: Option<Ramp>,
}

impl Governor {
    /// At rest.
    pub const fn new() -> Self {
        Self {
            velocity: 0.0,
            alpha: 0.0,
            limits: Limits::NONE,
            ramp: None,
            rest: Rest::NONE,
            clear: Clear::START,
            changed: false,
            halting: false,
            scanned: false,
            far: false,
            squared: 0.0,
            square: 0.0,
            spares: false,
            hurry: false,
            tight: false,
            wait: 0,
            calm: 0,
            margin: MARGIN_FIRST,
            closing: false,
            turn: 0,
            late: false,
        }
    }

    /// Velocity, mm/s, at the end of the last slice.
    pub fn velocity(&self) -> f32 {
        self.velocity
    }

    /// Time (s) and distance (mm) that have been worked out and not been handed out: [`Governor::velocity`] is that so much later.
    pub fn pending(&self) -> (f32, f32) {
        (self.rest.seconds, self.rest.distance)
    }

    /// The acceleration limit of the block that runs, mm/s^2.
    pub fn accel(&self) -> f32 {
        self.limits.accel
    }

    /// Whether the machine stands still, and nothing is left to be handed out.
    pub fn is_at_rest(&self) -> bool {
        !some(self.velocity) && !some(self.rest.seconds)
    }

    /// The machine stands still.
    #[inline(never)]
    #[small]
    pub fn stop(&mut self) {
        (self.velocity, self.alpha) = (0.0, 0.0);
        self.rest = Rest::NONE;
        self.clear.forget();
        self.ramp = None;
        self.halting = false;
        (self.wait, self.margin, self.closing) = (0, MARGIN_FIRST, false);
    }

    /// A block with these limits begins, mm/s^2 and mm/s^3. If they are others than before, it goes on with
    /// as much of its deceleration as may be ended in time; acceleration ends at once.
    #[inline(always)]
    pub fn begin(&mut self, accel: f32, jerk: f32) {
        if !some(jerk) && !some(self.limits.jerk) {
            // Without a jerk limit nothing else depends on the acceleration.
            self.limits.accel = accel;
        } else if !same(accel, self.limits.accel) || !same(jerk, self.limits.jerk) {
            self.change_limits(accel, jerk);
        }
    }

    #[inline(never)]
    fn change_limits(&mut self, accel: f32, jerk: f32) {
        self.leave_ramp();
        self.halting = false;
        self.clear.forget();
        (self.wait, self.margin, self.closing) = (0, MARGIN_FIRST, false);
        let mut alpha = 0.0;
        if some(jerk) && self.alpha < 0.0 {
            alpha = greater(self.alpha * self.limits.accel / accel, -1.0);
            let most = sqrt(2.0 * jerk * self.velocity) / accel;
            alpha = greater(alpha, -most);
        }
        self.alpha = alpha;
        self.limits = Limits::new(accel, jerk);
    }

    /// An override has changed feeds, of what runs and of what is ahead.
    pub fn change_feed(&mut self) {
        (self.late, self.changed) = (true, true);
        self.clear.forget();
        self.wait = 0;
        if !self.halting && self.ramp.as_ref().is_some_and(|ramp| ramp.phase() == Phase::Up) {
            self.leave_ramp();
        }
    }

    /// The CPU has no time left: no looks ahead but those that it takes to go on. Or it has.
    #[inline(always)]
    pub fn set_hurry(&mut self, hurry: bool) {
        self.hurry = hurry;
    }

    /// Whether the velocity is steady, with a jerk limit, and no ramp begins in the next stretches.
    pub fn is_far_from_ramps(&self) -> bool {
        self.far
    }

    /// What is ahead has changed.
    pub fn look_again(&mut self) {
        self.changed = true;
    }

    /// The next stretch of [`SEGMENT_S`] without a jerk limit, as `trapezoid`; nothing is left of another.
    pub(super) fn sharply(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        self.spares = false;
        self.trapezoid(left, cruise, headroom)
    }

    /// The next stretch, of about `seconds`, in a block with `left` mm to go at up to `cruise` mm/s.
    #[inline(always)]
    pub fn stretch(&mut self, left: f32, cruise: f32, ahead: &impl Ahead, seconds: f32) -> Stretch {
        if some(self.limits.jerk) {
            return self.smooth(left, cruise, ahead, seconds);
        }
        if some(self.rest.seconds) && self.has_rest() {
            return self.cut(left);
        }
        self.spares = !same(seconds, SEGMENT_S);
        self.trapezoid(left, cruise, ahead.headroom())
    }
}
