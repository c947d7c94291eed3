//! Backlash compensation: what a motor has to turn before its axis follows, when it reverses.
//!
//! Owned by exec (level 2). [`Backlash::turn`] gets the distances of each line that begins. If a line turns a motor
//! round, the motor is to go its width in addition, in the new direction. [`Backlash::feed`] adds a share of that to
//! each sample, before the means ([`Smooth`](super::smooth::Smooth)), at a constant pace. So the axis does not stop, and
//! the means make of the jump to that pace a ramp.
//!
//! **Limits.** The planner drives an axis with backlash at [`KEPT`] of its acceleration and jerk, and [`KEPT_VELOCITY`]
//! of its velocities. The remainder is for the take-up: its pace is the jump of velocity that takes the remaining
//! acceleration over [`CORNER_S`], or the remaining velocity if that is less ([`pace`]). A motor that turns back before
//! it is done waits for as long as the mean that rounds corners, so that two jumps do not add up.
//!
//! **At a standstill** a line waits until the take-up of its motors has come out of the means. So it is complete before
//! a probing, a search for a switch, a pass of a thread, and under G61.1. Where motion has no means, as under G61, this
//! is the only take-up: a motor that reverses while others go on stays behind until the next standstill of the path.
//!
//! **Position.** The steps of a take-up are no part of it: [`Backlash::deduct`] takes them from the target of exec, as
//! late as the means are, so that the position shown is nearly right meanwhile. A take-up goes on in a hold until it is
//! complete, so at each standstill a motor is off its position by its width or not at all. All is done in integers, and
//! a width is a whole number of steps, so nothing adds up. After a stop at once, the steps that have been taken from the
//! position count as made ([`Backlash::stop`]), and the next line makes the others. Steps of the path and of the
//! take-up cannot be told apart then, so an axis stopped during a take-up may be off its position by as much as its width.
//!
//! **What it cannot do.** An axis that turns back before the take-up is complete has not gone as far as its path. In a
//! take-up an axis lags by up to its width; on a curve by far less, because it is slow where it reverses.
//!
//! The first line that moves a motor tells its direction. After homing, that is the direction away from the switch.
//!
//! **Rubbish.** A width of more than [`WIDTH_MOST`] steps is that. A width that changes during a take-up is taken over
//! with the next change; settings change at a standstill. Nothing can be full or late.
//!
//! Units: 1/16 step. Cost on AVR: 30 cycles a line and 5 a sample without backlash; 150 a motor and sample in a take-up.

use super::block::PARTS_LOG2;
use super::smooth::{CHANNELS, CORNER, CORNER_S, SAMPLE_S};
use crate::boards::MOTORS;
use crate::capability::Capability;
use crate::dda::STEP_LOG2;
use kerf_macros::small;

/// The number of motors whose backlash can be compensated: none in an image without the capability.
pub const SLACKS: usize = if Capability::Backlash.is_built_in() { MOTORS } else { 0 };

/// The share of its acceleration and its jerk that an axis with backlash has for its path.
pub const KEPT: f32 = 0.75;

/// The share of its velocities that an axis with backlash has for its path.
pub const KEPT_VELOCITY: f32 = 15.0 / 16.0;

/// The most steps of backlash.
pub const WIDTH_MOST: u16 = u16::MAX >> PARTS_LOG2;

/// In [`Side::recent`]: the motor has turned back, and waits.
const WAITS: u8 = 0x80;

/// The share of the steps that have been fed and not yet taken from the position that is taken in a sample, as a power
/// of two. It follows about as late as the means.
const FOLLOWS_LOG2: u8 = if SAMPLE_S >= 0.004 { 2 } else { 3 };

/// The backlash of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Slack {
    /// Its width, whole steps; 0 for none.
    pub width: u16,
    /// How far the motor goes in a sample to take it up, 1/16 step.
    pub pace: u8,
}

impl Slack {
    /// No backlash.
    pub const NONE: Self = Self { width: 0, pace: 0 };
}

/// Returns the velocity of a take-up, mm/s, on an axis whose path may have this velocity and acceleration, mm/s and
/// mm/s^2; an acceleration of 0 is no limit.
#[small]
pub fn pace(velocity: f32, accel: f32) -> f32 {
    let jump = accel * (CORNER_S * (1.0 - KEPT) / KEPT);
    let spare = velocity * ((1.0 - KEPT_VELOCITY) / KEPT_VELOCITY);
    if jump > 0.0 && jump < spare { jump } else { spare }
}

/// The most samples of a take-up, some 8 to 16 s: an axis that is too slow for that exceeds its limits.
const SAMPLES_MOST: u16 = 4_096;

/// Returns the least pace of a take-up of `width` steps, 1/16 step a sample.
pub fn least_pace(width: u16) -> u8 {
    const _: () = assert!((WIDTH_MOST << PARTS_LOG2) / SAMPLES_MOST < u8::MAX as u16);
    ((width << PARTS_LOG2) / SAMPLES_MOST) as u8 + 1
}

/// The take-up of a motor, in its present direction.
#[derive(Clone, Copy, Debug)]
struct Side {
    slack: Slack,
    /// What has not been fed yet, 1/16 step.
    left: u16,
    /// The steps that have not been taken from the position yet.
    hidden: u16,
    /// For how many more samples the last sample with a part of a take-up counts. With [`WAITS`], that part was in the
    /// other direction.
    recent: u8,
}

impl Side {
    const NONE: Self = Self { slack: Slack::NONE, left: 0, hidden: 0, recent: 0 };

    /// Turns the motor round.
    #[inline(always)]
    fn turn(&mut self) {
        let width = self.slack.width;
        self.left = (width << PARTS_LOG2).saturating_sub(self.left);
        self.hidden = width.saturating_sub(self.hidden);
        if self.recent != 0 {
            self.recent ^= WAITS;
        }
    }

    /// Returns what goes into the next sample, 1/16 step.
    #[inline(always)]
    fn feed(&mut self) -> u16 {
        let waits = self.recent & WAITS != 0;
        let now = if waits { 0 } else { self.left.min(self.slack.pace.into()) };
        if now > 0 {
            self.left -= now;
            self.recent = CORNER;
        } else if self.recent & !WAITS != 0 {
            self.recent -= 1;
        }
        if self.recent == WAITS {
            self.recent = 0;
        }
        now
    }

    /// The whole steps that have been fed and not taken from the position.
    #[inline(always)]
    fn fed(&self) -> u16 {
        self.hidden - self.left.div_ceil(1 << PARTS_LOG2).min(self.hidden)
    }

    #[inline(always)]
    fn is_done(&self) -> bool {
        self.left == 0 && self.hidden == 0 && self.recent == 0
    }
}

/// The take-up of all motors.
#[derive(Debug)]
pub struct Backlash {
    sides: [Side; SLACKS],
    /// The motors whose direction is known, as bits; those of them that go backwards; those with something to do.
    known: u8,
    backwards: u8,
    busy: u8,
}

impl Backlash {
    /// No backlash, and no direction is known.
    pub const fn new() -> Self {
        Self { sides: [Side::NONE; SLACKS], known: 0, backwards: 0, busy: 0 }
    }

    /// Sets the backlash of each motor, from the next reversal on.
    #[inline(never)]
    #[small]
    pub fn set(&mut self, slacks: &[Slack; MOTORS]) {
        for (side, slack) in self.sides.iter_mut().zip(slacks) {
            side.slack.pace = slack.pace.max(1);
            if side.fed() == 0 && side.left == side.hidden << PARTS_LOG2 {
                side.slack.width = slack.width.min(WIDTH_MOST);
                side.hidden = side.hidden.min(side.slack.width);
                side.left = side.hidden << PARTS_LOG2;
            }
        }
    }

    /// Takes in the distances of a line that begins.
    #[inline(never)]
    pub fn turn(&mut self, way: &[i16; MOTORS]) {
        let mut bit = 1;
        for (side, way) in self.sides.iter_mut().zip(way) {
            if *way != 0 {
                let backwards = if *way < 0 { bit } else { 0 };
                if self.known & bit == 0 {
                    self.known |= bit;
                    self.backwards = self.backwards & !bit | backwards;
                } else if (self.backwards ^ backwards) & bit != 0 {
                    self.backwards ^= bit;
                    side.turn();
                    if !side.is_done() {
                        self.busy |= bit;
                    }
                }
            }
            bit <<= 1;
        }
    }

    /// Whether something has not been fed yet.
    #[inline(always)]
    pub fn is_due(&self) -> bool {
        self.busy != 0 && self.has_left()
    }

    #[inline(never)]
    fn has_left(&self) -> bool {
        self.sides.iter().any(|side| side.left != 0)
    }

    /// Adds to the distances of a sample.
    #[inline(always)]
    pub fn feed(&mut self, distances: &mut [i32; CHANNELS]) {
        if self.busy != 0 {
            self.feed_busy(distances);
        }
    }

    #[inline(never)]
    #[small]
    fn feed_busy(&mut self, distances: &mut [i32; CHANNELS]) {
        let mut bit = 1;
        for (side, distance) in self.sides.iter_mut().zip(distances) {
            if self.busy & bit != 0 {
                let way = i32::from(side.feed()) << (STEP_LOG2 - PARTS_LOG2);
                *distance += if self.backwards & bit != 0 { -way } else { way };
            }
            bit <<= 1;
        }
    }

    /// Takes steps that have been fed from the position: all of them if the means are empty.
    #[inline(always)]
    pub fn deduct(&mut self, is_empty: bool, position: &mut [i32; MOTORS]) {
        if self.busy != 0 {
            self.deduct_busy(is_empty, position);
        }
    }

    #[inline(never)]
    #[small]
    fn deduct_busy(&mut self, is_empty: bool, position: &mut [i32; MOTORS]) {
        let mut bit = 1;
        for (side, position) in self.sides.iter_mut().zip(position) {
            if self.busy & bit != 0 {
                let fed = side.fed();
                let least = u16::from(fed != 0);
                let steps = if is_empty { fed } else { (fed >> FOLLOWS_LOG2).max(least) };
                side.hidden -= steps;
                let steps = i32::from(steps);
                let more = if self.backwards & bit != 0 { steps } else { -steps };
                *position = position.wrapping_add(more);
                if is_empty && side.left == 0 {
                    side.recent = 0;
                }
                if side.is_done() {
                    self.busy &= !bit;
                }
            }
            bit <<= 1;
        }
    }

    /// The motors have been stopped at once: what has not been taken from the position has not been made.
    #[inline(never)]
    #[small]
    pub fn stop(&mut self) {
        for side in &mut self.sides {
            side.left = side.hidden << PARTS_LOG2;
            side.recent = 0;
        }
    }
}

impl Default for Backlash {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec;

    fn way(x: i16) -> [i16; MOTORS] {
        let mut way = [0; MOTORS];
        way[0] = x;
        way
    }

    /// What the motor has been fed and what has been taken from its position, in 1/16 step.
    #[derive(Default)]
    struct Motor {
        backlash: Backlash,
        fed: i64,
        taken: i64,
    }

    impl Motor {
        fn new(width: u16, pace: u8) -> Self {
            let mut motor = Self::default();
            motor.backlash.set(&[Slack { width, pace }; MOTORS]);
            motor
        }

        fn sample(&mut self, is_empty: bool) -> i64 {
            let mut distances = [0; CHANNELS];
            self.backlash.feed(&mut distances);
            let fed = i64::from(distances[0]) >> (STEP_LOG2 - PARTS_LOG2);
            self.fed += fed;
            let mut position = [0; MOTORS];
            self.backlash.deduct(is_empty, &mut position);
            self.taken -= i64::from(position[0]) << PARTS_LOG2;
            fed
        }

        fn rest(&mut self) {
            while self.backlash.is_due() {
                self.sample(false);
            }
            self.sample(true);
        }
    }

    #[test]
    fn the_first_line_tells_the_direction() {
        let mut motor = Motor::new(20, 50);
        motor.backlash.turn(&way(-3));
        assert!(!motor.backlash.is_due());
        motor.backlash.turn(&way(0));
        motor.backlash.turn(&way(-1));
        assert!(!motor.backlash.is_due());
        motor.backlash.turn(&way(1));
        assert_eq!([50, 50, 50, 50, 50, 50, 20, 0], core::array::from_fn(|_| motor.sample(false)));
        motor.rest();
        assert_eq!((motor.fed, motor.taken, motor.backlash.busy), (320, 320, 0));
    }

    #[test]
    fn a_motor_that_turns_back_waits() {
        let mut motor = Motor::new(20, 50);
        motor.backlash.turn(&way(1));
        motor.backlash.turn(&way(-1));
        motor.sample(false);
        motor.backlash.turn(&way(1));
        for _ in 0..CORNER {
            assert_eq!(motor.sample(false), 0);
        }
        assert_eq!(motor.sample(false), 50);
        motor.rest();
        assert_eq!((motor.fed, motor.taken), (0, 0));
    }

    proptest! {
        /// Whatever the lines and samples: at rest a motor is off by its width or not at all; on the way by no more.
        /// Within the mean that rounds corners the pace changes by no more than itself.
        #[test]
        fn nothing_adds_up(
            width in 0u16..300, pace: u8, first: bool,
            lines in prop::collection::vec((-2i16..=2, 0u8..20, any::<bool>(), any::<bool>()), 1..300),
        ) {
            let mut motor = Motor::new(width, pace);
            motor.backlash.turn(&way(if first { 1 } else { -1 }));
            let side = |fed: i64| if first { fed } else { -fed };
            let most = i64::from(width) << PARTS_LOG2;
            let mut paces = vec![0; CORNER.into()];
            for (x, samples, rests, stops) in lines {
                motor.backlash.turn(&way(x));
                for _ in 0..samples {
                    paces.push(motor.sample(false));
                }
                for off in [motor.fed, motor.taken] {
                    prop_assert!((-most..=0).contains(&side(off)), "{off}");
                }
                if stops {
                    motor.backlash.stop();
                    motor.fed = motor.taken;
                    paces.extend([0; CORNER as usize]);
                }
                if rests {
                    motor.rest();
                    paces.extend([0; CORNER as usize]);
                    let back = motor.backlash.backwards & 1 == u8::from(first);
                    prop_assert_eq!(side(motor.fed), if back { -most } else { 0 });
                    prop_assert_eq!(motor.fed, motor.taken);
                }
            }
            for paces in paces.windows(usize::from(CORNER) + 1) {
                let (least, most) = (paces.iter().min().unwrap(), paces.iter().max().unwrap());
                prop_assert!(most - least <= i64::from(pace.max(1)), "{paces:?}");
            }
        }

        #[test]
        fn no_width_is_too_much(width: u16, pace: u8, later: u16, turns in 0..9) {
            let mut motor = Motor::new(width, pace);
            motor.backlash.turn(&way(1));
            for turn in 0..turns {
                motor.backlash.turn(&way(if turn & 1 == 0 { -1 } else { 1 }));
                motor.sample(false);
                motor.backlash.set(&[Slack { width: later, pace }; MOTORS]);
            }
            motor.rest();
            prop_assert_eq!(motor.fed, motor.taken);
        }
    }

    #[test]
    fn a_million_reversals_do_not_drift() {
        let mut motor = Motor::new(23, 31);
        motor.backlash.turn(&way(1));
        for turn in 0..1_000_000u32 {
            motor.backlash.turn(&way(if turn & 1 == 0 { -1 } else { 1 }));
            for _ in 0..turn % 23 {
                motor.sample(false);
            }
        }
        motor.rest();
        assert_eq!((motor.fed, motor.taken), (0, 0));
    }
}
