//! Reads what the machine sends.

use kerf::hal::serial::{XOFF, XON};

/// Beginnings of lines that are answers.
const ANSWERS: [&[u8]; 3] = [b"{\"r\":{", b"{r:{", b"tinyg ["];

/// Beginnings of the result of probing.
const PROBED: [&str; 2] = ["{\"r\":{\"prb\":", "{r:{prb:"];

/// Takes what the machine sends, and counts the answers.
#[derive(Default)]
pub struct Ears {
    /// Number of answers.
    pub answers: usize,
    /// The last answer.
    pub last: Vec<u8>,
    /// Whether bytes need not be text, because the two ends may use different baud rates.
    pub deaf: bool,
    partial: Vec<u8>,
}

impl Ears {
    /// Takes bytes from the machine.
    pub fn hear(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if matches!(*byte, XON | XOFF) {
                continue;
            }
            if *byte == b'\n' {
                self.line();
            } else if *byte != b'\r' || !self.partial.is_empty() {
                // A return may stand behind a line feed.
                assert!(self.deaf || (b' '..=b'~').contains(byte), "says the byte {byte}");
                self.partial.push(*byte);
            }
        }
    }

    /// Whether the machine is in the middle of a line.
    pub fn listening(&self) -> bool {
        !self.partial.is_empty()
    }

    fn line(&mut self) {
        let line = std::mem::take(&mut self.partial);
        let text = String::from_utf8_lossy(&line);
        assert!(self.deaf || !line.starts_with(b"{") || line.ends_with(b"}"), "says {text}");
        // The unsolicited result of probing has no length and no slots.
        let unasked =
            PROBED.iter().any(|probed| text.starts_with(probed)) && text.contains("[1,0,0");
        if !unasked && ANSWERS.iter().any(|answer| line.starts_with(answer)) {
            self.answers += 1;
            self.last = line;
        }
    }
}
