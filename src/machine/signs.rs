//! Real-time characters that have come and have not had all their effect yet.
//!
//! Written and read by `tasks::hold` and `tasks::jog`, in thread mode; the power task calls [`Signs::age`].

use core::cell::Cell;

use super::jog::Bar;

/// Characters of one write may come so far apart, ms.
const TOGETHER_MS: u16 = 20;

/// Which of them.
#[derive(Default)]
pub struct Signs {
    /// A tilde, and no exclamation mark since: where it stands, what is held goes on.
    pub resume: Cell<bool>,
    /// A percent sign in the hold that is on; perhaps in a comment, where it is none.
    pub percent: Cell<bool>,
    /// A door has begun the hold that is on.
    pub door: Cell<bool>,
    /// Whether a jog may begin, by a character that ends jogs.
    pub jogs: Cell<Bar>,
    /// When a percent sign came that was none, ms modulo 2^16.
    lone: Cell<Option<u16>>,
}

impl Signs {
    /// A percent sign has come without a hold, at this time (ms): none, unless an exclamation mark comes right behind it.
    pub fn lone_percent(&self, now: u32) {
        self.lone.set(Some(now as u16));
    }

    /// Whether such a percent sign has come right before.
    fn is_behind_percent(&self, now: u32) -> bool {
        self.lone.get().is_some_and(|at| (now as u16).wrapping_sub(at) < TOGETHER_MS)
    }

    /// Whether such a percent sign has come right before an exclamation mark that comes now. None has come for the next one.
    pub fn take_lone_percent(&self, now: u32) -> bool {
        let is_behind = self.is_behind_percent(now);
        self.lone.set(None);
        is_behind
    }

    /// Forgets a percent sign that is too old. To be called at least once a minute, for the time wraps.
    pub fn age(&self, now: u32) {
        if !self.is_behind_percent(now) {
            self.lone.set(None);
        }
    }

    /// Forgets what has come in a hold.
    pub fn clear(&self) {
        self.resume.set(false);
        self.percent.set(false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_percent_sign_is_forgotten_before_the_time_comes_again() {
        let signs = Signs::default();
        assert!(!signs.is_behind_percent(0), "none has come");
        let at = u32::MAX - 9;
        signs.lone_percent(at);
        for (ms, behind) in [(0, true), (19, true), (20, false)] {
            assert_eq!(signs.is_behind_percent(at.wrapping_add(ms)), behind, "{ms}");
        }
        signs.age(at.wrapping_add(19));
        assert!(signs.is_behind_percent(at.wrapping_add(19)), "it is not too old yet");
        signs.age(at.wrapping_add(20));
        for ms in [1 << 16, u32::MAX] {
            assert!(!signs.is_behind_percent(at.wrapping_add(ms)), "{ms}");
        }
    }
}
