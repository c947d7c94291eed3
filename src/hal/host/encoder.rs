//! The sensors of the spindle on the host: edges that tests make, and the same pulses of them as on the chip.

use core::cell::Cell;

use super::{inputs, now};
use crate::boards::{ACTIVE, Pin};
use crate::encoder::Pulses;

/// CPU cycles of a count.
const COUNT: u64 = 64;

struct Sensors {
    pulses: Cell<Pulses>,
    in_use: Cell<u8>,
    /// How long contacts bounce, counts.
    bounce: Cell<u16>,
    /// The level of each pin, and when it has changed last, cycles.
    levels: Cell<[(bool, u64); 2]>,
}

machine_static! {
    fn all() -> Sensors = Sensors {
        pulses: Cell::new(Pulses::NONE),
        in_use: Cell::new(0),
        bounce: Cell::new(0),
        levels: Cell::new([(true, 0); 2]),
    };
}

/// The sensors `lines` are read from now on (bit 0 index, bit 1 sync), whose contacts bounce for so many counts.
pub fn set_up(lines: u8, bounce: u16) {
    all().in_use.set(lines);
    all().bounce.set(bounce);
    inputs::leave_out(ACTIVE.shared_inputs(lines));
}

/// Whether any sensor is read.
pub fn is_set_up() -> bool {
    all().in_use.get() != 0
}

/// What the sensors have seen so far.
pub fn read() -> Pulses {
    Pulses { now: (now() / COUNT) as u16, ..all().pulses.get() }
}

/// A pin is driven.
pub(super) fn drive(pin: Pin, high: bool) {
    let Some(encoder) = ACTIVE.encoder else { return };
    for (line, of) in [encoder.index, encoder.sync].into_iter().enumerate() {
        if of.is(pin) {
            edge(line, high);
        }
    }
}

/// A sensor, 0 index and 1 sync, lets its pin go high, or pulls it low.
pub(super) fn edge(line: usize, high: bool) {
    let sensors = all();
    let mut levels = sensors.levels.get();
    let (was, since) = core::mem::replace(&mut levels[line], (high, now()));
    sensors.levels.set(levels);
    let still = (now() - since) / COUNT;
    if was == high
        || high
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
        pulses.sync = pulses.sync.wrapping_add(1);
        pulses.sync_at = at;
    }
    sensors.pulses.set(pulses);
}
