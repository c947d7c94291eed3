//! The settings as the interpreter and the planner read them.

use kerf_macros::small;

use super::homing;
use crate::boards::{ACTIVE, MOTORS, inputs};
use crate::capability::Capability;
use crate::config::getters::TRAVEL_NONE;
use crate::config::groups::system;
use crate::config::shape::{Resonances, SHAPED};
use crate::config::{Setting, Settings, StepRatio};
use crate::gcode::heating::Part;
use crate::gcode::modal::{Defaults, Distance, PathMode, Plane, Units};
use crate::gcode::setup::{AxisMode, Setup};
use crate::hal::{encoder, inputs as pins};
use crate::kinematics::{self, DIFFERENCE, SUM};
use crate::motion::backlash::{KEPT, KEPT_VELOCITY, Slack, WIDTH_MOST, least_pace, pace};
use crate::motion::block::PARTS_LOG2;
use crate::motion::dynamics::{MachineLimits, PER_SECOND_SQUARED};
use crate::motion::line::Motors;
use crate::motion::pace::Drivers;
use crate::motion::smooth::SAMPLE_S;
use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};

/// The most by which an arc may exceed the reach: see `gcode::limits`.
const REACH_SLACK: i32 = 256;
/// The sensors of an encoder without sync ([`encoder::in_use`]).
const INDEX_ALONE: u8 = 1;

#[small]
impl Setup for Settings {
    fn mode(&self, axis: u8) -> AxisMode {
        match self.axis_mode(axis.into()) {
            0 => AxisMode::Disabled,
            2 => AxisMode::Inhibited,
            3 => AxisMode::Radius,
            _ => AxisMode::Standard,
        }
    }

    fn radius(&self, axis: u8) -> u32 {
        self.radius_nm(axis.into())
    }

    #[inline(always)]
    fn travel(&self, axis: u8) -> Option<(Length, Length)> {
        if self.soft_limits() { limited_travel(self, axis) } else { None }
    }

    #[inline(always)]
    fn reach(&self) -> Option<Length> {
        if self.octaves() == 0 { None } else { Some(fine_reach(self)) }
    }

    #[inline(never)]
    fn defaults(&self) -> Defaults {
        Defaults {
            plane: match self.system(system::GPL) {
                0 => Plane::Xy,
                1 => Plane::Zx,
                _ => Plane::Yz,
            },
            units: if self.system(system::GUN) == 0 { Units::Inch } else { Units::Mm },
            system: self.system(system::GCO).saturating_sub(1),
            path: match self.system(system::GPA) {
                0 => PathMode::Exact,
                1 => PathMode::ExactStop,
                _ => PathMode::Continuous,
            },
            distance: match self.system(system::GDI) {
                0 => Distance::Absolute,
                _ => Distance::Incremental,
            },
        }
    }

    fn deletes_blocks(&self) -> bool {
        self.system(system::BD) != 0
    }

    fn stops_at_m1(&self) -> bool {
        self.system(system::OST) != 0
    }

    fn has_probe(&self) -> bool {
        ACTIVE.inputs[inputs::PROBE].is_some() && pins::left_out() >> inputs::PROBE & 1 == 0
    }

    fn encoder(&self, has_sync: bool) -> Result<(), Status> {
        if ACTIVE.encoder.is_none() {
            return Err(Status::NoEncoderInput);
        }
        match encoder::in_use() {
            0 => Err(Status::NoEncoder),
            INDEX_ALONE if has_sync => Err(Status::NoSync),
            _ => Ok(()),
        }
    }

    fn hottest(&self, part: Part) -> u16 {
        let heating = self.heating.first();
        heating.and_then(|heating| heating.hottest.get(part as usize).copied()).unwrap_or(0)
    }

    fn heats(&self, _part: Part) -> Result<(), Status> {
        match self.heating.first().map(|heating| heating.refused) {
            None | Some(Status::Ok) => Ok(()),
            Some(refused) => Err(refused),
        }
    }

    fn extrudes(&self) -> Result<(), Status> {
        match self.heating.first() {
            Some(heating) if !heating.extrudes() => Err(Status::TooCold),
            _ => Ok(()),
        }
    }

    fn drives(&self) -> Result<(), Status> {
        match self.undriven.first() {
            None | Some(Status::Ok) => Ok(()),
            Some(refused) => Err(*refused),
        }
    }

    fn axes_that_home(&self) -> u8 {
        homing::axes(self)
    }

    fn homing(&self, axis: u8) -> Result<(), Status> {
        if Capability::Drivers.is_built_in() {
            self.drives()?;
        }
        homing::of(self, axis).map(|_| ())
    }
}

/// Lowers the velocity limits that `setting` affects to what the motors can follow. Returns whether one was lowered.
#[inline(never)]
#[small]
pub fn limit_velocity(settings: &mut Settings, setting: Setting) -> bool {
    let drivers = MachineLimits::drivers(settings);
    settings.limit_velocity(setting, |motors| drivers.step_rate_max(motors) as u32)
}

/// Returns what moves a motor: the position of an axis, or the positions of X and Y together ([`kinematics`]). A motor
/// of an inhibited axis stands still.
#[small]
pub fn moved_by(settings: &Settings, motor: usize) -> u8 {
    let drives = settings.motor_axis(motor);
    let moves = |axis| settings.mode(axis) != AxisMode::Inhibited;
    let moved = match kinematics::is_shared(drives) {
        true => moves(0) && moves(1),
        false => usize::from(drives) < AXES && moves(drives),
    };
    if moved { drives } else { kinematics::NOTHING }
}

/// Returns where an axis is when the motors are at these steps; `None` if no motor moves it. Of several motors the
/// first one is used. If the motor is at the steps of `end`, the axis is at `end` exactly, so that fractions of a step
/// are not lost. Cost: 3,000 cycles.
#[inline(never)]
#[small]
pub fn counted(
    settings: &Settings,
    steps: &[i32; MOTORS],
    axis: usize,
    end: Option<&PerAxis<Length>>,
) -> Option<Length> {
    let of = |drives| coordinate(settings, steps, drives, end);
    if Capability::CoreXy.is_built_in()
        && axis < 2
        && let (Some(sum), Some(difference)) = (of(SUM), of(DIFFERENCE))
    {
        return Some(kinematics::axis(axis, sum, difference));
    }
    of(axis as u8)
}

/// Returns where the first motor is that `drives` moves.
#[inline(never)]
#[small]
fn coordinate(
    settings: &Settings,
    steps: &[i32; MOTORS],
    drives: u8,
    end: Option<&PerAxis<Length>>,
) -> Option<Length> {
    let motor = (0..MOTORS).find(|motor| moved_by(settings, *motor) == drives)?;
    let (ratio, steps) = (settings.step_ratio(motor), *steps.get(motor)?);
    match end.and_then(|end| kinematics::place_of(drives, end)) {
        Some(end) if ratio.steps(end) == steps => Some(end),
        _ => ratio.length(steps),
    }
}

impl Motors for Settings {
    fn motor_axis(&self, motor: usize) -> u8 {
        moved_by(self, motor)
    }
    fn ratio(&self, motor: usize) -> StepRatio {
        self.step_ratio(motor)
    }
}

impl MachineLimits for Settings {
    fn velocity_max(&self, axis: usize) -> f32 {
        kept(self, axis, Settings::velocity_max(self, axis), KEPT_VELOCITY)
    }
    fn feedrate_max(&self, axis: usize) -> f32 {
        kept(self, axis, Settings::feedrate_max(self, axis), KEPT_VELOCITY)
    }
    fn jerk_max(&self, axis: usize) -> f32 {
        kept(self, axis, Settings::jerk_max(self, axis), KEPT)
    }
    fn accel_max(&self, axis: usize) -> f32 {
        kept(self, axis, Settings::accel_max(self, axis), KEPT)
    }
    #[inline(always)]
    fn has_backlash(&self) -> bool {
        Capability::Backlash.is_built_in() && (0..AXES).any(|axis| has_backlash(self, axis))
    }
    #[inline(always)]
    fn resonances(&self) -> [Resonances; SHAPED] {
        self.resonances
    }
    fn junction_deviation(&self, axis: usize) -> f32 {
        Settings::junction_deviation(self, axis)
    }
    fn junction_acceleration(&self) -> f32 {
        Settings::junction_acceleration(self)
    }
    fn drivers(&self) -> Drivers {
        Drivers { pulse_us: self.step_pulse_us(), setup_us: self.direction_setup_us() }
    }
}

/// Returns the `share` of a limit that an axis with backlash has for its path; all of it on another axis.
#[inline(always)]
fn kept(settings: &Settings, axis: usize, limit: f32, share: f32) -> f32 {
    let shares = Capability::Backlash.is_built_in() && has_backlash(settings, axis);
    if shares { limit * share } else { limit }
}

/// Whether a motor that an axis turns has backlash.
#[inline(never)]
#[small]
fn has_backlash(settings: &Settings, axis: usize) -> bool {
    let has = |axis| settings.backlash(axis) != Length::ZERO;
    let shared = Capability::CoreXy.is_built_in() && axis < 2 && (has(0) || has(1));
    has(axis)
        || shared && (0..MOTORS).any(|motor| kinematics::is_shared(settings.motor_axis(motor)))
}

/// Returns the backlash of a motor. An axis without motor, or an inhibited one, has none.
#[inline(never)]
#[small]
pub fn slack_of(settings: &Settings, motor: usize) -> Slack {
    let axis = usize::from(kinematics::stands_for(moved_by(settings, motor)));
    let (width, ratio) = (settings.backlash(axis), settings.step_ratio(motor));
    if width == Length::ZERO {
        return Slack::NONE;
    }
    let velocity = MachineLimits::velocity_max(settings, axis) * (1.0 / 60.0);
    let accel = MachineLimits::accel_max(settings, axis) * PER_SECOND_SQUARED;
    // In 1/16 step: sixteen times the way in a sample.
    let way = pace(velocity, accel) * (SAMPLE_S * (1 << PARTS_LOG2) as f32 * 1e4);
    let width = ratio.steps(width).clamp(0, WIDTH_MOST.into()) as u16;
    let pace = ratio.steps(Length(way as i32)).clamp(least_pace(width).into(), u8::MAX.into());
    Slack { width, pace: pace as u8 }
}

/// Returns how far steps can be counted if some motor makes several in the shortest length.
#[inline(never)]
#[small]
fn fine_reach(settings: &Settings) -> Length {
    match settings.octaves() {
        octaves @ ..=14 => Length((i32::MAX >> octaves) - REACH_SLACK),
        // A block could not hold the steps of the shortest move: no move is possible, not even from the origin.
        _ => Length(-1),
    }
}

/// Returns the travel of an axis if soft limits are on; `None` if the axis has no limits.
#[inline(never)]
#[small]
fn limited_travel(settings: &Settings, axis: u8) -> Option<(Length, Length)> {
    let (low, high) = (settings.travel_min(axis.into()), settings.travel_max(axis.into()));
    if low == high {
        return None;
    }
    // The lowest value that can be set, and anything below it, means no limit, at either end.
    let end = |end, far| if end == TRAVEL_NONE { Length(far) } else { end };
    Some((end(low, i32::MIN), end(high, i32::MAX)))
}
