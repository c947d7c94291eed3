//! Inputs: the switches' pins, with pull-ups.
//!
//! | interrupt | does |
//! |---|---|
//! | IO_IRQ_BANK0, priority 0 | takes a sample at an edge of a switch; passes edges of the encoder on |
//! | TIMER_IRQ_1, priority 0 | takes a sample of all pins, when [`Switches`] asks for one |
//!
//! While no switch changes, none of these interrupts comes. From an edge to the sample that finds no change, edges of
//! switches raise no interrupt, because only samples count: noise of any frequency costs a sample or two each 125 us,
//! 3 % of the CPU, and the feeder is not late. At a limit the sample itself stops the steps, at most 9.4
//! us after the edge, of which 3 us pass between two samples. A contact is recorded as the position in the generator's
//! words at the first of two samples; the feeder computes the motor position from it ([`stepper::contact`]).

use core::cell::UnsafeCell;

use embassy_rp::interrupt;
use embassy_rp::interrupt::{IO_IRQ_BANK0, InterruptExt, Priority};
use embassy_rp::pac::{IO_BANK0, TIMER};

use super::stepper::{self, Place};
use super::{encoder, flags, gpio, mask};
use crate::boards::{ACTIVE, inputs};
use crate::hal::event::Event;
use crate::hal::{Boot, Level, Thread};
use crate::switches::{FIRST_US, LATER_US, Next, Switches};

/// Time from the first of two samples to the second. A limit stops the steps within 10 us of its edge.
const SOON_US: u32 = 3;
/// The number of the alarm that times the samples.
const ALARM: usize = 1;
/// Shortest time to an alarm: an alarm never comes if its time has passed before it is set.
const SOONEST_US: u32 = 2;
/// Groups of eight pins, each with a register for their events.
const GROUPS: usize = 4;
/// Bits of a pin's four events that are edges: falling and rising.
const EDGES: u32 = 0b1100;

/// The pin of each input as a bit; 0 for none.
const PINS: [u32; inputs::COUNT] = {
    let (mut pins, mut i) = ([0; inputs::COUNT], 0);
    while i < inputs::COUNT {
        if let Some(pin) = ACTIVE.inputs[i] {
            pins[i] = 1 << pin.bit;
        }
        i += 1;
    }
    pins
};

/// The state of sampling, and its parameters from thread mode.
struct State {
    /// [`PINS`], which are here to be in RAM: a limit would have to wait for flash.
    pins: [u32; inputs::COUNT],
    switches: Switches,
    /// Inputs that are read, as bits. The pins of the others belong to an encoder.
    used: u16,
    /// Inputs that are active low.
    low: u16,
    /// Inputs that stop the steps.
    stops: u16,
    /// Inputs that have stopped the steps since [`take_hits`] took them last.
    hits: u16,
    /// Ends of axes that are ignored as limits for now.
    spared: u8,
    /// Inputs that end a move, and in `awaited` the state of each that ends it.
    armed: u16,
    awaited: u16,
    /// Where the generator was at the first of two samples.
    place: Place,
    /// The next sample is adopted without being filtered.
    fresh: bool,
    /// A sample is due.
    due: bool,
    /// The events of each group of eight pins that are edges of switches.
    events: [u32; GROUPS],
    /// Edges of switches raise no interrupt.
    deaf: bool,
}

struct Shared(UnsafeCell<State>);

// SAFETY: only the handlers of priority 0, which do not preempt each other, and others with interrupts off use it:
// see `with`.
unsafe impl Sync for Shared {}

static STATE: Shared = Shared(UnsafeCell::new(State {
    pins: PINS,
    switches: Switches::new(),
    used: u16::MAX,
    low: 0,
    stops: 0,
    hits: 0,
    spared: 0,
    armed: 0,
    awaited: 0,
    place: Place::NONE,
    fresh: true,
    due: false,
    events: [0; GROUPS],
    deaf: false,
}));

fn with<R>(act: impl FnOnce(&mut State) -> R) -> R {
    // SAFETY: interrupts are off.
    mask(|| act(unsafe { &mut *STATE.0.get() }))
}

impl State {
    /// Returns the inputs that look active now.
    fn found(&self) -> u16 {
        let all = gpio::levels();
        let high = |(i, pin): (usize, &u32)| u16::from(all & pin != 0) << i;
        let levels = self.pins.iter().enumerate().map(high).fold(0, |bits, bit| bits | bit);
        (levels ^ self.low) & self.used
    }

    /// Has edges of switches raise an interrupt, or no more. What has happened before raises none.
    fn hear(&mut self, on: bool) {
        if core::mem::replace(&mut self.deaf, !on) != on {
            return;
        }
        for (group, events) in self.events.iter().copied().enumerate().filter(|(_, e)| *e != 0) {
            let enabled = IO_BANK0.int_proc(0).inte(group);
            if on {
                IO_BANK0.intr(group).write(|w| w.0 = events);
                enabled.modify(|w| w.0 |= events);
            } else {
                enabled.modify(|w| w.0 &= !events);
            }
        }
    }

    /// Plans a sample in `us` microseconds.
    fn plan(&mut self, us: u32) {
        self.due = true;
        self.hear(false);
        let at = TIMER.timerawl().read().wrapping_add(us.max(SOONEST_US));
        TIMER.alarm(ALARM).write_value(at);
        // An alarm that is set after its time never comes, which may happen because the code had to wait for the
        // flash.
        if TIMER.timerawl().read().wrapping_sub(at) as i32 >= 0 {
            interrupt::TIMER_IRQ_1.pend();
        }
    }

    /// Plans the first sample after an edge, unless a sample is planned already.
    fn ask(&mut self) {
        if !self.due {
            self.plan(FIRST_US);
        }
    }
}

/// Sets up the pins and the interrupts.
pub(super) fn start(boot: &Boot) {
    ACTIVE.inputs.iter().flatten().for_each(|pin| gpio::pull_up(*pin));
    encoder::start(boot);
    let switches = ACTIVE.inputs.iter().flatten().fold(0u32, |bits, pin| bits | 1 << pin.bit);
    let own = switches & !encoder::watched();
    for group in 0..GROUPS {
        let events = events_of(own | encoder::watched(), group);
        IO_BANK0.intr(group).write(|w| w.0 = u32::MAX);
        IO_BANK0.int_proc(0).inte(group).write(|w| w.0 = events);
    }
    with(|state| state.events = core::array::from_fn(|group| events_of(own, group)));
    IO_IRQ_BANK0.set_priority(Priority::P0);
    interrupt::TIMER_IRQ_1.set_priority(Priority::P0);
    TIMER.inte().modify(|w| w.set_alarm(ALARM, true));
    with(|state| state.plan(LATER_US));
    // SAFETY: everything that the handlers touch has been set up.
    unsafe {
        IO_IRQ_BANK0.enable();
        interrupt::TIMER_IRQ_1.enable();
    }
}

/// Returns the events of a group that are edges of these pins.
fn events_of(pins: u32, group: usize) -> u32 {
    let own = pins >> (8 * group) & 0xFF;
    (0..8).filter(|pin| own & 1 << pin != 0).fold(0, |bits, pin| bits | EDGES << (4 * pin))
}

/// The handler of IO_IRQ_BANK0.
pub(super) extern "C" fn edges() {
    let mut changed = 0;
    for group in 0..GROUPS {
        let events = IO_BANK0.int_proc(0).ints(group).read().0;
        if events != 0 {
            IO_BANK0.intr(group).write(|w| w.0 = events);
            let pins = (0..8).filter(|pin| events & EDGES << (4 * pin) != 0);
            changed |= pins.fold(0, |bits, pin| bits | 1u32 << (8 * group as u32 + pin));
        }
    }
    if changed & encoder::watched() != 0 {
        encoder::edges(changed);
    }
    if changed & !encoder::watched() != 0 {
        with(|state| {
            if !state.due {
                sample(state);
            }
        });
    }
}

/// Takes a sample, when the alarm says so.
#[interrupt]
fn TIMER_IRQ_1() {
    TIMER.intr().write(|w| w.set_alarm(ALARM, true));
    with(sample);
}

fn sample(state: &mut State) {
    state.due = false;
    let now = state.found();
    if core::mem::replace(&mut state.fresh, false) {
        state.switches.adopt(now);
        flags::set(Event::Realtime);
    }
    if state.armed != 0 && state.switches.changed(now) == 0 && state.switches.is_news(now) {
        state.place = stepper::place();
    }
    let (changed, next) = state.switches.sample(now);
    if changed != 0 {
        let hits = changed & now & state.stops & !u16::from(state.spared);
        if hits != 0 {
            stepper::stop();
            state.hits |= hits;
        }
        if changed & state.armed & !(now ^ state.awaited) != 0 {
            stepper::contact(state.place);
        }
        flags::set(Event::Realtime);
    }
    match next {
        Next::Edge => {
            state.hear(true);
            // This sample includes all edges before it; a later edge plans another sample.
            if state.found() != now {
                state.ask();
            }
        }
        Next::Soon => state.plan(SOON_US),
        Next::Later => state.plan(LATER_US),
    }
}

/// Sets which inputs are active low, and which inputs stop the steps.
pub fn set_up(_: Thread, low: u16, stops: u16) {
    with(|state| {
        state.stops = stops;
        if core::mem::replace(&mut state.low, low) != low {
            state.fresh = true;
            state.ask();
        }
    });
}

/// Gives the pins of these inputs to an encoder from now on.
pub(super) fn leave_out(_: Thread, inputs: u16) {
    with(|state| {
        (state.used, state.fresh) = (!inputs, true);
        state.ask();
    });
}

/// Returns the inputs that are not read because an encoder uses their pins. Any level.
pub fn left_out() -> u16 {
    with(|state| !state.used)
}

/// Sets the ends of axes that are ignored as limits for now, and with them the ends at the same pins.
pub fn spare(_: Thread, ends: u8) {
    let ends = ACTIVE.ends_beside(ends);
    with(|state| state.spared = ends);
}

/// Arms the end of a move: the first input of `armed` whose state becomes that in `awaited` ends the move
/// ([`contact`](crate::dda::contact)). 0 disarms.
pub fn arm(_: Thread, armed: u16, awaited: u16) {
    with(|state| (state.armed, state.awaited) = (armed, awaited));
}

/// Returns the inputs that are active.
pub fn worked(_: Level) -> u16 {
    with(|state| state.switches.worked())
}

/// Takes the inputs that have stopped the steps since the last call.
pub fn take_hits(_: Thread) -> u16 {
    with(|state| core::mem::take(&mut state.hits))
}
