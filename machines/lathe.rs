//! A lathe: X across, in radius, and Z along the spindle, on ball screws. No Y, no A; arcs are in XZ.

use super::{MachineProfile, set};

/// A lathe.
pub const LATHE: MachineProfile = MachineProfile {
    name: "lathe",
    about: "a lathe",
    entries: &[
        set("24", "ma", 255.0),
        set("ya", "am", 0.0),
        set("ya", "sn", 0.0),
        set("", "gpl", 1.0),
        // Ball screws: 320 steps/mm
        set("13", "tr", 5.0),
        set("x", "vm", 1_200.0),
        set("x", "fr", 1_200.0),
        set("z", "vm", 2_400.0),
        set("z", "fr", 2_400.0),
        // X is 0 at the axis of the spindle and homes away from it, Z at its right end
        set("x", "sn", 0.0),
        set("x", "sx", 1.0),
        set("x", "tm", 60.0),
        set("z", "tn", -250.0),
    ],
};
