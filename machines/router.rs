//! A router of the Shapeoko class: belts on X and Y, a threaded rod on Z, a motor at each side of Y.

use super::{MachineProfile, set};

/// A router of the Shapeoko class.
pub const ROUTER: MachineProfile = MachineProfile {
    name: "router",
    about: "a router of the Shapeoko class",
    entries: &[
        // GT2 belts on pulleys of 20 teeth: 40 steps/mm
        set("124", "tr", 40.0),
        // The second motor of Y faces the first
        set("4", "ma", 1.0),
        set("4", "po", 1.0),
        set("a", "am", 0.0),
        set("xy", "vm", 5_000.0),
        set("xy", "fr", 5_000.0),
        set("z", "vm", 500.0),
        set("z", "fr", 500.0),
        // 500 mm/s^2, reached in 27 ms. All axes share the longest of these times
        set("xy", "ac", 500.0),
        set("xy", "jm", 4_000.0),
        set("xy", "jh", 8_000.0),
        set("xy", "jd", 0.02),
        set("", "ja", 1_800_000.0),
        set("z", "ac", 100.0),
        set("z", "jm", 800.0),
        set("z", "jh", 1_000.0),
        set("x", "tm", 290.0),
        set("y", "tm", 320.0),
        set("z", "tn", -60.0),
        set("xy", "sv", 1_500.0),
        set("z", "sv", 300.0),
    ],
};
