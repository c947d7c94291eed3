//! The modal state: what one line leaves in force for the next.
//!
//! The discriminants are the numbers in which TinyG reports these modes.

use crate::capability::Capability;

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
    /// G38.2: until the probe touches; it must.
    ProbeTowards = 5,
    /// G81.
    Drill = 6,
    /// G82.
    DrillDwell = 7,
    /// G83.
    PeckDrill = 8,
    /// G84.
    Tap = 9,
    /// G85.
    Bore = 10,
    /// G86.
    BoreStop = 11,
    /// G87.
    BackBore = 12,
    /// G88.
    BoreByHand = 13,
    /// G89.
    BoreDwell = 14,
    /// G73.
    ChipBreak = 15,
    /// G38.3: until the probe touches; it may not.
    ProbeTowardsQuietly = 16,
    /// G38.4: until the probe lets go; it must.
    ProbeAway = 17,
    /// G38.5: until the probe lets go; it may not.
    ProbeAwayQuietly = 18,
    /// G33, G32: in step with the spindle.
    Thread = 19,
    /// G76: a thread in several passes.
    ThreadCycle = 20,
    /// G33.1: in step with the spindle, there and back.
    RigidTap = 21,
}

impl MotionMode {
    /// How many there are.
    pub const COUNT: usize = 22;

    /// G73, G81 to G89. Never in an image without them.
    pub fn is_cycle(self) -> bool {
        Capability::Cycles.is_built_in() && self.capability() == Some(Capability::Cycles)
    }

    /// What an image needs to have for it.
    #[inline(always)]
    pub const fn capability(self) -> Option<Capability> {
        match self as u8 {
            5 | 16..=18 => Some(Capability::Probing),
            6..=15 => Some(Capability::Cycles),
            19..=21 => Some(Capability::Lathe),
            _ => None,
        }
    }

    /// Whether this image has it.
    #[inline(always)]
    pub const fn is_built_in(self) -> bool {
        match self.capability() {
            Some(capability) => capability.is_built_in(),
            None => true,
        }
    }
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

/// Group 4: what I, J and K of an arc are measured from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum ArcDistance {
    /// G90.1: from where X, Y and Z are.
    Absolute = 0,
    /// G91.1: from the start of the arc.
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
    /// G95: for each turn of the spindle.
    PerTurn = 2,
}

/// Group 14: what S means.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum SpeedMode {
    /// G97: turns a minute.
    Turns = 0,
    /// G96: the speed of the surface that is cut, m/min, or feet a minute with G20.
    Surface = 1,
}

/// Group 15: what X words mean.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum XMode {
    /// G8: radii.
    Radius = 0,
    /// G7: diameters.
    Diameter = 1,
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

/// Group 13: how closely the path is followed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum PathMode {
    /// G61.
    Exact = 0,
    /// G61.1: a stop at the end of each move.
    ExactStop = 1,
    /// G64: short moves that lie on a line may be made one (`motion::chain`).
    Continuous = 2,
}

/// How far from the path G64 may take short moves if it does not say: 1 um, in units of [`Length`](crate::units::Length).
pub const TOLERANCE: u8 = 10;
/// The most that it can say.
pub const TOLERANCE_MAX: u8 = 254;

/// Group 7 of the M codes: how the spindle turns.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[repr(u8)]
pub enum Turn {
    /// M5.
    #[default]
    Off = 0,
    /// M3.
    Clockwise = 1,
    /// M4.
    Counterclockwise = 2,
}

/// Group 8 of the M codes: what each of them adds to the coolants that run, as bits; M9 takes all.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Coolant {
    /// M9.
    Off = 0,
    /// M7.
    Mist = 1,
    /// M8.
    Flood = 2,
}

/// Group 10: where a canned cycle ends along its axis.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Retract {
    /// G98: where the axis was before the first cycle, if that is above R.
    Initial = 0,
    /// G99: at R.
    ToR = 1,
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
    /// Group 4.
    pub arc_distance: ArcDistance,
    /// Group 5.
    pub feed_mode: FeedMode,
    /// Group 6.
    pub units: Units,
    /// Group 10.
    pub retract: Retract,
    /// Group 14.
    pub speed_mode: SpeedMode,
    /// Group 15.
    pub x_mode: XMode,
    /// Group 12: 0 to 8 for G54 to G59.3.
    pub system: u8,
    /// Group 13.
    pub path: PathMode,
    /// G64 P: how far from the path short moves may be taken, in units of [`Length`](crate::units::Length).
    pub tolerance: u8,
    /// Group 7 of the M codes.
    pub spindle: Turn,
    /// The coolants that run, bits of [`Coolant`].
    pub coolant: u8,
}

/// The modes in which the machine starts, and to which M2 and M30 return: settings.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Defaults {
    /// `gpl`.
    pub plane: Plane,
    /// `gun`.
    pub units: Units,
    /// `gco`: 0 to 8 for G54 to G59.3.
    pub system: u8,
    /// `gpa`.
    pub path: PathMode,
    /// `gdi`.
    pub distance: Distance,
}

impl Defaults {
    /// G17 G21 G54 G64 G90.
    pub const USUAL: Self = Self {
        plane: Plane::Xy,
        units: Units::Mm,
        system: 0,
        path: PathMode::Continuous,
        distance: Distance::Absolute,
    };
}

impl Modal {
    /// See [`Commands::blend`](super::command::Commands::blend).
    #[inline(always)]
    pub fn blend(&self) -> u8 {
        if self.path == PathMode::Continuous { self.tolerance + 1 } else { 0 }
    }

    /// At power-up: the defaults, and G8 G80 G91.1 G94 G97 G98 M5 M9.
    pub const fn new(defaults: &Defaults) -> Self {
        let Defaults { plane, units, system, path, distance } = *defaults;
        Self {
            motion: MotionMode::None,
            plane,
            distance,
            arc_distance: ArcDistance::Incremental,
            feed_mode: FeedMode::PerMinute,
            units,
            retract: Retract::Initial,
            speed_mode: SpeedMode::Turns,
            x_mode: XMode::Radius,
            system,
            path,
            tolerance: TOLERANCE,
            spindle: Turn::Off,
            coolant: 0,
        }
    }
}
