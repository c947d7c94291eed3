//! Whether the firmware is well: if so the watchdog is fed, else the chip resets in half a second, with the outputs
//! off and the motors without power.
//!
//! The power task asks, every 20 ms: that it has its turn says that ticks come, that timers are served and that no
//! task of thread mode keeps the others waiting. Exec answers each time ([`answer`]), and while ticks of the step timer
//! come it has to have queued a segment since ([`Sign::Segment`]), for which the step interrupt must have taken one. All of
//! it once in half a second is enough; the longest that is usual is 60 ms, of segments, and 20 ms of thread mode. Cost: 300
//! cycles a look, and one poll of exec.

use crate::hal::byte::SharedByte;
use crate::hal::imp::{exec, stepper, watchdog};

/// A sign of life.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Sign {
    /// Exec has been polled.
    Exec = 1,
    /// A segment has been queued.
    Segment = 2,
}

const ALL: u8 = Sign::Exec as u8 | Sign::Segment as u8;

machine_static! {
    // Exec sets bits; thread mode, which never runs in between, clears them all.
    fn signs() -> SharedByte = SharedByte::new(0);
}

/// Exec gives a sign of life. Exec only.
#[inline(always)]
pub fn answer(sign: Sign) {
    signs().set(signs().get() | sign as u8);
}

/// Feeds the watchdog if all is well, and asks for other signs. Thread mode.
pub fn look() {
    let rests = if stepper::running() && !stepper::is_stopped() { 0 } else { Sign::Segment as u8 };
    if signs().get() | rests == ALL {
        signs().set(0);
        watchdog::feed();
    }
    exec::pend();
}
