//! Outputs that are not steps.

use super::Local;

machine_static! {
    fn powered() -> Local<bool> = Local::new(false);
}

/// Switches all motor drivers on or off.
pub fn power(on: bool) {
    powered().set(on);
}

/// Whether the drivers are on.
pub fn is_powered() -> bool {
    powered().get()
}
