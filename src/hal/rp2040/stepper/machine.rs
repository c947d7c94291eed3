//! The state machine, its FIFO and the two channels of the DMA: all their registers.
//!
//! ```text
//! RAM: chunk n, n + 1  --channel n mod 2-->  FIFO (4 words)  -->  state machine  -->  pins
//! ```

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use embassy_rp::interrupt::{DMA_IRQ_0, InterruptExt, PIO0_IRQ_0, Priority};
use embassy_rp::pac::{DMA, PIO0};
use embassy_rp::pio::program::pio_asm;

use super::words::{Count, Put};
use super::{CHUNK, CHUNKS, STOPPED, gpio, mask};
use crate::boards::{ACTIVE, MOTORS, Port};

/// The state machine, of four.
const SM: usize = 0;
/// Where its program lies: wherever it is loaded, jumps are as in the text.
const ORIGIN: u8 = 0;
/// The instruction behind the one that takes a word: the word's pins are not out yet.
const TAKEN: u8 = ORIGIN + 1;
/// The interrupt flag that a marked word raises.
const MARKED: u32 = 1;

/// What the channels do: words from memory, one for each place in the FIFO (request 0 is that of the first state machine of PIO0).
const CONTROL: u32 = 1 | 2 << 2 | 1 << 4;
/// Where the channel that follows is written, itself for none.
const CHAIN: u32 = 11;
/// Of a channel: it is at work.
const BUSY: u32 = 1 << 24;

const _: () = {
    let base = ACTIVE.motors[0].step.bit;
    let mut m = 0;
    while m < MOTORS {
        let (step, dir) = (ACTIVE.motors[m].step, ACTIVE.motors[m].dir);
        assert!(step.port as u8 == Port::Gpio as u8 && dir.port as u8 == Port::Gpio as u8);
        assert!(step.bit == base + m as u8, "step pins are side by side");
        assert!(dir.bit == base + (MOTORS + m) as u8, "direction pins are right behind step pins");
        m += 1;
    }
};

struct Buffer(UnsafeCell<[[u32; CHUNK]; CHUNKS]>);

// SAFETY: the feeder alone writes it, and never a chunk that the DMA reads.
unsafe impl Sync for Buffer {}

static BUFFER: Buffer = Buffer(UnsafeCell::new([[0; CHUNK]; CHUNKS]));

/// Words in each chunk, by its number modulo [`CHUNKS`].
static LENGTHS: [AtomicU32; CHUNKS] = [const { AtomicU32::new(0) }; CHUNKS];
/// Chunks that have been handed to the DMA.
static SENT: AtomicU32 = AtomicU32::new(0);

/// How far words have been carried out: so many of this chunk, and all before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    chunk: u32,
    words: u32,
}

impl Place {
    /// Nowhere.
    pub const NONE: Place = Place { chunk: 0, words: 0 };
}

/// The address of a chunk.
fn address(chunk: u32) -> u32 {
    BUFFER.0.get() as u32 + (chunk as usize % CHUNKS * CHUNK * 4) as u32
}

fn length(chunk: u32) -> u32 {
    LENGTHS[chunk as usize % CHUNKS].load(Relaxed)
}

/// Connects the pins and loads the program. Start-up.
pub(super) fn start() {
    let program = pio_asm!(
        ".origin 0",
        ".wrap_target",
        "start:",
        "    pull block",
        "    out pins, 8",
        "    out y, 1",
        "    out x, 23",
        "hold:",
        "    jmp x-- hold",
        "    jmp !y start",
        "    irq nowait 0",
        ".wrap",
    );
    const { assert!(super::words::PINS == 8, "the program has as many pins") };
    for (i, instruction) in program.program.code.iter().enumerate() {
        PIO0.instr_mem(i).write(|w| w.set_instr_mem(*instruction));
    }
    let base = ACTIVE.motors[0].step.bit;
    let sm = PIO0.sm(SM);
    sm.clkdiv().write(|w| w.set_int(1));
    sm.execctrl().write(|w| {
        w.set_wrap_bottom(program.program.wrap.target);
        w.set_wrap_top(program.program.wrap.source);
    });
    sm.shiftctrl().write(|w| {
        w.set_out_shiftdir(true);
        w.set_in_shiftdir(true);
    });
    // Pins become outputs by instructions that are carried out at once.
    for motor in &ACTIVE.motors {
        for pin in [motor.step, motor.dir] {
            sm.pinctrl().write(|w| {
                w.set_set_base(pin.bit);
                w.set_set_count(1);
            });
            execute(SET_PINS);
            execute(SET_PINDIRS);
            gpio::connect(pin, gpio::Unit::Pio0);
        }
    }
    sm.pinctrl().write(|w| {
        w.set_out_base(base);
        w.set_out_count(super::words::PINS as u8);
    });
    PIO0.irqs(0).inte().write(|w| w.0 = MARKED << 8);
    DMA.inte(0).write_value(0b11);
    for interrupt in [DMA_IRQ_0, PIO0_IRQ_0] {
        interrupt.set_priority(Priority::P2);
        // SAFETY: what the handlers touch is there.
        unsafe { interrupt.enable() };
    }
}

/// `set pins, 0`, `set pindirs, 1`, `jmp 0`.
const SET_PINS: u16 = 0b111_00000_000_00000;
const SET_PINDIRS: u16 = 0b111_00000_100_00001;
const JMP_START: u16 = ORIGIN as u16;

fn execute(instruction: u16) {
    PIO0.sm(SM).instr().write(|w| w.set_instr(instruction));
}

/// The state machine stands still from now on. Any level.
pub(super) fn halt() {
    // The other state machines are nobody's.
    PIO0.ctrl().write(|w| w.0 = 0);
}

fn run() {
    PIO0.ctrl().write(|w| w.0 = 1 << SM);
}

/// The channels whose chunks have gone to the FIFO since the last call, as bits.
pub(super) fn take_done() -> u32 {
    let done = DMA.ints(0).read() & 0b11;
    DMA.ints(0).write_value(done);
    done
}

/// Whether a marked word has ended since the last call.
pub(super) fn take_mark() -> bool {
    let marked = PIO0.irq().read().0 & MARKED != 0;
    if marked {
        PIO0.irq().write(|w| w.0 = MARKED);
    }
    marked
}

/// The next chunk, to be filled. The feeder.
pub(super) struct Chunk {
    number: u32,
    words: usize,
}

impl Chunk {
    pub(super) fn next() -> Self {
        Self { number: SENT.load(Relaxed), words: 0 }
    }

    /// How many words there is room for.
    pub(super) fn room(&self) -> usize {
        CHUNK - self.words
    }

    pub(super) fn is_empty(&self) -> bool {
        self.words == 0
    }

    fn slot(&self, word: usize) -> *mut u32 {
        // Inside the buffer: `word` is below `CHUNK`.
        (address(self.number) as *mut u32).wrapping_add(word)
    }

    /// Hands it to the DMA, behind the chunk that is sent if `follows`.
    pub(super) fn send(self, follows: bool) {
        let (own, other) = (self.number as usize % 2, (self.number as usize + 1) % 2);
        let start = address(self.number);
        let (channel, before) = (DMA.ch(own), DMA.ch(other));
        LENGTHS[self.number as usize % CHUNKS].store(self.words as u32, Relaxed);
        // The words are in memory before the DMA reads them.
        cortex_m::asm::dmb();
        mask(|| {
            channel.al1_ctrl().write_value(CONTROL | (own as u32) << CHAIN);
            channel.al1_read_addr().write_value(start);
            channel.al1_write_addr().write_value(PIO0.txf(SM).as_ptr() as u32);
            channel.trans_count().write_value(self.words as u32);
            SENT.store(self.number.wrapping_add(1), Relaxed);
            if STOPPED.load(Relaxed) {
                return;
            }
            run();
            if follows {
                before.al1_ctrl().write_value(CONTROL | (own as u32) << CHAIN);
                // It may have ended before it was told what follows.
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

impl Put for Chunk {
    fn put(&mut self, word: u32) {
        if self.words < CHUNK {
            // SAFETY: inside the chunk, which the DMA does not read now.
            unsafe { self.slot(self.words).write_volatile(word) };
            self.words += 1;
        }
    }

    fn change_last(&mut self, change: impl FnOnce(&mut u32)) {
        if self.words > 0 {
            let slot = self.slot(self.words - 1);
            // SAFETY: as in `put`.
            unsafe {
                let mut word = slot.read_volatile();
                change(&mut word);
                slot.write_volatile(word);
            }
        }
    }
}

/// How far words have been carried out right now. Any level. Cost: 60 cycles.
pub fn place() -> Place {
    let newest = SENT.load(Relaxed).wrapping_sub(1);
    let gone = |chunk: u32| {
        let read = DMA.ch(chunk as usize % 2).al1_read_addr().read();
        read.wrapping_sub(address(chunk)) / 4
    };
    let sent = match gone(newest) {
        0 => {
            let before = newest.wrapping_sub(1);
            Place { chunk: before, words: gone(before) }
        }
        words => Place { chunk: newest, words },
    };
    let waiting = PIO0.flevel().read().0 >> (8 * SM) & 0xF;
    let taken = PIO0.sm(SM).addr().read().addr() == TAKEN;
    back(sent, waiting + u32::from(taken))
}

/// So many words before a place.
fn back(place: Place, words: u32) -> Place {
    match place.words.checked_sub(words) {
        Some(words) => Place { words, ..place },
        None => {
            let chunk = place.chunk.wrapping_sub(1);
            let rest = words - place.words;
            Place { chunk, words: length(chunk).saturating_sub(rest) }
        }
    }
}

fn word(place: Place) -> u32 {
    let at = address(place.chunk) as *const u32;
    // SAFETY: inside the buffer; the feeder, which writes it, does not run meanwhile or calls this.
    unsafe { at.wrapping_add(place.words as usize % CHUNK).read_volatile() }
}

/// The steps of the words behind a place, backwards ones negative. The feeder, or while it cannot run.
pub(super) fn steps_behind(place: Place) -> [i32; MOTORS] {
    let before = if length(place.chunk) == 0 { 0 } else { word(back(place, 1)) };
    let mut count = Count::behind(super::words::pins_of(before));
    let (mut at, end) = (place, SENT.load(Relaxed));
    // Two chunks wait at most; the place may be in the two before them.
    for _ in 0..CHUNKS {
        if at.chunk == end {
            break;
        }
        for words in at.words..length(at.chunk) {
            count.add(word(Place { words, ..at }));
        }
        at = Place { chunk: at.chunk.wrapping_add(1), words: 0 };
    }
    count.steps
}

/// What has been sent and not carried out is gone; the steps of it. Step pins are low. While the feeder cannot run and no steps come.
pub(super) fn drop_words() -> [i32; MOTORS] {
    halt();
    // What is on its way to the FIFO arrives.
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
    // A change of this bit empties the FIFO.
    let sm = PIO0.sm(SM);
    for _ in 0..2 {
        sm.shiftctrl().modify(|w| w.set_fjoin_rx(!w.fjoin_rx()));
    }
    PIO0.ctrl().write(|w| w.set_sm_restart(1 << SM));
    execute(JMP_START);
    steps
}

/// Puts the pins out, while nothing else is sent.
pub(super) fn show(pins: u32) {
    PIO0.txf(SM).write_value(pins);
    run();
}
