//! The rows of the settings table, one per setting. Everything else is derived from them.
//!
//! A row states the setting's name, its range, its default, what text mode calls it, and what it means:
//!
//! ```text
//! SL "sl": int(0, 1), 0,
//!     bare(text!("soft limit enable")),
//!     "Soft limits. 1: a move of a homed axis beyond `tn` or `tm` is refused with status 220. 0: no soft limits.";
//! ```
//!
//! When Kerf is built, the setting's place in RAM, the tables in program memory and the table in `docs/settings.md`
//! are made from its row. In EEPROM a setting is identified by its name, so rows may be moved. A setting of motors or
//! axes has one row for all of them. Rows are in the order in which senders list a group: TinyG's settings first,
//! then those that only Kerf has. The constructors of rows are in [`table`](super::table), those of words in
//! [`words`](super::words).
//!
//! To add a setting, add its row, and a getter in `getters.rs`. Other defaults of a machine belong in its file under
//! `machines/`.

mod axes;
#[cfg(feature = "drivers")]
mod drivers;
mod heaters;
mod machine;
mod motors;
mod outputs;
mod sender;
mod shaping;

pub use axes::axis;
#[cfg(feature = "drivers")]
pub use drivers::driver;
pub use heaters::{bed, hot_end};
pub use machine::system;
pub use motors::{motor, squaring};
pub use outputs::{coolant, pwm, spindle};
pub use sender::{job, user};
pub use shaping::shaper;

/// The name of a setting without its group, and its meaning.
#[cfg(feature = "std")]
pub type Meaning = (&'static str, &'static str);

/// Makes the module of a group from its rows: its tables, and a constant per row by which getters find the setting.
///
/// `group! { module: type of a value, table of defaults => { CONSTANT "name": row, default, words, meaning; .. } }`.
/// The table of defaults is either `PLAIN`, the defaults in the rows, or the result of applying the careful machine's
/// profile to them. A default is scaled as stored.
macro_rules! group {
    ($(#[$doc:meta])* $module:ident: $value:ty, $defaults:expr => {
        $($place:ident $name:literal: $row:expr, $default:expr, $words:expr, $meaning:literal;)*
    }) => {
        $(#[$doc])*
        pub mod $module {
            #[allow(unused_imports, clippy::wildcard_imports)]
            use crate::config::groups::names::*;

            /// The number of rows.
            pub const COUNT: usize = [$($name),*].len();
            /// The rows.
            pub const LIST: [SettingRow; COUNT] = numbered([$(named($row, $name)),*]);
            /// The defaults in the rows, scaled as stored.
            pub const PLAIN: [$value; COUNT] = [$($default),*];
            /// The meanings of the settings.
            #[cfg(feature = "std")]
            pub const MEANINGS: [crate::config::groups::Meaning; COUNT] = [$(($name, $meaning)),*];
            /// The number of bytes: for the settings that every owner has, and for those with [`HOMING`].
            pub const SMALLS: [usize; 2] = count(&LIST, Kind::Small);
            /// The number of 32-bit words, in the same way.
            pub const LARGES: [usize; 2] = count(&LIST, Kind::Large);

            $(
                #[doc = concat!("Where `", $name, "` is: see [`SettingRow::slot`].")]
                pub const $place: u8 = slot(&LIST, $name);
            )*

            crate::progmem! {
                /// The rows.
                pub static ROWS: [SettingRow; COUNT] = LIST;

                /// The defaults in force in this image, scaled as stored.
                pub static DEFAULTS: [$value; COUNT] = $defaults;

                /// What text mode calls the settings.
                pub static WORDS: [Words; COUNT] = [$($words),*];
            }
        }
    };
}

use group;

/// The names that rows use.
mod names {
    pub use crate::boards::{ACTIVE, MOTORS, SHORTEST_PULSE_US, inputs};
    pub use crate::config::machines;
    pub use crate::config::table::*;
    pub use crate::config::words::*;
    pub use crate::text;
    pub use crate::units::AXES;
}
