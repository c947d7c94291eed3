//! The pulses of the spindle's sensors: the handler of edges ([`super::inputs`]) records their times, in counts of 4
//! us.
//!
//! A pulse is a falling edge of a pin that has not changed for `bounce` before, so that a contact that bounces makes
//! one pulse. A read has interrupts off for some cycles.

use core::cell::UnsafeCell;

use embassy_rp::pac::TIMER;

use super::{gpio, inputs, mask};
use crate::boards::{ACTIVE, Pin};
use crate::capability::Capability;
use crate::encoder::Pulses;
use crate::hal::{Boot, Thread};

/// The state that the handler and readers share.
struct State {
    pulses: Pulses,
    in_use: u8,
    /// How long contacts bounce, in counts.
    bounce: u16,
    /// When each pin changed last, in counts.
    edges: [u32; 2],
}

struct Shared(UnsafeCell<State>);

// SAFETY: only the handler of edges, which nothing of ours preempts, and others with interrupts off use it: see
// `with`.
unsafe impl Sync for Shared {}

static STATE: Shared =
    Shared(UnsafeCell::new(State { pulses: Pulses::NONE, in_use: 0, bounce: 0, edges: [0; 2] }));

fn with<R>(act: impl FnOnce(&mut State) -> R) -> R {
    // SAFETY: interrupts are off.
    mask(|| act(unsafe { &mut *STATE.0.get() }))
}

/// Returns the counts of 4 us since start-up.
fn counts() -> u32 {
    TIMER.timerawl().read() / 4
}

/// Returns the pins of the sensors, index first; `None` if the image cannot use them.
fn pins() -> Option<[Pin; 2]> {
    let encoder = ACTIVE.encoder.filter(|_| Capability::Lathe.is_built_in())?;
    Some([encoder.index, encoder.sync])
}

/// Sets the pull-ups.
pub(super) fn start(_: &Boot) {
    pins().into_iter().flatten().for_each(gpio::pull_up);
}

/// Returns the pins whose edges are a sensor's, as bits of their numbers.
pub(super) fn watched() -> u32 {
    pins().into_iter().flatten().fold(0, |bits, pin| bits | 1 << pin.bit)
}

/// Sets which sensors are read from now on (bit 0 index, bit 1 sync), and for how many counts their contacts bounce.
pub fn set_up(thread: Thread, lines: u8, bounce: u16) {
    with(|state| (state.in_use, state.bounce) = (lines, bounce));
    inputs::leave_out(thread, ACTIVE.shared_inputs(lines));
}

/// Returns which sensors are read, as bits of [`set_up`]; 0 without an encoder. Any level.
pub fn in_use() -> u8 {
    with(|state| state.in_use)
}

/// Returns the pulses counted and timed so far. Any level.
pub fn read() -> Pulses {
    with(|state| Pulses { now: counts() as u16, ..state.pulses })
}

/// Returns 0: there is no counter.
pub fn at_counter(_: Thread) -> u16 {
    0
}

/// Records edges at pins, as bits of their numbers. The handler of edges.
pub(super) fn edges(changed: u32) {
    let Some(pins) = pins() else { return };
    let levels = gpio::levels();
    for (line, pin) in pins.into_iter().enumerate() {
        if changed & 1 << pin.bit != 0 {
            edge(line, levels & 1 << pin.bit != 0);
        }
    }
}

fn edge(line: usize, high: bool) {
    let at = counts();
    with(|state| {
        let still = at.wrapping_sub(core::mem::replace(&mut state.edges[line], at));
        if high || state.in_use & 1 << line == 0 || still < u32::from(state.bounce) {
            return;
        }
        let pulses = &mut state.pulses;
        if line == 0 {
            pulses.index = pulses.index.wrapping_add(1);
            (pulses.index_at, pulses.at_index) = (at as u16, pulses.sync);
        } else {
            pulses.sync = pulses.sync.wrapping_add(1);
            pulses.sync_at = at as u16;
        }
    });
}
