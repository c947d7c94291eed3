//! The governor's stretches under a jerk limit.
//!
//! Called by [`Governor::stretch`](super::governor::Governor::stretch). In each stretch it tries to raise the
//! acceleration, to have none, and to keep it, and takes the first that leaves it safe (`reach`). If none
//! does it brakes: for the limit that has to be braked for first, as late as may be, so that it comes out at
//! the very place (`brake`). That brake it follows to its end. Only if more blocks come it looks whether
//! there is something better, and goes on braking if not: they never make the way shorter.
//!
//! Where one limit closely follows another, the way to the one may be too fast for the other: each
//! stretch of such a brake is looked at, and if it is not safe, is one of hard braking, which always is.
//!
//! What the length of stretches makes unavoidable: alpha changes in steps of a stretch, and a velocity
//! that is less than `J t^2` away (with t the time of a stretch) is gone to at once, as is the end of a move
//! that is shorter than `2 J t^3`. Cost on AVR: about 5,000 cycles.

use super::exec::SEGMENT_S;
use super::float::{below, greater, lesser, some};
use super::governor::{Governor, Stretch};
use super::queue::Anchor;
use super::reach::{Ahead, NONE, Reach};
use super::state::State;
use crate::math::sqrt;

/// A possible next state.
#[derive(Clone, Copy)]
struct Next {
    state: State,
    /// How far it is to there, mm.
    distance: f32,
}

/// A time to look ahead for.
struct Span {
    /// Way to the end of the block, mm.
    left: f32,
    /// Velocity limit, mm/s.
    cruise: f32,
    seconds: f32,
    /// The block is to be over then.
    ends: bool,
}

impl Governor {
    /// The next stretch.
    #[inline(never)]
    pub(super) fn smooth(
        &mut self,
        left: f32,
        cruise: f32,
        ahead: &impl Ahead,
        nominal: f32,
    ) -> Stretch {
        if let Some(stretch) = self.steady(left, cruise, nominal) {
            return stretch;
        }
        if self.brake.is_none() || self.look {
            // Above the feed, which an override has lowered, it looks until it is not.
            let v = self.state.velocity;
            self.look = below(cruise, v) && (self.late || below(cruise * 1.01, v));
            if let Some(stretch) = self.go(left, cruise, ahead, nominal) {
                self.brake = None;
                return stretch;
            }
        }
        if self.brake.is_some() {
            return self.follow(left, ahead, nominal);
        }
        if self.state.velocity > self.crawl(nominal) {
            return self.brake(left, ahead, nominal);
        }
        // The last of a slow-down, in whose midst a move has begun: it is at rest, and off from there.
        if some(self.state.velocity) {
            self.stop();
            if let Some(stretch) = self.go(left, cruise, ahead, nominal) {
                return stretch;
            }
        }
        self.creep(left, cruise, nominal)
    }

    /// A stretch at the feed, if the machine has it and could still stop within the block: whatever is
    /// ahead. Cost: 800, of a long move.
    #[inline(never)]
    fn steady(&self, left: f32, cruise: f32, nominal: f32) -> Option<Stretch> {
        let State { velocity, alpha } = self.state;
        if velocity.to_bits() != cruise.to_bits() || some(alpha) || self.brake.is_some() {
            return None;
        }
        let distance = velocity * nominal;
        let rest = left - distance;
        let top = velocity + self.limits.kappa;
        let enough = rest > distance && top * top < 2.0 * self.limits.accel * rest;
        enough.then_some(Stretch { seconds: nominal, distance, ends: false })
    }

    /// A stretch without a brake, if that is safe.
    #[inline(never)]
    fn go(&mut self, left: f32, cruise: f32, ahead: &impl Ahead, nominal: f32) -> Option<Stretch> {
        let v = self.state.velocity;
        let ends = left <= v * nominal;
        let seconds = if ends { self.shortest(left, cruise) } else { nominal };
        let mut span = Span { left, cruise, seconds, ends };
        let mut next = self.choose(&span, ahead)?;
        let after = next.state.velocity;
        if !span.ends && next.distance + 0.5 * nominal * after >= left {
            // What would be left is not worth a stretch.
            span.ends = true;
            span.seconds = self.time_to(after, left, nominal);
            next = self.choose(&span, ahead)?;
        }
        // Another state may be safe at the very end, one that takes less time to get there.
        for _ in 0..3 {
            let time = self.time_to(next.state.velocity, left, nominal);
            if !span.ends || time >= 0.99 * span.seconds {
                break;
            }
            span.seconds = time;
            next = self.choose(&span, ahead)?;
        }
        let Span { mut seconds, ends, .. } = span;
        let after = next.state.velocity;
        if after <= v && v < self.crawl(nominal) && v < 0.5 * cruise {
            return None;
        }
        let mut distance = next.distance;
        if ends {
            self.arrive(&mut next.state, ahead);
            seconds = self.time_to(next.state.velocity, left, nominal);
            distance = left;
        }
        self.state = next.state;
        Some(Stretch { seconds, distance, ends })
    }

    /// The shortest time to the end of the block, which takes less than a stretch at the present velocity.
    fn shortest(&self, left: f32, cruise: f32) -> f32 {
        let State { velocity, alpha } = self.state;
        let seconds = left / velocity;
        let most = lesser(alpha + self.limits.pace * seconds, 1.0);
        if velocity >= cruise || most <= 0.0 {
            return seconds;
        }
        left / (velocity + 0.5 * self.limits.accel * most * seconds)
    }

    /// How long it takes to the end of the block if it gets there with velocity `next`.
    fn time_to(&self, next: f32, left: f32, nominal: f32) -> f32 {
        let sum = self.state.velocity + next;
        if sum * nominal > left { (left + left) / sum } else { nominal + nominal }
    }

    /// A velocity to be rid of at once.
    pub(super) fn crawl(&self, nominal: f32) -> f32 {
        0.2 * self.limits.jerk * nominal * nominal
    }

    /// A place that is nearer to the end of the block than any other is at it, but for rounding.
    pub(super) fn here(&self, ahead: f32) -> bool {
        ahead <= 1e-4 * self.limits.accel
    }

    /// A limit at the very end of the block is kept exactly: stretches are not as fine.
    pub(super) fn arrive(&self, next: &mut State, ahead: &impl Ahead) {
        if let Some(anchor) = ahead.anchor(0)
            && self.here(anchor.ahead)
            && next.velocity > anchor.velocity
            && self.takes(&anchor, next.velocity)
        {
            *next = State { velocity: anchor.velocity, alpha: 0.0 };
        }
    }

    /// Whether a limit is to be kept exactly that is here, and below `velocity`: not if an override has lowered it
    /// too late.
    pub(super) fn takes(&self, anchor: &Anchor, velocity: f32) -> bool {
        let change = lesser(self.limits.pace * SEGMENT_S, 1.0);
        let little = self.limits.accel * change * SEGMENT_S;
        !(self.late && anchor.soft) || velocity - anchor.velocity <= little
    }

    /// From rest to rest over what is too short to get going: a fraction of a step, most likely.
    #[inline(never)]
    fn creep(&mut self, left: f32, cruise: f32, nominal: f32) -> Stretch {
        self.stop();
        // Four jerk phases: left = J T^3 / 32.
        let seconds = greater(cube_root(32.0 * left / self.limits.jerk), nominal);
        Stretch { seconds: greater(seconds, left / cruise), distance: left, ends: true }
    }

    /// The best safe state to be in at the end of a span.
    #[inline(never)]
    fn choose(&self, span: &Span, ahead: &impl Ahead) -> Option<Next> {
        let &Span { left, cruise, seconds, ends } = span;
        let alpha = self.state.alpha;
        let change = self.limits.pace * seconds;
        // Up to the feed and no further.
        let highest = match self.level_off(cruise, change, seconds) {
            Some(next) => next,
            None => {
                let most = lesser(alpha + change, self.towards(cruise, seconds));
                self.next(greater(lesser(most, 1.0), greater(alpha - change, -1.0)), seconds)
            }
        };
        if self.safe(&highest, left, ahead, ends) {
            return Some(highest);
        }
        let most = highest.state.alpha;
        // To cruise is worth a stop on the way up or down.
        if most > 0.0 && alpha <= change && -alpha <= change {
            let level = self.next(0.0, seconds);
            if self.safe(&level, left, ahead, ends) {
                return Some(level);
            }
        }
        if alpha > 0.0 && alpha < most {
            let same = self.next(alpha, seconds);
            if self.safe(&same, left, ahead, ends) {
                return Some(same);
            }
        }
        None
    }

    /// The velocity itself if it is so near that the acceleration need not build up.
    fn level_off(&self, cruise: f32, change: f32, seconds: f32) -> Option<Next> {
        let State { velocity, alpha } = self.state;
        let change = lesser(change, 1.0);
        let near = self.limits.accel * change * seconds;
        let way = cruise - velocity;
        let level = alpha <= change && -alpha <= change && way <= near && -way <= near;
        if !level {
            return None;
        }
        let distance = 0.5 * (velocity + cruise) * seconds;
        Some(Next { state: State { velocity: cruise, alpha: 0.0 }, distance })
    }

    /// The alpha with which the velocity comes to `cruise` if alpha goes to 0 from there:
    /// `v' + k alpha'^2 = cruise`.
    #[inline(never)]
    fn towards(&self, cruise: f32, seconds: f32) -> f32 {
        let half = 0.5 * self.limits.accel * seconds;
        let way = cruise - self.state.velocity - half * self.state.alpha;
        let b = 0.5 * half;
        let size = if way < 0.0 { -way } else { way };
        // The quotient that does not cancel.
        way / (b + sqrt(b * b + self.limits.kappa * size))
    }

    /// The state when alpha has gone to `alpha` in this time.
    #[inline(never)]
    fn next(&self, alpha: f32, seconds: f32) -> Next {
        let State { velocity, alpha: before } = self.state;
        let gain = self.limits.accel * seconds;
        let after = velocity + 0.5 * gain * (before + alpha);
        let distance = seconds * (velocity + gain * (before + before + alpha) * (1.0 / 6.0));
        Next { state: State { velocity: greater(after, 0.0), alpha }, distance }
    }

    #[inline(never)]
    fn safe(&self, next: &Next, left: f32, ahead: &impl Ahead, ends: bool) -> bool {
        let rest = if ends { 0.0 } else { greater(left - next.distance, 0.0) };
        let reach = Reach::new(next.state.velocity, next.state.alpha, self.limits.kappa);
        reach.safe(2.0 * self.limits.accel * rest, ahead, NONE)
    }
}

/// Up to 5 % more than the cube root of a positive number: the bits of a float are nearly its logarithm.
fn cube_root(x: f32) -> f32 {
    f32::from_bits(x.to_bits() / 3 + 0x2A51_19F2) * 1.05
}
