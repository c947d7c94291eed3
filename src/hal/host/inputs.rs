//! Inputs on the host: tests set the levels, and the same filter samples them as on the chip.

use core::cell::{Cell, RefCell};

use super::{NEVER, encoder, flags, now, stepper};
use crate::boards::{ACTIVE, inputs};
use crate::dda::contact;
use crate::hal::event::Event;
use crate::hal::{Level, Thread};
use crate::switches::{FIRST_US, LATER_US, Next, SOON_US, Switches};

struct Inputs {
    /// Inputs whose pins are high.
    levels: Cell<u16>,
    switches: RefCell<Switches>,
    used: Cell<u16>,
    low: Cell<u16>,
    stops: Cell<u16>,
    spared: Cell<u8>,
    hits: Cell<u16>,
    armed: Cell<(u16, u16)>,
    fresh: Cell<bool>,
    next_sample: Cell<u64>,
}

machine_static! {
    fn all() -> Inputs = Inputs {
        levels: Cell::new(u16::MAX),
        switches: RefCell::new(Switches::new()),
        used: Cell::new(u16::MAX),
        low: Cell::new(0),
        stops: Cell::new(0),
        spared: Cell::new(0),
        hits: Cell::new(0),
        armed: Cell::new((0, 0)),
        fresh: Cell::new(true),
        next_sample: Cell::new(now() + cycles(LATER_US)),
    };
}

const fn cycles(us: u32) -> u64 {
    (us * (ACTIVE.clock_hz / 1_000_000)) as u64
}

/// Sets which inputs are active low, and which inputs stop the steps.
pub fn set_up(_: Thread, low: u16, stops: u16) {
    all().stops.set(stops);
    if all().low.replace(low) != low {
        all().fresh.set(true);
        edge();
    }
}

/// Leaves the pins of these inputs to an encoder from now on.
pub(super) fn leave_out(inputs: u16) {
    all().used.set(!inputs);
    all().fresh.set(true);
    edge();
}

/// Returns the inputs that are not read because an encoder uses their pins.
pub fn left_out() -> u16 {
    !all().used.get()
}

/// Sets the ends of axes that are not limits for now.
pub fn spare(_: Thread, ends: u8) {
    all().spared.set(ends);
}

/// Arms the end of a move: the first input of `armed` whose state becomes that in `awaited` ends the move
/// ([`contact`]). 0 disarms.
pub fn arm(_: Thread, armed: u16, awaited: u16) {
    all().armed.set((armed, awaited));
}

/// Returns the inputs that are active.
pub fn worked(_: Level) -> u16 {
    all().switches.borrow().worked()
}

/// Takes the inputs that have stopped the steps since the last call.
pub fn take_hits(_: Thread) -> u16 {
    all().hits.take()
}

/// Sets the level of an input's pin.
pub(super) fn set(input: usize, high: bool) {
    let pin = ACTIVE.inputs.get(input).copied().flatten();
    let same = |i: &usize| pin.is_some() && ACTIVE.inputs[*i] == pin;
    let bits = (0..inputs::COUNT).filter(same).fold(0, |bits, i| bits | 1 << i);
    if let Some(pin) = pin {
        encoder::drive(pin, high);
    }
    let before = all().levels.get();
    let after = if high { before | bits } else { before & !bits };
    if after != before {
        all().levels.set(after);
        edge();
    }
}

/// Plans the first sample after an edge, unless a sample is planned already.
fn edge() {
    if all().next_sample.get() == NEVER {
        all().next_sample.set(now() + cycles(FIRST_US));
    }
}

/// Returns when the next sample is due.
pub(super) fn next_sample() -> u64 {
    all().next_sample.get()
}

/// Takes a sample, at its time.
pub(super) fn sample() {
    let wired = (0..inputs::COUNT).filter(|i| ACTIVE.inputs[*i].is_some());
    let wired = wired.fold(0, |bits, i| bits | 1 << i);
    let i = all();
    let mut switches = i.switches.borrow_mut();
    let found = ((i.levels.get() & wired) ^ i.low.get()) & i.used.get();
    if i.fresh.take() {
        switches.adopt(found);
        flags::set(Event::Realtime);
    }
    let (changed, next) = switches.sample(found);
    if changed != 0 {
        let hits = changed & found & i.stops.get() & !u16::from(i.spared.get());
        if hits != 0 {
            stepper::stop();
            i.hits.set(i.hits.get() | hits);
        }
        let (armed, awaited) = i.armed.get();
        if changed & armed & !(found ^ awaited) != 0 {
            let (dda, tail) = stepper::moment();
            contact::mark(&dda, tail);
            contact::note();
            flags::set(Event::BlockDone);
        }
        flags::set(Event::Realtime);
    }
    i.next_sample.set(match next {
        Next::Edge => NEVER,
        Next::Soon => now() + cycles(SOON_US),
        Next::Later => now() + cycles(LATER_US),
    });
}
