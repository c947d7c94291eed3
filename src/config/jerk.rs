//! Jerk limits that have no effect.
//!
//! A jerk limit that lets an axis reach its acceleration limit within a millisecond has no effect. The motion code
//! ignores it (`motion::dynamics::effective_jerk`), because no sample of motion is as short. The sender gets a warning
//! when it sets such a limit. Cost on AVR: 1,500 cycles.

use super::groups::axis;
use super::setting::large_of;
use super::table::Kind;
use super::{Owner, Setting, Settings};
use crate::units::FIRST_ROTARY;

/// The jerk, in units of the setting (1,000 mm/min^3), that reaches 0.1 mm/s^2 in a millisecond.
const PER_ACCEL: i32 = 21_600;

#[small]
impl Settings {
    /// Whether `setting` is a jerk limit, or the acceleration limit of the same axis, and leaves the jerk limit
    /// without effect.
    #[inline(never)]
    pub fn has_idle_jerk(&self, setting: Setting) -> bool {
        let (Owner::Axis(owner), row) = (setting.owner(), setting.row()) else { return false };
        let first = large_of(owner);
        let accel = self.large(first + axis::AC);
        // No jerk limit that fits 32 bits reaches a higher acceleration within a millisecond.
        if row.kind != Kind::Large || !(1..=i32::MAX / PER_ACCEL).contains(&accel) {
            return false;
        }
        let idle = |slot: u8| {
            (row.slot == slot || row.slot == axis::AC)
                && self.large(first + slot) >= accel * PER_ACCEL
        };
        idle(axis::JM) || (usize::from(owner) <= FIRST_ROTARY && idle(axis::JH))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Name;
    use crate::motion::dynamics::{PER_SECOND_CUBED, effective_jerk};
    use proptest::prelude::*;

    fn setting(name: &str) -> Setting {
        Setting::find(&Name::new().with(name.as_bytes()).unwrap()).unwrap()
    }

    fn idle(settings: &mut Settings, name: &str, value: i32) -> bool {
        settings.store(setting(name), value);
        settings.has_idle_jerk(setting(name))
    }

    #[test]
    fn a_jerk_limit_that_reaches_the_acceleration_within_a_millisecond_is_idle() {
        let mut settings = Settings::new();
        assert!(!idle(&mut settings, "xac", 5_000));
        // 500 mm/s^2 in a millisecond are 500,000 mm/s^3.
        assert!(!idle(&mut settings, "xjm", 107_999_999));
        assert!(idle(&mut settings, "xjm", 108_000_000));
        assert!(!idle(&mut settings, "xvm", 900_000), "which is about something else");
        assert!(!idle(&mut settings, "xac", 5_001));
        assert!(idle(&mut settings, "xac", 4_000));
        assert!(!idle(&mut settings, "xac", 0), "none to be reached");
        assert!(!idle(&mut settings, "yac", 5_000));
        assert!(idle(&mut settings, "yjh", 200_000_000));
        assert!(idle(&mut settings, "yac", 5_001));
        assert!(!idle(&mut settings, "yac", i32::MAX));
        assert!(!idle(&mut settings, "bac", 5_001), "which has no jerk limit for homing");
    }

    proptest! {
        #[test]
        fn motion_does_without_the_limits_that_are_said_to_be_idle(
            accel in 1..49_000i32, part in 0.5..2.0f64,
        ) {
            let jerk = (f64::from(accel) * f64::from(PER_ACCEL) * part) as i32;
            // Close to the limit a float may round to either side.
            prop_assume!((part - 1.0).abs() > 1e-4);
            let (accel_s, jerk_s) = (accel as f32 * 0.1, jerk as f32 * 1e3 * PER_SECOND_CUBED);
            let mut settings = Settings::new();
            settings.store(setting("xac"), accel);
            let told = idle(&mut settings, "xjm", jerk);
            prop_assert_eq!(told, effective_jerk(jerk_s, accel_s) == 0.0, "{} {}", accel, jerk);
        }
    }
}
