//! Determines which bytes make a line that must be answered, independently of the firmware.

use kerf::realtime;
use kerf::tasks::lines::LINE_MAX;

/// What a byte ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// A line that is empty or has only blanks.
    Empty,
    /// A line with content.
    Line,
}

/// Follows the bytes that are sent.
#[derive(Default)]
pub struct Lines {
    /// Whether the sender was in text mode at the end of the last line.
    pub is_text: bool,
    first: Option<u8>,
    /// Whether the line has more than one byte that is not blank.
    more: bool,
    len: usize,
    returned: bool,
}

impl Lines {
    /// Takes a byte. Returns what it ends; `None` if it ends nothing.
    pub fn take(&mut self, byte: u8) -> Option<End> {
        if realtime::bit(byte) != 0 {
            return None;
        }
        let returned = std::mem::replace(&mut self.returned, byte == b'\r');
        match byte {
            b'\n' if returned => None,
            b'\n' | b'\r' => Some(self.end()),
            b' ' | b'\t' if self.first.is_none() => None,
            _ => {
                // A question mark at the beginning is a line of its own, with or without a line end.
                let asked = self.first == Some(b'?') && !matches!(byte, b' ' | b'\t');
                let ended = (asked && self.len <= LINE_MAX).then(|| self.end());
                self.more |= self.first.is_some() && !matches!(byte, b' ' | b'\t');
                self.first = self.first.or(Some(byte));
                self.len += 1;
                ended
            }
        }
    }

    fn end(&mut self) -> End {
        let whole = self.len <= LINE_MAX;
        match self.first {
            Some(b'{') if whole => self.is_text = false,
            Some(b'?' | b'$') if whole => self.is_text = true,
            Some(b'h' | b'H') if whole && !self.more => self.is_text = true,
            _ => {}
        }
        let is_empty = self.first.is_none();
        (self.first, self.more, self.len) = (None, false, 0);
        if is_empty { End::Empty } else { End::Line }
    }
}
