//! Heaters and their sensors: no board with this chip has any.

/// Does nothing.
pub fn begin(_heater: u8) {}

/// None is ever complete.
pub fn reading() -> Option<u16> {
    None
}

/// Does nothing.
pub fn switch(_on: u8) {}
