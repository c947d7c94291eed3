//! Real-time characters: single bytes that act wherever they stand in the stream.
//!
//! The receive interrupt takes them out, so they never reach a line and never get a response.

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

/// Beside [`RESUME`]: its place in the stream is not known, for the receive ring was full.
pub const UNPLACED: u8 = 1 << 6;

/// No character that asks for something: XON has come, and what was held back may leave.
pub const LET_GO: u8 = 1 << 7;

/// Characters whose place in the stream counts: there the receive ring gets a
/// [`CUT`](crate::hal::serial::CUT) or [`GO`](crate::hal::serial::GO).
pub const PLACED: u8 = FLUSH | KILL | RESUME | RESET;

/// The characters that are pending when one more comes: who says hold does not say resume any more.
#[inline(always)]
pub const fn with(pending: u8, character: u8) -> u8 {
    let pending = if character & HOLD != 0 { pending & !RESUME } else { pending };
    pending | character
}

/// The bit of a real-time character, 0 for any other byte.
///
/// The receive interrupt of the AVR has its twin in assembly (`hal/avr/uart/interrupts.rs`); the transcripts, which
/// run on both, hold the two together.
#[inline(always)]
pub const fn bit(byte: u8) -> u8 {
    // Most bytes of G-code are letters, digits and dots: one test lets them pass.
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

/// The first of the characters of overrides, and the one behind the last. They, and [`JOG_END`], are parts of letters
/// in UTF-8 too: they are none behind a byte above [`ASCII`].
pub const FIRST: u8 = 0x90;
/// See [`FIRST`].
pub const END: u8 = 0x9E;
/// The highest byte that is a letter of its own.
pub const ASCII: u8 = 0x7F;

/// Ends a jog, and does nothing else.
pub const JOG_END: u8 = 0x85;

/// Begins the steps anew, from 100 %.
pub const FULL: u8 = 0;
/// [`FULL`] of the spindle: the second of the two ranges of steps.
const SPINDLE: u8 = 9;

/// What characters ask of the overrides, and of a jog, since it was taken last: however many there are, it is as much.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// By how many percent feed and spindle are to be more, or less.
    pub percent: [i8; 2],
    /// From 100 %, for feed (1) and spindle (2); and the traverse, in [`TRAVERSE`]: 1 for 100 %, 2 for 50, 3 for 25; and
    /// [`NO_JOG`].
    pub fixed: u8,
}

/// Bits of [`Asked::fixed`].
pub const TRAVERSE: u8 = 0x0C;
/// A jog is to end.
pub const NO_JOG: u8 = 0x10;

impl Asked {
    /// No character has come.
    pub const NOTHING: Self = Self { percent: [0; 2], fixed: 0 };

    /// With one more character, if it is one of these. The receive interrupt of the AVR has its twin in assembly.
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
