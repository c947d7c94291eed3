//! The functions of `avr/text.rs` in plain Rust.

/// Copies from the beginning of `from` to `to`, up to the first byte below a blank, the end of either, or 255 bytes.
/// Returns how many bytes it has copied.
pub fn copy_printing(from: &[u8], to: &mut [u8]) -> u8 {
    let most = to.len().min(from.len()).min(255);
    let count = from.iter().take(most).take_while(|byte| **byte >= b' ').count();
    to[..count].copy_from_slice(&from[..count]);
    count as u8
}

/// A place in a line.
pub struct Cursor<'a> {
    /// The current byte; 0 at the end of the line.
    pub byte: u8,
    /// The bytes behind it.
    rest: &'a [u8],
}

impl<'a> Cursor<'a> {
    /// Makes a place at `byte`, with `rest` behind it: 255 bytes at most.
    pub fn new(byte: u8, rest: &'a [u8]) -> Self {
        Self { byte, rest: rest.get(..255).unwrap_or(rest) }
    }

    /// Returns how many bytes there are behind `byte`.
    pub fn left(&self) -> u8 {
        self.rest.len() as u8
    }

    /// Goes on to the next byte.
    pub fn step(&mut self) {
        self.byte = self.rest.split_off_first().copied().unwrap_or(0);
    }

    /// Takes up to four digits. Returns their number, and how many digits are missing to four.
    pub fn four(&mut self) -> (u16, u8) {
        let (mut value, mut missing) = (0, 4);
        while missing > 0 && self.byte.is_ascii_digit() {
            value = value * 10 + u16::from(self.byte - b'0');
            missing -= 1;
            self.step();
        }
        (value, missing)
    }
}
