//! The filling end of the segment ring, which belongs to exec. Its reading end belongs to the step interrupt.

use core::ops::{Deref, DerefMut};

use super::ring::{Prefilled, Producer};
use crate::dda::{SEGMENTS, Segment};

/// The filling end of the segment ring, whose queued segments exec may still change.
pub struct Segments(Prefilled<Segment, SEGMENTS>);

impl Segments {
    /// Fills the vacant slots with the default segment.
    ///
    /// # Safety
    /// The ring is read in interrupts above exec, or by exec itself, and no reference into the ring is kept.
    #[inline(always)]
    pub(super) unsafe fn new(segments: Producer<Segment, SEGMENTS>) -> Self {
        Self(segments.prefilled(Segment::default()))
    }

    /// Changes a segment queued earlier; `back` 0 is the newest. Returns `false` if the interrupt has taken it, or
    /// takes another one just then. Interrupts are off while `change` runs, so it has to be short.
    #[inline(always)]
    pub fn amend(&mut self, back: usize, change: impl FnOnce(&mut Segment)) -> bool {
        // SAFETY: by the contract of `new` nobody reads a segment while interrupts are off.
        unsafe { self.0.producer().amend_masked(back, change) }
    }
}

impl Deref for Segments {
    type Target = Prefilled<Segment, SEGMENTS>;

    #[inline(always)]
    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Segments {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}
