//! Parts of a received line, and what the caller does next with it.

/// A part of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Span {
    /// The first byte of the part.
    pub start: u8,
    /// The position behind the last byte of the part.
    pub end: u8,
}

#[small]
impl Span {
    /// Returns the bytes of the part.
    #[inline(never)]
    pub fn of(self, line: &[u8]) -> &[u8] {
        line.get(usize::from(self.start)..usize::from(self.end)).unwrap_or(&[])
    }
}

/// Whether a text has a checksum with a line number behind it, or with one byte between them. Then it is more than one
/// line: an end has been lost or changed.
#[small]
pub fn is_joined(text: &[u8]) -> bool {
    let mut rest = text;
    while let Some(at) = rest.iter().position(|byte| *byte == b'*') {
        rest = rest.get(at + 1..).unwrap_or(&[]);
        let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let behind = rest.get(digits..).unwrap_or(&[]);
        let joins = matches!(behind, [b'N', b'0'..=b'9', ..] | [_, b'N', b'0'..=b'9', ..]);
        if digits > 0 && joins {
            return true;
        }
    }
    false
}

/// What the caller of [`Answers::step`](super::Answers::step) does next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// Step again.
    More,
    /// Run this part of the line as G-code, call [`Answers::ran`](super::Answers::ran), and step again.
    Gcode {
        /// The first byte of the part.
        start: u8,
        /// The position behind the last byte of the part.
        end: u8,
    },
    /// The value to be changed is still being written to memory: step again later.
    Wait,
    /// The answer is complete.
    Done(crate::status::Status),
}

/// What an answer may tell beside the status.
#[derive(Clone, Copy, Default)]
pub struct Ending {
    /// The number of free line slots.
    pub free: u8,
    /// Length in bytes of the answered line, line end included; 0 if the response answers no line.
    pub length: u16,
}
