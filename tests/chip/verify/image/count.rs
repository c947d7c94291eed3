//! Counts with all timers, for the host to measure the clock.
//!
//! The counts begin when the line feed of the command has come, and end when the next byte has come. Both moments are
//! seen by polling, and acted on at once: the timers start 20 to 40 cycles after the receiver has taken the byte, and
//! stop 20 to 90 cycles after it. So the counts are those of the time between the two bytes, to 5 us and one count of
//! 4 us. Timers stop one after the other, 2 cycles apart.
//!
//! A byte that stops the count and is no line feed begins a line, which is ignored up to its line feed; the answer comes
//! then.

use super::{serial, timers};

/// Counts until the next byte. Returns the count of each timer.
#[inline(never)]
pub fn until_byte() -> [u32; 6] {
    let mut counts = [0u32; 6];
    // An overflow is polled for each 30 to 150 cycles, and cannot come twice meanwhile.
    while !serial::has_byte() {
        add_overflows(&mut counts);
    }
    timers::halt();
    // The timers stand, so a flag belongs to the count that is read.
    add_overflows(&mut counts);
    timers::each(|number, timer| {
        if let Some(count) = counts.get_mut(number) {
            *count = *count << timer.bits() | u32::from(timer.count());
        }
    });
    while serial::next() != b'\n' {}
    counts
}

#[inline(always)]
fn add_overflows(counts: &mut [u32; 6]) {
    timers::each(|number, timer| {
        if timer.takes_overflow()
            && let Some(count) = counts.get_mut(number)
        {
            *count += 1;
        }
    });
}
