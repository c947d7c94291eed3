//! The settings: a row each, from which all else follows.
//!
//! A row says what a setting is called, what it may be, what it is at first, what text mode calls it, and what it means:
//!
//! ```text
//! SL "sl": int(0, 1), 0,
//!     bare(text!("soft limit enable")),
//!     "Moves of homed axes beyond `tn` and `tm` are refused (220).";
//! ```
//!
//! Its place in RAM, the tables in program memory and the table in `docs/settings.md` are made of it when Kerf is built; in EEPROM its
//! name stands for it, so that rows may be moved. A motor or axis setting has one row for all motors or axes. Rows stand in the order
//! that groups are listed in: TinyG's settings come first in each group, then those of Kerf alone. The constructors of rows are in
//! [`table`](super::table), those of words in [`words`](super::words).
//!
//! To add a setting, add its row, and a getter in `getters.rs`. A machine that wants another default has it in its file under `machines/`.

mod axes;
#[cfg(feature = "drivers")]
mod drivers;
mod heaters;
mod machine;
mod motors;
mod outputs;
mod sender;

pub use axes::axis;
#[cfg(feature = "drivers")]
pub use drivers::driver;
pub use heaters::{bed, hot_end};
pub use machine::system;
pub use motors::{motor, squaring};
pub use outputs::{coolant, pwm, spindle};
pub use sender::{job, user};

/// What a setting is called without its group, and what it means.
#[cfg(feature = "std")]
pub type Meaning = (&'static str, &'static str);

/// Makes a group's module of its rows: its tables, and a constant for each row by which getters find the setting.
///
/// `group! { module: type of a value, table of defaults => { CONSTANT "name": row, default, words, meaning; .. } }`. The table of
/// defaults is `PLAIN`, which has them as the rows say, or what the profile of the careful machine makes of them. A default is scaled
/// as kept.
macro_rules! group {
    ($(#[$doc:meta])* $module:ident: $value:ty, $defaults:expr => {
        $($place:ident $name:literal: $row:expr, $default:expr, $words:expr, $meaning:literal;)*
    }) => {
        $(#[$doc])*
        pub mod $module {
            #[allow(unused_imports, clippy::wildcard_imports)]
            use crate::config::groups::names::*;

            /// How many rows there are.
            pub const COUNT: usize = [$($name),*].len();
            /// The rows.
            pub const LIST: [SettingRow; COUNT] = numbered([$(named($row, $name)),*]);
            /// Their defaults, scaled as kept, where no profile says otherwise.
            pub const PLAIN: [$value; COUNT] = [$($default),*];
            /// What they mean.
            #[cfg(feature = "std")]
            pub const MEANINGS: [crate::config::groups::Meaning; COUNT] = [$(($name, $meaning)),*];
            /// Bytes that the settings take which every owner has, and those with [`HOMING`] besides.
            pub const SMALLS: [usize; 2] = count(&LIST, Kind::Small);
            /// Words that they take, likewise.
            pub const LARGES: [usize; 2] = count(&LIST, Kind::Large);

            $(
                #[doc = concat!("Where `", $name, "` is: see [`SettingRow::slot`].")]
                pub const $place: u8 = slot(&LIST, $name);
            )*

            crate::progmem! {
                /// The rows.
                pub static ROWS: [SettingRow; COUNT] = LIST;

                /// Their defaults, scaled as kept.
                pub static DEFAULTS: [$value; COUNT] = $defaults;

                /// What text mode calls them.
                pub static WORDS: [Words; COUNT] = [$($words),*];
            }
        }
    };
}

use group;

/// What rows are written with.
mod names {
    pub use crate::boards::{ACTIVE, MOTORS, SHORTEST_PULSE_US, inputs};
    pub use crate::config::machines;
    pub use crate::config::table::*;
    pub use crate::config::words::*;
    pub use crate::text;
    pub use crate::units::AXES;
}
