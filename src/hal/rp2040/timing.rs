//! How fast the RP2040 is.

use super::Chip;
use crate::boards::MOTORS;
use crate::dda::Ticks;
use crate::hal::contract::Timing;

/// A pulse of 2 us and as long a pause; ticks beside steps as fine as the feeder takes a fifth of the CPU for.
const USUAL: Ticks =
    Ticks { step: 256, shortest: 160, fine: 160, coarse: 320, settles: u16::MAX / 4 };

impl Timing for Chip {
    /// Half the system clock.
    const TIMER_HZ: u32 = 64_000_000;
    const TICKS: [Ticks; MOTORS] = [USUAL; MOTORS];
}
