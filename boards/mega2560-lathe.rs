//! Arduino Mega 2560 with a grbl-style shield, on a lathe. Differs from `mega2560-grbl`: it has thread cutting
//! instead of grbl's dialect, text mode and probing, because the flash has no room for all.

use super::{Board, MEGA2560_GRBL};

/// Arduino Mega 2560 with a grbl-style shield, on a lathe.
pub const MEGA2560_LATHE: Board = Board {
    name: "mega2560-lathe",
    features: &["dialect-tinyg", "cycles", "lathe"],
    ..MEGA2560_GRBL
};
