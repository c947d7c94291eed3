//! Text in program memory, packed.
//!
//! The texts are packed by byte pair encoding. A byte beyond ASCII is a code, and each code stands for two bytes or
//! codes. The word `missing` takes one byte. Texts for people become 40 % shorter. The crate `kerf-macros` packs them;
//! [`Text::bytes`] unpacks them byte by byte. Texts that are written with every line are [`Plain`], because unpacking
//! takes time.

use heapless::Vec;
use kerf_macros::{pairs, small};

use super::Plain;
use crate::progmem;

/// The code of the first of `PAIRS`.
const FIRST: u8 = 128;
/// The deepest nesting of pairs in pairs.
const DEPTH: usize = 4;

progmem! { static PAIRS: [[u8; 2]; 128] = pairs!(); }

/// A packed text in program memory. Make one with [`text!`](crate::text!) only.
#[derive(Clone, Copy)]
pub struct Text(Plain);

impl Text {
    /// Makes a text from its packed bytes.
    pub const fn new(packed: Plain) -> Self {
        Self(packed)
    }

    /// Returns the number of bytes. Cost on AVR: that of reading the text.
    #[inline(never)]
    #[small]
    pub fn len(self) -> usize {
        self.bytes().count()
    }

    /// Whether the text is empty.
    pub const fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    /// Returns the bytes of the text, one by one. Cost on AVR: about 60 cycles a byte.
    pub fn bytes(self) -> Bytes {
        Bytes { packed: self.0, pending: Vec::new() }
    }
}

/// The bytes of a [`Text`].
pub struct Bytes {
    packed: Plain,
    /// What is left of the code that is being unpacked, the next byte last.
    pending: Vec<u8, DEPTH>,
}

impl Iterator for Bytes {
    type Item = u8;

    #[inline(never)]
    #[small]
    fn next(&mut self) -> Option<u8> {
        let mut byte = match self.pending.pop() {
            Some(byte) => byte,
            None => {
                let byte = self.packed.at(0)?;
                self.packed = self.packed.behind(1);
                byte
            }
        };
        while let Some([first, second]) =
            byte.checked_sub(FIRST).and_then(|code| PAIRS.at(code.into()))
        {
            // A test ensures that the codes are not nested deeper than `DEPTH`.
            let _ = self.pending.push(second);
            byte = first;
        }
        Some(byte)
    }
}

/// A [`Text`] from a literal, or from a variable of the compiler's environment: `text!("SYSTEM READY")`.
#[macro_export]
macro_rules! text {
    ($($text:tt)+) => {
        const { $crate::progmem::Text::new($crate::flash_bytes!($crate::progmem::packed!($($text)+))) }
    };
}

#[cfg(test)]
mod tests {
    use std::string::String;

    use super::*;

    fn unpacked(text: Text) -> String {
        text.bytes().map(char::from).collect()
    }

    #[test]
    fn texts_come_back() {
        assert_eq!(unpacked(text!("SYSTEM READY")), "SYSTEM READY");
        assert_eq!(unpacked(text!("")), "");
        let long = text!("All settings: docs/settings.md in the sources.");
        assert_eq!(unpacked(long), "All settings: docs/settings.md in the sources.");
        assert_eq!(long.len(), 46);
    }

    #[test]
    fn the_version_is_the_packages() {
        assert_eq!(unpacked(text!(env!("CARGO_PKG_VERSION"))), env!("CARGO_PKG_VERSION"));
    }

    #[test]
    fn every_code_is_shallow_enough() {
        fn depth(code: u8) -> usize {
            let inside = code.checked_sub(FIRST).and_then(|at| PAIRS.at(at.into()));
            inside.map_or(0, |pair| 1 + pair.into_iter().map(depth).max().unwrap_or(0))
        }
        assert_eq!((FIRST..=u8::MAX).map(depth).max(), Some(DEPTH));
    }
}
