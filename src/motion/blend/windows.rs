//! Windows: corners in a row that may come within the time of a mean.

use super::limits::{in_lengths, reach, whole};
use super::{Blend, CURVE, EVEN, Entry, PER_MM, PLACES, ROUND, SHARE, STRAIGHT};
use crate::motion::float::{greater, least};

/// Some corners in a row.
#[derive(Clone, Copy, Default)]
pub(super) struct Window {
    /// The velocity below which the path between them takes longer than the mean.
    pub(super) alone: f32,
    /// The velocity limit if it does not.
    pub(super) together: f32,
    /// The change of direction: that of an axis, weighted, in 2^-22, and the square of the whole.
    pub(super) change: u32,
    pub(super) square: u32,
}

impl Blend {
    /// Applies what the windows of a mean ask for that end at the last corner, up to the velocity `top`.
    pub(super) fn look_back(&mut self, top: f32, mean: usize) {
        let newest = self.len - 1;
        let to = self.entry(newest).unit;
        let accel = self.entry(newest).accel();
        let seconds = self.limits.windows[mean & 1];
        let longest = in_lengths(reach(top, accel, seconds));
        let speeds_up = 0.25 * ROUND * accel * seconds * seconds;
        let slowest = self.limits.least_of(self, newest);
        let is_curve = self.entry(newest).turn < CURVE && slowest >= EVEN * accel;
        let (mut oldest, mut way, mut limit) = (newest, 0u32, top);
        // The windows, from the shortest to the longest.
        loop {
            let from = match oldest {
                0 => self.before,
                _ => Some(self.entry(oldest - 1).unit),
            };
            let Some(from) = from else { break };
            let (change, square) = self.limits.change(&from, &to);
            let alone = (way as f32 * (1.0 / PER_MM) - speeds_up) / seconds;
            let mut together = self.limits.velocity(change, seconds);
            if is_curve {
                together = least(together, SHARE / whole(square, slowest * seconds));
            }
            limit = least(limit, greater(together, alone));
            let window = Window { alone, together, change, square };
            self.windows[oldest % PLACES] = window;
            let Some(before) = oldest.checked_sub(1) else { break };
            way = way.saturating_add(self.entry(before).length);
            if way >= longest || before < self.done {
                break;
            }
            oldest = before;
        }
        let last = limit;
        let (mut limit, mut change, mut square) = (f32::MAX, 0, 0);
        for n in oldest..=newest {
            let window = self.windows[n % PLACES];
            let asked = &mut self.entry_mut(n).asked[mean & 1];
            limit = least(limit, greater(window.together, window.alone));
            asked.velocity = least(asked.velocity, limit);
            if window.alone < greater(asked.velocity, last) {
                (change, square) = (change.max(window.change), square.max(window.square));
            }
            asked.change = asked.change.max(change);
            asked.square = asked.square.max(square);
        }
    }

    /// Returns by which mean a corner is limited: the one that allows the higher velocity, if that is so for the corners
    /// near it as well. Limits by different means do not add up.
    pub(super) fn mean_of(&self, corner: usize, accel: f32) -> usize {
        let is_first = |entry: &Entry| entry.asked[0].velocity > entry.asked[1].velocity;
        let entry = self.entry(corner);
        let velocity = least(entry.entry, entry.asked[0].velocity);
        let near = in_lengths(reach(
            velocity,
            accel,
            greater(self.limits.windows[0], self.limits.windows[1]),
        ));
        let differs = |entry: &Entry| entry.turn >= STRAIGHT && !is_first(entry);
        let mut way = 0u32;
        for at in corner..self.len {
            if way >= near {
                break;
            }
            if differs(self.entry(at)) {
                return 1;
            }
            way = way.saturating_add(self.entry(at).length);
        }
        let mut way = 0u32;
        for at in (0..corner).rev() {
            way = way.saturating_add(self.entry(at).length);
            if way >= near {
                break;
            }
            if differs(self.entry(at)) {
                return 1;
            }
        }
        0
    }

    /// Whether no other corner is so near that the means mix it with this one.
    pub(super) fn is_alone(&self, corner: usize, velocity: f32, accel: f32) -> bool {
        let near = in_lengths(reach(velocity, accel, 2.0 * self.limits.kernel.reach()));
        let mut way = 0u32;
        for at in corner..self.len {
            way = way.saturating_add(self.entry(at).length);
            if way >= near {
                break;
            }
            if at + 1 < self.len && self.entry(at + 1).turn >= STRAIGHT {
                return false;
            }
        }
        let mut way = 0u32;
        for at in (0..corner).rev() {
            let entry = self.entry(at);
            way = way.saturating_add(entry.length);
            if way >= near {
                return true;
            }
            if entry.turn >= STRAIGHT {
                return false;
            }
        }
        way.saturating_add(self.gone) >= near
    }
}
