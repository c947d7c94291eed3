//! What probing has found. The planner writes, reports read.

use core::cell::Cell;

use crate::units::{FIRST_ROTARY, Length, PerAxis};

/// What has become of a probing. The discriminants are TinyG's numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ProbeState {
    /// No contact.
    #[default]
    Failed,
    /// There was one.
    Touched,
    /// A probing move is under way.
    Waiting,
}

/// How far the reporter has come with the result.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum News {
    /// There is nothing to tell.
    #[default]
    None,
    /// Nobody has begun to tell it.
    Waits,
    /// It is being told.
    Begun,
}

/// The last probing.
#[derive(Default)]
pub struct Probe {
    state: Cell<ProbeState>,
    at: Cell<[Length; FIRST_ROTARY]>,
    news: Cell<News>,
}

impl Probe {
    /// What has become of it.
    pub fn state(&self) -> ProbeState {
        self.state.get()
    }

    /// Where the contact was, or where it ended, machine coordinates; of the axes that may probe.
    pub fn at(&self, axis: u8) -> Option<Length> {
        self.at.get().get(usize::from(axis)).copied()
    }

    /// Records that a probing move begins.
    pub fn begin(&self) {
        self.state.set(ProbeState::Waiting);
    }

    /// Where it has come to an end, which is told when the machine is at rest: [`Self::tell`].
    pub fn found(&self, at: &PerAxis<Length>) {
        let [x, y, z, ..] = *at;
        self.at.set([x, y, z]);
    }

    /// Records that the probing move has come to its end, which is to be reported.
    pub fn tell(&self, state: ProbeState) {
        self.state.set(state);
        self.news.set(News::Waits);
    }

    /// Records that a probing move has been flushed, if one was under way: no contact was found, and nothing is reported.
    pub fn abandon(&self) {
        if self.state.get() == ProbeState::Waiting {
            self.state.set(ProbeState::Failed);
        }
    }

    /// Whether there is a result that nobody has begun to tell.
    pub fn is_news(&self) -> bool {
        self.news.get() == News::Waits
    }

    /// Whether there is a result that has not been told to its end.
    pub fn is_untold(&self) -> bool {
        self.news.get() != News::None
    }

    /// Whether there is a result that nobody has begun to tell; the caller tells it, and then says so ([`Self::has_been_told`]).
    pub fn take_news(&self) -> bool {
        let is_news = self.is_news();
        if is_news {
            self.news.set(News::Begun);
        }
        is_news
    }

    /// The result has been told.
    pub fn has_been_told(&self) {
        self.news.set(News::None);
    }
}
