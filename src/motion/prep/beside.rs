//! Motors that move independently of the running block, in its segments: those of a [retreat](super::super::retract).

use super::super::retract::Retreat;
use super::minor::Minor;
use super::{ASIDE, Prep, TURNED};
use crate::boards::MOTORS;
use crate::dda::Segment;

impl Prep {
    /// Returns the debt of the first of `motors`, phase units.
    #[small]
    pub fn debt_of(&self, motors: u8) -> i32 {
        let first = motors.trailing_zeros() as usize;
        self.debt.get(first).copied().unwrap_or_default()
    }

    /// Prepares `motors`, which the line does not move, to move in this direction. A debt that they still have is left. Segments have ticks for them from
    /// here on.
    #[inline(never)]
    #[small]
    pub fn join(&mut self, motors: u8, backwards: bool) {
        let turned = if backwards { !self.backwards & motors } else { self.backwards & motors };
        if turned != 0 {
            self.backwards ^= turned;
            self.turned = true;
        }
        let mut bit = 1;
        for minor in &mut self.minors {
            if motors & bit != 0 {
                *minor = Minor::default();
                if self.minor & bit == 0 {
                    self.minor |= bit;
                    self.others = self.others.wrapping_add(1);
                }
            }
            bit <<= 1;
        }
    }

    /// Makes a segment of 2 ms in which `motors` may move, and no other motor.
    #[small]
    pub fn stand(&mut self, motors: u8, out: &mut Segment) {
        self.pause(ASIDE.0, ASIDE.1, out);
        out.moving = motors;
        out.seal(0, 0);
        if self.turned {
            self.behind_turn(out);
        }
    }

    /// Adds the motors of a retreat to a segment of the block, if it has room for them.
    #[inline(never)]
    #[small]
    pub fn add(&mut self, retreat: &mut Retreat, out: &mut Segment, target: &mut [i32; MOTORS]) {
        // Not in the tick in which directions settle: the segment after it is in `held`.
        if self.held.is_none() && !retreat.is_done() {
            retreat.add(out, target, &mut self.debt);
            out.settle = 0;
        }
    }

    /// Returns how far motors that have [joined](Prep::join) are to go in each tick of a segment that is queued
    /// already; 0 if there is no time for them.
    #[inline(never)]
    #[small]
    pub fn plan_lead(&self, retreat: &mut Retreat, ticks: u16, period: u16) -> u16 {
        let stands = !self.turned || period >= self.setup.saturating_add(TURNED);
        if stands && period >= self.paces().settles { retreat.plan(ticks, period) } else { 0 }
    }

    /// Counts the distance that has been added to a queued segment for the motors of a retreat.
    #[small]
    pub fn note_lead(
        &mut self,
        retreat: &mut Retreat,
        increment: u16,
        ticks: u16,
        target: &mut [i32; MOTORS],
    ) {
        self.turned = false;
        retreat.note(increment, ticks, target, &mut self.debt);
    }
}
