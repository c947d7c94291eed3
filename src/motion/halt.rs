//! The velocity generator in a feedhold: decelerates to a standstill at the acceleration limit.
//!
//! Called by exec while a hold is on, instead of the functions of `trapezoid`. The deceleration continues over any
//! number of blocks, each with its own limit. Braking as hard as possible meets every constraint ahead
//! (`speed_constraints`), so that velocities are never above those without a hold, and no corner is taken too fast.
//!
//! At the standstill the state of the governor is that before a first move: the resumed motion starts as any other,
//! from the middle of a block.
//!
//! Units: mm, s. Cost on AVR: 2,500 cycles a stretch.

use super::float::{below, greater, least};
use super::governor::{Governor, Stretch};
use crate::math::sqrt;

/// A stop beyond this share of the distance left in the block counts as one at its end.
const AT_END: f32 = 0.9999;

impl Governor {
    /// Returns the next stretch of a hold, in a block with `left` mm to go, at whose end the square of the velocity may
    /// be `headroom`. Its duration is nominal, or up to the longest where the stretch ends in a standstill or at the end
    /// of the block.
    #[inline(never)]
    pub fn halt(&mut self, left: f32, headroom: f32) -> Stretch {
        let (v, accel, nominal) = (self.velocity, self.accel, self.nominal);
        let way = 0.5 * v * v / accel;
        if way < AT_END * left {
            let seconds = v / accel;
            if seconds <= self.longest {
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
            if seconds <= self.longest {
                self.velocity = next;
                return Stretch { seconds, distance: left, ends: true };
            }
        }
        let next = greater(v - accel * nominal, 0.0);
        self.velocity = next;
        let distance = 0.5 * (v + next) * nominal;
        // Rounding may put the end of the stretch at that of the block, or beyond.
        let ends = !below(distance, left);
        Stretch { seconds: nominal, distance: if ends { left } else { distance }, ends }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::exec::SEGMENT_S;
    use proptest::prelude::*;

    /// Runs a hold, and returns the distance that it takes.
    fn stop(governor: &mut Governor) -> f32 {
        let (mut way, mut stretches) = (0.0, 0);
        let mut before = governor.velocity();
        while !governor.is_at_rest() {
            governor.take(SEGMENT_S);
            let stretch = governor.halt(1e4, 0.0);
            assert!(!stretch.ends && stretch.seconds <= 2.0 * SEGMENT_S, "{stretch:?}");
            let most = governor.accel * stretch.seconds * 1.01;
            assert!(before - governor.velocity() <= most + 1e-3, "{stretch:?} from {before}");
            (before, way) = (governor.velocity(), way + stretch.distance);
            stretches += 1;
            assert!(stretches < 100_000, "it freezes at {before}");
        }
        way
    }

    proptest! {
        /// A stretch whose end is that of the block but for rounding.
        #[test]
        fn it_stays_within_the_block(
            v in 0.01f32..500.0, accel in 20.0f32..5_000.0, nominal in 1e-4f32..4e-3, off in -4i32..4,
            headroom in prop_oneof![Just(0.0f32), 0.0f32..100.0],
        ) {
            let next = (v - accel * nominal).max(0.0);
            let way = 0.5 * (v + next) * nominal;
            let left = f32::from_bits(way.to_bits().saturating_add_signed(off));
            let mut governor = Governor::new();
            governor.begin(accel);
            governor.velocity = v;
            governor.take_exactly(nominal);
            let stretch = governor.halt(left, headroom);
            prop_assert!(stretch.distance <= left && stretch.seconds <= nominal, "{stretch:?}");
            prop_assert!(stretch.ends || stretch.distance < left, "{stretch:?}");
            prop_assert!((0.0..=v).contains(&governor.velocity));
        }

        #[test]
        fn it_stops_as_soon_as_may_be(v in 0.1f32..500.0, accel in 20.0f32..5_000.0) {
            let mut governor = Governor::new();
            governor.begin(accel);
            governor.velocity = v;
            let best = f64::from(v).powi(2) / (2.0 * f64::from(accel));
            let way = f64::from(stop(&mut governor));
            prop_assert!((way / best - 1.0).abs() < 0.005, "{way} mm, the shortest is {best}");
        }
    }

    #[test]
    fn a_stop_at_the_very_end_of_a_block_ends_it() {
        let mut governor = Governor::new();
        governor.begin(1_000.0);
        governor.velocity = 2.0;
        governor.take(SEGMENT_S);
        let stretch = governor.halt(0.002, 0.0);
        assert!(stretch.ends && governor.is_at_rest(), "{stretch:?}");
    }
}
