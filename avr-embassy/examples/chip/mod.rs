//! What differs between the chips that the examples run on: nothing but the module of `avr-device`.

#[cfg(feature = "atmega1284p")]
pub use avr_device::atmega1284p::*;
#[cfg(feature = "atmega2560")]
pub use avr_device::atmega2560::*;
