//! Exec: runs blocks, a few milliseconds at a time.
//!
//! Owned by the exec task (level 2), which asks [`Exec::step`] for a segment whenever the segment ring
//! wants one. The [`Governor`] says how far the next stretch goes and how long it takes, [`Prep`] makes a
//! segment of it. A stretch ends where its block ends: a block that takes less than [`SEGMENT_S`] is one
//! segment. Times are seconds, distances mm.
//!
//! Nothing is planned ahead but what the [horizon](super::horizon) knows: how fast the machine is, and how
//! fast it may be at the end of the block, settle each stretch. More blocks in the queue tell at the
//! next one.
//!
//! A move without steps (shorter than a step, or of axes without motors) takes its time all the same:
//! many of them in a row are no faster than a long one.
//!
//! Cost on AVR: with [`Prep`] 3,500 cycles for a segment or a short block, 7,500 with a jerk limit.

use super::block::{Block, Body, Line};
use super::dda::Segment;
use super::governor::{Ahead, Governor};
use super::prep::{CYCLES_MAX, FINE_S, Prep};
use super::queue::{Anchor, BlockSource};
use crate::boards::MOTORS;

/// CPU cycles in a second.
const CYCLES_PER_S: f32 = crate::boards::ACTIVE.clock_hz as f32;

/// CPU cycles in a millisecond.
const CYCLES_PER_MS: u16 = (crate::boards::ACTIVE.clock_hz / 1000) as u16;

/// Nominal time of a segment: as short as leaves two thirds of the CPU to others.
pub const SEGMENT_S: f32 = 0.002;

/// Shortest block with steps, s: twice what exec takes for it while the step interrupt is busy.
pub const BLOCK_S_MIN: f32 = 0.000_75;

/// A dwell's segment: this many ticks of a millisecond.
const DWELL_TICKS: u16 = 2;

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
    pub steps: [i16; MOTORS],
    /// What is still to be run of that block, mm.
    pub left: f32,
    /// Its length, mm.
    pub length: f32,
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
            left: 0.0,
            length: 0.0,
            velocity: 0.0,
            line: 0,
            running: false,
            program: Program::Ready,
        }
    }

    /// Where motor `m` is, in steps.
    pub fn position(&self, m: usize) -> i32 {
        if self.left <= 0.0 || self.steps[m] == 0 {
            return self.target[m];
        }
        let short = f32::from(self.steps[m]) * (self.left / self.length);
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

/// The line that exec is running.
#[derive(Clone, Copy, Debug, Default)]
struct Running {
    /// Way to go, mm.
    left: f32,
    /// Velocity limit, mm/s.
    cruise: f32,
    /// Phase units of the dominant motor in a mm.
    scale: f32,
    /// Without a jerk limit: the square of the velocity that may be left at the end.
    headroom: f32,
    /// What of the queue `headroom` knows.
    version: u8,
    /// No stretch of it has been prepared.
    fresh: bool,
    /// All is planned; `Prep` has some left.
    done: bool,
    jerk: bool,
}

/// The state of exec.
#[derive(Debug, Default)]
pub struct Exec {
    prep: Prep,
    governor: Governor,
    running: Option<Running>,
    dwell_ms: u32,
}

/// What the governor sees of the queue.
struct View<'a> {
    headroom: f32,
    blocks: &'a BlockSource,
}

impl Ahead for View<'_> {
    fn headroom(&self) -> f32 {
        self.headroom
    }
    fn anchor(&self, n: u8) -> Option<Anchor> {
        self.blocks.anchor(n)
    }
}

impl Exec {
    /// At rest.
    pub const fn new() -> Self {
        Self { prep: Prep::new(), governor: Governor::new(), running: None, dwell_ms: 0 }
    }

    /// Does the next thing there is to do. `standstill` says that the steppers have stopped.
    pub fn step(&mut self, blocks: &mut BlockSource, standstill: bool, out: &mut Snapshot) -> Step {
        if let Some(segment) = self.prep.held() {
            return Step::Segment(segment);
        }
        if self.dwell_ms > 0 {
            return Step::Segment(self.dwell());
        }
        if self.running.is_none() {
            let Some(block) = blocks.oldest() else {
                return self.idle(standstill, out);
            };
            if let Some(step) = self.take_up(&block, blocks, standstill, out) {
                return step;
            }
        }
        self.run(blocks, out)
    }

    /// Begins the oldest block. `None` if it is a line, which is to be run now.
    fn take_up(
        &mut self,
        block: &Block,
        blocks: &mut BlockSource,
        standstill: bool,
        out: &mut Snapshot,
    ) -> Option<Step> {
        out.line = block.line;
        match &block.body {
            Body::Line(line) => {
                self.begin(line, blocks, out);
                return None;
            }
            Body::Dwell(ms) => {
                self.dwell_ms = *ms;
                self.halt(out);
                out.running = true;
            }
            Body::SetPosition(steps) => {
                out.target = *steps;
                out.left = 0.0;
            }
            Body::ProgramStop | Body::ProgramEnd => {
                self.halt(out);
                if !standstill {
                    return Some(Step::Standstill);
                }
                out.running = false;
                out.program = match block.body {
                    Body::ProgramEnd => Program::Ended,
                    _ => Program::Stopped,
                };
            }
            Body::Drivers(drivers) => self.prep.set_drivers(*drivers),
            Body::Nothing => {}
        }
        blocks.release();
        Some(Step::Again)
    }

    fn halt(&mut self, out: &mut Snapshot) {
        self.governor.stop();
        out.velocity = 0.0;
    }

    fn idle(&mut self, standstill: bool, out: &mut Snapshot) -> Step {
        self.halt(out);
        self.prep.rest();
        if standstill && out.running {
            out.running = false;
            out.program = Program::Stopped;
        }
        Step::Idle
    }

    fn dwell(&mut self) -> Segment {
        let ticks = if self.dwell_ms < u32::from(DWELL_TICKS) { 1 } else { DWELL_TICKS };
        self.dwell_ms -= u32::from(ticks);
        self.prep.pause(ticks, CYCLES_PER_MS)
    }

    /// Takes up a line. It stays in the ring until its last segment, so that the planner counts it as
    /// work in hand.
    #[inline(never)]
    fn begin(&mut self, line: &Line, blocks: &mut BlockSource, out: &mut Snapshot) {
        blocks.enter();
        let most = self.prep.begin(&line.steps, line.cruise * FINE_S < line.length);
        let mut m = 0;
        while m < MOTORS {
            out.target[m] = out.target[m].wrapping_add(line.steps[m].into());
            m += 1;
        }
        out.steps = line.steps;
        out.length = line.length;
        out.running = true;
        let jerk = line.jerk.get();
        self.governor.begin(line.accel.get(), jerk);
        self.running = Some(Running {
            left: line.length,
            cruise: line.cruise,
            // The block's units, to be divided by its length when that is needed.
            scale: f32::from(most) * 32768.0,
            headroom: 0.0,
            version: blocks.version().wrapping_sub(1),
            fresh: true,
            done: false,
            jerk: jerk > 0.0,
        });
    }

    /// Prepares the next stretch of the line being run. In place: copying its state would cost as
    /// much as the mathematics.
    #[inline(never)]
    fn run(&mut self, blocks: &mut BlockSource, out: &mut Snapshot) -> Step {
        let Some(running) = &mut self.running else {
            return Step::Again;
        };
        if running.done {
            return self.end(0, false, blocks);
        }
        let version = blocks.version();
        if version != running.version {
            running.version = version;
            if running.jerk {
                self.governor.look_again();
            } else {
                running.headroom = blocks.headroom();
            }
        }
        let ahead = View { headroom: running.headroom, blocks };
        let stretch = self.governor.stretch(running.left, running.cruise, &ahead, SEGMENT_S);
        out.velocity = self.governor.velocity();
        let cycles = cycles_of(stretch.seconds);
        if stretch.ends {
            out.left = 0.0;
            running.done = true;
            let whole = running.fresh;
            return self.end(cycles, whole, blocks);
        }
        if running.fresh {
            running.fresh = false;
            running.scale /= running.left;
        }
        running.left -= stretch.distance;
        out.left = running.left;
        let left = (running.left * running.scale) as u32;
        self.prep.segment(left, cycles).map_or(Step::Again, Step::Segment)
    }

    /// Hands out what is left of the line being run.
    fn end(&mut self, cycles: u32, whole: bool, blocks: &mut BlockSource) -> Step {
        let segment = self.prep.last(cycles, whole);
        if self.prep.left() == 0 {
            self.running = None;
            blocks.release();
        }
        segment.map_or(Step::Again, Step::Segment)
    }
}

/// CPU cycles in `seconds`; at least 1, at most what [`Prep`] takes.
fn cycles_of(seconds: f32) -> u32 {
    ((seconds * CYCLES_PER_S + 0.5) as u32).clamp(1, CYCLES_MAX)
}
