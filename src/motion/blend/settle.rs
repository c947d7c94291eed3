//! Makes corners final when the path that waits is longer than their windows.

use super::limits::{in_lengths, reach, zone};
use super::{Blend, Entry, LEAST_SHARE, PER_MM, USED};
use crate::motion::float::{greater, least};
use crate::motion::junction::STRAIGHT;

impl Blend {
    /// Makes corners final whose windows lie in the path that waits; all if nothing follows.
    pub(super) fn settle(&mut self, all: bool) {
        while self.done < self.len {
            let corner = self.done;
            if self.entry(corner).turn >= STRAIGHT {
                if !all && !self.reaches(corner) {
                    return;
                }
                self.finish(corner);
            }
            self.done += 1;
        }
    }

    /// Whether the path behind a corner is as long as its windows.
    pub(super) fn reaches(&self, corner: usize) -> bool {
        let entry = self.entry(corner);
        let asked = greater(entry.asked[0].velocity, entry.asked[1].velocity);
        let velocity = least(least(entry.entry, asked), entry.cruise());
        let needed = reach(velocity, entry.accel(), self.limits.kernel.reach());
        self.way(corner, self.len) >= in_lengths(needed)
    }

    /// Whether no corner behind can limit the first block any more: those in reach are final.
    pub(super) fn is_settled(&self) -> bool {
        if self.done == 0 {
            return false;
        }
        self.way(1, self.done) >= self.entry(0).zone
    }

    /// The stage is full: makes the corners of its first half final, at velocities at which their windows lie in the path
    /// that waits behind them, and what they limit in the path that waits before them.
    pub(super) fn crowd(&mut self) {
        let reach = self.limits.kernel.reach();
        while self.done <= self.len / 2 {
            let corner = self.done;
            if self.entry(corner).turn >= STRAIGHT {
                let mm = |way: u32| way as f32 * (1.0 / PER_MM);
                let more = self.entry(corner).accel() * reach * reach;
                let behind = mm(self.way(corner, self.len)) - 0.25 * more;
                let fits = match self.before {
                    Some(_) => least(behind, mm(self.way(0, corner)) - 0.5 * more),
                    None => behind,
                };
                let entry = self.entry_mut(corner);
                entry.entry = least(entry.entry, greater(fits, 0.0) * (1.0 / reach));
                self.finish(corner);
            }
            self.done += 1;
        }
    }

    /// Makes a corner final: limits its velocity by the deviation, and the acceleration about it by the room it leaves.
    pub(super) fn finish(&mut self, corner: usize) {
        let entry = *self.entry(corner);
        let accel = greater(self.ahead_of(corner).map_or(0.0, Entry::accel), entry.accel());
        let mean = self.mean_of(corner, accel);
        let mut velocity = least(entry.entry, entry.asked[mean].velocity);
        let allowed = USED * self.limits.deviation;
        let mut share = 1.0;
        let may_be_off = self.most_off(&entry, velocity, accel) > allowed;
        if may_be_off && self.off(corner, velocity, accel) > allowed {
            let stands = self.off(corner, 0.0, accel);
            if stands > 0.5 * allowed {
                share = greater(0.5 * allowed / stands, LEAST_SHARE);
            }
            velocity = self.slowed(corner, velocity, share * accel, allowed);
        }
        let (velocity, room) = self.fastest(corner, mean, velocity, accel);
        self.entry_mut(corner).entry = velocity;
        let seconds = greater(self.limits.windows[mean], self.limits.kernel.reach());
        self.leave(corner, room, zone(velocity, room * accel, seconds));
        if share < 1.0 {
            let reach = self.limits.kernel.reach();
            self.leave(corner, share, zone(velocity, share * accel, reach));
        }
    }

    /// Returns the highest velocity, up to `most`, at which the path is off by no more than `allowed` at a corner.
    pub(super) fn slowed(&self, corner: usize, most: f32, accel: f32, allowed: f32) -> f32 {
        let (mut low, mut high) = (0.0, most);
        for _ in 0..6 {
            let middle = 0.5 * (low + high);
            if self.off(corner, middle, accel) > allowed { high = middle } else { low = middle }
        }
        low
    }

    /// Limits the acceleration as far as `zone` mm about a corner.
    pub(super) fn leave(&mut self, corner: usize, room: f32, zone: f32) {
        let corners = self.corners_about(corner, in_lengths(zone));
        // The blocks on both sides of each of these corners.
        for n in corners.start.saturating_sub(1)..corners.end {
            let entry = self.entry_mut(n);
            entry.room = least(entry.room, room);
        }
    }
}
