//! Inputs: the switches' pins, with pull-ups.
//!
//! | interrupt | does |
//! |---|---|
//! | IO_IRQ_BANK0, priority 0 | an edge: a sample; edges of the encoder |
//! | TIMER_IRQ_1, priority 0 | a sample of all pins, as [`Switches`] wants it |
//!
//! While no switch moves none of them comes. A limit stops the steps right there, 9.4 us after its edge at most, of which 3 pass between the two samples. The place of a contact is where the
//! generator's words were at the first of two samples; the feeder works it out ([`stepper::contact`]).

use core::cell::UnsafeCell;

use embassy_rp::interrupt;
use embassy_rp::interrupt::{IO_IRQ_BANK0, InterruptExt, Priority};
use embassy_rp::pac::{IO_BANK0, TIMER};

use super::stepper::{self, Place};
use super::{encoder, flags, gpio, mask};
use crate::boards::ACTIVE;
use crate::hal::event::Event;
use crate::switches::{FIRST_US, LATER_US, Next, Switches};

/// From the first of two samples to the second: a limit stops the steps within 10 us of its edge.
const SOON_US: u32 = 3;
/// The alarm of the samples.
const ALARM: usize = 1;
/// An alarm that is due at once is missed if the time has passed before it is set.
const SOONEST_US: u32 = 2;
/// Edges of a pin among its four events: low and high edge.
const EDGES: u32 = 0b1100;

/// What sampling knows and is told.
struct State {
    switches: Switches,
    /// Those that are looked at: the pins of the others are an encoder's.
    used: u16,
    /// Low is worked.
    low: u16,
    /// What stops the steps.
    stops: u16,
    /// Those of them that have been hit.
    hits: u16,
    /// Ends that are no limits for now.
    spared: u8,
    /// Those that end a move, and what they must be for it.
    armed: u16,
    awaited: u16,
    /// Where the generator was at the first of two samples.
    place: Place,
    /// The next sample is to believe what it finds.
    fresh: bool,
    /// A sample is due.
    due: bool,
}

struct Shared(UnsafeCell<State>);

// SAFETY: the handlers of priority 0, which do not preempt each other, and others with interrupts off: see `with`.
unsafe impl Sync for Shared {}

static STATE: Shared = Shared(UnsafeCell::new(State {
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
}));

fn with<R>(act: impl FnOnce(&mut State) -> R) -> R {
    // SAFETY: interrupts are off.
    mask(|| act(unsafe { &mut *STATE.0.get() }))
}

impl State {
    /// The inputs that look worked.
    fn found(&self) -> u16 {
        (levels() ^ self.low) & self.used
    }

    /// Someone has to look in so many microseconds.
    fn plan(&mut self, us: u32) {
        self.due = true;
        let at = TIMER.timerawl().read().wrapping_add(us.max(SOONEST_US));
        TIMER.alarm(ALARM).write_value(at);
        // One that was set behind its time never comes: the code may have had to wait for the flash.
        if TIMER.timerawl().read().wrapping_sub(at) as i32 >= 0 {
            interrupt::TIMER_IRQ_1.pend();
        }
    }

    /// What is to be looked at like an edge.
    fn ask(&mut self) {
        if !self.due {
            self.plan(FIRST_US);
        }
    }
}

/// The inputs whose pins are high.
fn levels() -> u16 {
    let all = gpio::levels();
    let pins = ACTIVE.inputs.iter().enumerate();
    pins.fold(0, |bits, (i, pin)| match pin {
        Some(pin) => bits | u16::from(all & 1 << pin.bit != 0) << i,
        None => bits,
    })
}

/// Sets pins and interrupts up. Start-up.
pub(super) fn start() {
    ACTIVE.inputs.iter().flatten().for_each(|pin| gpio::pull_up(*pin));
    encoder::start();
    let switches = ACTIVE.inputs.iter().flatten().fold(0u32, |bits, pin| bits | 1 << pin.bit);
    for group in 0..4 {
        let watched = (switches | encoder::watched()) >> (8 * group) & 0xFF;
        let events = (0..8).filter(|pin| watched & 1 << pin != 0);
        let events = events.fold(0, |bits, pin| bits | EDGES << (4 * pin));
        IO_BANK0.intr(group).write(|w| w.0 = u32::MAX);
        IO_BANK0.int_proc(0).inte(group).write(|w| w.0 = events);
    }
    IO_IRQ_BANK0.set_priority(Priority::P0);
    interrupt::TIMER_IRQ_1.set_priority(Priority::P0);
    TIMER.inte().modify(|w| w.set_alarm(ALARM, true));
    with(|state| state.plan(LATER_US));
    // SAFETY: what the handlers touch is there.
    unsafe {
        IO_IRQ_BANK0.enable();
        interrupt::TIMER_IRQ_1.enable();
    }
}

/// IO_IRQ_BANK0.
pub(super) extern "C" fn edges() {
    let mut changed = 0;
    for group in 0..4 {
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

/// A sample.
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
        // An edge that came before this sample has been seen by it; one that comes later asks again.
        Next::Edge if state.found() == now => {}
        Next::Edge => state.ask(),
        Next::Soon => state.plan(SOON_US),
        Next::Later => state.plan(LATER_US),
    }
}

/// Which inputs are worked when low, and which of them stop the steps. Thread mode.
pub fn set_up(low: u16, stops: u16) {
    with(|state| {
        state.stops = stops;
        if core::mem::replace(&mut state.low, low) != low {
            state.fresh = true;
            state.ask();
        }
    });
}

/// The pins of these inputs are an encoder's from now on. Thread mode.
pub(super) fn leave_out(inputs: u16) {
    with(|state| {
        (state.used, state.fresh) = (!inputs, true);
        state.ask();
    });
}

/// Those inputs. Thread mode.
pub fn left_out() -> u16 {
    with(|state| !state.used)
}

/// These ends are no limits for now. Thread mode.
pub fn spare(ends: u8) {
    with(|state| state.spared = ends);
}

/// Has the first of the inputs `armed` that comes to be as in `awaited` end the move
/// ([`contact`](crate::dda::contact)); none if `armed` is 0. Thread mode.
pub fn arm(armed: u16, awaited: u16) {
    with(|state| (state.armed, state.awaited) = (armed, awaited));
}

/// The inputs that are worked. Thread mode.
pub fn worked() -> u16 {
    with(|state| state.switches.worked())
}

/// What has stopped the steps since the last call. Thread mode.
pub fn take_hits() -> u16 {
    with(|state| core::mem::take(&mut state.hits))
}
