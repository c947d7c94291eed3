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
    intro: "One or more holes along the axis across the plane in force; what follows calls it Z, and the others X \
and Y. Up to R if the tool is below, over the hole, down to R, then what the cycle does, and last up: with \
G98 to where the tool was before the series if that is above R, else to R. R, Z, P, Q and I J K stay in force \
from line to line for as long as the same cycle goes on, so that a line with X or Y alone makes another hole. L \
holes: with G91 each X and Y further on, with G90 all at one place. With G91 R is measured from the present \
height, and Z from R. P is in seconds. At least one of X, Y and Z has to be on the line. A cycle stays in force \
until another code of the group of motions.",
    docs: &[
        g(
            730,
            "Break chips",
            "Feeds by Q, backs up by 0.254 mm to break the chip, and so on to Z; up by traverse.",
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
            "Drill",
            "Feeds to Z; up by traverse.",
            cycle!("G81", "", "", per_turn!("G81", ""), speed!("G81", "")),
        ),
        g(
            820,
            "Drill with dwell",
            "Feeds to Z, dwells for P; up by traverse.",
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
            "Drill in pecks",
            "Feeds by Q, traverses up to R and down again to 0.254 mm above the bottom so far, and so on to Z; up \
by traverse.",
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
            "Cycles end where they began",
            "At the height before the first cycle of a series, if that is above R. Stays in force; in force at \
power-up and after M2.",
            &[],
        ),
        g(990, "Cycles end at R", "Stays in force.", &[]),
    ],
};
