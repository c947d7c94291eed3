//! Merges short moves that lie on a line: what a program says in many lines, one block does.
//!
//! Owned by the planner, which keeps one [`Chain`]: the lines since the last block. A line joins the chain if all
//! ends that the program has named in it so far are within the tolerance of the straight way from the chain's start
//! to the new end. Then the driven path is within the tolerance of every point of the programmed path, and the other
//! way round, because both are straight between two ends.
//!
//! **What it keeps.** No end but the last. The axis that goes farthest is the dominant one, and no line of a chain
//! goes back along it. For each of the other axes ([`Minor`]) the chain keeps the steepest and the least steep way
//! that pass within the tolerance of all ends before the last. A new end must lie between the two; then it narrows
//! them in turn. All is in integers and exact: lines that lie on one line to the unit of [`Length`] are merged
//! whatever the tolerance.
//!
//! **The tolerance.** The driven and the programmed path are compared where the dominant axis is as far. The distance
//! there is never less than the true distance, so that for one other axis the tolerance holds as it is. With two other
//! axes, each gets 0.7 of it.
//!
//! **How long it gets.** At most what takes [`TIME_MS`] at its feed along any axis, or 3.2 mm. Reports name a line
//! that much too early at most. Lines that each take longer are not merged.
//!
//! Only linear axes, and only lines at the same feed. Cost on AVR: 900 cycles for a line that goes on, 600 for one that begins.

use kerf_macros::small;

use super::float::{scaled, whole};
use crate::gcode::command::Feed;
use crate::hal::arithmetic::product;
use crate::units::{AXES, FIRST_ROTARY, Length, PerAxis};

/// The longest time that a chain takes at its feed.
pub const TIME_MS: u16 = 12;

/// How far a feed of 1 mm/min goes in that time, in units of [`Length`], as a power of two.
const FEED_LOG2: i8 = 1;
const _: () = assert!(Length::PER_MM as u32 * TIME_MS as u32 == 60_000 << FEED_LOG2);

/// The farthest that any axis goes in a chain: with the tolerance it fits 16 bits.
const MOST: u16 = 0x7E00;

/// The axes other than the dominant one.
const MINORS: usize = FIRST_ROTARY - 1;

/// A slope: how far an axis goes (`way`) while the dominant axis goes `over`.
#[derive(Clone, Copy, Debug, Default)]
struct Slope {
    way: i16,
    over: u16,
}

impl Slope {
    /// Returns the slope that goes `way` farther.
    #[inline(always)]
    fn beside(&self, way: i16) -> Self {
        Self { way: self.way + way, over: self.over }
    }
}

/// The slopes between which the way of an axis has to stay.
#[derive(Clone, Copy, Debug, Default)]
struct Minor {
    low: Slope,
    high: Slope,
}

impl Minor {
    /// Returns the slopes that pass an end within the tolerance.
    #[inline(never)]
    fn past(end: &Slope, tolerance: i16) -> Self {
        Self { low: end.beside(-tolerance), high: end.beside(tolerance) }
    }

    /// Whether the way to this end stays between the slopes. If so, the end has to be passed from now on.
    ///
    /// Two slopes are compared by what each goes over the product of both lengths, below 2^30; the slopes beside the end differ from its own by
    /// the tolerance times the other length.
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
    /// The way from the start of the chain to its end.
    way: PerAxis<i16>,
    /// mm/min.
    feed: f32,
    /// How far the dominant axis may go at most.
    most: u16,
    /// What was asked for, see [`Commands::blend`](crate::gcode::command::Commands::blend); 0 if no line may join the
    /// chain.
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
        // With two other axes, both may be off by this much.
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

    /// Returns a way that no line joins. No axis may go farther than 16 bits hold.
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

    /// The feed of the chain; `None` if no line may go on with it.
    pub fn feed(&self) -> Option<Feed> {
        (!self.is_closed()).then_some(Feed::PerMinute(self.feed))
    }

    /// Goes on to `to`, if all ends of the chain, which begins at `from`, are near enough to the straight way there.
    /// Returns whether it does. After a line that did not join, no other line may.
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
            // After a line of next to nothing, another axis may go farther than the dominant one.
            if way.unsigned_abs() > self.most {
                return false;
            }
            if self.moved & bit == 0 && way != 0 {
                // Two axes that move have less of the tolerance each, so a second one does not join.
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

    /// Sets the way of the chain; rotary axes do not move.
    #[inline(always)]
    fn take(&mut self, way: [i16; FIRST_ROTARY]) {
        for (place, way) in self.way.iter_mut().zip(way) {
            *place = way;
        }
    }
}

/// Returns the way of the dominant axis, and the ways of the axes after it in cyclic order.
#[inline(always)]
fn turned([x, y, z]: [i16; FIRST_ROTARY], dominant: u8) -> (i16, [i16; MINORS]) {
    match dominant {
        0 => (x, [y, z]),
        1 => (y, [z, x]),
        _ => (z, [x, y]),
    }
}

/// Sets the way from `from` to `to`. Returns false if an axis goes too far, or a rotary axis moves.
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

/// Returns a product with a number below 2^15.
#[inline(always)]
fn times(a: i16, b: u16) -> i32 {
    let size = product(a.unsigned_abs(), b) as i32;
    if a < 0 { -size } else { size }
}
