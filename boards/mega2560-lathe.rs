//! Arduino Mega 2560 with a grbl-style shield, on a lathe. Differs from `mega2560-grbl`: it has thread cutting
//! instead of grbl's dialect, because the flash has no room for both.

use super::{Board, MEGA2560_GRBL};

/// Arduino Mega 2560 with a grbl-style shield, on a lathe.
pub const MEGA2560_LATHE: Board = Board {
    name: "mega2560-lathe",
    features: &["dialect-tinyg", "cycles", "probing", "jobs", "help", "lathe"],
    ..MEGA2560_GRBL
};
