//! The values of the machine that can be read beside its settings: tables of names, units and texts.

use super::state;
use super::variation::Variation;
use crate::boards::inputs;
use crate::capability::Capability;
use crate::config::Fixed;
use crate::config::drive::DRIVERS;
use crate::config::name::token;
use crate::gcode::overrides::Override;
use crate::progmem::Text;
use crate::protocol::{Machine, Value};
use crate::units::FIRST_ROTARY;
use crate::{named, progmem, text};

/// Where a reported number comes from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Source {
    /// A value of the machine.
    Of(Value),
    /// `stat`.
    State,
    /// `macs`.
    Machine,
    /// `cycs`.
    Cycle,
    /// `mots`.
    Motion,
    /// `hold`.
    Hold,
    /// `rx`: how much the sender may send, in lines, or in characters if the sender counts characters.
    Room,
    /// Not supported; always reads 0: `fd`, `ma`, `_xs1`, `_fe1`.
    Zero,
}

#[small]
impl Source {
    /// Returns the index of the value's name in its `choices`. TinyG has no interlock, and its shutdown has the
    /// number of g2core's interlock, so the index of the shutdown is one higher than the number.
    pub fn choice(self, machine: &mut impl Machine) -> i32 {
        let number = self.read(machine);
        let is_state = matches!(self, Source::State | Source::Machine);
        if is_state && state::is_tinyg_shutdown(machine) { number + 1 } else { number }
    }

    /// Returns the number now.
    #[inline(never)]
    pub fn read(self, machine: &mut impl Machine) -> i32 {
        match self {
            Source::Of(value) => machine.value(value),
            Source::State => state::stat(machine),
            Source::Machine => state::macs(machine),
            Source::Cycle => state::cycs(machine),
            Source::Motion => state::mots(machine),
            Source::Hold => state::hold(machine),
            Source::Room => machine.value(match Variation::of(machine.settings()) {
                Variation::Characters => Value::BytesFree,
                _ => Value::SlotsFree,
            }),
            Source::Zero => 0,
        }
    }
}

/// Makes the source of a machine's value.
const fn of(value: Value) -> Source {
    Source::Of(value)
}

/// The most steps that are shown, so that they fit 32 bits with two decimals.
const STEPS_MAX: i32 = i32::MAX / 100;

/// The unit of a value, and how it is shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Form {
    /// An integer, or a number that stands for a choice.
    Count,
    /// A speed.
    Speed,
    /// A factor, in thousandths.
    Factor,
    /// A length or angle.
    Length,
    /// A length in millimetres even if the units are inches, or an angle.
    Millimetres,
    /// A length in millimetres even if the units are inches, or an angle; shown with two decimals.
    Rough,
    /// Thousandths of a millimetre, shown in the units in force.
    Micrometres,
    /// Eighths of a degree Celsius, shown with two decimals.
    Degrees,
    /// Steps, with two decimals.
    Steps,
    /// Turns a minute, with two decimals unless it is a whole number.
    Turns,
}

#[small]
impl Form {
    /// Returns `value` as it is shown; lengths are in inches if `inches`.
    pub fn show(self, value: i32, inches: bool) -> Fixed {
        let (stored, shown) = match self {
            Form::Count => return Fixed::int(value),
            Form::Factor => return Fixed { value, decimals: 3 },
            Form::Degrees => return Fixed { value: value * 125, decimals: 3 }.rounded(2),
            Form::Steps => {
                let value = value.clamp(-STEPS_MAX, STEPS_MAX).wrapping_mul(100);
                return Fixed { value, decimals: 2 };
            }
            Form::Turns if value % 1_000 == 0 => (3, 0),
            Form::Turns => (3, 2),
            Form::Rough => (4, 2),
            Form::Speed => (3, 2),
            Form::Micrometres => (3, 3),
            Form::Length | Form::Millimetres => (4, 3),
        };
        let value = Fixed { value, decimals: stored };
        if inches && matches!(self, Form::Speed | Form::Length | Form::Micrometres) {
            value.inches(shown)
        } else {
            value.rounded(shown)
        }
    }
}

/// Returns how a position on an axis is shown. An angle is never converted to inches.
#[small]
pub fn place_form(axis: u8) -> Form {
    if usize::from(axis) < FIRST_ROTARY { Form::Length } else { Form::Millimetres }
}

/// A value with a name of its own.
#[derive(Clone, Copy)]
pub struct Single {
    /// The name of the value, padded with zeros.
    pub token: [u8; 4],
    /// Where the value comes from.
    pub source: Source,
    /// The unit of the value.
    pub form: Form,
    /// The label in text reports; empty if they do not show the value.
    pub label: Text,
    /// The names of the value's numbers from 0 on, separated by `|`; empty if the numbers have no names.
    pub choices: Text,
}

named! { Single, 4 }

/// A group of values with one member for each axis, motor or input.
#[derive(Clone, Copy)]
pub struct Vector {
    /// The name of the group, padded with zeros.
    pub token: [u8; 4],
    /// The unit of the members.
    pub form: Form,
    /// The number of members: axes, motors, or inputs. Only the last row may have more members than there are axes.
    pub members: u8,
    /// The label in text reports, which follows the letter of the axis.
    pub label: Text,
}

named! { Vector, 4 }

#[small]
impl Vector {
    /// Returns how member `index` is shown. An angle is never converted to inches.
    pub fn form(&self, index: u8) -> Form {
        if self.form == Form::Length { place_form(index) } else { self.form }
    }
}

/// The number of rows of [`SINGLES`].
pub const SINGLE_COUNT: usize = 49
    + if Capability::Printer.is_built_in() { 6 } else { 0 }
    + if Capability::Sd.is_built_in() { 3 } else { 0 }
    + DRIVERS;
/// The index of the state of the first driver in [`SINGLES`].
#[cfg(feature = "drivers")]
pub const FIRST_DRIVER: u8 = (SINGLE_COUNT - 1 - DRIVERS) as u8;
/// The number of rows of [`VECTORS`].
pub const VECTOR_COUNT: usize = 17;
/// The index of the vector `g92`.
pub const SHIFT: u8 = 5;
/// The index of the vector `prb`, whose group begins with `prbe`.
pub const PROBED: u8 = 15;
/// The index of `spf`.
pub const SYNC_ERROR: u8 = 28;
/// The index of `prbe`.
pub const PROBE_STATE: u8 = SINGLE_COUNT as u8 - 1;

const NONE: Text = text!("");
const LINE: Text = text!("Line number:");
const STATES: Text = text!(
    "Initializing|Ready|Alarm|Stop|End|Run|Hold|Probe|Cycle|Homing|Jog|Interlock|Shutdown|Panic"
);
const MACHINE: Text = text!("Initializing|Ready|Alarm|Stop|End|Cycle|Interlock|Shutdown|Panic");
const COORDINATES: Text = text!(
    "G53 - machine coordinate system|G54 - coordinate system 1|G55 - coordinate system 2|\
     G56 - coordinate system 3|G57 - coordinate system 4|G58 - coordinate system 5|\
     G59 - coordinate system 6|G59.1|G59.2|G59.3"
);
const MOTION: Text = text!(
    "G0  - linear traverse|G1  - linear feed|G2  - clockwise arc feed|\
     G3  - counter clockwise arc feed|G80 - cancel motion mode (none active)|\
     G38.2 - probe|G81|G82|G83|G84|G85|G86|G87|G88|G89|G73|G38.3|G38.4|G38.5|G33|G76|G33.1"
);
#[cfg(feature = "drivers")]
const DRIVER: Text = text!("OK|No answer|Not set|Overheated|Shorted|Supply low|Hot|Open wire");
const FEED: Text = text!(
    "G93 - inverse time mode|G94 - units-per-minute mode (i.e. feedrate mode)|\
     G95 - units-per-revolution mode"
);
const DISTANCE: Text = text!("G90 - absolute distance mode|G91 - incremental distance mode");
const ARC_DISTANCE: Text =
    text!("G90.1 - absolute distance mode|G91.1 - incremental distance mode (default mode)");
const ON: Text = text!("Off|On");
const PATH: Text = text!("G61 - exact path mode|G61.1 - exact stop mode|G64 - continuous mode");

const PROBE: Value = Value::Input(inputs::PROBE as u8);
const DOOR: Value = Value::Input(inputs::DOOR as u8);
const STOP: Value = Value::Input(inputs::STOP as u8);

#[small]
const fn count(name: &str, source: Source, label: Text, choices: Text) -> Single {
    Single { token: token(name), source, form: Form::Count, label, choices }
}

#[small]
const fn speed(name: &str, source: Source, label: Text) -> Single {
    Single { token: token(name), source, form: Form::Speed, label, choices: NONE }
}

#[small]
const fn turns(name: &str, source: Source, label: Text) -> Single {
    Single { token: token(name), source, form: Form::Turns, label, choices: NONE }
}

#[small]
const fn factor(name: &str, of: Override, label: Text) -> Single {
    let (source, form) = (Source::Of(Value::Override(of)), Form::Factor);
    Single { token: token(name), source, form, label, choices: NONE }
}

#[small]
const fn single(name: &str, source: Source, form: Form) -> Single {
    Single { token: token(name), source, form, label: NONE, choices: NONE }
}

#[small]
const fn vector(name: &str, form: Form, members: u8, label: Text) -> Vector {
    Vector { token: token(name), form, members, label }
}

progmem! {
    /// Values with names of their own.
    pub static SINGLES: [Single; SINGLE_COUNT] = [
        count("n", of(Value::FinishedLine), text!("Line finished:"), NONE),
        count("line", of(Value::MotionLine), LINE, NONE),
        speed("vel", of(Value::Velocity), text!("Velocity:")),
        speed("feed", of(Value::Feed), text!("Feed rate:")),
        count("stat", Source::State, text!("Machine state:"), STATES),
        count("macs", Source::Machine, text!("Raw machine state:"), MACHINE),
        count("cycs", Source::Cycle, text!("Cycle state:"), text!("Off|Machining|Probe|Homing|Jog")),
        count("mots", Source::Motion, text!("Motion state:"), text!("Stop|Run|Hold")),
        count("hold", Source::Hold, text!("Feedhold state:"), text!("Off|Sync|Plan|Decel|Hold|End-Hold")),
        count("unit", of(Value::Units), text!("Units:"), text!("G20 - inches mode|G21 - millimeter mode")),
        count("coor", of(Value::Coordinates), text!("Coordinate system:"), COORDINATES),
        count("momo", of(Value::MotionMode), text!("Motion mode:"), MOTION),
        count("plan", of(Value::Plane), text!("Plane:"), text!("G17 - XY plane|G18 - XZ plane|G19 - YZ plane")),
        count("path", of(Value::Path), text!("Path Mode:"), PATH),
        count("dist", of(Value::Distance), text!("Distance mode:"), DISTANCE),
        count("frmo", of(Value::FeedMode), text!("Feed rate mode:"), FEED),
        count("tool", of(Value::Tool), text!("Tool number"), NONE),
        count("home", of(Value::Home), text!("Homing state:"), text!("Not Homed|Homed|Homing")),
        count("chk", of(Value::Check), text!("Check mode:"), ON),
        count("qr", of(Value::QueueFree), NONE, NONE),
        count("qi", of(Value::QueueAdded), NONE, NONE),
        count("qo", of(Value::QueueRemoved), NONE, NONE),
        count("rx", Source::Room, NONE, NONE),
        count("admo", of(Value::ArcDistance), text!("Arc Distance mode:"), ARC_DISTANCE),
        count("spe", of(Value::SpindleOn), text!("Spindle:"), ON),
        count("spd", of(Value::SpindleDirection), text!("Spindle direction:"), text!("CW|CCW")),
        turns("sps", of(Value::SpindleSpeed), text!("Spindle speed:")),
        count("spx", of(Value::PulseMisfits), text!("Encoder misfits:"), NONE),
        single("spf", of(Value::SyncError), Form::Micrometres),
        count("com", of(Value::Mist), text!("Mist coolant:"), ON),
        count("cof", of(Value::Flood), text!("Flood coolant:"), ON),
        factor("mfo", Override::Feed, text!("Feed override:")),
        factor("mto", Override::Traverse, text!("Traverse override:")),
        factor("sso", Override::Spindle, text!("Spindle override:")),
        count("mfoe", of(Value::OverrideOn(Override::Feed)), text!("Feed override enable:"), ON),
        count("mtoe", of(Value::OverrideOn(Override::Traverse)), text!("Traverse override enable:"), ON),
        count("ssoe", of(Value::OverrideOn(Override::Spindle)), text!("Spindle override enable:"), ON),
        count("fd", Source::Zero, NONE, NONE),
        single("ma", Source::Zero, Form::Length),
        count("rst", of(Value::Reset), text!("Last reset:"), text!("Power on|External|Brown-out|Watchdog|Asked for")),
        count("stv", of(Value::Starvations), text!("Late segments:"), NONE),
        count("usbr", of(Value::UsbRestarts), NONE, NONE),
        count("usbe", of(Value::UsbErrors), NONE, NONE),
        count("pls", of(Value::AtCounter), NONE, NONE),
        count("kept", of(Value::Kept), NONE, NONE),
        count("inp", of(PROBE), text!("Probe:"), NONE),
        count("ind", of(DOOR), text!("Door:"), NONE),
        count("ine", of(STOP), text!("Emergency stop:"), NONE),
        #[cfg(feature = "sd")]
        count("sdu", of(Value::FileUse), text!("File:"), text!("None|Selected|Runs|Is written")),
        #[cfg(feature = "sd")]
        count("sdat", of(Value::FileAt), NONE, NONE),
        #[cfg(feature = "sd")]
        count("sdof", of(Value::FileLength), NONE, NONE),
        #[cfg(feature = "printer")]
        single("he1t", of(Value::Temperature(0)), Form::Degrees),
        #[cfg(feature = "printer")]
        single("he3t", of(Value::Temperature(1)), Form::Degrees),
        #[cfg(feature = "printer")]
        single("he1s", of(Value::WantedTemperature(0)), Form::Degrees),
        #[cfg(feature = "printer")]
        single("he3s", of(Value::WantedTemperature(1)), Form::Degrees),
        #[cfg(feature = "printer")]
        single("he1o", of(Value::HeaterPower(0)), Form::Factor),
        #[cfg(feature = "printer")]
        single("he3o", of(Value::HeaterPower(1)), Form::Factor),
        #[cfg(feature = "drivers")]
        count("drx1", of(Value::Driver(0)), text!("Driver 1:"), DRIVER),
        #[cfg(feature = "drivers")]
        count("drx2", of(Value::Driver(1)), text!("Driver 2:"), DRIVER),
        #[cfg(feature = "drivers")]
        count("drx3", of(Value::Driver(2)), text!("Driver 3:"), DRIVER),
        #[cfg(feature = "drivers")]
        count("drx4", of(Value::Driver(3)), text!("Driver 4:"), DRIVER),
        count("prbe", of(Value::ProbeState), text!("Probe state:"), text!("Failed|Succeeded|Waiting")),
    ];

    /// The groups of values by axis, motor or input. [`vector_value`] depends on their order.
    pub static VECTORS: [Vector; VECTOR_COUNT] = [
        vector("mpo", Form::Millimetres, 6, text!(" machine posn:")),
        vector("pos", Form::Length, 6, text!(" position:")),
        vector("ofs", Form::Millimetres, 6, text!(" work offset:")),
        vector("hom", Form::Count, 6, text!(" axis homing state:")),
        vector("tof", Form::Millimetres, 6, text!(" tool length:")),
        vector("g92", Form::Length, 6, NONE),
        vector("pwr", Form::Count, 4, NONE),
        vector("_te", Form::Rough, 6, NONE),
        vector("_tr", Form::Rough, 6, NONE),
        vector("_ts", Form::Steps, 4, NONE),
        vector("_ps", Form::Steps, 4, NONE),
        vector("_cs", Form::Steps, 4, NONE),
        vector("_es", Form::Steps, 4, NONE),
        vector("_xs", Form::Steps, 4, NONE),
        vector("_fe", Form::Steps, 4, NONE),
        vector("prb", Form::Millimetres, 6, NONE),
        vector("in", Form::Count, inputs::ENDS as u8, NONE),
    ];
}

/// Returns the source of member `index` of a vector.
#[small]
pub fn vector_value(vector: u8, index: u8) -> Source {
    let value = match vector {
        0 => Value::MachinePosition(index),
        1 => Value::Position(index),
        2 => Value::Offset(index),
        3 => Value::Homed(index),
        4 => Value::ToolOffset(index),
        SHIFT => Value::Shift(index),
        6 => Value::Powered(index),
        7 => Value::Target(index),
        8 => Value::MachinePosition(index),
        9..13 => Value::Steps(index),
        13 | 14 => return Source::Zero,
        PROBED => Value::Probed(index),
        _ => Value::Input(index),
    };
    Source::Of(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shows_in_the_units_in_force() {
        let show = |form: Form, value, inches| form.show(value, inches);
        assert_eq!(show(Form::Speed, 25_400, true), Fixed { value: 100, decimals: 2 });
        assert_eq!(show(Form::Length, 254_000, true), Fixed { value: 1000, decimals: 3 });
        assert_eq!(show(Form::Millimetres, 254_000, true), Fixed { value: 25_400, decimals: 3 });
        assert_eq!(show(Form::Count, 7, true), Fixed::int(7));
    }
}
