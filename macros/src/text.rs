//! Packs texts by byte pair encoding: `src/hal/progmem/text.rs` unpacks them on the chip.
//!
//! This runs on the computer that compiles Kerf. A `const fn` took half of the compile time.

use std::collections::HashMap;
use std::sync::LazyLock;

/// The code of the first of [`PARTS`]; codes below it are ASCII.
const FIRST: u8 = 128;
/// Number of codes.
const CODES: usize = 128;

/// The texts that codes stand for, in order. Packed with the parts before it, each part is two bytes or codes.
///
/// They were found by adding, again and again, the pair that occurred most often in all texts of the image. The table
/// may be changed freely, and new texts need no change of it.
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

/// [`PARTS`] as pairs, and the code of each pair.
struct Pairs {
    all: Vec<[u8; 2]>,
    codes: HashMap<[u8; 2], u8>,
}

static PAIRS: LazyLock<Pairs> = LazyLock::new(Pairs::new);

impl Pairs {
    fn new() -> Self {
        let mut pairs = Self { all: Vec::new(), codes: HashMap::new() };
        for (part, code) in PARTS.iter().zip(FIRST..=u8::MAX) {
            let pair = pairs.pack(part.as_bytes());
            let pair = pair.try_into().expect("a part is a pair of the parts before it");
            pairs.all.push(pair);
            pairs.codes.insert(pair, code);
        }
        pairs
    }

    /// Replaces pairs in the order of their codes, as long as there are any.
    fn pack(&self, text: &[u8]) -> Vec<u8> {
        let mut packed = text.to_vec();
        let lowest = |packed: &[u8]| {
            let codes = packed.windows(2).filter_map(|pair| self.codes.get(pair));
            codes.min().copied()
        };
        while let Some(code) = lowest(&packed) {
            packed = replaced(&packed, self.all[usize::from(code - FIRST)], code);
        }
        packed
    }
}

/// Replaces each occurrence of `pair` by `code`.
fn replaced(bytes: &[u8], pair: [u8; 2], code: u8) -> Vec<u8> {
    let mut replaced = Vec::with_capacity(bytes.len());
    let mut rest = bytes;
    while let Some((&first, behind)) = rest.split_first() {
        let is_pair = rest.starts_with(&pair);
        replaced.push(if is_pair { code } else { first });
        rest = if is_pair { &rest[2..] } else { behind };
    }
    replaced
}

/// Returns the pair that each code stands for, in order.
pub fn pairs() -> &'static [[u8; 2]] {
    &PAIRS.all
}

/// Packs ASCII text; `None` if the text is not ASCII.
pub fn pack(text: &str) -> Option<Vec<u8>> {
    text.is_ascii().then(|| PAIRS.pack(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expand(code: u8, to: &mut Vec<u8>) {
        match code.checked_sub(FIRST) {
            None => to.push(code),
            Some(part) => pairs()[usize::from(part)].iter().for_each(|&code| expand(code, to)),
        }
    }

    #[test]
    fn texts_are_short() {
        let len = |text| pack(text).unwrap().len();
        assert_eq!(len("missing"), 1);
        assert_eq!(len("All settings: docs/settings.md in the sources."), 26);
        assert_eq!(len(""), 0);
    }

    #[test]
    fn what_is_not_ascii_is_refused() {
        assert_eq!(pack("5 \u{b5}m"), None);
    }

    #[test]
    fn every_part_comes_back_from_its_code() {
        for (part, code) in PARTS.iter().zip(FIRST..=u8::MAX) {
            let mut bytes = Vec::new();
            expand(code, &mut bytes);
            assert_eq!(bytes, part.as_bytes());
            assert_eq!(pack(part).unwrap(), [code]);
        }
    }

    #[test]
    fn a_text_comes_back() {
        let text = "  $test=0  |Homing error - invalid word is missing|eee   ";
        let mut bytes = Vec::new();
        pack(text).unwrap().into_iter().for_each(|code| expand(code, &mut bytes));
        assert_eq!(bytes, text.as_bytes());
    }
}
