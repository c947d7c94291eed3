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
    /// When its first byte was put on the line, ms.
    pub begun: u64,
    /// Its last byte has been put on the line; and when that was.
    pub ended: Option<u64>,
    /// What its sender counts for it.
    pub bytes: usize,
    pub cut: Cut,
    /// It moves as others of this stretch do.
    pub epoch: u32,
    /// How many bytes the port had heard when it was dropped, and when it ended.
    pub heard: usize,
    /// Its answer is due at once, unless the sender has held it back.
    pub due: bool,
}

impl Sent {
    pub fn is_data(&self) -> bool {
        self.line.kind == Kind::Data
    }
}

/// All of them, in the order in which they were sent.
#[derive(Default)]
pub struct Ledger {
    pub waiting: Vec<Sent>,
}

impl Ledger {
    /// Bytes without answers.
    pub fn bytes(&self) -> usize {
        self.waiting.iter().map(|sent| sent.bytes).sum()
    }

    /// Lines without answers.
    pub fn lines(&self) -> usize {
        self.waiting.len()
    }

    /// Whether a question would be the only one of its port.
    pub fn may_ask(&self) -> bool {
        self.waiting.iter().all(Sent::is_data)
    }

    /// Lines of G-code so far may be dropped.
    pub fn cut(&mut self, cut: Cut, heard: usize, is_gone: impl Fn(&Sent) -> Cut) {
        for sent in self.waiting.iter_mut().filter(|sent| sent.is_data()) {
            let cut = if is_gone(sent) < cut { is_gone(sent) } else { cut };
            if sent.cut < cut {
                (sent.cut, sent.heard) = (cut, heard);
            }
        }
    }

    /// The line that an answer is for. The error is why there can be none, or not now.
    pub fn answer(&mut self, answer: &Answer) -> Result<Sent, String> {
        let at = match answer.id {
            Some(id) => self.waiting.iter().position(|sent| sent.id == id),
            // What has been dropped, or was too long, does not say.
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
