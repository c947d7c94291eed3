//! The limits of the axes, in the units of motion.
//!
//! Owned by the planner task, made from the settings when they change. Settings are integers in the units of the
//! sender, whose conversion takes longer than planning a block.

use super::float::{below, greater, lesser, some};
use super::line::Motors;
use super::pace::Drivers;
use super::short::Short;
use super::smooth::{CORNER_S, Spans};
use crate::boards::MOTORS;
use crate::config::StepRatio;
use crate::config::shape::{Resonances, SHAPED};
use crate::kinematics;
use crate::math::sqrt;
use crate::units::PerAxis;

/// A jerk limit counts as none if it lets the acceleration reach its limit in less than this time, s.
const JERK_TIME_MIN: f32 = 0.001;

/// Returns the jerk limit if it has an effect, else 0; `accel` is the acceleration limit. Neither is negative. Cost: 160.
pub fn effective_jerk(jerk: f32, accel: f32) -> f32 {
    if some(jerk) && below(jerk * JERK_TIME_MIN, accel) { jerk } else { 0.0 }
}

/// The least time, s, that the acceleration takes to reach its limit under a jerk limit with an effect.
const JERKY_S: f32 = 1.0625 * JERK_TIME_MIN;

/// The source of the limits: the settings, in their units. Axes are 0 to 5 for X Y Z A B C. A value that is not
/// positive means no limit. For rotary axes mm stands for degrees.
pub trait MachineLimits {
    /// Traverse velocity of an axis, mm/min.
    fn velocity_max(&self, axis: usize) -> f32;
    /// Feed velocity of an axis, mm/min.
    fn feedrate_max(&self, axis: usize) -> f32;
    /// Jerk of an axis, mm/min^3.
    fn jerk_max(&self, axis: usize) -> f32;
    /// Acceleration of an axis, mm/min^2.
    fn accel_max(&self, axis: usize) -> f32;
    /// Junction deviation of an axis, mm.
    fn junction_deviation(&self, axis: usize) -> f32;
    /// Junction acceleration, mm/min^2.
    fn junction_acceleration(&self) -> f32;
    /// Whether an axis has [backlash](super::backlash).
    fn has_backlash(&self) -> bool {
        false
    }
    /// The resonances of the axes; none in an image that cannot shape.
    fn resonances(&self) -> [Resonances; SHAPED] {
        [Resonances::NONE; SHAPED]
    }
    /// The pulse width and direction set-up time of the drivers.
    fn drivers(&self) -> Drivers {
        Drivers::USUAL
    }
}

/// Converts an acceleration from mm/min^2 to mm/s^2.
pub const PER_SECOND_SQUARED: f32 = 1.0 / 3_600.0;

/// Converts a jerk from mm/min^3 to mm/s^3.
pub const PER_SECOND_CUBED: f32 = 1.0 / 216_000.0;

/// Limits of an axis; 0 for none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Axis {
    /// Traverse velocity, mm/s.
    pub velocity: f32,
    /// Feed velocity, mm/s.
    pub feed: f32,
    /// Acceleration, mm/s^2.
    pub accel: Short,
    /// Jerk, mm/s^3.
    pub jerk: Short,
    /// Junction deviation, mm.
    pub deviation: Short,
    /// By how much the velocity may change at a corner where there are [means](super::smooth), mm/s.
    pub corner: Short,
}

impl Axis {
    /// Whether all limits but the velocities are equal to those of another axis.
    #[inline(always)]
    pub(super) fn is_like(&self, other: &Self) -> bool {
        (self.accel, self.jerk, self.deviation) == (other.accel, other.jerk, other.deviation)
    }

    /// Sets acceleration and jerk, mm/s^2 and mm/s^3; 0 or less for no limit. The velocities must be known. Cost:
    /// 3,000.
    ///
    /// A ramp from 0 to v takes `v / A + A / J`, the least with an acceleration of `sqrt(J v)`. The limit is lowered to
    /// this, and is this if there is none. Even the least limit that results is such that the jerk limit has an effect
    /// ([`effective_jerk`]).
    #[inline(never)]
    #[small]
    pub fn limit_change(&mut self, accel: f32, jerk: f32) {
        let most = sqrt(greater(jerk, 0.0) * greater(self.velocity, self.feed));
        let limits = most > 0.0 && (accel > most || accel <= 0.0);
        let accel = if accel > 0.0 { accel } else { most };
        let accel = if limits { lesser(accel, greater(most, jerk * JERKY_S)) } else { accel };
        (self.accel, self.jerk) = (Short::new(accel), Short::new(jerk));
        self.corner = Short::new(accel * CORNER_S);
    }

    /// Returns how long the acceleration takes to reach its limit, s; 0 without a jerk limit that has an effect.
    #[inline(never)]
    #[small]
    fn build_up(&self) -> f32 {
        let (accel, jerk) = (self.accel.get(), self.jerk.get());
        let jerk = effective_jerk(jerk, accel);
        if jerk > 0.0 { accel / jerk } else { 0.0 }
    }
}

/// Limits of the machine.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dynamics {
    /// Limits of each axis.
    pub axes: PerAxis<Axis>,
    /// Junction acceleration, mm/s^2.
    pub junction: f32,
    /// What each motor drives: an axis, or X and Y together ([`kinematics`]).
    pub drives: [u8; MOTORS],
    /// Highest step rate of each motor, steps/s, by the number of motors that move, less one.
    pub rates: [f32; MOTORS],
    /// The means for motion within these limits.
    pub spans: Spans,
    /// Whether lines are driven with these means, which round corners.
    pub rounds: bool,
    /// Whether lines may be merged: no motor has steps so fine that a [chain](super::chain) could have more steps than
    /// a block holds, not even on CoreXY.
    pub merges: bool,
}

/// Whether a motor has at most half a step in a unit of length. Then a travel of 16 bits along two axes has less than
/// 2^15 steps.
#[inline(never)]
#[small]
fn is_coarse(ratio: StepRatio) -> bool {
    ratio.num <= ratio.den / 2
}

impl Dynamics {
    /// Returns the limits of `machine`. Cost: 5,000 an axis, 600 for each number of motors.
    pub fn new(machine: &(impl MachineLimits + Motors)) -> Self {
        let mut dynamics = Self::default();
        dynamics.set(machine);
        dynamics
    }

    /// Sets the limits to those of `machine`.
    #[inline(never)]
    #[small]
    pub fn set(&mut self, machine: &(impl MachineLimits + Motors)) {
        for (n, axis) in self.axes.iter_mut().enumerate() {
            axis.velocity = machine.velocity_max(n) * (1.0 / 60.0);
            axis.feed = machine.feedrate_max(n) * (1.0 / 60.0);
            axis.deviation = Short::new(machine.junction_deviation(n));
            let accel = machine.accel_max(n) * PER_SECOND_SQUARED;
            axis.limit_change(accel, machine.jerk_max(n) * PER_SECOND_CUBED);
        }
        self.merges = true;
        for (m, axis) in self.drives.iter_mut().enumerate() {
            *axis = machine.motor_axis(m);
            self.merges &= is_coarse(machine.ratio(m));
        }
        self.spans = Spans::of(self.build_up());
        if machine.has_backlash() {
            // The take-up needs a mean, also where no jerk limit has an effect.
            self.spans = self.spans.and_corner();
        }
        let resonances = machine.resonances();
        if resonances.iter().any(Resonances::is_some) {
            self.spans = self.spans.and_shaper(resonances);
        }
        self.junction = machine.junction_acceleration() * PER_SECOND_SQUARED;
        let drivers = machine.drivers();
        for (others, rate) in self.rates.iter_mut().enumerate() {
            *rate = drivers.step_rate_max(others + 1);
        }
    }

    /// Returns the time in which the slowest axis with a motor reaches its acceleration limit, s; 0 if no such axis has
    /// a jerk limit.
    #[inline(never)]
    #[small]
    pub fn build_up(&self) -> f32 {
        let mut most = 0.0;
        for (n, axis) in self.axes.iter().enumerate() {
            if self.drives.iter().any(|drives| kinematics::turns(*drives, n as u8)) {
                most = greater(axis.build_up(), most);
            }
        }
        most
    }
}
