//! The modal state: what one line leaves in force for the next.
//!
//! The discriminants are the numbers in which TinyG reports these modes.

/// Group 1: what axis words alone do.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum MotionMode {
    /// G0.
    Traverse = 0,
    /// G1.
    Feed = 1,
    /// G2.
    ClockwiseArc = 2,
    /// G3.
    CounterclockwiseArc = 3,
    /// G80.
    None = 4,
}

/// Group 2: where arcs lie.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Plane {
    /// G17.
    Xy = 0,
    /// G18.
    Zx = 1,
    /// G19.
    Yz = 2,
}

impl Plane {
    /// First and second axis, counter-clockwise from one to the other, and the axis across.
    pub fn axes(self) -> [u8; 3] {
        match self {
            Plane::Xy => [0, 1, 2],
            Plane::Zx => [2, 0, 1],
            Plane::Yz => [1, 2, 0],
        }
    }
}

/// Group 3: what axis words are measured from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Distance {
    /// G90.
    Absolute = 0,
    /// G91.
    Incremental = 1,
}

/// Group 5: what F means.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum FeedMode {
    /// G93: the line takes 1/F minutes.
    InverseTime = 0,
    /// G94.
    PerMinute = 1,
}

/// Group 6: the length of 1.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Units {
    /// G20.
    Inch = 0,
    /// G21.
    Mm = 1,
}

/// Group 13: how closely the path is followed. Kerf's planner never leaves the path, so that the first
/// and the last are the same.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum PathMode {
    /// G61.
    Exact = 0,
    /// G61.1: a stop at the end of each move.
    ExactStop = 1,
    /// G64.
    Continuous = 2,
}

/// All of them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Modal {
    /// Group 1.
    pub motion: MotionMode,
    /// Group 2.
    pub plane: Plane,
    /// Group 3.
    pub distance: Distance,
    /// Group 5.
    pub feed_mode: FeedMode,
    /// Group 6.
    pub units: Units,
    /// Group 13.
    pub path: PathMode,
}

impl Modal {
    /// At power-up: G80 G17 G90 G94 G21 G64.
    pub const fn new() -> Self {
        Self {
            motion: MotionMode::None,
            plane: Plane::Xy,
            distance: Distance::Absolute,
            feed_mode: FeedMode::PerMinute,
            units: Units::Mm,
            path: PathMode::Continuous,
        }
    }

    /// M2 and M30, which leave the units and the path mode alone.
    pub fn end_program(&mut self) {
        *self = Self { units: self.units, path: self.path, ..Self::new() };
    }
}

impl Default for Modal {
    fn default() -> Self {
        Self::new()
    }
}
