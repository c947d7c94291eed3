//! Real-time characters that have arrived and have not yet had their whole effect.
//!
//! `tasks::hold` and `tasks::jog` write and read them, in thread mode. The power task calls [`Signs::age`].

use core::cell::Cell;

use super::jog::Bar;

/// Characters that a sender writes together may arrive this far apart, ms.
const TOGETHER_MS: u16 = 20;

/// The pending characters.
#[derive(Default)]
pub struct Signs {
    /// A `~` has come, and no `!` since. Held motion resumes when the reader reaches the place of the `~`.
    pub resume: Cell<bool>,
    /// A `%` has come during the present hold. It does not count if it turns out to be in a comment.
    pub percent: Cell<bool>,
    /// Whether an open door has begun the present hold.
    pub door: Cell<bool>,
    /// Whether a jog may begin after a character that ends jogs.
    pub jogs: Cell<Bar>,
    /// The time at which a `%` came without a hold, ms modulo 2^16.
    lone: Cell<Option<u16>>,
}

impl Signs {
    /// Records that a `%` has come without a hold, at the time `now` (ms). It has no effect unless a `!` comes directly
    /// behind it.
    pub fn lone_percent(&self, now: u32) {
        self.lone.set(Some(now as u16));
    }

    /// Whether a `%` without a hold has come directly before the time `now`.
    fn is_behind_percent(&self, now: u32) -> bool {
        self.lone.get().is_some_and(|at| (now as u16).wrapping_sub(at) < TOGETHER_MS)
    }

    /// Whether a `%` without a hold has come directly before a `!` that comes at the time `now`. Forgets the `%`.
    pub fn take_lone_percent(&self, now: u32) -> bool {
        let is_behind = self.is_behind_percent(now);
        self.lone.set(None);
        is_behind
    }

    /// Forgets a `%` that is too old. Call it at least once a minute, because the recorded time wraps.
    pub fn age(&self, now: u32) {
        if !self.is_behind_percent(now) {
            self.lone.set(None);
        }
    }

    /// Forgets the `~` and the `%` that have come during a hold.
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
