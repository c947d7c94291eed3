//! What text mode calls a setting.

use super::Setting;
use crate::progmem::Text;
use crate::text;

/// The words that text mode shows beside the value of a setting.
#[derive(Clone, Copy)]
pub struct Words {
    /// The title of the setting, which follows the name of its owner.
    pub title: Text,
    /// Whether the setting is a length or an angle, so that its unit follows the value.
    pub length: bool,
    /// The text at the end: the rest of the unit, or the choices.
    pub tail: Text,
    /// The number of decimals, if it is not the same as in JSON.
    pub decimals: Option<u8>,
}

pub(super) const fn words(title: Text, tail: Text) -> Words {
    Words { title, length: false, tail, decimals: None }
}

pub(super) const fn length(title: Text, tail: Text) -> Words {
    Words { title, length: true, tail, decimals: None }
}

pub(super) const fn bare(title: Text) -> Words {
    words(title, text!(""))
}

impl Words {
    pub(super) const fn with_decimals(mut self, decimals: u8) -> Words {
        self.decimals = Some(decimals);
        self
    }
}

// Units and choices that several settings have.
pub(super) const OFF_ON: Text = text!(" [0=off,1=on]");
pub(super) const POLARITY: Text = text!(" [0=normal,1=reverse]");
pub(super) const SWITCHES: Text = text!(" [0=off,1=homing,2=limit,3=limit+homing]");
pub(super) const SPEED: Text = text!("/min");
pub(super) const JERK_UNIT: Text = text!("/min^3 * 1 million");
pub(super) const TURNS: Text = text!(" RPM");
pub(super) const PHASE: Text = text!(" [0..1]");
pub(super) const LEVEL: Text = text!(" [0=active low,1=active high]");
pub(super) const USER_DATA: Text = text!("user data");
pub(super) const JOB_ID: Text = text!("job id");
pub(super) const SENSORS: Text =
    text!(" [0=none,1=Semitec,2=EPCOS,3=AD595,4=PT100,5=AD8495,6=MAX6675]");
pub(super) const DEGREES: Text = text!(" C");
#[cfg(feature = "drivers")]
pub(super) const AMPERES: Text = text!(" A");
pub(super) const HZ: Text = text!(" Hz");
pub(super) const SHAPERS: Text = text!(" [0=mean,1=EI]");
pub(super) const SECONDS: Text = text!(" s");
pub(super) const NONE: Text = text!("");

impl Setting {
    /// Returns the words of the setting.
    pub fn words(self) -> Option<Words> {
        let index = usize::from(self.index());
        self.owner().words().at(index)
    }
}
