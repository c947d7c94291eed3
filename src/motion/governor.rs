//! The governor is the velocity generator: it decides how fast the machine goes in the next few milliseconds.
//!
//! Owned by exec, which calls [`Governor::stretch`] for each stretch. Exec passes the distance left in the block, its
//! velocity limit, and the constraints ahead ([`Ahead`]). The governor goes as fast as the limits allow, and can always
//! slow down in time for all that is queued. A ramp continues over any number of blocks. A limit that changes (more
//! blocks, a lower feed) applies from the present velocity on.
//!
//! Units: mm, s (degrees for a rotary-only move).
//!
//! Without a jerk limit its velocities are those of trapezoids (`trapezoid`). With a jerk limit it works in slices
//! (`slice`, `rise`), with ramps that are laid out once (`ramp`), and scans the constraints ahead at most once for a
//! stretch (`constraint`). The work for a stretch has a bound in every state.
//!
//! Cost on AVR: 1,500 to 2,500 cycles a stretch without a jerk limit. With a jerk limit 500 for a block that ends
//! within the slice, 1,200 at the feed, 3,500 in a ramp; at worst some 19,000, when there is a scan and a ramp is
//! laid out.

pub use super::constraint::Ahead;
use super::constraint::Clear;
use super::exec::SEGMENT_S;
use super::float::{below, greater, scaled, some};
use super::ramp::{Phase, Ramp};
use super::rise::MARGIN_FIRST;
use super::slice::Rest;
use super::speed_constraints::kappa;
use crate::math::sqrt;

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

/// A jerk limit counts as none if it lets the acceleration reach its limit in less than this time, s.
pub(super) const JERK_TIME_MIN: f32 = 0.001;

/// Returns the jerk limit to put into a block, 0 for none; `accel` is the block's acceleration. Neither is negative.
/// Cost: 160.
pub fn effective_jerk(jerk: f32, accel: f32) -> f32 {
    if some(jerk) && below(jerk * JERK_TIME_MIN, accel) { jerk } else { 0.0 }
}

/// Whether two limits, or two velocities, are equal. Cost: 15.
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
    /// `jerk / accel`: by how much [`Governor::alpha`] may change in a second.
    pub pace: f32,
    /// `accel / jerk`: the seconds in which [`Governor::alpha`] goes from 0 to 1.
    pub build: f32,
    /// `sqrt(8 kappa)`.
    pub root: f32,
}

impl Limits {
    /// Returns the limits with the derived values, which are 0 without a jerk limit. Cost: 2,700 with one.
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

/// The velocity generator: velocity and acceleration along the path, at the end of the last slice.
#[derive(Debug, Default)]
#[repr(C)]
pub struct Governor {
    // The most used fields come first: the CPU reaches 64 bytes from a pointer.
    /// mm/s.
    pub(super) velocity: f32,
    pub(super) limits: Limits,
    /// The part of the last slice that has not been handed out.
    pub(super) rest: Rest,
    /// With a jerk limit: the acceleration as a share of its limit, from 0 to 1. A ramp that runs knows its own
    /// acceleration.
    pub(super) alpha: f32,
    /// Whether something ahead has changed that the ramp does not take into account.
    pub(super) changed: bool,
    /// Whether the ramp is that of a feedhold.
    pub(super) halting: bool,
    /// Whether this stretch has had a scan already, or the layout of a ramp, which takes as long.
    pub(super) scanned: bool,
    /// Whether the velocity is steady, and no ramp begins for a while.
    pub(super) far: bool,
    /// Without a jerk limit: a velocity; `square` is its square.
    pub(super) squared: f32,
    pub(super) square: f32,
    /// Without a jerk limit: stretches are twice as long, and the machine does not speed up where it would soon have to
    /// slow down again.
    pub(super) spares: bool,
    /// Whether no time is left for scans that may wait.
    pub(super) hurry: bool,
    /// Whether no time is left for scans at the end of an acceleration.
    pub(super) tight: bool,
    /// Slices until another attempt to go faster is worthwhile.
    pub(super) wait: u8,
    /// Slices until going faster by little is worthwhile.
    pub(super) calm: u8,
    /// By how many slices the next scan looks further ahead than it has to.
    pub(super) margin: u8,
    /// Whether a scan has found a velocity unsafe: the acceleration is about to end.
    pub(super) closing: bool,
    /// Counts slices of a ramp.
    pub(super) turn: u8,
    /// Whether an override has ever changed feeds: a limit that comes from a feed may then be too near to be kept.
    pub(super) late: bool,
    /// What is known of the constraints ahead.
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

    /// Multiplies the velocity, because distances along the path count for this much more from here on. There is no jerk
    /// limit.
    pub fn rescale(&mut self, ratio: f32) {
        self.velocity *= ratio;
    }

    /// Returns the time (s) and distance (mm) that have been computed but not handed out. [`Governor::velocity`] is the
    /// velocity at their end.
    pub fn pending(&self) -> (f32, f32) {
        (self.rest.seconds, self.rest.distance)
    }

    /// The acceleration limit of the block that runs, mm/s^2.
    pub fn accel(&self) -> f32 {
        self.limits.accel
    }

    /// Whether the machine stands still, and nothing remains to be handed out.
    pub fn is_at_rest(&self) -> bool {
        !some(self.velocity) && !some(self.rest.seconds)
    }

    /// Puts the machine at a standstill.
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

    /// Begins a block with these limits, mm/s^2 and mm/s^3. If they differ from the limits before, an acceleration ends
    /// at once, and a deceleration is reduced to what can still be ended in time.
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

    /// Takes into account that an override has changed the feeds of the running block and of those ahead.
    pub fn change_feed(&mut self) {
        (self.late, self.changed) = (true, true);
        self.clear.forget();
        self.wait = 0;
        if !self.halting && self.ramp.as_ref().is_some_and(|ramp| ramp.phase() == Phase::Up) {
            self.leave_ramp();
        }
    }

    /// Sets whether the CPU has no time left: then the governor makes only the scans that it needs to go on.
    #[inline(always)]
    pub fn set_hurry(&mut self, hurry: bool) {
        self.hurry = hurry;
    }

    /// If it is `tight`, the CPU has no time for another scan at the end of an acceleration. Exec level.
    #[inline(always)]
    pub fn set_tight(&mut self, tight: bool) {
        self.tight = tight;
    }

    /// Whether the velocity is steady, with a jerk limit, and no ramp begins in the next stretches.
    pub fn is_far_from_ramps(&self) -> bool {
        self.far
    }

    /// Takes into account that the constraints ahead have changed.
    pub fn look_again(&mut self) {
        self.changed = true;
    }

    /// Returns the next stretch, of [`SEGMENT_S`], without a jerk limit, as `trapezoid` does. No remainder of a slice
    /// may be left.
    pub(super) fn sharply(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        self.spares = false;
        self.trapezoid(left, cruise, headroom)
    }

    /// Returns the next stretch, of about `seconds`, in a block with `left` mm to go at up to `cruise` mm/s.
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
