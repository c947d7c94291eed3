//! Motion with means: the path in samples, the samples through the means, and what comes out in segments.

use super::{Exec, Step};
use crate::capability::Capability;
use crate::dda::Segment;
use crate::motion::block::{Body, Line};
use crate::motion::exec::spindle::Follows;
use crate::motion::float::{below, scaled, size, some};
use crate::motion::queue::BlockSource;
use crate::motion::smooth::{LEAD, SAMPLE_S};
use crate::motion::snapshot::Snapshot;

/// The most stretches that exec adds to a sample before other work has its turn.
const STRETCHES: u8 = 4;

/// The share of the difference to the velocity of the path by which the reported velocity changes in a sample, as a
/// power of two. It follows about as late as the means.
const FOLLOWS_LOG2: i8 = if SAMPLE_S >= 0.004 { -2 } else { -3 };
/// A reported velocity that is off by less than this share, as a power of two, is that of the path.
const STEADY_LOG2: i8 = -8;

impl Exec {
    /// Whether motion has means. A pass in step with the spindle has none, nor has the retreat from it.
    #[inline(always)]
    pub fn is_sampled(&self) -> bool {
        self.smooth.spans().is_some()
            && !(Capability::Lathe.is_built_in()
                && matches!(self.follows, Follows::Angle(_) | Follows::Retreats(_)))
    }

    /// Begins a line.
    #[inline(always)]
    pub(super) fn begin_sampled(&mut self, line: &Line, out: &mut Snapshot) {
        self.sampler.begin(line);
        self.prep.begin_sampled(line);
        // The target is where the samples end, so nothing is left to it. The distances only say which motors move.
        out.left = 0.0;
        out.steps = line.way;
    }

    /// Adds the next stretches to the sample, those of lines that follow too. Makes the segment if the sample is full.
    #[inline(never)]
    pub(super) fn run_sampled(
        &mut self,
        blocks: &mut BlockSource,
        out: &mut Snapshot,
        segment: &mut Segment,
    ) -> Step {
        for _ in 0..STRETCHES {
            let (cruise, holds) = match self.limit(blocks) {
                Ok(limit) => limit,
                Err(share) => return self.await_speed(share, out, segment),
            };
            self.sample(cruise, holds, blocks);
            if self.sampler.is_full() {
                self.emit(out, segment);
                return Step::Segment;
            }
            let stops = self.running.active || self.hold && self.governor.is_at_rest();
            if stops || !self.begin(blocks, out) {
                break;
            }
        }
        Step::Again
    }

    /// Adds the next stretch of the running line to the sample.
    #[inline(always)]
    fn sample(&mut self, cruise: f32, holds: bool, blocks: &mut BlockSource) {
        let running = &mut self.running;
        let (before, headroom) = (running.left, running.headroom);
        self.governor.take_exactly(self.sampler.left());
        let stretch = match holds {
            true => self.governor.halt(before, headroom),
            false => self.governor.part(before, cruise, headroom),
        };
        // What rounding takes from a short stretch in a long line belongs to the next one.
        let distance = stretch.distance + running.owed;
        if stretch.ends || !below(distance, before) {
            self.sampler.end(stretch.seconds);
            running.active = false;
            blocks.release();
            return;
        }
        running.left = before - distance;
        running.owed = distance - (before - running.left);
        self.sampler.add(stretch.seconds, before, running.left);
    }

    /// Makes the segment of the sample.
    #[inline(never)]
    fn emit(&mut self, out: &mut Snapshot, segment: &mut Segment) {
        let velocity = self.governor.velocity();
        let mut distances = self.sampler.take();
        if let Some(lead) = distances.get_mut(LEAD) {
            *lead = self.prep.lead_more(velocity);
        }
        self.backlash.feed(&mut distances);
        self.smooth.put(&mut distances);
        let off = velocity - out.velocity;
        let steady = some(velocity) && below(size(off), scaled(velocity, STEADY_LOG2));
        if steady {
            out.velocity = velocity;
        } else if some(off) {
            out.velocity += scaled(off, FOLLOWS_LOG2);
        }
        // A steady motion has fine ticks.
        self.prep.refine(steady && self.running.long, self.coarse);
        self.prep.set_hurry(self.hurry);
        self.prep.slice(&distances, &mut out.target, segment);
        self.backlash.deduct(self.smooth.is_empty(), &mut out.target);
    }

    /// The path stands still: makes the next segment of a sample in which the means are not empty, then the one in which
    /// motors make what rounding has left. Returns false, and no segment, if there is none.
    #[inline(never)]
    pub(super) fn drains(&mut self, out: &mut Snapshot, segment: &mut Segment) -> bool {
        if !self.is_sampled() {
            return false;
        }
        self.flows_out(out, segment)
    }

    /// Makes the next segment of a sample in which the path stands still and motors do not; false if there is none.
    #[inline(always)]
    fn flows_out(&mut self, out: &mut Snapshot, segment: &mut Segment) -> bool {
        if self.sampler.has_begun() || !self.smooth.is_empty() || self.backlash.is_due() {
            self.sampler.pad();
            self.emit(out, segment);
            return true;
        }
        self.prep.finish(segment)
    }

    /// Before a line that begins at a standstill: makes the next segment in which its motors take up their backlash.
    /// Returns false, and no segment, if that is done. Motion without the mean that rounds corners borrows it.
    #[inline(never)]
    #[small]
    pub(super) fn takes_up(
        &mut self,
        blocks: &BlockSource,
        out: &mut Snapshot,
        segment: &mut Segment,
    ) -> bool {
        if self.lent.is_none() {
            if !self.governor.is_at_rest() || self.sampler.has_begun() || !self.smooth.is_empty() {
                return false;
            }
            let due = blocks.look(|block| {
                let Body::Line(line) = &block.body else { return false };
                self.backlash.turn(&line.way);
                self.backlash.is_due()
            });
            if due != Some(true) {
                return false;
            }
            self.lent = Some(self.smooth.spans());
            self.smooth.set(self.smooth.spans().and_corner());
        }
        if self.flows_out(out, segment) {
            return true;
        }
        self.give_back();
        false
    }

    /// Ends a take-up at a standstill.
    #[inline(always)]
    pub(super) fn give_back(&mut self) {
        if let Some(spans) = self.lent.take() {
            self.smooth.set(spans);
        }
    }
}
