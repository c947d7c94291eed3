//! A wire from contacts to a pin, with fault injection.

use std::collections::VecDeque;

use kerf::boards::Pin;

use super::build::Wiring;
use super::random::Random;

const NEVER: u64 = u64::MAX;

/// How a contact bounces whenever it changes.
#[derive(Clone, Copy, Debug)]
pub struct Bounce {
    /// How often the contact opens and closes again.
    pub times: u32,
    /// Time within which it bounces, cycles.
    pub cycles: u64,
}

/// A wire.
pub struct Line {
    pin: Pin,
    wiring: Wiring,
    /// The inputs whose contacts on this wire are worked, as bits.
    worked: u16,
    /// Whether the wire is worked now, bounces included.
    active: bool,
    /// The changes to come, in the order of time.
    flips: VecDeque<(u64, bool)>,
    /// The disturbances, each with its first cycle and its end.
    noise: Vec<(u64, u64)>,
    bounce: Option<Bounce>,
    stuck: Option<bool>,
    /// The level that was reported last.
    told: Option<bool>,
    /// Cycle of the latest call of `advance`.
    now: u64,
}

impl Line {
    /// A wire without contacts.
    pub fn new(pin: Pin, wiring: Wiring) -> Self {
        Line {
            pin,
            wiring,
            worked: 0,
            active: false,
            flips: VecDeque::new(),
            noise: Vec::new(),
            bounce: None,
            stuck: None,
            told: None,
            now: 0,
        }
    }

    /// Its pin.
    pub fn pin(&self) -> Pin {
        self.pin
    }

    /// Whether its contacts open when they are worked.
    pub fn opens(&self) -> bool {
        self.wiring == Wiring::NormallyClosed
    }

    /// Whether the contact of an input on it is worked.
    pub fn is_worked(&self, input: usize) -> bool {
        self.worked & 1 << input != 0
    }

    /// Sets how the contacts bounce from now on; `None` ends the bouncing.
    pub fn set_bounce(&mut self, bounce: Option<Bounce>) {
        self.bounce = bounce;
    }

    /// Makes the wire look worked or not worked from now on, whatever happens; `None` mends it.
    pub fn set_stuck(&mut self, stuck: Option<bool>) {
        self.stuck = stuck;
    }

    /// Inverts the level from cycle `from` on for so many cycles.
    pub fn disturb(&mut self, from: u64, cycles: u64) {
        self.noise.push((from, from + cycles));
    }

    /// Works the contact of an input or lets it go. The first edge comes at once. Bounces follow at random times, and
    /// the last one ends in the new state.
    pub fn work(&mut self, input: usize, worked: bool, now: u64, random: &mut Random) {
        let before = self.worked != 0;
        self.worked = self.worked & !(1 << input) | u16::from(worked) << input;
        let after = self.worked != 0;
        if before == after {
            return;
        }
        self.flips.clear();
        self.flips.push_back((now, after));
        let Some(bounce) = self.bounce else { return };
        let count = 2 * bounce.times as usize;
        let mut times: Vec<u64> =
            (0..count).map(|_| now + 1 + random.below(bounce.cycles.max(1))).collect();
        times.sort_unstable();
        let bounces = times.into_iter().enumerate().map(|(i, at)| (at, (i % 2 == 1) == after));
        self.flips.extend(bounces);
    }

    /// Cycle of the last bounce.
    pub fn settles(&self) -> u64 {
        self.flips.back().map_or(self.now, |(at, _)| *at)
    }

    /// Cycle at which the level may change next.
    pub fn due(&self) -> u64 {
        let flip = self.flips.front().map_or(NEVER, |(at, _)| *at);
        let edges = self.noise.iter().map(|(from, to)| if *from > self.now { *from } else { *to });
        let told = if self.told == Some(self.level()) { NEVER } else { 0 };
        edges.fold(flip, u64::min).min(told)
    }

    /// Goes on to cycle `now`. Returns the new level if the level has changed.
    pub fn advance(&mut self, now: u64) -> Option<bool> {
        while let Some((at, active)) = self.flips.front().copied()
            && at <= now
        {
            self.active = active;
            self.flips.pop_front();
        }
        self.noise.retain(|(_, to)| *to > now);
        self.now = now;
        let level = self.level();
        (self.told.replace(level) != Some(level)).then_some(level)
    }

    fn level(&self) -> bool {
        let active = self.stuck.unwrap_or(self.active);
        let disturbed = self.noise.iter().any(|(from, _)| *from <= self.now);
        (active == (self.wiring == Wiring::NormallyClosed)) != disturbed
    }
}
