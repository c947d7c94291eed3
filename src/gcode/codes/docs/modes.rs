//! Modes: planes, units, distances, path, feeds.

use super::{Section, g, no};
use crate::status::Status::{
    CutterCompensation, FeedrateMissing, InverseTimeNotAllowed, PWordNegative, SWordMissing,
    SpindleMustTurn,
};

pub const MODES: Section = Section {
    title: "Planes, units, distances, path",
    intro: "Each of these stays in force until another one of its group comes.",
    docs: &[
        g(
            170,
            "XY plane",
            "Arcs lie in XY, canned cycles go along Z. In force at power-up and after M2, unless `gpl` says \
otherwise.",
            &[],
        ),
        g(180, "ZX plane", "Arcs lie in ZX, canned cycles go along Y.", &[]),
        g(190, "YZ plane", "Arcs lie in YZ, canned cycles go along X.", &[]),
        g(
            200,
            "Inches",
            "Lengths are inches and F inches a minute, from this line on, whatever its order. Degrees stay \
degrees. Reports and settings speak inches too.",
            &[],
        ),
        g(
            210,
            "Millimetres",
            "Lengths are millimetres and F millimetres a minute, from this line on, whatever its order. In \
force at power-up and after M2, unless `gun` says otherwise.",
            &[],
        ),
        g(400, "No cutter compensation", "There never is any.", &[]),
        g(410, "Cutter compensation, left", COMPENSATION, &[no(CutterCompensation, &["G41"])]),
        g(420, "Cutter compensation, right", COMPENSATION, &[no(CutterCompensation, &["G42"])]),
        g(
            610,
            "Exact path",
            "The path is followed exactly, without a stop where none is needed. Each move is made by itself.",
            &[],
        ),
        g(611, "Exact stop", "Each move ends at rest; the chords of an arc do not.", &[]),
        g(
            640,
            "Continuous path",
            "The path is followed without a stop where none is needed. Short feed moves of linear axes that lie on a line, to within P, are \
made one: up to 12 ms of them, or 3.2 mm. P is 0.001 mm if it is not given, and 0.0254 mm at most; with 0 they lie on the line exactly. On \
a curve on which none can be made one with the next, only every eighth is looked at. In force at power-up and after M2, unless `gpa` says otherwise.",
            &[no(PWordNegative, &["G64 P-0.001"])],
        ),
        g(
            70,
            "Diameters",
            "X words are diameters from this line on, whatever they are for: moves, G10, G92 and the others. X moves by half of each. I of an arc is a \
radius still, and so is X in reports and settings.",
            &[],
        ),
        g(80, "Radii", "X words are radii. In force at power-up and after M2.", &[]),
        g(
            900,
            "Absolute distances",
            "Axis words are positions in the coordinate system in force. In force at power-up and after M2, \
unless `gdi` says otherwise.",
            &[],
        ),
        g(
            901,
            "Absolute arc centres",
            "I, J and K of arcs are positions in the coordinate system in force.",
            &[],
        ),
        g(
            910,
            "Incremental distances",
            "Axis words are measured from the present position. What rounding takes is carried on, so that \
increments add up exactly.",
            &[],
        ),
        g(
            911,
            "Incremental arc centres",
            "I, J and K of arcs are measured from the start of the arc. In force at power-up and after M2.",
            &[],
        ),
    ],
};

const COMPENSATION: &str =
    "Always refused: the program has to come with the radius of the tool worked in.";

pub const FEEDS: Section = Section {
    title: "Feed modes",
    intro: "Each stays in force until another one comes. A change of the mode forgets F.",
    docs: &[
        g(
            930,
            "Inverse time",
            "Each feed move takes 1/F minutes and needs an F of its own.",
            &[
                no(FeedrateMissing, &["G93 G1 X1 F2", "X2"]),
                no(InverseTimeNotAllowed, &["G93 G81 X1 Z-1 R1 F2"]),
            ],
        ),
        g(
            940,
            "Units per minute",
            "F is the speed along the path, in the units in force a minute. In force at power-up and after M2.",
            &[no(FeedrateMissing, &["G93 G1 X1 F2", "G94 X2"])],
        ),
        g(
            950,
            "Units per turn",
            "F is the way for each turn of the spindle. Feeds are planned for the speed S that has been programmed, with G96 that at the end of the move. \
With an encoder (`spn`) they follow the speed that it measures, to 0.5 %, each 20 ms, up to S: a spindle that is slower has slower feeds, and one that stands still none. A faster one, as by \
its override, does not count, nor does any without an encoder.",
            &[
                no(FeedrateMissing, &["M3 S1000", "F100", "G95 G1 X1"]),
                no(SpindleMustTurn, &["G95 G1 X1 F0.1"]),
                no(SWordMissing, &["M3", "G95 G1 X1 F0.1"]),
            ],
        ),
    ],
};
