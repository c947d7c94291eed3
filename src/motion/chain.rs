//! Merges short, nearly collinear moves into one block.
//!
//! The planner owns one [`Chain`]: the lines since the last block. A line joins the chain if all its programmed end
//! points so far lie within the tolerance of the straight line from the chain's start to the new end point. Then the
//! driven path is within the tolerance of every point of the programmed path, and vice versa, because both are straight
//! between end points.
//!
//! **State.** The chain stores only its last end point. The dominant axis is the one that travels farthest in the first
//! line; no line of a chain reverses it. For each other axis ([`Minor`]) the chain stores the highest and the lowest
//! slope that pass within the tolerance of all earlier end points. A new end point must lie between these two slopes,
//! and then narrows them. The arithmetic is exact, in integers: lines that are collinear to the unit of [`Length`] are
//! merged whatever the tolerance.
//!
//! **Tolerance.** The deviation of the driven path is measured at equal positions of the dominant axis. It is never
//! less than the true distance between the paths. If one other axis moves, it gets the whole tolerance; if two move,
//! each gets 0.7 of it.
//!
//! **Length.** No axis travels farther in a chain than in [`TIME_MS`] at the feed, nor farther than 3.2 mm. A report
//! names a line early by at most that distance. Lines that are longer than that are not merged.
//!
//! Only lines of linear axes, at one feed, are merged. Cost on AVR: 900 cycles for a line that joins, 600 for one that
//! begins a chain.

use kerf_macros::small;

use super::float::{scaled, whole};
use crate::gcode::command::Feed;
use crate::hal::arithmetic::product;
use crate::units::{AXES, FIRST_ROTARY, Length, PerAxis};

/// The longest travel of an axis in a chain, as time at the feed.
pub const TIME_MS: u16 = 12;

/// The distance at 1 mm/min in [`TIME_MS`], in units of [`Length`], as a power of two.
const FEED_LOG2: i8 = 1;
const _: () = assert!(Length::PER_MM as u32 * TIME_MS as u32 == 60_000 << FEED_LOG2);

/// The longest travel of any axis in a chain, units of [`Length`]: with the tolerance it fits 16 bits.
const MOST: u16 = 0x7E00;

/// The axes other than the dominant one.
const MINORS: usize = FIRST_ROTARY - 1;

/// A slope: an axis travels `way` while the dominant axis travels `over`, in units of [`Length`].
#[derive(Clone, Copy, Debug, Default)]
struct Slope {
    way: i16,
    over: u16,
}

impl Slope {
    /// Returns a slope whose travel is larger by `way`.
    #[inline(always)]
    fn beside(&self, way: i16) -> Self {
        Self { way: self.way + way, over: self.over }
    }
}

/// The slopes of an axis between which the next end point must lie.
#[derive(Clone, Copy, Debug, Default)]
struct Minor {
    low: Slope,
    high: Slope,
}

impl Minor {
    /// Returns the lowest and the highest slope that pass within the tolerance of an end point.
    #[inline(never)]
    fn past(end: &Slope, tolerance: i16) -> Self {
        Self { low: end.beside(-tolerance), high: end.beside(tolerance) }
    }

    /// Whether an end point lies between the slopes. If so, narrows the slopes to pass within its tolerance.
    ///
    /// Slopes are compared by cross-multiplication; products are below 2^30. The slopes at the edges of the tolerance
    /// differ from the end point's own slope by the tolerance times the other `over`.
    #[inline(never)]
    fn pass(&mut self, end: &Slope, tolerance: i16) -> bool {
        let (low, at_low) = (times(self.low.way, end.over), times(end.way, self.low.over));
        if low > at_low {
            return false;
        }
        let (high, at_high) = (times(self.high.way, end.over), times(end.way, self.high.over));
        if high < at_high {
            return false;
        }
        let size = tolerance as u16;
        if at_low - product(size, self.low.over) as i32 > low {
            self.low = end.beside(-tolerance);
        }
        if at_high + (product(size, self.high.over) as i32) < high {
            self.high = end.beside(tolerance);
        }
        true
    }
}

/// Lines that become one block.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chain {
    /// Travel from the start of the chain to its end, units of [`Length`].
    way: PerAxis<i16>,
    /// mm/min.
    feed: f32,
    /// Longest travel of the dominant axis.
    most: u16,
    /// The requested tolerance plus one, see [`Commands::blend`](crate::gcode::command::Commands::blend); 0 if no line
    /// may join the chain.
    blend: u8,
    /// The tolerance of each axis.
    tolerance: i16,
    dominant: u8,
    /// Which minors have moved, a bit each.
    moved: u8,
    /// The axes after the dominant one, in cyclic order.
    minors: [Minor; MINORS],
}

impl Chain {
    /// Makes this a chain of one line. Returns false if the line is too long, or must not be merged.
    #[inline(never)]
    pub fn begin(
        &mut self,
        from: &PerAxis<Length>,
        to: &PerAxis<Length>,
        feed: Option<&Feed>,
        blend: u8,
    ) -> bool {
        let Some(&Feed::PerMinute(feed)) = feed else { return false };
        let mut way = [0; FIRST_ROTARY];
        if blend == 0 || !go(from, to, &mut way) {
            return false;
        }
        self.way = [0; AXES];
        self.take(way);
        let [x, y, z] = way.map(i16::unsigned_abs);
        self.dominant = if z > x && z > y { 2 } else { u8::from(y > x) };
        let far = whole(scaled(feed, FEED_LOG2));
        self.most = if far < u32::from(MOST) { far as u16 } else { MOST };
        let (way, ends) = turned(way, self.dominant);
        let over = way.unsigned_abs();
        if over == 0 || over >= self.most {
            return false;
        }
        (self.feed, self.blend) = (feed, blend);
        let tolerance = u16::from(blend - 1);
        // If both other axes move, each gets 0.7 of the tolerance.
        let both = ends.iter().all(|way| *way != 0);
        self.tolerance = if both { product(tolerance, 181) >> 8 } else { tolerance.into() } as i16;
        self.moved = 0;
        let mut bit = 1;
        for (minor, &way) in self.minors.iter_mut().zip(&ends) {
            if way != 0 {
                *minor = Minor::past(&Slope { way, over }, self.tolerance);
                self.moved |= bit;
            }
            bit <<= 1;
        }
        true
    }

    /// Returns a move that no line joins. The travel of each axis must fit 16 bits.
    #[inline(never)]
    #[small]
    pub fn closed(from: &PerAxis<Length>, to: &PerAxis<Length>) -> Self {
        let mut chain = Self::default();
        for (way, (from, to)) in chain.way.iter_mut().zip(from.iter().zip(to)) {
            *way = to.0.wrapping_sub(from.0) as i16;
        }
        chain
    }

    /// Whether no line may join the chain.
    pub fn is_closed(&self) -> bool {
        self.blend == 0
    }

    /// Closes the chain: no line joins it any more.
    pub fn close(&mut self) {
        self.blend = 0;
    }

    /// Returns where the chain ends, if it begins at `from`.
    #[inline(always)]
    pub fn end(&self, from: &PerAxis<Length>) -> PerAxis<Length> {
        let mut end = *from;
        for (end, way) in end.iter_mut().zip(&self.way) {
            if *way != 0 {
                end.0 = end.0.wrapping_add((*way).into());
            }
        }
        end
    }

    /// The feed of the chain; `None` if the chain is closed.
    pub fn feed(&self) -> Option<Feed> {
        (!self.is_closed()).then_some(Feed::PerMinute(self.feed))
    }

    /// Extends the chain, which begins at `from`, to the end point `to`, if all its end points are within the tolerance
    /// of the straight line to `to`. Returns whether it did. After `false`, no other line may join.
    #[inline(never)]
    pub fn go_on(
        &mut self,
        from: &PerAxis<Length>,
        to: &PerAxis<Length>,
        feed: Option<&Feed>,
        blend: u8,
    ) -> bool {
        let Some(Feed::PerMinute(feed)) = feed else { return false };
        let differs = feed.to_bits() != self.feed.to_bits() || blend != self.blend;
        let mut next = [0; FIRST_ROTARY];
        if differs || blend == 0 || !go(from, to, &mut next) {
            return false;
        }
        let [x, y, z, ..] = self.way;
        let (before, _) = turned([x, y, z], self.dominant);
        let (now, ends) = turned(next, self.dominant);
        let (passed, over) = (before.unsigned_abs(), now.unsigned_abs());
        if (now ^ before) < 0 || over < passed || over > self.most {
            return false;
        }
        let mut bit = 1;
        for (minor, &way) in self.minors.iter_mut().zip(&ends) {
            // If the first line was very short, another axis may now travel farther than the dominant one.
            if way.unsigned_abs() > self.most {
                return false;
            }
            if self.moved & bit == 0 && way != 0 {
                // The tolerance was set for one other axis that moves, so a second one may not begin to move.
                if self.moved != 0 {
                    return false;
                }
                // Of all ends at which the axis has not moved, the last one limits it most.
                *minor = Minor::past(&Slope { way: 0, over: passed }, self.tolerance);
                self.moved = bit;
            }
            if self.moved & bit != 0 && !minor.pass(&Slope { way, over }, self.tolerance) {
                return false;
            }
            bit <<= 1;
        }
        self.take(next);
        true
    }

    /// Sets the travel of the chain; rotary axes do not move.
    #[inline(always)]
    fn take(&mut self, way: [i16; FIRST_ROTARY]) {
        for (place, way) in self.way.iter_mut().zip(way) {
            *place = way;
        }
    }
}

/// Returns the travel of the dominant axis, and that of the axes after it in cyclic order.
#[inline(always)]
fn turned([x, y, z]: [i16; FIRST_ROTARY], dominant: u8) -> (i16, [i16; MINORS]) {
    match dominant {
        0 => (x, [y, z]),
        1 => (y, [z, x]),
        _ => (z, [x, y]),
    }
}

/// Writes the travel from `from` to `to`. Returns false if an axis travels too far, or a rotary axis moves.
#[inline(never)]
fn go(from: &PerAxis<Length>, to: &PerAxis<Length>, ways: &mut [i16; FIRST_ROTARY]) -> bool {
    let mut axes = from.iter().zip(to);
    for (way, (from, to)) in ways.iter_mut().zip(axes.by_ref()) {
        let far = to.0.wrapping_sub(from.0);
        *way = far as i16;
        // From -MOST to MOST.
        if far.wrapping_add(MOST.into()) as u32 > 2 * u32::from(MOST) {
            return false;
        }
    }
    axes.all(|(from, to)| from == to)
}

/// Returns the signed product; `b` is below 2^15.
#[inline(always)]
fn times(a: i16, b: u16) -> i32 {
    let size = product(a.unsigned_abs(), b) as i32;
    if a < 0 { -size } else { size }
}
