//! Sensors of temperature: what the converter reads, and how hot that is.
//!
//! A reading is the sum of [`SAMPLES`] conversions of 10 bits, taken one after the other: noise of the wires makes it finer than one
//! conversion. A thermistor hangs between pin and ground, with 4,700 ohms from the pin to the supply, as on RAMPS; its table is worked out
//! when the firmware is built, from its resistance at 25 degrees and its beta. Between two entries, 5 degrees apart, it is a straight line:
//! 0.15 degrees off at most. An AD595 gives 10 mV a degree. Cost of a reading: 2,500 cycles.

use crate::progmem::Progmem;

/// Conversions in a reading.
pub const SAMPLES: u16 = 32;
/// The highest reading.
const FULL: u16 = SAMPLES * 1_023;
/// Temperatures are worked out in 1/64 degree.
pub const UNIT: i16 = 64;

/// Which sensor a heater has.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[repr(u8)]
pub enum Kind {
    /// There is no such heater.
    #[default]
    None = 0,
    /// Semitec 104GT-2: 100,000 ohms, beta 4267.
    Semitec = 1,
    /// EPCOS B57560G104F: 100,000 ohms, beta 4092.
    Epcos = 2,
    /// Thermocouple of type K with an AD595.
    Ad595 = 3,
}

/// What is wrong with a sensor.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Broken {
    /// The sensor reads as if a wire were off.
    Open,
    /// The sensor reads as if its wires touched.
    Short,
}

/// Temperatures of the entries, degrees.
const LOW: i16 = -20;
const STEP: i16 = 5;
const ENTRIES: usize = 76;

/// Beyond these the sensor is broken: colder than -20 degrees, hotter than 355.
const MARGIN: u16 = SAMPLES * 2;

crate::progmem! {
    /// The reading at each temperature, falling.
    static SEMITEC: [u16; ENTRIES] = thermistor(100_000.0, 4_267.0);
    static EPCOS: [u16; ENTRIES] = thermistor(100_000.0, 4_092.0);
}

const _: () = assert!(SAMPLES as u32 * 1_023 <= i16::MAX as u32 + 1);

/// From the pin to the supply, ohms.
const PULL_UP: f64 = 4_700.0;

/// The table of a thermistor.
const fn thermistor(at_25: f64, beta: f64) -> [u16; ENTRIES] {
    let mut table = [0; ENTRIES];
    let mut n = 0;
    while n < ENTRIES {
        let kelvin = 273.15 + LOW as f64 + n as f64 * STEP as f64;
        let ohms = at_25 * exp(beta * (1.0 / kelvin - 1.0 / 298.15));
        // A conversion gives the step below: half of one too little.
        let reading = SAMPLES as f64 * (1_024.0 * ohms / (ohms + PULL_UP) - 0.5);
        table[n] = if reading < 0.0 { 0 } else { (reading + 0.5) as u16 };
        n += 1;
    }
    table
}

/// The exponential function, for tables that are made when the firmware is built.
const fn exp(x: f64) -> f64 {
    // exp(x) is exp(x / 1024) squared ten times.
    let x = x / 1_024.0;
    let mut power = 1.0 + x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0)));
    let mut n = 0;
    while n < 10 {
        power *= power;
        n += 1;
    }
    power
}

#[small]
impl Kind {
    /// The kind of a setting's value.
    pub fn of(value: u8) -> Self {
        match value {
            1 => Self::Semitec,
            2 => Self::Epcos,
            3 => Self::Ad595,
            _ => Self::None,
        }
    }

    /// How hot it is, in 1/64 degree.
    #[inline(never)]
    pub fn temperature(self, reading: u16) -> Result<i16, Broken> {
        match self {
            Self::None => Ok(0),
            Self::Semitec => of_table(&SEMITEC, reading),
            Self::Epcos => of_table(&EPCOS, reading),
            // 500 degrees are all that the converter can read: an amplifier without its thermocouple gives that.
            Self::Ad595 if reading > FULL - MARGIN => Err(Broken::Open),
            Self::Ad595 => {
                // Half of a step, by which each conversion is too little.
                let product = (u32::from(reading) + u32::from(SAMPLES / 2)) * (500 * UNIT as u32);
                Ok((product / (u32::from(SAMPLES) * 1_024)) as i16)
            }
        }
    }
}

/// Looks a reading up in a falling table.
#[inline(never)]
#[small]
fn of_table(table: &Progmem<[u16; ENTRIES]>, reading: u16) -> Result<i16, Broken> {
    let mut before = match table.at(0) {
        Some(first) if reading <= first => first,
        _ => return Err(Broken::Open),
    };
    for n in 1..ENTRIES {
        let Some(entry) = table.at(n) else { break };
        if reading >= entry {
            let part = u32::from(before - reading) * (STEP * UNIT) as u32;
            let part = part / u32::from(before - entry).max(1);
            let whole = (LOW + STEP * (n as i16 - 1)) * UNIT;
            return Ok(whole + part as i16);
        }
        before = entry;
    }
    Err(Broken::Short)
}

/// What the converter reads on average at a temperature in degrees, without noise; for tests.
#[cfg(feature = "std")]
pub fn reading(kind: Kind, degrees: f64) -> f64 {
    (f64::from(SAMPLES) * (1_024.0 * share(kind, degrees) - 0.5)).clamp(0.0, FULL.into())
}

/// The part of the supply that a sensor of a kind gives at a temperature in degrees; for tests and simulated machines.
#[cfg(feature = "std")]
pub fn share(kind: Kind, degrees: f64) -> f64 {
    let beta = match kind {
        Kind::None => return 1.0,
        Kind::Semitec => 4_267.0,
        Kind::Epcos => 4_092.0,
        Kind::Ad595 => return (degrees / 500.0).clamp(0.0, 1.0),
    };
    let ohms = 100_000.0 * (beta * (1.0 / (degrees + 273.15) - 1.0 / 298.15)).exp();
    ohms / (ohms + PULL_UP)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_temperature_is_read_within_a_quarter_of_a_degree() {
        for kind in [Kind::Semitec, Kind::Epcos, Kind::Ad595] {
            let from = if kind == Kind::Ad595 { 0 } else { -15 };
            for degrees in from..300 {
                let reading = reading(kind, degrees.into()).round() as u16;
                let read = f64::from(kind.temperature(reading).unwrap()) / f64::from(UNIT);
                assert!((read - f64::from(degrees)).abs() < 0.25, "{kind:?} {degrees}: {read}");
            }
        }
    }

    #[test]
    fn broken_wires_are_told_apart() {
        for kind in [Kind::Semitec, Kind::Epcos] {
            assert_eq!(kind.temperature(FULL), Err(Broken::Open));
            assert_eq!(kind.temperature(0), Err(Broken::Short));
            assert_eq!(kind.temperature(SAMPLES * 5), Err(Broken::Short));
        }
        assert_eq!(Kind::Ad595.temperature(FULL), Err(Broken::Open));
        assert_eq!(Kind::None.temperature(FULL), Ok(0));
    }

    #[test]
    fn any_reading_is_a_temperature_or_a_fault() {
        for kind in [Kind::Semitec, Kind::Epcos, Kind::Ad595] {
            let mut last = None;
            for reading in 0..=u16::MAX {
                let now = kind.temperature(reading);
                if let (Some(Ok(last)), Ok(now)) = (last, now) {
                    let falls = kind != Kind::Ad595;
                    assert!(if falls { now <= last } else { now >= last }, "{kind:?} {reading}");
                }
                last = Some(now);
            }
        }
    }
}
