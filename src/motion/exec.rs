//! Exec: runs blocks, a few milliseconds at a time.
//!
//! Owned by the exec task (level 2), which asks [`Exec::step`] for a segment whenever the segment ring
//! has room. A block is run as an up-ramp, a cruise and a down-ramp ([`Running`]); each call advances the
//! time by [`SEGMENT_S`] and hands the distance to [`Prep`]. Times are seconds, distances mm.
//!
//! The planner guarantees that the machine can slow down to every block's `entry` (`lookahead`). Exec
//! does the other direction: it knows how fast it really is, and speeds up as far as it can. So it
//! may enter a block slower than planned, never faster. While the down-ramp has not begun it keeps
//! looking at the next block's `entry`, which rises as more blocks arrive, and moves its exit up.
//!
//! Distance is kept in integer phase units of the dominant motor, so a block of any length at any
//! speed ends exactly; floats only say how far the next few milliseconds go. Near its end a block is
//! measured from the end, where floats are fine-grained.
//!
//! Cost on AVR: with [`Prep`] about 13,000 cycles a segment, and 15,000 more at the start of a block.

use super::block::{Block, Kind};
use super::dda::Segment;
use super::prep::{PERIOD_MIN, Prep, Rest};
use super::profile::{Limits, greater, lesser, reach};
use super::queue::BlockSource;
use super::running::{CRUISE_MIN, Running};
use crate::boards::MOTORS;

/// CPU cycles in a second.
const CYCLES_PER_S: f32 = crate::boards::ACTIVE.clock_hz as f32;

/// CPU cycles in a millisecond.
const CYCLES_PER_MS: u32 = crate::boards::ACTIVE.clock_hz / 1000;

/// Nominal time of a segment. Four of them are the latency from exec to the pins.
pub const SEGMENT_S: f32 = 0.004;

/// The same in CPU cycles.
const SEGMENT_CYCLES: u32 = (SEGMENT_S * CYCLES_PER_S) as u32;

/// Highest step rate of a motor, steps per second: a step on every tick.
pub const STEP_RATE_MAX: f32 = CYCLES_PER_S / PERIOD_MIN as f32;

/// Shortest block with steps, s: about what exec takes to begin one and to prepare it while the step
/// interrupt is at its busiest.
pub const BLOCK_S_MIN: f32 = 0.004;

/// A dwell's segment: this many ticks of a millisecond.
const DWELL_TICKS: u16 = 4;

/// What [`Exec::step`] found to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// A segment to queue.
    Segment(Segment),
    /// Nothing to queue, but something was done: ask again.
    Again,
    /// A program stop or end is due: ask again when the steppers stand still.
    Standstill,
    /// No block.
    Idle,
}

/// What reports show of the motion that is being prepared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Motor positions at the end of the block being run, in steps.
    pub target: [i32; MOTORS],
    /// Signed steps of that block.
    pub steps: [i32; MOTORS],
    /// Share of that block which is still to be run, 1 to 0.
    pub share_left: f32,
    /// Velocity along the path, mm/s.
    pub velocity: f32,
    /// The N word of the block being run.
    pub line: u32,
    /// Something moves, or dwells.
    pub running: bool,
    /// What the program came to last.
    pub program: Program,
}

impl Snapshot {
    /// At rest, at zero.
    pub const fn new() -> Self {
        Self {
            target: [0; MOTORS],
            steps: [0; MOTORS],
            share_left: 0.0,
            velocity: 0.0,
            line: 0,
            running: false,
            program: Program::Ready,
        }
    }

    /// Where motor `m` is, in steps.
    pub fn position(&self, m: usize) -> i32 {
        let short = self.steps[m] as f32 * self.share_left;
        self.target[m].wrapping_sub(short as i32)
    }
}

/// How the program stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Program {
    /// Nothing has run since reset.
    #[default]
    Ready,
    /// The queue ran empty, or M0.
    Stopped,
    /// M2 or M30.
    Ended,
}

/// The state of exec.
#[derive(Debug, Default)]
pub struct Exec {
    prep: Prep,
    running: Option<Running>,
    rest: Rest,
    /// Velocity at the boundary of blocks.
    velocity: f32,
    dwell_ms: u32,
    snapshot: Snapshot,
}

impl Exec {
    /// At rest.
    pub const fn new() -> Self {
        Self {
            prep: Prep::new(),
            running: None,
            rest: Rest { distance: 0, cycles: 0 },
            velocity: 0.0,
            dwell_ms: 0,
            snapshot: Snapshot::new(),
        }
    }

    /// What reports show.
    pub fn snapshot(&self) -> &Snapshot {
        &self.snapshot
    }

    /// Does the next thing there is to do. `standstill` says that the steppers have stopped.
    pub fn step(&mut self, blocks: &mut BlockSource, standstill: bool) -> Step {
        if self.dwell_ms > 0 {
            return Step::Segment(self.dwell());
        }
        if self.running.is_some() {
            return self.run(blocks);
        }
        let Some(block) = blocks.peek(0, |block| *block) else {
            return self.idle(standstill);
        };
        self.snapshot.line = block.line;
        match block.kind {
            Kind::Line => self.begin(&block, blocks),
            Kind::Dwell => {
                self.dwell_ms = block.steps[0].unsigned_abs();
                self.snapshot.running = true;
                blocks.release();
                Step::Again
            }
            Kind::SetPosition => {
                self.snapshot.target = block.steps;
                self.snapshot.share_left = 0.0;
                blocks.release();
                Step::Again
            }
            Kind::ProgramStop | Kind::ProgramEnd => self.stop(block.kind, blocks, standstill),
        }
    }

    fn idle(&mut self, standstill: bool) -> Step {
        self.rest = Rest::default();
        self.velocity = 0.0;
        self.snapshot.velocity = 0.0;
        if standstill && self.snapshot.running {
            self.snapshot.running = false;
            self.snapshot.program = Program::Stopped;
        }
        Step::Idle
    }

    fn stop(&mut self, kind: Kind, blocks: &mut BlockSource, standstill: bool) -> Step {
        self.velocity = 0.0;
        self.snapshot.velocity = 0.0;
        if !standstill {
            return Step::Standstill;
        }
        self.snapshot.running = false;
        self.snapshot.program =
            if kind == Kind::ProgramEnd { Program::Ended } else { Program::Stopped };
        blocks.release();
        Step::Again
    }

    fn dwell(&mut self) -> Segment {
        let ticks = self.dwell_ms.min(u32::from(DWELL_TICKS)) as u16;
        self.dwell_ms -= u32::from(ticks);
        Segment { ticks, period: CYCLES_PER_MS as u16, ..self.prep.idle(0, 1).0 }
    }

    /// Takes up a line block. It stays in the ring until its last segment, so that the planner
    /// counts it as work in hand.
    #[inline(never)]
    fn begin(&mut self, block: &Block, blocks: &mut BlockSource) -> Step {
        let wish = exit_wish(blocks, block.cruise);
        let most = self.prep.begin(block);
        for m in 0..MOTORS {
            self.snapshot.target[m] = self.snapshot.target[m].wrapping_add(block.steps[m]);
        }
        self.snapshot.steps = block.steps;
        self.snapshot.share_left = 1.0;
        self.snapshot.running = true;
        if most == 0 {
            blocks.release();
            return self.pass(block, wish);
        }
        self.running = Some(Running::new(block, most, self.velocity, wish));
        Step::Again
    }

    /// A block too short for a single step, or of axes without motors: its time goes to the next
    /// step, so that many of them in a row are no faster than a long one.
    fn pass(&mut self, block: &Block, exit_wish: f32) -> Step {
        let limits = Limits { accel: block.accel, jerk: block.jerk };
        let entry = self.velocity;
        let reached = greater(reach(entry, block.length, &limits), CRUISE_MIN);
        self.velocity = lesser(exit_wish, reached);
        self.snapshot.share_left = 0.0;
        self.snapshot.velocity = self.velocity;
        let mean = lesser(greater((entry + reached) * 0.5, CRUISE_MIN), block.cruise);
        let seconds = block.length / mean;
        let ms = (seconds * 1000.0) as u32;
        self.dwell_ms = self.dwell_ms.saturating_add(ms);
        self.rest.cycles += cycles_of(seconds - ms as f32 * 0.001);
        if self.rest.cycles >= CYCLES_PER_MS {
            self.rest.cycles -= CYCLES_PER_MS;
            self.dwell_ms = self.dwell_ms.saturating_add(1);
        }
        Step::Again
    }

    /// Prepares the next stretch of the block being run. In place: copying its state would cost as
    /// much as the mathematics.
    #[inline(never)]
    fn run(&mut self, blocks: &mut BlockSource) -> Step {
        let Some(running) = &mut self.running else {
            return Step::Again;
        };
        running.raise_exit(exit_wish(blocks, running.cruise));
        let body = running.body_left();
        let left = running.time_left(body);
        let rest = core::mem::take(&mut self.rest);
        if left <= 1.5 * SEGMENT_S {
            self.velocity = running.exit;
            self.snapshot.velocity = running.exit;
            self.snapshot.share_left = 0.0;
            self.running = None;
            blocks.release();
            let cycles = cycles_of(left) + rest.cycles;
            return self.prep.last(cycles).map_or(Step::Again, Step::Segment);
        }
        let distance = running.advance(SEGMENT_S, body) + rest.distance;
        let (segment, rest) = self.prep.segment(distance, SEGMENT_CYCLES + rest.cycles);
        self.rest = rest;
        self.snapshot.velocity = running.velocity();
        self.snapshot.share_left = running.share_left();
        Step::Segment(segment)
    }
}

/// CPU cycles in `seconds`; at least 1, at most what [`Prep`] takes beside a rest.
fn cycles_of(seconds: f32) -> u32 {
    ((seconds * CYCLES_PER_S) as u32).clamp(1, 100_000)
}

/// The velocity at which the block after the oldest may be entered, 0 if there is none yet.
fn exit_wish(blocks: &BlockSource, cruise: f32) -> f32 {
    blocks
        .peek(1, |next| if next.kind == Kind::Line { next.entry } else { 0.0 })
        .map_or(0.0, |entry| lesser(entry, cruise))
}
