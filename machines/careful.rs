//! A machine with unknown properties: TinyG's screws, and ramps that are slow enough for every stepper but not tedious.

use super::{MachineProfile, set};

/// The machine that an image is built for by default.
pub const CAREFUL: MachineProfile = MachineProfile {
    name: "careful",
    about: "a machine that nothing is known of",
    entries: &[
        // 200 mm/s^2, reached in 43 ms
        set("xyz", "ac", 200.0),
        set("xyz", "jm", 1_000.0),
        set("xyz", "jh", 2_000.0),
        set("", "ja", 720_000.0),
        set("xyzabc", "jd", 0.01),
        // Z is 0 at the top, where it homes
        set("z", "tn", -75.0),
        set("z", "tm", 0.0),
        // A, if it is switched on (`am`), is a rotary table: words are degrees
        set("abc", "vm", 7_200.0),
        set("abc", "fr", 7_200.0),
        set("abc", "ac", 400.0),
        set("abc", "jm", 2_000.0),
        set("a", "jh", 4_000.0),
    ],
};
