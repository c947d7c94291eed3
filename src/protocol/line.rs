//! Lines: what comes in, and what is done with one.

/// A part of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Span {
    /// The first byte of the part.
    pub start: u8,
    /// The byte behind the last one.
    pub end: u8,
}

#[small]
impl Span {
    /// The bytes of the part.
    #[inline(never)]
    pub fn of(self, line: &[u8]) -> &[u8] {
        line.get(usize::from(self.start)..usize::from(self.end)).unwrap_or(&[])
    }
}

/// What the caller of [`Answers::step`](super::Answers::step) does next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// Step again.
    More,
    /// Run this part of the line as G-code, call [`Answers::ran`](super::Answers::ran), and step again.
    Gcode {
        /// The first byte of that part.
        start: u8,
        /// The byte behind the last one.
        end: u8,
    },
    /// What is to be changed is still on its way to memory: step again later.
    Wait,
    /// The answer is complete.
    Done(crate::status::Status),
}

/// What an answer may say beside the status.
#[derive(Clone, Copy, Default)]
pub struct Ending {
    /// Free line slots.
    pub free: u8,
    /// Length in bytes of the line that is answered, its line end included; 0 if the response answers no line.
    pub length: u16,
}
