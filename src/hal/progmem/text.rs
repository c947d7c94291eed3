//! Text in program memory, packed.
//!
//! This is byte pair encoding. A byte beyond ASCII is a code for one of [`PARTS`], and each part is two bytes or codes. The word
//! `missing` takes one byte. Texts for people become 40 % shorter. The compiler packs them; [`Text::bytes`] unpacks them byte by byte.
//!
//! [`PARTS`] was found by adding, again and again, the pair that occurred most often in all texts of the image. The table may
//! change freely, and new texts need no change to it. Texts that are written with every line are [`Plain`].

use heapless::Vec;

use super::Plain;
use crate::progmem;

/// The code of the first of [`PARTS`].
const FIRST: u8 = 128;
/// Number of codes.
const CODES: usize = 128;
/// The deepest nesting of parts in parts.
const DEPTH: usize = 4;
/// The longest text, in bytes.
const LONGEST: usize = 255;

/// What codes stand for, in order. Packed with the parts before it, a part is two bytes or codes.
#[rustfmt::skip]
const PARTS: [&str; CODES] = [
    "in", "e ", "  ", "er", "s ", "or", "d ", "st", "ing", "t ", "on", "an", "de", "is ", "at", "al", "se",
    "it", "ar", " t", " m", "ed", "co", "en", "- ", " w", " [", "set", "ord ", "|G", "of", "ion", "is", "el",
    "  $", "ch", " word ", "re", " - ", "ol", "te", "om", "ax", "ing ", "    ", "o ", "im", " th", "e m",
    "val", " [0", "m ", " [0=", "ode", "1=", "ver", ",1=", "ro", "id", "fi", "iss", "sp", "le ", "lo", "le",
    "fa", " p", "issing", "test", "th", "ot ", "es", "off", "ul", "ting", "ter", "ror", "Hom", "ity",
    "missing", "ec", "test=", " word is ", "setting", "defa", "ste", "inval", "ac", "  $test=", "ion ", "um",
    "se ", "ra", "ed ", "bo", "ach", "ab", "achin", "invalid", "ind", "ut", "un", "po", "de ", "In", ",2",
    ",2=", "Homing ", "e s", "ot", "op", "oc", "not ", "man", "for", "e:", "be ", ", ", "   ", "vel", "ue",
    "eed", "di", "c ", "00", "indle ", "defaul", "        ",
];

progmem! { static PAIRS: [[u8; 2]; CODES] = pairs(); }

const fn pairs() -> [[u8; 2]; CODES] {
    let mut pairs = [[0; 2]; CODES];
    let mut code = 0;
    while code < CODES {
        let (packed, len) = pack_with(PARTS[code].as_bytes(), pairs.split_at(code).0);
        assert!(len == 2, "a part is a pair of the parts before it");
        pairs[code] = [packed[0], packed[1]];
        code += 1;
    }
    pairs
}

/// Packs ASCII text: the bytes, and how many of them count.
pub const fn pack(text: &[u8]) -> ([u8; LONGEST], usize) {
    const PAIRS: [[u8; 2]; CODES] = pairs();
    pack_with(text, &PAIRS)
}

const fn pack_with(text: &[u8], pairs: &[[u8; 2]]) -> ([u8; LONGEST], usize) {
    let (mut bytes, mut len) = ([0; LONGEST], text.len());
    let mut at = 0;
    while at < len {
        assert!(text[at].is_ascii(), "texts are ASCII");
        bytes[at] = text[at];
        at += 1;
    }
    let mut code = 0;
    while code < pairs.len() {
        len = replace(&mut bytes, len, pairs[code], FIRST + code as u8);
        code += 1;
    }
    (bytes, len)
}

/// Puts `code` wherever `pair` is. Returns how many bytes are left.
const fn replace(bytes: &mut [u8; LONGEST], len: usize, pair: [u8; 2], code: u8) -> usize {
    let (mut from, mut to) = (0, 0);
    while from < len {
        let is_pair = from + 1 < len && bytes[from] == pair[0] && bytes[from + 1] == pair[1];
        bytes[to] = if is_pair { code } else { bytes[from] };
        from += if is_pair { 2 } else { 1 };
        to += 1;
    }
    to
}

/// A packed text in program memory. Make one with [`text!`](crate::text!) only.
#[derive(Clone, Copy)]
pub struct Text(Plain);

impl Text {
    /// The text that `packed` stands for.
    pub const fn new(packed: Plain) -> Self {
        Self(packed)
    }

    /// Number of bytes. Cost on AVR: that of reading it.
    #[inline(never)]
    #[small]
    pub fn len(self) -> usize {
        self.bytes().count()
    }

    /// Whether there is none.
    pub const fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    /// The bytes of the text, one by one. Cost on AVR: about 60 cycles a byte.
    pub fn bytes(self) -> Bytes {
        Bytes { packed: self.0, pending: Vec::new() }
    }
}

/// The bytes of a [`Text`].
pub struct Bytes {
    packed: Plain,
    /// What is left of the part being read, the next one last.
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
            // A test holds the parts to their depth.
            let _ = self.pending.push(second);
            byte = first;
        }
        Some(byte)
    }
}

/// A [`Text`] from a literal or a constant: `text!("SYSTEM READY")`.
#[macro_export]
macro_rules! text {
    ($text:expr) => {{
        const PACKED: ([u8; 255], usize) = $crate::progmem::pack($text.as_bytes());
        $crate::progmem! { static TEXT: [u8; PACKED.1] = *PACKED.0.first_chunk().unwrap(); }
        const {
            // SAFETY: `progmem!` placed it in program memory.
            $crate::progmem::Text::new(unsafe { $crate::progmem::Plain::new(&TEXT) })
        }
    }};
}

#[cfg(test)]
mod tests {
    use std::string::String;
    use std::vec::Vec;

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
    fn texts_are_short_in_memory() {
        assert_eq!(pack(b"missing").1, 1);
        assert_eq!(pack(b"All settings: docs/settings.md in the sources.").1, 26);
        assert_eq!(pack(b"").1, 0);
    }

    #[test]
    fn every_part_comes_back_from_its_code() {
        fn expand(code: u8, depth: usize, to: &mut Vec<u8>) {
            assert!(depth <= DEPTH);
            match code.checked_sub(FIRST) {
                None => to.push(code),
                Some(part) => {
                    pairs()[usize::from(part)].iter().for_each(|&code| expand(code, depth + 1, to));
                }
            }
        }
        for (code, part) in PARTS.iter().enumerate() {
            let mut bytes = Vec::new();
            expand(FIRST + code as u8, 0, &mut bytes);
            assert_eq!(bytes, part.as_bytes());
            let (packed, len) = pack(&bytes);
            assert_eq!((packed[0], len), (FIRST + code as u8, 1));
        }
    }
}
