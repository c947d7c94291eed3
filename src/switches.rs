//! Switches: debounces the levels of input pins. Touches no pin.
//!
//! `hal` samples all pins at once, and each sample says when the next one is due. An edge asks for a first sample after
//! [`FIRST_US`]. A new level is accepted if two samples in a row, [`SOON_US`] apart, agree on it. From this follows:
//!
//! - A pulse shorter than [`SOON_US`] is never accepted. A pulse longer than [`FIRST_US`] and [`SOON_US`] together
//!   always is.
//! - A change is accepted [`FIRST_US`] + [`SOON_US`] after its edge if nothing else has happened in the last
//!   [`LATER_US`], and after 300 us in any case.
//! - After a change the switch is locked: it is ignored for [`LOCK_MS`], so that its bouncing is one event. Afterwards
//!   its level is accepted as it is then.
//!
//! Under continuous noise, a sample that found no change is followed by a pause, so that sampling takes at most a fifth
//! of the CPU. While no pin changes there are no samples. Sets of switches are bits, as in
//! [`inputs`](crate::boards::inputs).

/// Time from an edge to the first sample, microseconds.
pub const FIRST_US: u32 = 1;
/// Time from the first sample to the second, microseconds. The RP2040 is fast enough for a shorter time.
pub const SOON_US: u32 = 10;
/// Time between samples while a switch is locked, and after a sample that found no change, microseconds.
pub const LATER_US: u32 = 125;
/// How long a switch is locked after a change, ms. A change of another switch starts the time anew.
pub const LOCK_MS: u32 = 10;

const LOCK_LOOKS: u8 = (LOCK_MS * 1_000 / LATER_US) as u8;

/// When the next sample is due.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// [`FIRST_US`] after the next edge.
    Edge,
    /// In [`SOON_US`].
    Soon,
    /// In [`LATER_US`].
    Later,
}

/// The debounced state of all switches.
#[derive(Clone, Debug)]
pub struct Switches {
    /// The actuated switches, after debouncing.
    worked: u16,
    /// The switches that were actuated in the last sample.
    last: u16,
    /// The switches that are locked because they have changed within [`LOCK_MS`].
    locked: u16,
    /// Samples until the locked switches are free again.
    left: u8,
    /// A sample has found no change and asked for a pause. If the next sample finds no change either, it waits for an
    /// edge.
    paused: bool,
}

impl Switches {
    /// Returns the state in which no switch is actuated.
    pub const fn new() -> Self {
        Self { worked: 0, last: 0, locked: 0, left: 0, paused: false }
    }

    /// Returns the actuated switches, after debouncing.
    pub fn worked(&self) -> u16 {
        self.worked
    }

    /// Accepts the levels of a sample without debouncing: at power-up, and when the settings of the switches have
    /// changed.
    pub fn adopt(&mut self, now: u16) {
        *self = Self { worked: now, last: now, ..Self::new() };
    }

    /// Whether a sample that finds the switches `now` actuated has to be confirmed by another.
    pub fn is_news(&self, now: u16) -> bool {
        (now ^ self.worked) & !self.locked != 0
    }

    /// Stores the first of two samples. The second one decides.
    pub fn note(&mut self, now: u16) {
        self.last = now;
    }

    /// Returns the switches that have changed, given a second sample that finds the switches `now` actuated.
    #[inline(always)]
    pub fn changed(&self, now: u16) -> u16 {
        (now ^ self.worked) & !(now ^ self.last) & !self.locked
    }

    /// Evaluates a sample that finds the switches `now` actuated. Returns the switches that have changed, and when the
    /// next sample is due.
    pub fn sample(&mut self, now: u16) -> (u16, Next) {
        let changed = self.changed(now);
        self.last = now;
        self.worked ^= changed;
        if changed != 0 {
            self.locked |= changed;
            self.left = LOCK_LOOKS;
        }
        (changed, self.next(now))
    }

    fn next(&mut self, now: u16) -> Next {
        if self.is_news(now) {
            return Next::Soon;
        }
        if self.locked != 0 {
            self.left = self.left.saturating_sub(1);
            if self.left > 0 {
                return Next::Later;
            }
            self.locked = 0;
            return Next::Soon;
        }
        self.paused = !self.paused;
        if self.paused { Next::Later } else { Next::Edge }
    }
}

impl Default for Switches {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// Samples one switch, whose edges are at the given times (us), whenever a sample is due. Returns the changes: the
    /// time and the new level.
    fn watched(edges: &[u32], until: u32) -> Vec<(u32, bool)> {
        let level = |at| edges.iter().filter(|e| **e <= at).count() % 2 == 1;
        let (mut switches, mut events) = (Switches::new(), Vec::new());
        let mut edge = edges.iter().copied();
        let (mut at, mut next) = (0, Next::Edge);
        loop {
            at = match next {
                Next::Soon => at + SOON_US,
                Next::Later => at + LATER_US,
                // An edge since the last sample asks for another sample.
                Next::Edge => match edge.find(|e| *e > at) {
                    Some(edge) => edge + FIRST_US,
                    None => return events,
                },
            };
            if at > until {
                return events;
            }
            let (changed, then) = switches.sample(level(at).into());
            next = then;
            if changed != 0 {
                events.push((at, switches.worked() != 0));
            }
        }
    }

    #[test]
    fn an_edge_is_believed_after_two_samples() {
        assert_eq!(watched(&[1_000], 100_000), [(1_011, true)]);
        assert_eq!(watched(&[1_000, 50_000], 100_000), [(1_011, true), (50_011, false)]);
    }

    #[test]
    fn a_contact_that_bounces_is_one_event() {
        let bounces: Vec<u32> = (0..21).map(|n| 1_000 + 130 * n).collect();
        assert_eq!(watched(&bounces, 100_000), [(1_011, true)]);
    }

    #[test]
    fn what_is_so_after_the_lock_counts() {
        let events = watched(&[1_000, 5_000], 100_000);
        assert_eq!(events.len(), 2);
        assert!((10_800..11_400).contains(&events[1].0) && !events[1].1, "{events:?}");
    }

    #[test]
    fn a_switch_need_not_wait_for_another() {
        let mut switches = Switches::new();
        for now in [1, 1] {
            switches.sample(now);
        }
        assert_eq!(switches.sample(3), (0, Next::Soon));
        assert_eq!(switches.sample(3), (2, Next::Later));
        assert_eq!(switches.worked(), 3);
    }

    #[test]
    fn what_is_adopted_is_no_event() {
        let mut switches = Switches::new();
        switches.adopt(0b101);
        assert_eq!(switches.worked(), 0b101);
        assert_eq!(switches.sample(0b101), (0, Next::Later));
        assert_eq!(switches.sample(0b101), (0, Next::Edge));
    }

    proptest! {
        #[test]
        fn short_pulses_are_never_believed(
            pulses in prop::collection::vec((300u32..5_000, 1u32..SOON_US), 0..40)
        ) {
            let mut at = 0;
            let edges: Vec<u32> = pulses.iter().flat_map(|(pause, width)| {
                at += pause + width;
                [at - width, at]
            }).collect();
            prop_assert_eq!(watched(&edges, at + 50_000), []);
        }

        #[test]
        fn long_pulses_always_are(from in 500u32..5_000, width in SOON_US + FIRST_US + 1..5_000) {
            let events = watched(&[from, from + width], 50_000);
            prop_assert_eq!(events.len(), 2);
            prop_assert_eq!(events[0], (from + FIRST_US + SOON_US, true));
        }

        #[test]
        fn whatever_happens_the_end_is_known(
            pauses in prop::collection::vec(1u32..3_000, 0..60)
        ) {
            let mut at = 0;
            let edges: Vec<u32> = pauses.iter().map(|pause| { at += pause; at }).collect();
            let events = watched(&edges, at + 100_000);
            let level = events.last().is_some_and(|(_, level)| *level);
            prop_assert_eq!(level, edges.len() % 2 == 1);
            let apart = events.windows(2).all(|pair| pair[1].0 - pair[0].0 >= LOCK_MS * 1_000 - LATER_US);
            prop_assert!(apart, "{:?}", events);
            prop_assert!(events.windows(2).all(|pair| pair[0].1 != pair[1].1));
        }
    }
}
