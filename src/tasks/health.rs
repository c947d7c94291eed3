//! Health checks of the firmware. While they pass, the watchdog is fed; otherwise the chip resets within half a second,
//! with the outputs off and the motors without power.
//!
//! The power task checks every 20 ms. That it runs shows that the millisecond tick and timers work, and that no task of
//! thread mode blocks the others. Exec must answer each check ([`answer`]). While ticks of the step timer come, exec
//! must also have queued a segment since the last check, for which the step interrupt must have taken one.
//!
//! While motors move on fine ticks, thread mode may have a few percent of the CPU, and one report may take all of half
//! a second. So exec feeds the watchdog as well, every [`OFTEN`] segments, up to [`PATIENCE`] times without thread
//! mode: that is 3 s of the shortest segments, 8 s of usual ones.
//!
//! Exec also counts how often the steppers have run out of segments in motion ([`starvations`]). A reset would not help
//! against this fault: `{stv:n}` returns the count, and the reporter reports the first one. Cost: 300 cycles a check,
//! and one poll of exec.

use kerf_macros::small;

use crate::hal::byte::SharedByte;
use crate::hal::{Interrupt, Thread, exec, stepper, watchdog};

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

/// Exec feeds the watchdog after every this many segments.
const OFTEN: u8 = 16;
/// How many times exec feeds the watchdog before thread mode has to do so.
const PATIENCE: u8 = 250;

machine_static! {
    // Exec sets bits; thread mode, which never runs in between, clears them all.
    fn signs() -> SharedByte = SharedByte::new(0);
}

machine_static! {
    // Exec counts down; thread mode sets it.
    fn patience() -> SharedByte = SharedByte::new(0);
}

/// Notes a sign of life of exec.
#[inline(always)]
pub fn answer(_: Interrupt, sign: Sign) {
    signs().set(signs().get() | sign as u8);
}

/// Notes that exec has queued a segment, the `count`th.
#[inline(always)]
pub fn moves(exec: Interrupt, count: u8) {
    answer(exec, Sign::Segment);
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

/// Counts a starvation: a segment follows one that ended at speed, but the steppers stand still, so they have waited
/// for it.
#[inline(never)]
#[small]
pub fn look_for_starvation(_: Interrupt) {
    if !stepper::running() && !stepper::is_stopped() {
        late().set(late().get().saturating_add(1));
    }
}

/// Returns how many times the steppers have waited for a segment in mid-motion since the reset, 255 for more. Any
/// level.
pub fn starvations() -> u8 {
    late().get()
}

/// Feeds the watchdog if all is well, and asks exec for new signs of life.
pub fn look(_: Thread) {
    let rests = if stepper::running() && !stepper::is_stopped() { 0 } else { Sign::Segment as u8 };
    if signs().get() | rests == ALL {
        signs().set(0);
        patience().set(PATIENCE);
        watchdog::feed();
    }
    exec::pend();
}
