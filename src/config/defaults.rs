//! Sets settings to their defaults, or to the profile of a machine.
//!
//! Goes through the tables row by row, so that a row is read once for all motors or axes. This matters because a
//! reset to defaults, and a new profile, block everything else in thread mode meanwhile.

use super::Settings;
use super::groups::{axis, job, motor, system};
use super::machines::{self, CHOICE, Entry};
use super::setting::{Owner, Setting};
use super::table::SettingRow;
use crate::boards::MOTORS;

#[small]
impl Settings {
    /// Sets all settings to their defaults.
    pub fn set_defaults(&mut self) {
        self.set(machines::ACTIVE, true);
    }

    /// Sets the settings that profiles define to their values on a machine: all settings of motors and axes, and
    /// those settings of the system in which profiles differ. Up to 150,000 cycles on AVR.
    pub fn take_over(&mut self, machine: u8) {
        self.set(machine, false);
    }

    #[inline(never)]
    fn set(&mut self, machine: u8, all: bool) {
        for index in 0..system::COUNT {
            let (Some(row), Some(value)) = (system::ROWS.at(index), system::DEFAULTS.at(index))
            else {
                break;
            };
            if all || machines::is_of_machine(index) {
                self.put(Owner::System.place(&row), value);
            }
        }
        for row in (0..job::COUNT).filter(|_| all).filter_map(|row| job::ROWS.at(row)) {
            self.put(Owner::Job.place(&row), 0);
        }
        for row in 0..motor::COUNT {
            let (Some(row), Some(values)) = (motor::ROWS.at(row), motor::DEFAULTS.at(row)) else {
                break;
            };
            self.put_row(&row, Owner::Motor(0), &values);
        }
        for row in 0..axis::COUNT {
            let (Some(row), Some(values)) = (axis::ROWS.at(row), axis::DEFAULTS.at(row)) else {
                break;
            };
            self.put_row(&row, Owner::Axis(0), &values);
        }
        if machine != machines::ACTIVE {
            self.put_differences(machines::ACTIVE);
            self.put_differences(machine);
        }
        self.keep(Setting::of_entry(CHOICE), machine.into());
        for motor in 0..MOTORS as u8 {
            self.derive(motor);
        }
    }

    #[inline(never)]
    fn put_differences(&mut self, machine: u8) {
        for entry in machines::differences(machine) {
            self.put_entry(&entry);
        }
    }

    #[inline(never)]
    fn put_entry(&mut self, entry: &Entry) {
        let index = entry.first().index();
        for owner in entry.owners() {
            // The first axis may lack a setting that another axis has.
            if let Some(row) = owner.load(index) {
                self.put(owner.place(&row), entry.value());
            }
        }
    }

    #[inline(never)]
    fn put_row(&mut self, row: &SettingRow, first: Owner, values: &[i32]) {
        for (number, value) in (0..).zip(values) {
            let owner = first.numbered(number);
            if owner.has(row) {
                self.put(owner.place(row), *value);
            }
        }
    }
}
