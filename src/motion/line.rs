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
use super::divide::{quotient, root};
use super::dynamics::{Axis, Dynamics};
use super::exec::BLOCK_S_MIN;
use super::float::{below, least, scaled, some};
use super::governor::{ACCEL_MOST, effective_jerk};
use super::junction::{self, Heading, ONE};
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
        let mut path = Path::default();
        match path.measure(line.from, line.to) {
            Way::None => return Built::Nothing,
            Way::Far => return Built::Parts(2),
            Way::Near => {}
        }
        let mut motors = self.motors;
        path.drive(&mut motors, line.to, machine);
        if let Some(parts) = path.count(&self.motors, &motors) {
            return Built::Parts(parts);
        }
        path.limit(line.feed, dynamics);
        path.limit_change(dynamics);
        path.limit_steps(&dynamics.rates);
        path.heading.deviation = junction::deviation(&path.heading.unit, dynamics);
        let mut entry = least(path.cruise, self.cruise);
        if some(entry) {
            let corner = junction::limit(&self.heading, &path.heading, dynamics.junction, entry);
            entry = least(entry, corner);
        }
        self.heading = path.heading;
        self.cruise = path.cruise;
        self.motors = motors;
        let block = Move {
            steps: path.steps,
            length: path.length,
            cruise: path.cruise,
            start: 0.0,
            entry: Short::ZERO,
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
}

/// Parts of at most [`STEPS_MAX`] steps.
#[inline(never)]
fn parts(from: i32, to: i32) -> u16 {
    // The rounding of their ends may add a step.
    u16::try_from(from.abs_diff(to) / u32::from(STEPS_MAX - 1) + 1).unwrap_or(u16::MAX)
}

/// Whether there is a way.
enum Way {
    None,
    Near,
    /// More than [`Length`] holds.
    Far,
}

/// The way from here to there, and what limits it. Filled in place: to move it costs as much as a
/// multiplication of floats.
#[derive(Default)]
struct Path {
    /// Travel of each axis, in units of [`Length`].
    travel: PerAxis<i32>,
    /// mm.
    length: f32,
    /// Travel of each axis for a unit of length.
    heading: Heading,
    steps: [i16; MOTORS],
    /// Steps of the motor that makes most, and how many motors move.
    most: u16,
    moving: u8,
    cruise: f32,
    accel: Short,
    jerk: Short,
}

impl Path {
    /// Length and direction. The length is that of the linear axes; of the rotary ones if no linear
    /// one moves. In 15 bits: 0.01 % exact.
    #[inline(never)]
    fn measure(&mut self, from: &PerAxis<Length>, to: &PerAxis<Length>) -> Way {
        let mut bits = 0;
        for axis in 0..AXES {
            if from[axis] != to[axis] {
                let Some(way) = to[axis].0.checked_sub(from[axis].0) else {
                    return Way::Far;
                };
                self.travel[axis] = way;
                bits |= way.unsigned_abs();
            }
        }
        if bits == 0 {
            return Way::None;
        }
        let shift = normalize(&mut self.heading.unit, &self.travel, bits);
        let (linear, rotary) = self.heading.unit.split_at(FIRST_ROTARY);
        let mut length = norm(linear);
        if length == 0 {
            length = norm(rotary);
        }
        if length == 0 {
            // A linear move too short beside its rotary one to be told from none.
            length = 1;
        }
        for u in &mut self.heading.unit {
            if *u != 0 {
                *u = share(*u, length);
            }
        }
        self.length = scaled(f32::from(length) * 1e-4, shift);
        Way::Near
    }

    /// Takes the motors to the end of the move.
    #[inline(never)]
    fn drive(&self, motors: &mut [Motor; MOTORS], to: &PerAxis<Length>, machine: &impl Motors) {
        for (m, motor) in motors.iter_mut().enumerate() {
            let axis = usize::from(machine.motor_axis(m));
            if axis < AXES && self.travel[axis] != 0 {
                motor.go(machine.ratio(m), self.travel[axis], to[axis]);
            }
        }
    }

    /// Counts the steps, or says in how many parts they would fit.
    #[inline(never)]
    fn count(&mut self, from: &[Motor; MOTORS], to: &[Motor; MOTORS]) -> Option<u16> {
        for m in 0..MOTORS {
            let (from, to) = (from[m].steps, to[m].steps);
            if from == to {
                continue;
            }
            let steps = match to.checked_sub(from).map(i16::try_from) {
                Some(Ok(steps)) if steps != i16::MIN => steps,
                _ => return Some(parts(from, to)),
            };
            self.steps[m] = steps;
            self.moving += 1;
            self.most = self.most.max(steps.unsigned_abs());
        }
        None
    }

    /// Applies the feed and the velocity limit of every axis that moves.
    #[inline(never)]
    fn limit(&mut self, feed: Option<Feed>, dynamics: &Dynamics) {
        self.cruise = match feed {
            Some(Feed::PerMinute(feed)) => feed * (1.0 / 60.0),
            Some(Feed::Minutes(time)) if time > 0.0 => self.length / (time * 60.0),
            _ => CRUISE_MOST,
        };
        for (&u, axis) in self.heading.unit.iter().zip(&dynamics.axes) {
            if u == 0 {
                continue;
            }
            let velocity = if feed.is_some() { axis.feed } else { axis.velocity };
            // Most axes are slower than the path.
            if some(velocity) && (below(velocity, self.cruise) || u.unsigned_abs() > ONE as u16) {
                let u = float(u.unsigned_abs());
                if below(velocity, u * self.cruise) {
                    self.cruise = velocity / u;
                }
            }
        }
        // Within what no division goes wrong with.
        if below(CRUISE_MOST, self.cruise) {
            self.cruise = CRUISE_MOST;
        } else if below(self.cruise, CRUISE_LEAST) {
            self.cruise = CRUISE_LEAST;
        }
    }

    /// Acceleration and jerk.
    #[inline(never)]
    fn limit_change(&mut self, dynamics: &Dynamics) {
        let mut slowest = Slowest::default();
        for (&u, axis) in self.heading.unit.iter().zip(&dynamics.axes) {
            if u != 0 {
                slowest.look(u.unsigned_abs(), axis);
            }
        }
        let mut jerk = slowest.jerk.get();
        let mut least = slowest.least.get();
        // Moves of both linear and rotary axes may have units above 1.
        if slowest.most > ONE as u16 {
            jerk /= float(slowest.most);
            least /= float(slowest.most);
        }
        if some(least) {
            let jerk = effective_jerk(jerk, least);
            let accel = if some(jerk) { least } else { slowest.accel.get() / float(slowest.unit) };
            self.accel = Short::new(least_of(accel));
            self.jerk = Short::new(jerk);
        } else if some(jerk) {
            // What a ramp to full speed comes to, so that the jerk alone limits it.
            let accel = least_of(sqrt(jerk * power_of_two_above(self.cruise)));
            self.accel = Short::new(accel);
            self.jerk = Short::new(effective_jerk(jerk, accel));
        } else {
            self.accel = Short::new(ACCEL_MOST);
        }
    }

    /// Keeps motors within the rate that so many can have together, and a block with steps long
    /// enough for exec.
    #[inline(never)]
    fn limit_steps(&mut self, rates: &[f32; MOTORS]) {
        if self.moving == 0 {
            return;
        }
        let way = rates[usize::from(self.moving) - 1] * self.length;
        let most = f32::from(self.most);
        if below(way, self.cruise * most) {
            self.cruise = way / most;
        }
        if below(self.length, self.cruise * BLOCK_S_MIN) {
            self.cruise = self.length * (1.0 / BLOCK_S_MIN);
        }
    }
}

fn least_of(accel: f32) -> f32 {
    least(accel, ACCEL_MOST)
}

/// The travel in 15 bits and a sign, and the power of two that takes it back. `bits` is the union of
/// the sizes.
#[inline(never)]
fn normalize(unit: &mut PerAxis<i16>, travel: &PerAxis<i32>, bits: u32) -> i8 {
    const MOST: u32 = 1 << 14;
    let mut bits = bits;
    let mut shift = 0i8;
    while bits >= 2 * MOST {
        bits >>= 1;
        shift += 1;
    }
    while bits < MOST {
        bits <<= 1;
        shift -= 1;
    }
    for (unit, &way) in unit.iter_mut().zip(travel) {
        *unit = if way == 0 {
            0
        } else if shift <= 0 {
            // The result has 15 bits: no more are needed on the way.
            let mut way = way as i16;
            for _ in 0..-shift {
                way <<= 1;
            }
            way
        } else {
            (way >> shift) as i16
        };
    }
    shift
}

/// The length of a vector.
#[inline(never)]
fn norm(vector: &[i16]) -> u16 {
    let mut sum = 0u32;
    let mut only = 0u16;
    let mut terms = 0u8;
    for &term in vector {
        if term != 0 {
            terms += 1;
            only = term.unsigned_abs();
            sum += u32::from(only) * u32::from(only);
        }
    }
    if terms < 2 { only } else { root(sum) }
}

/// `part / whole` in the units of a heading.
#[inline(never)]
fn share(part: i16, whole: u16) -> i16 {
    let size = part.unsigned_abs();
    // Twice and more: a rotary axis beside a linear one.
    let share = if size >> 1 >= whole {
        i16::MAX
    } else {
        quotient(u32::from(size) << 14, whole).min(i16::MAX as u16) as i16
    };
    if part < 0 { -share } else { share }
}

/// A part of a heading as a float.
fn float(u: u16) -> f32 {
    scaled(f32::from(u), -14)
}

/// Velocities beyond all machines, mm/s.
const CRUISE_MOST: f32 = 1e5;
/// See [`CRUISE_MOST`].
const CRUISE_LEAST: f32 = 1e-6;

/// The axis that limits the acceleration, and the least limits of all axes.
#[derive(Default)]
struct Slowest {
    /// Limit and unit of the axis that limits most.
    accel: Short,
    unit: u16,
    least: Short,
    jerk: Short,
    /// The largest unit.
    most: u16,
}

impl Slowest {
    fn look(&mut self, u: u16, axis: &Axis) {
        if axis.accel != Short::ZERO {
            if self.least == Short::ZERO || axis.accel < self.least {
                self.least = axis.accel;
            }
            let slower = if self.accel == Short::ZERO {
                true
            } else if axis.accel == self.accel {
                self.unit < u
            } else {
                below(axis.accel.get() * f32::from(self.unit), self.accel.get() * f32::from(u))
            };
            if slower {
                self.accel = axis.accel;
                self.unit = u;
            }
        }
        if axis.jerk != Short::ZERO && (self.jerk == Short::ZERO || axis.jerk < self.jerk) {
            self.jerk = axis.jerk;
        }
        if self.most < u {
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
