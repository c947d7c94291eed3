//! Autotune (M303): finds the PID factors of a heater by relay oscillation.
//!
//! The heater has the power `bias + swing` until it is hotter than the target, then `bias - swing` until it is colder,
//! and so on. After each cycle `bias` is adjusted so that both halves become equally long. The height of the
//! oscillation gives the ultimate gain, `ku = 4 * swing / (pi * height)`. The factors follow from `ku` and the period
//! by [`RULE`].
//!
//! Stepped five times a second in place of [`Control`](super::control::Control). Temperatures are in 1/64 degree. It
//! ends after the requested cycles. It fails when half a cycle takes longer than [`HALF_S`], or when the heater gets
//! more than [`FAR`] above the target. The supervision of heaters and sensors goes on meanwhile. Cost of a step: 100
//! cycles; 4,000 for the last step of a cycle.

use super::control::{FULL, STEPS};
use super::sensor::UNIT;

/// The power is switched when the temperature has passed the target by more than this.
const BAND: i16 = UNIT / 4;
/// The autotune fails when the temperature is this far above the target.
const FAR: i16 = 25 * UNIT;
/// How long half a cycle may take, seconds.
const HALF_S: u16 = 1_200;
/// The least and the greatest mean power of the oscillation.
const BIAS: (u8, u8) = (20, FULL - 20);
/// The least number of cycles. The first cycle is not measured, because the heater starts cold; the next ones adjust
/// the mean power.
pub const CYCLES_MIN: u8 = 3;
/// The greatest number of cycles.
pub const CYCLES_MAX: u8 = 50;
/// Hundredths: `p` as a share of `ku`, `i` as a share of `p` over the period, and `d` as a share of `p` times the
/// period.
const RULE: (u32, u32, u32) = (60, 100, 30);

/// The factors found by the oscillation, in hundredths as in [`Factors`](super::control::Factors).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Found {
    /// Power per degree.
    pub p: u16,
    /// Power per degree and second.
    pub i: u16,
    /// Power per degree a second.
    pub d: u16,
}

/// The stage of an autotune.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Stage {
    /// There has been no autotune.
    #[default]
    Idle,
    /// The temperature oscillates around the target.
    Swings,
    /// The factors have been found.
    Done,
    /// Half a cycle has taken too long.
    TooSlow,
    /// The heater has got too hot.
    TooHot,
    /// The autotune has been stopped.
    Stopped,
}

/// A heater being tuned.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tune {
    /// The stage.
    pub stage: Stage,
    /// Whether the bed is tuned, not the hot end.
    pub bed: bool,
    /// The number of completed cycles.
    pub cycle: u8,
    /// The mean power of the oscillation, 255 for full power.
    pub bias: u8,
    /// The amplitude of the power around `bias`.
    pub swing: u8,
    /// The lowest and the highest temperature of the last cycle, 1/64 degree.
    pub extremes: (i16, i16),
    /// The factors of the last cycle.
    pub found: Found,
    cycles: u8,
    /// Whether the power is `bias + swing`.
    more: bool,
    wanted: i16,
    low: i16,
    high: i16,
    /// Steps of this half of the cycle; in `before`, those of the half before.
    steps: u16,
    before: u16,
}

#[small]
impl Tune {
    /// No autotune. All bytes are 0, because it is part of a static.
    pub const IDLE: Self = Self {
        stage: Stage::Idle,
        bed: false,
        cycle: 0,
        bias: 0,
        swing: 0,
        extremes: (0, 0),
        found: Found { p: 0, i: 0, d: 0 },
        cycles: 0,
        more: false,
        wanted: 0,
        low: 0,
        high: 0,
        steps: 0,
        before: 0,
    };

    /// Begins an autotune at the target `wanted`, 1/64 degree, with `cycles` cycles.
    pub fn begin(bed: bool, wanted: i16, cycles: u8) -> Self {
        let cycles = cycles.clamp(CYCLES_MIN, CYCLES_MAX);
        Self {
            stage: Stage::Swings,
            bed,
            bias: FULL / 2,
            swing: FULL / 2,
            cycles,
            more: true,
            wanted,
            low: i16::MAX,
            high: i16::MIN,
            ..Self::IDLE
        }
    }

    /// Whether the autotune is under way.
    pub fn is_on(&self) -> bool {
        self.stage == Stage::Swings
    }

    /// Stops the autotune.
    pub fn stop(&mut self) {
        if self.is_on() {
            self.stage = Stage::Stopped;
        }
    }

    /// Returns the power of the next step; 0 when the autotune is over.
    #[inline(never)]
    pub fn step(&mut self, now: i16) -> u8 {
        if !self.is_on() {
            return 0;
        }
        self.steps += 1;
        (self.low, self.high) = (self.low.min(now), self.high.max(now));
        let above = now.saturating_sub(self.wanted);
        self.stage = match () {
            () if above > FAR => Stage::TooHot,
            () if self.steps > HALF_S * STEPS as u16 => Stage::TooSlow,
            () => Stage::Swings,
        };
        if self.more && above > BAND {
            self.turn();
        } else if !self.more && above < -BAND {
            self.end_cycle();
            self.turn();
        }
        match self.stage {
            Stage::Swings if self.more => self.bias.saturating_add(self.swing),
            Stage::Swings => self.bias.saturating_sub(self.swing),
            _ => 0,
        }
    }

    /// Begins the other half of the cycle.
    fn turn(&mut self) {
        self.more = !self.more;
        (self.before, self.steps) = (self.steps, 0);
    }

    /// Ends a cycle: the temperature is below the target again.
    fn end_cycle(&mut self) {
        let (up, down) = (i32::from(self.before), i32::from(self.steps));
        // The first cycle is not measured, because it began cold.
        if self.cycle > 0 {
            self.found = self.factors((up + down) as u32);
            let by = i32::from(self.swing) * (up - down) / (up + down).max(1);
            let bias = i32::from(self.bias) + by;
            self.bias = bias.clamp(BIAS.0.into(), BIAS.1.into()) as u8;
            self.swing = self.bias.min(FULL - self.bias);
        }
        self.extremes = (self.low, self.high);
        (self.low, self.high) = (i16::MAX, i16::MIN);
        self.cycle += 1;
        if self.cycle >= self.cycles {
            self.stage = Stage::Done;
        }
    }

    /// Returns the factors for a cycle of `period` steps.
    fn factors(&self, period: u32) -> Found {
        let height = u32::from(self.high.abs_diff(self.low)).max(1);
        // Hundredths: 400 / pi * 2 * 64, over the difference of both extremes in 1/64 degree.
        let ku = 16_297 * u32::from(self.swing) / height;
        let (p, i, d) = RULE;
        let p = ku * p / 100;
        let kept = |value: u32| value.min(60_000) as u16;
        Found {
            p: kept(p),
            i: kept(p * i * STEPS as u32 / (100 * period.max(1))),
            d: kept(p * d / 100 * period / STEPS as u32),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heat::control::{Control, Factors};

    /// A simulated heater: heat flows from the heater into the block, and from there to the air; the sensor follows the
    /// block.
    #[derive(Clone)]
    struct Plant {
        capacity: f64,
        watts: f64,
        loss: f64,
        fan: f64,
        delay: [f64; 2],
        heater: f64,
        block: f64,
        sensor: f64,
        noise: u32,
    }

    impl Plant {
        fn new(capacity: f64, watts: f64, loss: f64, fan: f64, delay: [f64; 2]) -> Self {
            let (heater, block, sensor, noise) = (0.0, 22.0, 22.0, 1);
            Self { capacity, watts, loss, fan, delay, heater, block, sensor, noise }
        }

        /// Simulates a step of a fifth of a second at a power. Returns the measured temperature.
        fn step(&mut self, power: u8, fan: bool) -> i16 {
            let watts = self.watts * f64::from(power) / 255.0;
            for _ in 0..20 {
                self.heater += (watts - self.heater) * 0.01 / self.delay[0];
                let loss = self.loss + if fan { self.fan } else { 0.0 };
                self.block += (self.heater - loss * (self.block - 22.0)) * 0.01 / self.capacity;
                self.sensor += (self.block - self.sensor) * 0.01 / self.delay[1];
            }
            self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(self.noise >> 16) / 65_536.0 - 0.5;
            ((self.sensor + noise * 0.1) * f64::from(UNIT)) as i16
        }
    }

    /// A hot end of 40 W, a heavier one of 60 W whose sensor is slow, and a light one of 30 W.
    fn plants() -> [Plant; 3] {
        [
            Plant::new(14.0, 40.0, 0.09, 0.03, [2.0, 1.5]),
            Plant::new(25.0, 60.0, 0.13, 0.04, [3.0, 2.5]),
            Plant::new(8.0, 30.0, 0.07, 0.02, [1.5, 1.0]),
        ]
    }

    fn tuned(plant: &mut Plant, degrees: i16, cycles: u8) -> (Tune, f64) {
        let mut tune = Tune::begin(false, degrees * UNIT, cycles);
        let (mut power, mut seconds) = (0, 0.0);
        while tune.is_on() {
            let now = plant.step(power, false);
            power = tune.step(now);
            seconds += 0.2;
            assert!(seconds < 20_000.0, "it does not end");
        }
        assert_eq!(tune.step(0), 0);
        (tune, seconds)
    }

    #[test]
    fn three_plants_converge_and_are_held() {
        let mut wrong = std::vec::Vec::new();
        for (n, mut plant) in plants().into_iter().enumerate() {
            let cold = plant.clone();
            let (tune, seconds) = tuned(&mut plant, 200, 8);
            assert_eq!((tune.stage, tune.cycle), (Stage::Done, 8));
            let Found { p, i, d } = tune.found;
            std::println!("plant {n}: {tune:?} in {seconds:.0} s");
            let factors = Factors { p, i, d, fan: 0, hysteresis: 0 };
            let (mut plant, mut control) = (cold, Control::OFF);
            let (mut most, mut low, mut high) = (0f64, 1e9f64, 0f64);
            let (mut dip, mut below) = (1e9f64, 0.0);
            let mut power = 0;
            for step in 0..5_000 {
                let fan = step > 4_000;
                let now = plant.step(power, fan);
                power = control.step(now, 200 * UNIT, 0, &factors);
                if !fan {
                    most = most.max(plant.sensor);
                }
                if (1_200..4_000).contains(&step) {
                    (low, high) = (low.min(plant.sensor), high.max(plant.sensor));
                }
                if fan {
                    dip = dip.min(plant.sensor);
                    below += if plant.sensor < 199.0 { 0.2 } else { 0.0 };
                }
            }
            std::println!(
                "  most {most:.2}, held {low:.2} to {high:.2}, fan {dip:.2}, below 199 for {below:.1} s"
            );
            if most > 202.0 || low < 199.5 || high > 200.5 || dip < 198.0 || below > 20.0 {
                wrong.push(n);
            }
        }
        assert!(wrong.is_empty(), "{wrong:?}");
    }

    #[test]
    fn a_bed_converges() {
        let mut plant = Plant::new(600.0, 120.0, 1.2, 0.0, [5.0, 4.0]);
        let (tune, seconds) = tuned(&mut plant, 60, 5);
        std::println!("bed: {tune:?} in {seconds:.0} s");
        assert_eq!(tune.stage, Stage::Done);
    }

    #[test]
    fn what_does_not_swing_ends() {
        let mut weak = Plant::new(14.0, 5.0, 0.09, 0.03, [2.0, 1.5]);
        let (tune, seconds) = tuned(&mut weak, 200, 5);
        assert_eq!(tune.stage, Stage::TooSlow);
        assert!(seconds < 1_300.0, "{seconds}");
        let mut wild = Plant::new(3.0, 200.0, 0.09, 0.03, [4.0, 1.5]);
        assert_eq!(tuned(&mut wild, 200, 5).0.stage, Stage::TooHot);
    }

    #[test]
    fn any_reading_leaves_it_within_bounds() {
        let mut tune = Tune::begin(false, 200 * UNIT, u8::MAX);
        let mut random = 1u32;
        for _ in 0..200_000 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let now = match random >> 30 {
                0 => (random >> 8) as i16,
                _ => (200 * UNIT).wrapping_add(((random >> 12) % 2_000) as i16 - 1_000),
            };
            tune.step(now);
            if !tune.is_on() {
                tune = Tune::begin(false, 200 * UNIT, (random >> 24) as u8);
            }
            assert!((BIAS.0..=BIAS.1).contains(&tune.bias) && tune.swing <= FULL / 2);
        }
    }
}
