//! Sets settings to what they are by default, or on a machine.
//!
//! Goes through the tables row by row, so that a row is read once for all motors or axes: a reset to defaults, and a new profile,
//! hold up everything else in thread mode meanwhile.

use super::Settings;
use super::machines::{self, CHOICE, Entry};
use super::setting::{Owner, Setting};
use super::table::{
    AXIS, AXIS_DEFAULTS, AXIS_ROWS, JOB, JOB_ROWS, MOTOR, MOTOR_DEFAULTS, MOTOR_ROWS, Row, SYSTEM,
    SYSTEM_DEFAULTS, SYSTEM_ROWS,
};
use crate::boards::MOTORS;

#[small]
impl Settings {
    /// Sets everything to its default.
    pub fn set_defaults(&mut self) {
        self.set(machines::ACTIVE, true);
    }

    /// Sets what a machine's profile says to what it is on the machine of this number: all settings of motors and axes, and what else
    /// some machine has otherwise than another. Up to 150,000 cycles on AVR.
    pub fn take_over(&mut self, machine: u8) {
        self.set(machine, false);
    }

    #[inline(never)]
    fn set(&mut self, machine: u8, all: bool) {
        for index in 0..SYSTEM_ROWS {
            let (Some(row), Some(value)) = (SYSTEM.at(index), SYSTEM_DEFAULTS.at(index)) else {
                break;
            };
            if all || machines::is_of_machine(index) {
                self.put(Owner::System.place(&row), value);
            }
        }
        for row in (0..JOB_ROWS).filter(|_| all).filter_map(|row| JOB.at(row)) {
            self.put(Owner::Job.place(&row), 0);
        }
        for row in 0..MOTOR_ROWS {
            let (Some(row), Some(values)) = (MOTOR.at(row), MOTOR_DEFAULTS.at(row)) else { break };
            self.put_row(&row, Owner::Motor(0), &values);
        }
        for row in 0..AXIS_ROWS {
            let (Some(row), Some(values)) = (AXIS.at(row), AXIS_DEFAULTS.at(row)) else { break };
            self.put_row(&row, Owner::Axis(0), &values);
        }
        for entry in machines::differences(machine) {
            self.put_entry(&entry);
        }
        self.keep(Setting::of_entry(CHOICE), machine.into());
        for motor in 0..MOTORS as u8 {
            self.derive(motor);
        }
    }

    #[inline(never)]
    fn put_entry(&mut self, entry: &Entry) {
        let index = entry.first().index();
        for owner in entry.owners() {
            // The first axis may lack what another has.
            if let Some(row) = owner.load(index) {
                self.put(owner.place(&row), entry.value());
            }
        }
    }

    #[inline(never)]
    fn put_row(&mut self, row: &Row, first: Owner, values: &[i32]) {
        for (number, value) in (0..).zip(values) {
            let owner = first.numbered(number);
            if owner.has(row) {
                self.put(owner.place(row), *value);
            }
        }
    }
}
