//! What one line of G-code asks of the machine: canonical commands, in units and machine coordinates.
//!
//! The interpreter fills one [`Commands`] for a line; the planner carries its parts out in the order
//! of the fields, which is the RS274 order of execution. Everything modal (units, distance mode,
//! offsets, planes) has been resolved.

use crate::units::{Length, PerAxis};

/// The canonical commands of one line, in order of execution.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
pub struct Commands {
    /// The N word, 0 if the line has none.
    pub line: u32,
    /// G4: stand still for this many milliseconds.
    pub dwell_ms: Option<u32>,
    /// G28.3: call the present position this, on the axes that are `Some`.
    pub set_position: Option<PerAxis<Option<Length>>>,
    /// The move, if any.
    pub motion: Motion,
    /// G61.1 is in force: the move ends at rest. By itself it is nothing to carry out.
    pub exact_stop: bool,
    /// M0, M1, M2, M30, M60.
    pub stop: Stop,
}

impl Commands {
    /// Whether the machine has nothing to do.
    pub fn is_empty(&self) -> bool {
        // In full, so that a new part is not forgotten here.
        let Commands { line: _, dwell_ms, set_position, motion, exact_stop: _, stop } = self;
        matches!(motion, Motion::None)
            && *stop == Stop::None
            && dwell_ms.is_none()
            && set_position.is_none()
    }
}

/// A move to `target`, which is in machine coordinates.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
pub enum Motion {
    /// None.
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

/// What ends or interrupts a program.
#[derive(Clone, Copy, Default, Debug, PartialEq, Eq)]
pub enum Stop {
    /// Nothing does.
    #[default]
    None,
    /// M0, M1, M60: program stop.
    Program,
    /// M2, M30: program end.
    End,
}
