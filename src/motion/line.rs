//! From a straight move to a block: length, limits along the path, junction, steps.
//!
//! Called by the planner task. Owns the direction of the last move and the motor positions at the
//! end of the last block. Units: what [`Machine`] says on the way in; mm (degrees for a move of
//! rotary axes alone) and s on the way out. Costs are AVR cycles.
//!
//! Steps are the difference of two exact absolute positions, so nothing accumulates: neither
//! rounding nor moves shorter than a step. A move without any steps (shorter than one, or of an axis
//! without a motor) is still a block and takes its time, or the next step would come too early.

use super::block::{Block, Kind};
use super::junction::{self, Heading};
use super::profile::lesser;
use crate::boards::MOTORS;
use crate::gcode::command::Feed;
use crate::math::sqrt;
use crate::units::{AXES, FIRST_ROTARY, Length, PerAxis};

/// What the builder needs to know of the machine. Axes are 0 to 5 for X Y Z A B C; a limit that is
/// not positive is none; mm are degrees for rotary axes.
pub trait Machine {
    /// Traverse velocity of an axis, mm/min.
    fn velocity_max(&self, axis: usize) -> f32;
    /// Feed velocity of an axis, mm/min.
    fn feedrate_max(&self, axis: usize) -> f32;
    /// Jerk of an axis, mm/min^3.
    fn jerk_max(&self, axis: usize) -> f32;
    /// Acceleration of an axis, mm/min^2.
    fn accel_max(&self, _axis: usize) -> f32 {
        0.0
    }
    /// Junction deviation of an axis, mm.
    fn junction_deviation(&self, axis: usize) -> f32;
    /// Junction acceleration, mm/min^2.
    fn junction_acceleration(&self) -> f32;
    /// The axis that a motor drives; [`AXES`] or more if none.
    fn motor_axis(&self, motor: usize) -> u8;
    /// The absolute position of a motor, steps, when its axis is at `position`.
    fn steps(&self, motor: usize, position: Length) -> i32;
    /// Steps a second that a motor can be given.
    fn max_step_rate(&self) -> f32;
    /// Shortest time in which a block with steps can be prepared, s; 0 for no limit. Shorter ones are
    /// slowed down, so that exec never falls behind the steppers.
    fn min_block_time(&self) -> f32 {
        0.0
    }
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
    /// The N word, 0 for none.
    pub line: u32,
}

/// Makes blocks.
#[derive(Clone, Copy, Debug, Default)]
pub struct Builder {
    /// The direction of the last move.
    heading: Heading,
    /// The velocity limit of the last move; 0 if the machine stands still after it.
    cruise: f32,
    /// Motor positions at the end of the last block.
    steps: [i32; MOTORS],
}

impl Builder {
    /// The block for a move; its `entry` is left to the look-ahead. `None`, and nothing changed, if
    /// it has no length, or more steps than an `i32` holds.
    ///
    /// Cost: 7,000 + 3,500 for each axis that moves, and four [`Machine::steps`].
    pub fn line(&mut self, line: &Line, machine: &impl Machine) -> Option<Block> {
        let mut path = Path::new(line.from, line.to)?;
        let target = targets(line.to, &self.steps, machine);
        let steps = difference(&target, &self.steps)?;
        path.limit(line.feed, machine);
        path.limit_steps(&steps, machine.max_step_rate(), machine.min_block_time());
        let heading = Heading::new(path.unit, |axis| machine.junction_deviation(axis));
        let mut entry_max = lesser(path.cruise, self.cruise);
        if entry_max > 0.0 {
            let acceleration = machine.junction_acceleration() * PER_MINUTE2;
            entry_max = lesser(entry_max, junction::limit(&self.heading, &heading, acceleration));
        }
        *self = Builder { heading, cruise: path.cruise, steps: target };
        Some(Block {
            steps,
            length: path.length,
            cruise: path.cruise,
            entry_max,
            entry: 0.0,
            accel: path.accel,
            jerk: path.jerk,
            line: line.line,
            kind: Kind::Line,
        })
    }

    /// The next move starts from rest.
    pub fn stopped(&mut self) {
        self.cruise = 0.0;
    }

    /// The motors are not where the last block would have left them (a flushed queue, homing): they
    /// are at `steps`, at rest.
    pub fn at(&mut self, steps: [i32; MOTORS]) {
        self.steps = steps;
        self.stopped();
    }

    /// The block that renames the present position. Motors without an axis keep theirs.
    pub fn set_position(
        &mut self,
        position: &PerAxis<Length>,
        line: u32,
        machine: &impl Machine,
    ) -> Block {
        self.at(targets(position, &self.steps, machine));
        Block { steps: self.steps, line, kind: Kind::SetPosition, ..Block::default() }
    }

    /// The block that stands still.
    pub fn dwell(&mut self, ms: u32, line: u32) -> Block {
        self.stopped();
        let ms = i32::try_from(ms).unwrap_or(i32::MAX);
        Block { steps: [ms, 0, 0, 0], line, kind: Kind::Dwell, ..Block::default() }
    }

    /// The block for a program stop or end.
    pub fn stop(&mut self, kind: Kind, line: u32) -> Block {
        self.stopped();
        Block { line, kind, ..Block::default() }
    }
}

/// Seconds in the units of [`Machine`].
const PER_MINUTE: f32 = 1.0 / 60.0;
const PER_MINUTE2: f32 = 1.0 / 3_600.0;
const PER_MINUTE3: f32 = 1.0 / 216_000.0;

/// Where the motors are when the axes are at `position`.
fn targets(
    position: &PerAxis<Length>,
    present: &[i32; MOTORS],
    machine: &impl Machine,
) -> [i32; MOTORS] {
    let mut steps = *present;
    for (motor, steps) in steps.iter_mut().enumerate() {
        if let Some(&length) = position.get(usize::from(machine.motor_axis(motor))) {
            *steps = machine.steps(motor, length);
        }
    }
    steps
}

fn difference(to: &[i32; MOTORS], from: &[i32; MOTORS]) -> Option<[i32; MOTORS]> {
    let mut steps = [0; MOTORS];
    for (steps, (to, from)) in steps.iter_mut().zip(to.iter().zip(from)) {
        *steps = to.checked_sub(*from)?;
    }
    Some(steps)
}

/// The way from here to there, and what limits it.
struct Path {
    length: f32,
    /// Travel of each axis for a unit of length.
    unit: PerAxis<f32>,
    cruise: f32,
    accel: f32,
    jerk: f32,
}

impl Path {
    /// Length and direction, without limits. `None` if it has no length. The length is that of the
    /// linear axes; of the rotary ones if no linear one moves.
    fn new(from: &PerAxis<Length>, to: &PerAxis<Length>) -> Option<Self> {
        let mut travel = [0.0; AXES];
        for (travel, (to, from)) in travel.iter_mut().zip(to.iter().zip(from)) {
            *travel = match to.checked_sub(*from) {
                Some(distance) => distance.to_mm(),
                None => to.to_mm() - from.to_mm(),
            };
        }
        let (linear, rotary) = travel.split_at(FIRST_ROTARY);
        let mut length = norm(linear);
        if length <= 0.0 {
            length = norm(rotary);
        }
        if length <= 0.0 {
            return None;
        }
        let scale = 1.0 / length;
        let unit = travel.map(|d| if d == 0.0 { 0.0 } else { d * scale });
        Some(Path { length, unit, cruise: f32::MAX, accel: f32::MAX, jerk: f32::MAX })
    }

    /// Applies the feed and the limits of every axis that moves.
    fn limit(&mut self, feed: Option<Feed>, machine: &impl Machine) {
        for (axis, &u) in self.unit.iter().enumerate() {
            if u == 0.0 {
                continue;
            }
            // The path moves so much faster than the axis.
            let ratio = if u < 0.0 { -1.0 / u } else { 1.0 / u };
            let velocity = match feed {
                None => machine.velocity_max(axis),
                Some(_) => machine.feedrate_max(axis),
            };
            lower(&mut self.cruise, velocity, ratio);
            lower(&mut self.accel, machine.accel_max(axis), ratio);
            lower(&mut self.jerk, machine.jerk_max(axis), ratio);
        }
        match feed {
            Some(Feed::PerMinute(feed)) => lower(&mut self.cruise, feed, 1.0),
            Some(Feed::Minutes(time)) if time > 0.0 => {
                lower(&mut self.cruise, self.length / time, 1.0);
            }
            _ => {}
        }
        self.cruise *= PER_MINUTE;
        // In a block no limit is 0.
        self.accel = if self.accel < f32::MAX { self.accel * PER_MINUTE2 } else { 0.0 };
        self.jerk = if self.jerk < f32::MAX { self.jerk * PER_MINUTE3 } else { 0.0 };
    }

    /// Keeps every motor within `rate` steps a second, and a block with steps at `time` or longer.
    fn limit_steps(&mut self, steps: &[i32; MOTORS], rate: f32, time: f32) {
        let most = steps.iter().map(|steps| steps.unsigned_abs()).max().unwrap_or(0);
        if most > 0 {
            lower(&mut self.cruise, rate / most as f32, self.length);
            if time > 0.0 {
                lower(&mut self.cruise, self.length / time, 1.0);
            }
        }
    }
}

/// Lowers `limit` to `value * ratio`, if `value` is a limit at all.
fn lower(limit: &mut f32, value: f32, ratio: f32) {
    if value > 0.0 {
        *limit = lesser(*limit, value * ratio);
    }
}

fn norm(travel: &[f32]) -> f32 {
    let mut sum = 0.0;
    for &d in travel {
        if d != 0.0 {
            sum += d * d;
        }
    }
    sqrt(sum)
}
