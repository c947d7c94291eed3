//! Canonical commands: what one line of G-code asks of the machine, in millimetres and machine coordinates.
//!
//! The interpreter fills one [`Commands`] for a line. [`steps`](super::steps) carries its fields out in their order,
//! which is the RS274 order of execution. Everything modal (units, distance mode, offsets, planes) has been resolved.

use super::decimal::Exact;
use super::heating::Heat;
use super::modal::{MotionMode, Plane, Turn};
use super::overrides::Change;
use super::threading::ThreadCycle;
use crate::capability::Capability;
use crate::units::{Length, PerAxis};

/// The highest N word: blocks keep it in three bytes.
pub const N_MAX: u32 = 0xFF_FFFF;

/// The canonical commands of one line, in order of execution.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
pub struct Commands {
    /// The N word, 0 if the line has none; at most [`N_MAX`].
    pub line: u32,
    /// M6: the tool of the last T word is in the spindle from now on.
    pub changes_tool: bool,
    /// M3, M4, M5, or S while the spindle turns.
    pub spindle: Option<Spindle>,
    /// M7, M8, M9: the coolants that run, bits of [`Coolant`](super::modal::Coolant).
    pub coolant: Option<u8>,
    /// M48 to M51.
    pub overrides: Option<Change>,
    /// G4: stand still for this many milliseconds.
    pub dwell_ms: Option<u32>,
    /// What the axes do, if anything.
    pub motion: Motion,
    /// G61.1 is in force: moves end at standstill. Without a move this asks for nothing.
    pub exact_stop: bool,
    /// G64: corners may be rounded, and successive short straight moves may be merged into one if they stay within a
    /// tolerance. The value is the tolerance in units of [`Length`] plus one. 0 with G61 and G61.1.
    pub blend: u8,
    /// M0, M1, M2, M30, M60.
    pub stop: Stop,
}

impl Commands {
    /// Whether the machine has nothing to do.
    pub fn is_empty(&self) -> bool {
        matches!(self.motion, Motion::None) && self.is_motion_alone()
    }

    /// Whether the line asks for a move.
    pub fn moves(&self) -> bool {
        !matches!(self.motion, Motion::None | Motion::SetPosition { .. } | Motion::Check)
    }

    /// Whether the line moves along its path exactly, without a stop at its end: G61.
    pub fn is_exact_path(&self) -> bool {
        let follows = matches!(
            self.motion,
            Motion::Traverse { .. } | Motion::Feed { .. } | Motion::Arc { .. } | Motion::Cycle(_)
        );
        follows && self.blend == 0 && !self.exact_stop
    }

    /// Whether the line asks for one straight move and for nothing else.
    pub fn is_straight(&self) -> bool {
        matches!(self.motion, Motion::Traverse { .. } | Motion::Feed { .. })
            && self.is_motion_alone()
    }

    /// Whether the line asks for nothing besides its motion. Also true if there is no motion.
    pub fn is_motion_alone(&self) -> bool {
        // All fields are listed, so that a new field cannot be forgotten here.
        let Commands {
            line: _,
            changes_tool,
            spindle,
            coolant,
            overrides,
            dwell_ms,
            motion: _,
            exact_stop: _,
            blend: _,
            stop,
        } = self;
        !*changes_tool
            && spindle.is_none()
            && coolant.is_none()
            && overrides.is_none()
            && dwell_ms.is_none()
            && *stop == Stop::None
    }

    /// Empties the commands. Not inlined, unlike `clear_here`.
    #[inline(never)]
    #[small]
    pub fn clear(&mut self) {
        self.clear_here();
    }

    /// Empties the commands. Writes only the tags, because the whole structure is large.
    #[inline(always)]
    pub(super) fn clear_here(&mut self) {
        self.motion = Motion::None;
        self.clear_beside_motion();
    }

    /// Empties everything except the motion.
    #[inline(always)]
    pub(super) fn clear_beside_motion(&mut self) {
        self.line = 0;
        self.changes_tool = false;
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
    /// The direction, or off.
    pub turn: Turn,
    /// S: turns per minute, or m/min with G96. [`Surface`] then gives the turns.
    pub speed: f32,
}

/// G96: a constant surface speed. The spindle speed follows from it and from the radius at which X is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surface {
    /// The surface speed, m/min. More than 0 while it is in force.
    pub speed: f32,
    /// The highest spindle speed, turns a minute; 0 for [`FASTEST`].
    pub limit: u16,
    /// The machine coordinate X of the axis of rotation.
    pub origin: Length,
}

/// The highest spindle speed without a limit, turns a minute. It applies at the axis of rotation, where the radius is
/// 0.
const FASTEST: f32 = 65_535.0;

/// Factor from m/min to turns a minute at a radius of one unit: 10^7 units are 1 m, and a circumference is 2 pi radii.
const TURNS: f32 = 1e7 / core::f32::consts::TAU;

impl Surface {
    /// The value while no surface speed is in force.
    pub const NONE: Self = Self { speed: 0.0, limit: 0, origin: Length::ZERO };

    /// Whether the surface speed is in force.
    pub fn is_on(&self) -> bool {
        self.speed.to_bits() != 0
    }

    /// Returns the highest spindle speed, turns a minute.
    pub fn most(&self) -> f32 {
        if self.limit == 0 { FASTEST } else { self.limit.into() }
    }

    /// Returns the spindle speed with X at `x`, machine coordinates. In turns a minute. Cost on AVR: 1,100 cycles.
    #[inline(never)]
    #[small]
    pub fn turns(&self, x: Length) -> f32 {
        let most = self.most();
        let radius = x.0.abs_diff(self.origin.0);
        let turns = self.speed * TURNS;
        // The comparison is of products, so that a radius of 0 is no division by 0.
        let radius = radius as f32;
        if turns < most * radius { turns / radius } else { most }
    }
}

/// The motion of the axes. Targets are machine coordinates.
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
    /// G38.2 to G38.5: straight at the feed rate, until the probe makes or loses contact.
    Probe {
        /// Where the move ends without contact.
        target: PerAxis<Length>,
        /// How fast.
        feed: Feed,
        /// Which of the four codes.
        mode: MotionMode,
    },
    /// G33 and G33.1: straight, in step with the spindle.
    Thread {
        /// Where to.
        target: PerAxis<Length>,
        /// How far the axis that moves farthest goes in a turn of the spindle.
        lead: Length,
        /// G33.1: the spindle reverses at the target, and the axes come back in step with it.
        returns: bool,
    },
    /// G76: a thread in several passes.
    ThreadCycle(ThreadCycle),
    /// G73, G81 to G89: a canned cycle.
    Cycle(Cycle),
    /// G28.2, G28.4: the homing cycle.
    Home {
        /// The axes, as bits.
        axes: u8,
        /// Whether the position is set to what the switches say.
        set: bool,
    },
    /// `{jogx:..}`: a jog, which is a traverse.
    Jog {
        /// Where to.
        target: PerAxis<Length>,
    },
    /// `{chk:1}` and `{chk:0}`: the lines that follow are only checked, or are executed again.
    Check,
    /// The moves that follow are corrected for the tilt of the bed (true), or are not.
    #[cfg(feature = "bed-plane")]
    FollowBed(bool),
    /// M104 to M190: heaters and the fan.
    Heat(Heat),
    /// G28.3: sets the present position. No motor moves.
    SetPosition {
        /// The new coordinates of all axes. Axes that the line does not name keep theirs.
        position: PerAxis<Length>,
    },
}

impl Motion {
    /// Whether motors may turn for it.
    pub fn moves(&self) -> bool {
        let stands = matches!(
            self,
            Motion::None | Motion::Check | Motion::Heat(_) | Motion::SetPosition { .. }
        );
        #[cfg(feature = "bed-plane")]
        let stands = stands || matches!(self, Motion::FollowBed(_));
        !stands
    }
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
    /// Whether the arc is clockwise (G2).
    pub clockwise: bool,
    /// Full turns beyond the arc itself; for a full circle (endpoint = start) 0 means one turn.
    pub extra_turns: u16,
}

/// A canned cycle: one or more holes, drilled along the axis across the plane. Machine coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// The code of the cycle.
    pub mode: MotionMode,
    /// The plane in which the holes lie.
    pub plane: Plane,
    /// The reference point, along the first and second axis of the plane.
    pub from: [Exact; 2],
    /// The distance from the reference point to the first hole, and from each hole to the next.
    pub pitch: [Exact; 2],
    /// How many holes; at least 1.
    pub holes: u16,
    /// R: the level at which feeding begins.
    pub retract: Length,
    /// The bottom of the hole.
    pub bottom: Length,
    /// The level at which the tool leaves a hole: `retract`, or above it.
    pub clear: Length,
    /// Q: the depth of a peck. More than 0 in cycles that peck.
    pub peck: Length,
    /// P: how long to dwell at the bottom.
    pub dwell_ms: u32,
    /// G87: how far beside the hole the tool enters and leaves, along the first and second axis of the plane; then the
    /// level at which the bore ends.
    pub back: [Length; BACK],
    /// How fast to feed.
    pub feed: Feed,
    /// How the spindle turns.
    pub spindle: Spindle,
}

/// The lengths that only G87 has, in an image that has it.
pub const BACK: usize = if Capability::Boring.is_built_in() { 3 } else { 0 };

impl Cycle {
    /// How far beside the hole the tool enters and leaves, along the first and second axis of the plane.
    pub fn aside(&self) -> [Length; 2] {
        [0, 1].map(|i| self.back.get(i).copied().unwrap_or_default())
    }

    /// The level at which a bore from below ends.
    pub fn top(&self) -> Length {
        self.back.get(2).copied().unwrap_or_default()
    }
}

/// How a line stops or ends the program.
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
