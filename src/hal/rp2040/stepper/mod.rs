//! Steps: a state machine of PIO0, which two DMA channels feed in turn with words from RAM.
//!
//! An entry of two words is a pause, a pulse, and the pins for that pulse ([`words`]). The state machine runs at the
//! system clock, so each edge comes at its exact cycle whatever the CPU does, and all motors share one time base. The
//! pins may be anywhere, because an entry has bits for all pins of the chip. On a board with [registers](crate::boards::Registers) they are outputs
//! of a shift register: another program sends the same entries bit by bit, and all outputs change with its latch
//! ([`program`]).
//!
//! The **feeder**, the handler of DMA_IRQ_0 and PIO0_IRQ_0, runs the step generator ([`Dda`]) ahead of time and
//! writes chunks of entries, each about half a millisecond long. While one chunk is sent the next one waits behind
//! it, chained by the hardware. When no segment is left, the last entry has a mark, at which the state machine raises
//! its interrupt: the machine stands still.
//!
//! **Counting.** Chunks are numbered. The read addresses of the channels, the level of the FIFO and the current
//! instruction of the state machine tell how many words have been carried out ([`place`]). The entries behind that
//! place are steps that have not been made: after a stop [`settle`] subtracts them from the position, and the place
//! of a contact is computed from them.
//!
//! **When late.** Two chunks are ready, each at least [`CHUNK_CYCLES`] long unless segments come late. If the feeder is
//! later than that, all pins keep their levels until it runs; no step is lost.

mod feeder;
mod machine;
mod program;
pub mod words;

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use embassy_rp::interrupt::{DMA_IRQ_0, InterruptExt};

use super::{exec, gpio, mask, register};
use crate::boards::{ACTIVE, MOTORS};
use crate::dda::{SEGMENTS, Segment};
use crate::hal::ring::Ring;
use crate::hal::segments::Segments;
use crate::hal::{Boot, Interrupt, Thread};
use feeder::FEEDER;
use machine::WIRING;
pub use machine::{Place, place};

/// Entries of a chunk: enough for a step each microsecond, and some more.
const CHUNK: usize = 512;
/// Chunks in RAM. Two are sent or wait. Up to three more may have entries in the FIFO and in the state machine, and a
/// contact is worked out later than it happens.
const CHUNKS: usize = 8;
/// About how long a chunk lasts, cycles: half a millisecond.
const CHUNK_CYCLES: i32 = 64_000;

static RING: Ring<Segment, SEGMENTS> = Ring::new();
/// Steps are coming, or will come. Exec sets it, the feeder clears it.
static RUNNING: AtomicBool = AtomicBool::new(false);
/// Set by [`stop`].
static STOPPED: AtomicBool = AtomicBool::new(false);
/// Exec has queued a segment while nothing ran.
static BEGINS: AtomicBool = AtomicBool::new(false);
/// How long pulses last, us.
static PULSE_US: AtomicU32 = AtomicU32::new(2);
/// The outputs of a register that are inverted, as bits of an entry. A pin of the chip is inverted at its pad instead.
static INVERTED: AtomicU32 = AtomicU32::new(0);

/// Sets PIO, DMA and pins up, and returns the filling end of the segment ring. `None` after the first time.
pub fn start(boot: &Boot) -> Option<Segments> {
    let (producer, consumer) = RING.split()?;
    feeder::start(boot, consumer);
    machine::start(boot);
    // SAFETY: the feeder alone reads the ring, in the interrupt of the DMA, and copies each segment.
    Some(unsafe { Segments::new(producer) })
}

/// Starts the steps if they have stopped. Exec calls it after it has queued a segment.
pub fn go(_: Interrupt) {
    if !RUNNING.load(Relaxed) && !is_stopped() {
        RUNNING.store(true, Relaxed);
        BEGINS.store(true, Relaxed);
        DMA_IRQ_0.pend();
    }
}

/// Stops the steps at once, wherever the motors are; they stay stopped until [`release`]. Any level.
pub fn stop() {
    STOPPED.store(true, Relaxed);
    kill();
}

/// Stops the steps at once. Also for the panic handler.
pub fn kill() {
    machine::halt();
}

/// Whether [`stop`] has stopped the steps and nothing has released them. Any level.
pub fn is_stopped() -> bool {
    STOPPED.load(Relaxed)
}

/// Allows steps again after a stop. Call it when the motors have [settled](settle).
pub fn release(_: Thread) {
    STOPPED.store(false, Relaxed);
}

/// Whether steps are coming. Any level.
pub fn running() -> bool {
    RUNNING.load(Relaxed) && !is_stopped()
}

/// Always returns `u32::MAX`, unknown: the entries of the running segment still wait to be sent.
pub fn left(_: Interrupt) -> u32 {
    u32::MAX
}

/// Drops the rest of all segments after a stop, so that every motor stands where its last pulse has put it. `held` is
/// the segment that would have come next after the queued ones. Subtracts the steps that were not made from `position`.
/// Call it while no steps come.
pub fn settle(_: Interrupt, mut held: Option<Segment>, position: &mut [i32; MOTORS]) {
    if running() {
        return;
    }
    feeder::alone(|feeder| {
        for (position, steps) in position.iter_mut().zip(machine::drop_words()) {
            *position = position.wrapping_sub(steps);
        }
        feeder.settle(&mut held, position);
        BEGINS.store(false, Relaxed);
        RUNNING.store(false, Relaxed);
    });
}

/// Notes a contact, at which the pins were at `place`. Handler of inputs.
pub(super) fn contact(place: Place) {
    mask(|| FEEDER.contact.set(Some(place)));
    DMA_IRQ_0.pend();
}

/// Sets which direction pins are inverted: bit m for motor m. Call it while nothing runs.
pub fn set_inverted(_: Thread, motors: u8) {
    if ACTIVE.registers.is_some() {
        let dirs = |motors| WIRING.turned(motors);
        return invert(dirs(u8::MAX), dirs(motors));
    }
    for (m, motor) in ACTIVE.motors.iter().enumerate() {
        gpio::invert(motor.dir, motors & 1 << m != 0);
    }
}

/// Sets the width of a step pulse, in microseconds, and which step pins rest high (bit m for motor m). The values may
/// change only while nothing runs.
pub fn set_step_output(_: Thread, pulse_us: u8, inverted: u8) {
    PULSE_US.store(pulse_us.into(), Relaxed);
    if ACTIVE.registers.is_some() {
        let steps = |motors| WIRING.stepping(motors);
        return invert(steps(u8::MAX), steps(inverted));
    }
    for (m, motor) in ACTIVE.motors.iter().enumerate() {
        gpio::invert(motor.step, inverted & 1 << m != 0);
    }
}

/// Inverts the outputs `inverted` of the outputs `of`, and no other of these. They change at once if nothing runs.
fn invert(of: u32, inverted: u32) {
    let pins = INVERTED.load(Relaxed) & !of | inverted;
    if pins == INVERTED.load(Relaxed) {
        return;
    }
    INVERTED.store(pins, Relaxed);
    feeder::alone(|feeder| {
        if !RUNNING.load(Relaxed) && !is_stopped() {
            feeder.show();
        }
    });
}
