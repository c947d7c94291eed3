//! Timing constants of the ATmega2560. The host stands in for this chip and uses this file, too.

use super::Chip;
use crate::boards::{ACTIVE, MOTORS};
use crate::dda::Ticks;
use crate::hal::contract::Timing;

impl Timing for Chip {
    /// The step timer counts the clock itself.
    const TIMER_HZ: u32 = ACTIVE.clock_hz;
    const PULSE_US: u8 = 2;
    const TICKS: [Ticks; MOTORS] = [
        ticks(160, 160, 200, 400, 200),
        ticks(240, 200, 200, 400, 200),
        ticks(240, 240, 320, 480, 300),
        ticks(319, 319, 400, 560, 320),
    ];
}

const fn ticks(step: u16, shortest: u16, fine: u16, coarse: u16, settles: u16) -> Ticks {
    Ticks { step, shortest, fine, coarse, coarsest: 800, settles }
}
