//! The work origin: coordinate systems and tool lengths.

use super::{Section, g, no};
use crate::status::Status::{
    AxisInvalid, AxisWordMissing, HWordInvalid, HWordMissing, LWordInvalid, LWordMissing,
    MachineCoordinatesMotion, OutOfRange, PWordInvalid, PWordMissing, ToolInvalid,
};

pub const SYSTEMS: Section = Section {
    title: "Coordinate systems and offsets",
    intro: "The origin of axis words is that of the coordinate system, plus G92 if it is in force, plus the \
length of the tool. A change of it moves nothing. Systems, stored positions and tools \
survive M2 and power cuts.",
    docs: &[
        g(
            100,
            "Set an offset",
            "L2: system P (1 is G54, 9 is G59.3, 0 the one in force) has its origin at the axis words, in machine \
coordinates. L20: it has its origin where the present position is called the axis words. L1: tool P (1 to 10) is as \
long as the words of X and Z. L10: it is so long that the present position is called the words once it is in \
force. Axes without a word keep what they have. A tool length in force stays as it is until the next G43.",
            &[
                no(LWordMissing, &["G10 P1 X1"]),
                no(LWordInvalid, &["G10 L3 P1 X1"]),
                no(PWordMissing, &["G10 L2 X1"]),
                no(PWordInvalid, &["G10 L2 P10 X1"]),
                no(PWordInvalid, &["G10 L20 P1.5 X1"]),
                no(ToolInvalid, &["G10 L1 P0 Z1"]),
                no(ToolInvalid, &["G10 L10 P11 Z1"]),
                no(AxisWordMissing, &["G10 L2 P1"]),
                no(AxisInvalid, &["G10 L1 P1 Y1"]),
            ],
        ),
        g(
            540,
            "Coordinate system 1",
            "Stays in force. In force at power-up and after M2, unless `gco` says otherwise. All systems are at 0 \
at first.",
            &[],
        ),
        g(550, "Coordinate system 2", "Stays in force.", &[]),
        g(560, "Coordinate system 3", "Stays in force.", &[]),
        g(570, "Coordinate system 4", "Stays in force.", &[]),
        g(580, "Coordinate system 5", "Stays in force.", &[]),
        g(590, "Coordinate system 6", "Stays in force.", &[]),
        g(591, "Coordinate system 7", "Stays in force.", &[]),
        g(592, "Coordinate system 8", "Stays in force.", &[]),
        g(593, "Coordinate system 9", "Stays in force.", &[]),
        g(
            530,
            "Machine coordinates",
            "On this line axis words are positions in machine coordinates, with G91 too. G0 or G1 has to be on \
the line or in force.",
            &[
                no(MachineCoordinatesMotion, &["G81 Z-1 R1 F100", "G53 X1"]),
                no(MachineCoordinatesMotion, &["G0", "G53"]),
                no(MachineCoordinatesMotion, &["F100", "G53 G2 X2 I1"]),
            ],
        ),
        g(
            920,
            "Call the position",
            "An offset over all coordinate systems, such that the present position is called the axis words. Axes \
without a word keep theirs, if it is in force. Until G92.1, G92.2 or M2.",
            &[no(AxisWordMissing, &["G92"]), no(OutOfRange, &["G0 X200000", "G92 X-100000"])],
        ),
        g(921, "Forget G92", "The offset of G92 is 0 and not in force.", &[]),
        g(922, "Suspend G92", "The offset of G92 is not in force, and remembered.", &[]),
        g(923, "Resume G92", "The offset of G92 is in force again, as G92.2 left it.", &[]),
    ],
};

pub const TOOLS: Section = Section {
    title: "Tools",
    intro: "A tool shifts the origin along X and Z by its lengths, which are 0 until G10 sets them. Tools 1 to 10 \
have some; tool 0 is an empty spindle. Tools 11 to 99 have no length: G43 takes 0 for it, and an exception (180) says so.",
    docs: &[
        g(
            430,
            "Tool length",
            "The lengths of tool H are in force, without H those of the tool in the spindle; H0 is none. Stays \
in force, after M2 too, whatever tool is changed.",
            &[no(HWordInvalid, &["G43 H100"]), no(HWordInvalid, &["T100 M6", "G43"])],
        ),
        g(
            431,
            "Tool length as given",
            "The tool is as long as the axis words, on any axis. Axes without a word keep what they have.",
            &[no(AxisWordMissing, &["G43.1"])],
        ),
        g(
            432,
            "Another tool length",
            "The lengths of tool H are added to those in force.",
            &[no(HWordMissing, &["G43.2"]), no(HWordInvalid, &["G43.2 H100"])],
        ),
        g(490, "No tool length", "In force at power-up.", &[]),
        super::machine::CHANGE,
    ],
};
