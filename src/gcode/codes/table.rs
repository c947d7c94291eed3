//! The tables of all G and M codes.

use super::{Action, Code, HeatCode, NonModal, OverrideCode, StopCode, Switch, ToolLength};
use crate::gcode::modal::{
    ArcDistance, Coolant, Distance, FeedMode, MotionMode, PathMode, Plane, Retract, SpeedMode,
    Turn, Units, XMode,
};
use crate::gcode::overrides::Override;
use crate::gcode::words::{self, AXES, D, E, H, K, L, OFFSETS, P, Q, R, S, T, bit};

/// Returns a row for a code without words of its own.
const fn code(number: u16, action: Action) -> Code {
    Code { number, action, takes: 0, needs: 0 }
}

/// Returns a row for a code that may have the words `takes`.
const fn with(number: u16, action: Action, takes: u32) -> Code {
    Code { number, action, takes, needs: 0 }
}

/// Returns a row for a code that needs the words `needs`, and may have the words `also`.
const fn needing(number: u16, action: Action, needs: u32, also: u32) -> Code {
    Code { number, action, takes: needs | also, needs }
}

/// Returns a row for a canned cycle. It needs no words here, because its words stay in force from line to line.
const fn cycle(number: u16, mode: MotionMode, also: u32) -> Code {
    with(number, Action::Motion(mode), AXES | bit(R) | bit(L) | also)
}

const fn probe(number: u16, mode: MotionMode) -> Code {
    needing(number, Action::Motion(mode), AXES, 0)
}

/// Returns a row for a threading pass. K does not stay in force: a line without the code, while it is in force, needs K
/// too. `State::thread` checks this.
const fn thread(number: u16, mode: MotionMode) -> Code {
    with(number, Action::Motion(mode), AXES | bit(K))
}

/// Returns a row for a threading cycle. Its words do not stay in force: a line without the code, while it is in force,
/// needs them too. `State::thread_cycle` checks this.
const fn thread_cycle(number: u16) -> Code {
    let words = Z_WORD | OFFSETS | bit(P) | bit(R) | bit(Q) | bit(H) | bit(E) | bit(L);
    with(number, Action::Motion(MotionMode::ThreadCycle), words)
}

/// The set of Z.
const Z_WORD: u32 = 1 << 2;

const ARC: u32 = AXES | OFFSETS | bit(R) | bit(P);

/// From this whole number on there are few codes. They have no entries in the tables of first rows, and are searched
/// one after the other.
pub const DENSE: u16 = 100;
/// The number of entries in the tables of first rows.
pub const STARTS: usize = DENSE as usize + 1;

/// The number of G codes.
pub const G_ROWS: usize = 74;
/// The number of M codes.
pub const M_ROWS: usize = 28;

crate::progmem! {
    /// The G codes, by number.
    pub static G: [Code; G_ROWS] = G_TABLE;
    /// The M codes, by number.
    pub static M: [Code; M_ROWS] = M_TABLE;
    /// For each whole number up to [`DENSE`], where the search for a G code of that number begins: its first row, or that
    /// of the next code, or the row before: see [`starts`].
    pub static G_START: [u8; STARTS] = starts(&G_TABLE);
    /// For each whole number up to [`DENSE`], where the search for an M code of that number begins, as for the G codes.
    pub static M_START: [u8; STARTS] = starts(&M_TABLE);
    /// The words that the code of each motion mode takes.
    pub static MOTION: [u32; MotionMode::COUNT] = motions();
}

const G_TABLE: [Code; G_ROWS] = [
    with(0, Action::Motion(MotionMode::Traverse), AXES),
    with(10, Action::Motion(MotionMode::Feed), AXES),
    with(20, Action::Motion(MotionMode::ClockwiseArc), ARC),
    with(30, Action::Motion(MotionMode::CounterclockwiseArc), ARC),
    needing(40, Action::NonModal(NonModal::Dwell), bit(P), 0),
    code(70, Action::XMode(XMode::Diameter)),
    code(80, Action::XMode(XMode::Radius)),
    needing(100, Action::NonModal(NonModal::SetData), bit(L) | bit(P) | AXES, 0),
    code(170, Action::Plane(Plane::Xy)),
    code(180, Action::Plane(Plane::Zx)),
    code(190, Action::Plane(Plane::Yz)),
    code(200, Action::Units(Units::Inch)),
    code(210, Action::Units(Units::Mm)),
    with(280, Action::NonModal(NonModal::GoStored(0)), AXES),
    code(281, Action::NonModal(NonModal::Store(0))),
    needing(282, Action::NonModal(NonModal::Home { set: true }), AXES, 0),
    needing(283, Action::NonModal(NonModal::SetPosition), AXES, 0),
    needing(284, Action::NonModal(NonModal::Home { set: false }), AXES, 0),
    with(300, Action::NonModal(NonModal::GoStored(1)), AXES),
    code(301, Action::NonModal(NonModal::Store(1))),
    thread(320, MotionMode::Thread),
    thread(330, MotionMode::Thread),
    thread(331, MotionMode::RigidTap),
    probe(382, MotionMode::ProbeTowards),
    probe(383, MotionMode::ProbeTowardsQuietly),
    probe(384, MotionMode::ProbeAway),
    probe(385, MotionMode::ProbeAwayQuietly),
    code(400, Action::CutterOff),
    code(410, Action::CutterOn),
    code(420, Action::CutterOn),
    with(430, Action::ToolLength(ToolLength::Table), bit(H)),
    needing(431, Action::ToolLength(ToolLength::Words), AXES, 0),
    needing(432, Action::ToolLength(ToolLength::Add), bit(H), 0),
    code(490, Action::ToolLength(ToolLength::Off)),
    code(530, Action::NonModal(NonModal::MachineCoordinates)),
    code(540, Action::System(0)),
    code(550, Action::System(1)),
    code(560, Action::System(2)),
    code(570, Action::System(3)),
    code(580, Action::System(4)),
    code(590, Action::System(5)),
    code(591, Action::System(6)),
    code(592, Action::System(7)),
    code(593, Action::System(8)),
    code(610, Action::Path(PathMode::Exact)),
    code(611, Action::Path(PathMode::ExactStop)),
    with(640, Action::Path(PathMode::Continuous), bit(P)),
    cycle(730, MotionMode::ChipBreak, bit(Q)),
    thread_cycle(760),
    code(800, Action::Motion(MotionMode::None)),
    cycle(810, MotionMode::Drill, 0),
    cycle(820, MotionMode::DrillDwell, bit(P)),
    cycle(830, MotionMode::PeckDrill, bit(Q)),
    cycle(840, MotionMode::Tap, bit(P)),
    cycle(850, MotionMode::Bore, 0),
    cycle(860, MotionMode::BoreStop, bit(P)),
    cycle(870, MotionMode::BackBore, OFFSETS),
    cycle(880, MotionMode::BoreByHand, bit(P)),
    cycle(890, MotionMode::BoreDwell, bit(P)),
    code(900, Action::Distance(Distance::Absolute)),
    code(901, Action::ArcDistance(ArcDistance::Absolute)),
    code(910, Action::Distance(Distance::Incremental)),
    code(911, Action::ArcDistance(ArcDistance::Incremental)),
    needing(920, Action::NonModal(NonModal::SetOffset), AXES, 0),
    code(921, Action::NonModal(NonModal::ClearOffset)),
    code(922, Action::NonModal(NonModal::SuspendOffset)),
    code(923, Action::NonModal(NonModal::ResumeOffset)),
    code(930, Action::FeedMode(FeedMode::InverseTime)),
    code(940, Action::FeedMode(FeedMode::PerMinute)),
    code(950, Action::FeedMode(FeedMode::PerTurn)),
    needing(960, Action::SpeedMode(SpeedMode::Surface), bit(S), bit(D)),
    code(970, Action::SpeedMode(SpeedMode::Turns)),
    code(980, Action::Retract(Retract::Initial)),
    code(990, Action::Retract(Retract::ToR)),
];

const fn set(what: Override, how: Switch) -> Action {
    Action::Override(OverrideCode::One(what, how))
}

const M_TABLE: [Code; M_ROWS] = [
    code(0, Action::Stop(StopCode::Program)),
    code(10, Action::Stop(StopCode::Optional)),
    code(20, Action::Stop(StopCode::End)),
    code(30, Action::Spindle(Turn::Clockwise)),
    code(40, Action::Spindle(Turn::Counterclockwise)),
    code(50, Action::Spindle(Turn::Off)),
    code(60, Action::ToolChange),
    code(70, Action::Coolant(Coolant::Mist)),
    code(80, Action::Coolant(Coolant::Flood)),
    code(90, Action::Coolant(Coolant::Off)),
    code(300, Action::Stop(StopCode::End)),
    code(480, Action::Override(OverrideCode::All(true))),
    needing(481, set(Override::Feed, Switch::To), bit(P), 0),
    needing(482, set(Override::Traverse, Switch::To), bit(P), 0),
    code(490, Action::Override(OverrideCode::All(false))),
    code(491, set(Override::Feed, Switch::Off)),
    code(492, set(Override::Traverse, Switch::Off)),
    with(500, set(Override::Feed, Switch::Maybe), bit(P)),
    with(501, set(Override::Traverse, Switch::Maybe), bit(P)),
    with(510, set(Override::Spindle, Switch::Maybe), bit(P)),
    code(600, Action::Stop(StopCode::Program)),
    heat(1_040, HeatCode::SetHotEnd, bit(S) | bit(T)),
    heat(1_060, HeatCode::Fan, bit(S) | bit(P)),
    heat(1_070, HeatCode::FanOff, bit(P)),
    heat(1_090, HeatCode::ReachHotEnd, bit(S) | bit(R) | bit(T)),
    heat(1_160, HeatCode::ReachAll, 0),
    heat(1_400, HeatCode::SetBed, bit(S)),
    heat(1_900, HeatCode::ReachBed, bit(S) | bit(R)),
];

const fn heat(number: u16, code: HeatCode, takes: u32) -> Code {
    with(number, Action::NonModal(NonModal::Heat(code)), takes)
}

/// Boot loaders of 2011 take three of this byte, `!`, in a row in an image for a command, and cannot flash the image.
const MARK: u8 = b'!';

/// Returns where the search for each whole number begins. Where that would make three times [`MARK`] in a row, the third
/// search begins one row earlier, which takes a little longer and finds the same.
const fn starts<const N: usize>(rows: &[Code; N]) -> [u8; STARTS] {
    assert!(N <= u8::MAX as usize, "more rows than a byte can count: make the starts `u16`");
    let mut starts = [0; STARTS];
    let mut whole = 0;
    while whole <= DENSE {
        let mut row = 0;
        while row < N && rows[row].number < 10 * whole {
            row += 1;
        }
        let at = whole as usize;
        starts[at] = row as u8;
        if at >= 2 && starts[at] == MARK && starts[at - 1] == MARK && starts[at - 2] == MARK {
            starts[at] -= 1;
        }
        whole += 1;
    }
    starts
}

const fn motions() -> [u32; MotionMode::COUNT] {
    let mut taken = [0; MotionMode::COUNT];
    let mut row = 0;
    while row < G_ROWS {
        if let Action::Motion(mode) = G_TABLE[row].action {
            taken[mode as usize] = G_TABLE[row].takes;
        }
        row += 1;
    }
    taken
}

/// Checks that each word is taken by some code. A word that no code takes would be refused on every line.
const _: () = {
    let mut taken = words::ALWAYS;
    let mut row = 0;
    while row < G_ROWS {
        taken |= G_TABLE[row].takes;
        row += 1;
    }
    assert!(taken == (1 << words::COUNT) - 1);
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::codes::{find, g, m};

    #[test]
    fn tables_are_sorted() {
        assert!(G.get().is_sorted_by_key(|row| row.number));
        assert!(M.get().is_sorted_by_key(|row| row.number));
    }

    #[test]
    fn every_row_is_found_and_nothing_else() {
        for number in 0..10_000u16 {
            let (whole, tenth) = (number / 10, (number % 10) as u8);
            let of = |rows: &[Code]| rows.iter().find(|row| row.number == number).copied();
            assert_eq!(g(whole, tenth), of(&G.get()), "G{whole}.{tenth}");
            assert_eq!(m(whole, tenth), of(&M.get()), "M{whole}.{tenth}");
        }
    }

    const HIGH_TABLE: [Code; 5] = [
        code(990, Action::Stop(StopCode::Program)),
        code(1_000, Action::Stop(StopCode::Optional)),
        code(1_040, Action::Stop(StopCode::End)),
        with(1_095, Action::Stop(StopCode::Program), bit(P)),
        code(9_999, Action::Stop(StopCode::Optional)),
    ];

    crate::progmem! {
        static HIGH: [Code; 5] = HIGH_TABLE;
        static HIGH_START: [u8; STARTS] = starts(&HIGH_TABLE);
    }

    #[test]
    fn codes_go_up_to_999() {
        for number in 0..10_000u16 {
            let found = find(&HIGH, &HIGH_START, number / 10, (number % 10) as u8);
            assert_eq!(found, HIGH_TABLE.iter().find(|row| row.number == number).copied());
        }
    }
}
