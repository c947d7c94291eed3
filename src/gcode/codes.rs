//! The language: every G and M code, and what it does. A new code is a row here.
//!
//! The variant of an [`Action`] is the modal group of the code: a line may carry one of each.

use super::command::Stop;
use super::modal::{Distance, FeedMode, MotionMode, PathMode, Plane, Units};
use crate::progmem::Progmem;

/// What a code does, by modal group (RS274/NGC section 3.4).
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
    /// Group 5.
    FeedMode(FeedMode),
    /// Group 6.
    Units(Units),
    /// Group 13.
    Path(PathMode),
    /// Groups in which this machine has one mode, so that selecting it changes nothing.
    Only(OnlyMode),
    /// Group 4, M codes.
    Stop(Stop),
}

/// Group 0: for one line only.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NonModal {
    /// G4.
    Dwell,
    /// G28.3.
    SetPosition,
    /// G92.
    SetOffset,
    /// G92.1.
    ClearOffset,
}

impl NonModal {
    /// Whether the axis words of the line belong to it.
    pub fn uses_axes(self) -> bool {
        matches!(self, NonModal::SetPosition | NonModal::SetOffset)
    }
}

/// Codes that name the only mode of their group.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum OnlyMode {
    /// Group 7, G40: no cutter compensation.
    Cutter = 1,
    /// Group 8, G49: no tool length offset.
    ToolLength = 2,
    /// Group 12, G54: the coordinate system.
    Coordinates = 4,
}

/// A row: the number of the code in tenths, and what it does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Code {
    number: u16,
    action: Action,
}

const fn code(number: u16, action: Action) -> Code {
    Code { number, action }
}

/// G codes, by number.
const G_ROWS: [Code; 24] = [
    code(0, Action::Motion(MotionMode::Traverse)),
    code(10, Action::Motion(MotionMode::Feed)),
    code(20, Action::Motion(MotionMode::ClockwiseArc)),
    code(30, Action::Motion(MotionMode::CounterclockwiseArc)),
    code(40, Action::NonModal(NonModal::Dwell)),
    code(170, Action::Plane(Plane::Xy)),
    code(180, Action::Plane(Plane::Zx)),
    code(190, Action::Plane(Plane::Yz)),
    code(200, Action::Units(Units::Inch)),
    code(210, Action::Units(Units::Mm)),
    code(283, Action::NonModal(NonModal::SetPosition)),
    code(400, Action::Only(OnlyMode::Cutter)),
    code(490, Action::Only(OnlyMode::ToolLength)),
    code(540, Action::Only(OnlyMode::Coordinates)),
    code(610, Action::Path(PathMode::Exact)),
    code(611, Action::Path(PathMode::ExactStop)),
    code(640, Action::Path(PathMode::Continuous)),
    code(800, Action::Motion(MotionMode::None)),
    code(900, Action::Distance(Distance::Absolute)),
    code(910, Action::Distance(Distance::Incremental)),
    code(920, Action::NonModal(NonModal::SetOffset)),
    code(921, Action::NonModal(NonModal::ClearOffset)),
    code(930, Action::FeedMode(FeedMode::InverseTime)),
    code(940, Action::FeedMode(FeedMode::PerMinute)),
];

/// M codes, by number.
const M_ROWS: [Code; 5] = [
    code(0, Action::Stop(Stop::Program)),
    code(10, Action::Stop(Stop::Program)),
    code(20, Action::Stop(Stop::End)),
    code(300, Action::Stop(Stop::End)),
    code(600, Action::Stop(Stop::Program)),
];

crate::progmem! {
    static G: [Code; G_ROWS.len()] = G_ROWS;
    static M: [Code; M_ROWS.len()] = M_ROWS;
}

crate::progmem! {
    /// For each whole number, the first row of that number or a greater one.
    static G_START: [u8; 101] = starts(&G_ROWS);
    /// The same for M codes.
    static M_START: [u8; 101] = starts(&M_ROWS);
}

const fn starts<const N: usize>(rows: &[Code; N]) -> [u8; 101] {
    let mut starts = [0; 101];
    let mut whole = 0;
    while whole <= 100 {
        let mut row = 0;
        while row < N && rows[row].number < 10 * whole {
            row += 1;
        }
        starts[whole as usize] = row as u8;
        whole += 1;
    }
    starts
}

/// What G code `whole`.`tenth` does.
pub fn g(whole: u8, tenth: u8) -> Option<Action> {
    find(&G, &G_START, whole, tenth)
}

/// What M code `whole`.`tenth` does.
pub fn m(whole: u8, tenth: u8) -> Option<Action> {
    find(&M, &M_START, whole, tenth)
}

/// Looks a code up. Cost on AVR: 60 cycles.
fn find<const N: usize>(
    table: &Progmem<[Code; N]>,
    starts: &Progmem<[u8; 101]>,
    whole: u8,
    tenth: u8,
) -> Option<Action> {
    let number = u16::from(whole) * 10 + u16::from(tenth);
    let mut index = usize::from(starts.at(whole.into())?);
    loop {
        let row = table.at(index)?;
        if row.number >= number {
            return (row.number == number).then_some(row.action);
        }
        index += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_sorted() {
        assert!(G.get().is_sorted_by_key(|row| row.number));
        assert!(M.get().is_sorted_by_key(|row| row.number));
    }

    #[test]
    fn every_row_is_found_and_nothing_else() {
        let rows = G.get();
        for number in 0..2_560u16 {
            let row = rows.iter().find(|row| row.number == number);
            let found = g((number / 10) as u8, (number % 10) as u8);
            assert_eq!(found, row.map(|row| row.action), "{number}");
        }
        assert_eq!(m(30, 0), Some(Action::Stop(Stop::End)));
        assert_eq!(m(3, 0), None);
    }
}
