//! Timing constants of the RP2040.

use super::Chip;
use crate::boards::{ACTIVE, MOTORS};
use crate::dda::Ticks;
use crate::hal::contract::Timing;

/// A pulse of half a microsecond and a pause of the same length. Ticks without steps are as fine as the feeder manages
/// with a quarter of the CPU.
const USUAL: Ticks =
    Ticks { step: 64, shortest: 64, fine: 66, coarse: 66, coarsest: 66, settles: u16::MAX / 4 };

/// Ticks on a board whose steps are behind a shift register. A pulse begins with eight bits that are shifted out, and
/// ends with eight more. So a step takes 141 cycles at least: 0.52 us of pulse, and as much of pause.
const SHIFTED: Ticks =
    Ticks { step: 71, shortest: 71, fine: 73, coarse: 73, coarsest: 73, settles: u16::MAX / 4 };

impl Timing for Chip {
    /// Half the system clock.
    const TIMER_HZ: u32 = 64_000_000;
    const PULSE_US: u8 = 0;
    const TICKS: [Ticks; MOTORS] =
        if ACTIVE.registers.is_some() { [SHIFTED; MOTORS] } else { [USUAL; MOTORS] };
    /// Seven segments of this length in the ring cover the millisecond by which the feeder is ahead, and most of
    /// another one.
    const BLOCK_S_MIN: f32 = 0.000_25;
    const SAMPLE_MS: u8 = 2;
    /// Exec is fast enough: 40 % of the CPU are busy with an arc on which a motor makes a million steps a second.
    const SHORT_SHARE: f32 = 1.0;
    const STAGE: usize = 64;
    const BLEND_S_MIN: f32 = 0.000_8;
    // Blocks of six motors take more RAM.
    const LOOK_AHEAD: usize = if MOTORS > 5 { 704 } else { 768 };
    const LINE_BYTES: [usize; 2] = [2_088, 1_040];
}
