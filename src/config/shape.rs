//! The resonances of the axes. Kept beside the settings, because the planner reads them.

use super::groups::shaper;
use super::table::row_of;
use super::{Owner, Setting, Settings};
use crate::capability::Capability;
use crate::motion::shaper::{HERTZ, RINGING, Resonances};

/// The value of a frequency, in 0.1 Hz.
const TENTH: i32 = 100;
/// The value of a damping ratio of 1 %.
const PERCENT: i32 = 10;

impl Settings {
    /// Takes over the value of a setting of input shaping. `false` if the setting is not one of these.
    pub fn set_resonance(&mut self, setting: Setting, value: i32) -> bool {
        let is_own = Capability::Shaping.is_built_in() && setting.owner() == Owner::Shaper;
        if is_own && let Some(resonances) = self.resonances.first_mut() {
            put(resonances, setting, value);
        }
        is_own
    }

    /// Whether there is a filter for the resonances if a setting has this value.
    pub(super) fn can_shape(&self, setting: Setting, value: i32) -> bool {
        let now = self.resonances.first().filter(|_| setting.owner() == Owner::Shaper);
        now.is_none_or(|now| {
            let mut then = *now;
            put(&mut then, setting, value);
            let is_low = setting.is_frequency() && (1..TENTH * i32::from(HERTZ.0)).contains(&value);
            then.fits() && !is_low
        })
    }
}

impl Setting {
    /// Whether this is the frequency of a resonance.
    fn is_frequency(self) -> bool {
        usize::from(self.index()) < RINGING
    }
}

fn put(resonances: &mut Resonances, setting: Setting, value: i32) {
    let row = setting.index();
    if let Some(hertz) = resonances.hertz.get_mut(usize::from(row)) {
        *hertz = (value / TENTH) as u16;
    } else if row == const { row_of(&shaper::LIST, "t") } {
        resonances.kind = value as u8;
    } else {
        resonances.damping = (value / PERCENT) as u8;
    }
}
