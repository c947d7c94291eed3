//! The state machine, its FIFO and the two DMA channels: this module owns all their registers.
//!
//! ```text
//! RAM: chunk n, n + 1  --channel n mod 2-->  FIFO (4 words)  -->  state machine  -->  pins, or shift register
//! ```

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use embassy_rp::interrupt::{DMA_IRQ_0, InterruptExt, PIO0_IRQ_0, Priority};
use embassy_rp::pac::{DMA, PIO0};

use super::program::{self, Layout};
use super::words::{CHANGES, Count, Entry, List, Wiring};
use super::{CHUNK, CHUNKS, INVERTED, STOPPED, gpio, mask, register};
use crate::boards::{ACTIVE, MOTORS, Port};
use crate::hal::Boot;

/// The number of the state machine, of four.
const SM: usize = 0;
/// Where its program is in an entry, by the address of the instruction.
const LAYOUT: Layout =
    if ACTIVE.registers.is_some() { program::OF_SHIFTED } else { program::OF_DIRECT };
/// Bit of the interrupt flag that a marked entry raises.
const MARKED: u8 = 1;
/// How often [`place`] reads again when the state machine moves on meanwhile.
const TRIES: u8 = 8;
/// How often [`show`] looks at most whether the state machine waits again; each time takes ten cycles or more.
const POLLS: u8 = 20;
/// Words of an entry.
const WORDS: u32 = 2;

/// What the channels do: they move words from memory, one for each free place in the FIFO (request 0 is that of
/// PIO0's first state machine).
const CONTROL: u32 = 1 | 2 << 2 | 1 << 4;
/// Position of the number of the channel that follows; a channel's own number means none.
const CHAIN: u32 = 11;
/// Bit of a channel's control register: the channel is at work.
const BUSY: u32 = 1 << 24;

/// The number of pins of the chip.
const PINS: u8 = 30;

/// The motors' pins.
pub(super) static WIRING: Wiring = Wiring::new(ACTIVE.motors, ACTIVE.registers);

const _: () = {
    let (port, pins) = match ACTIVE.registers {
        Some(registers) => (Port::Steps, registers.steps.outputs),
        None => (Port::Gpio, PINS),
    };
    let mut m = 0;
    while m < MOTORS {
        let (step, dir) = (ACTIVE.motors[m].step, ACTIVE.motors[m].dir);
        assert!(step.port as u8 == port as u8 && dir.port as u8 == port as u8);
        assert!(step.bit < pins && dir.bit < pins);
        m += 1;
    }
};

struct Buffer(UnsafeCell<[[Entry; CHUNK]; CHUNKS]>);

// SAFETY: only the feeder writes it, and never a chunk that the DMA reads.
unsafe impl Sync for Buffer {}

static BUFFER: Buffer = Buffer(UnsafeCell::new([[[0; 2]; CHUNK]; CHUNKS]));

/// Words in each chunk, by its number modulo [`CHUNKS`].
static LENGTHS: [AtomicU32; CHUNKS] = [const { AtomicU32::new(0) }; CHUNKS];
/// Chunks that have been handed to the DMA.
static SENT: AtomicU32 = AtomicU32::new(0);

/// How far entries have been carried out: `words` words of this chunk, and all chunks before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    chunk: u32,
    words: u32,
}

impl Place {
    /// No place: nothing has been sent.
    pub const NONE: Place = Place { chunk: 0, words: 0 };
}

/// Returns the address of a chunk.
fn address(chunk: u32) -> u32 {
    BUFFER.0.get() as u32 + chunk % CHUNKS as u32 * size_of::<[Entry; CHUNK]>() as u32
}

fn length(chunk: u32) -> u32 {
    LENGTHS[chunk as usize % CHUNKS].load(Relaxed)
}

/// Connects the pins and loads the program.
pub(super) fn start(boot: &Boot) {
    let sm = PIO0.sm(SM);
    sm.clkdiv().write(|w| w.set_int(1));
    if let Some(registers) = ACTIVE.registers {
        register::load(boot, PIO0, SM, &program::shifted());
        register::connect(boot, PIO0, SM, registers.steps, gpio::Unit::Pio0);
        // The register has anything at power-up, and keeps what it has over a reset.
        show(0);
    } else {
        register::load(boot, PIO0, SM, &program::direct());
        connect_motors(boot);
    }
    PIO0.irqs(0).inte().write(|w| w.set_sm0(true));
    DMA.inte(0).write_value(0b11);
    for interrupt in [DMA_IRQ_0, PIO0_IRQ_0] {
        interrupt.set_priority(Priority::P2);
        // SAFETY: everything that the handlers touch has been set up.
        unsafe { interrupt.enable() };
    }
}

/// Makes the motors' pins outputs of the state machine.
fn connect_motors(boot: &Boot) {
    let sm = PIO0.sm(SM);
    sm.shiftctrl().write(|w| {
        w.set_out_shiftdir(true);
        w.set_in_shiftdir(true);
    });
    for motor in ACTIVE.motors {
        for pin in [motor.step, motor.dir] {
            register::drive_low(boot, PIO0, SM, pin);
            gpio::connect_output(pin, gpio::Unit::Pio0);
        }
    }
    // All pins of the chip. Only the motors' pins are connected to the state machine.
    sm.pinctrl().write(|w| w.set_out_count(PINS));
}

/// `jmp 0`, `pull block`, `mov isr, osr`.
const JMP_START: u16 = 0;
const PULL: u16 = 0b100_00000_1010_0000;
const TO_PULSE: u16 = 0b101_00000_110_00_111;

fn execute(instruction: u16) {
    PIO0.sm(SM).instr().write(|w| w.set_instr(instruction));
}

/// Stops the state machine at once. Any level.
pub(super) fn halt() {
    // Nobody uses the other state machines.
    PIO0.ctrl().write(|w| w.set_sm_enable(0));
}

fn run() {
    PIO0.ctrl().write(|w| w.set_sm_enable(1 << SM));
}

/// Sets the count of pulses from the next entry on. The feeder, while nothing is sent.
pub(super) fn set_pulse(count: u32) {
    halt();
    begin_anew();
    PIO0.txf(SM).write_value(count);
    execute(PULL);
    execute(TO_PULSE);
}

/// Lets the program begin at its start. While the state machine stands still.
fn begin_anew() {
    PIO0.ctrl().write(|w| w.set_sm_restart(1 << SM));
    execute(JMP_START);
}

/// Takes the channels whose chunks have gone to the FIFO since the last call, as bits.
pub(super) fn take_done() -> u32 {
    let done = DMA.ints(0).read() & 0b11;
    DMA.ints(0).write_value(done);
    done
}

/// Whether a marked entry has been carried out since the last call.
pub(super) fn take_mark() -> bool {
    let marked = PIO0.irq().read().irq() & MARKED != 0;
    if marked {
        PIO0.irq().write(|w| w.set_irq(MARKED));
    }
    marked
}

/// The next chunk, which the feeder fills.
pub(super) struct Chunk {
    number: u32,
    /// The entries that have been written.
    pub list: List<'static>,
}

impl Chunk {
    /// Returns the next chunk. Only the feeder calls it, and fills one chunk at a time.
    pub(super) fn next() -> Self {
        let number = SENT.load(Relaxed);
        let chunks = BUFFER.0.get().cast::<[Entry; CHUNK]>();
        // SAFETY: inside the buffer. The DMA does not read this chunk now, and the chunk that was filled before has
        // been handed over.
        let room = unsafe { &mut *chunks.wrapping_add(number as usize % CHUNKS) };
        Self { number, list: List::new(room) }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.len() == 0
    }

    /// Hands the chunk to the DMA. If `follows`, it comes behind the chunk that is being sent.
    pub(super) fn send(self, follows: bool) {
        let (own, other) = (self.number as usize % 2, (self.number as usize + 1) % 2);
        let start = address(self.number);
        let (channel, before) = (DMA.ch(own), DMA.ch(other));
        let words = self.list.len() as u32 * WORDS;
        LENGTHS[self.number as usize % CHUNKS].store(words, Relaxed);
        // The words must be in memory before the DMA reads them.
        cortex_m::asm::dmb();
        mask(|| {
            channel.al1_ctrl().write_value(CONTROL | (own as u32) << CHAIN);
            channel.al1_read_addr().write_value(start);
            channel.al1_write_addr().write_value(PIO0.txf(SM).as_ptr() as u32);
            channel.trans_count().write_value(words);
            SENT.store(self.number.wrapping_add(1), Relaxed);
            if STOPPED.load(Relaxed) {
                return;
            }
            run();
            if follows {
                before.al1_ctrl().write_value(CONTROL | (own as u32) << CHAIN);
                // The channel before may have ended before it was told what follows.
                let ended = before.al1_ctrl().read() & BUSY == 0;
                let waits = channel.al1_ctrl().read() & BUSY == 0
                    && channel.al1_read_addr().read() == start;
                if !(ended && waits) {
                    return;
                }
            }
            DMA.multi_chan_trigger().write(|w| w.set_multi_chan_trigger(1 << own));
        });
    }
}

/// Returns how far entries have been carried out. Any level. Cost: 80 cycles.
pub fn place() -> Place {
    let mut found = Place::NONE;
    if SENT.load(Relaxed) == 0 {
        return found;
    }
    // If the state machine moves on meanwhile, its state is read again. In each entry that happens for a moment only.
    for _ in 0..TRIES {
        let (place, waiting) = (sent(), waiting());
        let at = PIO0.sm(SM).addr().read().addr();
        let taken = match at {
            at if LAYOUT.taken.contains(&at) => WORDS,
            at if LAYOUT.half_taken.iter().any(|range| range.contains(&at)) => 1,
            _ => 0,
        };
        found = back(place, waiting + taken);
        if found.words.is_multiple_of(WORDS) && sent_is(found, waiting + taken) {
            break;
        }
    }
    found
}

/// Whether `place` is `behind` words before the end of what has been sent.
fn sent_is(place: Place, behind: u32) -> bool {
    back(sent(), behind) == place && waiting() <= behind
}

/// Returns the number of words in the FIFO.
fn waiting() -> u32 {
    PIO0.flevel().read().0 >> (8 * SM) & 0xF
}

/// Returns how far the DMA has read.
fn sent() -> Place {
    let newest = SENT.load(Relaxed).wrapping_sub(1);
    let gone = |chunk: u32| {
        let read = DMA.ch(chunk as usize % 2).al1_read_addr().read();
        read.wrapping_sub(address(chunk)) / 4
    };
    match gone(newest) {
        0 => {
            let before = newest.wrapping_sub(1);
            Place { chunk: before, words: gone(before) }
        }
        words => Place { chunk: newest, words },
    }
}

/// Returns the place `words` words before `place`.
fn back(mut place: Place, mut words: u32) -> Place {
    for _ in 0..CHUNKS {
        if let Some(left) = place.words.checked_sub(words) {
            return Place { words: left, ..place };
        }
        words -= place.words;
        let chunk = place.chunk.wrapping_sub(1);
        place = Place { chunk, words: length(chunk) };
    }
    place
}

fn entry(chunk: u32, number: u32) -> Entry {
    let at = address(chunk) as *const Entry;
    // SAFETY: inside the buffer. The feeder, which writes it, does not run meanwhile, or it is the caller.
    unsafe { at.wrapping_add(number as usize % CHUNK).read_volatile() }
}

/// Returns the steps of the entries behind a place; backward steps are negative. The feeder, or others while it
/// cannot run.
pub(super) fn steps_behind(place: Place) -> [i32; MOTORS] {
    let mut count = Count::default();
    let inverted = INVERTED.load(Relaxed);
    let (mut at, end) = (place, SENT.load(Relaxed));
    for _ in 0..CHUNKS {
        if at.chunk == end {
            break;
        }
        for number in at.words / WORDS..length(at.chunk) / WORDS {
            count.add(&WIRING, inverted, entry(at.chunk, number));
        }
        at = Place { chunk: at.chunk.wrapping_add(1), words: 0 };
    }
    count.steps
}

/// Drops what has been sent and not carried out, and returns its steps. Leaves step pins low. While the feeder cannot
/// run and no steps come.
pub(super) fn drop_words() -> [i32; MOTORS] {
    halt();
    // Waits until the words on their way to the FIFO have arrived.
    while (0..2).any(|ch| DMA.ch(ch).al1_ctrl().read() & BUSY != 0)
        && PIO0.fstat().read().0 >> (16 + SM) & 1 == 0
    {}
    let steps = steps_behind(place());
    DMA.chan_abort().write(|w| w.set_chan_abort(0b11));
    while DMA.chan_abort().read().chan_abort() != 0 {}
    let newest = SENT.load(Relaxed).wrapping_sub(1);
    DMA.ch(newest as usize % 2).al1_read_addr().write_value(address(newest) + 4 * length(newest));
    take_done();
    take_mark();
    // Changing this bit empties the FIFO.
    let sm = PIO0.sm(SM);
    for _ in 0..2 {
        sm.shiftctrl().modify(|w| w.set_fjoin_rx(!w.fjoin_rx()));
    }
    begin_anew();
    steps
}

/// Sets the pins to `pins`, while nothing else is sent. Cost: a microsecond, until the state machine waits again.
pub(super) fn show(pins: u32) {
    for word in [CHANGES, pins] {
        PIO0.txf(SM).write_value(word);
    }
    run();
    for _ in 0..POLLS {
        if waiting() == 0 && PIO0.sm(SM).addr().read().addr() == 0 {
            break;
        }
    }
}
