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
use super::divide::{product, quotient, root};
use super::dynamics::{Axis, Dynamics};
use super::exec::BLOCK_S_MIN;
use super::float::{OCTAVE, below, least, log, scaled, some};
use super::governor::{ACCEL_MOST, effective_jerk};
use super::junction::{self, Heading, ONE};
use super::prep::STEPS_MAX;
use super::short::Short;
use super::steps::Motor;
use crate::boards::MOTORS;
use crate::config::StepRatio;
use crate::gcode::command::Feed;
use crate::math::sqrt;
use crate::units::{FIRST_ROTARY, Length, PerAxis};

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
    Line(f32),
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
    /// The feed of the last move.
    feed: LastFeed,
    /// Motors at the end of the last block.
    motors: [Motor; MOTORS],
}

/// A feed and what it comes to: mostly that of the move before.
#[derive(Clone, Copy, Debug, Default)]
struct LastFeed {
    /// mm/min.
    feed: f32,
    /// mm/s.
    velocity: f32,
}

impl LastFeed {
    /// `feed`, mm/min, in mm/s, times `stretch` if there is one. Cost: 30; 300 for another feed.
    fn per_second(&mut self, feed: f32, stretch: f32) -> f32 {
        if self.feed.to_bits() != feed.to_bits() {
            *self = Self { feed, velocity: times(feed, 1.0 / 60.0) };
        }
        if some(stretch) { times(self.velocity, stretch) } else { self.velocity }
    }
}

/// Not inlined: or it would be worked out where it is not asked for.
#[inline(never)]
fn times(a: f32, b: f32) -> f32 {
    a * b
}

impl Builder {
    /// The block for a move, put into `out` if it is [`Built::Line`]. Nothing is changed otherwise.
    ///
    /// Cost: 3,500 + 1,300 for each axis that moves with its motor, for short moves.
    #[inline(never)]
    pub fn line(
        &mut self,
        line: &Line,
        dynamics: &Dynamics,
        machine: &impl Motors,
        out: &mut Move,
    ) -> Built {
        let mut path = Path::default();
        match path.measure(line.from, line.to) {
            Way::None => return Built::Nothing,
            Way::Far => return Built::Parts(2),
            Way::Near => {}
        }
        out.steps = [0; MOTORS];
        let parts = path.drive(&mut self.motors, line.to, dynamics, machine, &mut out.steps);
        if parts > 0 {
            self.put_back(line.from, dynamics, machine);
            return Built::Parts(parts);
        }
        path.limit(line.feed, &mut self.feed, dynamics);
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
        out.length = path.length;
        out.cruise = path.cruise;
        out.accel = path.accel;
        out.jerk = path.jerk;
        Built::Line(entry)
    }

    /// Takes the motors back to where the last block ended.
    #[inline(never)]
    fn put_back(&mut self, to: &PerAxis<Length>, dynamics: &Dynamics, machine: &impl Motors) {
        for (m, motor) in self.motors.iter_mut().enumerate() {
            if let Some(&position) = to.get(usize::from(dynamics.drives[m])) {
                *motor = Motor::at(machine.ratio(m), position);
            }
        }
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
fn parts_of(from: i32, to: i32) -> u16 {
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
    /// How much longer the way of the rotary axes is than that of the linear ones, if it is; else 0.
    stretch: f32,
    /// The axes that move: a bit for each, the first axis lowest.
    moved: u8,
    /// Steps of the motor that makes most, and how many motors make any.
    most: u16,
    moving: u8,
    cruise: f32,
    accel: Short,
    jerk: Short,
}

impl Path {
    /// Length and direction. 0.01 % exact, for a single axis exact.
    ///
    /// The length is that of the linear axes, or of the rotary ones (degrees) if these have the longer
    /// way; the feed, which is that of the linear axes where they move, is more by as much.
    #[inline(never)]
    fn measure(&mut self, from: &PerAxis<Length>, to: &PerAxis<Length>) -> Way {
        let mut all = 0u32;
        let mut bit = 1u8;
        for ((travel, from), to) in self.travel.iter_mut().zip(from).zip(to) {
            if from != to {
                let Some(way) = to.0.checked_sub(from.0) else {
                    return Way::Far;
                };
                *travel = way;
                all |= way.unsigned_abs();
                self.moved |= bit;
            }
            bit <<= 1;
        }
        if self.moved & self.moved.wrapping_sub(1) == 0 {
            return self.measure_axis(all);
        }
        let shift = normalize(&mut self.heading.unit, &self.travel, all);
        let (linear, rotary) = self.heading.unit.split_at(FIRST_ROTARY);
        let mut length = norm(linear);
        if self.moved >> FIRST_ROTARY != 0 {
            let turn = norm(rotary);
            if turn > length {
                length = turn;
                if self.moved & ((1 << FIRST_ROTARY) - 1) != 0 {
                    self.stretch = stretch(&self.travel);
                }
            }
        }
        for u in &mut self.heading.unit {
            if *u != 0 {
                *u = share(*u, length);
            }
        }
        // Long moves have the time to be measured exactly, and their steps come evenly.
        self.length = if shift > 0 {
            length_of(&self.travel)
        } else {
            composed(length, 127 + 15 + i16::from(shift)) * 1e-4
        };
        Way::Near
    }

    /// The same for a move of one axis, or of none.
    #[inline(never)]
    fn measure_axis(&mut self, way: u32) -> Way {
        if self.moved == 0 {
            return Way::None;
        }
        for (unit, &way) in self.heading.unit.iter_mut().zip(&self.travel) {
            if way != 0 {
                *unit = if way < 0 { -ONE } else { ONE };
            }
        }
        self.length = way as f32 * 1e-4;
        Way::Near
    }

    /// Takes the motors to the end of the move and counts their steps; or says in how many parts these
    /// would fit, if not 0.
    #[inline(never)]
    fn drive(
        &mut self,
        motors: &mut [Motor; MOTORS],
        to: &PerAxis<Length>,
        dynamics: &Dynamics,
        machine: &impl Motors,
        steps: &mut [i16; MOTORS],
    ) -> u16 {
        let mut parts = 0;
        let all = motors.iter_mut().zip(steps).zip(&dynamics.drives);
        for (m, ((motor, steps), &axis)) in all.enumerate() {
            let axis = usize::from(axis);
            let Some(&travel) = self.travel.get(axis) else { continue };
            if travel == 0 {
                continue;
            }
            let before = motor.steps;
            motor.go(machine.ratio(m), travel, to[axis]);
            let after = motor.steps;
            let way = after.wrapping_sub(before);
            let size = way.unsigned_abs();
            if size > u32::from(STEPS_MAX) || (way < 0) != (after < before) {
                parts = parts.max(parts_of(before, after));
            } else if size != 0 {
                *steps = way as i16;
                self.moving += 1;
                self.most = self.most.max(size as u16);
            }
        }
        parts
    }

    /// The axes that move, with the size of their part of the heading, or a little more: never less
    /// than it is. Ends with the last that moves.
    #[inline(always)]
    fn axes<'a>(&'a self, dynamics: &'a Dynamics) -> impl Iterator<Item = (u16, &'a Axis)> {
        let mut left = self.moved;
        let mut all = self.heading.unit.iter().zip(&dynamics.axes);
        core::iter::from_fn(move || {
            while left != 0 {
                let moves = left & 1 != 0;
                left >>= 1;
                let (u, axis) = all.next()?;
                if moves {
                    return Some(((u.unsigned_abs() + 2).min(ONE as u16), axis));
                }
            }
            None
        })
    }

    /// Applies the feed and the velocity limit of every axis that moves.
    #[inline(never)]
    fn limit(&mut self, feed: Option<Feed>, last: &mut LastFeed, dynamics: &Dynamics) {
        self.cruise = match feed {
            Some(Feed::PerMinute(feed)) => last.per_second(feed, self.stretch),
            Some(Feed::Minutes(time)) if some(time) => self.length / (time * 60.0),
            _ => CRUISE_MOST,
        };
        let mut cruise = self.cruise;
        for (u, axis) in self.axes(dynamics) {
            let velocity = if feed.is_some() { axis.feed } else { axis.velocity };
            // Most axes are slower than the path.
            if some(velocity) && below(velocity, cruise) {
                let u = float(u);
                if below(velocity, u * cruise) {
                    cruise = velocity / u;
                }
            }
        }
        // Within what no division goes wrong with.
        self.cruise =
            if below(cruise, CRUISE_LEAST) { CRUISE_LEAST } else { least(cruise, CRUISE_MOST) };
    }

    /// Acceleration and jerk.
    #[inline(never)]
    fn limit_change(&mut self, dynamics: &Dynamics) {
        let mut slowest = Slowest::default();
        for (u, axis) in self.axes(dynamics) {
            slowest.look(u, axis);
        }
        let jerk = slowest.jerk.get();
        let least = slowest.least.get();
        if some(least) {
            // Plainly of no effect if it allows the acceleration within 2^-11 s.
            let plain = log(least) + 11 * OCTAVE < log(jerk);
            let jerk = if !some(jerk) || plain { 0.0 } else { effective_jerk(jerk, least) };
            let accel = if some(jerk) { least } else { over(slowest.accel, slowest.unit) };
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
        let rate = rates[usize::from(self.moving) - 1];
        let most = f32::from(self.most);
        // Two octaves: plainly below the limit, whatever the logarithms' error.
        if log(self.cruise) + log(most) + 2 * OCTAVE > log(rate) + log(self.length) {
            let way = rate * self.length;
            if below(way, self.cruise * most) {
                self.cruise = way / most;
            }
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
    let mut shift = 0i8;
    if bits < 2 * MOST {
        // All 16 bits wide.
        let mut bits = bits as u16;
        while bits < MOST as u16 {
            bits <<= 1;
            shift += 1;
        }
        for (unit, &way) in unit.iter_mut().zip(travel) {
            let mut way = way as i16;
            if way != 0 {
                for _ in 0..shift {
                    way <<= 1;
                }
            }
            *unit = way;
        }
        return -shift;
    }
    let mut bits = bits;
    while bits >= 2 * MOST {
        bits >>= 1;
        shift += 1;
    }
    for (unit, &way) in unit.iter_mut().zip(travel) {
        *unit = if way == 0 { 0 } else { (way >> shift) as i16 };
    }
    shift
}

/// The length of a vector.
#[inline(never)]
fn norm(vector: &[i16]) -> u16 {
    let mut sum = 0u32;
    for &term in vector {
        let size = term.unsigned_abs();
        if size != 0 {
            sum += product(size, size);
        }
    }
    root(sum)
}

/// The length of a move, mm: that of the linear axes or of the rotary ones, whichever is longer.
#[inline(never)]
fn length_of(travel: &PerAxis<i32>) -> f32 {
    let (linear, rotary) = travel.split_at(FIRST_ROTARY);
    let (linear, rotary) = (exact_norm(linear), exact_norm(rotary));
    1e-4 * if below(linear, rotary) { rotary } else { linear }
}

/// How much longer the way of the rotary axes is than that of the linear ones.
#[inline(never)]
fn stretch(travel: &PerAxis<i32>) -> f32 {
    let (linear, rotary) = travel.split_at(FIRST_ROTARY);
    exact_norm(rotary) / exact_norm(linear)
}

#[inline(never)]
fn exact_norm(travel: &[i32]) -> f32 {
    let mut sum = 0.0;
    for &way in travel {
        sum += way as f32 * way as f32;
    }
    sqrt(sum)
}

/// `part / whole` in the units of a heading; no more than [`ONE`].
#[inline(never)]
fn share(part: i16, whole: u16) -> i16 {
    let size = part.unsigned_abs();
    let share = if size >= whole { ONE } else { quotient(u32::from(size) << 14, whole) as i16 };
    if part < 0 { -share } else { share }
}

/// A limit along the path: that of an axis, not 0, over its part `u` of the heading, not 0. As exact as
/// a [`Short`]. Cost: 350, where a division of floats takes 700.
#[inline(never)]
fn over(limit: Short, u: u16) -> f32 {
    let (limit, u) = (limit.get().to_bits(), f32::from(u).to_bits());
    // Their mantissas, the first of 9 bits, the other of 16.
    let above = u32::from((limit >> 15) as u16 & 0xFF | 0x100) << 22;
    let below = (u >> 8) as u16 | 0x8000;
    let quotient = quotient(above, below);
    let power = (limit >> 23) as i16 - (u >> 23) as i16 + 127 + 14;
    composed(quotient, power)
}

/// A float from its first 16 bits, the top one of which may be 0, but not the next one as well, and its
/// exponent if it is not. Cost: 30.
#[inline(never)]
fn composed(bits: u16, power: i16) -> f32 {
    let (mantissa, power) =
        if bits >= 0x8000 { (bits << 1, power) } else { (bits << 2, power - 1) };
    f32::from_bits(u32::from(power as u16) << 23 | u32::from(mantissa) << 7)
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
    }
}

/// The power of two that is not below `x`, as blocks of nearly the same velocity are to have the same
/// limits. Cost: 20.
fn power_of_two_above(x: f32) -> f32 {
    let bits = x.to_bits();
    f32::from_bits((bits + 0x007F_FFFF) & 0xFF80_0000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn over_is_a_division(limit in 1e-3f32..1e7, u in 1..=ONE as u16) {
            let limit = Short::new(limit);
            let exact = limit.get() / float(u);
            prop_assert_eq!(Short::new(over(limit, u)), Short::new(exact));
        }
    }
}
