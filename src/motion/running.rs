//! The block that exec is running: where in its profile it is, and how far the next stretch goes.
//!
//! Owned by [`Exec`](super::exec::Exec). A block is an up-ramp (head), a cruise (body) and a down-ramp
//! (tail). Times are seconds, distances mm; what is left is counted in phase units of the dominant
//! motor, in integers.
//!
//! Cost on AVR: [`Running::new`] 15,000 cycles, more where a peak has to be searched; the rest together
//! about 5,000 a segment.

use super::block::Block;
use super::profile::{Limits, Ramp, greater, lesser, peak, reach};

/// Slowest cruise, mm/s: only keeps a division by zero away.
pub const CRUISE_MIN: f32 = 1e-9;

/// Where in its block exec is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Head,
    Body,
    Tail,
}

/// The block being run.
#[derive(Clone, Copy, Debug)]
pub struct Running {
    head: Ramp,
    tail: Ramp,
    phase: Phase,
    /// Seconds since the ramp began, in `Head` and `Tail`.
    time: f32,
    /// Velocity between the ramps, and at the end, mm/s.
    pub cruise: f32,
    /// See `cruise`.
    pub exit: f32,
    limits: Limits,
    /// Phase units of the dominant motor in a mm.
    scale: f32,
    /// Phase units of the dominant motor until the end, beyond those handed to `Prep`.
    left: u64,
    /// One over all phase units of the block.
    per_total: f32,
    /// One over `scale`, and over `cruise`.
    per_scale: f32,
    per_cruise: f32,
    /// What is below a phase unit.
    fraction: f32,
}

/// A count of phase units as a float; cheaper than the library's 64-bit conversion.
fn units(count: u64) -> f32 {
    (count >> 16) as u32 as f32 * 65536.0 + f32::from(count as u16)
}

impl Running {
    /// Plans a block that is entered at `entry` and should be left at `exit_wish`.
    pub fn new(block: &Block, most: u32, entry: f32, exit_wish: f32) -> Self {
        let limits = Limits { accel: block.accel, jerk: block.jerk };
        let length = block.length;
        let exit = if exit_wish > entry && Ramp::new(entry, exit_wish, &limits).length() > length {
            lesser(reach(entry, length, &limits), exit_wish)
        } else {
            exit_wish
        };
        let cruise = greater(peak(entry, exit, length, block.cruise, &limits), CRUISE_MIN);
        let left = u64::from(most) << 15;
        let total = units(left);
        let scale = total / length;
        Self {
            head: Ramp::new(entry, cruise, &limits),
            tail: Ramp::new(cruise, exit, &limits),
            phase: Phase::Head,
            time: 0.0,
            cruise,
            exit,
            limits,
            scale,
            per_scale: 1.0 / scale,
            per_cruise: 1.0 / cruise,
            per_total: 1.0 / total,
            left,
            fraction: 0.0,
        }
    }

    /// Takes over a higher exit velocity, if there is one and the down-ramp has not begun.
    pub fn raise_exit(&mut self, wish: f32) {
        if self.phase != Phase::Tail && wish > self.exit * 1.001 {
            self.exit = wish;
            self.tail = Ramp::new(self.cruise, wish, &self.limits);
        }
    }

    /// Length of the cruise still to be run, mm. In the head, of the whole cruise.
    pub fn body_left(&self) -> f32 {
        let head = if self.phase == Phase::Head { self.head.remaining(self.time) } else { 0.0 };
        greater(units(self.left) * self.per_scale - head - self.tail.length(), 0.0)
    }

    /// Seconds until the end of the block, of whose cruise `body` mm are left.
    pub fn time_left(&self, body: f32) -> f32 {
        match self.phase {
            Phase::Tail => self.tail.time() - self.time,
            Phase::Body => body * self.per_cruise + self.tail.time(),
            Phase::Head => {
                let head = self.head.time() - self.time;
                head + body * self.per_cruise + self.tail.time()
            }
        }
    }

    /// Share of the block that is left.
    pub fn share_left(&self) -> f32 {
        units(self.left) * self.per_total
    }

    /// Velocity now, mm/s.
    pub fn velocity(&self) -> f32 {
        match self.phase {
            Phase::Head => self.head.velocity(self.time),
            Phase::Body => self.cruise,
            Phase::Tail => self.tail.velocity(self.time),
        }
    }

    /// Advances the time; returns the distance, in phase units of the dominant motor. `body` mm of
    /// the cruise are left.
    pub fn advance(&mut self, seconds: f32, body: f32) -> u32 {
        let mut travel = 0.0;
        let mut seconds = seconds;
        if self.phase == Phase::Head {
            let until = self.time + seconds;
            if until < self.head.time() {
                travel = self.head.distance(until) - self.head.distance(self.time);
                self.time = until;
                return self.take(travel);
            }
            travel = self.head.remaining(self.time);
            seconds = until - self.head.time();
            self.phase = Phase::Body;
        }
        if self.phase == Phase::Body {
            let possible = self.cruise * seconds;
            if possible < body {
                return self.take(travel + possible);
            }
            travel += body;
            seconds -= body * self.per_cruise;
            self.phase = Phase::Tail;
            self.time = 0.0;
        }
        let before = self.tail.remaining(self.time);
        self.time += greater(seconds, 0.0);
        self.take(travel + before - self.tail.remaining(self.time))
    }

    /// Cuts `travel` mm to whole phase units and takes them from what is left.
    fn take(&mut self, travel: f32) -> u32 {
        let exact = travel * self.scale + self.fraction;
        let whole = (exact as u32).min(self.left.min(u64::from(u32::MAX / 2)) as u32);
        self.fraction = lesser(greater(exact - whole as f32, 0.0), 1.0);
        self.left -= u64::from(whole);
        whole
    }
}
