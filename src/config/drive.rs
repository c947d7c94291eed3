//! The configuration of motor drivers that have a UART. Kept beside the settings, because homing reads it.

use super::Settings;
#[cfg(feature = "drivers")]
use super::{Owner, Setting};
use crate::boards::ACTIVE;
use crate::capability::Capability;
use crate::status::Status;

/// The number of drivers with settings: 0 in an image without the capability `drivers`.
pub const DRIVERS: usize = if Capability::Drivers.is_built_in() { 4 } else { 0 };

/// 1 in an image with drivers that are set up by UART, else 0.
pub const DRIVEN: usize = Capability::Drivers.is_built_in() as usize;
/// Why such drivers do not move motors at the start: none has been asked yet, so lines wait.
pub const AT_START: Status = if ACTIVE.drivers.is_some() { Status::Again } else { Status::Ok };

/// The settings of a motor's driver, beside its microsteps.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Drive {
    /// The current in motion, mA (RMS).
    pub run: u16,
    /// The current at standstill, mA (RMS).
    pub hold: u16,
    /// Whether the chopper is stealthChop; otherwise it is spreadCycle.
    pub quiet: bool,
    /// The load from which the driver reports a stall, 1 to 255; a higher value reports it sooner. 0 for never.
    pub stall: u8,
}

impl Drive {
    /// The defaults of the settings.
    pub const DEFAULT: Self = Self { run: 580, hold: 310, quiet: true, stall: 0 };
}

impl Settings {
    /// Whether an axis homes by the load of the motor with the axis's number, not by a switch. The fields must have
    /// been filled from the settings: see `tasks::drivers`.
    #[inline(always)]
    pub fn homes_by_stall(&self, axis: u8) -> bool {
        Capability::Drivers.is_built_in()
            && self.drives.get(usize::from(axis)).is_some_and(|drive| drive.stall != 0)
    }

    /// Takes over the value of a setting of a driver. `false` if the setting is not one of a driver.
    #[cfg(feature = "drivers")]
    pub fn set_drive(&mut self, setting: Setting, value: i32) -> bool {
        if setting.owner() != Owner::Drivers {
            return false;
        }
        let (kind, motor) = (setting.index() / DRIVERS as u8, setting.index() % DRIVERS as u8);
        if let Some(drive) = self.drives.get_mut(usize::from(motor)) {
            match kind {
                0 => drive.run = value as u16,
                1 => drive.hold = value as u16,
                2 => drive.quiet = value != 0,
                _ => drive.stall = value as u8,
            }
        }
        true
    }
}

#[cfg(test)]
#[cfg(feature = "drivers")]
mod tests {
    use super::*;
    use crate::config::Name;

    fn set(settings: &mut Settings, name: &str, value: i32) {
        let setting = Setting::find(&Name::new().with(name.as_bytes()).unwrap()).unwrap();
        assert!(settings.set_drive(setting, value), "{name}");
    }

    #[test]
    fn each_setting_is_its_motors() {
        let mut settings = Settings::new();
        for motor in 0..DRIVERS {
            let before = settings.drives;
            let value = |kind: usize| (100 * kind + motor + 60) as u16;
            set(&mut settings, &std::format!("drr{}", motor + 1), value(1).into());
            set(&mut settings, &std::format!("drh{}", motor + 1), value(2).into());
            set(&mut settings, &std::format!("drc{}", motor + 1), 0);
            if motor < 3 {
                set(&mut settings, &std::format!("drs{}", motor + 1), 255);
            }
            let stall = if motor < 3 { 255 } else { 0 };
            let wanted = Drive { run: value(1), hold: value(2), quiet: false, stall };
            assert_eq!(settings.drives[motor], wanted);
            assert_eq!(settings.drives[motor + 1..], before[motor + 1..]);
            assert_eq!(settings.homes_by_stall(motor as u8), motor < 3);
        }
        assert!(!settings.homes_by_stall(4));
    }

    #[test]
    fn what_is_set_at_first_is_what_drivers_begin_with() {
        let mut settings = Settings::new();
        for setting in (Setting::WARM..Setting::COLD).filter_map(Setting::from_number) {
            settings.set_drive(setting, setting.default_value());
        }
        assert_eq!(settings.drives, [Drive::DEFAULT; DRIVERS]);
    }
}
