//! Windows: corners in a row that may come within the time of a mean.

use super::limits::{in_lengths, reach, taken};
use super::{Blend, CURVE, EVEN, Entry, ONE, PER_MM, PLACES, ROUND, SHARE, WEIGHT};
use crate::motion::float::{greater, least};
use crate::motion::junction::{STRAIGHT, turn};

/// Some corners in a row, the last of which is the newest.
#[derive(Clone, Copy)]
pub(super) struct Window {
    /// The length of the path between them.
    way: u32,
    /// The velocity limit for each mean: that at which the path takes longer than the mean, or that of the change.
    limits: [f32; 2],
    /// The change of direction: that of an axis, weighted, in 2^-22, and the square of the whole.
    change: u32,
    square: u32,
}

impl Window {
    /// No window.
    pub(super) const NONE: Self = Self { way: 0, limits: [f32::MAX; 2], change: 0, square: 0 };
}

/// What decides about the windows of a mean.
struct Bounds {
    seconds: f32,
    /// The velocity at which windows are looked for, mm/s.
    top: f32,
    /// By how much the machine may speed up between corners, mm/s.
    speeds_up: f32,
    /// The velocity limit so far, and the changes above which a window lowers it.
    limit: f32,
    change: u32,
    square: u32,
    /// The longest window.
    longest: u32,
}

impl Bounds {
    /// Returns the velocity below which a path takes longer than the mean.
    fn alone(&self, way: u32) -> f32 {
        greater(way as f32 * (1.0 / PER_MM) / self.seconds - self.speeds_up, 0.0)
    }

    /// Returns the longest path that may take less time than the mean between places that are passed at `velocity`.
    fn reach(&self, velocity: f32) -> u32 {
        in_lengths((velocity + self.speeds_up) * self.seconds)
    }
}

impl Blend {
    /// Applies what the windows ask for that end at the last corner, up to the velocity `top`.
    pub(super) fn look_back(&mut self, top: f32) {
        let newest = self.len - 1;
        let (to, accel) = (self.entry(newest).unit, self.entry(newest).accel());
        let slowest = self.slowest(newest);
        let is_curve = self.entry(newest).turn < CURVE && slowest >= EVEN * accel;
        let mut bounds = [0, 1].map(|mean| self.bounds(mean, top, accel, slowest, is_curve));
        let mut oldest = newest;
        // The windows, from the shortest to the longest.
        while let Some(from) = self.unit_ahead_of(oldest) {
            let way = self.way(oldest, newest);
            if oldest < newest && bounds.iter().all(|bounds| way >= bounds.longest) {
                oldest += 1;
                break;
            }
            let (change, square) = (self.limits.change(&from, &to), turn(&from, &to));
            let mut window = Window { way, limits: [f32::MAX; 2], change, square };
            for (limit, bounds) in window.limits.iter_mut().zip(&mut bounds) {
                if change > bounds.change || square > bounds.square {
                    let mut together = self.limits.velocity(change, bounds.seconds);
                    if is_curve {
                        let taken = taken(square, slowest * bounds.seconds);
                        together = least(together, SHARE / taken);
                    }
                    *limit = greater(together, bounds.alone(way));
                    bounds.limit = least(bounds.limit, *limit);
                }
            }
            self.windows[oldest % PLACES] = window;
            match oldest.checked_sub(1) {
                Some(before) if before >= self.done => oldest = before,
                _ => break,
            }
        }
        for (mean, bounds) in bounds.iter().enumerate() {
            self.look_ahead(oldest, newest, mean, bounds);
        }
    }

    /// Returns what decides about the windows of a mean.
    fn bounds(&self, mean: usize, top: f32, accel: f32, slowest: f32, is_curve: bool) -> Bounds {
        let seconds = self.limits.windows[mean & 1];
        let speeds_up = 0.25 * ROUND * accel * seconds;
        let share = SHARE * ONE * seconds / top;
        let whole = share * slowest;
        Bounds {
            seconds,
            top,
            speeds_up,
            limit: top,
            change: (share * WEIGHT * self.limits.accel) as u32,
            square: if is_curve { (whole * whole) as u32 } else { u32::MAX },
            longest: in_lengths((top + speeds_up) * seconds),
        }
    }

    /// Applies the windows of a mean to the corners from `oldest` to `newest`.
    fn look_ahead(&mut self, oldest: usize, newest: usize, mean: usize, bounds: &Bounds) {
        let last = bounds.limit;
        let near = bounds.reach(last);
        let (mut limit, mut change, mut square) = (f32::MAX, 0, 0);
        for n in oldest..=newest {
            let window = self.windows[n % PLACES];
            let asked = &mut self.entry_mut(n).asked[mean & 1];
            limit = least(limit, window.limits[mean & 1]);
            asked.velocity = least(asked.velocity, limit);
            let velocity = least(asked.velocity, bounds.top);
            let within =
                window.way < near || velocity > last && window.way < bounds.reach(velocity);
            if within {
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
        self.corners_about(corner, near).any(|n| differs(self.entry(n))).into()
    }

    /// Whether no other corner is so near that the means mix it with this one.
    pub(super) fn is_alone(&self, corner: usize, velocity: f32, accel: f32) -> bool {
        let near = in_lengths(reach(velocity, accel, 2.0 * self.limits.kernel.reach()));
        let about = self.corners_about(corner, near);
        let reaches_gone = about.start == 0 && self.way(0, corner).saturating_add(self.gone) < near;
        let mut others = about.filter(|n| *n != corner);
        !reaches_gone && !others.any(|n| self.entry(n).turn >= STRAIGHT)
    }
}
