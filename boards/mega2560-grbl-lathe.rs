//! Arduino Mega 2560 with a grbl-style shield, on a lathe whose sender speaks grbl's dialect: `mega2560-grbl` with threads, and with
//! grbl's dialect alone.

use super::{Board, MEGA2560_GRBL};

/// Arduino Mega 2560 with a grbl-style shield, on a lathe whose sender speaks grbl's dialect.
pub const MEGA2560_GRBL_LATHE: Board = Board {
    name: "mega2560-grbl-lathe",
    features: &["dialect-grbl", "cycles", "probing", "lathe"],
    ..MEGA2560_GRBL
};
