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

/// Those of which the place in the stream counts: there the receive ring gets a
/// [`CUT`](crate::hal::serial::CUT) or [`GO`](crate::hal::serial::GO).
pub const PLACED: u8 = FLUSH | KILL | RESUME;

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

#[cfg(test)]
mod tests {
    use super::bit;

    #[test]
    fn only_six_bytes_are_special() {
        let special: std::vec::Vec<u8> = (0..=255).filter(|b| bit(*b) != 0).collect();
        assert_eq!(special, [0x04, 0x05, 0x18, b'!', b'%', b'~']);
    }
}
