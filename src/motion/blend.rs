//! Blending: how fast corners are passed where [means](super::smooth) round them.
//!
//! Owned by the block queue, in thread mode. Blocks wait here ([`Blend::add`]) until what follows them is known as far as
//! the means reach, some 50 ms of path, and then go to the queue ([`Blend::take`]). If nothing follows for now, they all
//! go ([`Blend::flush`]). Chips with [`STAGE`] places do this; on the host tests choose.
//!
//! A mean over the time T makes of a jump of velocity by d an acceleration d / T. So the acceleration of an axis keeps to
//! its limit A if its velocity changes by at most A T within any T, for one of the two means. Corners take part of that,
//! and acceleration along the path takes the remainder:
//!
//! - **Velocity.** Two corners share a window if the path between them takes less than T. The change of direction from
//!   the first to the last corner of a window limits the velocity at all of them, so that no axis changes by more than
//!   [`SHARE`] of A T. A window is a time, and the machine may speed up between its corners: a path of length x takes
//!   less than T at a velocity of v and more at both ends if x < v T + A T^2 / 4 (`windows`).
//! - **Room.** What corners leave over limits the acceleration along the path near them. Long lines are cut there, so that
//!   the remainder of the line has the whole acceleration. Short lines are limited as a whole. On a curve turning and
//!   acceleration along the path are at right angles, which leaves more; so does a corner far from all others (`room`).
//!   A sharp corner is passed at the velocity that costs the least time.
//! - **Deviation.** What comes out of the means is off the path by the sum of the changes of direction, each times
//!   `v phi(t) + A Phi(t)` at its distance t in time ([`Kernel`]). The velocity at a corner keeps this within P. Where
//!   even a stop is off by half of P, acceleration is limited about the corner as well.
//!
//! Holds and overrides make the motion slower or begin later, and no bound depends on that.
//!
//! If the stage is full, the path that waits is shorter than the windows. The velocity is then limited so that windows
//! are as short.
//!
//! Cost on the RP2040: 600 cycles for a line that goes straight on. A corner costs more for each corner within its windows;
//! with a full stage some 750 lines a second are left while four motors run fast. So lines that take less than
//! [`BLEND_S_MIN`] are not blended ([`is_dense`]).
//!
//! Measured from steps (`tests/blend.rs`): 0.1 % of random paths take up to 1.12 of A, all others keep to it.
//!
//! Units: mm, s; lengths in 0.1 um, directions in 2^-14.

mod cut;
mod deviation;
mod kernel;
mod limits;
mod room;
mod settle;
mod windows;

use core::ops::Range;

use kernel::Kernel;
use limits::{Limits, in_lengths, zone};
use windows::Window;

use super::block::{Block, Body, Line};
use super::dynamics::Dynamics;
use super::float::{below, greater, least};
use super::junction::{self, STRAIGHT, turn};
use super::smooth::{SAMPLE_S, Spans};
use crate::hal::{BLEND_S_MIN, STAGE};
use crate::units::{AXES, PerAxis};

/// Whether this chip blends.
pub const BLENDS: bool = STAGE > 0;

/// How many stages there are.
pub const STAGES: usize = BLENDS as usize;

/// Blocks that adding a line may take besides those that wait: the parts of the line and of the line before.
pub const SPARE: usize = 5;

/// The share of the acceleration that corners may take.
const SHARE: f32 = 0.8;
/// The share of P that is used: the deviation is known at corners only.
const USED: f32 = 0.93;
/// The share of the acceleration that is left along a curve.
const ROUND: f32 = 0.6;
/// The least share of the acceleration that is left along the path, so that a hold can stop there.
const LEAST_ROOM: f32 = 0.05;
/// The least share of the acceleration that is left about a corner that would otherwise be off by more than P.
const LEAST_SHARE: f32 = 0.005;
/// The room at the end of a path that has been flushed. The corner that may follow takes as much.
const HALF: f32 = 0.5;
/// Axes are alike if the acceleration limits differ by less.
const EVEN: f32 = 0.9;
/// A corner of less than this belongs to a curve: the square of a half, in 2^-28.
const CURVE: u32 = 1 << 26;
/// Lengths in a mm.
const PER_MM: f32 = 1e4;
/// 1 in the units of a direction.
const ONE: f32 = junction::ONE as f32;
/// 1 in the units of a weight.
const WEIGHT: f32 = 256.0;

/// Whether a line of this length, mm, takes too little time at its velocity to be blended: each line looks at all those that
/// wait within its windows, and the planner has no time for so many. Its corners are those of a chip that does not blend.
pub fn is_dense(length: f32, cruise: f32) -> bool {
    below(length, cruise * BLEND_S_MIN)
}

/// Places for blocks that wait.
const PLACES: usize = if BLENDS { STAGE } else { 1 };

/// A block that waits, and the corner at its start.
#[derive(Clone, Copy)]
struct Entry {
    block: Block,
    /// The direction of the path.
    unit: PerAxis<i16>,
    /// The length of the path; 0 for a block that moves nothing.
    length: u32,
    /// Where on the path it begins: counts on from block to block, and wraps.
    at: u32,
    /// How much path may be covered at its cruise within the reach of the kernel, and twice that if it speeds up between
    /// corners at both ends.
    zone: u32,
    span: u32,
    /// The velocity limit at its start.
    entry: f32,
    /// The share of the acceleration that is left in the block.
    room: f32,
    /// The square of the change of direction at its start.
    turn: u32,
    /// What windows of each mean ask for.
    asked: [Asked; 2],
}

/// What the windows with a corner ask for.
#[derive(Clone, Copy)]
struct Asked {
    /// The velocity limit.
    velocity: f32,
    /// The greatest change of direction: that of an axis, weighted, in 2^-22, and the square of the whole.
    change: u32,
    square: u32,
}

impl Asked {
    /// No limit.
    const NOTHING: Self = Self { velocity: f32::MAX, change: 0, square: 0 };
}

impl Entry {
    /// A place without a block.
    const fn vacant() -> Self {
        Self {
            block: Block::new(Body::Line(Line::NONE), 0),
            unit: [0; AXES],
            length: 0,
            at: 0,
            zone: 0,
            span: 0,
            entry: f32::MAX,
            room: 1.0,
            turn: 0,
            asked: [Asked::NOTHING; 2],
        }
    }

    fn line(&self) -> Option<&Line> {
        match &self.block.body {
            Body::Line(line) => Some(line),
            Body::QueuedAction(_) => None,
        }
    }

    fn cruise(&self) -> f32 {
        self.line().map_or(f32::MAX, |line| line.cruise)
    }

    fn accel(&self) -> f32 {
        self.line().map_or(0.0, |line| line.accel.get())
    }
}

/// A block that is to go to the queue.
pub struct Ready<'a> {
    /// The block.
    pub block: &'a Block,
    /// The highest velocity at its start, mm/s.
    pub entry: f32,
    /// The share of its acceleration limit that it has.
    pub room: f32,
}

/// How the corner before a new line may be passed.
struct Approach {
    /// The velocity up to which windows are looked for, mm/s.
    top: f32,
    /// The velocity limit, mm/s.
    entry: f32,
    /// How much path behind the corner it may limit.
    zone: u32,
}

/// The blocks that wait, and what limits them.
pub struct Blend {
    /// When the planner began to wait for lines that follow, ms, modulo 2^16. The planner's.
    pub since: u16,
    /// How far the corners of the planner's chain may be off, in units of [`Length`](crate::units::Length).
    pub chained: u16,
    limits: Limits,
    /// The blocks: a ring.
    entries: [Entry; PLACES],
    /// The windows that begin at each corner and end at the last one, while they are looked for.
    windows: [Window; PLACES],
    first: usize,
    len: usize,
    /// Where on the path the last block ends.
    end: u32,
    /// How many corners are final, from the first block on.
    done: usize,
    /// How many blocks are to go because nothing follows for now, and whether the machine stops behind them.
    flushed: usize,
    stops: bool,
    /// The direction before the first block; `None` at a standstill.
    before: Option<PerAxis<i16>>,
    /// The velocity limit of the next corner, if the path before it has gone.
    behind: f32,
    /// The length of the path from the last corner that has gone to the first block.
    gone: u32,
    /// The motor of the extruder.
    motor: u8,
    on: bool,
    /// Lines follow the spindle, and are not blended.
    follows: bool,
}

impl Blend {
    /// A stage that is off, without blocks.
    pub const fn new() -> Self {
        Self {
            since: 0,
            chained: 0,
            limits: Limits {
                kernel: Kernel::NONE,
                spans: [0.0; 2],
                windows: [0.0; 2],
                deviation: 0.05,
                accel: 0.0,
                weights: [0; AXES],
                accels: [0.0; AXES],
            },
            entries: [Entry::vacant(); PLACES],
            windows: [Window::NONE; PLACES],
            first: 0,
            len: 0,
            end: 0,
            done: 0,
            flushed: 0,
            stops: false,
            before: None,
            behind: f32::MAX,
            gone: u32::MAX,
            motor: 0,
            on: false,
            follows: false,
        }
    }

    /// Whether lines are to be added.
    pub fn is_on(&self) -> bool {
        self.on && !self.follows
    }

    /// Notes whether lines follow the spindle from here on. No block waits.
    pub fn follow(&mut self, spindle: bool) {
        self.follows = spindle;
    }

    /// How many blocks wait.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no block waits.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Sets the limits for the lines from here on. No block waits.
    pub fn set(&mut self, spans: Spans, dynamics: &Dynamics) {
        self.on = spans.rounds() && crate::hal::system::blends();
        let limits = &mut self.limits;
        limits.accels = dynamics.axes.map(|axis| axis.accel.get());
        limits.accel = limits.accels.iter().fold(f32::MAX, |least, accel| match *accel > 0.0 {
            true => least.min(*accel),
            false => least,
        });
        limits.weights = limits.accels.map(|accel| match accel > 0.0 {
            true => (WEIGHT * limits.accel / accel + 0.99) as u16,
            false => 0,
        });
        limits.kernel = Kernel::of(spans);
        let reach = limits.kernel.reach();
        limits.spans = [PER_MM * reach, 0.5 * PER_MM * reach * reach];
        let (corner, jerk) = spans.samples();
        limits.windows = [corner, jerk].map(|samples| f32::from(samples) * SAMPLE_S);
    }

    /// Sets which motor drives the extruder, if there is one.
    pub fn set_extruder(&mut self, motor: u8) {
        self.motor = motor;
    }

    /// Sets P, mm.
    pub fn set_deviation(&mut self, deviation: f32) {
        self.limits.deviation = deviation;
    }

    /// P, mm.
    pub fn deviation(&self) -> f32 {
        self.limits.deviation
    }

    /// Forgets all blocks: the machine stands still.
    pub fn clear(&mut self) {
        (self.first, self.len, self.done, self.flushed) = (0, 0, 0, 0);
        self.follows = false;
        self.stop();
    }

    /// Notes that the machine stands still behind the last block.
    pub fn stop(&mut self) {
        (self.before, self.behind, self.gone) = (None, f32::MAX, u32::MAX);
        self.stops = false;
    }

    /// Adds a block that moves nothing and at which the machine does not stop.
    pub fn pass(&mut self, block: Block) {
        let unit = self.unit_ahead_of(self.len).unwrap_or_default();
        self.append(&unit, 0).block = block;
    }

    /// Adds a line with this N word and direction. There is room for [`SPARE`] blocks.
    pub fn add(&mut self, line: &Line, number: u32, unit: &PerAxis<i16>) {
        let from = self.unit_ahead_of(self.len);
        let change = from.map_or(0, |from| turn(&from, unit));
        let corner =
            from.filter(|_| change >= STRAIGHT).map(|from| self.approach(line, &from, unit));
        let length = in_lengths(line.extent.length());
        let (zone, span) = self.measures(line);
        let entry = self.append(unit, length);
        entry.block.set(line, number);
        (entry.zone, entry.span) = (zone, span);
        if let Some(Approach { top, entry: velocity, zone }) = corner {
            (entry.turn, entry.entry) = (change, velocity);
            self.look_back(top);
            if length - length / 5 > zone {
                self.cut_last_at(zone);
            }
        }
        self.cut_last();
    }

    /// Returns the limits of the corner before a line that is to be added, and cuts the line before it.
    fn approach(&mut self, line: &Line, from: &PerAxis<i16>, unit: &PerAxis<i16>) -> Approach {
        let cruise = self.last().map_or(f32::MAX, Entry::cruise);
        let top = least(least(cruise, line.cruise), self.behind);
        let [first, second] = self.limits.windows;
        let change = self.limits.change(from, unit);
        let entry = least(top, self.limits.velocity(change, greater(first, second)));
        self.behind = f32::MAX;
        let accel = greater(self.last().map_or(0.0, Entry::accel), line.accel.get());
        let zone = zone(entry, accel, self.limits.kernel.reach());
        self.cut_end(zone);
        Approach { top, entry, zone: in_lengths(zone) }
    }

    /// Returns [`Entry::zone`] and [`Entry::span`] of a line.
    fn measures(&self, line: &Line) -> (u32, u32) {
        let [by_velocity, by_accel] = self.limits.spans;
        let (way, more) = (line.cruise * by_velocity, line.accel.get() * by_accel);
        let zone = way + more;
        (zone as u32, (zone + way) as u32)
    }

    /// Notes that a line with this direction and length goes past the stage, in which no block waits.
    pub fn went_past(&mut self, unit: &PerAxis<i16>, length: f32) {
        (self.before, self.behind, self.gone) = (Some(*unit), f32::MAX, in_lengths(length));
        self.stops = false;
    }

    /// Lets all blocks that wait go. If the machine `stops` there, no corner follows; otherwise one may, and the end of the
    /// path leaves it half of the acceleration.
    pub fn flush(&mut self, stops: bool) {
        if self.len == 0 {
            if stops {
                self.stop();
            }
            return;
        }
        self.stops = stops;
        if stops {
            self.settle(true);
        } else {
            let accel = self.last().map_or(0.0, Entry::accel);
            let seconds = self.limits.kernel.reach();
            let wanted = zone(HALF * accel * seconds, HALF * accel, seconds);
            self.cut_end(wanted);
            self.settle(true);
            let newest = self.len - 1;
            let last = self.entry_mut(newest);
            last.room = least(last.room, HALF);
            let length = last.length as f32 * (1.0 / PER_MM);
            self.behind = greater(0.0, length / seconds - 0.25 * accel * seconds);
        }
        self.flushed = self.len;
    }

    /// Drops the lines that wait, and lets all else go: the machine stops.
    pub fn drop_lines(&mut self) {
        let mut left = 0;
        for n in 0..self.len {
            if self.entry(n).line().is_none() {
                *self.entry_mut(left) = *self.entry(n);
                left += 1;
            }
        }
        (self.len, self.done, self.flushed, self.stops) = (left, left, left, true);
        if left == 0 {
            self.stop();
        }
    }

    /// Returns the next block that is to go to the queue.
    pub fn take(&mut self) -> Option<Ready<'_>> {
        if self.len == 0 {
            return None;
        }
        if self.flushed == 0 {
            self.settle(false);
            if !self.is_settled() && self.len + SPARE < PLACES {
                return None;
            }
            if !self.is_settled() {
                self.crowd();
            }
        }
        let at = self.first;
        let Entry { unit, length, turn, .. } = self.entries[at];
        self.before = Some(unit);
        self.gone = if turn >= STRAIGHT { length } else { self.gone.saturating_add(length) };
        self.first = (at + 1) % PLACES;
        self.len -= 1;
        self.done = self.done.saturating_sub(1);
        self.flushed = self.flushed.saturating_sub(1);
        if self.len == 0 && self.stops {
            self.stop();
        }
        let Entry { block, entry, room, .. } = &self.entries[at];
        Some(Ready { block, entry: *entry, room: *room })
    }

    fn last(&self) -> Option<&Entry> {
        self.ahead_of(self.len)
    }

    /// Returns the block before block `n`, if it waits.
    fn ahead_of(&self, n: usize) -> Option<&Entry> {
        n.checked_sub(1).map(|n| self.entry(n))
    }

    /// Returns the direction before block `n`; `None` at a standstill.
    fn unit_ahead_of(&self, n: usize) -> Option<PerAxis<i16>> {
        self.ahead_of(n).map(|entry| entry.unit).or(self.before)
    }

    /// Adds a place for a block of this length that changes nothing. There is room; else it takes the last place.
    fn append(&mut self, unit: &PerAxis<i16>, length: u32) -> &mut Entry {
        self.len = PLACES.min(self.len + 1);
        let at = self.end;
        self.end = at.wrapping_add(length);
        let entry = self.entry_mut(self.len - 1);
        (entry.unit, entry.length, entry.at) = (*unit, length, at);
        (entry.zone, entry.span) = (0, 0);
        (entry.entry, entry.room, entry.turn) = (f32::MAX, 1.0, 0);
        entry.asked = [Asked::NOTHING; 2];
        entry
    }

    /// Returns the length of the path from the start of block `n` to that of block `to`, or to the end of the last one.
    fn way(&self, n: usize, to: usize) -> u32 {
        let place = |n: usize| if n < self.len { self.entry(n).at } else { self.end };
        place(to).wrapping_sub(place(n))
    }

    /// Returns the corners that are less than `far` from a corner, itself included if `far` is more than 0.
    fn corners_about(&self, corner: usize, far: u32) -> Range<usize> {
        let ahead = (corner..self.len).take_while(|n| self.way(corner, *n) < far).count();
        let back = (0..corner).rev().take_while(|n| self.way(*n, corner) < far).count();
        corner - back..corner + ahead
    }

    fn entry(&self, n: usize) -> &Entry {
        &self.entries[(self.first + n) % PLACES]
    }

    fn entry_mut(&mut self, n: usize) -> &mut Entry {
        &mut self.entries[(self.first + n) % PLACES]
    }
}

impl Default for Blend {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::block::Extent;
    use crate::motion::dynamics::Axis;
    use crate::motion::junction::ONE;
    use crate::motion::short::Short;

    /// A stage, and a line of 0.1 mm along an axis.
    fn stage() -> (Blend, impl Fn(usize) -> (Line, PerAxis<i16>)) {
        crate::hal::imp::set_blends(true);
        let accel = Short::new(500.0);
        let axes = [Axis { accel, ..Axis::default() }; AXES];
        let mut blend = Blend::new();
        blend.set(Spans::of(0.027), &Dynamics { axes, ..Dynamics::default() });
        let line = move |axis: usize| {
            let line =
                Line { extent: Extent::new(0.1, false), cruise: 50.0, accel, ..Line::default() };
            let mut unit = [0; AXES];
            unit[axis] = ONE;
            (line, unit)
        };
        (blend, line)
    }

    /// Adds a line along each axis, and lets all blocks go. Returns the velocity limits at their starts.
    fn goes(blend: &mut Blend, lines: &[(Line, PerAxis<i16>)], stops: bool) -> std::vec::Vec<f32> {
        lines.iter().for_each(|(line, unit)| blend.add(line, 0, unit));
        blend.flush(stops);
        core::iter::from_fn(|| blend.take().map(|ready| ready.entry)).collect()
    }

    #[test]
    fn the_corner_behind_a_path_that_has_gone_is_a_corner() {
        let (mut blend, line) = stage();
        assert_eq!(goes(&mut blend, &[line(0)], false), [f32::MAX]);
        let [corner, again] = goes(&mut blend, &[line(1), line(0)], false)[..] else { panic!() };
        assert!(corner < 10.0 && again < 20.0, "{corner} {again}");
        // The last line was along X.
        assert!(goes(&mut blend, &[line(1)], true)[0] < 10.0);
        // The machine has stopped.
        assert_eq!(goes(&mut blend, &[line(0)], true), [f32::MAX]);
    }

    #[test]
    fn lines_are_dropped_and_all_else_goes() {
        use crate::motion::block::QueuedAction;
        let (mut blend, line) = stage();
        let aside = |lead| Block::action(QueuedAction::Lead(lead), 0);
        let (first, unit) = line(0);
        blend.add(&first, 0, &unit);
        for lead in [1.0, 2.0] {
            blend.pass(aside(lead));
            blend.add(&first, 0, &unit);
        }
        blend.drop_lines();
        let left = core::iter::from_fn(|| blend.take().map(|ready| ready.block.body));
        let leads = left.filter_map(|body| match body {
            Body::QueuedAction(QueuedAction::Lead(lead)) => Some(lead),
            _ => None,
        });
        assert_eq!(leads.collect::<std::vec::Vec<_>>(), [1.0, 2.0]);
        assert_eq!(goes(&mut blend, &[line(1)], true), [f32::MAX]);
    }
}
