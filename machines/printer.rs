//! A 3D printer of the Mendel class: belts on X and Y, a screw on Z, and the extruder as A, in mm of filament.

use super::{MachineProfile, set};

/// A 3D printer of the Mendel class.
pub const PRINTER: MachineProfile = MachineProfile {
    name: "printer",
    about: "a 3D printer of the Mendel class",
    entries: &[
        set("1234", "mi", 16.0),
        // GT2 belts on pulleys of 20 teeth: 80 steps/mm; a screw of four starts: 400 steps/mm. Rods of 0.8 mm a
        // turn, which some have, need `3tr` 0.8.
        set("12", "tr", 40.0),
        set("3", "tr", 8.0),
        // A drive gear of 11 mm: 93 steps/mm of filament, which is the A axis, in mm
        set("4", "tr", 34.4086),
        set("xy", "vm", 12_000.0),
        set("xy", "fr", 12_000.0),
        set("z", "vm", 720.0),
        set("z", "fr", 720.0),
        // 1,000 mm/s^2, reached in 30 ms. All axes share the longest of these times
        set("xy", "ac", 1_000.0),
        set("xy", "jm", 7_200.0),
        set("xy", "jh", 14_400.0),
        set("xya", "jd", 0.02),
        set("", "ja", 3_600_000.0),
        set("z", "ac", 100.0),
        set("z", "jm", 720.0),
        set("z", "jh", 1_000.0),
        // 48 mm/s of filament and 960 mm/s^2, reached in 30 ms
        set("a", "vm", 2_880.0),
        set("a", "fr", 2_880.0),
        set("a", "ac", 960.0),
        set("a", "jm", 6_912.0),
        set("a", "jh", 13_824.0),
        set("a", "sn", 0.0),
        // Z is 0 at the bed, where it homes
        set("xyz", "tm", 200.0),
        set("z", "tn", 0.0),
        set("z", "sn", 1.0),
        set("z", "sx", 0.0),
        set("xy", "sv", 2_000.0),
        set("z", "sv", 300.0),
        set("xyz", "lb", 2.0),
    ],
};
