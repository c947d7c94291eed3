//! What one line of G-code asks of the machine: canonical commands, in millimetres and machine coordinates.
//!
//! The interpreter fills one [`Commands`] for a line; [`steps`](super::steps) takes them apart in the order
//! of the fields, which is the RS274 order of execution. Everything modal (units, distance mode,
//! offsets, planes) has been resolved.

use super::decimal::Exact;
use super::heating::Heat;
use super::modal::{MotionMode, Plane, Turn};
use super::overrides::Change;
use super::threading::ThreadCycle;
use crate::units::{Length, PerAxis};

/// The highest N word: blocks keep it in three bytes.
pub const N_MAX: u32 = 0xFF_FFFF;

/// The canonical commands of one line, in order of execution.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
pub struct Commands {
    /// The N word, 0 if the line has none; at most [`N_MAX`].
    pub line: u32,
    /// M6: this tool is in the spindle.
    pub tool: Option<u8>,
    /// M3, M4, M5, or S while it turns.
    pub spindle: Option<Spindle>,
    /// M7, M8, M9: the coolants that run, bits of [`Coolant`](super::modal::Coolant).
    pub coolant: Option<u8>,
    /// M48 to M51.
    pub overrides: Option<Change>,
    /// G4: stand still for this many milliseconds.
    pub dwell_ms: Option<u32>,
    /// What its axes do, if anything.
    pub motion: Motion,
    /// G61.1 is in force: moves end at rest. By itself it is nothing to carry out.
    pub exact_stop: bool,
    /// G64, of a straight move: short ones within this tolerance of a line may be made one, in units of [`Length`] and one more. 0 under
    /// G61 and G61.1: none are.
    pub blend: u8,
    /// M0, M1, M2, M30, M60.
    pub stop: Stop,
}

impl Commands {
    /// Whether the machine has nothing to do.
    pub fn is_empty(&self) -> bool {
        matches!(self.motion, Motion::None) && self.is_motion_alone()
    }

    /// Whether it has nothing to do but a straight move.
    pub fn is_straight(&self) -> bool {
        matches!(self.motion, Motion::Traverse { .. } | Motion::Feed { .. })
            && self.is_motion_alone()
    }

    /// Whether it has nothing to do but to move.
    pub fn is_motion_alone(&self) -> bool {
        // In full, so that a new part is not forgotten here.
        let Commands {
            line: _,
            tool,
            spindle,
            coolant,
            overrides,
            dwell_ms,
            motion: _,
            exact_stop: _,
            blend: _,
            stop,
        } = self;
        tool.is_none()
            && spindle.is_none()
            && coolant.is_none()
            && overrides.is_none()
            && dwell_ms.is_none()
            && *stop == Stop::None
    }

    /// Empties it, by a call.
    #[inline(never)]
    #[small]
    pub fn clear(&mut self) {
        self.clear_here();
    }

    /// Empties it, touching nothing but the tags: it is large.
    #[inline(always)]
    pub(super) fn clear_here(&mut self) {
        self.motion = Motion::None;
        self.clear_beside_motion();
    }

    /// Empties it but for the motion.
    #[inline(always)]
    pub(super) fn clear_beside_motion(&mut self) {
        self.line = 0;
        self.tool = None;
        self.spindle = None;
        self.coolant = None;
        self.overrides = None;
        self.dwell_ms = None;
        self.exact_stop = false;
        self.blend = 0;
        self.stop = Stop::None;
    }
}

/// How the spindle is to turn.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
pub struct Spindle {
    /// Which way.
    pub turn: Turn,
    /// S, in turns per minute.
    pub speed: f32,
}

/// G96: the spindle turns as fast as a surface speed asks for at the radius where X is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surface {
    /// m/min; more than 0 while it is in force.
    pub speed: f32,
    /// The most, turns a minute; 0 for [`FASTEST`].
    pub limit: u16,
    /// The machine coordinate X of the axis of rotation.
    pub origin: Length,
}

/// The most turns a minute that a surface speed asks for, at the axis of rotation too.
const FASTEST: f32 = 65_535.0;

/// From m/min to turns a minute at a radius of one unit: 10^7 units are a m, and a turn is 2 pi radii.
const TURNS: f32 = 1e7 / core::f32::consts::TAU;

impl Surface {
    /// Not in force.
    pub const NONE: Self = Self { speed: 0.0, limit: 0, origin: Length::ZERO };

    /// Whether it is in force.
    pub fn is_on(&self) -> bool {
        self.speed.to_bits() != 0
    }

    /// The most turns a minute.
    pub fn most(&self) -> f32 {
        if self.limit == 0 { FASTEST } else { self.limit.into() }
    }

    /// How fast the spindle turns with X there, machine coordinates; turns a minute. Cost on AVR: 1,100 cycles.
    #[inline(never)]
    #[small]
    pub fn turns(&self, x: Length) -> f32 {
        let most = self.most();
        let radius = x.0.abs_diff(self.origin.0);
        let turns = self.speed * TURNS;
        // Compared as a product: nothing is divided by 0.
        let radius = radius as f32;
        if turns < most * radius { turns / radius } else { most }
    }
}

/// What axes do. Targets are machine coordinates.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
pub enum Motion {
    /// No motion.
    #[default]
    None,
    /// G0: straight, each axis within its traverse limit.
    Traverse {
        /// Where to.
        target: PerAxis<Length>,
    },
    /// G1: straight at the feed rate.
    Feed {
        /// Where to.
        target: PerAxis<Length>,
        /// How fast.
        feed: Feed,
    },
    /// G2 and G3: an arc or helix.
    Arc {
        /// Where to.
        target: PerAxis<Length>,
        /// How fast.
        feed: Feed,
        /// Which circle.
        arc: Arc,
    },
    /// G28 and G30 with axis words: a traverse in two parts.
    Through {
        /// Where to first.
        via: PerAxis<Length>,
        /// Where to in the end.
        target: PerAxis<Length>,
    },
    /// G38.2 to G38.5: straight at the feed rate, until the probe says stop.
    Probe {
        /// Where to at most.
        target: PerAxis<Length>,
        /// How fast.
        feed: Feed,
        /// Which of them.
        mode: MotionMode,
    },
    /// G33 and G33.1: straight, in step with the spindle.
    Thread {
        /// Where to.
        target: PerAxis<Length>,
        /// How far the axis that moves farthest goes in a turn.
        lead: Length,
        /// G33.1: the spindle turns round there, and they come back in step.
        returns: bool,
    },
    /// G76.
    ThreadCycle(ThreadCycle),
    /// G73, G81 to G89.
    Cycle(Cycle),
    /// G28.2, G28.4: the homing cycle.
    Home {
        /// The axes, as bits.
        axes: u8,
        /// Whether the position is set to what the switches say.
        set: bool,
    },
    /// `{jogx:..}`: a traverse by itself.
    Jog {
        /// Where to.
        target: PerAxis<Length>,
    },
    /// `{chk:1}`, `{chk:0}`: from here on lines are checked only, or carried out again.
    Check,
    /// From here on moves follow the plane of the bed, or do not.
    #[cfg(feature = "bed-plane")]
    FollowBed(bool),
    /// M104 to M190: heaters and the fan.
    Heat(Heat),
    /// G28.3: no motor moves; the present position is called this.
    SetPosition {
        /// All axes; those that the line does not name are where they were.
        position: PerAxis<Length>,
    },
}

/// How fast a feed move goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feed {
    /// G94: units (mm, or degrees for a rotary-only move) per minute along the path.
    PerMinute(f32),
    /// G93: the whole move takes this many minutes.
    Minutes(f32),
}

/// The circle of an arc. Axes are indices in X Y Z A B C order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// First axis of the plane: X for G17, Z for G18, Y for G19, so that counter-clockwise turns
    /// from it towards `second` (RS274).
    pub first: u8,
    /// Second axis of the plane: Y, X, Z.
    pub second: u8,
    /// The axis along which a helix advances: Z, Y, X.
    pub linear: u8,
    /// Centre, machine coordinates, of the first and second axis.
    pub center: [Length; 2],
    /// G2.
    pub clockwise: bool,
    /// Full turns beyond the arc itself; for a full circle (endpoint = start) 0 means one turn.
    pub extra_turns: u16,
}

/// A canned cycle: one or more holes along the axis across the plane. Machine coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Which one.
    pub mode: MotionMode,
    /// The holes lie in this plane.
    pub plane: Plane,
    /// Where the holes are counted from, along the first and second axis of the plane.
    pub from: [Exact; 2],
    /// From there to the first hole, and from one hole to the next.
    pub pitch: [Exact; 2],
    /// How many holes; at least 1.
    pub holes: u16,
    /// R: feeding begins here.
    pub retract: Length,
    /// The bottom of the hole.
    pub bottom: Length,
    /// Where the axis is left: at `retract`, or above it.
    pub clear: Length,
    /// Q: the depth of a peck; more than 0 for cycles that peck.
    pub peck: Length,
    /// P: how long to dwell at the bottom.
    pub dwell_ms: u32,
    /// G87: how far beside the hole the tool goes in and out.
    pub aside: [Length; 2],
    /// G87: where the bore ends.
    pub top: Length,
    /// How fast to feed.
    pub feed: Feed,
    /// How the spindle turns.
    pub spindle: Spindle,
}

/// What ends or interrupts a program.
#[derive(Clone, Copy, Default, Debug, PartialEq, Eq)]
pub enum Stop {
    /// No stop.
    #[default]
    None,
    /// M0, M1, M60: program stop.
    Program,
    /// M2, M30: program end.
    End,
}
