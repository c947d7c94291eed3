//! Messages that a response gives beside its result.

use crate::progmem;
use crate::progmem::Text;
use crate::protocol::Warning;
use crate::text;

/// A message beside the result. If several are due, the last variant in this order is given.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
pub enum Remark {
    /// No message.
    #[default]
    None,
    /// This number of microsteps is unusual.
    Microsteps,
    /// The velocity limits of an axis were lowered to what its motors can follow.
    Velocity,
    /// A jerk limit of an axis has no effect because of its acceleration limit.
    Jerk,
    /// A search velocity is above the traverse velocity.
    Search,
    /// The serial line does not support this rate.
    Baud,
    /// There is no built-in job with this number.
    Test,
    /// A setting has decided the dialect of the port.
    Set,
    /// The first line has decided the dialect of the port.
    Said,
    /// Where to find help.
    Help,
    /// How to enter the boot loader.
    AskBoot,
    /// The machine enters the boot loader.
    Boot,
    /// How to restore the defaults.
    AskDefaults,
    /// The defaults have been restored.
    Defaults,
}

impl Remark {
    /// Returns the text of the message.
    pub fn text(self) -> Text {
        REMARKS.at(self as usize).unwrap_or(text!(""))
    }
}

progmem! {
    // A table, because the compiler would put the texts of a `match` into RAM.
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
