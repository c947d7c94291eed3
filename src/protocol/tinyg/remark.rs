//! What a response tells beside what has been done.

use crate::progmem;
use crate::progmem::Text;
use crate::protocol::Warning;
use crate::text;

/// What is told beside what has been done; the last one counts most.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
pub enum Remark {
    /// No message.
    #[default]
    None,
    /// Drivers with so many microsteps are unusual.
    Microsteps,
    /// The velocity limits of an axis were lowered to what its motors can follow.
    Velocity,
    /// A jerk limit of an axis is not in force beside its acceleration limit.
    Jerk,
    /// A search velocity is above the traverse velocity.
    Search,
    /// The line has no such rate.
    Baud,
    /// There is no such built-in job.
    Test,
    /// The port is spoken to so for it is set.
    Set,
    /// The port is spoken to so for it was spoken to so first.
    Said,
    /// Where help is.
    Help,
    /// How to get into the boot loader.
    AskBoot,
    /// The boot loader is next.
    Boot,
    /// How to restore the defaults.
    AskDefaults,
    /// The defaults have been restored.
    Defaults,
}

impl Remark {
    /// What it says.
    pub fn text(self) -> Text {
        REMARKS.at(self as usize).unwrap_or(text!(""))
    }
}

progmem! {
    // A table, for what the compiler makes of a `match` would be in RAM.
    static REMARKS: [Text; 14] = [
        text!(""),
        text!("*** WARNING *** Setting non-standard microstep value"),
        text!("*** WARNING *** Velocity limited by the step rate"),
        text!("*** WARNING *** Jerk limit has no effect beside ac"),
        text!("*** WARNING *** Search velocity limited by vm"),
        text!("*** WARNING *** Unsupported baud rate specified"),
        text!("Test not found"),
        text!("TinyG's dialect on this port, as is set"),
        text!("TinyG's dialect on this port, for it was said first"),
        text!("Send $h for help, {sys:n} for the settings"),
        text!("Send {boot:true} to enter boot loader"),
        text!("Entering boot loader"),
        text!("Send {defa:true} to reset to default settings"),
        text!("Initializing configs to default settings"),
    ];
}

impl From<Warning> for Remark {
    fn from(warning: Warning) -> Self {
        match warning {
            Warning::None => Remark::None,
            Warning::Velocity => Remark::Velocity,
            Warning::Jerk => Remark::Jerk,
            Warning::Search => Remark::Search,
        }
    }
}
