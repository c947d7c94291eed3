//! Arduino Mega 2560 with RAMPS 1.4, as a mill or a router: the pins of [`RAMPS14`], without heaters, for the senders of
//! grbl and of TinyG. Both images keep their settings in one format, so either may follow the other.

use super::{Board, RAMPS14};

/// Arduino Mega 2560 with RAMPS 1.4, as a mill.
pub const RAMPS14_CNC: Board = Board {
    name: "ramps14-cnc",
    features: &["dialect-tinyg", "dialect-grbl", "cycles", "probing", "text", "backlash"],
    // The outputs for heaters and the fan (D10, D8, D9) stay hazards: they are low.
    heaters: None,
    card: None,
    ..RAMPS14
};
