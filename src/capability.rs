//! What an image may have or do without: capabilities, a Cargo feature each.
//!
//! A board's file says which ones its image has (`features`), and `cargo xtask build --without NAME` leaves one out. What is
//! not built in is refused by its name with [`Status::NotBuiltIn`]; nothing is ignored. The questions here are
//! answered by the compiler: code behind them is in the image or it is not.

use crate::status::Status;

/// A part of the firmware that an image may lack.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Capability {
    /// Canned cycles: G73, G81 to G89.
    Cycles,
    /// Probing: G38.2 to G38.5.
    Probing,
    /// Built-in jobs: `{test:n}` but for the stored program.
    Jobs,
    /// Help for people at a terminal: `h`, `$h`, `$test` and so on.
    Help,
    /// Turning: the encoder of the spindle, and the codes that go by it.
    Lathe,
    /// Printing: heaters, their sensors and fans, and the codes for them.
    Printer,
    /// Motors that drive X and Y together, as those of a CoreXY machine do.
    CoreXy,
    /// Printing from an SD card.
    Sd,
    /// Settings of drivers that take them by UART, and homing by the load that such drivers measure.
    Drivers,
    /// A bed that is a plane, which moves follow: G29 and M420.
    BedPlane,
}

impl Capability {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Cycles,
        Self::Probing,
        Self::Jobs,
        Self::Help,
        Self::Lathe,
        Self::Printer,
        Self::CoreXy,
        Self::Sd,
        Self::Drivers,
        Self::BedPlane,
    ];

    /// Whether this image has it.
    #[inline(always)]
    pub const fn is_built_in(self) -> bool {
        match self {
            Self::Cycles => cfg!(feature = "cycles"),
            Self::Probing => cfg!(feature = "probing"),
            Self::Jobs => cfg!(feature = "jobs"),
            Self::Help => cfg!(feature = "help"),
            Self::Lathe => cfg!(feature = "lathe"),
            Self::Printer => cfg!(feature = "printer"),
            Self::CoreXy => cfg!(feature = "corexy"),
            Self::Sd => cfg!(feature = "sd"),
            Self::Drivers => cfg!(feature = "drivers"),
            Self::BedPlane => cfg!(feature = "bed-plane"),
        }
    }

    /// Refuses what needs it if this image has it not.
    #[inline(always)]
    pub const fn check(self) -> Result<(), Status> {
        if self.is_built_in() { Ok(()) } else { Err(Status::NotBuiltIn) }
    }

    /// The feature, for documents and tests.
    #[cfg(feature = "std")]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cycles => "cycles",
            Self::Probing => "probing",
            Self::Jobs => "jobs",
            Self::Help => "help",
            Self::Lathe => "lathe",
            Self::Printer => "printer",
            Self::CoreXy => "corexy",
            Self::Sd => "sd",
            Self::Drivers => "drivers",
            Self::BedPlane => "bed-plane",
        }
    }
}
