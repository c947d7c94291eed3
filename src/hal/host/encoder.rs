//! The sensors of the spindle on the host. Edges come from tests or from a turning spindle, and become the same
//! pulses as on the chip.

use core::cell::Cell;

use super::{NEVER, inputs, now};
use crate::boards::{ACTIVE, Pin};
use crate::encoder::Pulses;
use crate::hal::Thread;

/// CPU cycles in a count.
const COUNT: u64 = 64;

struct Sensors {
    pulses: Cell<Pulses>,
    in_use: Cell<u8>,
    /// How long contacts bounce, in counts.
    bounce: Cell<u16>,
    /// The level of each pin, and when it changed last, in cycles.
    levels: Cell<[(bool, u64); 2]>,
    /// The level of the second pin of sync.
    second: Cell<bool>,
}

/// A spindle that turns by itself.
#[derive(Clone, Copy)]
struct Turning {
    /// Cycles from an edge to the next; 0 while the spindle stands.
    half: u64,
    /// The spindle turns backwards.
    reversed: bool,
    /// Pulses of sync in a turn; with 1 only the index is read.
    per_turn: u16,
    /// Edges so far in this turn.
    edges: u16,
    next: u64,
}

machine_static! {
    fn turning() -> Cell<Turning> =
        Cell::new(Turning { half: 0, reversed: false, per_turn: 1, edges: 0, next: NEVER });
    fn all() -> Sensors = Sensors {
        pulses: Cell::new(Pulses::NONE),
        in_use: Cell::new(0),
        bounce: Cell::new(0),
        levels: Cell::new([(true, 0); 2]),
        second: Cell::new(true),
    };
}

/// Sets which sensors are read from now on (bit 0 index, bit 1 sync, bit 2 the second sync sensor), and for how many
/// counts their contacts bounce.
pub fn set_up(_: Thread, lines: u8, bounce: u16) {
    all().in_use.set(lines);
    all().bounce.set(bounce);
    inputs::leave_out(ACTIVE.shared_inputs(lines));
}

/// Returns 0: there is no counter.
pub fn at_counter(_: Thread) -> u16 {
    0
}

/// Whether any sensor is read.
pub fn in_use() -> u8 {
    all().in_use.get()
}

/// Returns the pulses counted and timed so far.
pub fn read() -> Pulses {
    Pulses { now: (now() / COUNT) as u16, ..all().pulses.get() }
}

/// Turns the spindle at `rpm` turns a minute from now on, with `per_turn` pulses of sync in each turn; backwards
/// below 0.
pub(super) fn turn(rpm: f64, per_turn: u16) {
    let per_turn = per_turn.max(1);
    let edges = rpm.abs() * f64::from(per_turn) * 2.0;
    let half = if edges > 0.0 { (f64::from(ACTIVE.clock_hz) * 60.0 / edges) as u64 } else { 0 };
    let (before, reversed) = (turning().get(), rpm < 0.0);
    let mut edges = before.edges % (per_turn * 2);
    // How far a spindle that already turns is from its next edge, as a share of the way between two edges.
    let mut left = match before.half > 0 && before.per_turn == per_turn {
        true => before.next.saturating_sub(now()) as f64 / before.half as f64,
        false => 1.0,
    };
    if before.half > 0 && half > 0 && before.reversed != reversed {
        // It goes back to the edges that it made last.
        (left, edges) = (1.0 - left, (per_turn * 2 + 2 - edges) % (per_turn * 2));
    }
    let next = if half > 0 { now() + (half as f64 * left) as u64 } else { NEVER };
    turning().set(Turning { half, reversed, per_turn, edges, next });
}

/// Returns when the spindle makes its next edge.
pub(super) fn next_edge() -> u64 {
    turning().get().next
}

/// Makes an edge of the spindle, at its time. Each pulse begins with a falling edge; the first pulse of a turn comes
/// with that of the index.
pub(super) fn advance() {
    let spindle = turning().get();
    let rises = spindle.edges % 2 == 1;
    if spindle.per_turn > 1 {
        // The second sensor is a quarter of the distance between two marks behind the first.
        all().second.set(rises == spindle.reversed);
        edge(1, rises);
    }
    if spindle.edges < 2 {
        edge(0, rises);
    }
    let edges = (spindle.edges + 1) % (spindle.per_turn * 2);
    turning().set(Turning { edges, next: now() + spindle.half, ..spindle });
}

/// Sets the level of a pin, if it is a sensor's.
pub(super) fn drive(pin: Pin, high: bool) {
    let Some(encoder) = ACTIVE.encoder else { return };
    for (line, of) in [encoder.index, encoder.sync].into_iter().enumerate() {
        if of.is(pin) {
            edge(line, high);
        }
    }
}

/// Lets a sensor, 0 index or 1 sync, release its pin to high, or pull it low.
pub(super) fn edge(line: usize, high: bool) {
    let sensors = all();
    let mut levels = sensors.levels.get();
    let (was, since) = core::mem::replace(&mut levels[line], (high, now()));
    sensors.levels.set(levels);
    let still = (now() - since) / COUNT;
    let (counts, back) = match sensors.in_use.get() & 4 != 0 && line == 1 {
        true => (sensors.second.get(), high),
        false => (!high, false),
    };
    if was == high
        || !counts
        || sensors.in_use.get() & 1 << line == 0
        || still < sensors.bounce.get().into()
    {
        return;
    }
    let (mut pulses, at) = (sensors.pulses.get(), (now() / COUNT) as u16);
    if line == 0 {
        pulses.index = pulses.index.wrapping_add(1);
        (pulses.index_at, pulses.at_index) = (at, pulses.sync);
    } else {
        pulses.sync = pulses.sync.wrapping_add_signed(if back { -1 } else { 1 });
        pulses.sync_at = at;
    }
    sensors.pulses.set(pulses);
}
