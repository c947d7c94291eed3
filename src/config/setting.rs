//! [`Setting`], the handle of a setting: it gives the setting's owner and its row of the table.

#[cfg(feature = "drivers")]
use super::groups::driver;
use super::groups::{
    axis, bed, coolant, hot_end, job, motor, pwm, shaper, spindle, squaring, system, user,
};
use super::machines;
use super::name::{Name, axis_letter, axis_of, token};
use super::table::{HOMING, IDLE, Kind, MODE, RADIUS, SettingRow, row_of};
use super::words::Words;
use crate::boards::{ACTIVE, MOTORS};
use crate::capability::Capability;
use crate::progmem::{Slice, Text};
use crate::status::Status;
use crate::text;
use crate::units::{AXES, FIRST_ROTARY};

const FIRST_MOTOR: u8 = system::COUNT as u8;
/// The digit that names the group of the last motor.
const LAST_MOTOR: u8 = b'0' + MOTORS as u8;
const FIRST_AXIS: u8 = FIRST_MOTOR + (MOTORS * motor::COUNT) as u8;
const FIRST_PWM: u8 = FIRST_AXIS + (AXES * axis::COUNT) as u8;
const FIRST_SPINDLE: u8 = FIRST_PWM + pwm::COUNT as u8;
const FIRST_COOLANT: u8 = FIRST_SPINDLE + spindle::COUNT as u8;
const FIRST_SQUARING: u8 = FIRST_COOLANT + coolant::COUNT as u8;
const FIRST_HOT_END: u8 = FIRST_SQUARING + squaring::COUNT as u8;
const FIRST_BED: u8 = FIRST_HOT_END + HOT_END;
const FIRST_SHAPER: u8 = FIRST_BED + BED;
const FIRST_DRIVER: u8 = FIRST_SHAPER + SHAPER;
const FIRST_USER: u8 = FIRST_DRIVER + DRIVER;
const FIRST_JOB: u8 = FIRST_USER + USERS * user::COUNT as u8;

/// The number of rows for heaters: 0 in an image that cannot print.
const HOT_END: u8 = if Capability::Printer.is_built_in() { hot_end::COUNT as u8 } else { 0 };
const BED: u8 = if Capability::Printer.is_built_in() { bed::COUNT as u8 } else { 0 };

/// The number of rows for input shaping: 0 in an image that cannot shape.
const SHAPER: u8 = if Capability::Shaping.is_built_in() { shaper::COUNT as u8 } else { 0 };

/// The number of rows for motor drivers: 0 in an image without configurable drivers.
#[cfg(feature = "drivers")]
const DRIVER: u8 = driver::COUNT as u8;
#[cfg(not(feature = "drivers"))]
const DRIVER: u8 = 0;

/// The number of groups of user data, `uda` to `udd`.
pub const USERS: u8 = 4;

/// What a setting belongs to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Owner {
    /// The machine.
    System,
    /// A motor, from 0 on.
    Motor(u8),
    /// An axis, 0 to 5.
    Axis(u8),
    /// The PWM output of the spindle.
    Pwm,
    /// The spindle.
    Spindle,
    /// The coolant.
    Coolant,
    /// The second motor of an axis that two motors move.
    Squaring,
    /// The hot end.
    HotEnd,
    /// The bed.
    Bed,
    /// Input shaping.
    Shaper,
    /// The drivers of motors.
    #[cfg(feature = "drivers")]
    Drivers,
    /// A group of user data for the sender's own use, 0 to 3.
    User(u8),
    /// The job that runs, as senders identify it.
    Job,
}

#[small]
impl Owner {
    /// Returns the number of table rows that describe the owner's settings.
    pub fn rows(self) -> u8 {
        match self {
            Owner::System => system::COUNT as u8,
            Owner::Motor(_) => motor::COUNT as u8,
            Owner::Axis(_) => axis::COUNT as u8,
            Owner::Pwm => pwm::COUNT as u8,
            Owner::Spindle => spindle::COUNT as u8,
            Owner::Coolant => coolant::COUNT as u8,
            Owner::Squaring => squaring::COUNT as u8,
            Owner::HotEnd => HOT_END,
            Owner::Bed => BED,
            Owner::Shaper => SHAPER,
            #[cfg(feature = "drivers")]
            Owner::Drivers => DRIVER,
            Owner::User(_) => user::COUNT as u8,
            Owner::Job => job::COUNT as u8,
        }
    }

    /// Returns the owner's settings.
    #[inline(always)]
    pub fn settings(self) -> impl Iterator<Item = Setting> {
        (0..self.rows()).filter_map(move |row| Setting::of(self, row))
    }

    /// Returns the name of the owner's group, which is the prefix of its settings' names. Empty for the system.
    pub fn prefix(self) -> Name {
        match self {
            Owner::System => Name::new(),
            Owner::Motor(motor) => named([b'1' + motor, 0, 0, 0]),
            Owner::Axis(axis) => named([axis_letter(axis), 0, 0, 0]),
            Owner::Pwm => named(token("p1")),
            Owner::Spindle => named(token("sp")),
            Owner::Coolant => named(token("co")),
            Owner::Squaring => named(token("sq")),
            Owner::HotEnd => named(token("he1")),
            Owner::Bed => named(token("he3")),
            Owner::Shaper => named(token("is")),
            #[cfg(feature = "drivers")]
            Owner::Drivers => named(token("dr")),
            Owner::User(group) => named([b'u', b'd', b'a' + group, 0]),
            Owner::Job => named(token("jid")),
        }
    }

    /// Returns the owner with whose prefix `name` begins; `None` for names of the system.
    pub fn of_name(name: &Name) -> Option<Owner> {
        match *name.bytes() {
            [motor @ b'1'..=LAST_MOTOR, ..] => Some(Owner::Motor(motor - b'1')),
            [b'p', b'1', ..] => Some(Owner::Pwm),
            [b's', b'p', ..] => Some(Owner::Spindle),
            [b'c', b'o', ..] => Some(Owner::Coolant),
            [b's', b'q', ..] => Some(Owner::Squaring),
            [b'h', b'e', b'1', ..] if HOT_END != 0 => Some(Owner::HotEnd),
            [b'h', b'e', b'3', ..] if BED != 0 => Some(Owner::Bed),
            [b'i', b's', ..] if SHAPER != 0 => Some(Owner::Shaper),
            #[cfg(feature = "drivers")]
            [b'd', b'r', ..] => Some(Owner::Drivers),
            [b'u', b'd', group @ b'a'..=b'd', ..] => Some(Owner::User(group - b'a')),
            [b'j', b'i', b'd', ..] => Some(Owner::Job),
            [letter, ..] => axis_of(letter).map(Owner::Axis),
            [] => None,
        }
    }

    /// Returns the owner whose prefix `name` is.
    pub fn called(name: &Name) -> Option<Owner> {
        Owner::of_name(name).filter(|owner| owner.prefix() == *name)
    }

    /// Whether the owner is a rotary axis.
    pub fn is_rotary(self) -> bool {
        matches!(self, Owner::Axis(axis) if usize::from(axis) >= FIRST_ROTARY)
    }

    pub(super) fn has(self, row: &SettingRow) -> bool {
        match self {
            Owner::Axis(axis) if row.is(HOMING) => usize::from(axis) <= FIRST_ROTARY,
            Owner::Axis(_) if row.is(RADIUS) => self.is_rotary(),
            _ => true,
        }
    }

    /// Returns the table of the owner's settings.
    fn table(self) -> Option<Slice<SettingRow>> {
        Some(match self {
            Owner::System => system::ROWS.slice(),
            Owner::Motor(motor) if usize::from(motor) < MOTORS => motor::ROWS.slice(),
            Owner::Axis(axis) if usize::from(axis) < AXES => axis::ROWS.slice(),
            Owner::Pwm => pwm::ROWS.slice(),
            Owner::Spindle => spindle::ROWS.slice(),
            Owner::Coolant => coolant::ROWS.slice(),
            Owner::Squaring => squaring::ROWS.slice(),
            Owner::HotEnd if HOT_END != 0 => hot_end::ROWS.slice(),
            Owner::Bed if BED != 0 => bed::ROWS.slice(),
            Owner::Shaper if SHAPER != 0 => shaper::ROWS.slice(),
            #[cfg(feature = "drivers")]
            Owner::Drivers => driver::ROWS.slice(),
            Owner::User(group) if group < USERS => user::ROWS.slice(),
            Owner::Job => job::ROWS.slice(),
            _ => return None,
        })
    }

    /// Returns motor or axis `number`, if this owner is a motor or an axis; else this owner.
    pub(super) fn numbered(self, number: u8) -> Owner {
        match self {
            Owner::Motor(_) => Owner::Motor(number),
            Owner::Axis(_) => Owner::Axis(number),
            owner => owner,
        }
    }

    /// Returns where the owner's setting of this row is kept.
    #[inline(never)]
    pub(super) fn place(self, row: &SettingRow) -> Place {
        let (small, large) = match self {
            Owner::Motor(motor) => (motor * motor::SMALLS[0] as u8, motor * motor::LARGES[0] as u8),
            Owner::Axis(axis) => (small_of(axis), large_of(axis)),
            Owner::Job => (0, large_of(AXES as u8) + system::LARGES[0] as u8),
            _ => (small_of(AXES as u8), large_of(AXES as u8)),
        };
        match row.kind {
            Kind::Small => Place::Small(small + row.slot),
            Kind::Large | Kind::Job => Place::Large(large + row.slot),
            Kind::Cold | Kind::Data => Place::Log,
            Kind::Constant | Kind::Text => Place::Constant,
        }
    }

    /// Returns what text mode calls the owner's settings, by row.
    pub(super) fn words(self) -> Slice<Words> {
        match self {
            Owner::System => system::WORDS.slice(),
            Owner::Motor(_) => motor::WORDS.slice(),
            Owner::Axis(_) => axis::WORDS.slice(),
            Owner::Pwm => pwm::WORDS.slice(),
            Owner::Spindle => spindle::WORDS.slice(),
            Owner::Coolant => coolant::WORDS.slice(),
            Owner::Squaring => squaring::WORDS.slice(),
            Owner::HotEnd if HOT_END != 0 => hot_end::WORDS.slice(),
            Owner::Bed if BED != 0 => bed::WORDS.slice(),
            Owner::Shaper if SHAPER != 0 => shaper::WORDS.slice(),
            Owner::HotEnd | Owner::Bed | Owner::Shaper => squaring::WORDS.slice(),
            #[cfg(feature = "drivers")]
            Owner::Drivers => driver::WORDS.slice(),
            Owner::User(_) => user::WORDS.slice(),
            Owner::Job => job::WORDS.slice(),
        }
    }

    /// Returns a row of the owner's table; `None` if the owner lacks that setting.
    pub(super) fn load(self, row: u8) -> Option<SettingRow> {
        self.table()?.at(row.into()).filter(|row| self.has(row))
    }
}

/// Takes the token by value, because a slice of a constant would occupy RAM.
#[inline(never)]
#[small]
fn named(token: [u8; 4]) -> Name {
    Name::new().with_token(token)
}

/// Where the value of a setting is kept.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Place {
    /// In a byte of [`Settings`](super::Settings), at this index.
    Small(u8),
    /// In a 32-bit word of [`Settings`](super::Settings), at this index.
    Large(u8),
    /// In the table: its default is its value.
    Constant,
    /// In EEPROM only.
    Log,
}

/// The number of bytes for settings in RAM.
pub const SMALLS: usize = small_of(AXES as u8) as usize + system::SMALLS[0];
/// The number of 32-bit words for settings in RAM.
pub const LARGES: usize = large_of(AXES as u8) as usize + system::LARGES[0] + job::COUNT;

/// The room of all axes before this one. Each axis takes `all`, and an axis that homes takes `homing` in addition.
const fn base(axis: u8, [all, homing]: [usize; 2]) -> u8 {
    let homes = FIRST_ROTARY as u8 + 1;
    let homes = if axis < homes { axis } else { homes };
    axis * all as u8 + homes * homing as u8
}

/// Returns the index of the first byte of an axis; for axis 6, of the system. The bytes of motors come first.
pub const fn small_of(axis: u8) -> u8 {
    (MOTORS * motor::SMALLS[0]) as u8 + base(axis, axis::SMALLS)
}

/// Returns the index of the first word of an axis; for axis 6, of the system. The words of motors come first.
pub const fn large_of(axis: u8) -> u8 {
    (MOTORS * motor::LARGES[0]) as u8 + base(axis, axis::LARGES)
}

/// The number of settings, as a `usize` so that the sum cannot wrap.
const NUMBERS: usize = system::COUNT
    + MOTORS * motor::COUNT
    + AXES * axis::COUNT
    + pwm::COUNT
    + spindle::COUNT
    + coolant::COUNT
    + squaring::COUNT
    + HOT_END as usize
    + BED as usize
    + SHAPER as usize
    + DRIVER as usize
    + USERS as usize * user::COUNT
    + job::COUNT;
const _: () = assert!(
    NUMBERS <= u8::MAX as usize,
    "there are more settings than a byte can number: make `Setting` and what is kept of it (`Storage`, `Item`) two bytes wide"
);
const _: () = assert!(
    MOTORS * motor::SMALLS[0] + AXES * (axis::SMALLS[0] + axis::SMALLS[1]) + system::SMALLS[0]
        <= 256
        && MOTORS * motor::LARGES[0]
            + AXES * (axis::LARGES[0] + axis::LARGES[1])
            + system::LARGES[0]
            + job::COUNT
            <= 256,
    "the settings have more places in RAM than a byte can number: widen `Place`, or keep some in EEPROM alone (`Kind::Cold`)"
);

/// A setting.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Setting(u8);

#[small]
impl Setting {
    /// Numbers below this may be settings. Some in that range are not.
    pub const NUMBERS: u8 = FIRST_JOB + job::COUNT as u8;
    /// Numbers below this may be settings that are in RAM and kept.
    pub const WARM: u8 = FIRST_PWM;
    /// Numbers from [`Self::WARM`] up to this one, exclusive, are settings that are in EEPROM only.
    pub const COLD: u8 = FIRST_JOB;

    /// An upper bound for the number of kept settings, in RAM or in EEPROM only. One or two of the counted ones are
    /// not kept.
    pub const KEPT: u16 = (SMALLS + LARGES - job::COUNT) as u16 + (Self::COLD - Self::WARM) as u16;

    /// The number of the setting that holds Kerf's version.
    pub const VERSION: u8 = row_of(&system::LIST, "kerf");

    /// The number of the setting.
    pub fn number(self) -> u8 {
        self.0
    }

    /// Returns the setting with that number; `None` if there is none. Some axes lack some settings.
    pub fn from_number(number: u8) -> Option<Setting> {
        let setting = Setting(number);
        setting.owner().load(setting.index()).map(|_| setting)
    }

    /// Returns the setting with a number from the entries of machines. The build checks that these numbers are valid.
    pub(super) const fn of_entry(number: u8) -> Setting {
        Setting(number)
    }

    /// Returns the setting of `owner` in `row` of its table; `None` if the owner lacks that setting.
    pub fn of(owner: Owner, row: u8) -> Option<Setting> {
        let base = match owner {
            Owner::System => 0,
            Owner::Motor(motor) => FIRST_MOTOR + motor * motor::COUNT as u8,
            Owner::Axis(axis) => FIRST_AXIS + axis * axis::COUNT as u8,
            Owner::Pwm => FIRST_PWM,
            Owner::Spindle => FIRST_SPINDLE,
            Owner::Coolant => FIRST_COOLANT,
            Owner::Squaring => FIRST_SQUARING,
            Owner::HotEnd => FIRST_HOT_END,
            Owner::Bed => FIRST_BED,
            Owner::Shaper => FIRST_SHAPER,
            #[cfg(feature = "drivers")]
            Owner::Drivers => FIRST_DRIVER,
            Owner::User(group) => FIRST_USER + group * user::COUNT as u8,
            Owner::Job => FIRST_JOB,
        };
        owner.load(row).map(|_| Setting(base + row))
    }

    /// Returns the setting called `name`; `None` if there is none. About 1,000 cycles on AVR.
    #[small]
    pub fn find(name: &Name) -> Option<Setting> {
        let search = |owner: Owner| {
            let token = name.row_name(owner.prefix().bytes().len())?;
            Setting::of(owner, owner.table()?.find(token)?)
        };
        let owner = Owner::of_name(name);
        owner.and_then(search).or_else(|| search(Owner::System))
    }

    /// Whether this is `ej`, the mode at power-up.
    pub fn is_mode(self) -> bool {
        self.0 == const { row_of(&system::LIST, "ej") }
    }

    /// Whether this is `mi`, the microsteps of a motor.
    pub fn is_microsteps(self) -> bool {
        matches!(self.owner(), Owner::Motor(_))
            && self.index() == const { row_of(&motor::LIST, "mi") }
    }

    /// Whether the board's drivers can have this value. Where drivers are configured by UART, microsteps must be a
    /// power of two.
    pub(super) fn suits_driver(self, value: i32) -> bool {
        const TOLD: bool = ACTIVE.drivers.is_some() && Capability::Drivers.is_built_in();
        !TOLD || !self.is_microsteps() || value.count_ones() == 1
    }

    /// Whether the setting is refused while anything moves. A change in mid-motion would alter the meaning of steps
    /// that are already planned.
    pub fn needs_rest(self) -> bool {
        matches!(self.owner(), Owner::Motor(_)) || self.row().is(IDLE)
    }

    /// Why this constant cannot be set.
    pub fn refusal(self) -> Status {
        let lacks = !Capability::Backlash.is_built_in() && self.is_backlash();
        if lacks { Status::NotBuiltIn } else { Status::ReadOnly }
    }

    /// Whether this is `bl`, the backlash of an axis.
    fn is_backlash(self) -> bool {
        matches!(self.owner(), Owner::Axis(_))
            && self.index() == const { row_of(&axis::LIST, "bl") }
    }

    /// Whether this is `baud`, the rate of the serial line.
    pub fn is_baud(self) -> bool {
        self.0 == const { row_of(&system::LIST, "baud") }
    }

    /// Whether this is `ej`, the mode in which TinyG's dialect starts.
    pub fn is_start_mode(self) -> bool {
        self.0 == const { row_of(&system::LIST, "ej") }
    }

    /// Whether this is `dia`, the dialect of the ports.
    pub fn is_dialect(self) -> bool {
        self.0 == const { row_of(&system::LIST, "dia") }
    }

    /// Whether the setting is in EEPROM only.
    pub fn is_cold(self) -> bool {
        (Self::WARM..Self::COLD).contains(&self.0)
    }

    /// The text of a setting whose kind is [`Kind::Text`].
    pub fn text(self) -> Text {
        if self.row().max != 0 { text!(env!("CARGO_PKG_VERSION")) } else { text!("0000-KERF") }
    }

    /// Whether the setting is written as hexadecimal.
    pub fn is_data(self) -> bool {
        matches!(self.row().kind, Kind::Data | Kind::Job)
    }

    /// Whether the setting is in RAM and survives a power cut. All settings in RAM do, except the rate of the serial
    /// line: a stored rate could lock the user out.
    pub fn is_kept(self) -> bool {
        matches!(self.row().kind, Kind::Small | Kind::Large) && !self.is_baud()
    }

    /// Whether the setting can have this value, scaled as stored.
    pub fn accepts(self, value: i32) -> bool {
        let row = self.row();
        let linear_mode = row.is(MODE) && !self.owner().is_rotary();
        (row.min..=row.max - i32::from(linear_mode)).contains(&value) && self.suits_driver(value)
    }

    /// `mch`, the machine's profile.
    pub const MACHINE: Setting = Setting(machines::CHOICE);

    /// Whether this is `mch`, the machine's profile.
    pub fn is_machine(self) -> bool {
        self == Self::MACHINE
    }

    /// Whether this is a velocity limit of an axis, `vm` or `fr`, which a change of another setting may lower.
    pub fn is_velocity(self) -> bool {
        let row = self.row();
        let is_limit = row.kind == Kind::Large && matches!(row.slot, axis::VM | axis::FR);
        is_limit && matches!(self.owner(), Owner::Axis(_))
    }

    /// Whether this is `spw`, the width of step pulses.
    pub fn is_pulse_width(self) -> bool {
        self.0 == const { row_of(&system::LIST, "spw") }
    }

    /// Returns the owner of the setting.
    pub fn owner(self) -> Owner {
        #[cfg(feature = "drivers")]
        if (FIRST_DRIVER..FIRST_USER).contains(&self.0) {
            return Owner::Drivers;
        }
        if self.0 < FIRST_MOTOR {
            Owner::System
        } else if self.0 < FIRST_AXIS {
            Owner::Motor((self.0 - FIRST_MOTOR) / motor::COUNT as u8)
        } else if self.0 < FIRST_PWM {
            Owner::Axis((self.0 - FIRST_AXIS) / axis::COUNT as u8)
        } else if self.0 < FIRST_SPINDLE {
            Owner::Pwm
        } else if self.0 < FIRST_COOLANT {
            Owner::Spindle
        } else if self.0 < FIRST_SQUARING {
            Owner::Coolant
        } else if self.0 < FIRST_HOT_END {
            Owner::Squaring
        } else if self.0 < FIRST_BED {
            Owner::HotEnd
        } else if self.0 < FIRST_SHAPER {
            Owner::Bed
        } else if self.0 < FIRST_DRIVER {
            Owner::Shaper
        } else if self.0 < FIRST_JOB {
            Owner::User((self.0 - FIRST_USER) / user::COUNT as u8)
        } else {
            Owner::Job
        }
    }

    /// Returns the full name of the setting.
    pub fn name(self) -> Name {
        self.owner().prefix().with_token(self.row().token)
    }

    /// Returns the number of its row in the owner's table.
    pub fn index(self) -> u8 {
        match self.owner() {
            Owner::System => self.0,
            Owner::Motor(_) => (self.0 - FIRST_MOTOR) % motor::COUNT as u8,
            Owner::Axis(_) => (self.0 - FIRST_AXIS) % axis::COUNT as u8,
            Owner::Pwm => self.0 - FIRST_PWM,
            Owner::Spindle => self.0 - FIRST_SPINDLE,
            Owner::Coolant => self.0 - FIRST_COOLANT,
            Owner::Squaring => self.0 - FIRST_SQUARING,
            Owner::HotEnd => self.0 - FIRST_HOT_END,
            Owner::Bed => self.0 - FIRST_BED,
            Owner::Shaper => self.0 - FIRST_SHAPER,
            #[cfg(feature = "drivers")]
            Owner::Drivers => self.0 - FIRST_DRIVER,
            Owner::User(_) => (self.0 - FIRST_USER) % user::COUNT as u8,
            Owner::Job => self.0 - FIRST_JOB,
        }
    }

    /// Returns the row of the setting.
    pub fn row(self) -> SettingRow {
        // Handles are only made for numbers that have a row.
        self.owner().load(self.index()).unwrap_or(SettingRow::NONE)
    }

    /// Returns this setting of the first motor or axis, and the bit of the motor or axis that owns this one.
    pub(super) fn first_of_row(self) -> (Setting, u8) {
        match self.owner() {
            Owner::Motor(motor) => (Setting(self.0 - motor * motor::COUNT as u8), 1 << motor),
            Owner::Axis(axis) => (Setting(self.0 - axis * axis::COUNT as u8), 1 << axis),
            _ => (self, 1),
        }
    }

    /// Returns the value of the setting in the profile of a machine, scaled as stored. About 3,000 cycles on AVR.
    pub fn value_on(self, machine: u8) -> i32 {
        if self.is_machine() {
            return machine.into();
        }
        if machine == machines::ACTIVE {
            return self.default_value();
        }
        // Two profiles differ by way of the careful machine.
        let of = |machine| machines::value(machine, self);
        of(machine).or_else(|| of(machines::ACTIVE)).unwrap_or_else(|| self.default_value())
    }

    /// Returns the default of the setting, scaled as stored.
    #[inline(never)]
    pub fn default_value(self) -> i32 {
        let index = usize::from(self.index());
        let value = match self.owner() {
            Owner::System => system::DEFAULTS.at(index),
            Owner::Motor(motor) => {
                motor::DEFAULTS.at(index).and_then(|d| d.get(usize::from(motor)).copied())
            }
            Owner::Axis(axis) => {
                axis::DEFAULTS.at(index).and_then(|d| d.get(usize::from(axis)).copied())
            }
            Owner::Pwm => pwm::DEFAULTS.at(index),
            Owner::Spindle => spindle::DEFAULTS.at(index),
            Owner::HotEnd if HOT_END != 0 => hot_end::DEFAULTS.at(index),
            Owner::Bed if BED != 0 => bed::DEFAULTS.at(index),
            Owner::Shaper if SHAPER != 0 => shaper::DEFAULTS.at(index),
            Owner::HotEnd | Owner::Bed | Owner::Shaper => None,
            #[cfg(feature = "drivers")]
            Owner::Drivers => driver::DEFAULTS.at(index),
            Owner::Coolant | Owner::Squaring | Owner::User(_) | Owner::Job => None,
        };
        value.unwrap_or(0)
    }

    /// Returns where the value of the setting is kept.
    pub fn place(self) -> Place {
        self.owner().place(&self.row())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::string::String;
    use std::vec::Vec;

    fn all() -> impl Iterator<Item = Setting> {
        (0..=u8::MAX).filter_map(Setting::from_number)
    }

    #[test]
    fn every_name_finds_its_setting() {
        for setting in all() {
            assert_eq!(Setting::find(&setting.name()), Some(setting), "{:?}", setting.name());
            assert!(setting.number() < Setting::NUMBERS);
        }
        for bad in [
            "", "x", "p1", "p1f", "uda", "uda4", "jid", "jide", "xra", "bsn", "5ma", "foo",
            "bauds", "xvmm",
        ] {
            assert_eq!(Setting::find(&Name::new().with(bad.as_bytes()).unwrap()), None, "{bad}");
        }
    }

    #[test]
    fn no_place_is_used_twice() {
        let mut places = HashSet::new();
        for setting in all() {
            let place = setting.place();
            let nowhere = matches!(place, Place::Constant | Place::Log);
            assert!(nowhere || places.insert(std::format!("{place:?}")));
            match place {
                Place::Small(slot) => assert!(usize::from(slot) < SMALLS),
                Place::Large(slot) => assert!(usize::from(slot) < LARGES),
                Place::Constant => {}
                Place::Log => assert!(setting.is_cold()),
            }
        }
        // X Y Z have no radius.
        assert_eq!(places.len(), SMALLS + LARGES - 3);
    }

    #[test]
    fn defaults_keep_the_limits() {
        for setting in all().filter(|s| s.place() != Place::Constant) {
            let (row, value) = (setting.row(), setting.default_value());
            assert!((row.min..=row.max).contains(&value), "{:?}", setting.name());
        }
    }

    #[test]
    fn axes_list_what_they_have() {
        let list = |owner: Owner| -> Vec<String> {
            let rows = (0..owner.rows()).filter_map(|row| Setting::of(owner, row));
            rows.map(|s| String::from_utf8(s.name().bytes()[1..].to_vec()).unwrap()).collect()
        };
        assert_eq!(
            list(Owner::Axis(0)).join(" "),
            "am vm fr tn tm jm jh jd sn sx sv lv lb zb ac bl"
        );
        assert_eq!(
            list(Owner::Axis(3)).join(" "),
            "am vm fr tn tm jm jh jd ra sn sx sv lv lb zb ac bl"
        );
        assert_eq!(list(Owner::Axis(5)).join(" "), "am vm fr tn tm jm jd ra ac");
        assert_eq!(list(Owner::Motor(2)).join(" "), "ma sa tr mi po pm sp");
        assert_eq!(list(Owner::User(3)).join(" "), "dd0 dd1 dd2 dd3");
    }
}
