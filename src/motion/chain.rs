//! Short moves that lie on a line, as one: what a program says in many lines, one block does.
//!
//! Owned by the planner, which keeps one [`Chain`]: the lines since the last block. A line goes on with the chain if all
//! the ends that the program has named so far are within the tolerance of the straight way from the chain's start to the new end.
//! Then the path driven is within the tolerance of every point of the path programmed, and the other way round: between two ends
//! both are straight.
//!
//! **What it keeps.** No end but the last. The axis that goes farthest is the dominant one, and no line of a chain goes back along it. Each
//! of the others ([`Minor`]) has the steepest and the least steep way that passes within the tolerance of all ends before the last. A
//! new end is on such a way or it is not; if it is, it makes the two steeper and less steep in turn. All is in integers and exact: what is
//! on one line to the unit of [`Length`] is merged whatever the tolerance.
//!
//! **The tolerance.** The two ways are compared where the dominant axis is as far. That is never nearer than they are, so for
//! one other axis the tolerance holds as it is. For two each gets 0.7 of it.
//!
//! **How long it gets.** What takes [`TIME_MS`] at its feed along any axis, or 3.2 mm. What reports tell of a line is that much
//! ahead of it, no more. Lines of which each takes longer are not merged.
//!
//! Only linear axes, and only lines at the same feed. Cost on AVR: 900 cycles for a line that goes on, 600 for one that begins.

use kerf_macros::small;

use super::float::{scaled, whole};
use crate::gcode::command::Feed;
use crate::hal::arithmetic::product;
use crate::units::{AXES, FIRST_ROTARY, Length, PerAxis};

/// What a chain takes at most, at its feed.
pub const TIME_MS: u16 = 12;

/// In that time a feed of 1 mm/min goes so far in units of [`Length`], as a power of two.
const FEED_LOG2: i8 = 1;
const _: () = assert!(Length::PER_MM as u32 * TIME_MS as u32 == 60_000 << FEED_LOG2);

/// The farthest that any axis goes: with the tolerance it fits 16 bits.
const MOST: u16 = 0x7E00;

/// The axes other than the dominant one.
const MINORS: usize = FIRST_ROTARY - 1;

/// How much an axis goes for how much of the dominant one.
#[derive(Clone, Copy, Debug, Default)]
struct Slope {
    way: i16,
    over: u16,
}

impl Slope {
    /// The one that goes so much more.
    #[inline(always)]
    fn beside(&self, way: i16) -> Self {
        Self { way: self.way + way, over: self.over }
    }
}

/// Between which slopes the way of an axis has to stay.
#[derive(Clone, Copy, Debug, Default)]
struct Minor {
    low: Slope,
    high: Slope,
}

impl Minor {
    /// For an end that has to be passed.
    #[inline(never)]
    fn past(end: &Slope, tolerance: i16) -> Self {
        Self { low: end.beside(-tolerance), high: end.beside(tolerance) }
    }

    /// Whether a way to this end stays between them. If so, it has to be passed from now on.
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

/// Lines that one block will do.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chain {
    /// From its start to its end.
    way: PerAxis<i16>,
    /// mm/min.
    feed: f32,
    /// How far the dominant axis goes at most.
    most: u16,
    /// What was asked for, see [`Commands::blend`](crate::gcode::command::Commands::blend); 0 if nothing goes on with it.
    blend: u8,
    /// The tolerance of each axis.
    tolerance: i16,
    dominant: u8,
    /// Which minors have moved, a bit each.
    moved: u8,
    /// The axes behind the dominant one, in a ring.
    minors: [Minor; MINORS],
}

impl Chain {
    /// Becomes a chain of one line. False if that is too long, or none that may be merged.
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
        // Both may be off by as much.
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

    /// A way that nothing goes on with. No axis goes farther than 16 bits hold.
    #[inline(never)]
    #[small]
    pub fn closed(from: &PerAxis<Length>, to: &PerAxis<Length>) -> Self {
        let mut chain = Self::default();
        for (way, (from, to)) in chain.way.iter_mut().zip(from.iter().zip(to)) {
            *way = to.0.wrapping_sub(from.0) as i16;
        }
        chain
    }

    /// Whether nothing goes on with it.
    pub fn is_closed(&self) -> bool {
        self.blend == 0
    }

    /// Closes the chain: no line goes on with it any more.
    pub fn close(&mut self) {
        self.blend = 0;
    }

    /// Where it ends, if it begins at `from`.
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

    /// Goes on to `to`, if all its ends are near enough to the straight way there. It begins at `from`. After a line that did not
    /// go on none will.
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
            // Behind a line of next to nothing another axis may go farther.
            if way.unsigned_abs() > self.most {
                return false;
            }
            if self.moved & bit == 0 && way != 0 {
                // Two that move have less of the tolerance each.
                if self.moved != 0 {
                    return false;
                }
                // Of all ends at which it has not moved the last says most.
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

    /// Sets the way of the chain; rotary axes have none.
    #[inline(always)]
    fn take(&mut self, way: [i16; FIRST_ROTARY]) {
        for (place, way) in self.way.iter_mut().zip(way) {
            *place = way;
        }
    }
}

/// The ways of the dominant axis and of those behind it.
#[inline(always)]
fn turned([x, y, z]: [i16; FIRST_ROTARY], dominant: u8) -> (i16, [i16; MINORS]) {
    match dominant {
        0 => (x, [y, z]),
        1 => (y, [z, x]),
        _ => (z, [x, y]),
    }
}

/// The way from here to there. False if an axis goes far, or one turns.
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

/// A product with a number below 2^15.
#[inline(always)]
fn times(a: i16, b: u16) -> i32 {
    let size = product(a.unsigned_abs(), b) as i32;
    if a < 0 { -size } else { size }
}
