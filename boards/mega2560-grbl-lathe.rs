//! Arduino Mega 2560 with a grbl-style shield, on a lathe whose sender speaks grbl's dialect. Differs from
//! `mega2560-grbl`: it has thread cutting, and only grbl's dialect.

use super::{Board, MEGA2560_GRBL};

/// Arduino Mega 2560 with a grbl-style shield, on a lathe whose sender speaks grbl's dialect.
pub const MEGA2560_GRBL_LATHE: Board = Board {
    name: "mega2560-grbl-lathe",
    features: &["dialect-grbl", "cycles", "boring", "probing", "lathe"],
    ..MEGA2560_GRBL
};
