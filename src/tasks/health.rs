//! Whether the firmware is well: if so the watchdog is fed, else the chip resets in half a second, with the outputs
//! off and the motors without power.
//!
//! The power task asks, every 20 ms: that it has its turn says that ticks come, that timers are served and that no
//! task of thread mode keeps the others waiting. Exec answers each time ([`answer`]), and while ticks of the step timer
//! come it has to have queued a segment since, for which the step interrupt must have taken one.
//!
//! While motors move on fine ticks, thread mode may have a few percent of the CPU, and one report may take all of half a
//! second. So exec feeds the watchdog as well, each [`OFTEN`] segments, as long as it has [`PATIENCE`]: 3 s of the
//! shortest segments, 8 s of usual ones. Exec counts as well how often the steppers have waited for it in mid-motion
//! ([`starvations`]), which is a fault, but none that a reset mends: `{stv:n}` tells it, and the reporter the first. Cost: 300 cycles a look, and one poll of exec.

use kerf_macros::small;

use crate::hal::byte::SharedByte;
use crate::hal::{exec, stepper, watchdog};

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

/// After so many segments exec says so.
const OFTEN: u8 = 16;
/// How many times it does before thread mode has to.
const PATIENCE: u8 = 250;

machine_static! {
    // Exec sets bits; thread mode, which never runs in between, clears them all.
    fn signs() -> SharedByte = SharedByte::new(0);
}

machine_static! {
    // Exec counts down; thread mode sets it.
    fn patience() -> SharedByte = SharedByte::new(0);
}

/// Exec gives a sign of life. Exec only.
#[inline(always)]
pub fn answer(sign: Sign) {
    signs().set(signs().get() | sign as u8);
}

/// Exec has queued a segment, the `count`th. Exec only.
#[inline(always)]
pub fn moves(count: u8) {
    answer(Sign::Segment);
    if count.is_multiple_of(OFTEN) {
        let left = patience().get();
        if left > 0 {
            patience().set(left - 1);
            watchdog::feed();
        }
    }
}

machine_static! {
    // Exec counts; thread mode reads.
    fn late() -> SharedByte = SharedByte::new(0);
}

/// A segment follows one that ended at speed: if the steppers stand still, they have waited for it. Exec only.
#[inline(never)]
#[small]
pub fn look_for_starvation() {
    if !stepper::running() && !stepper::is_stopped() {
        late().set(late().get().saturating_add(1));
    }
}

/// How many times the steppers have waited for a segment in mid-motion since the reset, 255 for more. Any level.
pub fn starvations() -> u8 {
    late().get()
}

/// Feeds the watchdog if all is well, and asks for other signs. Thread mode.
pub fn look() {
    let rests = if stepper::running() && !stepper::is_stopped() { 0 } else { Sign::Segment as u8 };
    if signs().get() | rests == ALL {
        signs().set(0);
        patience().set(PATIENCE);
        watchdog::feed();
    }
    exec::pend();
}
