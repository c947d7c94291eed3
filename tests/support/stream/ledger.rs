//! The lines of a port that wait for their answers.

use super::answer::Answer;
use super::lines::{Effect, Kind, Line};

/// Whether a line may have been dropped.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub enum Cut {
    No,
    Perhaps,
    Surely,
}

/// A line that has been begun.
#[derive(Clone, Debug)]
pub struct Sent {
    pub id: u32,
    pub line: Line,
    /// Time at which its first byte was put on the line, ms.
    pub begun: u64,
    /// Time at which its last byte was put on the line; `None` before that.
    pub ended: Option<u64>,
    /// Number of bytes that its sender counts for it.
    pub bytes: usize,
    pub cut: Cut,
    /// The epoch of [`Course`](super::course::Course) in which it moves.
    pub epoch: u32,
    /// Number of bytes that the port had heard when the line was dropped or when it ended.
    pub heard: usize,
    /// Whether its answer is due at once. It is not if the sender has held the answer back.
    pub due: bool,
}

impl Sent {
    pub fn is_data(&self) -> bool {
        self.line.kind == Kind::Data
    }
}

/// All lines that wait, in the order in which they were sent.
#[derive(Default)]
pub struct Ledger {
    pub waiting: Vec<Sent>,
}

impl Ledger {
    /// Number of bytes in lines without answers.
    pub fn bytes(&self) -> usize {
        self.waiting.iter().map(|sent| sent.bytes).sum()
    }

    /// Number of lines without answers.
    pub fn lines(&self) -> usize {
        self.waiting.len()
    }

    /// Whether only lines of G-code wait, so that a question may be asked.
    pub fn may_ask(&self) -> bool {
        self.waiting.iter().all(Sent::is_data)
    }

    /// Takes note that the lines of G-code so far may be dropped; `is_gone` limits that for each line.
    pub fn cut(&mut self, cut: Cut, heard: usize, is_gone: impl Fn(&Sent) -> Cut) {
        for sent in self.waiting.iter_mut().filter(|sent| sent.is_data()) {
            let cut = if is_gone(sent) < cut { is_gone(sent) } else { cut };
            if sent.cut < cut {
                (sent.cut, sent.heard) = (cut, heard);
            }
        }
    }

    /// Removes and returns the line that an answer is for. The error says why there can be no such answer, or not
    /// now.
    pub fn answer(&mut self, answer: &Answer) -> Result<Sent, String> {
        let at = match answer.id {
            Some(id) => self.waiting.iter().position(|sent| sent.id == id),
            // The answer to a line that was dropped or too long has no number.
            None => self.waiting.iter().position(Sent::is_data).filter(|at| {
                let sent = &self.waiting[*at];
                sent.line.too_long || sent.cut != Cut::No
            }),
        };
        let at =
            at.ok_or_else(|| format!("{answer:?} answers no line that waits: {:?}", self.ids()))?;
        let sent = &self.waiting[at];
        let may_overtake = |earlier: &Sent| match (sent.line.kind, earlier.line.kind) {
            (Kind::Short, Kind::Data | Kind::Long) | (Kind::Long, Kind::Data) => true,
            _ => sent.line.effect == Effect::Flush && earlier.is_data(),
        };
        if let Some(earlier) = self.waiting[..at].iter().find(|earlier| !may_overtake(earlier)) {
            return Err(format!("{answer:?} comes before that to {:?}", earlier.line.text));
        }
        if sent.ended.is_none() {
            return Err(format!("{answer:?} comes before the end of {:?}", sent.line.text));
        }
        Ok(self.waiting.remove(at))
    }

    fn ids(&self) -> Vec<(u32, &str)> {
        self.waiting.iter().map(|sent| (sent.id, sent.line.text.trim_end())).collect()
    }
}
