//! The work origin: coordinate systems and tool lengths.

use super::{Section, g, no};
use crate::status::Status::{
    AxisInvalid, AxisWordMissing, HWordInvalid, HWordMissing, LWordInvalid, LWordMissing,
    MachineCoordinatesMotion, OutOfRange, PWordInvalid, PWordMissing, ToolInvalid,
};

pub const SYSTEMS: Section = Section {
    title: "Coordinate systems and offsets",
    intro: "The origin of axis words is the sum of the active coordinate system, the G92 offset if active, and the tool \
length. A change of the origin moves nothing. Coordinate systems, stored positions and tool lengths survive M2 \
and power cuts.",
    docs: &[
        g(
            100,
            "Set coordinate system or tool length",
            "L2 sets the origin of coordinate system P to the axis words, in machine coordinates. P1 is G54, P9 is G59.3, P0 \
the active system. L20 sets the origin so that the axis words become the coordinates of the present position. L1 \
sets the lengths of tool P (1 to 10) to the X and Z words. L10 sets them so that the words become the \
coordinates of the present position once the tool length is active. Axes without a word keep their value. The \
active tool length does not change until the next G43.",
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
            "Modal. Active at power-up and after M2, unless `gco` selects another system. All systems are 0 at first.",
            &[],
        ),
        g(550, "Coordinate system 2", "Modal.", &[]),
        g(560, "Coordinate system 3", "Modal.", &[]),
        g(570, "Coordinate system 4", "Modal.", &[]),
        g(580, "Coordinate system 5", "Modal.", &[]),
        g(590, "Coordinate system 6", "Modal.", &[]),
        g(591, "Coordinate system 7", "Modal.", &[]),
        g(592, "Coordinate system 8", "Modal.", &[]),
        g(593, "Coordinate system 9", "Modal.", &[]),
        g(
            530,
            "Machine coordinates",
            "On this line axis words are positions in machine coordinates, even with G91. G0 or G1 must be on the line or \
active.",
            &[
                no(MachineCoordinatesMotion, &["G81 Z-1 R1 F100", "G53 X1"]),
                no(MachineCoordinatesMotion, &["G0", "G53"]),
                no(MachineCoordinatesMotion, &["F100", "G53 G2 X2 I1"]),
            ],
        ),
        g(
            920,
            "Coordinate system offset",
            "Sets an offset for all coordinate systems, so that the axis words become the coordinates of the present \
position. Axes without a word keep their offset if it is active. The offset is active until G92.1, G92.2 or M2.",
            &[no(AxisWordMissing, &["G92"]), no(OutOfRange, &["G0 X200000", "G92 X-100000"])],
        ),
        g(921, "Reset G92 offset", "Sets the G92 offset to 0 and makes it inactive.", &[]),
        g(922, "Suspend G92 offset", "Makes the G92 offset inactive and keeps its value.", &[]),
        g(923, "Restore G92 offset", "Makes the kept G92 offset active again.", &[]),
    ],
};

pub const TOOLS: Section = Section {
    title: "Tools",
    intro: "Tool lengths shift the origin along X and Z. Tools 1 to 10 have lengths, which are 0 until G10 sets them. Tool 0 \
is an empty spindle. Tools 11 to 99 have no lengths: G43 uses 0 for them, and exception 180 reports it.",
    docs: &[
        g(
            430,
            "Tool length offset",
            "Activates the lengths of tool H, without H those of the tool in the spindle. H0 means no length. Modal. Stays \
active after M2 and after a tool change.",
            &[no(HWordInvalid, &["G43 H100"]), no(HWordInvalid, &["T100 M6", "G43"])],
        ),
        g(
            431,
            "Dynamic tool length offset",
            "Sets the active tool length to the axis words, on any axis. Axes without a word keep their value.",
            &[no(AxisWordMissing, &["G43.1"])],
        ),
        g(
            432,
            "Additional tool length offset",
            "Adds the lengths of tool H to the active lengths.",
            &[no(HWordMissing, &["G43.2"]), no(HWordInvalid, &["G43.2 H100"])],
        ),
        g(490, "Cancel tool length offset", "Active at power-up.", &[]),
        super::machine::CHANGE,
    ],
};
