//! Limits velocities to what the motors can follow.
//!
//! A setting may make an axis need more steps a second than can be generated. The velocity limits of the axis are
//! then lowered, and the protocol reports it. Called when a setting is stored. Cost on AVR: 6,000 cycles for each
//! motor of the axis.

use kerf_macros::small;

use super::groups::axis;
use super::setting::large_of;
use super::table::Kind;
use super::{Owner, Setting, Settings, StepRatio};
use crate::boards::MOTORS;
use crate::kinematics;
use crate::units::{AXES, FIRST_ROTARY};

#[small]
impl Settings {
    /// Lowers the velocity limits of the axes that `setting` affects to what their motors can follow. `rate` returns
    /// the possible steps a second for a number of motors. Returns whether a limit was lowered.
    pub fn limit_velocity(&mut self, setting: Setting, rate: impl Fn(usize) -> u32) -> bool {
        match setting.owner() {
            Owner::System if setting.is_pulse_width() || setting.is_machine() => {
                let mut lowered = false;
                for axis in 0..AXES as u8 {
                    lowered |= self.limit_axis(axis, &rate);
                }
                lowered
            }
            Owner::Motor(motor) => {
                let drives = self.motor_axis(motor.into());
                if kinematics::is_shared(drives) {
                    return self.limit_axis(0, &rate) | self.limit_axis(1, &rate);
                }
                self.limit_axis(drives, &rate)
            }
            Owner::Axis(axis) => self.limit_axis(axis, &rate),
            _ => false,
        }
    }

    /// Whether `setting` is the search velocity or the traverse velocity of an axis, and the traverse velocity is the
    /// lower one. The search is then slower than its setting.
    #[inline(never)]
    #[small]
    pub fn has_fast_search(&self, setting: Setting) -> bool {
        let (Owner::Axis(owner), row) = (setting.owner(), setting.row()) else { return false };
        if usize::from(owner) > FIRST_ROTARY || row.kind != Kind::Large {
            return false;
        }
        let first = large_of(owner);
        matches!(row.slot, axis::VM | axis::SV)
            && self.large(first + axis::SV) > self.large(first + axis::VM)
    }

    #[inline(never)]
    #[small]
    fn limit_axis(&mut self, axis: u8, rate: &impl Fn(usize) -> u32) -> bool {
        if usize::from(axis) >= AXES {
            return false;
        }
        let motors = (0..MOTORS).filter(|motor| kinematics::turns(self.motor_axis(*motor), axis));
        let rate = rate(motors.clone().count());
        let most = motors.filter_map(|motor| fastest(self.step_ratio(motor), rate)).min();
        let Some(most) = most else { return false };
        let mut lowered = false;
        for slot in [axis::VM, axis::FR] {
            if let Some(value) = self.large.get_mut(usize::from(large_of(axis) + slot))
                && *value > most
            {
                *value = most;
                lowered = true;
            }
        }
        lowered
    }
}

/// Returns the velocity at which a motor makes `rate` steps a second, scaled as stored (thousandths of a mm or degree
/// per minute), at least 1. `None` if the motor never steps.
fn fastest(ratio: StepRatio, rate: u32) -> Option<i32> {
    if ratio.num == 0 {
        return None;
    }
    // A unit of a `Length` is 0.0001 mm, so one unit a second is six thousandths of a millimetre a minute.
    let velocity = u64::from(rate) * 6 * u64::from(ratio.den) / u64::from(ratio.num);
    Some(i32::try_from(velocity).unwrap_or(i32::MAX).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Name;

    fn setting(name: &str) -> Setting {
        Setting::find(&Name::new().with(name.as_bytes()).unwrap()).unwrap()
    }

    fn store(settings: &mut Settings, name: &str, value: i32) -> bool {
        settings.store(setting(name), value);
        settings.limit_velocity(setting(name), |_| 40_000)
    }

    fn get(settings: &Settings, name: &str) -> i32 {
        settings.get(setting(name))
    }

    #[test]
    fn what_the_motors_can_follow_stays() {
        let mut settings = Settings::new();
        // With 1280 steps/mm, 40,000 steps a second are 31.25 mm/s.
        assert!(!store(&mut settings, "xvm", 1_875_000));
        assert!(!store(&mut settings, "xjm", i32::MAX));
        assert!(!store(&mut settings, "si", 300));
        assert_eq!(get(&settings, "xvm"), 1_875_000);
    }

    #[test]
    fn what_they_cannot_is_lowered() {
        let mut settings = Settings::new();
        assert!(store(&mut settings, "xvm", 1_875_001));
        assert_eq!((get(&settings, "xvm"), get(&settings, "xfr")), (1_875_000, 800_000));
        assert!(store(&mut settings, "1mi", 64));
        assert_eq!((get(&settings, "xvm"), get(&settings, "xfr")), (234_375, 234_375));
        assert_eq!(get(&settings, "yvm"), 800_000);
    }

    #[test]
    fn the_slowest_motor_of_an_axis_decides() {
        let mut settings = Settings::new();
        assert!(!store(&mut settings, "2mi", 16));
        assert!(!store(&mut settings, "xvm", 1_800_000));
        // Motor 2 now moves X, together with motor 1.
        assert!(store(&mut settings, "2ma", 0));
        assert_eq!(get(&settings, "xvm"), 937_500);
        assert!(!store(&mut settings, "yvm", 9_000_000), "Y has no motor left");
        assert!(!store(&mut settings, "3ma", 255), "no axis");
    }

    #[test]
    fn extremes() {
        let mut settings = Settings::new();
        for (angle, travel, microsteps) in [(1, 1, 255), (i32::MAX, i32::MAX, 1)] {
            store(&mut settings, "1mi", microsteps);
            store(&mut settings, "1sa", angle);
            store(&mut settings, "1tr", travel);
            assert!(get(&settings, "xvm") >= 1);
        }
    }
}
