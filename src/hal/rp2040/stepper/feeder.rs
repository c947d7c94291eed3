//! The feeder: writes chunks of words ahead of time. Owns the step generator, and the ring's end that reads.
//!
//! It runs in the handlers of DMA_IRQ_0 and PIO0_IRQ_0, of one priority: at the end of each chunk, when exec starts the steps, at the mark of the last word, and
//! when a contact is to be worked out. Cost of a tick: 60 to 130 cycles with its words.

use core::cell::{Cell, UnsafeCell};
use core::sync::atomic::Ordering::Relaxed;

use embassy_rp::interrupt;
use embassy_rp::interrupt::InterruptExt;

use super::machine::{self, Chunk, Place};
use super::words::{CYCLES_PER_COUNT, OF_A_TICK, OF_THE_END, Out, Writer};
use super::{BEGINS, CHUNK_CYCLES, PULSE_US, RING, RUNNING, STOPPED, exec, mask};
use crate::boards::MOTORS;
use crate::dda::{Dda, SEGMENTS, Segment, contact};
use crate::hal::event::Event;
use crate::hal::flags;
use crate::hal::ring::Consumer;

/// From the start to the first tick, counts.
const FIRST_TICK: u32 = 400;

/// What the feeder owns.
pub(super) struct Feeder {
    dda: Dda,
    writer: Writer,
    segments: Option<Consumer<Segment, SEGMENTS>>,
    /// Chunks that are sent or wait.
    flying: u8,
    /// The last word has been written: its mark is to come.
    ended: bool,
}

/// It, and what others tell it.
pub(super) struct Shared {
    feeder: UnsafeCell<Feeder>,
    /// Where the pins were at a contact. With interrupts off.
    pub contact: Cell<Option<Place>>,
}

// SAFETY: the feeder's handlers, which do not preempt each other, and `alone`; `contact` with interrupts off.
unsafe impl Sync for Shared {}

pub(super) static FEEDER: Shared = Shared {
    feeder: UnsafeCell::new(Feeder {
        dda: Dda::new(),
        writer: Writer::new(),
        segments: None,
        flying: 0,
        ended: false,
    }),
    contact: Cell::new(None),
};

/// Takes the ring's end. Start-up.
pub(super) fn start(segments: Consumer<Segment, SEGMENTS>) {
    alone(|feeder| feeder.segments = Some(segments));
}

/// Does something with the feeder while it cannot run. Thread mode, exec, and start-up.
pub(super) fn alone<R>(act: impl FnOnce(&mut Feeder) -> R) -> R {
    let was = interrupt::DMA_IRQ_0.is_enabled();
    interrupt::DMA_IRQ_0.disable();
    interrupt::PIO0_IRQ_0.disable();
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    // SAFETY: its handlers are off, and no level above them calls this.
    let result = act(unsafe { &mut *FEEDER.feeder.get() });
    if was {
        // SAFETY: as it was before.
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

/// What both handlers do.
fn turn() {
    // SAFETY: handlers of one priority, and `alone` keeps them off.
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
    /// The generator.
    pub(super) fn dda(&self) -> &Dda {
        &self.dda
    }

    fn begin(&mut self) {
        self.writer.set_pulse(PULSE_US.load(Relaxed) as u8);
        self.writer.begin(FIRST_TICK * CYCLES_PER_COUNT);
        self.ended = false;
    }

    /// The last word has been carried out.
    fn rest(&mut self) {
        self.ended = false;
        let waits = self.segments.as_ref().is_some_and(|segments| !segments.is_empty());
        if waits && !STOPPED.load(Relaxed) {
            return self.begin();
        }
        RUNNING.store(false, Relaxed);
        exec::pend();
    }

    /// Has two chunks on their way, as far as there are segments.
    fn feed(&mut self) {
        while RUNNING.load(Relaxed) && self.flying < 2 && !self.ended {
            let mut chunk = Chunk::next();
            self.fill(&mut chunk);
            if chunk.is_empty() {
                // Segments may come while the other one is sent.
                if self.flying > 0 {
                    return;
                }
                self.end(&mut chunk);
            }
            chunk.send(self.flying > 0);
            self.flying += 1;
        }
    }

    /// Whether there is a tick to be written.
    fn has_tick(&self) -> bool {
        self.dda.ticks > 0 || self.segments.as_ref().is_some_and(|segments| !segments.is_empty())
    }

    /// Writes ticks for about a millisecond.
    fn fill(&mut self, chunk: &mut Chunk) {
        let mut cycles = 0i32;
        while cycles < CHUNK_CYCLES && chunk.room() > OF_A_TICK + OF_THE_END && self.has_tick() {
            self.tick(chunk);
            cycles = cycles.saturating_add(self.writer.pass());
        }
        if cycles > 0 {
            self.writer.close(chunk);
        }
    }

    /// Writes a tick. Whether there was none, for there is no segment.
    fn tick(&mut self, chunk: &mut Chunk) -> bool {
        let Some(segments) = self.segments.as_mut() else { return true };
        let mut out = Out { writer: &mut self.writer, to: chunk, freed: false, stopped: false };
        self.dda.tick(&mut out, segments);
        let stopped = out.stopped;
        if out.freed {
            exec::pend();
        }
        stopped
    }

    /// The last pulse, and the mark.
    fn end(&mut self, chunk: &mut Chunk) {
        self.ended = self.tick(chunk);
        if self.ended {
            self.writer.end(chunk);
        } else {
            // A segment has come in the nick of time.
            self.writer.pass();
            self.writer.close(chunk);
        }
    }

    /// Everything that has not been carried out is forgotten: see [`Dda::settle`].
    pub(super) fn settle(&mut self, held: &mut Option<Segment>, position: &mut [i32; MOTORS]) {
        let segments = &mut self.segments;
        let queued = || segments.as_mut().and_then(Consumer::pop).or_else(|| held.take());
        self.dda.settle(queued, position);
        (self.flying, self.ended) = (0, false);
        self.writer.begin(0);
        machine::show(self.writer.pins());
    }

    /// Works out where the motors were when the pins were at `place`.
    fn contact(&mut self, place: Place) {
        contact::mark_behind(&self.dda, RING.tail(), &machine::steps_behind(place));
        contact::note();
        flags::set(Event::BlockDone);
    }
}
