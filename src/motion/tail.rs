//! The end of the block queue: the line that the next line follows, and whether the next line needs a key.
//!
//! Part of `queue`. Units: mm/s, brake potentials as in `speed_constraints`. Costs are AVR cycles.

use kerf_macros::small;

use super::block::Line;
use super::factors::Factors;
use super::float::{greater, least, lesser, some};
use super::queue::FIRM;
use super::short::Short;
use super::speed_constraints::{self, kappa};
use crate::hal::ring::Index;
use crate::math::sqrt;

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
    kappa: f32,
    limits: (Short, Short),
}

/// A key of the speed constraints.
#[derive(Clone, Copy)]
pub(super) struct Key {
    pub(super) key: f32,
    /// [`FIRM`] or 0.
    pub(super) firm: Index,
    /// The velocity at which the line may be entered.
    pub(super) entry: Short,
}

impl Last {
    /// Whether `line` has other jerk limits, so that keys before and after it cannot be compared.
    fn jerk_limits_change(&self, line: &Line, kappa: f32) -> bool {
        self.limits != (line.accel, line.jerk) && (some(self.kappa) || some(kappa))
    }

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
    pub(super) fn follow(&mut self, line: &mut Line, entry: f32) -> Option<Key> {
        line.entry = Short::new(entry);
        let cruise = line.velocity(&self.factors);
        if self.goes_on(line, cruise, entry) { None } else { self.corner(line, cruise, entry) }
    }

    /// Whether the line is as fast as the one before, and the corner between them is no limit.
    fn goes_on(&self, line: &Line, cruise: f32, entry: f32) -> bool {
        self.last.as_ref().is_some_and(|last| {
            last.limits == (line.accel, line.jerk) && last.as_fast(cruise, entry)
        })
    }

    /// Returns the key of a line with another velocity or a corner, or `None` if it needs none.
    #[inline(never)]
    fn corner(&mut self, line: &mut Line, cruise: f32, entry: f32) -> Option<Key> {
        let limits = (line.accel, line.jerk);
        let own =
            if line.jerk == Short::ZERO { 0.0 } else { kappa(line.accel.get(), line.jerk.get()) };
        let (mut entry, mut high, mut brakes, mut firm) = (entry, cruise, own, 0);
        let mut is_worth = true;
        match &mut self.last {
            None => entry = 0.0,
            // The lines before brake with their own limits, which end here, so the new line must be able to stop within
            // its own length.
            Some(last) if last.jerk_limits_change(line, own) => {
                entry = able_to_stop(line, entry, greater(own, last.kappa));
                (brakes, firm) = (last.kappa, FIRM);
            }
            // Only the acceleration changes.
            Some(last) if last.as_fast(cruise, entry) => {
                (last.kappa, last.limits) = (own, limits);
                return None;
            }
            Some(last) => {
                let limit = lesser(last.cruise, cruise) * WORTH;
                is_worth = entry < limit || cruise < last.high * WORTH;
                if !is_worth {
                    high = greater(last.high, cruise);
                }
            }
        }
        line.entry = Short::new(entry);
        self.last = Some(Last { cruise, high, kappa: own, limits });
        if !is_worth {
            return None;
        }
        let entry = Short::new(least(line.entry.get(), cruise));
        let key = line.start + speed_constraints::key(entry.get(), brakes);
        Some(Key { key, firm, entry })
    }
}

/// Returns the velocity, at most `entry`, from which a line can stop within its own length, for limits with this
/// [`kappa`].
#[inline(never)]
#[small]
fn able_to_stop(line: &Line, entry: f32, kappa: f32) -> f32 {
    lesser(entry, sqrt(kappa * kappa + line.gain()) - kappa)
}
