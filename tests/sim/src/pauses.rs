//! Finds pauses: gaps in the step stream in mid-motion, after which steps start again at speed.
//!
//! The meter reads only the steps, and the times when the step timer stands still. A pause is an interval between two
//! steps of the leading motor that is longer than [`RATIO`] times the interval before it and the one after it, while
//! the path moves at [`SLOWEST`] or more on both sides. The leading motor is the one that steps most: during the
//! interval no other motor steps twice. Two cases are no pauses. A motor that reverses stands still on purpose. So does
//! a motor whose velocity falls before the interval and rises after it at rates that give a standstill within the
//! interval.

use std::collections::VecDeque;

use kerf::boards::MOTORS;

use crate::recorder::Step;

mod side;

use side::Side;

/// How much longer than its neighbours an interval must be to count.
pub const RATIO: f64 = 2.5;
/// Velocity of the path from which pauses count, mm/s.
pub const SLOWEST: f64 = 8.0;
/// The time on each side of a pause that is evaluated, s.
const SIGHT_S: f64 = 0.010;
/// Number of steps kept: more than four motors make in the time that is evaluated.
const KEPT: usize = 1 << 14;

/// The parameters of the machine and of its job.
#[derive(Clone, Default, Debug)]
pub struct Scale {
    /// CPU cycles in a second.
    pub clock_hz: f64,
    /// What each motor moves.
    pub motors: [Travel; MOTORS],
    /// Where each line of the job ends, in steps of each motor, as the pins count them.
    pub ends: Vec<(usize, [i64; MOTORS])>,
}

/// The axis of a motor.
#[derive(Clone, Copy, Default, Debug)]
pub struct Travel {
    /// Its axis, counted from 0.
    pub axis: usize,
    /// Length of a step, mm or degrees.
    pub step: f64,
    /// Whether the axis is rotary.
    pub rotary: bool,
}

/// A pause.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pause {
    /// Cycle of the step before the pause.
    pub cycle: u64,
    /// Cycles from the step before the pause to the step after it.
    pub cycles: u64,
    /// Velocity of the path beside the pause, mm/s: the lower of the two sides.
    pub velocity: f64,
    /// The line of the job that was on its way, if the ends of lines are known.
    pub line: Option<usize>,
}

/// The findings of the meter.
#[derive(Clone, Default, PartialEq, Debug)]
pub struct Found {
    /// Intervals of the leading motor that are too long.
    pub pauses: Vec<Pause>,
    /// Standstills of the step timer in motion, whether or not they are long enough for a pause.
    pub starved: Vec<Pause>,
}

/// A possible pause. It is judged as soon as enough steps after it are known.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    kind: Kind,
    from: u64,
    to: u64,
    line: Option<usize>,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Kind {
    /// A long interval of this motor.
    Interval(u8),
    /// The timer stood still.
    Stop,
}

/// Detects pauses in a stream of steps.
pub struct Meter {
    scale: Scale,
    recent: VecDeque<Step>,
    /// The last three steps of each motor, the newest first.
    times: [[Option<u64>; 3]; MOTORS],
    /// The lines during which the newest two steps of each motor came, the newest first.
    lines: [[Option<usize>; 2]; MOTORS],
    position: [i64; MOTORS],
    /// Number of lines that have been carried out.
    done: usize,
    /// The last step before the timer stopped, and the line at that time.
    stopped: Option<(u64, Option<usize>)>,
    /// Whether the timer runs again, but no step has come yet.
    restarted: bool,
    waiting: VecDeque<Candidate>,
    found: Found,
}

impl Meter {
    /// A meter for motors at rest. Positions count from here.
    pub fn new(scale: Scale) -> Self {
        let mut meter = Meter {
            scale,
            recent: VecDeque::new(),
            times: [[None; 3]; MOTORS],
            lines: [[None; 2]; MOTORS],
            position: [0; MOTORS],
            done: 0,
            stopped: None,
            restarted: false,
            waiting: VecDeque::new(),
            found: Found::default(),
        };
        meter.pass_ends();
        meter
    }

    /// Takes a step.
    pub fn step(&mut self, step: Step) {
        let line = self.line();
        if self.recent.len() == KEPT {
            self.recent.pop_front();
        }
        self.recent.push_back(step);
        self.end_stop(step.cycle);
        self.interval(step, line);
        self.position[usize::from(step.motor)] += if step.positive { 1 } else { -1 };
        self.pass_ends();
        let seen = step.cycle.saturating_sub((SIGHT_S * self.scale.clock_hz) as u64);
        while let Some(candidate) = self.waiting.front().copied().filter(|c| c.to < seen) {
            self.waiting.pop_front();
            let Meter { scale, recent, found, .. } = self;
            judge(scale, recent, candidate, found);
        }
    }

    /// Takes note that the step timer was started or stopped.
    pub fn timer(&mut self, runs: bool) {
        if runs {
            self.restarted = self.stopped.is_some();
        } else if let Some(last) = self.recent.back() {
            // If the timer stops again before a step has come, the standstill goes on.
            self.stopped = self.stopped.or(Some((last.cycle, self.line())));
            self.restarted = false;
        }
    }

    /// Returns what has been found so far.
    pub fn found(&self) -> Found {
        let mut found = self.found.clone();
        for candidate in &self.waiting {
            judge(&self.scale, &self.recent, *candidate, &mut found);
        }
        found
    }

    fn line(&self) -> Option<usize> {
        self.scale.ends.get(self.done).map(|(line, _)| *line)
    }

    fn pass_ends(&mut self) {
        while self.scale.ends.get(self.done).is_some_and(|(_, end)| *end == self.position) {
            self.done += 1;
        }
    }

    fn end_stop(&mut self, now: u64) {
        if !self.restarted {
            return;
        }
        self.restarted = false;
        if let Some((from, line)) = self.stopped.take() {
            self.waiting.push_back(Candidate { kind: Kind::Stop, from, to: now, line });
        }
    }

    fn interval(&mut self, step: Step, line: Option<usize>) {
        let motor = usize::from(step.motor);
        if let [Some(c), Some(b), Some(a)] = self.times[motor] {
            let [before, long, after] = [b - a, c - b, step.cycle - c].map(|i| i as f64);
            if long > RATIO * before && long > RATIO * after {
                let kind = Kind::Interval(step.motor);
                let line = self.lines[motor][1];
                self.waiting.push_back(Candidate { kind, from: b, to: c, line });
            }
        }
        self.times[motor].rotate_right(1);
        self.times[motor][0] = Some(step.cycle);
        self.lines[motor] = [line, self.lines[motor][0]];
    }
}

/// Adds a candidate to what has been found if it is a pause.
fn judge(scale: &Scale, recent: &VecDeque<Step>, candidate: Candidate, found: &mut Found) {
    let Candidate { kind, from, to, line } = candidate;
    let begin = recent.partition_point(|s| s.cycle <= from);
    let end = recent.partition_point(|s| s.cycle < to);
    let motor = match kind {
        Kind::Interval(motor) => Some(motor),
        Kind::Stop => None,
    };
    if motor.is_some_and(|motor| !leads(recent, motor, begin, end)) {
        return;
    }
    let gap = (to - from) as f64 / scale.clock_hz;
    let before = Side::of(scale, motor, recent.range(..begin).rev());
    let after = Side::of(scale, motor, recent.range(end..));
    let (Some(before), Some(after)) = (before, after) else { return };
    let velocity = before.velocity.min(after.velocity);
    if velocity < SLOWEST || planned(gap, &before, &after) {
        return;
    }
    let pause = Pause { cycle: from, cycles: to - from, velocity, line };
    let list = if kind == Kind::Stop { &mut found.starved } else { &mut found.pauses };
    // Several motors may lead equally and show one pause. It counts once.
    if list.last().is_none_or(|last| pause.cycle >= last.cycle + last.cycles) {
        list.push(pause);
    }
}

/// Whether the motor leads from its step before `begin` to its step at or behind `end`, and steps in the same
/// direction on both sides.
fn leads(recent: &VecDeque<Step>, motor: u8, begin: usize, end: usize) -> bool {
    let mut others = [0; MOTORS];
    for step in recent.range(begin..end) {
        others[usize::from(step.motor)] += 1;
    }
    let direction = |mut steps: Box<dyn Iterator<Item = &Step> + '_>| {
        steps.find(|s| s.motor == motor).map(|s| s.positive)
    };
    let before = direction(Box::new(recent.range(..begin).rev()));
    let after = direction(Box::new(recent.range(end..)));
    others.iter().all(|n| *n <= 1) && before == after
}

/// Whether motion stops and starts again within a gap of so many seconds, as the velocities beside it show.
fn planned(gap: f64, before: &Side, after: &Side) -> bool {
    /// Segments have constant velocity and take 2 ms; two of them hide how velocity changes.
    const SLICES_S: f64 = 0.004;
    /// Gap after which the motion before it need not slow down, s. A motion that a switch or a stop has ended does
    /// not slow down as planned, and the next motion begins much later.
    const ENDED_S: f64 = 0.100;
    let reach = 0.6 * gap + SLICES_S;
    after.rest <= reach && (before.rest <= reach || gap > ENDED_S)
}

#[cfg(test)]
mod tests;
