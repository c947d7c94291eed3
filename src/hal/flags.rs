//! The event bits.

use super::event::Event;

/// Sets a bit. Any level. Cost: 2 cycles.
#[inline(always)]
pub fn set(event: Event) {
    event.bit().set();
}

/// Whether a bit is set. Any level. Cost: 2 cycles.
#[inline(always)]
pub fn has(event: Event) -> bool {
    event.bit().is_set()
}
