//! What a corner leaves of the acceleration along the path, and the velocity at which it costs the least time.

use super::limits::taken;
use super::{Blend, CURVE, Entry, LEAST_ROOM, ONE, WEIGHT};
use crate::math::sqrt;
use crate::motion::float::{greater, least};

impl Blend {
    /// Returns the velocity, up to `most`, at which a corner costs the least time, and the room that it leaves.
    pub(super) fn fastest(&self, corner: usize, mean: usize, most: f32, accel: f32) -> (f32, f32) {
        let entry = self.entry(corner);
        let room = self.room(corner, mean, most, accel);
        if entry.turn < CURVE || room >= 0.9 {
            return (most, room);
        }
        let before = self.ahead_of(corner).map_or(f32::MAX, Entry::cruise);
        let top = least(before, entry.cruise());
        let seconds = greater(self.limits.windows[mean & 1], self.limits.kernel.reach());
        // What slowing down and speeding up take longer than passing at the top, s.
        let cost = |velocity: f32, room: f32| {
            let slower = top - velocity;
            slower * (slower / accel + 2.0 * (1.0 - room) * seconds) / top
        };
        let mut best = (cost(most, room), most, room);
        for share in [0.75, 0.5, 0.25, 0.0] {
            let velocity = most * share;
            let room = self.room(corner, mean, velocity, accel);
            let cost = cost(velocity, room);
            if cost < best.0 {
                best = (cost, velocity, room);
            }
        }
        (best.1, best.2)
    }

    /// Returns the least acceleration limit of the axes that take part in a corner.
    pub(super) fn slowest(&self, corner: usize) -> f32 {
        let to = self.entry(corner).unit;
        self.limits.slowest(&self.unit_ahead_of(corner).unwrap_or(to), &to)
    }

    /// Returns the share of the acceleration along the path that a corner leaves.
    pub(super) fn room(&self, corner: usize, mean: usize, velocity: f32, accel: f32) -> f32 {
        let (entry, limits) = (self.entry(corner), &self.limits);
        let (asked, seconds) = (entry.asked[mean & 1], limits.windows[mean & 1]);
        let full = WEIGHT * ONE * seconds * limits.accel;
        let straight = 1.0 - velocity * asked.change as f32 / full;
        // Turning is at right angles to the path.
        let slowest = self.slowest(corner);
        let e = velocity * taken(asked.square, slowest * seconds);
        let c = least(sqrt(entry.turn as f32) / (2.0 * ONE) + 0.05, 1.0);
        let mut room = straight;
        if e < 1.0 {
            let both = sqrt(e * e * c * c + 1.0 - e * e) - e * c;
            room = greater(room, slowest / accel * both);
        }
        if self.is_alone(corner, velocity, accel) {
            room = greater(room, self.room_alone(corner, velocity));
        }
        greater(room, LEAST_ROOM)
    }

    /// Returns the share of the acceleration along the path that a corner leaves if no other corner is near.
    pub(super) fn room_alone(&self, corner: usize, velocity: f32) -> f32 {
        let entry = self.entry(corner);
        let Some(before) = self.ahead_of(corner) else { return LEAST_ROOM };
        let (along_before, along) = (before.accel() / ONE, entry.accel() / ONE);
        let mut room = 1.0;
        for ((from, to), limit) in before.unit.iter().zip(entry.unit).zip(self.limits.accels) {
            if limit <= 0.0 || *from == to {
                continue;
            }
            let jump = velocity * f32::from(from.abs_diff(to)) * (1.0 / ONE) / limit;
            let from = f32::from(from.unsigned_abs()) * along_before / limit;
            let to = f32::from(to.unsigned_abs()) * along / limit;
            for (passed, height) in &self.limits.kernel.shape {
                let left = 1.0 - jump * height;
                let ramps = from * (1.0 - passed) + to * passed;
                if left < room * ramps {
                    room = left / ramps;
                }
            }
        }
        room
    }
}
