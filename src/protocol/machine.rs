//! What the protocol asks of the machine.

use super::report::StatusReport;
use super::value::Value;
use crate::config::{Setting, Settings};
use crate::status::Status;

/// What is told beside a setting that has been stored; the last one counts most.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
pub enum Warning {
    /// Nothing.
    #[default]
    None,
    /// Drivers with so many microsteps are unusual.
    Microsteps,
    /// The velocity limits of an axis were lowered to what its motors can follow.
    Velocity,
}

/// The machine behind the protocol. Nothing here waits.
pub trait Machine {
    /// The settings in force.
    fn settings(&self) -> &Settings;
    /// Stores a value that [`Settings::check`] returned and lets it take effect, or refuses it.
    fn set(&mut self, setting: Setting, value: i32) -> Result<Warning, Status>;
    /// A value now, in the unit that [`Value`] states.
    fn value(&mut self, value: Value) -> i32;
    /// What status reports hold.
    fn report(&mut self) -> &mut StatusReport;
    /// Ends an alarm, if there is one.
    fn clear(&mut self) -> Status;
    /// Starts a built-in job, or ends the one that runs: 0.
    fn start_job(&mut self, number: u8) -> Status;
    /// Powers a motor, or takes its power; all of them for `None`.
    fn energize(&mut self, motor: Option<u8>, on: bool) -> Status;

    /// Whether lengths are in inches.
    fn inches(&mut self) -> bool {
        self.value(Value::Units) == 0
    }
}
