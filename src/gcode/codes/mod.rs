//! The language: every G and M code, what it does, and the words it takes and needs.
//!
//! A new code is a row of [`table`] and a text of [`docs`], from which `docs/gcode.md` is made.

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
    /// Group 0.
    NonModal(NonModal),
    /// Group 1.
    Motion(MotionMode),
    /// Group 2.
    Plane(Plane),
    /// Group 3.
    Distance(Distance),
    /// Group 4.
    ArcDistance(ArcDistance),
    /// Group 5.
    FeedMode(FeedMode),
    /// Group 6.
    Units(Units),
    /// Group 7: off.
    CutterOff,
    /// Group 7: on, which this machine has not.
    CutterOn,
    /// Group 8.
    ToolLength(ToolLength),
    /// Group 10.
    Retract(Retract),
    /// Group 12: 0 to 8.
    System(u8),
    /// Group 13.
    Path(PathMode),
    /// Group 14: what S is. G96: a surface speed.
    SpeedMode(SpeedMode),
    /// Group 15: what X is.
    XMode(XMode),
    /// Group 4 of the M codes.
    Stop(StopCode),
    /// Group 6 of the M codes.
    ToolChange,
    /// Group 7 of the M codes.
    Spindle(Turn),
    /// Group 8 of the M codes.
    Coolant(Coolant),
    /// Group 9 of the M codes.
    Override(OverrideCode),
}

/// Group 0: for one line only.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NonModal {
    /// G4.
    Dwell,
    /// G10.
    SetData,
    /// G28, G30: to the first or second stored position.
    GoStored(u8),
    /// G28.1, G30.1.
    Store(u8),
    /// G28.2, and G28.4, which leaves the position alone.
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

/// Heaters and fans.
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

/// Group 8.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ToolLength {
    /// G43.
    Table,
    /// G43.1.
    Words,
    /// G43.2.
    Add,
    /// G49.
    Off,
}

/// Group 4 of the M codes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StopCode {
    /// M0, M60.
    Program,
    /// M1.
    Optional,
    /// M2, M30.
    End,
}

/// Group 9 of the M codes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OverrideCode {
    /// M48, M49: all of them on or off.
    All(bool),
    /// M48.1, M49.1, M50; M48.2, M49.2, M50.1; M51: of one.
    One(Override, Switch),
}

/// How one override is set.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Switch {
    /// To P, which has to be there.
    To,
    /// To P, off for P0, on without P.
    Maybe,
    /// Off.
    Off,
}

/// A row of the tables.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Code {
    /// The number of the code in tenths: 283 for G28.3.
    pub number: u16,
    /// What it does.
    pub action: Action,
    /// The words it may use, as a set.
    pub takes: u32,
    /// The words that the code cannot be without, as bits; for axes, at least one of them.
    pub needs: u32,
}

/// G code `whole`.`tenth`.
pub fn g(whole: u16, tenth: u8) -> Option<Code> {
    find(&G, &G_START, whole, tenth)
}

/// M code `whole`.`tenth`.
pub fn m(whole: u16, tenth: u8) -> Option<Code> {
    find(&M, &M_START, whole, tenth)
}

/// The words that the code of a motion mode takes, whether it is on the line or in force.
pub fn taken_by(mode: MotionMode) -> u32 {
    MOTION.at(mode as usize).unwrap_or(0)
}

/// Looks a code up; `whole` is at most 999. Cost on AVR: 60 cycles, and 9 for each byte of the row; from [`DENSE`] on the
/// same for each row before it.
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
