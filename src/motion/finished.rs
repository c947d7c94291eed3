//! Which line has been finished, to its last step.
//!
//! Owned by the exec task, which is ahead of the motors by the segments that are queued. A line whose last segment has
//! been queued is finished when the segment after that has been taken, or when the motors stand still. With
//! [means](super::smooth) the end of a line goes on for as many segments as they cover. Of the lines that wait for this
//! only the oldest and the newest are remembered. Cost on AVR: 30 cycles a segment.

/// A line that has been queued to its last segment.
#[derive(Clone, Copy, Debug)]
struct Queued {
    line: u32,
    /// Segments that had been queued when the line ended, modulo 256.
    segments: u8,
}

/// Tracks which lines have been finished.
#[derive(Debug, Default)]
pub struct Finished {
    /// Segments queued, modulo 256.
    segments: u8,
    oldest: Option<Queued>,
    newest: Option<Queued>,
}

impl Finished {
    /// No line yet.
    pub const fn new() -> Self {
        Self { segments: 0, oldest: None, newest: None }
    }

    /// Notes that all of `line` has been prepared, but for `lag` segments.
    #[inline(never)]
    pub fn end(&mut self, line: u32, lag: u8) {
        let queued = Some(Queued { line, segments: self.segments.wrapping_add(lag) });
        let place = if self.oldest.is_none() { &mut self.oldest } else { &mut self.newest };
        *place = queued;
    }

    /// Notes that a segment has been queued.
    #[inline]
    pub fn queue(&mut self) {
        self.segments = self.segments.wrapping_add(1);
    }

    /// Returns the line that has been finished since the last call, if any; `waiting` segments have not been taken by
    /// the step generator yet.
    #[inline]
    pub fn take(&mut self, waiting: usize) -> Option<u32> {
        let oldest = self.oldest?;
        let taken = self.segments.wrapping_sub(waiting as u8);
        if (taken.wrapping_sub(oldest.segments) as i8) <= 0 {
            return None;
        }
        self.oldest = self.newest.take();
        Some(oldest.line)
    }

    /// Notes that the motors stand still and nothing waits: all lines are finished.
    pub fn rest(&mut self) {
        (self.oldest, self.newest) = (None, None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn queue(finished: &mut Finished, line: u32, segments: usize) {
        (0..segments).for_each(|_| finished.queue());
        finished.end(line, 0);
    }

    #[test]
    fn a_line_is_finished_when_the_next_one_runs() {
        let mut finished = Finished::new();
        queue(&mut finished, 10, 300);
        (0..3).for_each(|_| finished.queue());
        // The last segment of line 10 runs until another one has been taken.
        assert_eq!(finished.take(4), None);
        assert_eq!(finished.take(3), None);
        assert_eq!(finished.take(2), Some(10));
        assert_eq!(finished.take(0), None);
    }

    #[test]
    fn the_newest_of_many_short_lines_is_not_forgotten() {
        let mut finished = Finished::new();
        (1..=5).for_each(|line| queue(&mut finished, line, 1));
        (0..2).for_each(|_| finished.queue());
        assert_eq!(finished.take(6), None);
        assert_eq!(finished.take(5), Some(1));
        assert_eq!(finished.take(2), None);
        assert_eq!(finished.take(1), Some(5));
        assert_eq!(finished.take(0), None);
    }

    #[test]
    fn at_rest_nothing_is_waited_for() {
        let mut finished = Finished::new();
        queue(&mut finished, 1, 1);
        finished.rest();
        finished.queue();
        assert_eq!(finished.take(0), None);
    }
}
