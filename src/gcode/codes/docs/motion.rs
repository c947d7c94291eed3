//! Moves, arcs, probing.

use super::{On, Section, g, no, no_on};
use crate::status::Status::{
    ArcAxisMissing, ArcEndpointIsStart, ArcOffsetsMissing, ArcRadiusTolerance, ArcSpecification,
    AxisDisabled, AxisNotAllowed, AxisWordMissing, FeedrateMissing, HWordInvalid,
    InverseTimeNotAllowed, KWordInvalid, KWordMissing, LWordInvalid, NoEncoder, NoSync, OutOfRange,
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
    intro: "Axis words on a line without a code of this group move in the active motion mode. X, Y and Z are in the active \
units. A, B and C are in degrees, or lengths along the circumference if the axis is in radius mode (`am` 3).",
    docs: &[
        g(
            0,
            "Rapid move",
            "Moves straight to the axis words, as fast as the axes can. Modal. Without axis words nothing moves.",
            &[],
        ),
        g(
            10,
            "Linear move",
            "Moves straight to the axis words at the feed rate F. If only A, B and C move, F is in degrees. Modal. F is \
required even without axis words.",
            &[
                no(FeedrateMissing, &["G1 X1"]),
                no(SpindleMustTurn, &["G95 F0.1", "G1 X1"]),
                no(SWordMissing, &["M3 G95 F0.1", "G1 X1"]),
            ],
        ),
        g(20, "Arc, clockwise", ARC, arc!("G2")),
        g(30, "Arc, counter-clockwise", "As G2, but counter-clockwise.", arc!("G3")),
        g(
            40,
            "Dwell",
            "Pauses for P seconds, to the millisecond. The pause comes after earlier moves and before a move on its own line. \
             In grbl's dialect and in that of printing hosts the line is answered when all that is over, in TinyG's when it has been read.",
            &[
                no(PWordMissing, &["G4"]),
                no(PWordNegative, &["G4 P-1"]),
                no(OutOfRange, &["G4 P4294967"]),
            ],
        ),
        g(
            800,
            "Cancel motion mode",
            "Ends canned cycles. Axis words are refused until another code of the group comes. Beside another code of the \
group G80 only ends canned cycles, as in `G0 G80 G90`. Active at power-up.",
            &[no(AxisNotAllowed, &["G80 X1"])],
        ),
        g(320, "Spindle-synchronized motion", "As G33.", thread!("G32")),
        g(
            330,
            "Spindle-synchronized motion",
            "Cuts a thread: moves straight to the axis words in step with the spindle encoder (`spn`); see lathe.md. K is the \
lead: the distance per turn of the axis that moves farthest. Each line needs K. F has no effect. The machine \
stops, waits for the index pulse, and starts so that each pass follows the groove of the previous pass at any \
speed. Feed override has no effect in the pass. `!` waits for the end of the pass, unless `spr` is set. If no \
pulses come for 6 seconds (42, 43), or if an axis would be too fast (146), an alarm is raised and nothing moves. \
If the spindle stops in the cut, the axes come to rest with alarm 44.",
            thread!("G33"),
        ),
        g(
            331,
            "Rigid tapping",
            "Moves to the axis words as G33 does. There Kerf reverses the spindle; the axes follow it to its stop and back in \
step. At the start of the line Kerf reverses the spindle again. Once it has reversed, the axes return to the \
start. The tap overshoots the axis words while the spindle slows down: leave room for it. If the spindle does \
not reverse within the travel of one second, alarm 47 is raised. M3 or M4 must be active. A sync \
sensor is required. `!` waits for the end of the cycle.",
            &[
                no_on(On::NoSwitches, NoEncoder, &["M3 S100 G33.1 Z-5 K1"]),
                no_on(On::IndexAlone, NoSync, &["M3 S100 G33.1 Z-5 K1"]),
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
            "Cuts a thread along Z in several passes. Each pass moves as G33 does and follows the groove of the previous \
pass. The drive line is parallel to Z at the starting X. Passes end at Z. P is the lead. I is the distance from \
the drive line to the thread peak: negative for an external thread, positive for an internal one. J is the depth \
of the first pass, K that of the last, from the peak. Pass n is J n^(1/R) deep: R1, the default, makes equal \
depth steps, R2 equal chip areas. Q is the compound slide angle, 0 to 80 degrees: a pass of depth d begins d tan Q further along Z. H is the number of additional passes at full depth. E is the length of a taper along Z. L is its \
place: 1 entry, 2 exit, 3 both. With G7, I, J and K are diameters. The tool ends on the drive line at Z. Nothing \
moves before the first index pulse (42, 43). The words apply to their own line only.",
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

const ARC: &str = "Moves along an arc to the axis words, in the active plane. The direction is that seen from the positive end of \
the third axis. A word of the third axis makes a helix. I, J and K give the centre: with G91.1 relative to the \
start, where one of the two words may be omitted, with G90.1 relative to the origin. Instead of them R may give \
the radius; a negative R selects the longer arc. Without an end point in the plane the arc is a full circle. P \
is the number of turns that are begun: 1 is the arc alone or one circle, and each more adds a full turn. The radii at start and end may differ by 5 um or by \
a thousandth, but never by more than 1 mm. The smallest R is 0.001 mm. Modal.";

pub const PROBES: Section = Section {
    title: "Probing",
    intro: "",
    docs: &[
        g(382, "Probe towards, alarm without contact", PROBE, probe!("G38.2")),
        g(383, "Probe towards, no alarm", QUIET, probe!("G38.3")),
        g(384, "Probe away, alarm without release", PROBE, probe!("G38.4")),
        g(385, "Probe away, no alarm", QUIET, probe!("G38.5")),
    ],
};

const PROBE: &str = "Moves straight towards the axis words at the feed rate until the probe changes. Only X, Y and Z may move, by at \
least 0.254 mm. The machine stops beyond the contact point (`prb`) and returns to it at the same feed, so that \
G10 L20 and G92 in the next line apply to the contact point. With `pbo` 0 it stays where it has stopped. If the \
probe does not change, an alarm is raised. Refused on machines without a probe.";
const QUIET: &str = "As the code above, but no alarm is raised.";
