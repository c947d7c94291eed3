//! Heaters under any pattern of targets: no pattern hides a fault, and none makes a fault of a heater that is well.
//!
//! These tests drive [`Heater`] itself, hundreds of hours of it. In `heat_lines.rs` lines set the targets of the whole
//! firmware.

use std::fmt;

use kerf::config::groups::{bed, hot_end};
use kerf::heat::heater::{Heater, Seen};
use kerf::heat::sensor::{Kind, SAMPLES, UNIT, reading};
use kerf::heat::tune::Tune;
use kerf::status::Status;

use crate::plant::{AIR, Plant};
use crate::seeds::try_all;

/// Time between two samples, seconds.
const SAMPLE_S: f64 = 0.04;
/// The hot end's and the bed's maximum, degrees.
const HOTTEST: [f64; 2] = [275.0, 120.0];

/// A share of power that may stay unnoticed in a heater without effect.
pub const SPARED: f64 = 0.6;

/// A random number generator.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        for _ in 0..8 {
            random.unit();
        }
        random
    }

    /// From 0 to 1.
    pub fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + self.unit() * (high - low)
    }

    pub fn below(&mut self, end: usize) -> usize {
        ((self.unit() * end as f64) as usize).min(end - 1)
    }
}

/// How targets follow each other.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pattern {
    /// Any target or off, for 1 to 60 s.
    Any,
    /// Two targets, and how long each lasts.
    Two([f64; 2], [f64; 2]),
    /// Targets around the reading, up to so far from it, for so long at most.
    Around(f64, f64),
    /// One target.
    Hold(f64),
    /// Autotunes of so many seconds at most, at this target, and as much time off between them.
    Tunes(f64, [f64; 2]),
}

impl Pattern {
    fn random(random: &mut Random, hottest: f64) -> Self {
        let target = random.between(40.0, hottest);
        let share = |share: f64| target * share;
        let long = |random: &mut Random| match random.below(3) {
            0 => random.between(1.0, 3.0),
            1 => random.between(3.0, 20.0),
            _ => random.between(15.0, 60.0),
        };
        match random.below(9) {
            0 | 1 => Self::Any,
            2 => {
                let by = random.between(0.125, 2.0);
                Self::Two([target - by, target], [random.between(1.0, 19.5); 2])
            }
            3 => {
                let by = random.between(2.0, 20.0);
                Self::Two([target - by, target], [long(random), long(random)])
            }
            4 => Self::Two([share(random.unit()), target], [long(random), long(random)]),
            5 => Self::Two([0.0, target], [random.between(0.2, 2.0), random.between(8.0, 19.5)]),
            6 => Self::Two([0.0, target], [long(random), long(random)]),
            7 => Self::Around(random.between(1.0, 20.0), random.between(1.0, 60.0)),
            _ => Self::Tunes(target.min(hottest - 10.0), [long(random), long(random)]),
        }
    }
}

/// What is wrong with a heater.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    /// The sensor comes to the first temperature with this time constant, seconds.
    Loose(f64, f64),
    /// The reading stays where it is, but for a drift (degrees a second) and noise (steps of the converter).
    Frozen(f64, f64),
    Open,
    Dead,
    Stuck,
}

/// A heater of a kind: its name, its plant, and the highest target that it reaches, degrees.
type Heated = (&'static str, fn() -> Plant, f64);

const HOT_ENDS: [Heated; 7] = [
    ("40 W", Plant::hot_end, 275.0),
    ("30 W, light", || Plant::of(8.0, 30.0, 0.07, 0.02, [1.5, 1.0]), 275.0),
    ("60 W, heavy", || Plant::of(25.0, 60.0, 0.13, 0.04, [3.0, 2.5]), 275.0),
    ("60 W, fast", || Plant::of(11.0, 60.0, 0.11, 0.03, [1.5, 1.0]), 275.0),
    ("40 W, slow sensor", || Plant::of(14.0, 40.0, 0.09, 0.03, [3.0, 3.0]), 275.0),
    ("30 W, weak", || Plant::of(14.0, 30.0, 0.085, 0.01, [2.5, 2.0]), 275.0),
    ("25 W, very weak", || Plant::of(14.0, 25.0, 0.085, 0.01, [2.5, 2.0]), 230.0),
];

const BEDS: [Heated; 7] = [
    ("120 W", Plant::bed, 110.0),
    ("150 W, weak", || Plant::of(900.0, 150.0, 1.55, 0.0, [8.0, 6.0]), 100.0),
    ("150 W, very weak", || Plant::of(900.0, 150.0, 2.3, 0.0, [8.0, 6.0]), 70.0),
    ("mains", || Plant::of(900.0, 500.0, 2.0, 0.0, [8.0, 10.0]), 120.0),
    ("mains, strong", || Plant::of(900.0, 750.0, 2.0, 0.0, [8.0, 10.0]), 120.0),
    ("mains, light", || Plant::of(700.0, 600.0, 1.8, 0.0, [6.0, 8.0]), 120.0),
    ("thick, slow sensor", || Plant::of(1_500.0, 300.0, 2.2, 0.0, [15.0, 25.0]), 110.0),
];

/// A heater with its plant, and what came of them.
struct Rig {
    number: usize,
    name: &'static str,
    /// The highest target, degrees.
    reach: f64,
    heater: Heater,
    plant: Plant,
    fault: Fault,
    /// What the loose sensor reads.
    loose: f64,
    tune: Option<Tune>,
    to: f64,
    fan: u8,
    noise: Random,
    /// Seconds since power-up.
    at: f64,
    /// The first fault, and its moment.
    told: Option<(Status, f64)>,
    /// Seconds of full power since the heater's defect, less [`SPARED`] of all time.
    given: f64,
    /// The highest temperature since the heater's defect.
    most: f64,
    /// The highest target or temperature that the firmware has been asked for since then.
    asked: f64,
}

impl Rig {
    fn new(random: &mut Random, number: usize) -> Self {
        let mut heater = Heater::OFF;
        let factors = match number {
            0 => [(hot_end::P, 20_000), (hot_end::I, 800), (hot_end::D, 80_000)],
            _ => [(bed::HY, 1_000), (bed::P, 0), (bed::D, 0)],
        };
        let rows = [(hot_end::K, 1), (hot_end::MX, HOTTEST[number] as i32)];
        for (row, value) in factors.into_iter().chain(rows) {
            heater.set(row, value);
        }
        let kinds: &[Heated] = if number == 0 { &HOT_ENDS } else { &BEDS };
        let (name, plant, reach) = kinds[random.below(kinds.len())];
        let mut plant = plant();
        if random.below(3) == 0 {
            plant.block = random.between(AIR, reach);
            plant.sensor = plant.block;
        }
        Self {
            number,
            name,
            reach,
            heater,
            plant,
            fault: Fault::None,
            loose: AIR,
            tune: None,
            to: 0.0,
            fan: 0,
            noise: Random::new(7),
            at: 0.0,
            told: None,
            given: 0.0,
            most: 0.0,
            asked: 0.0,
        }
    }

    /// A heater with gains, a room, a supply and a power of its own. It comes barely to its highest target.
    fn varied(random: &mut Random, number: usize) -> Self {
        let mut rig = Self::new(random, number);
        let gains = match number {
            0 => [20.0, 0.8, 80.0],
            _ if random.below(3) == 0 => [60.0, 0.5, 600.0],
            _ => [0.0; 3],
        };
        let rows = [(hot_end::P, 2.0f64), (hot_end::I, 2.5), (hot_end::D, 1.5)];
        for ((row, by), gain) in rows.into_iter().zip(gains) {
            let gain = gain * by.powf(random.between(-1.0, 1.0));
            rig.heater.set(row, (gain * 1e3) as i32);
        }
        rig.heater.set(hot_end::HY, random.between(500.0, 3_000.0) as i32);
        rig.plant.air = random.between(5.0, 35.0);
        rig.plant.watts *= random.between(0.75, 1.1);
        // The weakest bed comes to 80 degrees.
        rig.plant.watts *= ((80.0 - rig.plant.air) / (rig.plant.most() - rig.plant.air)).max(1.0);
        rig.reach = rig.reach.min(rig.plant.most() - 1.0);
        if random.below(3) != 0 {
            (rig.plant.block, rig.plant.sensor) = (rig.plant.air, rig.plant.air);
        }
        rig
    }

    fn reads(&self) -> f64 {
        let is_real = !matches!(self.fault, Fault::Loose(..) | Fault::Frozen(..));
        if is_real { self.plant.sensor } else { self.loose }
    }

    fn set_fault(&mut self, fault: Fault) {
        self.loose = match fault {
            Fault::Loose(to, _) => self.plant.sensor.max(to),
            _ => self.plant.sensor,
        };
        (self.fault, self.given, self.most) = (fault, 0.0, self.plant.block);
        self.asked = self.plant.block;
    }

    /// Lets a sample's time pass.
    fn pass(&mut self) -> Result<(), Status> {
        let on = self.heater.level();
        let power = match self.fault {
            Fault::Dead => 0.0,
            Fault::Stuck => 1.0,
            _ => f64::from(on) / 255.0,
        };
        self.given = (self.given + SAMPLE_S * (f64::from(on) / 255.0 - SPARED)).max(0.0);
        self.plant.pass(SAMPLE_S, power, f64::from(self.fan) / 255.0);
        if let Fault::Loose(to, seconds) = self.fault {
            self.loose += (to - self.loose) * SAMPLE_S / seconds;
        }
        let mut steps = 0.0;
        if let Fault::Frozen(drift, noise) = self.fault {
            self.loose += drift * SAMPLE_S;
            steps = noise;
        }
        self.at += SAMPLE_S;
        self.most = self.most.max(self.plant.block);
        let noise = (self.noise.unit() - 0.5) * (6.0 + 2.0 * steps * f64::from(SAMPLES));
        let full = SAMPLES * 1_023;
        let felt = match self.fault {
            Fault::Open => full,
            _ => (reading(Kind::Semitec, self.reads()) + noise).clamp(0.0, full.into()) as u16,
        };
        let to = match &self.tune {
            Some(tune) if !tune.is_on() => 0.0,
            _ => self.to,
        };
        self.asked = self.asked.max(to);
        let to = (to * 8.0) as u16;
        let tune = self.tune.as_mut().filter(|tune| tune.is_on());
        let seen = self.heater.sample(self.number as u8, Some(felt), to, self.fan, tune);
        if let Err(status) = seen {
            self.told = self.told.or(Some((status, self.at)));
            self.stop();
        }
        seen.map(|_: Seen| ())
    }

    /// Switches off, as the firmware does at a fault.
    fn stop(&mut self) {
        (self.to, self.tune) = (0.0, None);
        self.heater.stop();
    }

    /// Runs a pattern for a time. A heater with a fault stays off for `pause` seconds, or for ever without.
    fn run(&mut self, random: &mut Random, pattern: Pattern, seconds: f64, pause: Option<f64>) {
        let (end, mut next, mut n) = (self.at + seconds, self.at, 0usize);
        while self.at < end {
            if self.at >= next {
                next = self.at + self.turn(random, pattern, n);
                n += 1;
            }
            if self.pass().is_err() {
                next = pause.map_or(f64::INFINITY, |pause| self.at + pause);
            }
        }
    }

    /// Sets the next target of a pattern. Returns how long it lasts.
    fn turn(&mut self, random: &mut Random, pattern: Pattern, n: usize) -> f64 {
        let hottest = self.reach;
        if random.below(20) == 0 {
            self.fan = [0, 255, 128][random.below(3)];
        }
        self.tune = None;
        match pattern {
            Pattern::Any => {
                self.to = match random.below(4) {
                    0 => 0.0,
                    _ => random.between(AIR, hottest),
                };
                random.between(1.0, 60.0)
            }
            Pattern::Hold(to) => {
                self.to = to;
                random.between(10.0, 300.0)
            }
            Pattern::Two(to, lasts) => {
                self.to = to[n % 2];
                lasts[n % 2]
            }
            Pattern::Around(by, lasts) => {
                self.to = (self.reads() + random.between(-by, by)).clamp(1.0, hottest);
                random.between(0.2, lasts)
            }
            Pattern::Tunes(to, lasts) => {
                self.to = to * (n % 2) as f64;
                if n % 2 == 1 {
                    let wanted = (to * f64::from(UNIT)) as i16;
                    self.tune = Some(Tune::begin(self.number == 1, wanted, 5));
                }
                lasts[n % 2]
            }
        }
    }
}

impl fmt::Display for Rig {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, fault, told, at, given, most, asked, .. } = self;
        let (block, reads) = (self.plant.block, self.reads());
        write!(text, "{name}, {fault:?}: {told:?}, at {at:.1} s, {given:.1} s of full power, ")?;
        write!(text, "block {block:.1}, at most {most:.1}, asked {asked:.1}, reads {reads:.1}")
    }
}

/// No pattern makes a fault of a heater that is well.
#[test]
fn a_heater_that_is_well_has_no_fault_under_any_pattern() {
    try_all(300, |seed| {
        let mut random = Random::new(seed);
        let number = random.below(2);
        let mut rig = Rig::new(&mut random, number);
        for _ in 0..6 {
            let pattern = Pattern::random(&mut random, rig.reach);
            rig.run(&mut random, pattern, 600.0, None);
            if rig.told.is_some() {
                return Err(format!("{pattern:?}: {rig}"));
            }
        }
        Ok(())
    });
}

/// No target makes a fault of a heater that is well, however weak or strong, cold or badly tuned it is.
#[test]
fn a_heater_that_is_well_has_no_fault_while_it_holds() {
    try_all(300, |seed| {
        let mut random = Random::new(seed);
        let mut rig = Rig::varied(&mut random, seed as usize % 2);
        for _ in 0..4 {
            let (low, high) = (rig.plant.air + 3.0, rig.reach);
            let to = [random.between(low, high), high][random.below(2)];
            let pattern = match random.below(3) {
                0 => Pattern::random(&mut random, rig.reach),
                _ => Pattern::Hold(to),
            };
            rig.run(&mut random, pattern, 1_500.0, None);
            if rig.told.is_some() {
                return Err(format!(
                    "{pattern:?}, {:.0} degrees in the room: {rig}",
                    rig.plant.air
                ));
            }
        }
        Ok(())
    });
}

/// A strong bed that is switched on and off gets hotter than its target, and cools slowly.
#[test]
fn a_strong_bed_that_overshoots_has_no_fault() {
    try_all(100, |seed| {
        let mut random = Random::new(seed);
        let mut rig = Rig::varied(&mut random, 1);
        let watts = random.between(500.0, 750.0);
        rig.plant = Plant::of(900.0, watts, 2.0, 0.0, [8.0, random.between(6.0, 12.0)]);
        rig.heater.set(bed::P, 0);
        rig.plant.air = random.between(15.0, 35.0);
        let mut over = 0f64;
        for _ in 0..3 {
            let to = random.between(30.0, 60.0);
            rig.run(&mut random, Pattern::Hold(to), 900.0, None);
            over = over.max(rig.most - to);
            if rig.told.is_some() {
                return Err(format!("{over:.1} degrees too hot at {to:.1}: {rig}"));
            }
        }
        Ok(())
    });
}

/// A bed warms the closed chamber, and the hot end in it gets warmer than its target. Its transistor that stays on is
/// told nevertheless.
#[test]
fn a_hot_end_that_a_chamber_warms_has_no_fault_unless_its_transistor_stays_on() {
    try_all(100, |seed| {
        let mut random = Random::new(seed);
        let mut rig = Rig::varied(&mut random, 0);
        (rig.plant.block, rig.plant.sensor) = (rig.plant.air, rig.plant.air);
        let (to, pace) = (random.between(20.0, 60.0), random.between(0.01, 0.2));
        let warmest = random.between(45.0, 75.0);
        let pattern = [Pattern::Hold(to), Pattern::Two([0.0, to], [5.0, 20.0])][random.below(2)];
        while rig.at < 3_000.0 {
            rig.plant.air = (rig.plant.air + pace).min(warmest);
            rig.run(&mut random, pattern, 1.0, None);
        }
        if rig.told.is_some() {
            return Err(format!("{pattern:?}, {warmest:.0} degrees in the chamber: {rig}"));
        }
        rig.set_fault(Fault::Stuck);
        rig.run(&mut random, pattern, 300.0, None);
        let is_well = rig.told.is_some_and(|(_, at)| at < 3_040.0);
        is_well.then_some(()).ok_or_else(|| format!("stuck, {pattern:?}: {rig}"))
    });
}

/// A heater with a sensor that freezes at any moment, with any gains.
#[test]
fn a_frozen_sensor_is_noticed_under_any_pattern() {
    try_all(600, |seed| {
        let pause = [None, Some(0.2), Some(3.0), Some(15.0)][seed as usize % 4];
        let mut random = Random::new(seed);
        let number = random.below(4) / 3;
        let mut rig = Rig::varied(&mut random, number);
        let pattern = match random.below(3) {
            0 => Pattern::random(&mut random, rig.reach),
            _ => Pattern::Hold(random.between(rig.plant.air + 10.0, rig.reach)),
        };
        let before = [90.0, 400.0, 1_200.0][random.below(3)];
        let before = random.between(1.0, before);
        rig.run(&mut random, pattern, before, None);
        let most = [0.03, 0.007][number];
        let drift = [0.0, random.between(-most, most)][random.below(2)];
        let noise = [0.0, random.between(0.0, 1.0)][random.below(2)];
        rig.told = None;
        rig.set_fault(Fault::Frozen(drift, noise));
        rig.run(&mut random, pattern, 1_500.0, pause);
        let is_well = rig.most <= limit_of(rig.number);
        is_well.then_some(()).ok_or_else(|| format!("{pattern:?}, {pause:?}, {before:.1}: {rig}"))
    });
}

/// A heater that works, whose pattern is then repeated with a defect.
fn defect(seed: u64, fault: impl Fn(&mut Random) -> Fault, pause: Option<f64>) -> (Rig, Pattern) {
    let mut random = Random::new(seed);
    let number = random.below(4) / 3;
    let mut rig = Rig::new(&mut random, number);
    let pattern = Pattern::random(&mut random, rig.reach);
    if random.below(2) == 0 {
        let seconds = random.between(1.0, 600.0);
        rig.run(&mut random, pattern, seconds, None);
    }
    let fault = fault(&mut random);
    rig.told = None;
    rig.set_fault(fault);
    rig.run(&mut random, pattern, 900.0, pause);
    (rig, pattern)
}

/// The highest temperature that a heater may come to, degrees: a hot end its maximum and 15 degrees. A bed gets more in
/// the 90 s that it may heat without a rise.
pub fn limit_of(number: usize) -> f64 {
    HOTTEST[number] + [15.0, 30.0][number]
}

fn loose(random: &mut Random) -> Fault {
    Fault::Loose(random.between(18.0, 40.0), random.between(1.0, 40.0))
}

/// With a sensor that has come loose the heater stays below its maximum and 15 degrees, even if a host clears each
/// alarm at once and heats again.
#[test]
fn a_loose_sensor_is_noticed_under_any_pattern() {
    try_all(600, |seed| {
        let pause = [None, Some(0.2), Some(3.0), Some(15.0)][seed as usize % 4];
        let (rig, pattern) = defect(seed, loose, pause);
        let is_well = rig.most <= limit_of(rig.number);
        is_well.then_some(()).ok_or_else(|| format!("{pattern:?}, {pause:?}: {rig}"))
    });
}

#[test]
fn an_open_sensor_is_noticed_under_any_pattern() {
    try_all(200, |seed| {
        let (rig, pattern) = defect(seed, |_| Fault::Open, Some(1.0));
        let is_well = rig.most <= limit_of(rig.number);
        is_well.then_some(()).ok_or_else(|| format!("{pattern:?}: {rig}"))
    });
}

/// A heater without effect is noticed, whether it has its power in one piece or in many.
#[test]
fn a_dead_heater_is_noticed_under_any_pattern() {
    try_all(400, |seed| {
        let (rig, pattern) = defect(seed, |_| Fault::Dead, None);
        let most = [20.0, 90.0][rig.number];
        let is_well = rig.given < most;
        is_well.then_some(()).ok_or_else(|| format!("{pattern:?}: {rig}"))
    });
}

/// A transistor that stays on is told before the heater is 35 degrees hotter than anything that it was asked for.
#[test]
fn a_stuck_transistor_is_noticed_under_any_pattern() {
    try_all(400, |seed| {
        let (rig, pattern) = defect(seed, |_| Fault::Stuck, None);
        let most = rig.asked.max(70.0) + 35.0;
        let is_well = rig.told.is_some() || rig.plant.sensor < most.min(limit_of(rig.number));
        is_well.then_some(()).ok_or_else(|| format!("{pattern:?}: {rig}"))
    });
}
