//! The feeder: writes chunks of entries ahead of time. Owns the step generator, and the reading end of the segment
//! ring.
//!
//! It runs in the handlers of DMA_IRQ_0 and PIO0_IRQ_0, which have one priority: at the end of each chunk, when exec
//! starts the steps, at the mark of the last entry, and when a contact has to be worked out. Cost: see
//! [`Writer::run`].

use core::cell::{Cell, UnsafeCell};
use core::sync::atomic::Ordering::Relaxed;

use embassy_rp::interrupt;
use embassy_rp::interrupt::InterruptExt;

use super::machine::{self, Chunk, Place, WIRING};
use super::words::{CYCLES_PER_COUNT, OF_A_SEGMENT, OF_THE_END, Out, Writer};
use super::{BEGINS, CHUNK_CYCLES, INVERTED, PULSE_US, RING, RUNNING, STOPPED, exec, mask};
use crate::boards::MOTORS;
use crate::dda::{Dda, SEGMENTS, Segment, contact};
use crate::hal::Boot;
use crate::hal::event::Event;
use crate::hal::flags;
use crate::hal::ring::Consumer;

/// Counts from the start to the first tick.
const FIRST_TICK: u32 = 400;

/// The state that the feeder owns.
pub(super) struct Feeder {
    dda: Dda,
    writer: Writer,
    segments: Option<Consumer<Segment, SEGMENTS>>,
    /// The next entry is the first of a motion.
    begins: bool,
    /// Chunks that are being sent or wait.
    flying: u8,
    /// The last entry has been written; its mark has not come yet.
    ended: bool,
}

/// The feeder, and what others tell it.
pub(super) struct Shared {
    feeder: UnsafeCell<Feeder>,
    /// Where the pins were at a contact that is still to be worked out. Used with interrupts off.
    pub contact: Cell<Option<Place>>,
}

// SAFETY: only the feeder's handlers, which do not preempt each other, and `alone` use the feeder; `contact` is used
// with interrupts off.
unsafe impl Sync for Shared {}

pub(super) static FEEDER: Shared = Shared {
    feeder: UnsafeCell::new(Feeder {
        dda: Dda::new(),
        writer: Writer::new(&WIRING),
        segments: None,
        begins: false,
        flying: 0,
        ended: false,
    }),
    contact: Cell::new(None),
};

/// Takes the reading end of the segment ring.
pub(super) fn start(_: &Boot, segments: Consumer<Segment, SEGMENTS>) {
    alone(|feeder| feeder.segments = Some(segments));
}

/// Runs `act` on the feeder while its handlers cannot run. Any level but theirs.
pub(super) fn alone<R>(act: impl FnOnce(&mut Feeder) -> R) -> R {
    let was = interrupt::DMA_IRQ_0.is_enabled();
    interrupt::DMA_IRQ_0.disable();
    interrupt::PIO0_IRQ_0.disable();
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    // SAFETY: the feeder's handlers are off, and no level above them calls this.
    let result = act(unsafe { &mut *FEEDER.feeder.get() });
    if was {
        // SAFETY: the interrupts are enabled as they were before.
        unsafe {
            interrupt::DMA_IRQ_0.enable();
            interrupt::PIO0_IRQ_0.enable();
        }
    }
    result
}

#[interrupt]
fn DMA_IRQ_0() {
    turn();
}

#[interrupt]
fn PIO0_IRQ_0() {
    turn();
}

/// Does the work of both handlers.
fn turn() {
    // SAFETY: both handlers have one priority, and `alone` keeps them off.
    let feeder = unsafe { &mut *FEEDER.feeder.get() };
    feeder.flying = feeder.flying.saturating_sub(machine::take_done().count_ones() as u8);
    if machine::take_mark() {
        feeder.rest();
    }
    if BEGINS.load(Relaxed) {
        BEGINS.store(false, Relaxed);
        feeder.begin();
    }
    feeder.feed();
    if let Some(place) = mask(|| FEEDER.contact.take()) {
        feeder.contact(place);
    }
}

impl Feeder {
    fn begin(&mut self) {
        self.writer.set_inverted(INVERTED.load(Relaxed));
        self.writer.set_pulse(PULSE_US.load(Relaxed) as u8);
        machine::set_pulse(self.writer.pulse_count());
        (self.begins, self.ended) = (true, false);
    }

    /// Ends the motion, because the last entry has been carried out; begins another one if segments wait.
    fn rest(&mut self) {
        self.ended = false;
        let waits = self.segments.as_ref().is_some_and(|segments| !segments.is_empty());
        if waits && !STOPPED.load(Relaxed) {
            return self.begin();
        }
        RUNNING.store(false, Relaxed);
        exec::pend();
    }

    /// Keeps two chunks on their way, as long as there are segments.
    fn feed(&mut self) {
        while RUNNING.load(Relaxed) && self.flying < 2 && !self.ended {
            let mut chunk = Chunk::next();
            self.fill(&mut chunk);
            if chunk.is_empty() {
                // Segments may still come while the other chunk is sent.
                if self.flying > 0 {
                    return;
                }
                self.end(&mut chunk);
            }
            chunk.send(self.flying > 0);
            self.flying += 1;
        }
    }

    /// Whether there is a tick to write.
    fn has_tick(&self) -> bool {
        self.dda.ticks > 0 || self.segments.as_ref().is_some_and(|segments| !segments.is_empty())
    }

    /// Writes ticks to `chunk` for about [`CHUNK_CYCLES`].
    fn fill(&mut self, chunk: &mut Chunk) {
        let mut cycles = 0i32;
        while cycles < CHUNK_CYCLES
            && chunk.list.left() > OF_A_SEGMENT + OF_THE_END + 1
            && self.has_tick()
        {
            if self.begins {
                self.begins = false;
                self.writer.begin(FIRST_TICK * CYCLES_PER_COUNT, &mut chunk.list);
            }
            if self.dda.ticks == 0 && !self.load(chunk) {
                break;
            }
            let period = self.writer.period().max(1);
            let room = chunk.list.left() - OF_THE_END;
            let ticks = ((CHUNK_CYCLES - cycles) / period + 1).min(room as i32) as u32;
            let ticks = ticks.min(self.dda.ticks.into()) as u16;
            self.writer.run(&mut self.dda, ticks, &mut chunk.list);
            cycles = cycles.saturating_add(i32::from(ticks).saturating_mul(period));
        }
        if cycles >= CHUNK_CYCLES && chunk.is_empty() {
            self.writer.close(&mut chunk.list);
        }
    }

    /// Loads the next segment. Returns `false` if there is none.
    fn load(&mut self, chunk: &mut Chunk) -> bool {
        let Some(segments) = self.segments.as_mut() else { return false };
        let mut out = Out { writer: &mut self.writer, to: &mut chunk.list };
        let loaded = self.dda.load(&mut out, segments);
        if loaded {
            exec::pend();
        }
        loaded
    }

    /// Writes the last entry, with its mark.
    fn end(&mut self, chunk: &mut Chunk) {
        self.writer.end(&mut chunk.list);
        self.ended = true;
    }

    /// Drops everything that has not been carried out: see [`Dda::settle`].
    pub(super) fn settle(&mut self, held: &mut Option<Segment>, position: &mut [i32; MOTORS]) {
        let segments = &mut self.segments;
        let queued = || segments.as_mut().and_then(Consumer::pop).or_else(|| held.take());
        self.dda.settle(queued, position);
        (self.flying, self.ended) = (0, false);
        self.writer.rest();
        self.show();
    }

    /// Sets the pins as they are between pulses. While nothing is sent.
    pub(super) fn show(&mut self) {
        self.writer.set_inverted(INVERTED.load(Relaxed));
        machine::show(self.writer.low());
    }

    /// Works out where the motors were when the pins were at `place`.
    fn contact(&mut self, place: Place) {
        contact::mark_behind(&self.dda, RING.tail(), &machine::steps_behind(place));
        contact::note();
        flags::set(Event::BlockDone);
    }
}
