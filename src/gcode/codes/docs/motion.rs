//! Moves, arcs, probing.

use super::{On, Section, g, no, no_on};
use crate::status::Status::{
    ArcAxisMissing, ArcEndpointIsStart, ArcOffsetsMissing, ArcRadiusTolerance, ArcSpecification,
    AxisDisabled, AxisNotAllowed, AxisWordMissing, FeedrateMissing, HWordInvalid,
    InverseTimeNotAllowed, KWordInvalid, KWordMissing, LWordInvalid, NoEncoder, OutOfRange,
    PWordInvalid, PWordMissing, PWordNegative, ProbeFailed, ProbeTooShort, QWordInvalid,
    RWordInvalid, RotaryNotAllowed, SWordMissing, SpindleMustTurn,
};

/// The refusals of an arc.
macro_rules! arc {
    ($code:literal) => {
        &[
            no(FeedrateMissing, &[concat!($code, " X1 I1")]),
            no(SpindleMustTurn, &["G95 F0.1", concat!($code, " X2 I1")]),
            no(SWordMissing, &["M3 G95 F0.1", concat!($code, " X2 I1")]),
            no_on(On::DisabledX, AxisDisabled, &[concat!($code, " Y2 J1 F100")]),
            no(ArcSpecification, &[concat!($code, " X2 R1 I1 F100")]),
            no(ArcSpecification, &[concat!($code, " X2 I1 K1 F100")]),
            no(ArcSpecification, &[concat!($code, " X5 I1 F100")]),
            no(ArcAxisMissing, &[concat!($code, " Z1 R5 F100")]),
            no(ArcOffsetsMissing, &[concat!($code, " X1 F100")]),
            no(ArcOffsetsMissing, &[concat!($code, " X1 I0 J0 F100")]),
            no(ArcOffsetsMissing, &["G90.1", concat!($code, " X2 I1 F100")]),
            no(ArcRadiusTolerance, &[concat!($code, " X5 R1 F100")]),
            no(ArcRadiusTolerance, &[concat!($code, " X0.1 R0.04 F100")]),
            no(ArcEndpointIsStart, &[concat!($code, " X0 R5 F100")]),
            no(OutOfRange, &["G28.3 X214000", concat!($code, " I500 F100")]),
            no(PWordNegative, &[concat!($code, " I1 P-1 F100")]),
            no(PWordInvalid, &[concat!($code, " I1 P1.5 F100")]),
        ]
    };
}

/// The refusals of a probing move.
macro_rules! probe {
    ($code:literal) => {
        &[
            no(AxisWordMissing, &[concat!($code, " F100")]),
            no_on(On::NoSwitches, ProbeFailed, &[concat!($code, " Z-5 F100")]),
            no(RotaryNotAllowed, &[concat!($code, " A5 F100")]),
            no(InverseTimeNotAllowed, &["G93", concat!($code, " Z-5 F1")]),
            no(FeedrateMissing, &[concat!($code, " Z-5")]),
            no(SpindleMustTurn, &["G95 F0.1", concat!($code, " Z-5")]),
            no(SWordMissing, &["M3 G95 F0.1", concat!($code, " Z-5")]),
            no(ProbeTooShort, &[concat!($code, " Z-0.25 F100")]),
        ]
    };
}

/// The refusals of a thread.
macro_rules! thread {
    ($code:literal) => {
        &[
            no_on(On::NoSwitches, NoEncoder, &[concat!($code, " Z-5 K1")]),
            no(AxisWordMissing, &[concat!($code, " K1")]),
            no(RotaryNotAllowed, &[concat!($code, " A5 K1")]),
            no(KWordMissing, &[concat!($code, " Z-5")]),
            no(KWordInvalid, &[concat!($code, " Z-5 K0")]),
            no(KWordInvalid, &[concat!($code, " Z-5 K-1")]),
        ]
    };
}

pub const MOVES: Section = Section {
    title: "Moves",
    intro: "Axis words on a line without a code of this group move in the mode that is in force. X, Y and \
Z are in the units in force, A, B and C in degrees (an axis in radius mode: a length along its \
circumference).",
    docs: &[
        g(
            0,
            "Traverse",
            "Straight to the axis words, as fast as the axes may. Stays in force. Without axis words \
nothing moves.",
            &[],
        ),
        g(
            10,
            "Feed",
            "Straight to the axis words at the feed rate F. If only A, B and C move, F is in degrees. Stays in \
force, and needs a feed even without axis words.",
            &[
                no(FeedrateMissing, &["G1 X1"]),
                no(SpindleMustTurn, &["G95 F0.1", "G1 X1"]),
                no(SWordMissing, &["M3 G95 F0.1", "G1 X1"]),
            ],
        ),
        g(20, "Arc, clockwise", ARC, arc!("G2")),
        g(30, "Arc, counter-clockwise", "As G2, the other way round.", arc!("G3")),
        g(
            40,
            "Dwell",
            "Stands still for P seconds, to the millisecond, after the moves before it and before a move on \
the same line.",
            &[
                no(PWordMissing, &["G4"]),
                no(PWordNegative, &["G4 P-1"]),
                no(OutOfRange, &["G4 P4294967"]),
            ],
        ),
        g(
            800,
            "No motion mode",
            "Ends canned cycles. Until another code of the group comes, axis words move nothing and are \
refused. Beside another code of the group it only ends them, as in `G0 G80 G90`. In force at power-up.",
            &[no(AxisNotAllowed, &["G80 X1"])],
        ),
        g(320, "Thread", "The same as G33.", thread!("G32")),
        g(
            330,
            "Thread",
            "Straight to the axis words in step with the spindle, by its encoder (`spn`); see lathe.md. K, on each line, is the way in a turn of the axis \
that moves farthest: the lead. F does not count. The machine comes to rest, waits for the index, and goes so that each pass lies in the one \
before, whatever the speed. Feed override and `!` wait for the end of the pass. If there are no pulses for 6 seconds (42, 43), or an axis would \
be too fast (146), an alarm says so, and nothing moves. A spindle that is lost in the cut is an alarm (44): the axes come to rest.",
            thread!("G33"),
        ),
        g(
            331,
            "Rigid tapping",
            "As G33 to the axis words, where the spindle is told to turn round; the axes follow it until it stands, and back in step. Where the \
line began the spindle is told to turn as before, and when it has turned round the axes go back to there. So the tap goes on beyond the axis words while the spindle \
slows down: leave room for it. If it has not turned round within the way of a second, that is an alarm (47). It needs M3 or M4. `!` waits for the end.",
            &[
                no_on(On::NoSwitches, NoEncoder, &["M3 S100 G33.1 Z-5 K1"]),
                no(AxisWordMissing, &["M3 S100 G33.1 K1"]),
                no(RotaryNotAllowed, &["M3 S100 G33.1 A5 K1"]),
                no(KWordMissing, &["M3 S100 G33.1 Z-5"]),
                no(KWordInvalid, &["M3 S100 G33.1 Z-5 K0"]),
                no(SpindleMustTurn, &["G33.1 Z-5 K1"]),
            ],
        ),
        g(
            760,
            "Threading cycle",
            "A thread along Z in several passes, each as G33 and in the one before. The drive line is parallel to Z through where X is. Z is where passes end; P the \
lead; I from the drive line to the peak of the thread, negative for an outer thread, positive for an inner one; J the depth of the first pass and K of the last, from the peak. \
The n-th pass is J n^(1/R) deep: R1, if it is not given, as much each time, R2 the same area. Q is the compound slide angle, 0 to 80 degrees: a pass begins depth tan Q further on. H more \
passes are made at the full depth. E is how long a taper is along Z, where L says: L1 at the entry, L2 at the exit, L3 both. With G7, I, J and K are diameters. The tool ends on the drive line at Z. \
Before the first index pulse nothing moves (42, 43). Words are for their line.",
            &[
                no_on(On::NoSwitches, NoEncoder, &["G76 P1 Z-10 I-1 J0.2 K0.6"]),
                no(AxisWordMissing, &["G76 P1 I-1 J0.2 K0.6"]),
                no(AxisNotAllowed, &["G76 P1 X1 Z-10 I-1 J0.2 K0.6"]),
                no(PWordMissing, &["G76 Z-10 I-1 J0.2 K0.6"]),
                no(PWordInvalid, &["G76 P0 Z-10 I-1 J0.2 K0.6"]),
                no(ArcOffsetsMissing, &["G76 P1 Z-10 J0.2 K0.6"]),
                no(ArcOffsetsMissing, &["G76 P1 Z-10 I-1 K0.6"]),
                no(OutOfRange, &["G76 P1 Z-10 I-1 J0 K0.6"]),
                no(KWordMissing, &["G76 P1 Z-10 I-1 J0.2"]),
                no(KWordInvalid, &["G76 P1 Z-10 I-1 J0.2 K-0.6"]),
                no(RWordInvalid, &["G76 P1 Z-10 I-1 J0.2 K0.6 R0.9"]),
                no(RWordInvalid, &["G76 P1 Z-10 I-1 J0.01 K0.6 R2"]),
                no(QWordInvalid, &["G76 P1 Z-10 I-1 J0.2 K0.6 Q81"]),
                no(HWordInvalid, &["G76 P1 Z-10 I-1 J0.2 K0.6 H256"]),
                no(LWordInvalid, &["G76 P1 Z-10 I-1 J0.2 K0.6 E1 L4"]),
                no(OutOfRange, &["G76 P1 Z-10 I-1 J0.2 K0.6 L1"]),
                no(OutOfRange, &["G76 P1 Z-10 I-1 J0.2 K0.6 E5 L1"]),
            ],
        ),
    ],
};

const ARC: &str = "From here to the axis words around a centre, in the plane in force, seen from the \
positive end of the third axis, along which a helix advances. The centre is at I, J, K (with G91.1 from the \
start, where one of two may be left out, with G90.1 from the origin), or R is the radius, negative for the \
long way round. Without an end point in the plane: a full circle. P full turns more; of a full circle, P \
turns in all. Radii at start and end may differ by 5 um, or by a thousandth, but never by 1 mm; the smallest \
R is 0.001 mm. Stays in force.";

pub const PROBES: Section = Section {
    title: "Probing",
    intro: "",
    docs: &[
        g(382, "Probe until it touches", PROBE, probe!("G38.2")),
        g(383, "Probe until it touches, if it does", QUIET, probe!("G38.3")),
        g(384, "Probe until it lets go", PROBE, probe!("G38.4")),
        g(385, "Probe until it lets go, if it does", QUIET, probe!("G38.5")),
    ],
};

const PROBE: &str = "Moves straight towards the axis words at the feed rate until the probe changes. X, Y and Z \
only, at least 0.254 mm. The machine stops beyond the contact point (`prb`) and returns to it at the same feed, so that G10 L20 and G92 in \
the next line apply to the contact point. With `pbo` 0 it stays where it has stopped. A move that ends without a contact raises an alarm. Refused on machines without a probe.";
const QUIET: &str = "As the code above, but a move that ends without a contact raises no alarm.";
