//! Counts the steps that the generator makes from a given moment on.
//!
//! Owned by exec, for a move that ends at a switch. The switch's interrupt records the state of the generator ([`Dda`])
//! between two ticks. From that state on, [`StepReplay`] counts the steps of the generator, a whole segment at a time,
//! with the integers of the generator. When the steppers have stopped, their position less these steps is the position
//! at the recorded moment. It is exact, whatever the path to the standstill.
//!
//! Cost on AVR: 500 cycles a segment, nothing while no moment is recorded.

use super::{Dda, STEP, STEP_LOG2, Segment};
use crate::boards::MOTORS;

/// A replay of the generator's steps.
#[derive(Clone, Debug, Default)]
pub struct StepReplay {
    phase: [u16; MOTORS],
    backwards: u8,
    steps: [i32; MOTORS],
}

impl StepReplay {
    /// A replay without a recorded moment.
    pub const fn new() -> Self {
        Self { phase: [0; MOTORS], backwards: 0, steps: [0; MOTORS] }
    }

    /// Starts the replay at the moment at which the generator's state is `dda`.
    pub fn begin(&mut self, dda: &Dda) {
        (self.phase, self.backwards) = (dda.phase, dda.backwards);
        for (m, steps) in self.steps.iter_mut().enumerate() {
            // A step that is due has left the phase already, but its pulse comes with the next tick.
            *steps = signed(i32::from(dda.due >> m & 1), dda.backwards, m);
        }
        self.advance(&dda.increment, dda.ticks);
    }

    /// Adds steps by which the generator was ahead of the motors.
    pub fn add(&mut self, steps: &[i32; MOTORS]) {
        for (steps, more) in self.steps.iter_mut().zip(steps) {
            *steps = steps.wrapping_add(*more);
        }
    }

    /// Replays a segment that the generator runs.
    pub fn run(&mut self, segment: &Segment) {
        let turned = segment.backwards ^ self.backwards;
        self.backwards = segment.backwards;
        for (m, phase) in self.phase.iter_mut().enumerate() {
            if turned & 1 << m != 0 {
                *phase = !*phase & !STEP;
            }
        }
        self.advance(&segment.increment, segment.ticks);
    }

    fn advance(&mut self, increment: &[u16; MOTORS], ticks: u16) {
        let motors = self.phase.iter_mut().zip(self.steps.iter_mut()).zip(increment).enumerate();
        for (m, ((phase, steps), increment)) in motors {
            // Below 2^31: an increment is at most a step.
            let way = u32::from(*phase) + u32::from(*increment) * u32::from(ticks);
            *phase = way as u16 & !STEP;
            *steps = steps.wrapping_add(signed((way >> STEP_LOG2) as i32, self.backwards, m));
        }
    }

    /// Returns where the motors were at the recorded moment, given that they are `at` when every segment has been
    /// run.
    pub fn before(&self, at: &[i32; MOTORS]) -> [i32; MOTORS] {
        let mut before = *at;
        for (at, steps) in before.iter_mut().zip(&self.steps) {
            *at = at.wrapping_sub(*steps);
        }
        before
    }
}

fn signed(steps: i32, backwards: u8, motor: usize) -> i32 {
    if backwards & 1 << motor != 0 { -steps } else { steps }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dda::{LOCKSTEP, Pins, SEGMENTS};
    use avr_embassy::ring::Ring;
    use proptest::prelude::*;
    use std::boxed::Box;
    use std::vec::Vec;

    #[derive(Default)]
    struct Counted {
        position: [i32; MOTORS],
        backwards: u8,
        stopped: bool,
    }

    impl Pins for Counted {
        fn rise(&mut self, motors: u8) {
            for m in 0..MOTORS {
                let step = i32::from(motors >> m & 1);
                self.position[m] += signed(step, self.backwards, m);
            }
        }
        fn fall(&mut self, _motors: u8) {}
        fn direction(&mut self, backwards: u8) {
            self.backwards = backwards;
        }
        fn period(&mut self, _cycles: u16) {}
        fn slot_free(&mut self) {}
        fn stop(&mut self) {
            self.stopped = true;
        }
    }

    fn segment(increment: [u16; MOTORS], ticks: u16, backwards: u8) -> Segment {
        let moving =
            (0..MOTORS as u8).filter(|m| increment[*m as usize] != 0).fold(0, |b, m| b | 1 << m);
        let full =
            (0..MOTORS as u8).filter(|m| increment[*m as usize] == STEP).fold(0, |b, m| b | 1 << m);
        let mut segment = Segment { increment, ticks, backwards, moving, ..Segment::default() };
        segment.seal(full, STEP);
        segment
    }

    proptest! {
        /// For any segments, and at any tick.
        #[test]
        fn the_steps_behind_a_moment_are_known(
            segments in prop::collection::vec(
                ([0u16..=STEP, 0u16..=STEP, 0u16..=STEP, 0u16..=STEP], 1u16..200, 0u8..16, 0u8..8), 1..7),
            moment in 0u32..1_500,
        ) {
            let segments: Vec<Segment> = segments.into_iter().map(|(mut increment, ticks, back, few)| {
                // Some stand still, some go at full speed.
                for (m, increment) in increment.iter_mut().enumerate() {
                    match few >> 1 {
                        0 => *increment = if m == 2 { STEP } else { 0 },
                        1 if m > 1 => *increment = 0,
                        _ => {}
                    }
                }
                segment(increment, ticks, back)
            }).collect();
            let ring: &'static Ring<Segment, SEGMENTS> = Box::leak(Box::default());
            let (mut producer, mut consumer) = ring.split().unwrap();
            segments.iter().for_each(|segment| producer.push(*segment).unwrap());
            let (mut dda, mut pins) = (Dda::new(), Counted::default());
            let mut at = None;
            for tick in 0.. {
                if tick == moment {
                    at = Some((dda.clone(), pins.position, producer.used()));
                }
                if pins.stopped {
                    break;
                }
                dda.tick(&mut pins, &mut consumer);
            }
            if let Some((dda, position, waiting)) = at {
                let mut replay = StepReplay::new();
                replay.begin(&dda);
                segments[segments.len() - waiting..].iter().for_each(|segment| replay.run(segment));
                prop_assert_eq!(replay.before(&pins.position), position);
            }
        }
    }

    #[test]
    fn lockstep_is_a_step_each_tick() {
        let segment = segment([STEP, 0, STEP, 0], 100, 0b100);
        assert_eq!(segment.mode, LOCKSTEP | 0b101);
        let mut replay = StepReplay::new();
        replay.run(&segment);
        assert_eq!(replay.before(&[0; MOTORS]), [-100, 0, 100, 0]);
    }
}
