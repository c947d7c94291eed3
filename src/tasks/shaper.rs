//! Input shaping: how the resonances of the axes are read.

use super::storage::Storage;
use crate::capability::Capability;
use crate::config::{Owner, Settings};

/// Takes over the resonances, as they have been saved. The planner finds the change before the next line.
#[inline(always)]
pub fn recall(settings: &mut Settings, storage: &Storage) {
    if Capability::Shaping.is_built_in() {
        for setting in Owner::Shaper.settings() {
            settings.set_resonance(setting, storage.cold(setting));
        }
    }
}
