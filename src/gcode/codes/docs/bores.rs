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
    intro: "Words and levels are as in the drilling cycles.",
    docs: &[
        g(
            840,
            "Tapping cycle",
            "Feeds to Z, reverses the spindle, dwells for P if given, feeds up, and reverses the spindle again. The spindle \
must turn clockwise. Feed and spindle are not synchronized: use a floating tap holder. F must be S times the \
pitch, with G95 the pitch.",
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
            "Boring cycle",
            "Feeds to Z and feeds up.",
            cycle!("G85", "", "", per_turn!("G85", ""), speed!("G85", "")),
        ),
        g(
            860,
            "Boring cycle, spindle stop, rapid out",
            "Feeds to Z, dwells for P, stops the spindle, retracts by rapid, and restarts the spindle. The spindle must turn.",
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
            "Back boring cycle",
            "Moves aside by I and J, stops the spindle, moves down to Z and back under the hole. Then starts the spindle, \
feeds up to K and down to Z. Then stops the spindle, moves aside, up and back, and restarts the spindle. With \
G91 K is relative to Z. The spindle must turn.",
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
            "Boring cycle, spindle stop, program stop",
            "Feeds to Z, dwells for P, stops the spindle, and stops as M0 does, so that you can take the tool out by hand. \
With `psw` 0 it does not wait. Retracts by rapid and restarts the spindle. The spindle must turn.",
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
            "Boring cycle with dwell",
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
