//! Real-time characters: single bytes that act wherever they stand in the stream.
//!
//! The receive interrupt takes them out of the stream, so they never become part of a line and never get a response.

/// `!`: feedhold.
pub const HOLD: u8 = 1 << 0;
/// `~`: resume.
pub const RESUME: u8 = 1 << 1;
/// `%`: queue flush.
pub const FLUSH: u8 = 1 << 2;
/// `^x`: reset.
pub const RESET: u8 = 1 << 3;
/// `^d`: kill the job.
pub const KILL: u8 = 1 << 4;
/// ENQ: asks for `{"ack":true}`.
pub const ENQUIRY: u8 = 1 << 5;

/// Set together with [`RESUME`]: the place of the `~` in the stream is not known, because the receive ring was full.
pub const UNPLACED: u8 = 1 << 6;

/// Not a request: XON has arrived, and output that was held back may be sent.
pub const LET_GO: u8 = 1 << 7;

/// Characters whose place in the stream counts. The receive ring gets a mark at that place:
/// [`CUT`](crate::hal::serial::CUT) or [`GO`](crate::hal::serial::GO).
pub const PLACED: u8 = FLUSH | KILL | RESUME | RESET;

/// Adds a character to the pending ones. A hold cancels a pending resume.
#[inline(always)]
pub const fn with(pending: u8, character: u8) -> u8 {
    let pending = if character & HOLD != 0 { pending & !RESUME } else { pending };
    pending | character
}

/// Returns the bit of a real-time character, 0 for any other byte.
///
/// The receive interrupt of the AVR contains this function in assembly (`hal/avr/uart/interrupts.rs`). The
/// transcripts run on both and check that the two agree.
#[inline(always)]
pub const fn bit(byte: u8) -> u8 {
    // Most bytes of G-code are letters, digits and dots. This one comparison excludes them.
    if byte > b'%' {
        return if byte == b'~' { RESUME } else { 0 };
    }
    match byte {
        b'!' => HOLD,
        b'%' => FLUSH,
        0x18 => RESET,
        0x04 => KILL,
        0x05 => ENQUIRY,
        _ => 0,
    }
}

/// The first override character. The override characters and [`JOG_END`] may also be part of a UTF-8 sequence, so they
/// do not count behind a byte above [`ASCII`].
pub const FIRST: u8 = 0x90;
/// The byte behind the last override character.
pub const END: u8 = 0x9E;
/// The highest byte that is a character by itself in UTF-8.
pub const ASCII: u8 = 0x7F;

/// Ends a jog, and does nothing else.
pub const JOG_END: u8 = 0x85;

/// The code, counted from [`FIRST`], that sets the feed override to 100 %. The four codes behind it change the
/// override.
pub const FULL: u8 = 0;
/// The code, counted from [`FIRST`], that sets the spindle override to 100 %. The four codes behind it change the
/// override.
const SPINDLE: u8 = 9;

/// The override requests, and the request to end a jog, since they were last taken. Its size does not depend on the
/// number of characters.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// The changes of the feed and the spindle override, percent.
    pub percent: [i8; 2],
    /// Bits 0 (feed) and 1 (spindle): `percent` counts from 100 % instead of the present override. The bits of
    /// [`TRAVERSE`]: the traverse override, 1 for 100 %, 2 for 50 %, 3 for 25 %, 0 for no change. And [`NO_JOG`].
    pub fixed: u8,
}

/// The bits of [`Asked::fixed`] that hold the traverse override.
pub const TRAVERSE: u8 = 0x0C;
/// The bit of [`Asked::fixed`] that asks for the end of a jog.
pub const NO_JOG: u8 = 0x10;

impl Asked {
    /// The value when no character has come.
    pub const NOTHING: Self = Self { percent: [0; 2], fixed: 0 };

    /// Adds one more character. `None` if it is neither an override character nor [`JOG_END`]. The receive interrupt of
    /// the AVR contains the same function in assembly.
    pub fn with(mut self, byte: u8) -> Option<Self> {
        if byte == JOG_END {
            self.fixed |= NO_JOG;
            return Some(self);
        }
        let code = byte.wrapping_sub(FIRST);
        let (which, code) = match code {
            0..=4 => (0, code),
            5..=7 => {
                self.fixed = self.fixed & !TRAVERSE | (code - 4) << 2;
                return Some(self);
            }
            SPINDLE..=13 => (1, code - SPINDLE),
            _ => return None,
        };
        let percent = &mut self.percent[which];
        match code {
            FULL => {
                *percent = 0;
                self.fixed |= 1 << which;
            }
            1 => *percent = percent.saturating_add(10),
            2 => *percent = percent.saturating_sub(10),
            3 => *percent = percent.saturating_add(1),
            _ => *percent = percent.saturating_sub(1),
        }
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overrides_add_up() {
        let all = |bytes: &[u8]| {
            bytes.iter().fold(Asked::NOTHING, |asked, byte| asked.with(*byte).unwrap())
        };
        assert_eq!(all(&[0x91, 0x91, 0x94, 0x9D, 0x9B]).percent, [19, -11]);
        let asked = all(&[0x91, 0x90, 0x93, 0x97, 0x96, 0x99]);
        assert_eq!((asked.percent, asked.fixed), ([1, 0], 3 | 2 << 2));
        assert_eq!(all(&[0x85, 0x91]), Asked { percent: [10, 0], fixed: NO_JOG });
        for other in [0x84, 0x86, 0x8F, 0x98, 0x9E, b'x', 0xE2] {
            assert_eq!(Asked::NOTHING.with(other), None);
        }
        assert_eq!(all(&[0x91; 40]).percent[0], i8::MAX);
    }

    #[test]
    fn only_six_bytes_are_special() {
        let special: std::vec::Vec<u8> = (0..=255).filter(|b| bit(*b) != 0).collect();
        assert_eq!(special, [0x04, 0x05, 0x18, b'!', b'%', b'~']);
    }
}
