//! Squaring: homing an axis with two motors that have a homing switch each, so that each motor ends off its own
//! switch.
//!
//! The second motor is the one with the highest number that shares its axis with a motor before it. `sqsw` says where
//! its switch is; the first motor has the switch of the axis. [`home`](super::home) adds these stages:
//!
//! | stage | move | ends |
//! |---|---|---|
//! | `Search` | both motors | where the first of the switches closes |
//! | `Square` | the motor whose switch is open, slowly, `lb` at most | where its switch closes |
//! | `Latch` | the first motor off its switch | where it opens |
//! | `LatchSecond` | the second motor off its own | where it opens |
//! | `Level` | the second motor | as far off its switch as the first one from its own, and `sqof` farther |
//! | `Zero` | both motors | as in homing without squaring |
//!
//! So homing never makes an axis more askew than before, except by the travel in which its switches open. A motor moves
//! alone when the other motors are taken off the axis ([`Dynamics::drives`](crate::motion::dynamics::Dynamics)). After
//! each such move the steps of all motors are computed again from the position of the first motor ([`Planner::level`]).
//! Otherwise the next move would also correct the second motor. Code that ends the cycle early orders this computation
//! as well.

use kerf_macros::small;

use super::Planner;
use crate::boards::{MOTORS, inputs};
use crate::config::groups::squaring;
use crate::config::{Owner, Setting};
use crate::kinematics;
use crate::status::Status;
use crate::tasks::homing::Homing;
use crate::tasks::setup::moved_by;
use crate::tasks::{common, switches};
use crate::units::{AXES, Length};

/// The second motor of an axis that is squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Second {
    /// The number of the motor, from 0.
    motor: u8,
    /// The input of its switch.
    input: u8,
}

impl Second {
    /// Returns the steps of this motor from those of all motors.
    pub fn of(self, steps: &[i32; MOTORS]) -> i32 {
        steps.get(usize::from(self.motor)).copied().unwrap_or_default()
    }

    /// Returns the bit of the motor's switch.
    pub fn switch(self) -> u16 {
        1 << self.input
    }

    /// The ends of axes that are no limits while this motor is homed, as bits. Both ends of an axis, which may share
    /// one pin.
    pub fn ends(self) -> u8 {
        if usize::from(self.input) < inputs::ENDS { 3 << (self.input & !1) } else { 0 }
    }
}

impl Planner {
    /// Returns the second motor of the axis, if the axis is squared, or why it cannot be squared.
    #[inline(never)]
    #[small]
    pub(super) fn second(&self, axis: u8, homing: &Homing) -> Result<Option<Second>, Status> {
        let Some(input) = (self.squaring(squaring::SW) as u8).checked_sub(1) else {
            return Ok(None);
        };
        let settings = self.links.settings.borrow();
        let drives = |m: usize| moved_by(&settings, m);
        let shares = |m: &usize| {
            let axis = drives(*m);
            usize::from(axis) < AXES && (0..*m).any(|before| drives(before) == axis)
        };
        let Some(motor) = (1..MOTORS).rev().find(shares).filter(|m| drives(*m) == axis) else {
            return Ok(None);
        };
        let wired = switches::WIRED >> input & 1 != 0;
        // A motor that is driven against a stop would drive the other motor, too.
        let stalls = self.homes_by_stall(axis);
        if stalls || !wired || homing.has_pin(input) || homing.backoff == Length::ZERO {
            return Err(Status::HomingSwitches);
        }
        Ok(Some(Second { motor: motor as u8, input }))
    }

    /// Returns a setting of the group `sq`.
    fn squaring(&self, row: u8) -> i32 {
        Setting::of(Owner::Squaring, row).map_or(0, |setting| self.links.storage.cold(setting))
    }

    /// Makes either the second motor or all other motors of the axis drive it alone. `moves`: the second motor does.
    #[inline(never)]
    #[small]
    pub(super) fn alone(&mut self, axis: u8, second: Second, moves: bool) {
        for (m, drives) in (0..).zip(self.dynamics.drives.iter_mut()) {
            if *drives == axis && (m == second.motor) != moves {
                *drives = kinematics::NOTHING;
            }
        }
    }

    /// Ends a move of some motors of the axis: all motors drive it again, and their steps are counted from where the
    /// first motor is. Returns how far the second motor is from its step `from`.
    #[inline(never)]
    #[small]
    pub(super) fn level(&mut self, second: Second, from: i32) -> Length {
        let motion = common::snapshot(self.links.thread);
        self.relocate(&motion);
        let m = usize::from(second.motor);
        let settings = self.links.settings.borrow();
        for (m, drives) in self.dynamics.drives.iter_mut().enumerate() {
            *drives = moved_by(&settings, m);
        }
        let ratio = settings.step_ratio(m);
        drop(settings);
        let position = self.position;
        self.set_position(&position);
        ratio.length(second.of(&motion.target).wrapping_sub(from)).unwrap_or_default()
    }

    /// Returns how much farther off its switch the second motor is to stand than the first one.
    pub(super) fn squaring_offset(&self) -> Length {
        Length(self.squaring(squaring::OF))
    }
}

const _: () = assert!(inputs::COUNT <= 16, "a bit each");
