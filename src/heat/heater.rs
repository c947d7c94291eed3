//! A heater with its sensor: readings in, power out.
//!
//! Sampled every 40 ms. Every five samples their mean makes a [step](super::control) of the control. Cost of a sample:
//! 3,000 cycles; 7,000 with a step, 8,000 while a heater with power gets colder.

use super::control::{Control, Factors, STEPS, level};
use super::fault::{Rule, Watch};
use super::sensor::{Broken, Kind, UNIT};
use super::tune::Tune;
use super::{HEATERS, Standing};
use crate::boards::PULSED;
use crate::config::groups::hot_end;
use crate::status::Status;

/// Missing readings in a row that count as an open sensor.
const MISSING: u8 = 3;
/// Samples from one reading of a MAX6675 to the next: 240 ms.
const ASKED_EVERY: u8 = 6;
/// Samples for which a MAX6675 may be unreadable, while a block of the SD card is being transferred: 160 ms.
const DENIED: u8 = 4;
/// [`Rule::rise_s`] and [`Rule::reach`] of the hot end and of the bed.
const RULES: [(u16, i16); HEATERS] = [(20, 256), (90, 128)];

/// A heater with its sensor.
#[derive(Clone, Copy, Debug)]
pub struct Heater {
    kind: Kind,
    factors: Factors,
    /// Maximum temperature, 1/64 degree.
    hottest: i16,
    /// Minimum temperature to extrude, 1/64 degree.
    least: i16,
    control: Control,
    watch: Watch,
    /// The highest power since the last step of `watch`, also if the heater has been stopped since.
    given: u8,
    /// The sum of the sensor's readings since the last step.
    sum: i32,
    samples: u8,
    missing: u8,
    /// The last word of a MAX6675; in `rests`, samples until it is read again.
    word: u16,
    rests: u8,
    denied: u8,
    owed: u8,
    /// Present temperature, 1/64 degree.
    now: i16,
    level: u8,
}

/// What a sample has done.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Seen {
    /// It was a sample between two steps.
    Sample,
    /// It completed a step.
    Step,
}

#[small]
impl Heater {
    /// A heater that is off, without settings.
    pub const OFF: Self = Self {
        kind: Kind::None,
        factors: Factors { p: 0, i: 0, d: 0, fan: 0, hysteresis: 0 },
        hottest: 0,
        least: 0,
        control: Control::OFF,
        watch: Watch::OFF,
        given: 0,
        sum: 0,
        samples: 0,
        missing: 0,
        word: 0,
        rests: 0,
        denied: 0,
        owed: 0,
        now: 0,
        level: 0,
    };

    /// Sets the value of a setting, scaled as stored. `row` is the row in the group of the hot end; the rows of the bed
    /// have equal numbers.
    #[inline(never)]
    pub fn set(&mut self, row: u8, value: i32) {
        let degrees = |value: i32| (value * i32::from(UNIT)) as i16;
        let factor = |value: i32| (value / 10) as u16;
        match row {
            hot_end::K => (self.kind, self.rests) = (Kind::of(value as u8), 0),
            hot_end::P => self.factors.p = factor(value),
            hot_end::I => self.factors.i = factor(value),
            hot_end::D => self.factors.d = factor(value),
            hot_end::F => self.factors.fan = value as u8,
            hot_end::HY => self.factors.hysteresis = (value * i32::from(UNIT) / 1_000) as u16,
            hot_end::MX => self.hottest = degrees(value),
            hot_end::MN => self.least = degrees(value),
            _ => {}
        }
    }

    /// The highest target that lines may set, eighths of a degree; 0 without a sensor.
    pub fn hottest(&self) -> u16 {
        if self.kind == Kind::None { 0 } else { self.hottest.unsigned_abs() / 8 }
    }

    /// The minimum temperature to move filament, degrees.
    pub fn least(&self) -> i16 {
        self.least / UNIT
    }

    /// Whether the temperature is more than `by`, 1/64 degree, below the minimum to move filament. Always false without
    /// a sensor.
    pub fn is_cold(&self, by: i16) -> bool {
        self.kind != Kind::None && self.now < self.least.saturating_sub(by)
    }

    /// The power of the heater's pin until the next sample, 255 for full power.
    pub fn level(&self) -> u8 {
        self.level
    }

    /// Returns the temperature of a single reading, 1/64 degree; `None` if the reading is missing.
    pub fn feels(&self, reading: Option<u16>) -> Option<Result<i16, Broken>> {
        reading.map(|reading| self.kind.temperature(reading))
    }

    /// Switches off at once.
    pub fn stop(&mut self) {
        self.level = 0;
        self.control.stop(self.now);
    }

    /// Returns the state that reports show, for the target `to`, eighths of a degree.
    pub fn standing(&self, to: u16) -> Standing {
        Standing { now: self.now / 8, to, power: self.control.power() }
    }

    /// Returns the distance to the target `to` (eighths of a degree), 1/64 degree; above 0 if the heater is too cold.
    pub fn error(&self, to: u16) -> i16 {
        in_units(to).saturating_sub(self.now)
    }

    /// Returns the reading of the sensor: `converted`, from the converter, or the word of a MAX6675, for which `ask` is
    /// called at every sixth sample. If `ask` returns none, the last word is used and `ask` is called again at the next
    /// sample; after [`DENIED`] samples the reading counts as missing.
    pub fn reading(
        &mut self,
        converted: Option<u16>,
        ask: impl FnOnce() -> Option<u16>,
    ) -> Option<u16> {
        if self.kind != Kind::Max6675 {
            return converted;
        }
        match self.rests.checked_sub(1) {
            Some(rests) => self.rests = rests,
            None => match ask() {
                Some(word) => (self.word, self.rests, self.denied) = (word, ASKED_EVERY - 1, 0),
                None if self.denied >= DENIED => return None,
                None => self.denied += 1,
            },
        }
        Some(self.word)
    }

    /// Takes a reading, `None` if it is missing. `number` is 0 for the hot end; `to` is the target, eighths of a
    /// degree; an autotune under way, `tune`, sets the power. The error is a fault, which leaves the heater off.
    #[inline(never)]
    pub fn sample(
        &mut self,
        number: u8,
        reading: Option<u16>,
        to: u16,
        fan: u8,
        tune: Option<&mut Tune>,
    ) -> Result<Seen, Status> {
        let wanted = if self.kind == Kind::None { 0 } else { in_units(to) };
        let seen = self.read(reading, wanted).and_then(|mean| match mean {
            None => Ok(Seen::Sample),
            Some(mean) => self.step(number, mean, wanted, fan, tune).map(|()| Seen::Step),
        });
        if seen.is_err() {
            self.stop();
        } else {
            let power = if wanted == 0 { 0 } else { self.control.power() };
            let pulsed = PULSED.get(usize::from(number)) == Some(&true);
            self.level = level(pulsed, &mut self.owed, power);
        }
        seen
    }

    /// Returns the mean temperature if a step is due. A broken sensor is no fault while the heater is off.
    fn read(&mut self, reading: Option<u16>, wanted: i16) -> Result<Option<i16>, Status> {
        let read = match reading {
            Some(reading) => {
                self.missing = 0;
                self.kind.temperature(reading)
            }
            None => {
                self.missing = self.missing.saturating_add(1);
                if self.missing < MISSING {
                    return Ok(None);
                }
                Err(Broken::Open)
            }
        };
        match read {
            Ok(now) => {
                self.sum += i32::from(now);
                self.samples += 1;
                if i32::from(self.samples) < STEPS {
                    return Ok(None);
                }
                let mean = (self.sum / STEPS) as i16;
                (self.sum, self.samples) = (0, 0);
                Ok(Some(mean))
            }
            Err(_) if wanted == 0 => {
                (self.sum, self.samples, self.now) = (0, 0, 0);
                Ok(None)
            }
            Err(Broken::Open) => Err(Status::SensorOpen),
            Err(Broken::Short) => Err(Status::SensorShort),
        }
    }

    fn step(
        &mut self,
        number: u8,
        mean: i16,
        wanted: i16,
        fan: u8,
        tune: Option<&mut Tune>,
    ) -> Result<(), Status> {
        self.now = mean;
        let (rise_s, reach) = if number == 0 { RULES[0] } else { RULES[1] };
        if self.kind != Kind::None {
            let rule = Rule { rise_s, hottest: self.hottest, reach };
            let given = core::mem::take(&mut self.given);
            // The fan cools the hot end.
            let wind = if number == 0 { fan } else { 0 };
            self.watch.step(mean, wanted, given, wind, &rule)?;
        }
        match (wanted, tune) {
            (0, _) => self.control.stop(mean),
            _ if self.watch.asks() => self.control.rest(mean),
            (_, Some(tune)) => self.control.drive(mean, tune.step(mean)),
            _ => {
                self.control.step(mean, wanted, fan, &self.factors);
            }
        }
        self.given = self.given.max(self.control.power());
        Ok(())
    }
}

/// Converts eighths of a degree to 1/64 degree.
#[small]
pub fn in_units(to: u16) -> i16 {
    (to.min(4_000) * 8) as i16
}

/// Equivalent rows of both heaters have equal numbers.
const _: () = {
    use crate::config::groups::bed;
    assert!(bed::K == hot_end::K && bed::P == hot_end::P && bed::I == hot_end::I);
    assert!(bed::D == hot_end::D && bed::F == hot_end::F && bed::HY == hot_end::HY);
    assert!(bed::MX == hot_end::MX);
};
