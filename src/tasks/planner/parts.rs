//! Lines that take several blocks: arcs, chord by chord, and moves of more steps than a block holds.

use kerf_macros::small;

use super::Planner;
use crate::gcode::arc::{Extent, Walk};
use crate::gcode::command::{Feed, Motion};
use crate::gcode::interpreter::Offsets;
use crate::motion::curve::Curve;
#[cfg(feature = "lathe")]
use crate::units::FIRST_ROTARY;
use crate::units::{Length, PerAxis};

/// Work that lasts longer than a turn. There is one at a time, so that they share memory.
pub(super) enum Ongoing {
    /// Nothing is going on.
    None,
    /// An arc.
    Arc(ArcWalk),
    /// A pass in step with the spindle, from here.
    #[cfg(feature = "lathe")]
    Pass([Length; FIRST_ROTARY]),
    /// Check mode: these are the offsets from before it.
    Check(Offsets),
}

/// An arc under way.
pub(super) struct ArcWalk {
    pub walk: Walk,
    /// mm/min.
    pub feed: f32,
    pub curve: Curve,
}

/// A move under way that is too long for one block, or longer than a [`Length`] can be.
pub(super) struct Parts {
    target: PerAxis<Length>,
    pub feed: Option<Feed>,
    pub left: u32,
}

impl Parts {
    #[inline(never)]
    #[small]
    pub fn new(target: &PerAxis<Length>, feed: Option<Feed>, of: u16) -> Self {
        let mut parts = Self { target: *target, feed, left: 1 };
        parts.divide(of);
        parts
    }

    /// Divides each remaining part into `of` parts. Interpreters refuse moves whose shortest part would still be too
    /// long.
    #[inline(never)]
    #[small]
    pub fn divide(&mut self, of: u16) {
        // The time of an inverse-time feed is that of the whole move.
        if let Some(Feed::Minutes(minutes)) = &mut self.feed {
            *minutes /= f32::from(of);
        }
        self.left = self.left.wrapping_mul(of.into());
    }

    /// Returns the end of the next part, with the machine at `position`.
    #[inline(never)]
    #[small]
    pub fn end(&self, position: &PerAxis<Length>) -> PerAxis<Length> {
        let mut end = self.target;
        for (end, start) in end.iter_mut().zip(position) {
            let way = i64::from(end.0) - i64::from(start.0);
            *end = Length((i64::from(start.0) + way / i64::from(self.left)) as i32);
        }
        end
    }
}

impl Planner {
    #[inline(never)]
    #[small]
    pub(super) fn begin_arc(&mut self, motion: &Motion) {
        let Motion::Arc { target, feed, arc } = motion else { return };
        let tolerance = self.links.settings.borrow().chordal_tolerance();
        let extent = Extent::of(&self.position, target, arc);
        // The time of an inverse-time arc is that of all its chords together.
        let feed = match *feed {
            Feed::Minutes(minutes) if minutes > 0.0 => extent.length() / minutes,
            Feed::Minutes(_) => f32::MAX,
            Feed::PerMinute(rate) => rate,
        };
        let axes = [arc.first, arc.second];
        let (radius, slope) = (extent.radius(), extent.slope());
        let (curve, longest) = Curve::of(axes, radius, slope, feed, &self.dynamics);
        let walk = Walk::new(&self.position, arc, &extent, tolerance, longest);
        self.walk = Ongoing::Arc(ArcWalk { walk, feed, curve });
    }
}
