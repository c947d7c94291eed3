//! The sensors of a spindle: edges on pins from its angle, with fault injection.
//!
//! Each sensor pulls its pin low while a mark passes it. Marks are evenly spaced, and the spindle may turn either
//! way.
//!
//! A second sensor may see the sync marks, half of a mark's width behind the first. Its level at an edge of the first
//! sensor tells which way the spindle turns.

use std::collections::VecDeque;

use kerf::boards::Pin;

use super::build::Sensors;
use super::random::Random;

const NEVER: u64 = u64::MAX;

/// One sensor with its marks.
struct Line {
    pin: Pin,
    /// Marks in a turn.
    marks: f64,
    /// Angle of the first mark, and width of each mark, in turns.
    first: f64,
    width: f64,
    /// The level after all planned edges.
    high: bool,
    /// The edges to come, in the order of time.
    edges: VecDeque<(u64, bool)>,
    /// Number of pulses until one is left out.
    miss: Option<u64>,
}

impl Line {
    /// Returns the edges on the way from one angle to another, as angles and levels, in the order in which they come.
    fn crossed(&self, from: f64, to: f64) -> Vec<(f64, bool)> {
        let (low, high) = (from.min(to), from.max(to));
        let marks = ((low - self.first) * self.marks).floor() as i64 - 1
            ..=((high - self.first) * self.marks).ceil() as i64;
        let mut edges = Vec::new();
        for mark in marks {
            let begins = self.first + mark as f64 / self.marks;
            for (at, level) in [(begins, from > to), (begins + self.width, from < to)] {
                if low < at && at <= high {
                    edges.push((at, level));
                }
            }
        }
        edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        if from > to {
            edges.reverse();
        }
        edges
    }
}

/// The sensors of a spindle: index, sync, and the second one of sync.
pub struct Encoder {
    build: Sensors,
    lines: Vec<Line>,
}

impl Encoder {
    /// Sensors with the index mark at angle 0.
    pub fn new(build: Sensors) -> Self {
        let line = |pin, marks: f64, first, width| {
            let (high, edges, miss) = (true, VecDeque::new(), None);
            Line { pin, marks, first, width, high, edges, miss }
        };
        let marks = f64::from(build.per_turn);
        let behind = build.phase + 0.5 * build.width / marks;
        let sync = [(build.sync, build.phase), (build.second, behind)].into_iter();
        let sync = sync.map_while(|(pin, at)| Some(line(pin?, marks, at, build.width / marks)));
        let index = line(build.index, 1.0, 0.0, build.index_width);
        let lines = std::iter::once(index).chain(sync).collect();
        Encoder { build, lines }
    }

    /// Gives the sync sensors this many marks a turn from now on, the index mark half way between two of them. Edges
    /// that are planned already still come.
    pub fn set_marks(&mut self, per_turn: u32) {
        let phase = 0.5 / f64::from(per_turn);
        self.build = Sensors { per_turn, phase, ..self.build };
        let fresh = Encoder::new(self.build).lines;
        for (line, fresh) in self.lines.iter_mut().zip(fresh).skip(1) {
            (line.marks, line.first, line.width) = (fresh.marks, fresh.first, fresh.width);
        }
    }

    /// Leaves out one pulse after `after` further pulses: of the index sensor if `index`, else of the sync sensor.
    pub fn miss(&mut self, index: bool, after: u64) {
        if let Some(line) = self.lines.get_mut(usize::from(!index)) {
            line.miss = Some(after);
        }
    }

    /// Adds a false pulse of so many cycles. Returns false, and adds nothing, if the sensor sees a mark at that time.
    pub fn add(&mut self, index: bool, at: u64, cycles: u64) -> bool {
        let Some(line) = self.lines.get_mut(usize::from(!index)) else { return false };
        let before = line.edges.iter().take_while(|(edge, _)| *edge <= at).last();
        let first = line.edges.front();
        let is_free = match (before, first) {
            (Some((_, high)), _) => *high,
            (None, Some((_, high))) => !high,
            (None, None) => line.high,
        };
        if is_free {
            line.edges.extend([(at, false), (at + cycles, true)]);
            line.edges.make_contiguous().sort_by_key(|(at, _)| *at);
        }
        is_free
    }

    /// Plans the edges that come while the spindle turns from one angle to another, in turns, between the cycles
    /// `began` and `ended`.
    pub fn turn(&mut self, from: f64, to: f64, began: u64, ended: u64, random: &mut Random) {
        let jitter = self.build.jitter;
        for line in &mut self.lines {
            for (angle, high) in line.crossed(from, to) {
                if !high && line.miss.is_some() {
                    let left = line.miss.unwrap_or(0);
                    line.miss = left.checked_sub(1);
                    if left == 0 {
                        continue;
                    }
                }
                if line.high == high {
                    continue;
                }
                line.high = high;
                let share = (angle - from) / (to - from);
                let at = began + (share * (ended - began) as f64) as u64;
                let at = at + if jitter > 0 { random.below(jitter) } else { 0 };
                line.edges.push_back((at, high));
                if let Some(bounce) = self.build.bounce {
                    let mut times: Vec<u64> = (0..2 * bounce.times)
                        .map(|_| at + 1 + random.below(bounce.cycles.max(1)))
                        .collect();
                    times.sort_unstable();
                    let flips = times.into_iter().enumerate();
                    line.edges.extend(flips.map(|(i, at)| (at, (i % 2 == 1) == high)));
                }
            }
            line.edges.make_contiguous().sort_by_key(|(at, _)| *at);
        }
    }

    /// Cycle at which a pin changes next.
    pub fn due(&self) -> u64 {
        let next = self.lines.iter().filter_map(|line| line.edges.front());
        next.map(|(at, _)| *at).min().unwrap_or(NEVER)
    }

    /// Adds the pins that have changed by `now` to `changed`. Returns whether an index pulse has begun.
    pub fn advance(&mut self, now: u64, changed: &mut Vec<(Pin, bool)>) -> bool {
        let mut begun = false;
        for (n, line) in self.lines.iter_mut().enumerate() {
            while let Some((at, high)) = line.edges.front().copied()
                && at <= now
            {
                line.edges.pop_front();
                // The machine takes pins from the end of the list, so later changes go to the front.
                changed.insert(0, (line.pin, high));
                begun |= n == 0 && !high;
            }
        }
        begun
    }
}
