//! Inputs: the switches' pins, with pull-ups.
//!
//! | interrupt | does | cycles |
//! |---|---|---|
//! | INT0 to INT7, PCINT0 to PCINT2 (`edges`) | starts the timer of the samples, because a switch may have moved | 20, interrupts off |
//! | TIMER2_COMPA, of printers TIMER3_COMPA | takes a sample of all pins, when [`Switches`] asks for one | 300, interrupts off for 26 and 26 |
//!
//! The timer is timer 2; in an image that can print it is timer 3, because timer 2 then makes the pulses of heaters
//! ([`heaters`](super::heaters)).
//!
//! While no switch changes, none of these interrupts comes. The sampling interrupt lets in all interrupts except itself
//! and exec, which would run far too long inside it. When a limit is hit, this interrupt itself stops the steps: 20 us
//! after the edge, plus its own 300 cycles, for which it competes with the step interrupt. The total is 28 to 62 us at
//! 50,000 steps a second, and 120 us at 85,000, where the step interrupt leaves it a sixth of the CPU. The position of a
//! probe's contact is that at the first of two samples, 20 us after the edge: a fifth of a step at 10,000 steps a
//! second.

use core::arch::asm;
use core::cell::UnsafeCell;

use avr_embassy::assembly;

use super::{flags, stepper};
use crate::boards::{ACTIVE, Interrupt, LOOKS, inputs};
use crate::dda::contact;
use crate::hal::event::Event;
use crate::hal::{Boot, Level, Thread};
use crate::switches::{FIRST_US, LATER_US, Next, SOON_US, Switches};

const _: () = {
    let looks = LOOKS as u8;
    assert!(
        ACTIVE.step_timer as u8 != looks && ACTIVE.tick_timer as u8 != looks,
        "the timer of the samples at the switches is used twice"
    );
    if let Some(pwm) = ACTIVE.pwm {
        assert!(pwm.timer as u8 != looks, "the timer of the samples at the switches is used twice");
    }
};

const EICRA: *mut u8 = 0x69 as *mut u8;
const EICRB: *mut u8 = 0x6A as *mut u8;
const EIMSK: *mut u8 = 0x3D as *mut u8;
const PCICR: *mut u8 = 0x68 as *mut u8;
const PCMSK: [*mut u8; 3] = [0x6B as *mut u8, 0x6C as *mut u8, 0x6D as *mut u8];
/// Timer 2 has 8 bits, timer 3 has 16. All values that are written to a count fit 8 bits.
#[cfg(not(feature = "printer"))]
mod timer {
    pub const CONTROL_A: *mut u8 = 0xB0 as *mut u8;
    pub const CONTROL_B: *mut u8 = 0xB1 as *mut u8;
    pub const COUNT: *mut u8 = 0xB2 as *mut u8;
    pub const COMPARE: *mut u8 = 0xB3 as *mut u8;
    pub const MASK: usize = 0x70;
    /// Clear on compare match, which the two timers select in different registers; a count each 8 cycles.
    pub const CTC: u8 = 1 << 1;
    pub const RUN: u8 = 1 << 1;
}
#[cfg(feature = "printer")]
mod timer {
    pub const CONTROL_A: *mut u8 = 0x90 as *mut u8;
    pub const CONTROL_B: *mut u8 = 0x91 as *mut u8;
    pub const COUNT: *mut u16 = 0x94 as *mut u16;
    pub const COMPARE: *mut u16 = 0x98 as *mut u16;
    pub const MASK: usize = 0x71;
    /// See the module above, for timer 2.
    pub const CTC: u8 = 0;
    pub const RUN: u8 = 1 << 3 | 1 << 1;
}
use timer::{COMPARE, CONTROL_A, CONTROL_B, COUNT, CTC, MASK, RUN};

/// Starts the timer: the address of a register, and the value to write.
pub(super) const START: usize = if cfg!(feature = "printer") { 0x91 } else { 0xB1 };
pub(super) const STARTED: u8 = RUN;
/// Enables the interrupt at the compare value.
const OCIE: u8 = 1 << 1;

/// Returns the last count of a period of `us` microseconds.
const fn top(us: u32) -> u8 {
    (us * (ACTIVE.clock_hz / 1_000_000) / 8 - 1) as u8
}

/// The interrupts to enable: the values of EIMSK and of the PCMSK registers.
pub(super) const MASKS: (u8, [u8; 3]) = {
    let (mut external, mut change) = (0, [0; 3]);
    let mut i = 0;
    while i < inputs::COUNT + 2 {
        let pin = match ACTIVE.encoder {
            _ if i < inputs::COUNT => ACTIVE.inputs[i],
            Some(encoder) if i == inputs::COUNT => Some(encoder.index),
            Some(encoder) => Some(encoder.sync),
            None => None,
        };
        if let Some(pin) = pin {
            match pin.interrupt() {
                Some(Interrupt::External(n)) => external |= 1 << n,
                Some(Interrupt::PinChange(n)) => change[n as usize / 8] |= 1 << (n % 8),
                Some(Interrupt::Gpio(_)) | None => {}
            }
        }
        i += 1;
    }
    (external, change)
};

/// Repeats code for each input of the board, with its pin as a constant.
macro_rules! each_input {
    ($i:ident, $pin:ident => $body:expr) => {
        each_input!(@ $i, $pin, $body, 0 1 2 3 4 5 6 7 8 9 10)
    };
    (@ $i:ident, $pin:ident, $body:expr, $($n:literal)+) => {$(
        if let Some($pin) = const { ACTIVE.inputs[$n] } {
            #[allow(dead_code)]
            const $i: usize = $n;
            $body
        }
    )+};
}

/// The state of the sampling interrupt, and its parameters from thread mode.
struct State {
    switches: Switches,
    /// Inputs that are read, as bits. The pins of the others belong to an encoder.
    used: u16,
    /// Inputs that are active low.
    low: u16,
    /// Inputs that stop the steps.
    stops: u16,
    /// Inputs that have stopped the steps since [`take_hits`] took them last.
    hits: u16,
    /// `stops` without the ends that are ignored for now.
    live: u16,
    spared: u8,
    /// Inputs that end a move, and in `awaited` the state of each that ends it.
    armed: u16,
    awaited: u16,
    /// The next sample is adopted without being filtered.
    fresh: bool,
}

impl State {
    /// Returns the inputs that look active now.
    #[inline(always)]
    fn found(&self) -> u16 {
        (levels() ^ self.low) & self.used
    }
}

struct Shared(UnsafeCell<State>);

// SAFETY: only two use it: the sampling interrupt, which does not nest, and tasks with interrupts off, see `with`.
unsafe impl Sync for Shared {}

static STATE: Shared = Shared(UnsafeCell::new(State {
    switches: Switches::new(),
    used: u16::MAX,
    low: 0,
    stops: 0,
    live: 0,
    spared: 0,
    hits: 0,
    armed: 0,
    awaited: 0,
    fresh: true,
}));

/// Gives a task access to the state. Each access takes a few cycles, with interrupts off.
fn with<R>(_: Level, what: impl FnOnce(&mut State) -> R) -> R {
    // SAFETY: interrupts are off, and no sample is under way while a task runs, as `Level` shows.
    avr_device::interrupt::free(|_| what(unsafe { &mut *STATE.0.get() }))
}

/// Sets up the pins and the interrupts.
pub fn start(boot: &Boot) {
    each_input!(I, pin => super::gpio::high(pin));
    super::encoder::start(boot);
    let (external, change) = MASKS;
    // SAFETY: start-up; nobody else uses these registers.
    unsafe {
        // Any edge of any INT.
        EICRA.write_volatile(0b0101_0101);
        EICRB.write_volatile(0b0101_0101);
        EIMSK.write_volatile(external);
        for (register, mask) in PCMSK.into_iter().zip(change) {
            register.write_volatile(mask);
        }
        PCICR.write_volatile(0b111);
        CONTROL_A.write_volatile(CTC);
        COMPARE.write_volatile(top(LATER_US).into());
        (MASK as *mut u8).write_volatile(OCIE);
        CONTROL_B.write_volatile(RUN);
    }
}

/// Sets which inputs are active low, and which inputs stop the steps.
pub fn set_up(thread: Thread, low: u16, stops: u16) {
    with(thread.level(), |state| {
        state.stops = stops;
        state.live = stops & !u16::from(state.spared);
    });
    // In two pieces, so that a step waits for 31 cycles at most.
    with(thread.level(), |state| {
        if state.low != low {
            (state.low, state.fresh) = (low, true);
            // SAFETY: starts a sample; if one is due already, it serves as well.
            unsafe { CONTROL_B.write_volatile(RUN) };
        }
    });
}

/// Gives the pins of these inputs to an encoder from now on.
pub(super) fn leave_out(thread: Thread, inputs: u16) {
    with(thread.level(), |state| {
        (state.used, state.fresh) = (!inputs, true);
        // SAFETY: starts a sample; if one is due already, it serves as well.
        unsafe { CONTROL_B.write_volatile(RUN) };
    });
}

/// Returns the inputs that are not read because an encoder uses their pins. Any level.
pub fn left_out() -> u16 {
    // SAFETY: a plain read, with interrupts off.
    avr_device::interrupt::free(|_| unsafe { !(&raw const (*STATE.0.get()).used).read() })
}

/// Sets the ends of axes that are ignored as limits for now.
pub fn spare(thread: Thread, ends: u8) {
    with(thread.level(), |state| {
        state.spared = ends;
        state.live = state.stops & !u16::from(ends);
    });
}

/// Arms the end of a move: the first input of `armed` whose state becomes that in `awaited` ends the move
/// ([`contact`](crate::dda::contact)). 0 disarms.
pub fn arm(thread: Thread, armed: u16, awaited: u16) {
    with(thread.level(), |state| (state.armed, state.awaited) = (armed, awaited));
}

/// Returns the inputs that are active.
pub fn worked(level: Level) -> u16 {
    with(level, |state| state.switches.worked())
}

/// Takes the inputs that have stopped the steps since the last call.
pub fn take_hits(thread: Thread) -> u16 {
    with(thread.level(), |state| core::mem::take(&mut state.hits))
}

/// Returns the inputs whose pins are high.
#[inline(never)]
fn levels() -> u16 {
    // In bytes, because shifts of words take long.
    let mut bytes = [0; 2];
    each_input!(I, pin => {
        let register = (pin.port.address() - 2) as *const u8;
        // SAFETY: reading an input register has no effect.
        if unsafe { register.read_volatile() } & 1 << pin.bit != 0 {
            bytes[I / 8] |= 1 << (I % 8);
        }
    });
    u16::from_le_bytes(bytes)
}

/// Waits until [`SOON_US`] after the interrupt was due. The second sample comes so soon that another interrupt would
/// cost more than the wait.
fn wait() {
    // SAFETY: the timer belongs to this interrupt; it has counted from 0 since the interrupt was due.
    unsafe {
        COMPARE.write_volatile(u8::MAX.into());
        while COUNT.read_volatile() < top(SOON_US).into() {}
    }
}

/// Records a possible contact. Out of line: its registers would have to be saved on every sample, and a limit has no
/// time for that.
#[cold]
#[inline(never)]
fn mark() {
    let (dda, tail) = stepper::moment();
    contact::mark(&dda, tail);
}

/// Takes a sample, and a second one if something has changed.
extern "C" fn sample() {
    // SAFETY: the sampling interrupt, which does not nest, runs this alone.
    let state = unsafe { &mut *STATE.0.get() };
    let mut now = state.found();
    if core::mem::replace(&mut state.fresh, false) {
        state.switches.adopt(now);
        flags::set(Event::Realtime);
    }
    if state.switches.is_news(now) {
        state.switches.note(now);
        // Recorded first, close to the edge, because the remaining work takes long while the step interrupt is busy.
        if state.armed != 0 {
            mark();
        }
        wait();
        now = state.found();
        // Done before anything else, because the step interrupt leaves only two cycles in five.
        if state.switches.changed(now) & now & state.live != 0 {
            stepper::stop();
        }
    }
    let (changed, next) = state.switches.sample(now);
    if changed != 0 {
        let hits = changed & now & state.live;
        if hits != 0 {
            stepper::stop();
            state.hits |= hits;
        }
        if changed & state.armed & !(now ^ state.awaited) != 0 {
            contact::note();
            flags::set(Event::BlockDone);
        }
        flags::set(Event::Realtime);
    }
    plan(next);
    // An edge that came before the timer was stopped has not started it.
    if next == Next::Edge && state.found() != now {
        // SAFETY: starts a sample.
        unsafe { CONTROL_B.write_volatile(RUN) };
    }
}

/// Sets the timer for the next sample.
fn plan(next: Next) {
    // SAFETY: these registers belong to the sampling interrupt; other code only starts the timer.
    unsafe {
        if next == Next::Edge {
            CONTROL_B.write_volatile(0);
        }
        // The compare value is written before the count, because a count past its top would first run to its maximum.
        let top = match next {
            Next::Edge => top(FIRST_US),
            Next::Soon => top(SOON_US),
            Next::Later => top(LATER_US),
        };
        COMPARE.write_volatile(top.into());
        COUNT.write_volatile(0);
    }
}

/// TIMER2_COMPA or TIMER3_COMPA: runs a sample, with interrupts on and exec held off.
#[cfg_attr(not(feature = "printer"), unsafe(export_name = "__vector_13"))]
#[cfg_attr(feature = "printer", unsafe(export_name = "__vector_32"))]
extern "C" fn look_is_due() -> ! {
    // SAFETY: it restores what it changes and what a called function may change, and returns by `reti`. Its own
    // source is off, so it does not nest. It changes `CLOSED` as `exec::lock` does, and leaves it closed if it was
    // closed already.
    unsafe {
        asm!(
            "push r24",
            "push r25",
            "in   r24, 0x3F",
            "push r24",
            "ldi  r24, 0",
            "sts  {mask}, r24",
            "lds  r25, {closed}",
            "ldi  r24, 1",
            "sts  {closed}, r24",
            "sei",
            "push r25",
            "push r0",
            "push r1",
            "push r18",
            "push r19",
            "push r20",
            "push r21",
            "push r22",
            "push r23",
            "push r26",
            "push r27",
            "push r30",
            "push r31",
            "clr  r1",
            "call {sample}",
            "pop  r31",
            "pop  r30",
            "pop  r27",
            "pop  r26",
            "pop  r23",
            "pop  r22",
            "pop  r21",
            "pop  r20",
            "pop  r19",
            "pop  r18",
            "pop  r1",
            "pop  r0",
            "pop  r25",
            // Lets exec in again if it was let in before. Only after samples may come again, because exec runs for
            // milliseconds.
            "ldi  r24, {unmask}",
            "tst  r25",
            "brne 1f",
            "cli",
            "sts  {mask}, r24",
            "sts  {closed}, r25",
            "lds  r24, {missed}",
            "tst  r24",
            "breq 2f",
            "sts  {missed}, r25",
            "ldi  r24, {pended}",
            "sts  {pend}, r24",
            "2:",
            "pop  r24",
            "out  0x3F, r24",
            "pop  r25",
            "pop  r24",
            "reti",
            // Restores the value: the tick counts `CLOSED` up while exec runs.
            "1:",
            "cli",
            "sts  {mask}, r24",
            "sts  {closed}, r25",
            "rjmp 2b",
            closed = sym assembly::CLOSED,
            missed = sym assembly::MISSED,
            pend = const assembly::PEND,
            pended = const assembly::PENDED,
            mask = const MASK,
            unmask = const OCIE,
            sample = sym sample,
            options(noreturn),
        );
    }
}
