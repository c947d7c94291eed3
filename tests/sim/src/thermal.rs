//! The heaters of a printer around the chip: its pins heat them, and its converter reads their sensors.
//!
//! [`Plant`] says where the heat goes. Each [`EVERY_MS`] the levels of the pins are looked at, the temperatures worked out, and the voltages of
//! the sensors, with noise, put at the converter's channels. A sensor can be broken while the machine runs.

use kerf::boards::Heaters;
use kerf::heat::sensor::{Kind, share};

use crate::mechanics::Random;

#[path = "../../support/plant.rs"]
mod plant;

pub use plant::{AIR, Plant};

/// Time between two looks at the pins, ms.
pub const EVERY_MS: u64 = 1;
/// How often a sample is kept, looks.
const SAMPLE: u64 = 100;
/// The converter's supply, mV.
const SUPPLY: f64 = 5_000.0;
/// Noise of a sensor's wire, mV from end to end.
const NOISE: f64 = 8.0;

/// A heater of a printer.
pub const HOT_END: usize = 0;
/// See [`HOT_END`].
pub const BED: usize = 1;

/// Temperatures at one time, in degrees.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sample {
    /// The cycle.
    pub cycle: u64,
    /// What the sensors of the hot end and the bed feel.
    pub degrees: [f64; 2],
}

/// The heaters, their sensors and the fan.
pub struct Thermal {
    pins: Heaters,
    plants: [Plant; 2],
    /// Which sensor each of them has.
    kinds: [Kind; 2],
    /// What a wire that is off, or shorted, makes of a sensor, mV.
    broken: [Option<u32>; 2],
    random: Random,
    looks: u64,
    samples: Vec<Sample>,
}

impl Thermal {
    /// At the temperature of the room.
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

    /// A heater and what its sensor feels.
    pub fn plant(&self, heater: usize) -> &Plant {
        &self.plants[heater]
    }

    /// A heater, to be made hot or cold.
    pub fn plant_mut(&mut self, heater: usize) -> &mut Plant {
        &mut self.plants[heater]
    }

    /// From now on the wire of a sensor has this voltage, mV, whatever the sensor feels; `None` mends it.
    pub fn break_wire(&mut self, heater: usize, millivolts: Option<u32>) {
        self.broken[heater] = millivolts;
    }

    /// The temperatures so far, ten in a second.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The pins of the heaters and the fan.
    pub(crate) fn pins(&self) -> &Heaters {
        &self.pins
    }

    /// Time passes with so much of their power at the heaters and the fan, 1 for all; what the converter's channels are at from then on, mV.
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

    /// The voltage of a sensor, mV.
    fn felt(&mut self, heater: usize) -> u32 {
        let noise = (self.random.below(1 << 16) as f64 / 65_536.0 - 0.5) * NOISE;
        let volts = share(self.kinds[heater], self.plants[heater].sensor) * SUPPLY;
        (volts + noise).round().clamp(0.0, SUPPLY) as u32
    }
}
