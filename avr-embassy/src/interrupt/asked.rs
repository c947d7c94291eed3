//! What interrupt mode wants of the time when thread mode has nothing left to do, on every chip.

use crate::byte::SharedByte;

/// What was asked for last, for when thread mode has nothing left to do: a number, and whether to go on then
/// ([`GO_ON`]). Written by interrupt mode only.
static ASKED: SharedByte = SharedByte::new(0);
const GO_ON: u8 = 1;
const NEXT: u8 = 2;
/// What of that thread mode, the only writer, has seen with nothing left to do.
static SEEN: SharedByte = SharedByte::new(0);

pub fn pend_when_idle() {
    ASKED.set(ASKED.get().wrapping_add(NEXT) | GO_ON);
}

pub fn note_idle() {
    ASKED.set(ASKED.get().wrapping_add(NEXT) & !GO_ON);
}

pub fn was_idle() -> bool {
    SEEN.get() == ASKED.get()
}

/// Thread mode has nothing left to do.
#[inline(always)]
pub fn idle() {
    // Something else may be asked for in between: it is seen the next time.
    let asked = ASKED.get();
    if SEEN.get() != asked {
        SEEN.set(asked);
        if asked & GO_ON != 0 {
            super::pend();
        }
    }
}
