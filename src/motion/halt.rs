//! The velocity generator in a feedhold: decelerates to a standstill as fast as the limits allow.
//!
//! Called by exec instead of [`Governor::stretch`] while a hold is on. Without a jerk limit a hold decelerates at the
//! acceleration limit; with one it follows a ramp that is laid out when the hold begins (`ramp`). The deceleration
//! continues over any number of blocks, each with its own limits. Braking as hard as possible meets every constraint
//! ahead (`speed_constraints`, `constraint`), so that velocities are never above those without a hold, and no corner is
//! taken too fast.
//!
//! At the standstill the state of the governor is that before a first move: the resumed motion starts as any other,
//! from the middle of a block.
//!
//! Units: mm, s. Cost on AVR: 2,500 cycles a stretch; with a jerk limit 6,000 for the first stretch, and 2,500 for
//! each other.

use super::constraint::Ahead;
use super::float::{greater, least, some};
use super::governor::{Governor, Stretch};
use crate::math::sqrt;

/// A stop beyond this share of the distance left in the block counts as one at its end.
const AT_END: f32 = 0.9999;

impl Governor {
    /// Returns the next stretch of a hold, in a block with `left` mm to go.
    #[inline(never)]
    pub fn halt(&mut self, left: f32, ahead: &impl Ahead, nominal: f32) -> Stretch {
        if some(self.limits.jerk) {
            self.smooth_halt(left, nominal)
        } else if self.has_rest() {
            self.cut(left)
        } else {
            self.halt_sharply(left, ahead.headroom(), nominal)
        }
    }

    /// Returns the next stretch of a hold without a jerk limit; `headroom` is as in `trapezoid`.
    #[inline(never)]
    pub(super) fn halt_sharply(&mut self, left: f32, headroom: f32, nominal: f32) -> Stretch {
        let (v, accel) = (self.velocity, self.limits.accel);
        let longest = 1.5 * nominal;
        let way = 0.5 * v * v / accel;
        if way < AT_END * left {
            let seconds = v / accel;
            if seconds <= longest {
                self.stop();
                return Stretch { seconds, distance: way, ends: false };
            }
        } else {
            let gain = 2.0 * accel * left;
            let square = greater(v * v - gain, 0.0);
            // Rounding may put a stop before the end of the block.
            let next = sqrt(least(square, greater(headroom, 0.0)));
            let next = if self.late { self.slowest(v, gain, next) } else { next };
            let seconds = 2.0 * left / (v + next);
            if seconds <= longest {
                self.velocity = next;
                return Stretch { seconds, distance: left, ends: true };
            }
        }
        let next = v - accel * nominal;
        self.velocity = next;
        Stretch { seconds: nominal, distance: 0.5 * (v + next) * nominal, ends: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hal::ring::Index;
    use crate::motion::exec::SEGMENT_S;
    use crate::motion::queue::Constraint;
    use crate::motion::short::Short;
    use proptest::prelude::*;

    /// What is ahead: a block that ends in a stop, far away.
    struct Far;

    impl Ahead for Far {
        fn headroom(&self) -> f32 {
            0.0
        }
        fn slower(&self, _: Index, _: Short) -> (Index, Constraint) {
            (0, Constraint { velocity: Short::ZERO, ahead: 0.0, firm: true })
        }
        fn end(&self) -> f32 {
            0.0
        }
    }

    /// Returns the shortest distance to a standstill from `v` at the acceleration `a`.
    fn shortest(v: f64, a: f64, accel: f64, jerk: f64) -> f64 {
        if jerk == 0.0 {
            return v * v / (2.0 * accel);
        }
        // The distance to the velocity at which the acceleration is or was 0, and of the ramp down from there.
        let (top, time) = (v + a * a / (2.0 * jerk), a / jerk);
        let way = v * time + a * time * time / 2.0 - jerk * time.powi(3) / 6.0;
        let ramp = if top >= accel * accel / jerk {
            top / accel + accel / jerk
        } else {
            2.0 * (top / jerk).sqrt()
        };
        way + top * ramp / 2.0
    }

    /// Runs a hold, and returns the distance that it takes.
    fn stop(governor: &mut Governor) -> f32 {
        let (mut way, mut stretches) = (0.0, 0);
        let mut before = governor.velocity();
        while !governor.is_at_rest() {
            let stretch = governor.halt(1e4, &Far, SEGMENT_S);
            assert!(!stretch.ends && stretch.seconds <= 2.0 * SEGMENT_S, "{stretch:?}");
            let most = governor.limits.accel * stretch.seconds * 1.01;
            assert!(before - governor.velocity() <= most + 1e-3, "{stretch:?} from {before}");
            (before, way) = (governor.velocity(), way + stretch.distance);
            stretches += 1;
            assert!(stretches < 100_000, "it freezes at {before}");
        }
        way
    }

    proptest! {
        #[test]
        fn it_stops_as_soon_as_may_be(
            v in 0.1f32..500.0, accel in 20.0f32..5_000.0, seconds in 0.002f32..1.0,
            sharp: bool, share in -1.0f32..1.0,
        ) {
            let jerk = if sharp { 0.0 } else { accel / seconds };
            let mut governor = Governor::new();
            governor.begin(accel, jerk);
            // Braking no harder than may end at a standstill.
            let most = crate::math::sqrt(2.0 * jerk * v) / accel;
            let alpha = if sharp { 0.0 } else { share.max(-0.999 * most) };
            (governor.velocity, governor.alpha) = (v, alpha);
            let best = shortest(v.into(), (alpha * accel).into(), accel.into(), jerk.into());
            let way = f64::from(stop(&mut governor));
            prop_assert!((way / best - 1.0).abs() < 0.005, "{way} mm, the shortest is {best}");
        }
    }

    #[test]
    fn a_stop_at_the_very_end_of_a_block_ends_it() {
        let mut governor = Governor::new();
        governor.begin(1_000.0, 0.0);
        governor.velocity = 2.0;
        let stretch = governor.halt(0.002, &Far, SEGMENT_S);
        assert!(stretch.ends && governor.is_at_rest(), "{stretch:?}");
    }
}
