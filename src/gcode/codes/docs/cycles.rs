//! Canned cycles that drill, and the refusals that all canned cycles share.

use super::{On, Section, g, no, no_on};
use crate::status::Status::{
    AxisDisabled, AxisTargetMissing, AxisWordMissing, FeedrateMissing, InverseTimeNotAllowed,
    LWordInvalid, PWordMissing, PWordNegative, QWordInvalid, QWordMissing, RWordInvalid,
    RWordMissing, RotaryNotAllowed, SWordMissing, SpindleMustTurn,
};

/// The refusals of a canned cycle: those that all cycles share, and those of this cycle (`$own`). With the words
/// `$more` the line of the cycle is complete. Some cycles need `$begin`, which switches the spindle on.
macro_rules! cycle {
    ($code:literal, $begin:literal, $more:literal $(, $own:expr)*) => {
        &[
            no(AxisWordMissing, &[$begin, concat!($code, " R1 F100")]),
            no(RotaryNotAllowed, &[$begin, concat!($code, $more, " A1 Z-1 R1 F100")]),
            no_on(On::DisabledX, AxisDisabled, &[$begin, concat!($code, $more, " Z-1 R1 F100")]),
            no(InverseTimeNotAllowed, &[$begin, "G93", concat!($code, $more, " Z-1 R1 F100")]),
            no(RWordMissing, &[$begin, concat!($code, $more, " Z-1 F100")]),
            no(AxisTargetMissing, &[$begin, concat!($code, $more, " X1 R1 F100")]),
            no(RWordInvalid, &[$begin, concat!($code, $more, " Z-1 R-2 F100")]),
            no(LWordInvalid, &[$begin, concat!($code, $more, " Z-1 R1 L0 F100")]),
            no(FeedrateMissing, &[$begin, concat!($code, $more, " Z-1 R1")]),
            $($own,)*
        ]
    };
}
pub(super) use cycle;

/// The refusal with G95, which needs a turning spindle, of a cycle that otherwise does not need one.
macro_rules! per_turn {
    ($code:literal, $more:literal) => {
        no(SpindleMustTurn, &["G95 F0.1", concat!($code, $more, " Z-1 R1")])
    };
}
pub(super) use per_turn;

/// The refusal of any cycle with G95 and without a spindle speed.
macro_rules! speed {
    ($code:literal, $more:literal) => {
        no(SWordMissing, &["M3 G95 F0.1", concat!($code, $more, " Z-1 R1")])
    };
}
pub(super) use speed;

pub const CYCLES: Section = Section {
    title: "Canned cycles: drilling",
    intro: "A canned cycle makes one or more holes along the axis perpendicular to the active plane. This axis is called Z \
below, the others X and Y. The tool moves by rapids: up to R if it is below, over the hole, down to R. Then the \
moves of the cycle follow. Last the tool retracts: with G98 to the initial level if that is above R, else to R. \
R, Z, P, Q, I, J and K stay active as long as the same cycle continues, so that a line with only X or Y makes \
another hole. L is the number of holes: with G91 X and Y advance at each hole, with G90 all holes are at one \
place. With G91 R is relative to the present height, and Z to R. P is in seconds. The line needs at least one of \
X, Y and Z. Modal.",
    docs: &[
        g(
            730,
            "Drilling cycle with chip breaking",
            "Feeds down by Q, retracts by 0.254 mm to break the chip, and repeats this to Z. Retracts by rapid.",
            cycle!(
                "G73",
                "",
                " Q1",
                per_turn!("G73", " Q1"),
                speed!("G73", " Q1"),
                no(QWordMissing, &["G73 Z-1 R1 F100"]),
                no(QWordInvalid, &["G73 Z-1 R1 Q0 F100"])
            ),
        ),
        g(
            810,
            "Drilling cycle",
            "Feeds to Z. Retracts by rapid.",
            cycle!("G81", "", "", per_turn!("G81", ""), speed!("G81", "")),
        ),
        g(
            820,
            "Drilling cycle with dwell",
            "Feeds to Z and dwells for P. Retracts by rapid.",
            cycle!(
                "G82",
                "",
                " P1",
                per_turn!("G82", " P1"),
                speed!("G82", " P1"),
                no(PWordMissing, &["G82 Z-1 R1 F100"]),
                no(PWordNegative, &["G82 Z-1 R1 P-1 F100"])
            ),
        ),
        g(
            830,
            "Peck drilling cycle",
            "Feeds down by Q, retracts to R by rapid, returns by rapid to 0.254 mm above the last depth, and repeats this to \
Z. Retracts by rapid.",
            cycle!(
                "G83",
                "",
                " Q1",
                per_turn!("G83", " Q1"),
                speed!("G83", " Q1"),
                no(QWordMissing, &["G83 Z-1 R1 F100"]),
                no(QWordInvalid, &["G83 Z-1 R1 Q-1 F100"])
            ),
        ),
        g(
            980,
            "Canned cycles retract to initial level",
            "The initial level is the height before the first cycle of a series. If it is below R, cycles retract to R. \
Modal. Active at power-up and after M2.",
            &[],
        ),
        g(990, "Canned cycles retract to R", "Modal.", &[]),
    ],
};
