//! The settings, as data in program memory: the one truth about names, storage, limits, defaults.
//!
//! Rows stand in the order that groups are listed in. A motor or axis setting has one row for all
//! motors or axes; its defaults are a row of the table behind. Sizes: 57 rows of 17 bytes and 644
//! bytes of defaults; and those that are in EEPROM alone. TinyG's settings come first in each group, then those of Kerf alone.

use super::machines;
use super::name::token;
use crate::boards::{ACTIVE, MOTORS, inputs};
use crate::units::AXES;
use crate::{named, progmem};

/// How a setting is kept.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Kind {
    /// Nowhere: its default is its value.
    Constant,
    /// In one byte; an integer.
    Small,
    /// In 32 bits, fixed point.
    Large,
    /// Nowhere: it is the board's name.
    Text,
    /// In EEPROM alone, fixed point: seldom asked for.
    Cold,
    /// In EEPROM alone; 32 bits, written as hexadecimal.
    Data,
    /// In 32 bits until the next reset, written as hexadecimal.
    Job,
}

/// Converted from and to inches in G20 (on an axis that turns: never).
pub const UNIT: u8 = 1;
/// Out of limits is a range error, not a minimum or maximum.
pub const RANGE: u8 = 2;
/// Out of limits is pulled to the limit.
pub const CLAMP: u8 = 4;
/// In millions: a value over a million is divided by one.
pub const JERK: u8 = 8;
/// Only axes that turn have it; it is a length even there.
pub const RADIUS: u8 = 16;
/// Only axes that home have it: X Y Z A.
pub const HOMING: u8 = 32;
/// The axis mode: a linear axis lacks the last one.
pub const MODE: u8 = 64;
/// Refused while anything moves, as all settings of motors are.
pub const IDLE: u8 = 128;

/// A setting, or the same setting of every motor or axis.
#[derive(Clone, Copy)]
pub struct Row {
    /// Its name, without the group; zero padded.
    pub token: [u8; 4],
    /// Its place among the small or large ones of the system, the motor, the axis.
    pub slot: u8,
    /// How it is kept.
    pub kind: Kind,
    /// See the constants above.
    pub flags: u8,
    /// Decimals kept.
    pub stored: u8,
    /// Decimals shown.
    pub shown: u8,
    /// Lower limit, scaled as kept.
    pub min: i32,
    /// Upper limit, scaled as kept.
    pub max: i32,
}

named! { Row, 4 }

impl Row {
    /// No setting's. All zeros, so that it needs no memory.
    pub const NONE: Row = constant("", 0);

    const fn with(mut self, flags: u8) -> Row {
        self.flags |= flags;
        self
    }

    /// Whether it has all of `flags`.
    pub const fn is(&self, flags: u8) -> bool {
        self.flags & flags == flags
    }
}

/// An integer of one byte.
const fn int(name: &str, slot: u8, min: i32, max: i32) -> Row {
    let (kind, flags, stored, shown) = (Kind::Small, RANGE, 0, 0);
    Row { token: token(name), slot, kind, flags, stored, shown, min, max }
}

/// A fixed-point number of `stored` decimals, of which `shown` are shown.
const fn fixed(name: &str, slot: u8, stored: u8, shown: u8, min: i32) -> Row {
    let (kind, flags, max) = (Kind::Large, 0, i32::MAX);
    Row { token: token(name), slot, kind, flags, stored, shown, min, max }
}

/// A number from 0 on of which three decimals are kept, in EEPROM.
const fn cold(name: &str, shown: u8) -> Row {
    let (kind, slot, flags, stored, min, max) = (Kind::Cold, 0, 0, 3, 0, i32::MAX);
    Row { token: token(name), slot, kind, flags, stored, shown, min, max }
}

/// Yes or no, in EEPROM.
const fn choice(name: &str) -> Row {
    whole(cold(name, 0), 1)
}

/// A whole number up to `max`.
const fn whole(row: Row, max: i32) -> Row {
    let mut row = up_to(row, max).with(RANGE);
    row.stored = 0;
    row
}

/// A length of either sign, in EEPROM.
const fn shift(name: &str, most: i32) -> Row {
    let mut row = up_to(cold(name, 3), most).with(UNIT);
    (row.stored, row.min) = (4, -most);
    row
}

/// 32 bits.
const fn bits(name: &str, kind: Kind, slot: u8) -> Row {
    let (flags, stored, shown, min, max) = (0, 0, 0, i32::MIN, i32::MAX);
    Row { token: token(name), slot, kind, flags, stored, shown, min, max }
}

/// A number that never changes.
const fn constant(name: &str, decimals: u8) -> Row {
    let (kind, slot, flags) = (Kind::Constant, 0, 0);
    let (stored, shown, min, max) = (decimals, decimals, 0, 0);
    Row { token: token(name), slot, kind, flags, stored, shown, min, max }
}

const fn board_name() -> Row {
    let mut row = constant("id", 0);
    row.kind = Kind::Text;
    row
}

const fn up_to(mut row: Row, max: i32) -> Row {
    row.max = max;
    row
}

/// Rows of [`SYSTEM`].
pub const SYSTEM_ROWS: usize = 37;
/// Rows of [`MOTOR`].
pub const MOTOR_ROWS: usize = 7;
/// Rows of [`AXIS`].
pub const AXIS_ROWS: usize = 16;
/// Rows of [`PWM`].
pub const PWM_ROWS: usize = 10;
/// Rows of [`SPINDLE`].
pub const SPINDLE_ROWS: usize = 4;
/// Rows of [`COOLANT`].
pub const COOLANT_ROWS: usize = 1;
/// Rows of [`SQUARING`].
pub const SQUARING_ROWS: usize = 2;
/// Rows of [`USER`].
pub const USER_ROWS: usize = 4;
/// Rows of [`JOB`].
pub const JOB_ROWS: usize = 4;

/// The row of [`SQUARING`] that says where the second motor's switch is.
pub const SQUARING_SWITCH: u8 = 0;
/// The row of [`SQUARING`] that says how much farther off it the second motor stands.
pub const SQUARING_OFFSET: u8 = 1;

/// Slots of the system, small and large.
#[allow(missing_docs)]
pub mod system {
    pub const SL: u8 = 0;
    pub const ST: u8 = 1;
    pub const EJ: u8 = 2;
    pub const JV: u8 = 3;
    pub const JS: u8 = 4;
    pub const TV: u8 = 5;
    pub const QV: u8 = 6;
    pub const SV: u8 = 7;
    pub const EC: u8 = 8;
    pub const EE: u8 = 9;
    pub const EX: u8 = 10;
    pub const GPL: u8 = 11;
    pub const GUN: u8 = 12;
    pub const GCO: u8 = 13;
    pub const GPA: u8 = 14;
    pub const GDI: u8 = 15;
    pub const SPW: u8 = 16;
    pub const DSU: u8 = 17;
    pub const BD: u8 = 18;
    pub const OST: u8 = 19;
    pub const PSW: u8 = 20;
    pub const RXM: u8 = 21;
    pub const DIA: u8 = 22;
    pub const SAF: u8 = 23;
    pub const EST: u8 = 24;
    pub const MCH: u8 = 25;
    pub const SMALL: usize = 26;

    pub const JA: u8 = 0;
    pub const CT: u8 = 1;
    pub const MT: u8 = 2;
    pub const SI: u8 = 3;
    pub const BAUD: u8 = 4;
    pub const JOB: u8 = 5;
    pub const LARGE: usize = 9;
}

/// Slots of a motor, small and large.
#[allow(missing_docs)]
pub mod motor {
    pub const MA: u8 = 0;
    pub const MI: u8 = 1;
    pub const PO: u8 = 2;
    pub const PM: u8 = 3;
    pub const SP: u8 = 4;
    pub const SMALL: usize = 5;

    pub const SA: u8 = 0;
    pub const TR: u8 = 1;
    pub const LARGE: usize = 2;
}

/// Slots of an axis, small and large. B and C have those before `SHORT` only.
#[allow(missing_docs)]
pub mod axis {
    pub const AM: u8 = 0;
    pub const SHORT_SMALL: usize = 1;
    pub const SN: u8 = 1;
    pub const SX: u8 = 2;
    pub const SMALL: usize = 3;

    pub const VM: u8 = 0;
    pub const FR: u8 = 1;
    pub const TN: u8 = 2;
    pub const TM: u8 = 3;
    pub const JM: u8 = 4;
    pub const JD: u8 = 5;
    pub const RA: u8 = 6;
    pub const AC: u8 = 7;
    pub const SHORT_LARGE: usize = 8;
    pub const JH: u8 = 8;
    pub const SV: u8 = 9;
    pub const LV: u8 = 10;
    pub const LB: u8 = 11;
    pub const ZB: u8 = 12;
    pub const LARGE: usize = 13;
}

const ANY: i32 = -i32::MAX;
const POSITIVE: i32 = 1;

/// The rows of [`SYSTEM`]; constants, for the profiles of machines are made of them when the image is built.
pub(super) const SYSTEM_LIST: [Row; SYSTEM_ROWS] = [
    constant("fb", 2),
    constant("fv", 3),
    constant("hp", 0),
    constant("hv", 0),
    board_name(),
    fixed("ja", system::JA, 2, 0, POSITIVE).with(UNIT),
    fixed("ct", system::CT, 6, 4, 1_000).with(UNIT),
    int("sl", system::SL, 0, 1),
    int("st", system::ST, 0, 1),
    up_to(fixed("mt", system::MT, 2, 2, 10), 429_496_700).with(CLAMP),
    int("ej", system::EJ, 0, 2),
    int("jv", system::JV, 0, 5),
    int("js", system::JS, 0, 1),
    int("tv", system::TV, 0, 1),
    int("qv", system::QV, 0, 3),
    int("sv", system::SV, 0, 2),
    up_to(fixed("si", system::SI, 0, 0, 100), 65_535).with(CLAMP),
    int("ec", system::EC, 0, 1),
    int("ee", system::EE, 0, 1),
    int("ex", system::EX, 0, if ACTIVE.has_handshake() { 2 } else { 1 }),
    int("rxm", system::RXM, 0, 1),
    up_to(fixed("baud", system::BAUD, 0, 0, 1), 1_000_000).with(RANGE),
    constant("net", 0),
    int("gpl", system::GPL, 0, 2),
    int("gun", system::GUN, 0, 1),
    int("gco", system::GCO, 1, 9),
    int("gpa", system::GPA, 0, 2),
    int("gdi", system::GDI, 0, 1),
    int("bd", system::BD, 0, 1),
    int("ost", system::OST, 0, 1),
    int("psw", system::PSW, 0, 1),
    int("dia", system::DIA, 0, 1),
    int("spw", system::SPW, 1, 10).with(IDLE),
    int("dsu", system::DSU, 0, 100).with(IDLE),
    int("saf", system::SAF, 0, 2),
    int("est", system::EST, 0, 2),
    int("mch", system::MCH, 0, machines::COUNT as i32 - 1).with(IDLE),
];

/// Those of [`MOTOR`].
pub(super) const MOTOR_LIST: [Row; MOTOR_ROWS] = [
    int("ma", motor::MA, 0, 255),
    fixed("sa", motor::SA, 4, 3, POSITIVE),
    fixed("tr", motor::TR, 6, 4, POSITIVE).with(UNIT),
    int("mi", motor::MI, 1, 255),
    int("po", motor::PO, 0, 1),
    int("pm", motor::PM, 0, 3),
    int("sp", motor::SP, 0, 1),
];

/// Those of [`AXIS`].
pub(super) const AXIS_LIST: [Row; AXIS_ROWS] = [
    int("am", axis::AM, 0, 3).with(MODE | IDLE),
    fixed("vm", axis::VM, 3, 0, POSITIVE).with(UNIT),
    fixed("fr", axis::FR, 3, 0, POSITIVE).with(UNIT),
    fixed("tn", axis::TN, 4, 3, ANY).with(UNIT | CLAMP),
    fixed("tm", axis::TM, 4, 3, ANY).with(UNIT | CLAMP),
    fixed("jm", axis::JM, 3, 0, POSITIVE).with(UNIT | JERK),
    fixed("jh", axis::JH, 3, 0, POSITIVE).with(UNIT | JERK | HOMING),
    fixed("jd", axis::JD, 6, 4, 0).with(UNIT),
    fixed("ra", axis::RA, 6, 3, POSITIVE).with(UNIT | RADIUS),
    int("sn", axis::SN, 0, 3).with(HOMING),
    int("sx", axis::SX, 0, 3).with(HOMING),
    fixed("sv", axis::SV, 3, 0, 0).with(UNIT | HOMING),
    fixed("lv", axis::LV, 3, 0, 0).with(UNIT | HOMING),
    fixed("lb", axis::LB, 4, 3, 0).with(UNIT | HOMING),
    fixed("zb", axis::ZB, 4, 3, 0).with(UNIT | HOMING),
    fixed("ac", axis::AC, 1, 1, 0).with(UNIT),
];

/// Values of the settings, scaled as kept.
pub(super) struct Values {
    pub(super) system: [i32; SYSTEM_ROWS],
    pub(super) motor: [[i32; MOTORS]; MOTOR_ROWS],
    pub(super) axis: [[i32; AXES]; AXIS_ROWS],
}

/// What TinyG has by default, and Kerf where no profile says otherwise.
const PLAIN: Values = Values {
    system: [
        44_020, 970, 1, 8, 0, 10_000_000, 10_000, 0, 0, 200, 1, 3, 1, 1, 0, 1, 500, 0, 0, 1, 1, 5,
        0, 0, 1, 1, 2, 0, 1, 1, 0, 0, 2, 1, 0, 0, 0,
    ],
    motor: [
        [0, 1, 2, 3],
        [1_8000; 4],
        [1_250_000, 1_250_000, 1_250_000, 360_000_000],
        [8; 4],
        [0; 4],
        [2; 4],
        [0; 4],
    ],
    axis: [
        [1, 1, 1, 3, 0, 0],
        [800_000, 800_000, 800_000, 230_400_000, 3_600_000, 3_600_000],
        [800_000, 800_000, 800_000, 230_400_000, 3_600_000, 3_600_000],
        [0, 0, 0, -1_0000, -1_0000, -1_0000],
        [150_0000, 150_0000, 75_0000, -1_0000, -1_0000, -1_0000],
        [20_000, 20_000, 20_000, 5_760_000, 20_000, 20_000],
        [40_000, 40_000, 40_000, 11_520_000, 0, 0],
        [50_000; 6],
        [0, 0, 0, 198_944, 1_000_000, 1_000_000],
        [1, 1, 0, 1, 0, 0],
        [0, 0, 1, 0, 0, 0],
        [500_000, 500_000, 400_000, 600_000, 0, 0],
        [100_000, 100_000, 100_000, 100_000, 0, 0],
        [5_0000, 5_0000, 5_0000, 5_0000, 0, 0],
        [1_0000, 1_0000, 1_0000, 2_0000, 0, 0],
        [0; 6],
    ],
};

/// The careful machine's, from which the other profiles differ.
const CAREFUL: Values = PLAIN.with(machines::CAREFUL.entries);

progmem! {
    /// The group `sys`.
    pub static SYSTEM: [Row; SYSTEM_ROWS] = SYSTEM_LIST;

    /// Their defaults, scaled as kept.
    pub static SYSTEM_DEFAULTS: [i32; SYSTEM_ROWS] = CAREFUL.system;

    /// What the constants at the head of [`SYSTEM`] are while the machine passes for a g2core.
    pub static G2CORE: [i32; 4] = [10_103, 990, 3, 0];

    /// The groups `1` to `4`.
    pub static MOTOR: [Row; MOTOR_ROWS] = MOTOR_LIST;

    /// Their defaults, by motor.
    pub static MOTOR_DEFAULTS: [[i32; MOTORS]; MOTOR_ROWS] = CAREFUL.motor;

    /// The groups `x` to `c`.
    pub static AXIS: [Row; AXIS_ROWS] = AXIS_LIST;

    /// Their defaults, by axis.
    pub static AXIS_DEFAULTS: [[i32; AXES]; AXIS_ROWS] = CAREFUL.axis;

    /// The group `p1`.
    pub static PWM: [Row; PWM_ROWS] = [
        cold("frq", 0),
        cold("csl", 0),
        cold("csh", 0),
        up_to(cold("cpl", 3), 1_000),
        up_to(cold("cph", 3), 1_000),
        cold("wsl", 0),
        cold("wsh", 0),
        up_to(cold("wpl", 3), 1_000),
        up_to(cold("wph", 3), 1_000),
        up_to(cold("pof", 3), 1_000),
    ];

    /// Their defaults.
    pub static PWM_DEFAULTS: [i32; PWM_ROWS] =
        [100_000, 1_000_000, 2_000_000, 125, 200, 1_000_000, 2_000_000, 125, 200, 100];

    /// The group `sp`.
    pub static SPINDLE: [Row; SPINDLE_ROWS] = [
        choice("ph"),
        up_to(cold("de", 3), 60_000),
        choice("ep"),
        choice("dp"),
    ];

    /// Their defaults.
    pub static SPINDLE_DEFAULTS: [i32; SPINDLE_ROWS] = [0, 0, 1, 0];

    /// The group `co`. Its default is 0.
    pub static COOLANT: [Row; COOLANT_ROWS] = [choice("ph")];

    /// The group `sq`. All are 0 at first.
    pub static SQUARING: [Row; SQUARING_ROWS] = [
        whole(cold("sw", 0), inputs::COUNT as i32),
        shift("of", 20_0000),
    ];

    /// The groups `uda` to `udd`. All are 0 at first.
    pub static USER: [Row; USER_ROWS] = [
        bits("0", Kind::Data, 0),
        bits("1", Kind::Data, 0),
        bits("2", Kind::Data, 0),
        bits("3", Kind::Data, 0),
    ];

    /// The group `jid`. All are 0 at first.
    pub static JOB: [Row; JOB_ROWS] = [
        bits("a", Kind::Job, system::JOB),
        bits("b", Kind::Job, system::JOB + 1),
        bits("c", Kind::Job, system::JOB + 2),
        bits("d", Kind::Job, system::JOB + 3),
    ];
}
