//! Requests of interrupt mode for the moment when thread mode has nothing left to do. This code serves every chip.

use crate::byte::SharedByte;

/// The last request: a number that counts requests, and the bit [`GO_ON`], which asks for the executor to run.
/// Written by interrupt mode only.
static ASKED: SharedByte = SharedByte::new(0);
const GO_ON: u8 = 1;
const NEXT: u8 = 2;
/// The last request that thread mode, the only writer, has seen with nothing left to do.
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

/// Serves the last request: thread mode has nothing left to do.
#[inline(always)]
pub fn idle() {
    // If interrupt mode makes another request in between, the next call sees it.
    let asked = ASKED.get();
    if SEEN.get() != asked {
        SEEN.set(asked);
        if asked & GO_ON != 0 {
            super::pend();
        }
    }
}
