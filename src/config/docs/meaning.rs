//! What each setting means, in the order of its table.

use crate::config::table::{
    AXIS_ROWS, COOLANT_ROWS, JOB_ROWS, MOTOR_ROWS, PWM_ROWS, SPINDLE_ROWS, SQUARING_ROWS,
    SYSTEM_ROWS, USER_ROWS,
};

/// A name without its group, and what it means.
pub type Meaning = (&'static str, &'static str);

pub const SYSTEM: [Meaning; SYSTEM_ROWS] = [
    ("fb", "Build that the protocol is compatible with."),
    ("fv", "Version that the protocol is compatible with."),
    ("hp", "Kind of hardware."),
    ("hv", "Revision of the hardware."),
    ("id", "Name of the board."),
    ("ja", "Acceleration towards the centre of a corner; more makes corners faster."),
    ("ct", "How far the chords of an arc may leave it."),
    ("sl", "Moves of homed axes beyond `tn` and `tm` are refused (220)."),
    ("st", "Kind of switches at the ends of axes: open or closed unless worked. A probe closes."),
    ("mt", "How long motors with `pm` 2 stay powered after a move."),
    (
        "ej",
        "Mode at power-up; after that answers are in the mode of the last line. With `dia` 1 that takes 2, and else lines of \
text mode are answered as `txt`.",
    ),
    (
        "jv",
        "What JSON responses show: nothing, the footer, messages, settings, line numbers, blocks of G-code; each \
includes what is before it.",
    ),
    ("js", "Whether keys are quoted."),
    ("tv", "Whether lines are answered with a prompt in text mode."),
    ("qv", "Queue reports: none, free blocks, or also those added and removed (3 is 2)."),
    ("sv", "Status reports: none, what has changed, or all of it."),
    ("si", "Time between status reports."),
    ("ec", "Whether lines end in LF CR."),
    ("ee", "Whether each line is sent back before it is answered, as a line of its own."),
    (
        "ex",
        "Flow control. With 1 XOFF holds answers back until XON, and Kerf sends them likewise; 2 does the same with \
pins, on ports that have them, and is refused by boards without.",
    ),
    (
        "rxm",
        "What the sender counts, and footers say: 1 lines, `[1,status,free line slots]`; 0 characters, at most 254 \
unanswered, `[1,status,length,checksum]`. `rx` counts likewise.",
    ),
    (
        "baud",
        "Rate of the USB line: a code, or bits a second from 9600 to 1000000; above 500000 lines may be refused by 13 while motors move. In force when the response has \
left; 115200 after a reset.",
    ),
    ("net", "Network of boards: there is none."),
    ("gpl", "Plane at power-up and after M2."),
    ("gun", "Units at power-up and after M2."),
    ("gco", "Coordinate system at power-up and after M2."),
    ("gpa", "Path mode at power-up and after M2."),
    ("gdi", "Distance mode at power-up and after M2."),
    ("bd", "Lines that begin with a slash are passed over."),
    ("ost", "M1 stops."),
    ("psw", "M0, M1, M60 and G88 wait for `~`."),
    (
        "dia",
        "Whom the sender takes the machine for. As a g2core it ends responses with `[1,status,length]` and has that one's \
`fb`, `fv`, `hp`, `hv`, prompts, and some status codes and texts.",
    ),
    ("spw", "How long a step pulse lasts. Longer pulses may lower `vm` and `fr`."),
    ("dsu", "How long a direction pin stands before a step."),
    (
        "saf",
        "Door switch: none, one that closes when the door is opened, or one that opens. An open door holds the machine; \
`~` resumes when it is shut.",
    ),
    (
        "est",
        "Emergency stop: none, one that closes when it is hit, or one that opens, as a broken wire does. It shuts the \
machine down: no step more, spindle and coolant off, motors keep their power.",
    ),
    (
        "mch",
        "Machine that was chosen last. Choosing one sets all settings of motors and axes, `ja`, `ct` and `gpl` to what they are on that machine: see Machines.",
    ),
];

pub const MOTOR: [Meaning; MOTOR_ROWS] = [
    (
        "ma",
        "Axis that it moves: 0 X, 1 Y, 2 Z, 3 A, 4 B, 5 C; above that none. Several may move one axis.",
    ),
    ("sa", "Angle of a full step."),
    (
        "tr",
        "Travel of the axis in a turn. More than 10,000 steps in a millimetre or degree leave less room for positions: see [how far numbers go](protocol.md#how-far-numbers-go).",
    ),
    ("mi", "Microsteps of the driver. Usual are 1, 2, 4 and 8; others are taken with a warning."),
    ("po", "Direction."),
    ("pm", "When it is powered; see `mt`."),
    ("sp", "Whether the driver steps on a falling edge."),
];

pub const AXIS: [Meaning; AXIS_ROWS] = [
    (
        "am",
        "0 disabled, 1 standard, 2 inhibited: counts and does not move, 3 radius: words are lengths along `ra`.",
    ),
    ("vm", "Speed of traverses at most. Lowered, with a message, if the motors cannot follow."),
    ("fr", "Speed of feeds at most. Lowered likewise."),
    ("tn", "Lower end of travel, for `sl`. The lowest that can be set is none."),
    (
        "tm",
        "Upper end of travel, for `sl`. The lowest that can be set is none; an axis whose ends are the same has neither.",
    ),
    (
        "jm",
        "Jerk at most. A value above 1000000 is divided by a million. A jerk that reaches `ac` within 1 ms has no effect: \
ramps are those of `ac` alone, and a message says so. That is `jm` of 216 times `ac` and more. About 6 times \
`ac` takes 36 ms.",
    ),
    ("jh", "Jerk while homing and probing, likewise; `ac` holds there too."),
    ("jd", "How far a corner may be cut, as far as its speed goes; more makes corners faster."),
    ("ra", "Radius that turns a length into an angle with `am` 3."),
    (
        "sn",
        "Switch at the lower end. A limit that is hit stops everything, with exception 204, until a reset. One switch of an axis may be that of homing.",
    ),
    ("sx", "Switch at the upper end, likewise."),
    ("sv", "Speed towards a homing switch; 0: the axis cannot be homed (242)."),
    (
        "lv",
        "Speed off a homing switch, when its place is taken; 0: the axis cannot be homed (243).",
    ),
    (
        "lb",
        "Way off a homing switch, within which it must open. With 0 its place is taken as it closes.",
    ),
    ("zb", "Way from where a homing switch opens to the end of travel."),
    (
        "ac",
        "Acceleration at most; 0 is none, and the jerk alone limits. `jm` says how soon it is reached; \
within 1 ms `jm` has no effect, and a message says so.",
    ),
];

pub const PWM: [Meaning; PWM_ROWS] = [
    ("frq", "Frequency; 0.122 Hz is the lowest there is."),
    ("csl", "Lowest speed, clockwise: a lower S has its share."),
    ("csh", "Highest speed, clockwise: a higher S has its share."),
    ("cpl", "Share of the period at the lowest speed, clockwise."),
    ("cph", "Share of the period at the highest speed, clockwise."),
    ("wsl", "Lowest speed, counter-clockwise."),
    ("wsh", "Highest speed, counter-clockwise."),
    ("wpl", "Share of the period at the lowest speed, counter-clockwise."),
    ("wph", "Share of the period at the highest speed, counter-clockwise."),
    ("pof", "Share of the period while the spindle is off, or S is 0."),
];

pub const SPINDLE: [Meaning; SPINDLE_ROWS] = [
    (
        "ph",
        "Whether the spindle stands still in a feedhold. It starts again before motion goes on, but not after `%`.",
    ),
    ("de", "Time that moves wait for when the spindle has been started, or turned round."),
    (
        "ep",
        "Level of the enable pin that is on. Until the settings have been read after a reset it is not driven.",
    ),
    ("dp", "Level of the direction pin."),
];

pub const COOLANT: [Meaning; COOLANT_ROWS] = [(
    "ph",
    "Whether mist and flood pause in a feedhold. They go on with the motion, but not after `%`.",
)];

pub const SQUARING: [Meaning; SQUARING_ROWS] = [
    (
        "sw",
        "Input of the second motor's own homing switch, as `in1`, `in2`..; 0 is none, and the axis is not squared. The motor is that \
         of the highest number that drives the same axis as one before it.",
    ),
    (
        "of",
        "How much farther off its switch than the first motor it stands when the axis is square.",
    ),
];

pub const USER: [Meaning; USER_ROWS] = [
    ("0", "First of the group."),
    ("1", "Second of the group."),
    ("2", "Third of the group."),
    ("3", "Fourth of the group."),
];

pub const JOB: [Meaning; JOB_ROWS] =
    [("a", "First part."), ("b", "Second part."), ("c", "Third part."), ("d", "Fourth part.")];
