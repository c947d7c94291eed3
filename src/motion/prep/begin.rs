//! The start of a block: the distance of each motor, and the dominant motor.

use super::super::block::{Line, PARTS_LOG2};
use super::ticks::{is_little, parts_of, times};
use super::{PART, PART_LOG2, Prep};
use crate::boards::{MOTORS, each_motor};
use crate::dda::{STEP, STEP_LOG2};
use crate::hal::arithmetic::product;

impl Prep {
    /// Starts a block. Puts the whole steps to its rounded end into `steps`, and adds them to `target`.
    #[inline(never)]
    pub fn begin(&mut self, line: &Line, steps: &mut [i16; MOTORS], target: &mut [i32; MOTORS]) {
        self.shift = u8::MAX;
        (self.full, self.minor, self.most, self.others) = (0, 0, 0, u8::MAX);
        self.parts = !line.extent.has_whole_steps();
        if !self.parts {
            self.begin_far(&line.way, steps, target);
            if self.has_advance() {
                self.begin_lead(line);
            }
            return;
        }
        each_motor!(M => {
            let mut way = line.way[M];
            let mut whole = 0;
            let debt = self.debt[M];
            if way != 0 {
                self.debt[M] = debt + (i32::from(way) << PART_LOG2);
                let sum = way + i16::from(self.fraction(M));
                self.place[M] = u16::from(sum as u8 & 15) << PART_LOG2;
                whole = sum >> PARTS_LOG2;
                target[M] = target[M].wrapping_add(whole.into());
            }
            steps[M] = whole;
            if !is_little(debt) {
                // Adds the debt of the motor, in 1/16 steps.
                way += parts_of(debt);
            }
            if way != 0 {
                self.take_up(M, 1 << M, way, line.way[M]);
            }
        });
        self.left = product(self.most, PART);
        if self.most == 0 {
            // Without motors there are no ticks to pace.
            self.others = 0;
        }
        if self.has_advance() {
            self.begin_lead(line);
        }
    }

    /// Starts a block whose distances are in whole steps, as [`Prep::begin`] does.
    #[inline(never)]
    #[small]
    fn begin_far(
        &mut self,
        ways: &[i16; MOTORS],
        steps: &mut [i16; MOTORS],
        target: &mut [i32; MOTORS],
    ) {
        *steps = *ways;
        let mut bit = 1;
        for (m, way) in ways.iter().enumerate() {
            if *way != 0 {
                target[m] = target[m].wrapping_add((*way).into());
                self.take_up(m, bit, *way, *way);
            }
            bit <<= 1;
        }
        self.left = product(self.most, STEP);
        self.lengthen();
        for (debt, way) in self.debt.iter_mut().zip(ways) {
            *debt += i32::from(*way) << STEP_LOG2;
        }
    }

    /// How far the end of the block is past the point half a step before its rounded whole step, in 1/16 step.
    #[inline(always)]
    pub(super) fn fraction(&self, m: usize) -> u8 {
        (self.place[m] >> 8) as u8 >> (PART_LOG2 - 8)
    }

    /// Takes in a motor that moves by `way` in the block; `own` is its distance in the line, without its debt.
    #[inline(always)]
    fn take_up(&mut self, m: usize, bit: u8, way: i16, own: i16) {
        self.others = self.others.wrapping_add(1);
        let (size, turned) = if way < 0 {
            ((way as u16).wrapping_neg(), !self.backwards & bit)
        } else {
            (way as u16, self.backwards & bit)
        };
        if turned != 0 {
            self.backwards ^= bit;
            self.turned = true;
        }
        self.minors[m].way = size;
        if size == self.most {
            self.full |= bit;
        } else if size > self.most {
            self.minor |= self.full;
            self.full = bit;
            self.most = size;
            self.own = own;
            let at = self.fraction(m);
            self.past = if way < 0 { !at } else { at };
        } else {
            self.minor |= bit;
        }
    }

    /// In a block of whole steps, adds the debt of the dominant motor to its distance, and to that of the motors that
    /// go as far.
    #[inline(never)]
    #[small]
    fn lengthen(&mut self) {
        let mut due = None;
        let mut bit = 1;
        for m in 0..MOTORS {
            if self.full & bit != 0 {
                let debt = if self.backwards & bit != 0 { -self.debt[m] } else { self.debt[m] };
                let due = *due.get_or_insert(i32::from(parts_of(debt)) << PART_LOG2);
                if (debt - due).unsigned_abs() > u32::from(PART) {
                    // The motor's distance is equal, but its debt is different.
                    self.full &= !bit;
                    self.minor |= bit;
                }
            } else if self.minor & bit == 0 && !is_little(self.debt[m]) {
                // The line does not move this motor, but the motor still has a debt.
                self.minor |= bit;
                self.minors[m].way = 0;
                self.others += 1;
                if (self.debt[m] < 0) != (self.backwards & bit != 0) {
                    self.backwards ^= bit;
                    self.turned = true;
                }
            }
            bit <<= 1;
        }
        let due = due.unwrap_or(0);
        self.left = self.left.wrapping_add_signed(due);
        // A longer distance of the dominant motor lengthens those of the other motors in proportion. Their own debts
        // replace that part.
        let mut bit = 1;
        for m in 0..MOTORS {
            let debt = if self.backwards & bit != 0 { -self.debt[m] } else { self.debt[m] };
            let way = self.minors[m].way;
            self.minors[m].owed = times(debt as i16, self.most) - times(due as i16, way);
            bit <<= 1;
        }
    }
}
