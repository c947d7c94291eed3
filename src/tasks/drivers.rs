//! Settings of drivers that are set up by UART. Empty in an image without such drivers. Thread mode.

use super::storage::Storage;
use crate::config::{Setting, Settings};
#[cfg(feature = "drivers")]
use crate::{config::drive::DRIVERS, drivers::registers, hal::drivers};

/// Takes over a setting, if it belongs to a driver. Returns whether it does.
#[cfg(feature = "drivers")]
pub fn set(settings: &mut Settings, setting: Setting, value: i32) -> bool {
    settings.set_drive(setting, value)
}

/// Takes over all settings of drivers, as they have been saved.
#[cfg(feature = "drivers")]
pub fn recall(settings: &mut Settings, storage: &Storage) {
    for setting in (Setting::WARM..Setting::COLD).filter_map(Setting::from_number) {
        settings.set_drive(setting, storage.cold(setting));
    }
}

/// Sends all settings to the drivers. Cost: eight divisions of floats.
#[cfg(feature = "drivers")]
pub fn tell(settings: &Settings) {
    for motor in 0..DRIVERS {
        drivers::tell(motor as u8, &registers(settings, motor));
    }
}

/// Without drivers, no setting belongs to one.
#[cfg(not(feature = "drivers"))]
#[inline(always)]
pub fn set(_settings: &mut Settings, _setting: Setting, _value: i32) -> bool {
    false
}

/// Without drivers, there is nothing to take over.
#[cfg(not(feature = "drivers"))]
#[inline(always)]
pub fn recall(_settings: &mut Settings, _storage: &Storage) {}

/// Without drivers, does nothing.
#[cfg(not(feature = "drivers"))]
#[inline(always)]
pub fn tell(_settings: &Settings) {}
