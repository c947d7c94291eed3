//! How close ticks may come: so that the step interrupt, exec and everything else have their time.
//!
//! Owned by [`Prep`](super::prep::Prep); the planner and the settings ask for the highest rates. The step
//! interrupt waits out each pulse, so that ticks keep the more distance the wider a pulse is. Times are
//! CPU cycles unless they are named otherwise.

use crate::boards::{MOTORS, STEPS_BY_UNIT};
use crate::dda::Ticks;
use crate::hal::{PULSE_US, TICKS, TIMER_HZ};

const CYCLES_PER_US: u16 = (TIMER_HZ / 1_000_000) as u16;
const _: () = assert!(TIMER_HZ / 1_000_000 < 256, "255 us take more than a tick period holds");

pub use crate::dda::Drivers;

impl Drivers {
    /// What the settings have by default.
    pub const USUAL: Self = Self { pulse_us: 2, setup_us: 1 };

    /// By how much ticks are longer than usual: by what the interrupt waits, and half of it, so that as large a part of the time
    /// is left to the others.
    const fn extra(self) -> u16 {
        let waits = self.waits();
        waits + waits / 2
    }

    /// By how much pulses are longer than those that the ticks are measured with.
    const fn waits(self) -> u16 {
        self.pulse_us.saturating_sub(PULSE_US) as u16 * CYCLES_PER_US
    }

    /// By how much ticks between steps are longer: shortest ones, fine ones and coarse ones. A unit that makes pulses by itself is ready for the next one half a
    /// microsecond behind a pulse.
    const fn spread(self) -> [u16; 3] {
        let extra = self.extra();
        if STEPS_BY_UNIT {
            [self.waits().saturating_sub(CYCLES_PER_US / 2); 3]
        } else {
            [extra, extra + extra / 2, 2 * extra]
        }
    }

    /// How long a direction stands before the first step.
    pub const fn setup(self) -> u16 {
        self.setup_us as u16 * CYCLES_PER_US
    }

    /// Highest step rate of each of so many motors that move together, steps per second: a step on every tick, but with two motors, which
    /// would leave exec too little time for ramps.
    pub const fn step_rate_max(self, motors: usize) -> f32 {
        let usual = usual(if motors == 0 { 0 } else { motors - 1 });
        TIMER_HZ as f32 / (usual.step + self.extra()) as f32
    }
}

/// Tick periods with usual pulses, by the number of motors, less one. No table: that would be in RAM.
const fn usual(motors: usize) -> Ticks {
    match motors {
        0 => const { TICKS[0] },
        1 => const { TICKS[1] },
        2 => const { TICKS[2] },
        _ => const { TICKS[MOTORS - 1] },
    }
}

/// Ticks of blocks so short that they are a single segment: 2^22 / the tick period.
pub const COARSEST: u16 = per(TICKS[0].coarsest);

/// How close ticks may come.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Shortest tick period: the step interrupt with so many motors, a short interrupt before it, and
    /// some time for everything else.
    pub shortest: u16,
    /// 2^22 / the tick period of steady motion: as fine as leaves exec and the planner a third of the CPU.
    pub fine: u16,
    /// 2^22 / that of short blocks, for which they need more.
    pub coarse: u16,
    /// From this tick period on pulses wait for the interrupt's worst latency ([`crate::dda::Segment::settle`]).
    pub settles: u16,
}

/// The paces for such drivers, by the number of motors that move, less one. Cost: 6,000.
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
        // 160 cycles and half more than 8 us of 16.
        assert_eq!((rate(10, 1), rate(10, 4)), (45_455, 31_311));
        let [usual, wide] = [2, 10].map(|pulse_us| paces(Drivers { pulse_us, setup_us: 1 }));
        for (usual, wide) in usual.iter().zip(&wide) {
            assert_eq!(wide.shortest, usual.shortest + 192);
            assert!(wide.fine < usual.fine && wide.coarse < usual.coarse);
        }
    }
}
