//! Capabilities: the optional parts of an image. Each is a Cargo feature.
//!
//! A board's file lists the capabilities of its image (`features`), and `cargo xtask build --without NAME` leaves one
//! out. A request for a missing capability is refused with [`Status::NotBuiltIn`], never ignored. All functions here
//! are constants for the compiler, so code of a missing capability is not in the image.

use crate::status::Status;

/// A part of the firmware that an image may lack.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Capability {
    /// Canned cycles: G73, G81 to G83, G85, G89.
    Cycles,
    /// Canned cycles that act on the spindle: G84, G86 to G88. They need [`Capability::Cycles`] as well.
    Boring,
    /// Probing: G38.2 to G38.5.
    Probing,
    /// Built-in jobs: `{test:n}`, except the stored program.
    Jobs,
    /// Help for people at a terminal: `h`, `$h`, `$test` and so on.
    Help,
    /// Text mode of TinyG's dialect: lines that begin with `$`, and answers as text.
    Text,
    /// Turning: the encoder of the spindle, and the codes that use it.
    Lathe,
    /// Printing: heaters, their sensors and fans, and the codes for them.
    Printer,
    /// Motors that drive X and Y together, as on a CoreXY machine.
    CoreXy,
    /// Running files of an SD card.
    Sd,
    /// Writing files to an SD card. It needs [`Capability::Sd`] as well.
    CardWrite,
    /// Stepper drivers that are set up over a UART, and homing by the load that these drivers measure.
    Drivers,
    /// Moves that follow the plane of a tilted bed: G29 and M420.
    BedPlane,
    /// Backlash compensation: the settings `xbl` to `abl`.
    Backlash,
    /// Input shaping for axes that ring: the settings `isx` to `isd`, and M593.
    Shaping,
}

impl Capability {
    /// All capabilities.
    pub const ALL: [Self; 15] = [
        Self::Cycles,
        Self::Boring,
        Self::Probing,
        Self::Jobs,
        Self::Help,
        Self::Text,
        Self::Lathe,
        Self::Printer,
        Self::CoreXy,
        Self::Sd,
        Self::CardWrite,
        Self::Drivers,
        Self::BedPlane,
        Self::Backlash,
        Self::Shaping,
    ];

    /// Whether this image has the capability.
    #[inline(always)]
    pub const fn is_built_in(self) -> bool {
        match self {
            Self::Cycles => cfg!(feature = "cycles"),
            Self::Boring => cfg!(feature = "boring"),
            Self::Probing => cfg!(feature = "probing"),
            Self::Jobs => cfg!(feature = "jobs"),
            Self::Help => cfg!(feature = "help"),
            Self::Text => cfg!(feature = "text"),
            Self::Lathe => cfg!(feature = "lathe"),
            Self::Printer => cfg!(feature = "printer"),
            Self::CoreXy => cfg!(feature = "corexy"),
            Self::Sd => cfg!(feature = "sd"),
            Self::CardWrite => cfg!(feature = "card-write"),
            Self::Drivers => cfg!(feature = "drivers"),
            Self::BedPlane => cfg!(feature = "bed-plane"),
            Self::Backlash => cfg!(feature = "backlash"),
            Self::Shaping => cfg!(feature = "shaping"),
        }
    }

    /// Returns `Ok` if this image has the capability, else [`Status::NotBuiltIn`].
    #[inline(always)]
    pub const fn check(self) -> Result<(), Status> {
        if self.is_built_in() { Ok(()) } else { Err(Status::NotBuiltIn) }
    }

    /// Returns the name of the Cargo feature, for documents and tests.
    #[cfg(feature = "std")]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cycles => "cycles",
            Self::Boring => "boring",
            Self::Probing => "probing",
            Self::Jobs => "jobs",
            Self::Help => "help",
            Self::Text => "text",
            Self::Lathe => "lathe",
            Self::Printer => "printer",
            Self::CoreXy => "corexy",
            Self::Sd => "sd",
            Self::CardWrite => "card-write",
            Self::Drivers => "drivers",
            Self::BedPlane => "bed-plane",
            Self::Backlash => "backlash",
            Self::Shaping => "shaping",
        }
    }
}
