//! The SD card's lines on a chip without a card.

/// Selects the card.
pub fn select() {}

/// Deselects the card.
pub fn release() {}

/// Sets the speed of the clock.
pub fn set_fast(_: bool) {}

/// Sends a byte. Returns 0xFF, because an undriven line is high.
pub fn exchange(_: u8) -> u8 {
    0xFF
}

/// Reads a block, all bytes 0xFF.
pub fn read(block: &mut [u8; 512]) {
    block.fill(0xFF);
}

/// Whether another device waits for the lines: never.
pub fn is_wanted() -> bool {
    false
}
