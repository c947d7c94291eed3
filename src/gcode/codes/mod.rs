//! The language: every G and M code, what it does, and the words it takes and needs.
//!
//! To add a code, add a row to [`table`] and a text to [`docs`]. `docs/gcode.md` is generated from these texts.

#[cfg(feature = "std")]
pub mod docs;
pub mod table;

use super::modal::{
    ArcDistance, Coolant, Distance, FeedMode, MotionMode, PathMode, Plane, Retract, SpeedMode,
    Turn, Units, XMode,
};
use super::overrides::Override;
use crate::progmem::Progmem;
use table::{DENSE, G, G_START, M, M_START, MOTION, STARTS};

/// What a code does. The variant is the modal group: a line may carry one code of each
/// (RS274/NGC section 3.4).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Action {
    /// Group 0: codes without a mode.
    NonModal(NonModal),
    /// Group 1: motion.
    Motion(MotionMode),
    /// Group 2: the plane.
    Plane(Plane),
    /// Group 3: the distance mode.
    Distance(Distance),
    /// Group 4: the distance mode of I, J and K.
    ArcDistance(ArcDistance),
    /// Group 5: the feed mode.
    FeedMode(FeedMode),
    /// Group 6: the units.
    Units(Units),
    /// Group 7: cutter compensation off.
    CutterOff,
    /// Group 7: cutter compensation on, which is not supported.
    CutterOn,
    /// Group 8: the tool length.
    ToolLength(ToolLength),
    /// Group 10: the retract level of canned cycles.
    Retract(Retract),
    /// Group 12: the coordinate system, 0 to 8.
    System(u8),
    /// Group 13: the path mode.
    Path(PathMode),
    /// Group 14: the meaning of S.
    SpeedMode(SpeedMode),
    /// Group 15: the meaning of X.
    XMode(XMode),
    /// Group 4 of the M codes: program stops.
    Stop(StopCode),
    /// Group 6 of the M codes: the tool change.
    ToolChange,
    /// Group 7 of the M codes: the spindle.
    Spindle(Turn),
    /// Group 8 of the M codes: coolant.
    Coolant(Coolant),
    /// Group 9 of the M codes: overrides.
    Override(OverrideCode),
}

/// Group 0: codes that are in force for one line only.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NonModal {
    /// G4.
    Dwell,
    /// G10.
    SetData,
    /// G28, G30: moves to the first (0) or second (1) stored position.
    GoStored(u8),
    /// G28.1, G30.1: stores the first (0) or second (1) position.
    Store(u8),
    /// G28.2, and G28.4, which does not set the position.
    Home {
        /// Whether the position is set to what the switches say.
        set: bool,
    },
    /// G28.3.
    SetPosition,
    /// G53.
    MachineCoordinates,
    /// G92.
    SetOffset,
    /// G92.1.
    ClearOffset,
    /// G92.2.
    SuspendOffset,
    /// G92.3.
    ResumeOffset,
    /// M104 to M190.
    Heat(HeatCode),
}

/// The codes for heaters and fans.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum HeatCode {
    /// M104.
    SetHotEnd,
    /// M109.
    ReachHotEnd,
    /// M140.
    SetBed,
    /// M190.
    ReachBed,
    /// M116.
    ReachAll,
    /// M106.
    Fan,
    /// M107.
    FanOff,
}

/// Group 8: the tool length.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ToolLength {
    /// G43: the lengths of a tool in the table.
    Table,
    /// G43.1: the lengths in the axis words.
    Words,
    /// G43.2: adds the lengths of a tool in the table.
    Add,
    /// G49: no tool length.
    Off,
}

/// Group 4 of the M codes: stops.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StopCode {
    /// M0, M60.
    Program,
    /// M1.
    Optional,
    /// M2, M30.
    End,
}

/// Group 9 of the M codes: overrides.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OverrideCode {
    /// M48 switches all overrides on, M49 off.
    All(bool),
    /// M48.1, M49.1, M50; M48.2, M49.2, M50.1; M51: these set one override.
    One(Override, Switch),
}

/// How one override is set.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Switch {
    /// The factor is set to P, which has to be present.
    To,
    /// The factor is set to P. P0 switches the override off, and no P switches it on.
    Maybe,
    /// The override is switched off.
    Off,
}

/// A row of the tables: one code.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Code {
    /// The number of the code in tenths: 283 for G28.3.
    pub number: u16,
    /// What the code does.
    pub action: Action,
    /// The words that the code may use, as a set.
    pub takes: u32,
    /// The words that the code needs, as a set. If the set has axes, the code needs at least one of them.
    pub needs: u32,
}

/// Returns the row of the G code `whole`.`tenth`. `None` if there is no such code.
pub fn g(whole: u16, tenth: u8) -> Option<Code> {
    find(&G, &G_START, whole, tenth)
}

/// Returns the row of the M code `whole`.`tenth`. `None` if there is no such code.
pub fn m(whole: u16, tenth: u8) -> Option<Code> {
    find(&M, &M_START, whole, tenth)
}

/// Returns the words that the code of a motion mode takes, whether the code is on the line or in force.
pub fn taken_by(mode: MotionMode) -> u32 {
    MOTION.at(mode as usize).unwrap_or(0)
}

/// Looks a code up. `whole` is at most 999. Cost on AVR: 60 cycles, and 9 for each byte of the row. From [`DENSE`] on
/// each row before that of the code costs as much again.
fn find<const N: usize>(
    table: &Progmem<[Code; N]>,
    starts: &Progmem<[u8; STARTS]>,
    whole: u16,
    tenth: u8,
) -> Option<Code> {
    let number = whole * 10 + u16::from(tenth);
    let mut index = usize::from(starts.at(usize::from(whole.min(DENSE)))?);
    loop {
        let row = table.at(index)?;
        if row.number >= number {
            return (row.number == number).then_some(row);
        }
        index += 1;
    }
}
