//! From a straight move to a block: length, limits along the path, junction, steps.
//!
//! Called by the planner task. Owns the direction of the last move and the motor positions at the
//! end of the last block. Costs are AVR cycles.
//!
//! Steps are the difference of two exact absolute positions, so nothing accumulates: neither
//! rounding nor moves shorter than a step. A move without any steps (shorter than one, or of an axis
//! without a motor) is still a block and takes its time, or the next step would come too early.
//!
//! A ramp may go over many blocks. Without a jerk limit each may have its own acceleration limit, what
//! its axes allow in its direction. With one, acceleration and jerk must be alike for as long as
//! possible: then they are those of the slowest axis that moves, whatever the direction.

use super::block::{Block, Body, Line as Move};
use super::dynamics::{Axis, Dynamics};
use super::exec::{BLOCK_S_MIN, step_rate_max};
use super::float::lesser;
use super::governor::{ACCEL_MOST, effective_jerk};
use super::junction::{self, Heading};
use super::prep::STEPS_MAX;
use super::short::Short;
use super::steps::Motor;
use crate::boards::MOTORS;
use crate::config::StepRatio;
use crate::gcode::command::Feed;
use crate::math::sqrt;
use crate::units::{AXES, FIRST_ROTARY, Length, PerAxis};

/// What the builder needs to know of the motors.
pub trait Motors {
    /// The axis that a motor drives; [`AXES`] or more if none.
    fn motor_axis(&self, motor: usize) -> u8;
    /// Steps of a motor for its axis' travel.
    fn ratio(&self, motor: usize) -> StepRatio;
}

/// A straight move.
#[derive(Clone, Copy, Debug)]
pub struct Line<'a> {
    /// Where the last move ended.
    pub from: &'a PerAxis<Length>,
    /// Where this one ends.
    pub to: &'a PerAxis<Length>,
    /// How fast; a traverse if `None`. Positive: the interpreter refuses a feed of 0.
    pub feed: Option<Feed>,
}

/// What becomes of a move.
#[derive(Clone, Copy, Debug)]
pub enum Built {
    /// Nothing: it has no length.
    Nothing,
    /// A block, which may be entered at so many mm/s.
    Line(Move, f32),
    /// More steps than a block holds: to be made in so many parts.
    Parts(u16),
}

/// Makes blocks.
#[derive(Clone, Copy, Debug, Default)]
pub struct Builder {
    /// The direction of the last move.
    heading: Heading,
    /// The velocity limit of the last move; 0 if the machine stands still after it.
    cruise: f32,
    /// Motors at the end of the last block.
    motors: [Motor; MOTORS],
}

impl Builder {
    /// The block for a move. Nothing is changed unless it is [`Built::Line`].
    ///
    /// Cost: 3,000 + 1,200 for each axis that moves and 600 for each motor, for short moves.
    #[inline(never)]
    pub fn line(&mut self, line: &Line, dynamics: &Dynamics, machine: &impl Motors) -> Built {
        let Some(mut path) = Path::new(line.from, line.to) else {
            return Built::Nothing;
        };
        let motors = self.moved(&path, line.to, machine);
        let mut steps = [0; MOTORS];
        let mut most = 0;
        let mut moving = 0;
        for (m, steps) in steps.iter_mut().enumerate() {
            let way = i64::from(motors[m].steps) - i64::from(self.motors[m].steps);
            if way == 0 {
                continue;
            }
            moving += 1;
            let size = way.unsigned_abs();
            if size > u64::from(STEPS_MAX) {
                return Built::Parts(parts(size));
            }
            *steps = way as i16;
            most = if size as u16 > most { size as u16 } else { most };
        }
        path.limit(line.feed, dynamics);
        path.limit_steps(most, moving);
        let heading = Heading::new(path.unit, dynamics);
        let mut entry = lesser(path.cruise, self.cruise);
        if entry > 0.0 {
            let corner = junction::limit(&self.heading, &heading, dynamics.junction, entry);
            entry = lesser(entry, corner);
        }
        *self = Builder { heading, cruise: path.cruise, motors };
        let block = Move {
            steps,
            length: path.length,
            cruise: path.cruise,
            start: 0.0,
            entry: Short::default(),
            accel: path.accel,
            jerk: path.jerk,
        };
        Built::Line(block, entry)
    }

    /// The next move starts from rest.
    pub fn stopped(&mut self) {
        self.cruise = 0.0;
    }

    /// The block that renames the present position. Motors without an axis keep theirs.
    pub fn set_position(&mut self, position: &PerAxis<Length>, machine: &impl Motors) -> Body {
        for (m, motor) in self.motors.iter_mut().enumerate() {
            if let Some(&position) = position.get(usize::from(machine.motor_axis(m))) {
                *motor = Motor::at(machine.ratio(m), position);
            }
        }
        self.stopped();
        Body::SetPosition(self.motors.map(|motor| motor.steps))
    }

    /// The block for something that is done at rest.
    pub fn pause(&mut self, body: Body, line: u32) -> Block {
        self.stopped();
        Block { body, line }
    }

    fn moved(&self, path: &Path, to: &PerAxis<Length>, machine: &impl Motors) -> [Motor; MOTORS] {
        let mut motors = self.motors;
        for (m, motor) in motors.iter_mut().enumerate() {
            let axis = usize::from(machine.motor_axis(m));
            if axis < AXES && path.unit[axis] != 0.0 {
                let ratio = machine.ratio(m);
                *motor = match path.travel[axis] {
                    Some(travel) => motor.moved(ratio, travel, to[axis]),
                    None => Motor::at(ratio, to[axis]),
                };
            }
        }
        motors
    }
}

/// Parts of at most [`STEPS_MAX`] steps.
#[inline(never)]
fn parts(steps: u64) -> u16 {
    // The rounding of their ends may add a step.
    u16::try_from(steps / u64::from(STEPS_MAX - 1) + 1).unwrap_or(u16::MAX)
}

/// The way from here to there, and what limits it.
struct Path {
    /// Travel of each axis, in units of [`Length`], if it is in range.
    travel: PerAxis<Option<i32>>,
    length: f32,
    /// Travel of each axis for a unit of length.
    unit: PerAxis<f32>,
    cruise: f32,
    accel: Short,
    jerk: Short,
}

impl Path {
    /// Length and direction, without limits. `None` if it has no length. The length is that of the
    /// linear axes; of the rotary ones if no linear one moves.
    fn new(from: &PerAxis<Length>, to: &PerAxis<Length>) -> Option<Self> {
        let mut travel = [None; AXES];
        let mut unit = [0.0; AXES];
        for axis in 0..AXES {
            let way = to[axis].0.checked_sub(from[axis].0);
            travel[axis] = way;
            unit[axis] = match way {
                Some(0) => 0.0,
                Some(way) => way as f32,
                None => to[axis].0 as f32 - from[axis].0 as f32,
            };
        }
        let (linear, rotary) = unit.split_at(FIRST_ROTARY);
        let mut length = norm(linear);
        if length == 0.0 {
            length = norm(rotary);
        }
        if length == 0.0 {
            return None;
        }
        let scale = 1.0 / length;
        for u in &mut unit {
            if *u != 0.0 {
                *u *= scale;
            }
        }
        let length = length * 1e-4;
        let (accel, jerk) = (Short::default(), Short::default());
        Some(Path { travel, length, unit, cruise: f32::MAX, accel, jerk })
    }

    /// Applies the feed and the limits of every axis that moves.
    fn limit(&mut self, feed: Option<Feed>, dynamics: &Dynamics) {
        match feed {
            Some(Feed::PerMinute(feed)) if feed > 0.0 => self.cruise = feed * (1.0 / 60.0),
            Some(Feed::Minutes(time)) if time > 0.0 => {
                self.cruise = self.length / (time * 60.0);
            }
            _ => {}
        }
        for (&u, axis) in self.unit.iter().zip(&dynamics.axes) {
            if u != 0.0 {
                let velocity = if feed.is_some() { axis.feed } else { axis.velocity };
                let u = size(u);
                if velocity > 0.0 && u * self.cruise > velocity {
                    self.cruise = velocity / u;
                }
            }
        }
        // Slower than any machine, so that no division goes wrong.
        if self.cruise > CRUISE_MOST {
            self.cruise = CRUISE_MOST;
        } else if self.cruise < CRUISE_LEAST {
            self.cruise = CRUISE_LEAST;
        }
        self.limit_change(dynamics);
    }

    /// Acceleration and jerk.
    fn limit_change(&mut self, dynamics: &Dynamics) {
        let mut slowest = Slowest::default();
        for (&u, axis) in self.unit.iter().zip(&dynamics.axes) {
            if u != 0.0 {
                slowest.look(size(u), axis);
            }
        }
        let jerk = slowest.jerk;
        if slowest.accel > 0.0 {
            let least = slowest.least;
            let jerk = effective_jerk(jerk, least);
            // Moves of both linear and rotary axes have units above 1.
            let accel =
                if jerk > 0.0 { least / slowest.most } else { slowest.accel / slowest.unit };
            self.accel = Short::new(lesser(accel, ACCEL_MOST));
            self.jerk = Short::new(if jerk > 0.0 { jerk / slowest.most } else { 0.0 });
        } else if jerk > 0.0 {
            // What a ramp to full speed comes to, so that the jerk alone limits it.
            let jerk = jerk / slowest.most;
            let accel = lesser(sqrt(jerk * power_of_two_above(self.cruise)), ACCEL_MOST);
            self.accel = Short::new(accel);
            self.jerk = Short::new(effective_jerk(jerk, accel));
        } else {
            self.accel = Short::new(ACCEL_MOST);
        }
    }

    /// Keeps motors within the rate that so many can have together, and a block with steps long
    /// enough for exec.
    fn limit_steps(&mut self, most: u16, moving: usize) {
        const RATES: [f32; MOTORS] =
            [step_rate_max(1), step_rate_max(2), step_rate_max(3), step_rate_max(4)];
        if moving == 0 {
            return;
        }
        let way = RATES[moving - 1] * self.length;
        let most = f32::from(most);
        if self.cruise * most > way {
            self.cruise = way / most;
        }
        if self.cruise * BLOCK_S_MIN > self.length {
            self.cruise = self.length * (1.0 / BLOCK_S_MIN);
        }
    }
}

/// Velocities beyond all machines, mm/s.
const CRUISE_MOST: f32 = 1e5;
/// See [`CRUISE_MOST`].
const CRUISE_LEAST: f32 = 1e-6;

/// The axis that limits the acceleration, and the least limits of all axes.
#[derive(Default)]
struct Slowest {
    /// Limit and unit of the axis that limits most.
    accel: f32,
    unit: f32,
    least: f32,
    jerk: f32,
    /// The largest unit, at least 1.
    most: f32,
}

impl Slowest {
    fn look(&mut self, u: f32, axis: &Axis) {
        let accel = axis.accel.get();
        if accel > 0.0 {
            if self.accel == 0.0 || accel < self.least {
                self.least = accel;
            }
            let slower = if self.accel == 0.0 {
                true
            } else if accel == self.accel {
                u > self.unit
            } else {
                accel * self.unit < self.accel * u
            };
            if slower {
                self.accel = accel;
                self.unit = u;
            }
        }
        let jerk = axis.jerk.get();
        if jerk > 0.0 && (self.jerk == 0.0 || jerk < self.jerk) {
            self.jerk = jerk;
        }
        if self.most == 0.0 {
            self.most = 1.0;
        }
        if u > self.most {
            self.most = u;
        }
    }
}

/// The power of two that is not below `x`, as blocks of nearly the same velocity are to have the same
/// limits. Cost: 20.
fn power_of_two_above(x: f32) -> f32 {
    let bits = x.to_bits();
    f32::from_bits((bits + 0x007F_FFFF) & 0xFF80_0000)
}

fn size(u: f32) -> f32 {
    f32::from_bits(u.to_bits() & 0x7FFF_FFFF)
}

fn norm(travel: &[f32]) -> f32 {
    let mut sum = 0.0;
    let mut moving = 0;
    let mut only = 0.0;
    for &d in travel {
        if d != 0.0 {
            moving += 1;
            only = d;
            sum += d * d;
        }
    }
    if moving == 1 { size(only) } else { sqrt(sum) }
}
