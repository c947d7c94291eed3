//! The result of probing. The planner writes it, reports read it.

use core::cell::Cell;

use crate::units::{Length, PerAxis};

/// The state of a probing move. The discriminants are TinyG's numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ProbeState {
    /// No contact.
    #[default]
    Failed,
    /// The probe made contact.
    Touched,
    /// A probing move is under way.
    Waiting,
}

/// How far the result has been reported.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum News {
    /// There is no result to report.
    #[default]
    None,
    /// The report of a result has not begun.
    Waits,
    /// The result is being reported.
    Begun,
}

/// The result of the last probing move.
#[derive(Default)]
pub struct Probe {
    state: Cell<ProbeState>,
    at: Cell<PerAxis<Length>>,
    news: Cell<News>,
}

impl Probe {
    /// Returns the state of the last probing move.
    pub fn state(&self) -> ProbeState {
        self.state.get()
    }

    /// Returns the position of the contact, or where the move ended without contact, in machine coordinates. Axes that
    /// cannot probe stood still at that position.
    pub fn at(&self, axis: u8) -> Option<Length> {
        self.at.get().get(usize::from(axis)).copied()
    }

    /// Returns the position that [`Self::at`] returns, on all axes.
    pub fn place(&self) -> PerAxis<Length> {
        self.at.get()
    }

    /// Records that a probing move begins.
    pub fn begin(&self) {
        self.state.set(ProbeState::Waiting);
    }

    /// Records where the probing move has ended. It is reported when the machine is at rest: [`Self::tell`].
    pub fn found(&self, at: &PerAxis<Length>) {
        self.at.set(*at);
    }

    /// Records the state at the end of the probing move, and that it has to be reported.
    pub fn tell(&self, state: ProbeState) {
        self.state.set(state);
        self.news.set(News::Waits);
    }

    /// Records that a probing move has been flushed, if one was under way: no contact was found, and nothing is
    /// reported.
    pub fn abandon(&self) {
        if self.state.get() == ProbeState::Waiting {
            self.state.set(ProbeState::Failed);
        }
    }

    /// Whether there is a result whose report has not begun.
    pub fn is_news(&self) -> bool {
        self.news.get() == News::Waits
    }

    /// Whether there is a result that has not been reported completely.
    pub fn is_untold(&self) -> bool {
        self.news.get() != News::None
    }

    /// Takes a result whose report has not begun. Returns whether there is one. The caller then reports it, and calls
    /// [`Self::has_been_told`] at the end.
    pub fn take_news(&self) -> bool {
        let is_news = self.is_news();
        if is_news {
            self.news.set(News::Begun);
        }
        is_news
    }

    /// Records that the result has been reported completely.
    pub fn has_been_told(&self) {
        self.news.set(News::None);
    }
}
