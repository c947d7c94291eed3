//! The end of the block queue: the line that the next line follows, and whether the next line needs a key.
//!
//! Part of `queue`. Units: mm/s, brake potentials as in `speed_constraints`. Costs are AVR cycles.

use super::block::Line;
use super::factors::Factors;
use super::float::{greater, least, lesser};
use super::short::Short;

/// A corner is worth a key if it is slower than this share of the velocities on both sides.
pub(super) const WORTH: f32 = 0.999;

/// The state at the end of the queue.
pub(super) struct Tail {
    /// The last line, if the next one may follow it without a stop.
    pub(super) last: Option<Last>,
    /// The overrides that keys are made for.
    pub(super) factors: Factors,
}

/// What the planner remembers of the line pushed last.
#[derive(Clone, Copy)]
pub(super) struct Last {
    pub(super) cruise: f32,
    /// The highest velocity since the last key, because many lines that are each slightly slower need a key together.
    pub(super) high: f32,
}

impl Last {
    /// Whether a line with this `cruise` and `entry` velocity is as fast as the last line.
    fn as_fast(&self, cruise: f32, entry: f32) -> bool {
        let cruise = cruise.to_bits();
        entry.to_bits() >= cruise
            && self.cruise.to_bits() == cruise
            && self.high.to_bits() == cruise
    }
}

impl Tail {
    /// Appends a line that starts at potential `line.start`, and whose corner may be taken at `entry`. Returns its key,
    /// or `None` if it needs none. Cost: 150 if it needs none.
    #[inline(always)]
    pub(super) fn follow(&mut self, line: &mut Line, entry: f32) -> Option<f32> {
        line.entry = Short::new(entry);
        let cruise = line.velocity(&self.factors);
        let goes_on = self.last.as_ref().is_some_and(|last| last.as_fast(cruise, entry));
        if goes_on { None } else { self.corner(line, cruise, entry) }
    }

    /// Returns the key of a line with another velocity or a corner, or `None` if it needs none.
    #[inline(never)]
    fn corner(&mut self, line: &mut Line, cruise: f32, entry: f32) -> Option<f32> {
        let (mut entry, mut high) = (entry, cruise);
        let mut is_worth = true;
        match &self.last {
            None => entry = 0.0,
            Some(last) => {
                let limit = lesser(last.cruise, cruise) * WORTH;
                is_worth = entry < limit || cruise < last.high * WORTH;
                if !is_worth {
                    high = greater(last.high, cruise);
                }
            }
        }
        line.entry = Short::new(entry);
        self.last = Some(Last { cruise, high });
        if !is_worth {
            return None;
        }
        let entry = Short::new(least(line.entry.get(), cruise)).get();
        Some(line.start + entry * entry)
    }
}
