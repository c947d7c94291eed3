//! The modal state: what one line leaves in force for the next.
//!
//! The discriminants are the numbers in which TinyG reports these modes.

use crate::capability::Capability;

/// Group 1: what axis words do on a line without a motion code.
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
    /// G38.2: until the probe makes contact. No contact is an error.
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
    /// G38.3: until the probe makes contact. No contact is no error.
    ProbeTowardsQuietly = 16,
    /// G38.4: until the probe loses contact. Lasting contact is an error.
    ProbeAway = 17,
    /// G38.5: until the probe loses contact. Lasting contact is no error.
    ProbeAwayQuietly = 18,
    /// G33, G32: in step with the spindle.
    Thread = 19,
    /// G76: a thread in several passes.
    ThreadCycle = 20,
    /// G33.1: in step with the spindle, there and back.
    RigidTap = 21,
}

impl MotionMode {
    /// The number of motion modes.
    pub const COUNT: usize = 22;

    /// Whether this is G73 or one of G81 to G89. Always false in an image without canned cycles.
    pub fn is_cycle(self) -> bool {
        Capability::Cycles.is_built_in() && matches!(self as u8, 6..=15)
    }

    /// Returns the capability that an image needs for this mode. `None` if every image has it.
    #[inline(always)]
    pub const fn capability(self) -> Option<Capability> {
        match self as u8 {
            5 | 16..=18 => Some(Capability::Probing),
            9 | 11..=13 => Some(Capability::Boring),
            6..=15 => Some(Capability::Cycles),
            19..=21 => Some(Capability::Lathe),
            _ => None,
        }
    }

    /// Whether this image has this mode.
    #[inline(always)]
    pub const fn is_built_in(self) -> bool {
        match self.capability() {
            Some(capability) => capability.is_built_in(),
            None => true,
        }
    }
}

/// Group 2: the plane of arcs and canned cycles.
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
    /// Returns the first and the second axis of the plane, and the axis across it. Counter-clockwise is from the first
    /// towards the second axis.
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
    /// G90.1: from the work origin.
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
    /// G95: F is the feed for each turn of the spindle.
    PerTurn = 2,
}

/// Group 14: what S means.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum SpeedMode {
    /// G97: turns a minute.
    Turns = 0,
    /// G96: the surface speed, m/min, or feet a minute with G20.
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

/// Group 6: the unit of lengths.
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
    /// G64: short moves that lie on a line may be merged into one (`motion::chain`).
    Continuous = 2,
}

/// G64 without P, as a tolerance.
pub const USUAL: u16 = u16::MAX;
/// The greatest tolerance that G64 can set: 1 mm, in units of [`Length`](crate::units::Length).
pub const TOLERANCE_MAX: u16 = 10_000;
/// How far merged moves may deviate from the path with G64 without P: 1 um.
const MERGED: u8 = 10;
/// The greatest deviation of merged moves.
const MERGED_MAX: u8 = 254;
/// How far the tool may be off the path with G64 without P where corners are rounded: 0.05 mm.
const ROUNDED: u16 = 500;
/// How far merged moves may deviate from the path then: 2.5 um. Moves of 0.03 mm whose ends are rounded to 0.001 mm zigzag
/// by 0.03 rad, which looks like acceleration. Merged moves do not.
const MERGED_WHERE_ROUNDED: u16 = 25;

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

/// Group 8 of the M codes: the coolant that each code switches on, as a bit. M9 switches all off.
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

/// Group 10: the level at which a canned cycle leaves a hole.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Retract {
    /// G98: the level of the axis before the first cycle, if it is above R; else R.
    Initial = 0,
    /// G99: R.
    ToR = 1,
}

/// The modes of all groups.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Modal {
    /// Group 1: motion.
    pub motion: MotionMode,
    /// Group 2: the plane.
    pub plane: Plane,
    /// Group 3: the distance mode.
    pub distance: Distance,
    /// Group 4: the distance mode of I, J and K.
    pub arc_distance: ArcDistance,
    /// Group 5: the feed mode.
    pub feed_mode: FeedMode,
    /// Group 6: the units.
    pub units: Units,
    /// Group 10: the retract level of canned cycles.
    pub retract: Retract,
    /// Group 14: the meaning of S.
    pub speed_mode: SpeedMode,
    /// Group 15: the meaning of X words.
    pub x_mode: XMode,
    /// Group 12: the coordinate system, 0 to 8 for G54 to G59.3.
    pub system: u8,
    /// Group 13: the path mode.
    pub path: PathMode,
    /// G64 P: how far the tool may be off the path, in units of [`Length`](crate::units::Length); [`USUAL`] without P.
    pub tolerance: u16,
    /// Group 7 of the M codes: the spindle.
    pub spindle: Turn,
    /// The coolants that run, bits of [`Coolant`].
    pub coolant: u8,
}

/// The settings for the modes in which the machine starts, and to which M2 and M30 return.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Defaults {
    /// The setting `gpl`.
    pub plane: Plane,
    /// The setting `gun`.
    pub units: Units,
    /// The setting `gco`: 0 to 8 for G54 to G59.3.
    pub system: u8,
    /// The setting `gpa`.
    pub path: PathMode,
    /// The setting `gdi`.
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
    /// Returns the value for [`Commands::blend`](super::command::Commands::blend).
    #[inline(always)]
    pub fn blend(&self) -> u8 {
        match self.path {
            PathMode::Continuous if self.tolerance == USUAL => MERGED + 1,
            PathMode::Continuous => {
                u8::try_from(self.tolerance).map_or(MERGED_MAX, |t| t.min(MERGED_MAX)) + 1
            }
            _ => 0,
        }
    }

    /// Returns the value for [`Commands::blend`](super::command::Commands::blend) where corners are rounded: a quarter of
    /// P is for moves that are merged.
    pub fn blend_where_rounded(&self) -> u8 {
        let merged = match self.tolerance {
            USUAL => MERGED_WHERE_ROUNDED,
            tolerance => tolerance / 4,
        };
        u8::try_from(merged).map_or(MERGED_MAX, |merged| merged.min(MERGED_MAX)) + 1
    }

    /// Returns how far rounded corners may be off the path, in units of [`Length`](crate::units::Length): three quarters
    /// of P.
    pub fn rounded(&self) -> u16 {
        let deviation = if self.tolerance == USUAL { ROUNDED } else { self.tolerance };
        deviation - deviation / 4
    }

    /// Returns the modes at power-up: the defaults, and G8 G80 G91.1 G94 G97 G98 M5 M9.
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
            tolerance: USUAL,
            spindle: Turn::Off,
            coolant: 0,
        }
    }
}
