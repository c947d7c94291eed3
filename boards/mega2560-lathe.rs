//! Arduino Mega 2560 with a grbl-style shield, on a lathe: `mega2560-grbl` with threads in the place of grbl's dialect, help screens and
//! built-in jobs, for all of which there is no room.

use super::{Board, MEGA2560_GRBL};

/// Arduino Mega 2560 with a grbl-style shield, on a lathe.
pub const MEGA2560_LATHE: Board = Board {
    name: "mega2560-lathe",
    features: &["dialect-tinyg", "cycles", "probing", "jobs", "help", "lathe"],
    ..MEGA2560_GRBL
};
