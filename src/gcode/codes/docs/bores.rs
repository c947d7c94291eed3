//! Canned cycles that tap and bore.

use super::cycles::{cycle, per_turn, speed};
use super::{On, Section, g, no, no_on};
use crate::status::Status::{
    ArcOffsetsMissing, AxisDisabled, AxisInvalid, AxisTargetMissing, AxisWordMissing,
    FeedrateMissing, InverseTimeNotAllowed, LWordInvalid, PWordMissing, PWordNegative,
    RWordInvalid, RWordMissing, RotaryNotAllowed, SWordMissing, SpindleMustTurn,
};

pub const BORES: Section = Section {
    title: "Canned cycles: tapping and boring",
    intro: "Words and levels are those of the drilling cycles.",
    docs: &[
        g(
            840,
            "Tap",
            "Feeds to Z, turns the spindle the other way round, dwells for P if there is one, feeds up, and turns it \
as before. The spindle has to turn clockwise. Feed and spindle are not synchronised: the tap needs a floating holder, and F is S times the \
pitch (or with G95 the pitch).",
            cycle!(
                "G84",
                "M3",
                "",
                speed!("G84", ""),
                no(SpindleMustTurn, &["G84 Z-1 R1 F100"]),
                no(SpindleMustTurn, &["M4", "G84 Z-1 R1 F100"]),
                no(PWordNegative, &["M3", "G84 Z-1 R1 P-1 F100"])
            ),
        ),
        g(
            850,
            "Bore",
            "Feeds to Z and feeds up.",
            cycle!("G85", "", "", per_turn!("G85", ""), speed!("G85", "")),
        ),
        g(
            860,
            "Bore, spindle stop, up by traverse",
            "Feeds to Z, dwells for P, stops the spindle, goes up by traverse, and turns it as before. The spindle \
has to turn.",
            cycle!(
                "G86",
                "M3",
                " P1",
                speed!("G86", " P1"),
                no(SpindleMustTurn, &["G86 Z-1 R1 P1 F100"]),
                no(PWordMissing, &["M3", "G86 Z-1 R1 F100"]),
                no(PWordNegative, &["M3", "G86 Z-1 R1 P-1 F100"])
            ),
        ),
        g(
            870,
            "Back bore",
            "With the spindle still, goes aside by I and J, down to Z and back under the hole; with it on, feeds up \
to K and down to Z; with it still again, goes aside, up and back, and turns it as before. With G91 K is measured \
from Z. The spindle has to turn.",
            cycle!(
                "G87",
                "M3",
                " I1 J0 K0",
                speed!("G87", " I1 J0 K0"),
                no(SpindleMustTurn, &["G87 Z-1 R1 I1 J0 K0 F100"]),
                no(ArcOffsetsMissing, &["M3", "G87 Z-1 R1 I1 K0 F100"]),
                no(AxisInvalid, &["M3", "G87 Z-1 R1 I1 J0 K-2 F100"])
            ),
        ),
        g(
            880,
            "Bore, spindle stop, up by hand",
            "Feeds to Z, dwells for P, stops the spindle, and stops as M0 does, for a hand to take the tool out \
(unless `psw` is 0); then goes up by traverse, and turns it as before. The spindle has to turn.",
            cycle!(
                "G88",
                "M3",
                " P1",
                speed!("G88", " P1"),
                no(SpindleMustTurn, &["G88 Z-1 R1 P1 F100"]),
                no(PWordMissing, &["M3", "G88 Z-1 R1 F100"]),
                no(PWordNegative, &["M3", "G88 Z-1 R1 P-1 F100"])
            ),
        ),
        g(
            890,
            "Bore with dwell",
            "Feeds to Z, dwells for P, and feeds up.",
            cycle!(
                "G89",
                "",
                " P1",
                per_turn!("G89", " P1"),
                speed!("G89", " P1"),
                no(PWordMissing, &["G89 Z-1 R1 F100"]),
                no(PWordNegative, &["G89 Z-1 R1 P-1 F100"])
            ),
        ),
    ],
};
