//! The heaters of a printer around the chip. The chip's pins heat them, and its converter reads their sensors.
//!
//! [`Plant`] is the thermal model. Every [`EVERY_MS`] the levels of the pins are read, the temperatures computed, and
//! the voltages of the sensors, with noise, put at the converter's channels. A sensor can be broken while the machine
//! runs.

use kerf::boards::Heaters;
use kerf::heat::sensor::{Kind, share};

use crate::mechanics::Random;

#[path = "../../support/plant.rs"]
mod plant;

pub use plant::{AIR, Plant};

/// Time between two computations, ms.
pub const EVERY_MS: u64 = 1;
/// Number of computations between two samples.
const SAMPLE: u64 = 100;
/// The converter's supply, mV: what a sensor's voltage is a share of.
pub(crate) const SUPPLY: f64 = 5_000.0;
/// Peak-to-peak noise of a sensor's wire, mV.
const NOISE: f64 = 8.0;

/// Index of the hot end among the heaters.
pub const HOT_END: usize = 0;
/// Index of the bed among the heaters.
pub const BED: usize = 1;

/// Temperatures at one time, degrees.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sample {
    /// The cycle.
    pub cycle: u64,
    /// The temperatures of the sensors of the hot end and the bed.
    pub degrees: [f64; 2],
}

/// The heaters, their sensors and the fan.
pub struct Thermal {
    pins: Heaters,
    plants: [Plant; 2],
    /// The kind of each heater's sensor.
    kinds: [Kind; 2],
    /// The voltage of each sensor whose wire is open or shorted, mV; `None` for a sensor that works.
    broken: [Option<u32>; 2],
    random: Random,
    looks: u64,
    samples: Vec<Sample>,
}

impl Thermal {
    /// Heaters at room temperature.
    pub fn new(pins: Heaters) -> Self {
        Self {
            pins,
            plants: [Plant::hot_end(), Plant::bed()],
            kinds: [Kind::Semitec, Kind::Semitec],
            broken: [None; 2],
            random: Random::new(1),
            looks: 0,
            samples: Vec::new(),
        }
    }

    /// Returns the model of a heater and its sensor.
    pub fn plant(&self, heater: usize) -> &Plant {
        &self.plants[heater]
    }

    /// Returns the model of a heater, to be made hot or cold.
    pub fn plant_mut(&mut self, heater: usize) -> &mut Plant {
        &mut self.plants[heater]
    }

    /// Forces the voltage on the wire of a sensor from now on, mV; `None` restores the sensor.
    pub fn break_wire(&mut self, heater: usize, millivolts: Option<u32>) {
        self.broken[heater] = millivolts;
    }

    /// Returns the temperatures so far, ten samples in a second.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The pins of the heaters and the fan.
    pub(crate) fn pins(&self) -> &Heaters {
        &self.pins
    }

    /// Advances the time by [`EVERY_MS`], with the given share of full power (0 to 1) at the heaters and the fan.
    /// Returns the converter's channels with their new voltages, mV.
    pub(crate) fn pass(&mut self, power: [f64; 2], fan: f64, cycle: u64) -> [(u8, u32); 2] {
        let seconds = EVERY_MS as f64 / 1e3;
        self.plants
            .iter_mut()
            .zip(power)
            .for_each(|(plant, power)| plant.pass(seconds, power, fan));
        if self.looks.is_multiple_of(SAMPLE) {
            let degrees = self.plants.each_ref().map(|plant| plant.sensor);
            self.samples.push(Sample { cycle, degrees });
        }
        self.looks += 1;
        std::array::from_fn(|heater| {
            let channel = self.pins.heaters[heater].channel;
            let felt = self.felt(heater);
            (channel, self.broken[heater].unwrap_or(felt))
        })
    }

    /// Returns the voltage of a sensor, mV.
    fn felt(&mut self, heater: usize) -> u32 {
        let noise = (self.random.below(1 << 16) as f64 / 65_536.0 - 0.5) * NOISE;
        let volts = share(self.kinds[heater], self.plants[heater].sensor) * SUPPLY;
        (volts + noise).round().clamp(0.0, SUPPLY) as u32
    }
}
