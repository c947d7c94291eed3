//! The pulses of the spindle's sensors. Timer 5 counts the time, and the handlers in [`edges`](super::edges) record
//! it.
//!
//! Timer 5 counts in units of 4 us ([`Pulses`]) and stands still unless an encoder is set up. It has no interrupt:
//! the reader of [`SHARED`], which this module owns, knows the time since its last read, which must be less than 262
//! ms. A pulse is a falling edge of a pin that has not changed for `bounce` before. So a contact that bounces makes
//! one pulse; the end of a pulse, and noise right after another edge, make none. Times of edges have 16 bits as well,
//! so the reader marks a pin that has been still for longer than it bounces as `quiet`.
//!
//! With a second sync sensor an edge of the first one counts while the pin of the second one is high: a falling edge is
//! a pulse, a rising one takes a pulse back. Both edges are at one place of the mark, so a spindle that swings about
//! that place counts nothing.
//!
//! Each read costs 300 cycles, interrupts off for 20 of them. RAM: 20 bytes.

use core::cell::UnsafeCell;
use core::mem::offset_of;
use kerf_macros::small;

use super::{inputs, mask};
use crate::boards::ACTIVE;
use crate::capability::Capability;
use crate::encoder::Pulses;
use crate::hal::{Boot, Thread};

const TCCR5B: *mut u8 = 0x121 as *mut u8;
const TCNT5: *const u16 = 0x124 as *const u16;
/// A count each 64 cycles.
const RUN: u8 = 0b011;
/// A count at each rising edge of the pin T5: PL2, D47.
const EDGES: u8 = 0b111;

/// The state of one sensor. The assembly knows its layout.
#[repr(C)]
pub(super) struct Line {
    /// When its pin changed last, in counts.
    pub edge: u16,
    /// When its last pulse began, in counts.
    pub at: u16,
    /// The pulses on the line, modulo 2^16. With a second sync sensor, pulses of the way back are subtracted.
    pub count: u16,
    /// Not 0: the pin has been still for so long that `edge` may be ambiguous.
    pub quiet: u8,
}

/// The state that handlers and readers share.
#[repr(C)]
pub(super) struct Shared {
    lines: [Line; 2],
    /// The count of the sync sensor's pulses at the last pulse of the index.
    pub at_index: u16,
    /// How long a pin must have been still before a pulse, in counts.
    pub bounce: u16,
    /// The port of each sensor, as read at the last change of a pin.
    pub levels: [u8; 2],
    /// The sensors that are used, as bits.
    pub in_use: u8,
}

/// Offsets of the lines in [`Shared`].
pub(super) const LINES: [usize; 2] = {
    let first = offset_of!(Shared, lines);
    [first, first + size_of::<Line>()]
};

/// Holds [`Shared`].
#[repr(transparent)]
pub(super) struct Place(UnsafeCell<Shared>);

// SAFETY: handlers write it; a reader reads it volatile, and again if it has changed meanwhile. The other fields are
// set with interrupts off.
unsafe impl Sync for Place {}

const LINE: Line = Line { edge: 0, at: 0, count: 0, quiet: 1 };

pub(super) static SHARED: Place = Place(UnsafeCell::new(Shared {
    lines: [LINE; 2],
    at_index: 0,
    bounce: 0,
    levels: [0; 2],
    in_use: 0,
}));

/// Sets the pull-ups. On images without threads, the timer counts edges of a pin instead.
pub(super) fn start(_: &Boot) {
    if !Capability::Lathe.is_built_in() {
        // SAFETY: start-up; the timer's register is this module's.
        unsafe { TCCR5B.write_volatile(EDGES) };
    }
    if let Some(encoder) = ACTIVE.encoder
        && Capability::Lathe.is_built_in()
    {
        super::gpio::high(encoder.index);
        super::gpio::high(encoder.sync);
        if let Some(second) = encoder.second {
            super::gpio::high(second);
        }
    }
}

/// Returns the rising edges at D47 since the start, modulo 2^16; 0 on images with threads.
#[small]
pub fn at_counter(_: Thread) -> u16 {
    if Capability::Lathe.is_built_in() {
        return 0;
    }
    // SAFETY: on these images nobody else reads a 16-bit register of this timer, so nothing comes between its two bytes.
    unsafe { TCNT5.read_volatile() }
}

/// Sets which sensors are read from now on (bit 0 index, bit 1 sync, bit 2 the second sync sensor), and for how many
/// counts their contacts bounce.
#[inline(never)]
#[small]
pub fn set_up(thread: Thread, lines: u8, bounce: u16) {
    let shared = SHARED.0.get();
    // SAFETY: interrupts are off for each write; the timer's register is this module's.
    mask(|| unsafe { (&raw mut (*shared).bounce).write_volatile(bounce) });
    mask(|| unsafe {
        (&raw mut (*shared).in_use).write_volatile(lines);
        TCCR5B.write_volatile(if lines == 0 { 0 } else { RUN });
    });
    inputs::leave_out(
        thread,
        match lines {
            0 => 0,
            1 => const { ACTIVE.shared_inputs(1) },
            _ => const { ACTIVE.shared_inputs(3) },
        },
    );
}

/// Whether any sensor is read. Any level.
#[small]
pub fn in_use() -> u8 {
    // SAFETY: a single load.
    unsafe { (&raw const (*SHARED.0.get()).in_use).read_volatile() }
}

/// Returns the time now, in counts.
fn now() -> u16 {
    // SAFETY: the high byte is latched in a register of this timer, which handlers use as well; interrupts are off.
    mask(|| unsafe { TCNT5.read_volatile() })
}

/// Returns the pulses counted and timed so far. Any level.
#[inline(never)]
#[small]
pub fn read() -> Pulses {
    let shared = SHARED.0.get();
    // SAFETY: a field that a handler writes during the read is read again.
    let field = |at: *const u16| unsafe { at.read_volatile() };
    let mut pulses = Pulses::NONE;
    loop {
        // SAFETY: no reference is made, only pointers.
        let (index, sync, at_index) = unsafe {
            (
                &raw mut (*shared).lines[0],
                &raw mut (*shared).lines[1],
                &raw const (*shared).at_index,
            )
        };
        // SAFETY: as above.
        unsafe {
            pulses.index = field(&raw const (*index).count);
            pulses.sync = field(&raw const (*sync).count);
            pulses.index_at = field(&raw const (*index).at);
            pulses.sync_at = field(&raw const (*sync).at);
            pulses.at_index = field(at_index);
            if field(&raw const (*index).count) == pulses.index
                && field(&raw const (*sync).count) == pulses.sync
            {
                pulses.now = now();
                settle(index);
                settle(sync);
                return pulses;
            }
        }
    }
}

/// Marks a pin as quiet if it has been still for longer than it bounces. The time is read after the edge: an edge
/// later than the time would look like one of 262 ms ago.
///
/// # Safety
/// `line` points to one of the lines of [`SHARED`].
unsafe fn settle(line: *mut Line) {
    // SAFETY: as in `read`; `edge` and `quiet` belong together, so they are compared and set with interrupts off.
    unsafe {
        let edge = mask(|| (&raw const (*line).edge).read_volatile());
        let bounce = (&raw const (*SHARED.0.get()).bounce).read_volatile();
        if now().wrapping_sub(edge) >= bounce {
            mask(|| {
                if (&raw const (*line).edge).read_volatile() == edge {
                    (&raw mut (*line).quiet).write_volatile(1);
                }
            });
        }
    }
}
