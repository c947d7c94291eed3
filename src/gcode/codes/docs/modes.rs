//! Modes: planes, units, distances, path, feeds.

use super::{Section, g, no};
use crate::status::Status::{
    CutterCompensation, FeedrateMissing, InverseTimeNotAllowed, PWordNegative, SWordMissing,
    SpindleMustTurn,
};

pub const MODES: Section = Section {
    title: "Planes, units, distances, path",
    intro: "All these codes are modal.",
    docs: &[
        g(
            170,
            "XY plane",
            "Arcs lie in XY. Canned cycles move along Z. Active at power-up and after M2, unless `gpl` selects another plane.",
            &[],
        ),
        g(180, "ZX plane", "Arcs lie in ZX. Canned cycles move along Y.", &[]),
        g(190, "YZ plane", "Arcs lie in YZ. Canned cycles move along X.", &[]),
        g(
            200,
            "Inches",
            "Lengths are in inches and F in inches per minute, for this whole line and the lines after it. Rotary axes stay \
in degrees. Reports and settings use inches too.",
            &[],
        ),
        g(
            210,
            "Millimetres",
            "Lengths are in millimetres and F in millimetres per minute, for this whole line and the lines after it. Active \
at power-up and after M2, unless `gun` selects inches.",
            &[],
        ),
        g(400, "Cutter compensation off", "No effect: Kerf has no cutter compensation.", &[]),
        g(410, "Cutter compensation, left", COMPENSATION, &[no(CutterCompensation, &["G41"])]),
        g(420, "Cutter compensation, right", COMPENSATION, &[no(CutterCompensation, &["G42"])]),
        g(
            610,
            "Exact path",
            "Follows the path exactly: merges no moves and rounds no corners. The machine stops only where it has to, and where G61 \
begins and ends. The acceleration and the junction deviation limit the speed. The jerk limit does not apply.",
            &[],
        ),
        g(
            611,
            "Exact stop",
            "Comes to a standstill at the end of each move, but not between the chords of an arc.",
            &[],
        ),
        g(
            640,
            "Continuous path",
            "Follows the path. The machine stops only where it has to. With a jerk limit it rounds corners, so that the \
velocity of no axis jumps. On an RP2040 the tool is then off the path by P at most, 0.05 mm without P and 1 mm at most, and no axis exceeds its \
acceleration. Moves that take less than 0.8 ms each are left out of that: their corners are those of an ATmega2560. A small P makes corners slow, also \
those of a curve of short moves; with P0 the machine follows the path as under G61. On an ATmega2560 the tool is up to \
0.05 mm off at 500 mm/s^2, and more at higher accelerations, whatever P is. Short feed moves of linear axes are merged if they lie on a straight \
line: on an RP2040 within a quarter of P, 0.0025 mm without P; on an ATmega2560 within P, 0.001 mm without P. A merged move takes at most 12 ms, \
has at most 3.2 mm, and is off by 0.0254 mm at most; with P0 only exactly collinear moves are merged. On a curve where no moves can be merged, \
only every eighth move is tested, later every 32nd. Active at power-up and after M2, unless `gpa` selects another mode.",
            &[no(PWordNegative, &["G64 P-0.001"])],
        ),
        g(
            70,
            "Diameter mode",
            "X words are diameters from this line on, for moves, G10, G92 and all other codes. X moves by half the value. In \
a canned cycle along X (G19) R is a diameter too, and so is I of G87. I of an arc is always a radius, Q is a \
distance, and X in reports and settings is a radius.",
            &[],
        ),
        g(80, "Radius mode", "X words are radii. Active at power-up and after M2.", &[]),
        g(
            900,
            "Absolute distance mode",
            "Axis words are positions in the active coordinate system. Active at power-up and after M2, unless `gdi` selects \
G91.",
            &[],
        ),
        g(
            901,
            "Absolute arc centres",
            "I, J and K of arcs are positions in the active coordinate system.",
            &[],
        ),
        g(
            910,
            "Incremental distance mode",
            "Axis words are distances from the present position. Rounding errors are carried over, so that increments add up \
exactly.",
            &[],
        ),
        g(
            911,
            "Incremental arc centres",
            "I, J and K of arcs are distances from the start of the arc. Active at power-up and after M2.",
            &[],
        ),
    ],
};

const COMPENSATION: &str = "Always refused. The CAM program must compensate for the tool radius.";

pub const FEEDS: Section = Section {
    title: "Feed modes",
    intro: "All these codes are modal. A change of the feed mode clears F.",
    docs: &[
        g(
            930,
            "Inverse time mode",
            "Each feed move takes 1/F minutes and needs its own F.",
            &[
                no(FeedrateMissing, &["G93 G1 X1 F2", "X2"]),
                no(InverseTimeNotAllowed, &["G93 G81 X1 Z-1 R1 F2"]),
            ],
        ),
        g(
            940,
            "Units per minute mode",
            "F is the speed along the path, in the active units per minute. Active at power-up and after M2.",
            &[no(FeedrateMissing, &["G93 G1 X1 F2", "G94 X2"])],
        ),
        g(
            950,
            "Units per revolution mode",
            "F is the distance per revolution of the spindle. With an encoder (`spn`) feeds follow the measured speed, to 0.5 \
%, every 20 ms, up to S. A slower spindle makes feeds slower, a stopped one stops them. A spindle that is faster \
than S, for example by its override, does not make feeds faster. Without an encoder feeds are those for S. With \
G96 the S of a move is that at its end.",
            &[
                no(FeedrateMissing, &["M3 S1000", "F100", "G95 G1 X1"]),
                no(SpindleMustTurn, &["G95 G1 X1 F0.1"]),
                no(SWordMissing, &["M3", "G95 G1 X1 F0.1"]),
            ],
        ),
    ],
};
