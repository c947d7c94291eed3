//! Computes one slice under a jerk limit: as fast as the limits allow, in bounded time.
//!
//! Called for each slice (`slice`), exec level. The state is a velocity v and an acceleration, alpha times its limit A.
//!
//! **Safe.** An acceleration takes time to end. So what counts is the *top*: the velocity `v + k alpha^2` that is
//! reached if the acceleration begins to end now, and the place where it is reached. A state is safe if the top may be
//! held as a steady velocity from that place on ([`Clear`]). It stays safe while the acceleration ends, and at the top
//! for as long as `Clear` says. A ramp that is laid out then, as hard as the limits allow, is in time for every
//! constraint ahead. So the machine can always go on without another scan.
//!
//! **Faster.** In each slice alpha is raised, or kept, or ended at the feed, if the resulting top is safe. A scan tries
//! a top some slices ahead, so that the next slices need no scan. If that top is not safe, the answer for a lower top
//! stays valid. The next scan then tries half the gain, and the acceleration ends when no gain is safe. A scan is for
//! one top, and there is one scan in a stretch (a second one at standstill, and where limits or feeds have changed).
//!
//! **In a hurry**, while the CPU has no time left, velocities are kept, ramps followed, and accelerations ended,
//! without a scan as long as the last answer allows it.
//!
//! **Slower.** A ramp is followed to its end. If something ahead has changed, a scan in every fourth slice tries to end
//! the deceleration now and keep the velocity that is left, or, before the deceleration has begun, to go faster. If
//! that is not safe, the ramp goes on.
//!
//! Two consequences of the duration of slices: Alpha changes in steps of a slice while it rises. A velocity that is
//! less than `J t^2` away (t is the time of a slice) is reached at once, and so is the end of a move that is shorter
//! than `2 J t^3`.
//!
//! Units: mm, s; distances to constraints ahead are brake potential (`constraint`). Cost on AVR: 800 cycles at a steady
//! velocity, 2,400 in a ramp, 3,000 while alpha rises; a scan 3,500 to 7,500 more, a ramp that is laid out 2,000 to
//! 4,000.

use super::constraint::{Ahead, Ask, Clear, needed};
use super::exec::SEGMENT_S;
use super::float::{below, greater, least, less, lesser, ratio, scaled, some};
use super::governor::{Governor, Limits, same};
use super::ramp::Phase;
use super::slice::Span;

/// Slices before another attempt to go faster, after one that has failed.
const WAIT: u8 = 8;

/// Slices at a steady velocity before a small gain in velocity is tried.
const CALM: u8 = 32;

/// Slices by which the first scan of an acceleration looks further ahead than it has to.
pub(super) const MARGIN_FIRST: u8 = 4;

/// Most slices by which a scan looks further ahead than it has to.
const MARGIN: u8 = 15;

/// How much longer than a usual slice the slice of [`Governor::creep`] may be, as a power of two: see
/// [`Governor::crawled`].
const CRAWL_LOG2: i8 = 3;
/// A stretch that is shorter than this is not worth a segment, s.
const LITTLE_S: f32 = SEGMENT_S / 4.0;

/// A candidate for the state after the slice.
#[derive(Clone, Copy, Default)]
struct Next {
    velocity: f32,
    alpha: f32,
    distance: f32,
    top: f32,
    /// The distance of the slice; `at` is the distance to the top. Brake potential.
    far: f32,
    at: f32,
}

/// Whether an acceleration can end at the feed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Arrives {
    /// The acceleration ends at the feed.
    Safely,
    /// It is not safe to end at the feed.
    Unsafe,
    /// Unknown without a second scan in this stretch.
    Unknown,
}

/// A slice at a steady velocity.
#[derive(Clone, Copy)]
struct Steady {
    distance: f32,
    /// The distance, brake potential.
    at: f32,
    /// Whether the velocity is known to be safe for twice the slice. If it is not, this is scanned for first, because a
    /// higher velocity is safe for a shorter time.
    known: bool,
}

impl Governor {
    /// Computes a slice. Returns false, with nothing done, if that takes a second scan in this stretch.
    #[inline(never)]
    pub(super) fn slice(&mut self, span: &Span, ahead: &impl Ahead) -> bool {
        if let Some(ramp) = &self.ramp {
            self.turn = self.turn.wrapping_add(1);
            let news = self.changed || !ramp.closed;
            if news
                && !self.hurry
                && self.turn & 3 == 0
                && ramp.phase() != Phase::Ending
                && !self.scanned
            {
                return self.reconsider(span, ahead);
            }
            self.follow(span.seconds);
            return true;
        }
        self.free(span, ahead)
    }

    /// Computes a slice where there is no ramp, or tries one that is faster than the ramp.
    #[inline(never)]
    fn free(&mut self, span: &Span, ahead: &impl Ahead) -> bool {
        let velocity = self.velocity;
        if self.alpha.is_sign_negative() && some(self.alpha) {
            return self.recover(span, ahead);
        }
        if below(span.cruise, velocity) {
            return self.slow_down(span, ahead);
        }
        if !some(self.alpha) && some(velocity) {
            let steady = self.steady_slice(span);
            let keeps = self.ramp.is_some() || self.hurry || !steady.known;
            if keeps || self.waits() || self.is_calm(span.cruise) {
                return self.keep(&steady, span, ahead);
            }
        }
        self.climb(span, ahead)
    }

    /// Whether the machine is at the feed, or less than 1/64 below it and steady only for a short time. Where each
    /// block has another feed, as on a spiral, following each small change would cost more than it gains.
    fn is_calm(&mut self, cruise: f32) -> bool {
        let velocity = self.velocity;
        if same(velocity, cruise) {
            return true;
        }
        let calm = self.calm > 0 && below(cruise, velocity + scaled(velocity, -6));
        self.calm = if calm { self.calm - 1 } else { CALM };
        calm
    }

    /// Whether it is too early for another attempt to go faster, after one that has failed.
    fn waits(&mut self) -> bool {
        let waits = self.wait > 0;
        self.wait = self.wait.saturating_sub(1);
        waits
    }

    /// Returns a slice at the present velocity. Cost: 300.
    #[inline(never)]
    fn steady_slice(&self, span: &Span) -> Steady {
        let velocity = self.velocity;
        let distance = velocity * span.seconds;
        let at = self.potential(distance);
        Steady { distance, at, known: self.is_clear(velocity, scaled(at, 1)) }
    }

    /// Computes a slice at a steady velocity. Returns false, with nothing done, if that takes a second scan in this
    /// stretch.
    #[inline(never)]
    fn keep(&mut self, steady: &Steady, span: &Span, ahead: &impl Ahead) -> bool {
        let velocity = self.velocity;
        let may_wait =
            steady.known || (self.hurry || self.scanned) && self.is_clear(velocity, steady.at);
        // A recent scan is good enough to lay out a ramp, because a scan and a ramp take too long for one slice. But a
        // ramp to a velocity that is no lower would end at once, and require another ramp after it.
        let lower = below(self.clear.target, velocity);
        if !may_wait && (self.clear.age > 1 || below(self.clear.top, velocity) || !lower) {
            if self.scanned {
                return false;
            }
            self.look_about(velocity, 0.0, velocity, span, ahead);
        }
        self.keep_or_slow(steady, span);
        true
    }

    /// After a scan for the steady velocity: goes on, or slows down where necessary.
    fn keep_or_slow(&mut self, steady: &Steady, span: &Span) {
        if self.is_clear(self.velocity, steady.at) {
            self.ramp = None;
            self.add(span.seconds, steady.distance, steady.at);
            return;
        }
        let lays = self.ramp.is_none();
        if lays {
            self.slow_for_clear(0.0);
        }
        self.follow(span.seconds);
        // The ramp took as long as a scan: no other scan in this stretch, unless the stretch is not worth a segment.
        self.scanned |= lays && !below(self.rest.seconds, LITTLE_S);
    }

    /// Lays out the ramp down to the target of the last scan; `at` is the distance to the place where the top is
    /// reached.
    fn slow_for_clear(&mut self, at: f32) {
        let slack = ratio(self.clear.slack(at, self.limits.kappa), scaled(self.limits.accel, 1));
        let Clear { target, closed, .. } = self.clear;
        self.lay(target, slack, closed);
        self.changed = false;
    }

    /// Returns the distance from the state to the end of the block, brake potential; negative if the state is beyond
    /// it.
    fn here(&self, span: &Span) -> f32 {
        self.potential(span.left)
    }

    /// Fills in the state after a slice in which alpha goes to `alpha`, without the distances.
    #[inline(never)]
    fn next(&self, alpha: f32, seconds: f32, out: &mut Next) {
        let half = scaled(seconds, -1);
        let velocity = self.velocity + half * self.limits.accel * (self.alpha + alpha);
        out.velocity = velocity;
        out.alpha = alpha;
        out.top = velocity + self.limits.kappa * alpha * alpha;
    }

    /// Fills in the distance of the slice, and the distance to the top.
    #[inline(never)]
    fn place_top(&self, next: &mut Next, seconds: f32) {
        next.distance = scaled(seconds, -1) * (self.velocity + next.velocity);
        next.far = self.potential(next.distance);
        next.at = next.far + self.rising(next.alpha, next.velocity, next.top);
    }

    /// Returns the distance in which an acceleration ends, brake potential; negative for a deceleration.
    fn rising(&self, alpha: f32, velocity: f32, top: f32) -> f32 {
        // The mean velocity is the velocity plus two thirds of the gain that is still to come.
        scaled(self.limits.kappa, 2) * alpha * (top - (top - velocity) * (1.0 / 3.0))
    }

    /// Computes a slice that accelerates if that is safe, else one that does not. Returns false, with nothing done, if
    /// that takes a second scan in this stretch.
    #[inline(never)]
    fn climb(&mut self, span: &Span, ahead: &impl Ahead) -> bool {
        let (alpha, seconds) = (self.alpha, span.seconds);
        let mut next = Next::default();
        self.next(least(alpha + self.limits.pace * seconds, 1.0), seconds, &mut next);
        if below(span.cruise, next.top) {
            if !some(alpha) {
                // So near to the feed that the acceleration need not build up.
                next = Next { velocity: span.cruise, top: span.cruise, ..Next::default() };
            } else {
                if !same(next.alpha, alpha) {
                    self.next(alpha, seconds, &mut next);
                }
                if below(span.cruise, next.top) {
                    if self.is_lowered(next.top - next.velocity, span.cruise) {
                        return self.slow_down(span, ahead);
                    }
                    let arrives = self.arrive(span, ahead);
                    if arrives == Arrives::Unsafe {
                        self.go_on(span, ahead);
                    }
                    return arrives != Arrives::Unknown;
                }
            }
        }
        self.place_top(&mut next, seconds);
        if self.is_clear(next.top, next.at) {
            self.look_early(&next, span, ahead);
        } else {
            if self.scanned {
                return false;
            }
            let has_time = !(self.hurry || self.ends_early()) || !some(alpha);
            if !has_time || !self.look_ahead(&next, span, ahead) {
                self.go_on(span, ahead);
                return true;
            }
        }
        self.ramp = None;
        (self.velocity, self.alpha) = (next.velocity, next.alpha);
        self.add(seconds, next.distance, next.far);
        true
    }

    /// Whether an acceleration that is about to end is ended now, without another scan. Each scan allows half the gain
    /// of the one before; at 80,000 steps/s computing a slice with a scan takes longer than the slice lasts.
    #[inline(always)]
    fn ends_early(&self) -> bool {
        self.tight && self.closing
    }

    /// Scans for a higher top while the next state is known to be safe but the states after it are not. Whatever the
    /// answer, the next state stays safe.
    #[inline(always)]
    fn look_early(&mut self, next: &Next, span: &Span, ahead: &impl Ahead) {
        if self.scanned
            || self.hurry
            || self.ends_early()
            || self.margin == 0
            || !below(self.clear.top, span.cruise)
        {
            return;
        }
        let gain = self.limits.accel * span.seconds;
        if below(self.clear.top, next.top + scaled(gain, 1)) {
            self.look_further(next, span, ahead);
        }
    }

    /// Scans for a top that is some slices further. Returns whether this top is safe.
    #[inline(never)]
    fn look_further(&mut self, next: &Next, span: &Span, ahead: &impl Ahead) -> bool {
        let gain = self.limits.accel * span.seconds * f32::from(self.margin);
        let far = lesser(next.top + gain, greater(span.cruise, next.top));
        let found = self.ask(far, next.at, span, ahead);
        self.adjust_margin(found);
        found
    }

    /// Scans for how long the velocity `top` may be kept. It is reached at the distance `at` in any case; the highest
    /// velocity until then is `fastest`.
    fn look_about(&mut self, top: f32, at: f32, fastest: f32, span: &Span, ahead: &impl Ahead) {
        let ask = Ask { top, at, fastest, level: 0.0, here: self.here(span), taken: true };
        self.scan(&ask, ahead);
    }

    /// Whether `top`, which is reached at the distance `at`, is safe.
    fn ask(&mut self, top: f32, at: f32, span: &Span, ahead: &impl Ahead) -> bool {
        self.changed = false;
        let ask = Ask { top, at, fastest: top, level: 0.0, here: self.here(span), taken: false };
        self.scan(&ask, ahead)
    }

    /// Scans for whether the next state is safe. From a steady velocity it first tries more than the next slice needs,
    /// as long as smaller gains remain to be tried.
    #[inline(never)]
    fn look_ahead(&mut self, next: &Next, span: &Span, ahead: &impl Ahead) -> bool {
        if !some(self.alpha) && self.margin > 0 {
            let found = self.look_further(next, span, ahead);
            // At rest there is time for another scan.
            if found || some(self.velocity) {
                return found;
            }
        }
        let found = self.ask(next.top, next.at, span, ahead);
        self.closing &= found;
        found
    }

    /// Sets how far ahead the next scan tries: twice as far each time, until a scan finds its top unsafe; from then on
    /// half as far each time.
    fn adjust_margin(&mut self, found: bool) {
        if found && !self.closing {
            self.margin = (2 * self.margin + 1).min(MARGIN);
        } else {
            self.closing = true;
            self.margin /= 2;
        }
    }

    /// Goes no faster: computes a slice of the present ramp, or of one that begins now.
    fn go_on(&mut self, span: &Span, ahead: &impl Ahead) {
        if self.ramp.is_some() {
            self.follow(span.seconds);
        } else {
            self.end_climb(span, ahead);
        }
    }

    /// Ends an acceleration that has no ramp yet, and lays out a ramp down if that is due. `clear` is for the present
    /// state, or for a faster one.
    #[inline(never)]
    fn end_climb(&mut self, span: &Span, ahead: &impl Ahead) {
        if !self.tries_less() {
            self.wait = WAIT;
            (self.margin, self.closing) = (MARGIN_FIRST, false);
        }
        let top = self.velocity + self.limits.kappa * self.alpha * self.alpha;
        let at = self.rising(self.alpha, self.velocity, top);
        let steady = self.steady_slice(span);
        let is_steady = !some(self.alpha) && some(self.velocity);
        if self.clear.top.is_sign_negative() || is_steady && !steady.known {
            self.look_about(top, at, top, span, ahead);
        }
        self.clear.narrow(top);
        let near = self.crawled(span);
        if !less(near, span.left)
            && !below(near, self.velocity * scaled(span.seconds, CRAWL_LOG2))
            && !less(self.here(span) + near, self.clear.place())
        {
            // A stop is so near that it is not worth a ramp.
            return self.creep(span);
        }
        if some(self.alpha) {
            // The last answer covers the way to the top. What follows is decided there.
            if below(self.clear.distance, at) {
                self.slow_for_clear(at);
            } else {
                let how = self.leveling(top);
                self.level_off(top, &how);
            }
            self.follow(span.seconds);
        } else if some(self.velocity) {
            self.keep_or_slow(&steady, span);
        } else {
            self.creep(span);
        }
    }

    /// Whether a steady velocity is so low that another scan for a smaller gain is worthwhile. Where the queue is
    /// short, a constant velocity is better than one that rises and falls by little.
    fn tries_less(&self) -> bool {
        let gain = self.limits.accel * SEGMENT_S * f32::from(self.margin + 1);
        !some(self.alpha) && self.closing && below(self.velocity, scaled(gain, 3))
    }

    /// Whether an override has lowered the feed so far that the acceleration cannot end at it any more. Until the
    /// acceleration has ended, the velocity grows by `climb`.
    fn is_lowered(&self, climb: f32, cruise: f32) -> bool {
        below(cruise - self.velocity, climb - scaled(climb, -6))
    }

    /// Ends the acceleration at the feed, if that is safe.
    #[inline(never)]
    fn arrive(&mut self, span: &Span, ahead: &impl Ahead) -> Arrives {
        let cruise = span.cruise;
        let how = self.leveling(cruise);
        let at = self.potential(how.distance);
        if !self.is_clear(cruise, at) {
            if self.scanned {
                return Arrives::Unknown;
            }
            if !self.ask(cruise, at, span, ahead) {
                return Arrives::Unsafe;
            }
        }
        self.level_off(cruise, &how);
        self.follow(span.seconds);
        Arrives::Safely
    }

    /// Slows down, because the velocity is above the feed or will be.
    #[inline(never)]
    fn slow_down(&mut self, span: &Span, ahead: &impl Ahead) -> bool {
        let (cruise, seconds) = (span.cruise, span.seconds);
        let near = self.limits.jerk * seconds * seconds;
        self.ramp = None;
        if !some(self.alpha) && !below(near, self.velocity - cruise) {
            self.velocity = cruise;
            return self.keep(&self.steady_slice(span), span, ahead);
        }
        if self.scanned {
            return false;
        }
        self.go_down_to(cruise, span, ahead);
        self.follow(seconds);
        true
    }

    /// Lays out a ramp down to `velocity`, or to a standstill if that is not safe.
    #[inline(never)]
    fn go_down_to(&mut self, velocity: f32, span: &Span, ahead: &impl Ahead) {
        let top = self.velocity + self.limits.kappa * self.alpha * self.alpha;
        let low = lesser(velocity, top);
        let at = self.rising(self.alpha, self.velocity, top) + needed(top, low, self.limits.kappa);
        self.look_about(low, at, top, span, ahead);
        self.changed = false;
        if !below(self.clear.distance, at) {
            self.lay(low, 0.0, true);
        } else {
            self.lay(0.0, 0.0, false);
        }
    }

    /// Decelerates without a ramp: after a feedhold, or where limits change, or where the ramp no longer fits.
    #[inline(never)]
    fn recover(&mut self, span: &Span, ahead: &impl Ahead) -> bool {
        if self.scanned {
            return false;
        }
        let bottom = self.bottom();
        if bottom > span.cruise {
            self.go_down_to(span.cruise, span, ahead);
        } else {
            self.changed = false;
            if !self.try_bottom(bottom, span, ahead) {
                self.brake_harder();
            }
        }
        self.follow(span.seconds);
        true
    }

    /// Decelerates harder: to the constraint that the scan has found, or, if that is too near for a deceleration that
    /// ends there, to a standstill.
    #[inline(never)]
    fn brake_harder(&mut self) {
        let Clear { target, closed, .. } = self.clear;
        let kappa = self.limits.kappa;
        let top = self.velocity + kappa * self.alpha * self.alpha;
        let at = self.rising(self.alpha, self.velocity, top);
        let fits = target < top && at + needed(top, target, kappa) <= self.clear.place();
        self.lay(if fits { target } else { 0.0 }, 0.0, closed && fits);
    }

    /// Something ahead has changed: computes a slice of the ramp, or a faster one.
    #[inline(never)]
    fn reconsider(&mut self, span: &Span, ahead: &impl Ahead) -> bool {
        self.changed = false;
        if self.ramp.as_ref().is_some_and(|ramp| !ramp.ends_at(span.cruise)) {
            self.take_alpha();
            if !self.alpha.is_sign_negative() || !some(self.alpha) {
                // The machine has not begun to slow down.
                (self.alpha, self.wait) = (greater(self.alpha, 0.0), 0);
                return self.free(span, ahead);
            }
            let bottom = self.bottom();
            if !below(span.cruise, bottom) {
                // The ramp stays, if the bottom is not safe.
                self.try_bottom(bottom, span, ahead);
            }
        }
        self.follow(span.seconds);
        true
    }

    /// Returns the velocity that is left if the deceleration begins to end now; 0 if that is too low to matter.
    #[inline(never)]
    fn bottom(&self) -> f32 {
        let bottom = self.velocity - self.limits.kappa * self.alpha * self.alpha;
        if below(0.2 * SEGMENT_S * SEGMENT_S * self.limits.jerk, bottom) { bottom } else { 0.0 }
    }

    /// Ends the deceleration, at the velocity `bottom`, if that is safe. Returns whether it is.
    #[inline(never)]
    fn try_bottom(&mut self, bottom: f32, span: &Span, ahead: &impl Ahead) -> bool {
        // `rising` is negative here: the distance from the bottom back to the state.
        let at = -self.rising(self.alpha, self.velocity, bottom);
        let level = self.velocity;
        let ask =
            Ask { top: bottom, at, fastest: level, level, here: self.here(span), taken: true };
        let safe = self.scan(&ask, ahead);
        if safe {
            self.bottom_out(bottom);
        }
        safe
    }

    /// Moves from standstill to standstill over a distance too short for a ramp: mostly a fraction of a step.
    #[inline(never)]
    fn creep(&mut self, span: &Span) {
        (self.velocity, self.alpha, self.wait) = (0.0, 0.0, 0);
        let left = least(greater(span.left, 0.0), self.crawled(span));
        // Four jerk phases: left = J T^3 / 32.
        let seconds = greater(rough_cube_root(32.0 * left / self.limits.jerk), span.seconds);
        self.add(greater(seconds, left / span.cruise), left, self.potential(left));
    }

    /// Returns the longest distance, mm, that one slice may cover from standstill to standstill without a ramp. Such a
    /// slice takes up to `2^CRAWL_LOG2` times as long as `span` says. Its mean velocity is at most what two usual
    /// slices of acceleration build up, a velocity jump that is small enough.
    #[inline(never)]
    fn crawled(&self, span: &Span) -> f32 {
        let Limits { accel, jerk, .. } = self.limits;
        let crawl = least(scaled(jerk, 1) * span.seconds, accel) * span.seconds;
        least(crawl, span.cruise) * scaled(span.seconds, CRAWL_LOG2)
    }

    /// Begins a feedhold: lays out the ramp down to a standstill, as hard as the limits allow.
    #[inline(never)]
    pub(super) fn halt_ramp(&mut self) {
        self.leave_ramp();
        self.halting = true;
        self.clear.forget();
        if some(self.velocity) {
            self.lay(0.0, 0.0, true);
        }
    }
}

/// Returns up to 5 % more than the cube root of a positive number: the bits of a float are nearly its logarithm.
/// `float::cube_root` would cost 2,700 cycles.
fn rough_cube_root(x: f32) -> f32 {
    f32::from_bits(x.to_bits() / 3 + 0x2A51_19F2) * 1.05
}
