//! A desktop mill of the Zen and Othermill class: lead screws everywhere.

use super::{MachineProfile, set};

/// A desktop mill of the Zen and Othermill class.
pub const MILL: MachineProfile = MachineProfile {
    name: "mill",
    about: "a desktop mill of the Zen and Othermill class",
    entries: &[
        // Lead screws: 328 steps/mm
        set("123", "tr", 4.8768),
        set("xy", "vm", 1_500.0),
        set("xy", "fr", 1_500.0),
        set("z", "vm", 1_200.0),
        set("z", "fr", 1_200.0),
        // 250 mm/s^2, reached in 36 ms
        set("xy", "ac", 250.0),
        set("xyz", "jm", 1_500.0),
        set("xyz", "jh", 3_000.0),
        set("", "ja", 900_000.0),
        // Fine work
        set("", "ct", 0.005),
        set("x", "tm", 138.0),
        set("y", "tm", 115.0),
    ],
};
