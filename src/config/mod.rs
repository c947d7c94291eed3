//! Settings: the table that describes them, and their current values.
//!
//! `protocol` reads and writes settings by name through [`Setting`]. Everything else uses the getters of
//! [`Settings`], each of which costs one load. Values are integers scaled by a power of ten, so text converts to them
//! and back exactly. Settings that are rarely read are in EEPROM only, and `tasks::storage` reads them.

pub mod bed;
#[cfg(feature = "std")]
pub mod docs;
pub mod drive;
pub mod groups;
pub mod heating;
pub mod machines;
pub mod name;
pub mod number;
pub mod ratio;
pub mod rows;
pub mod setting;
pub mod shape;
pub mod table;
pub mod words;

/// The version of Kerf.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

pub use name::Name;
pub use number::{Digits, Fixed, Number, hex};
pub use ratio::StepRatio;
pub use setting::{Owner, Place, Setting};
pub use words::Words;

use crate::baud;
use crate::boards::MOTORS;
use crate::kinematics;
use crate::status::Status;
use crate::units::{AXES, FIRST_ROTARY};
use bed::{BEDS, Bed};
use drive::{DRIVERS, Drive};
use groups::motor;
use heating::Heating;
use setting::{LARGES, SMALLS, large_of, small_of};
use shape::{Resonances, SHAPED};
use table::{CLAMP, JERK, Kind, MODE, RADIUS, RANGE, SettingRow, UNIT};

/// The current values of the settings.
pub struct Settings {
    small: [u8; SMALLS],
    large: [i32; LARGES],
    /// Steps per length of each motor, derived from its angle, travel and microsteps. Read for every block.
    ratios: [StepRatio; MOTORS],
    /// The octaves of the motor with the finest steps: see [`StepRatio::octaves`]. One more if a motor drives X and Y
    /// together.
    octaves: u8,
    /// The state of the heaters, against which lines are checked. Empty in an image without heaters.
    pub heating: [Heating; heating::PRINTERS],
    /// The configuration of the motor drivers. Empty in an image without configurable drivers.
    pub drives: [Drive; DRIVERS],
    /// The resonances of the axes.
    pub resonances: [Resonances; SHAPED],
    /// Why the drivers do not move the motors, or `Ok`. The task of the drivers keeps it up to date.
    pub undriven: [Status; drive::DRIVEN],
    /// The plane of the printer's bed. Empty in an image without bed levelling.
    pub bed: [Bed; BEDS],
}

impl Default for Settings {
    fn default() -> Self {
        Self::new()
    }
}

impl Settings {
    /// Returns settings that all have their defaults.
    pub fn new() -> Settings {
        let mut settings = Settings::blank();
        settings.set_defaults();
        settings
    }

    /// Returns settings without values, to be filled by [`Settings::set_defaults`].
    pub const fn blank() -> Settings {
        let ratios = [StepRatio::NONE; MOTORS];
        Settings {
            small: [0; SMALLS],
            large: [0; LARGES],
            ratios,
            octaves: 0,
            heating: [Heating::NONE; heating::PRINTERS],
            drives: [Drive::DEFAULT; DRIVERS],
            resonances: [Resonances::NONE; SHAPED],
            undriven: [drive::AT_START; drive::DRIVEN],
            bed: [Bed::NONE; BEDS],
        }
    }

    /// Returns the plane that moves follow; `None` if moves follow no plane.
    #[inline(always)]
    pub fn followed_bed(&self) -> Option<&Bed> {
        self.bed.first().filter(|bed| bed.follows())
    }

    /// Returns the value of a setting, scaled as stored. For a setting that is in EEPROM only this is its default.
    #[small]
    pub fn get(&self, setting: Setting) -> i32 {
        match setting.place() {
            Place::Small(slot) => self.small(slot).into(),
            Place::Large(slot) => self.large(slot),
            Place::Constant => self.constant(setting),
            // `tasks::storage` reads the values that are only in EEPROM.
            Place::Log => setting.default_value(),
        }
    }

    /// Returns the value of a constant. Some constants have other values while the machine identifies itself as a
    /// g2core.
    #[small]
    fn constant(&self, setting: Setting) -> i32 {
        let other = if self.is_g2core() { table::G2CORE.at(setting.number().into()) } else { None };
        other.unwrap_or_else(|| setting.default_value())
    }

    /// Stores a value that [`Settings::check`] returned.
    #[small]
    pub fn store(&mut self, setting: Setting, value: i32) {
        self.keep(setting, value);
        if let Owner::Motor(motor) = setting.owner() {
            self.derive(motor);
        }
    }

    /// Returns the value to store for `number` as sent, or the status with which it is refused.
    #[small]
    pub fn check(&self, setting: Setting, number: Number, inches: bool) -> Result<i32, Status> {
        let row = setting.row();
        if matches!(row.kind, Kind::Constant | Kind::Text) {
            return Err(setting.refusal());
        }
        if row.stored == 0 && !number.is_integer() {
            return Err(Status::BadNumber);
        }
        let million = number.fixed(0, false).is_none_or(|v| v > 1_000_000);
        let number = if row.is(JERK) && million { number.millionth() } else { number };
        let inches = inches && self.is_length(setting, &row);
        let lacks_last = (row.is(MODE) && !setting.owner().is_rotary())
            || (setting.is_mode() && !self.is_g2core());
        let value = limit(&row, row.max - i32::from(lacks_last), number, inches)?;
        if setting.is_baud() && baud::rate(value).is_none() {
            return Err(Status::OutOfRange);
        }
        if !setting.suits_driver(value) || !self.can_shape(setting, value) {
            return Err(Status::OutOfRange);
        }
        if matches!(setting.owner(), Owner::Motor(_)) && row.is_place(Kind::Small, motor::MA) {
            kinematics::check(value)?;
        }
        Ok(value)
    }

    /// Returns a value of a setting as it is shown to senders.
    pub fn show(&self, setting: Setting, value: i32, inches: bool) -> Fixed {
        self.show_as(setting, value, inches, setting.row().shown)
    }

    /// Returns a value of a setting as it is shown to senders, with at most `decimals` decimals.
    #[small]
    pub fn show_as(&self, setting: Setting, value: i32, inches: bool, decimals: u8) -> Fixed {
        let row = setting.row();
        let value = Fixed { value, decimals: row.stored };
        if inches && self.is_length(setting, &row) {
            value.inches(decimals)
        } else {
            value.rounded(decimals)
        }
    }

    /// Whether the setting is a length and not an angle. A length is shown in inches with G20.
    pub fn shows_length(&self, setting: Setting) -> bool {
        self.is_length(setting, &setting.row())
    }

    #[small]
    fn is_length(&self, setting: Setting, row: &SettingRow) -> bool {
        let rotary = match setting.owner() {
            Owner::Motor(motor) => {
                (FIRST_ROTARY..AXES).contains(&usize::from(self.motor_axis(motor.into())))
            }
            owner => owner.is_rotary() && !row.is(RADIUS),
        };
        row.is(UNIT) && !rotary
    }

    #[small]
    fn keep(&mut self, setting: Setting, value: i32) {
        self.put(setting.place(), value);
    }

    #[inline(never)]
    #[small]
    fn put(&mut self, place: Place, value: i32) {
        match place {
            Place::Small(slot) => {
                if let Some(place) = self.small.get_mut(usize::from(slot)) {
                    *place = value as u8;
                }
            }
            Place::Large(slot) => {
                if let Some(place) = self.large.get_mut(usize::from(slot)) {
                    *place = value;
                }
            }
            Place::Constant | Place::Log => {}
        }
    }

    #[inline(never)]
    #[small]
    fn derive(&mut self, motor: u8) {
        let base = motor * motor::LARGES[0] as u8;
        let (angle, travel) = (self.large(base + motor::SA), self.large(base + motor::TR));
        let microsteps = self.motor(motor.into(), motor::MI);
        if let Some(ratio) = self.ratios.get_mut(usize::from(motor)) {
            *ratio = StepRatio::new(angle, travel, microsteps);
        }
        let finest = self.ratios.iter().map(|ratio| ratio.octaves()).max().unwrap_or(0);
        let shares = |motor| kinematics::is_shared(self.motor_axis(motor));
        // On a motor that adds X and Y the length to be converted is up to twice as long.
        self.octaves = finest + u8::from((0..MOTORS).any(shares));
    }

    fn small(&self, slot: u8) -> u8 {
        self.small.get(usize::from(slot)).copied().unwrap_or(0)
    }

    #[inline(never)]
    fn large(&self, slot: u8) -> i32 {
        self.large.get(usize::from(slot)).copied().unwrap_or(0)
    }

    fn motor(&self, motor: usize, slot: u8) -> u8 {
        self.small((motor * motor::SMALLS[0]) as u8 + slot)
    }

    #[inline(never)]
    fn axis(&self, axis: usize, slot: u8) -> i32 {
        self.large(large_of(axis as u8) + slot)
    }

    fn switch(&self, axis: usize, slot: u8) -> u8 {
        if axis <= FIRST_ROTARY { self.small(small_of(axis as u8) + slot) } else { 0 }
    }

    fn homing(&self, axis: usize, slot: u8) -> i32 {
        if axis <= FIRST_ROTARY { self.axis(axis, slot) } else { 0 }
    }

    pub(crate) fn system(&self, slot: u8) -> u8 {
        self.small(small_of(AXES as u8) + slot)
    }

    fn system_large(&self, slot: u8) -> i32 {
        self.large(large_of(AXES as u8) + slot)
    }
}

/// Returns `number` scaled as stored and within the limits of `row`, with `max` as the upper limit. A value out of
/// range is an error, or the nearest limit if the row has [`CLAMP`].
fn limit(row: &SettingRow, max: i32, number: Number, inches: bool) -> Result<i32, Status> {
    let clamp = row.is(CLAMP);
    let (below, above) = if row.is(RANGE) && !row.is(MODE) {
        (Status::OutOfRange, Status::OutOfRange)
    } else {
        (Status::BelowMinimum, Status::AboveMaximum)
    };
    match number.fixed(row.stored, inches) {
        Some(value) if (row.min..=max).contains(&value) => Ok(value),
        Some(value) if value < row.min => {
            if clamp {
                Ok(row.min)
            } else {
                Err(below)
            }
        }
        None if number.is_negative() => {
            if clamp {
                Ok(row.min)
            } else {
                Err(below)
            }
        }
        _ => {
            if clamp {
                Ok(max)
            } else {
                Err(above)
            }
        }
    }
}

mod defaults;
pub mod getters;
mod jerk;
mod rates;
#[cfg(test)]
mod tests;
