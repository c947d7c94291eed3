//! Cuts a block short: a hold that is not resumed, a limit switch, a probe.

use super::{HALF, PART, Prep};
use crate::boards::MOTORS;
use crate::dda::{PHASE_START, STEP, STEP_LOG2, Segment};
use crate::hal::arithmetic::product;

impl Prep {
    /// Ends the block at once: subtracts from `target` the steps of the block that no segment has. From now on every
    /// motor counts as being at its last step ([`Dda::settle`](crate::dda::Dda::settle)). Returns the segment that was
    /// held back, if any. Cost: 4,000 a motor.
    #[inline(never)]
    #[small]
    pub fn cut(&mut self, target: &mut [i32; MOTORS]) -> Option<Segment> {
        let mut bit = 1;
        for (m, target) in target.iter_mut().enumerate() {
            // The distance from the whole step to which the end of the block is rounded to that end.
            let beyond = (i32::from(self.fraction[m]) - i32::from(HALF)) * i32::from(PART);
            let left = self.left_of(m, bit);
            let left = if self.backwards & bit != 0 { -left } else { left };
            // The debt includes `left`, modulo 2^16.
            let ahead = match self.extruder.first() {
                Some(extruder) if usize::from(extruder.motor) == m => extruder.made(),
                _ => 0,
            };
            let short = left + i32::from(self.debt[m].wrapping_sub(left as i16)) - beyond - ahead;
            *target = target.wrapping_add((i32::from(PHASE_START) - short) >> STEP_LOG2);
            bit <<= 1;
        }
        self.left = 0;
        self.time = 0;
        self.debt = [0; MOTORS];
        self.fraction = [HALF; MOTORS];
        if let Some(extruder) = self.extruder.first_mut() {
            extruder.cut();
        }
        // The segment that was to set new directions may be among the segments that are lost.
        self.turned = true;
        self.held.take()
    }

    /// Returns the phase units of a motor's distance that no segment has, in its direction, without its debt.
    #[inline(never)]
    #[small]
    fn left_of(&self, m: usize, bit: u8) -> i32 {
        let minor = &self.minors[m];
        if self.left == 0 || (self.full | self.minor) & bit == 0 {
            return 0;
        }
        if self.full & bit != 0 {
            return self.left as i32;
        }
        if self.shift == u8::MAX {
            // Nothing of the block has been prepared.
            return product(minor.way, if self.parts { PART } else { STEP }) as i32;
        }
        let wide = i64::from(minor.way) * i64::from(self.left) + i64::from(minor.owed);
        (wide / i64::from(self.most)) as i32
    }
}
