//! The resonances of the axes, and how to shape for them. Kept beside the settings, because the planner reads them.

use super::groups::shaper;
use super::table::row_of;
use super::{Owner, Setting, Settings};
use crate::capability::Capability;

/// 1 in an image that can shape, else 0.
pub const SHAPED: usize = Capability::Shaping.is_built_in() as usize;

/// The axes that have a resonance: X Y Z.
pub const RINGING: usize = 3;

/// The lowest and the highest resonance, 0.1 Hz.
pub const HERTZ: (u16, u16) = (200, 1_000);

/// The most that the periods of different resonances take together, ms.
pub const PERIODS_MS: usize = 100;

/// The largest damping ratio, percent.
pub const DAMPING_MOST: u8 = 30;

/// A mean over a period.
pub const MEAN: u8 = 0;
/// Three impulses.
pub const EXTRA_INSENSITIVE: u8 = 1;

/// The resonances of the axes, and how to shape for them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Resonances {
    /// The frequency of each axis, 0.1 Hz; 0 for none.
    pub hertz: [u16; RINGING],
    /// The damping ratio, percent.
    pub damping: u8,
    /// [`MEAN`] or [`EXTRA_INSENSITIVE`].
    pub kind: u8,
}

impl Resonances {
    /// No resonance. Damping and kind are the defaults of the settings.
    pub const NONE: Self = Self { hertz: [0; RINGING], damping: 10, kind: MEAN };

    /// Whether an axis has a resonance.
    pub fn is_some(&self) -> bool {
        self.hertz != [0; RINGING]
    }

    /// The different frequencies, 0.1 Hz.
    pub fn different(&self) -> impl Iterator<Item = u16> {
        let hertz = self.hertz;
        hertz.into_iter().enumerate().filter_map(move |(n, one)| {
            let known = hertz.iter().take(n).any(|other| *other == one);
            ((HERTZ.0..=HERTZ.1).contains(&one) && !known).then_some(one)
        })
    }

    /// Whether each frequency is in range or 0, and their periods are not too long together.
    pub fn fits(&self) -> bool {
        let known = |hertz: &u16| *hertz == 0 || (HERTZ.0..=HERTZ.1).contains(hertz);
        let periods: u32 = self.different().map(|hertz| 100_000_000 / u32::from(hertz)).sum();
        self.hertz.iter().all(known) && periods <= PERIODS_MS as u32 * 10_000
    }
}

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
