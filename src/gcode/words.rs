//! Words: the letters of a line that carry a number. Each has a slot, and a bit in sets of words.
//!
//! A set is a `u32` with one bit for each slot. The tables of `codes` use sets for the words that a code takes and the
//! words that it needs.

use crate::progmem;
use crate::status::Status;

/// The letter of each slot, axes first.
pub const LETTERS: [u8; COUNT] = *b"XYZABCIJKRPQLHFSTNDE";
/// The number of slots.
pub const COUNT: usize = 20;

const _: () = assert!(COUNT <= 32, "a set of words is a `u32`");

/// The slot of X.
pub const X: u8 = 0;
/// The slot of I. J and K follow.
pub const I: u8 = 6;
/// The slot of J.
pub const J: u8 = 7;
/// The slot of K.
pub const K: u8 = 8;
#[allow(missing_docs)]
mod names {
    pub const R: u8 = 9;
    pub const P: u8 = 10;
    pub const Q: u8 = 11;
    pub const L: u8 = 12;
    pub const H: u8 = 13;
    pub const F: u8 = 14;
    pub const S: u8 = 15;
    pub const T: u8 = 16;
    pub const N: u8 = 17;
    pub const D: u8 = 18;
    pub const E: u8 = 19;
}
pub use names::{D, E, F, H, L, N, P, Q, R, S, T};

/// The set of X Y Z A B C.
pub const AXES: u32 = 0x3F;
/// The set of A B C.
pub const ROTARY: u32 = 0x38;
/// The set of I J K.
pub const OFFSETS: u32 = 7 << I;
/// The words that have a meaning on any line, without a code that takes them.
pub const ALWAYS: u32 = bit(F) | bit(S) | bit(T) | bit(N);

/// The value of [`SLOT`] for a letter without a slot.
const NONE: u8 = 255;

progmem! {
    /// The slot of each letter, A to Z.
    static SLOT: [u8; 26] = {
        let mut table = [NONE; 26];
        let mut i = 0;
        while i < COUNT {
            table[(LETTERS[i] - b'A') as usize] = i as u8;
            i += 1;
        }
        table
    };
    /// The bit of each slot. A look-up is faster than a shift by a variable number.
    static BIT: [u32; COUNT] = {
        let mut table = [0; COUNT];
        let mut i = 0;
        while i < COUNT {
            table[i] = 1 << i;
            i += 1;
        }
        table
    };
    /// The status with which a code is refused that lacks a word that it needs, by slot.
    static MISSING: [Status; COUNT] = [
        Status::AxisWordMissing, Status::AxisWordMissing, Status::AxisWordMissing,
        Status::AxisWordMissing, Status::AxisWordMissing, Status::AxisWordMissing,
        Status::ArcOffsetsMissing, Status::ArcOffsetsMissing, Status::KWordMissing,
        Status::RWordMissing, Status::PWordMissing, Status::QWordMissing, Status::LWordMissing,
        Status::HWordMissing, Status::FeedrateMissing, Status::SWordMissing, Status::TWordMissing,
        Status::InternalError, Status::OutOfRange, Status::OutOfRange,
    ];
}

/// Returns the set of one slot.
pub const fn bit(slot: u8) -> u32 {
    1 << slot
}

/// Returns the set of one slot that is known only at run time. Empty for a number beyond the last slot.
pub fn bit_of(slot: u8) -> u32 {
    BIT.at(slot.into()).unwrap_or(0)
}

/// Returns the slot of a letter in upper case. `None` if the letter has no slot.
pub fn slot_of(letter: u8) -> Option<u8> {
    SLOT.at(usize::from(letter.wrapping_sub(b'A'))).filter(|slot| *slot != NONE)
}

/// Returns the status with which a line is refused that lacks the words of a set. The first word of the set decides.
#[small]
pub fn missing(set: u32) -> Status {
    let first = (0..COUNT as u8).find(|slot| set & bit_of(*slot) != 0);
    first.and_then(|slot| MISSING.at(slot.into())).unwrap_or(Status::InternalError)
}
