//! The text of subroutines and of the loop that is under way, line by line.
//!
//! A line has its length before it. Its blanks and its plain comments are left out. Subroutines come first; the loop is
//! behind them, and goes when it has ended. A text that is full takes no more: the line is refused.

use super::super::comment;
use super::super::lexer::is_blank;
use super::oword::Label;
use crate::status::Status;

/// Bytes for all lines.
pub const TEXT: usize = 4_096;
/// How many subroutines there may be.
pub const SUBS: usize = 24;
/// The longest line.
pub const LONGEST: usize = 255;

/// A subroutine that has been recorded.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Sub {
    label: Label,
    /// Where its first line is.
    start: u16,
}

/// The recorded lines.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Record {
    text: [u8; TEXT],
    /// Where the subroutines end.
    kept: u16,
    /// Where all lines end.
    end: u16,
    subs: [Sub; SUBS],
    count: u8,
}

impl Record {
    /// No lines.
    pub const NONE: Self = Self {
        text: [0; TEXT],
        kept: 0,
        end: 0,
        subs: [Sub { label: Label::NONE, start: 0 }; SUBS],
        count: 0,
    };

    /// Returns where all lines end.
    pub fn end(&self) -> u16 {
        self.end
    }

    /// Whether there are subroutines.
    pub fn has_subs(&self) -> bool {
        self.count > 0
    }

    /// Whether there is no room for another subroutine.
    pub fn is_full(&self) -> bool {
        usize::from(self.count) == SUBS
    }

    /// Returns where the first line of a subroutine is.
    pub fn sub(&self, label: Label) -> Option<u16> {
        self.subs().iter().find(|sub| sub.label == label).map(|sub| sub.start)
    }

    fn subs(&self) -> &[Sub] {
        self.subs.get(..self.count.into()).unwrap_or_default()
    }

    /// Adds a line. Returns where it is.
    pub fn add(&mut self, line: &[u8]) -> Result<u16, Status> {
        let at = self.end;
        let room = self.text.get_mut(usize::from(at)..).unwrap_or_default();
        let (length, room) = room.split_first_mut().ok_or(Status::RecordFull)?;
        let count = pack(line, room).ok_or(Status::RecordFull)?;
        *length = u8::try_from(count).map_err(|_| Status::RecordFull)?;
        self.end = at + 1 + u16::from(*length);
        Ok(at)
    }

    /// Copies the line at a place. Returns the place behind it, and its length.
    pub fn line(&self, at: u16, into: &mut [u8; LONGEST]) -> Option<(u16, usize)> {
        let (length, rest) = self.text.get(at.into()..self.end.into())?.split_first()?;
        let length = usize::from(*length);
        into.get_mut(..length)?.copy_from_slice(rest.get(..length)?);
        Some((at + 1 + length as u16, length))
    }

    /// Removes the lines from a place on.
    pub fn cut(&mut self, at: u16) {
        self.end = at.max(self.kept).min(self.end);
    }

    /// Removes the lines of the loop.
    pub fn drop_loop(&mut self) {
        self.end = self.kept;
    }

    /// Makes the lines behind the subroutines one of them.
    pub fn keep(&mut self, label: Label) -> Result<(), Status> {
        let sub = self.subs.get_mut(usize::from(self.count)).ok_or(Status::RecordFull)?;
        *sub = Sub { label, start: self.kept };
        (self.count, self.kept) = (self.count + 1, self.end);
        Ok(())
    }

    /// Removes a subroutine, because another one of the same label begins. There is no loop.
    pub fn remove(&mut self, label: Label) {
        let Some(at) = self.subs().iter().position(|sub| sub.label == label) else { return };
        let start = self.subs().get(at).map_or(0, |sub| sub.start);
        let end = self.subs().get(at + 1).map_or(self.kept, |next| next.start);
        self.text.copy_within(usize::from(end)..usize::from(self.kept), start.into());
        self.subs.copy_within(at + 1..usize::from(self.count), at);
        self.count -= 1;
        for sub in self.subs.iter_mut().take(self.count.into()).skip(at) {
            sub.start -= end - start;
        }
        self.kept -= end - start;
        self.end = self.kept;
    }
}

/// Writes a line without its blanks and plain comments. Returns its length; `None` if there is no room.
fn pack(line: &[u8], into: &mut [u8]) -> Option<usize> {
    let (mut rest, mut count) = (line, 0);
    let mut put = |bytes: &[u8]| {
        into.get_mut(count..count + bytes.len())?.copy_from_slice(bytes);
        count += bytes.len();
        Some(())
    };
    while let Some((byte, after)) = rest.split_first() {
        rest = after;
        match byte {
            b';' => break,
            b'(' => {
                let length = comment::length(after);
                let (text, behind) = after.split_at_checked(length).unwrap_or_default();
                rest = behind.get(1..).unwrap_or_default();
                put(b"(")?;
                if comment::kind(text).is_some() {
                    put(text)?;
                }
                put(b")")?;
            }
            byte if is_blank(*byte) => {}
            byte => put(&[*byte])?,
        }
    }
    Some(count)
}
