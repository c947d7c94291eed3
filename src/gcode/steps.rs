//! Steps: the commands of a line, split into single steps in the order of execution.
//!
//! The planner carries the steps out, `kerf canon` prints them. A canned cycle is a table of operations at a hole. It
//! is expanded step by step, so that it needs no memory except its present place in the table.
//!
//! The caller carries out each step before it asks for the next, and passes the position that the last step has
//! reached.

use super::command::{Commands, Cycle, Feed, Motion, Spindle, Stop};
use super::heating::Heat;
use super::modal::{MotionMode, Turn};
use super::overrides::Change;
use super::threading::ThreadCycle;
use crate::capability::Capability;
use crate::progmem;
use crate::units::{Length, PerAxis};

/// One step of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// The tool that is in the spindle is another one.
    Tool,
    /// Sets the direction and speed of the spindle.
    Spindle(Spindle),
    /// Sets the coolants that run, bits of [`Coolant`](super::modal::Coolant).
    Coolant(u8),
    /// Changes overrides.
    Override(Change),
    /// Stands still for this many milliseconds.
    Dwell(u32),
    /// A straight move to a place in machine coordinates. Without a feed it is a traverse.
    Line(PerAxis<Length>, Option<Feed>),
    /// The arc of the commands' motion.
    Arc,
    /// The probing move of the commands' motion.
    Probe,
    /// Waits at standstill until the encoder has measured the speed of the spindle.
    AwaitSpindle,
    /// A pass in step with the spindle. [`Steps::pass`] returns its lines.
    Thread,
    /// The homing cycle of the commands' motion.
    Home,
    /// The jog of the commands' motion.
    Jog,
    /// From here on lines are only checked, or are carried out again.
    Check,
    /// From here on moves follow the plane of the bed (true), or do not.
    #[cfg(feature = "bed-plane")]
    FollowBed(bool),
    /// Sets a heater or the fan, and waits for a temperature if the request says so.
    Heat(Heat),
    /// Sets the coordinates of the present position.
    SetPosition(PerAxis<Length>),
    /// The program stops or ends.
    Stop(Stop),
}

impl Step {
    /// Whether the step comes before the move of its line. Steps within a cycle count as well.
    pub fn precedes_motion(&self) -> bool {
        matches!(
            self,
            Step::Tool | Step::Spindle(_) | Step::Coolant(_) | Step::Override(_) | Step::Dwell(_)
        )
    }
}

/// How far a line has been carried out.
#[derive(Clone, Copy, Default, Debug)]
pub struct Steps {
    stage: Stage,
    /// In a motion of several steps: the number of the next step.
    part: u8,
    /// In a cycle: the number of the hole or the pass, from 1.
    hole: u16,
    /// In a cycle that pecks: the level that has been drilled to.
    depth: Length,
    peck: Peck,
}

#[derive(Clone, Copy, Default, PartialEq, Debug)]
enum Stage {
    #[default]
    OldSpindle,
    Tool,
    Spindle,
    Coolant,
    Overrides,
    Dwell,
    Motion,
    Stop,
    Done,
}

/// The next movement in a hole that is drilled in pecks.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
enum Peck {
    #[default]
    Deeper,
    Up,
    Down,
}

/// The indices of X and Z among the axes.
const X: usize = 0;
const Z: usize = 2;

/// How far above the last depth feeding begins again after a peck, and how far the tool goes up to break chips: 0.254
/// mm.
const PECK_CLEARANCE: i32 = 2_540;

/// An operation of a canned cycle at a hole.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Op {
    /// The hole is done.
    End,
    /// Goes up to R before the first hole, if the tool is below R.
    Rise,
    /// Goes to the place of the hole in the plane.
    Over,
    /// Goes to one side of the hole in the plane (G87).
    Aside,
    Rapid(Level),
    Feed(Level),
    /// Drills to the bottom in pecks.
    Peck,
    Dwell,
    SpindleOff,
    SpindleOn,
    SpindleBack,
    Stop,
}

impl Op {
    /// Whether only the cycles of [`Capability::Boring`] have this operation.
    const fn is_boring(self) -> bool {
        matches!(
            self,
            Op::Aside
                | Op::Feed(Level::Top)
                | Op::SpindleOff
                | Op::SpindleOn
                | Op::SpindleBack
                | Op::Stop
        )
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Level {
    R,
    Bottom,
    Clear,
    Top,
}

/// The operations with which all cycles begin.
const APPROACH: [Op; 3] = [Op::Rise, Op::Over, Op::Rapid(Level::R)];
/// The greatest number of operations after the approach.
const OPS: usize = if Capability::Boring.is_built_in() { 12 } else { 3 };
/// The motion mode of the first cycle in [`CYCLES`].
const FIRST: usize = MotionMode::Drill as usize;

progmem! {
    /// The operations of each cycle at a hole, by motion mode from G81 on.
    static CYCLES: [[Op; OPS]; 10] = [
        ops(&[Op::Feed(Level::Bottom), Op::Rapid(Level::Clear)]),
        ops(&[Op::Feed(Level::Bottom), Op::Dwell, Op::Rapid(Level::Clear)]),
        ops(&[Op::Peck, Op::Rapid(Level::Clear)]),
        boring(&[
            Op::Feed(Level::Bottom), Op::SpindleOff, Op::SpindleBack, Op::Dwell,
            Op::Feed(Level::Clear), Op::SpindleOff, Op::SpindleOn,
        ]),
        ops(&[Op::Feed(Level::Bottom), Op::Feed(Level::Clear)]),
        boring(&[
            Op::Feed(Level::Bottom), Op::Dwell, Op::SpindleOff, Op::Rapid(Level::Clear),
            Op::SpindleOn,
        ]),
        boring(&[
            Op::Aside, Op::SpindleOff, Op::Rapid(Level::Bottom), Op::Over, Op::SpindleOn,
            Op::Feed(Level::Top), Op::Feed(Level::Bottom), Op::SpindleOff, Op::Aside,
            Op::Rapid(Level::Clear), Op::Over, Op::SpindleOn,
        ]),
        boring(&[
            Op::Feed(Level::Bottom), Op::Dwell, Op::SpindleOff, Op::Stop,
            Op::Rapid(Level::Clear), Op::SpindleOn,
        ]),
        ops(&[Op::Feed(Level::Bottom), Op::Dwell, Op::Feed(Level::Clear)]),
        ops(&[Op::Peck, Op::Rapid(Level::Clear)]),
    ];
}

/// Returns the operations of a cycle that acts on the spindle; none in an image without such cycles.
const fn boring(some: &[Op]) -> [Op; OPS] {
    if Capability::Boring.is_built_in() { ops(some) } else { [Op::End; OPS] }
}

const fn ops(some: &[Op]) -> [Op; OPS] {
    let mut all = [Op::End; OPS];
    let mut i = 0;
    while i < some.len() {
        all[i] = some[i];
        i += 1;
    }
    all
}

#[small]
impl Steps {
    /// Returns the next step of a line. `position` is the position of the machine. `None` after the last step.
    #[inline(never)]
    pub fn next(&mut self, commands: &Commands, position: &PerAxis<Length>) -> Option<Step> {
        loop {
            let stage = self.stage;
            let (step, next) = match stage {
                // The spindle has to stop before the tool is changed.
                Stage::OldSpindle => {
                    let off = Step::Spindle(Spindle { turn: Turn::Off, speed: 0.0 });
                    (commands.changes_tool.then_some(off), Stage::Tool)
                }
                Stage::Tool => (commands.changes_tool.then_some(Step::Tool), Stage::Spindle),
                Stage::Spindle => (commands.spindle.map(Step::Spindle), Stage::Coolant),
                Stage::Coolant => (commands.coolant.map(Step::Coolant), Stage::Overrides),
                Stage::Overrides => (commands.overrides.map(Step::Override), Stage::Dwell),
                Stage::Dwell => (commands.dwell_ms.map(Step::Dwell), Stage::Motion),
                Stage::Motion => match self.motion(&commands.motion, position) {
                    None => (None, Stage::Stop),
                    more => return more,
                },
                Stage::Stop => {
                    let stop = (commands.stop != Stop::None).then_some(Step::Stop(commands.stop));
                    (stop, Stage::Done)
                }
                Stage::Done => return None,
            };
            self.stage = next;
            if step.is_some() {
                return step;
            }
        }
    }

    /// Makes [`Self::next`] return the stop at the end of the line once more.
    pub fn repeat(&mut self) {
        self.stage = Stage::Stop;
    }

    fn motion(&mut self, motion: &Motion, position: &PerAxis<Length>) -> Option<Step> {
        if let Motion::Cycle(cycle) = motion {
            let is_built_in = Capability::Cycles.is_built_in();
            return if is_built_in { self.cycle(cycle, position) } else { None };
        }
        if Capability::Lathe.is_built_in()
            && let Motion::ThreadCycle(cycle) = motion
        {
            return self.threading(cycle, position);
        }
        self.part += 1;
        match (motion, self.part) {
            (Motion::Through { via, .. }, 1) => Some(Step::Line(*via, None)),
            (Motion::Through { target, .. }, 2) => Some(Step::Line(*target, None)),
            (Motion::None, _) | (_, 2..) => None,
            (Motion::Traverse { target }, _) => Some(Step::Line(*target, None)),
            (Motion::Feed { target, feed }, _) => Some(Step::Line(*target, Some(*feed))),
            (Motion::Arc { .. }, _) => Some(Step::Arc),
            (Motion::Probe { .. }, _) => Some(Step::Probe),
            (Motion::Thread { .. }, _) => Some(Step::Thread),
            (Motion::Home { .. }, _) => Some(Step::Home),
            (Motion::Jog { .. }, _) => Some(Step::Jog),
            (Motion::Check, _) => Some(Step::Check),
            #[cfg(feature = "bed-plane")]
            (Motion::FollowBed(follows), _) => Some(Step::FollowBed(*follows)),
            (Motion::Heat(heat), _) => Some(Step::Heat(*heat)),
            (Motion::SetPosition { position }, _) => Some(Step::SetPosition(*position)),
            (Motion::Through { .. } | Motion::Cycle(_) | Motion::ThreadCycle(_), _) => None,
        }
    }

    /// Returns the next step of G76. Each pass goes to its start, cuts, and goes back to the drive line.
    #[inline(never)]
    fn threading(&mut self, cycle: &ThreadCycle, position: &PerAxis<Length>) -> Option<Step> {
        self.hole = self.hole.max(1);
        while self.hole <= cycle.passes {
            self.part += 1;
            let (axis, to) = match self.part {
                // Before the first pass nothing may move until the spindle turns.
                1 if self.hole == 1 => return Some(Step::AwaitSpindle),
                1 => continue,
                2 => (Z, cycle.begin(self.hole)),
                3 => (X, cycle.entry(self.hole)),
                4 => return Some(Step::Thread),
                5 => (X, cycle.drive),
                _ => {
                    self.part = 0;
                    self.hole += 1;
                    continue;
                }
            };
            match level(position, axis, to, None) {
                // A move to the present position is left out.
                Some(Step::Line(target, _)) if target == *position => {}
                step => return step,
            }
        }
        None
    }

    /// Returns a line of the pass that [`Step::Thread`] asks for: where the line ends, and how far the axis that moves
    /// farthest goes in a turn. Lines are counted from 0, and `position` is where the machine is. `None` beyond the
    /// last line.
    #[inline(never)]
    pub fn pass(
        &self,
        motion: &Motion,
        position: &PerAxis<Length>,
        line: u8,
    ) -> Option<(PerAxis<Length>, Length)> {
        match motion {
            Motion::Thread { target, lead, .. } if line == 0 => Some((*target, *lead)),
            Motion::ThreadCycle(cycle) => cycle.line(self.hole, line, position),
            _ => None,
        }
    }

    /// Returns where the pass that [`Step::Thread`] asks for ends, for callers that do not carry it out. `position` is
    /// where the machine is.
    pub fn end_of_pass(&self, motion: &Motion, position: &PerAxis<Length>) -> PerAxis<Length> {
        let (mut at, mut line) = (*position, 0);
        if matches!(motion, Motion::Thread { returns: true, .. }) {
            return at;
        }
        while let Some((end, _)) = self.pass(motion, &at, line) {
            (at, line) = (end, line + 1);
        }
        at
    }

    #[inline(never)]
    fn cycle(&mut self, cycle: &Cycle, position: &PerAxis<Length>) -> Option<Step> {
        if self.hole == 0 {
            self.hole = 1;
        }
        loop {
            let part = usize::from(self.part);
            let op = APPROACH.get(part).copied().unwrap_or_else(|| {
                let ops = CYCLES.at((cycle.mode as usize).wrapping_sub(FIRST));
                ops.and_then(|ops| ops.get(part - APPROACH.len()).copied()).unwrap_or(Op::End)
            });
            if op == Op::End {
                if self.hole >= cycle.holes {
                    return None;
                }
                self.hole += 1;
                self.part = 1;
                continue;
            }
            let step = self.op(op, cycle, position);
            if self.peck == Peck::Deeper {
                self.part += 1;
            }
            match step {
                // A move to the present position is left out.
                Some(Step::Line(target, _)) if target == *position => {}
                None => {}
                step => return step,
            }
        }
    }

    #[inline(never)]
    fn op(&mut self, op: Op, cycle: &Cycle, position: &PerAxis<Length>) -> Option<Step> {
        let across = usize::from(cycle.plane.axes()[2]);
        if !Capability::Boring.is_built_in() && op.is_boring() {
            return None;
        }
        let spindle = |turn| Some(Step::Spindle(Spindle { turn, ..cycle.spindle }));
        match op {
            Op::Rise if position.get(across)? < &cycle.retract => {
                level(position, across, cycle.retract, None)
            }
            Op::Rise | Op::End => None,
            Op::Over => self.over(cycle, position, [Length::ZERO; 2]),
            Op::Aside => self.over(cycle, position, cycle.aside()),
            Op::Rapid(to) => level(position, across, cycle.level(to), None),
            Op::Feed(to) => level(position, across, cycle.level(to), Some(cycle.feed)),
            Op::Peck => self.peck(cycle, position, across),
            Op::Dwell => (cycle.dwell_ms > 0).then_some(Step::Dwell(cycle.dwell_ms)),
            Op::SpindleOff => spindle(Turn::Off),
            Op::SpindleOn => spindle(cycle.spindle.turn),
            Op::SpindleBack => spindle(match cycle.spindle.turn {
                Turn::Clockwise => Turn::Counterclockwise,
                _ => Turn::Clockwise,
            }),
            Op::Stop => Some(Step::Stop(Stop::Program)),
        }
    }

    /// Returns the move to the place of the hole in the plane, or to a place that is `by` beside it.
    #[inline(never)]
    fn over(&self, cycle: &Cycle, position: &PerAxis<Length>, by: [Length; 2]) -> Option<Step> {
        let mut target = *position;
        let hole = cycle.hole(self.hole)?;
        for ((axis, hole), by) in cycle.plane.axes().into_iter().zip(hole).zip(by) {
            *target.get_mut(usize::from(axis))? = hole.units.checked_add(by)?;
        }
        Some(Step::Line(target, None))
    }

    /// Returns the next step of G73 and G83, which drill to the bottom in feeds no longer than Q.
    #[inline(never)]
    fn peck(&mut self, cycle: &Cycle, position: &PerAxis<Length>, across: usize) -> Option<Step> {
        let again = Length(self.depth.0.saturating_add(PECK_CLEARANCE)).min(cycle.retract);
        let (to, feed, next) = match self.peck {
            Peck::Up if cycle.mode == MotionMode::ChipBreak => (again, None, Peck::Down),
            Peck::Up => (cycle.retract, None, Peck::Down),
            Peck::Down | Peck::Deeper => {
                if self.peck == Peck::Deeper {
                    self.depth = cycle.retract;
                } else if *position.get(across)? > again {
                    return level(position, across, again, None);
                }
                self.depth = Length(self.depth.0.saturating_sub(cycle.peck.0)).max(cycle.bottom);
                let done = self.depth == cycle.bottom;
                (self.depth, Some(cycle.feed), if done { Peck::Deeper } else { Peck::Up })
            }
        };
        self.peck = next;
        level(position, across, to, feed)
    }
}

/// Returns a move along one axis. Without a feed it is a traverse.
#[inline(never)]
#[small]
fn level(
    position: &PerAxis<Length>,
    across: usize,
    to: Length,
    feed: Option<Feed>,
) -> Option<Step> {
    let mut target = *position;
    *target.get_mut(across)? = to;
    Some(Step::Line(target, feed))
}

impl Cycle {
    fn level(&self, level: Level) -> Length {
        match level {
            Level::R => self.retract,
            Level::Bottom => self.bottom,
            Level::Clear => self.clear,
            Level::Top => self.top(),
        }
    }
}
