//! Cuts lines in two, so that a part of a long line can have limits of its own.

use super::Blend;
use super::limits::in_lengths;
use crate::motion::advance::cut_push;
use crate::motion::block::{Extent, Line};

impl Blend {
    /// Cuts off the last `zone` mm of the path that waits, if they lie in a line that is longer.
    pub(super) fn cut_end(&mut self, zone: f32) {
        let zone = in_lengths(zone);
        let Some(length) = self.last().map(|last| last.length) else { return };
        if length - length / 5 > zone {
            self.cut_last_at(length - zone);
        }
    }

    /// Cuts the last block if it reaches farther than the corner that may follow it: the first part need not wait.
    pub(super) fn cut_last(&mut self) {
        let Some(last) = self.last() else { return };
        let (length, end) = (last.length, last.span);
        if length > end && length - length / 3 > end {
            self.cut_last_at(length - end);
        }
    }

    /// Cuts the last block after `length` of its path.
    pub(super) fn cut_last_at(&mut self, length: u32) {
        let Some(last) = self.last().copied() else { return };
        let Some(line) = last.line() else { return };
        if length == 0 || length >= last.length {
            return;
        }
        let share = length as f32 / last.length as f32;
        let (head, tail) = halves(line, share, self.motor.into());
        let (number, newest) = (last.block.line(), self.len - 1);
        let entry = self.entry_mut(newest);
        entry.block.set(&head, number);
        entry.length = length;
        self.end = entry.at.wrapping_add(length);
        let rest = self.append(&last.unit, last.length - length);
        rest.block.set(&tail, number);
        (rest.room, rest.zone, rest.span) = (last.room, last.zone, last.span);
    }
}

/// Returns a line in two parts, the first of which has this share of it.
fn halves(line: &Line, share: f32, motor: usize) -> (Line, Line) {
    let (mut head, mut tail) = (*line, *line);
    for ((head, tail), way) in head.way.iter_mut().zip(&mut tail.way).zip(line.way) {
        let part = f32::from(way) * share;
        *head = (part + if part < 0.0 { -0.5 } else { 0.5 }) as i16;
        *tail = way - *head;
    }
    let (length, whole) = (line.extent.length(), line.extent.has_whole_steps());
    head.extent = Extent::new(length * share, whole);
    tail.extent = Extent::new(length - length * share, whole);
    cut_push(line, &mut head, &mut tail, share, motor);
    (head, tail)
}
