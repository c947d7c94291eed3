//! The shortest tick periods that leave enough CPU time to the step interrupt, exec and everything else.
//!
//! Owned by [`Prep`](super::prep::Prep); the planner and the settings read the highest step rates. The step interrupt
//! waits for the end of each pulse, so wider pulses require longer tick periods. Times are CPU cycles unless stated
//! otherwise.

use crate::boards::{MOTORS, STEPS_BY_UNIT};
use crate::dda::Ticks;
use crate::hal::{PULSE_US, TICKS, TIMER_HZ};

const CYCLES_PER_US: u16 = (TIMER_HZ / 1_000_000) as u16;
const _: () = assert!(TIMER_HZ / 1_000_000 < 256, "255 us take more than a tick period holds");

/// Latest cycle of its first tick at which the direction pins of a segment are set.
pub const TURNED: u16 = 158;
/// The time from the end of a pulse to a change of directions by a step generator in hardware, and the cycles that the
/// change itself takes.
const HOLD_US: u16 = 1;
const CHANGES: u16 = 16;

pub use crate::dda::Drivers;

impl Drivers {
    /// The default of the settings.
    pub const USUAL: Self = Self { pulse_us: 2, setup_us: 1 };

    /// By how much tick periods are longer than usual: one and a half times the additional wait of the interrupt, so
    /// that everything else keeps its share of the CPU.
    const fn extra(self) -> u16 {
        let waits = self.waits();
        waits + waits / 2
    }

    /// By how much pulses are longer than the pulses with which the tick periods were measured.
    const fn waits(self) -> u16 {
        self.pulse_us.saturating_sub(PULSE_US) as u16 * CYCLES_PER_US
    }

    /// By how much the shortest, the fine and the coarse tick periods are longer. Step generators in hardware are ready
    /// for the next pulse half a microsecond after a pulse.
    const fn spread(self) -> [u16; 3] {
        let extra = self.extra();
        if STEPS_BY_UNIT {
            [self.waits().saturating_sub(CYCLES_PER_US / 2); 3]
        } else {
            [extra, extra + extra / 2, 2 * extra]
        }
    }

    /// How long the first step must wait from [`TURNED`] on so that a direction is stable before it, CPU cycles. A step
    /// generator in hardware changes directions a microsecond after the last pulse, which may be later than `TURNED`.
    pub const fn setup(self) -> u16 {
        let setup = self.setup_us as u16 * CYCLES_PER_US;
        if !STEPS_BY_UNIT {
            return setup;
        }
        let pulse_us = if self.pulse_us == 0 { 1 } else { self.pulse_us };
        let changed = (pulse_us as u16 + HOLD_US) * CYCLES_PER_US + CHANGES;
        setup + changed.saturating_sub(TURNED)
    }

    /// Returns the highest step rate of each of `motors` that move together, steps per second. This is one step in
    /// every tick, except with two motors, where that would leave exec too little time for ramps.
    pub const fn step_rate_max(self, motors: usize) -> f32 {
        let usual = usual(if motors == 0 { 0 } else { motors - 1 });
        TIMER_HZ as f32 / (usual.step + self.extra()) as f32
    }
}

/// Tick periods with usual pulses, by the number of motors, less one. Not a table, which would take RAM.
const fn usual(motors: usize) -> Ticks {
    match motors {
        0 => const { TICKS[0] },
        1 => const { TICKS[1] },
        2 => const { TICKS[2] },
        _ => const { TICKS[MOTORS - 1] },
    }
}

/// The pace of blocks so short that they are one segment: 2^22 / the tick period.
pub const COARSEST: u16 = per(TICKS[0].coarsest);

/// Limits of the tick period for a given number of motors that move.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Shortest tick period: the step interrupt with this many motors, a short interrupt before it, and
    /// some time for everything else.
    pub shortest: u16,
    /// 2^22 / the tick period of steady motion, as short as leaves exec and the planner a third of the CPU.
    pub fine: u16,
    /// 2^22 / the tick period of short blocks, for which exec and the planner need more of the CPU.
    pub coarse: u16,
    /// From this tick period on each pulse is delayed by the interrupt's worst latency
    /// ([`crate::dda::Segment::settle`]).
    pub settles: u16,
}

/// Returns the paces for such drivers, by the number of motors that move, less one. Cost: 6,000.
#[small]
pub const fn paces(drivers: Drivers) -> [Pace; MOTORS] {
    let [shortest, fine, coarse] = drivers.spread();
    let mut paces = [Pace { shortest: 0, fine: 0, coarse: 0, settles: 0 }; MOTORS];
    let mut m = 0;
    while m < MOTORS {
        let usual = usual(m);
        paces[m] = Pace {
            shortest: usual.shortest + shortest,
            fine: per(usual.fine + fine),
            coarse: per(usual.coarse + coarse),
            settles: usual.settles + shortest,
        };
        m += 1;
    }
    paces
}

const fn per(cycles: u16) -> u16 {
    ((1 << 22) / cycles as u32) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wider_pulses_take_their_time_from_each_tick() {
        let rate = |pulse_us, motors| {
            Drivers { pulse_us, ..Drivers::USUAL }.step_rate_max(motors).round() as u32
        };
        assert_eq!([1, 2].map(|us| rate(us, 1)), [100_000; 2]);
        // Pulses are 8 us longer: that makes tick periods longer by 128 cycles and half of that.
        assert_eq!((rate(10, 1), rate(10, 4)), (45_455, 31_311));
        let [usual, wide] = [2, 10].map(|pulse_us| paces(Drivers { pulse_us, setup_us: 1 }));
        for (usual, wide) in usual.iter().zip(&wide) {
            assert_eq!(wide.shortest, usual.shortest + 192);
            assert!(wide.fine < usual.fine && wide.coarse < usual.coarse);
        }
    }
}
