//! The SD card's lines on a chip without a card: the host, and the RP2040.

/// Selects the card.
pub fn select() {}

/// Lets it go.
pub fn release() {}

/// How fast the clock is to be.
pub fn set_fast(_: bool) {}

/// Sends a byte; a line that nobody drives is high.
pub fn exchange(_: u8) -> u8 {
    0xFF
}

/// Reads a block.
pub fn read(block: &mut [u8; 512]) {
    block.fill(0xFF);
}

/// Whether somebody waits for the lines.
pub fn is_wanted() -> bool {
    false
}
