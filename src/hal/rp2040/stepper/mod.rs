//! Steps: a state machine of PIO0, which two channels of the DMA feed in turn with words out of RAM.
//!
//! An entry of two words is a rest, a pulse, and the pins for it ([`words`]); the state machine runs at the system clock. So each
//! edge is where it should be to a cycle, whatever the CPU does, and all motors keep to one time. Pins may be anywhere: entries have all of the chip.
//!
//! The **feeder**, the handler of DMA_IRQ_0 and PIO0_IRQ_0, runs the step generator ([`Dda`]) ahead of time and writes chunks of entries, each about half a
//! millisecond long. While one chunk is sent the next one waits behind it, chained by the hardware. Where no segment is left, the last entry has a mark, upon
//! which the state machine raises its interrupt: the machine stands still.
//!
//! **Counting.** Chunks are numbered. How many words have been carried out follows from the read address of the channels, the level of the FIFO and the
//! instruction that the state machine is at ([`place`]). Entries behind that are steps that have not been made: after a stop [`settle`] takes them
//! off the position, and a contact's place is worked out from them.
//!
//! **When late.** Two chunks last for at least [`CHUNK_CYCLES`] each, unless segments come late. If the feeder comes later, all pins stand as they are
//! until it does; no step is lost.

mod feeder;
mod machine;
pub mod words;

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use embassy_rp::interrupt::{DMA_IRQ_0, InterruptExt};

use super::{exec, gpio, mask};
use crate::boards::{ACTIVE, MOTORS};
use crate::dda::{Dda, SEGMENTS, Segment};
use crate::hal::ring::{Producer, Ring};
use feeder::FEEDER;
pub use machine::{Place, place};

/// Entries of a chunk: a step each microsecond, and some.
const CHUNK: usize = 512;
/// Chunks in RAM. Two are sent or wait; three more may have entries in the FIFO and in the state machine, and a contact is told later.
const CHUNKS: usize = 8;
/// About how long a chunk lasts, cycles: half a millisecond.
const CHUNK_CYCLES: i32 = 64_000;

static RING: Ring<Segment, SEGMENTS> = Ring::new();
/// Steps are coming, or will. Exec sets it, the feeder clears it.
static RUNNING: AtomicBool = AtomicBool::new(false);
/// Set by [`stop`].
static STOPPED: AtomicBool = AtomicBool::new(false);
/// Exec has queued a segment while nothing ran.
static BEGINS: AtomicBool = AtomicBool::new(false);
/// How long pulses last, us.
static PULSE_US: AtomicU32 = AtomicU32::new(2);

/// Sets PIO, DMA and pins up. Start-up; `None` after the first time.
pub fn start() -> Option<Producer<Segment, SEGMENTS>> {
    let (producer, consumer) = RING.split()?;
    feeder::start(consumer);
    machine::start();
    Some(producer)
}

/// Starts the steps if they have stopped. Exec, after it has queued a segment.
pub fn go() {
    if !RUNNING.load(Relaxed) && !is_stopped() {
        RUNNING.store(true, Relaxed);
        BEGINS.store(true, Relaxed);
        DMA_IRQ_0.pend();
    }
}

/// Stops the steps at once and until [`release`], wherever the motors are. Any level.
pub fn stop() {
    STOPPED.store(true, Relaxed);
    kill();
}

/// Stops the steps at once. Also for the panic handler.
pub fn kill() {
    machine::halt();
}

/// Whether they have been stopped. Any level.
pub fn is_stopped() -> bool {
    STOPPED.load(Relaxed)
}

/// Steps may come again. Thread mode, when the motors have [settled](settle).
pub fn release() {
    STOPPED.store(false, Relaxed);
}

/// Whether steps are coming. Any level.
pub fn running() -> bool {
    RUNNING.load(Relaxed) && !is_stopped()
}

/// How long the segment that runs takes yet: not known, for what the feeder has made of it waits to be sent. Exec.
pub fn left() -> u32 {
    u32::MAX
}

/// Every motor is where its last pulse has put it; nothing is left of the segments, of which `held` would have come first after those that are
/// queued. What they lack is taken off `position`. Exec, while no steps come.
pub fn settle(mut held: Option<Segment>, position: &mut [i32; MOTORS]) {
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

/// Where the generator is, between two ticks, and the slot of its segment. It is ahead of the pins: a contact goes by [`contact`] here.
pub fn moment() -> (Dda, u8) {
    feeder::alone(|feeder| (feeder.dda().clone(), RING.tail()))
}

/// There has been a contact, when the pins were at `place`. Handler of inputs.
pub(super) fn contact(place: Place) {
    mask(|| FEEDER.contact.set(Some(place)));
    DMA_IRQ_0.pend();
}

/// Which direction pins are inverted: bit m for motor m. Thread mode, while nothing runs.
pub fn set_inverted(motors: u8) {
    for (m, motor) in ACTIVE.motors.iter().enumerate() {
        gpio::invert(motor.dir, motors & 1 << m != 0);
    }
}

/// How wide a step pulse is, in microseconds, and which step pins rest high (bit m for motor m). Thread mode; a change only while nothing runs.
pub fn set_step_output(pulse_us: u8, inverted: u8) {
    PULSE_US.store(pulse_us.into(), Relaxed);
    for (m, motor) in ACTIVE.motors.iter().enumerate() {
        gpio::invert(motor.step, inverted & 1 << m != 0);
    }
}
