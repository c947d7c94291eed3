//! Cuts a block short: a hold that is not resumed, a limit switch, a probe.

use super::Prep;
use crate::boards::MOTORS;
use crate::dda::{PHASE_START, STEP, STEP_LOG2, Segment};

impl Prep {
    /// Ends the block at once: subtracts from `target` the steps of the block that no segment has. From now on every
    /// motor counts as being at its last step ([`Dda::settle`](crate::dda::Dda::settle)). Returns the segment that was
    /// held back, if any. Cost: 200 a motor.
    #[inline(never)]
    #[small]
    pub fn cut(&mut self, target: &mut [i32; MOTORS]) -> Option<Segment> {
        for (m, target) in target.iter_mut().enumerate() {
            // The distance from the whole step to which the end of the block is rounded to that end.
            let beyond = i32::from(self.place[m]) - i32::from(STEP / 2);
            let ahead = match self.extruder.first() {
                Some(extruder) if usize::from(extruder.motor) == m => extruder.made(),
                _ => 0,
            };
            let short = self.debt[m] - beyond - ahead;
            *target = target.wrapping_add((i32::from(PHASE_START) - short) >> STEP_LOG2);
        }
        self.left = 0;
        self.time = 0;
        self.debt = [0; MOTORS];
        self.place = [STEP / 2; MOTORS];
        if let Some(extruder) = self.extruder.first_mut() {
            extruder.cut();
        }
        // The segment that was to set new directions may be among the segments that are lost.
        self.turned = true;
        self.held.take()
    }
}
