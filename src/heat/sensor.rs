//! Temperature sensors: conversion of readings to temperatures.
//!
//! A reading is the sum of [`SAMPLES`] successive conversions of 10 bits; noise of the wires makes the sum finer than
//! one conversion. A thermistor is between pin and ground, with a pull-up of 4,700 ohms, as on RAMPS. Its table is
//! computed when the firmware is built, from its resistance at 25 degrees and its beta. Entries are 5 degrees apart;
//! linear interpolation between them is 0.15 degrees off at most. An AD595 gives 10 mV a degree, an AD8495 5 mV. A
//! PT100 has an amplifier (E3D's): ten times its voltage in series with 4,400 ohms at 5 V. Cost of a reading: 2,500
//! cycles.
//!
//! A MAX6675 is read over SPI, and its reading is the word that it sends: quarters of a degree from bit 3 on, bit 2 for
//! an open thermocouple. It converts for 220 ms after each reading.

use crate::progmem::Progmem;

/// Conversions in a reading.
pub const SAMPLES: u16 = 32;
/// The highest reading.
const FULL: u16 = SAMPLES * 1_023;
/// Temperatures are computed in 1/64 degree.
pub const UNIT: i16 = 64;

/// The kind of a heater's sensor.
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
    /// Thermocouple of type K with an AD595: 10 mV a degree.
    Ad595 = 3,
    /// PT100 with E3D's amplifier.
    Pt100 = 4,
    /// Thermocouple of type K with an AD8495: 5 mV a degree.
    Ad8495 = 5,
    /// Thermocouple of type K with a MAX6675, over SPI.
    Max6675 = 6,
}

/// Bits of a MAX6675's word that must be 0: the dummy sign bit, the bit of an open thermocouple, and the device ID.
/// Without the chip the line is high.
const MAX6675_FAULT: u16 = 1 << 15 | 1 << 2 | 1 << 1;

/// The fault of a sensor.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Broken {
    /// The sensor reads as if a wire were off.
    Open,
    /// The sensor reads as if its wires touched.
    Short,
}

/// Temperatures of the entries, degrees: -20 to 355. A reading beyond these is that of a broken sensor.
const LOW: i16 = -20;
const STEP: i16 = 5;
const ENTRIES: usize = 76;

/// A reading of an amplifier that is this near to the highest one is that of an open sensor.
const MARGIN: u16 = SAMPLES * 2;

crate::progmem! {
    /// The reading at each temperature, in falling order.
    static SEMITEC: [u16; ENTRIES] = thermistor(100_000.0, 4_267.0);
    static EPCOS: [u16; ENTRIES] = thermistor(100_000.0, 4_092.0);
    /// The highest reading less the reading at each temperature.
    static PT100: [u16; ENTRIES] = pt100();
}

const _: () = assert!(SAMPLES as u32 * 1_023 <= i16::MAX as u32 + 1);

/// Pull-up resistor, ohms.
const PULL_UP: f64 = 4_700.0;

/// Returns the table of a thermistor.
const fn thermistor(at_25: f64, beta: f64) -> [u16; ENTRIES] {
    let mut table = [0; ENTRIES];
    let mut n = 0;
    while n < ENTRIES {
        let kelvin = 273.15 + LOW as f64 + n as f64 * STEP as f64;
        let ohms = at_25 * exp(beta * (1.0 / kelvin - 1.0 / 298.15));
        // A conversion rounds down, which is half a step too little on average.
        let reading = SAMPLES as f64 * (1_024.0 * ohms / (ohms + PULL_UP) - 0.5);
        table[n] = if reading < 0.0 { 0 } else { (reading + 0.5) as u16 };
        n += 1;
    }
    table
}

/// Returns the table of a PT100 with its amplifier, from the resistances of IEC 60751.
const fn pt100() -> [u16; ENTRIES] {
    let mut table = [0; ENTRIES];
    let mut n = 0;
    while n < ENTRIES {
        let reading =
            SAMPLES as f64 * (1_024.0 * pt100_share(LOW as f64 + n as f64 * STEP as f64) - 0.5);
        table[n] = FULL - (reading + 0.5) as u16;
        n += 1;
    }
    table
}

/// Returns the output of the PT100's amplifier, as a share of the supply.
const fn pt100_share(degrees: f64) -> f64 {
    let ohms = 100.0 * (1.0 + degrees * (3.9083e-3 - 5.775e-7 * degrees));
    10.0 * ohms / (ohms + 4_400.0)
}

/// The exponential function, for tables that are computed when the firmware is built.
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
    /// Returns the kind that a value of the setting selects.
    pub fn of(value: u8) -> Self {
        match value {
            1 => Self::Semitec,
            2 => Self::Epcos,
            3 => Self::Ad595,
            4 => Self::Pt100,
            5 => Self::Ad8495,
            6 => Self::Max6675,
            _ => Self::None,
        }
    }

    /// Converts a reading to a temperature, 1/64 degree. The error is that of a broken sensor.
    #[inline(never)]
    pub fn temperature(self, reading: u16) -> Result<i16, Broken> {
        match self {
            Self::None => Ok(0),
            Self::Semitec => of_table(&SEMITEC, reading),
            Self::Epcos => of_table(&EPCOS, reading),
            Self::Pt100 => {
                of_table(&PT100, FULL.saturating_sub(reading)).map_err(|broken| match broken {
                    // The resistance of a PT100 rises with the temperature.
                    Broken::Open => Broken::Short,
                    Broken::Short => Broken::Open,
                })
            }
            Self::Ad595 => of_line(reading, 500),
            Self::Ad8495 => of_line(reading, 1_000),
            Self::Max6675 if reading & MAX6675_FAULT != 0 => Err(Broken::Open),
            // A chip without supply holds the line low.
            Self::Max6675 if reading >> 3 == 0 => Err(Broken::Short),
            Self::Max6675 => Ok(((reading >> 3).min(2_047) * 16) as i16),
        }
    }
}

/// Converts a voltage that is proportional to the temperature: 0 at 0 degrees, the supply at `full` degrees. The
/// highest readings are those of an amplifier without its thermocouple.
#[inline(never)]
#[small]
fn of_line(reading: u16, full: u16) -> Result<i16, Broken> {
    if reading > FULL - MARGIN {
        return Err(Broken::Open);
    }
    // Adds half a step for each conversion, because conversions round down. 510 degrees are the most that an `i16`
    // holds.
    let sum = u32::from(reading) + u32::from(SAMPLES / 2);
    let degrees = sum * (u32::from(full) * UNIT as u32) / (u32::from(SAMPLES) * 1_024);
    Ok(degrees.min(510 * UNIT as u32) as i16)
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

/// Returns the mean reading at a temperature in degrees, without noise; for tests.
#[cfg(feature = "std")]
pub fn reading(kind: Kind, degrees: f64) -> f64 {
    if kind == Kind::Max6675 {
        return f64::from((degrees.clamp(0.0, 1_023.75) * 4.0) as u16) * 8.0;
    }
    (f64::from(SAMPLES) * (1_024.0 * share(kind, degrees) - 0.5)).clamp(0.0, FULL.into())
}

/// Returns the output of a sensor at a temperature in degrees, as a share of the supply; for tests and simulated
/// machines.
#[cfg(feature = "std")]
pub fn share(kind: Kind, degrees: f64) -> f64 {
    let beta = match kind {
        Kind::None | Kind::Max6675 => return 1.0,
        Kind::Semitec => 4_267.0,
        Kind::Epcos => 4_092.0,
        Kind::Ad595 => return (degrees / 500.0).clamp(0.0, 1.0),
        Kind::Ad8495 => return (degrees / 1_000.0).clamp(0.0, 1.0),
        Kind::Pt100 => return pt100_share(degrees).clamp(0.0, 1.0),
    };
    let ohms = 100_000.0 * (beta * (1.0 / (degrees + 273.15) - 1.0 / 298.15)).exp();
    ohms / (ohms + PULL_UP)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Kind; 6] =
        [Kind::Semitec, Kind::Epcos, Kind::Ad595, Kind::Pt100, Kind::Ad8495, Kind::Max6675];

    fn rises(kind: Kind) -> bool {
        !matches!(kind, Kind::Semitec | Kind::Epcos)
    }

    #[test]
    fn every_temperature_is_read_within_a_quarter_of_a_degree() {
        for kind in ALL {
            let from = if rises(kind) { 1 } else { -15 };
            for degrees in from..340 {
                let reading = reading(kind, degrees.into()).round() as u16;
                let read = f64::from(kind.temperature(reading).unwrap()) / f64::from(UNIT);
                assert!((read - f64::from(degrees)).abs() <= 0.25, "{kind:?} {degrees}: {read}");
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
        for kind in [Kind::Ad595, Kind::Ad8495, Kind::Pt100] {
            assert_eq!(kind.temperature(FULL), Err(Broken::Open));
        }
        assert_eq!(Kind::Pt100.temperature(0), Err(Broken::Short));
        let max6675 = |word| Kind::Max6675.temperature(word);
        let at_25 = reading(Kind::Max6675, 25.0) as u16;
        assert_eq!(max6675(at_25), Ok(25 * UNIT));
        // The thermocouple is open; the chip is missing; the chip has no supply.
        assert_eq!(max6675(at_25 | 4), Err(Broken::Open));
        assert_eq!(max6675(u16::MAX), Err(Broken::Open));
        assert_eq!(max6675(0), Err(Broken::Short));
        assert_eq!(Kind::None.temperature(FULL), Ok(0));
    }

    #[test]
    fn any_reading_is_a_temperature_or_a_fault() {
        for kind in ALL {
            let mut last = None;
            let step = if kind == Kind::Max6675 { 8 } else { 1 };
            for reading in (0..=u16::MAX).step_by(step) {
                let now = kind.temperature(reading);
                if let (Some(Ok(last)), Ok(now)) = (last, now) {
                    let falls = !rises(kind);
                    assert!(if falls { now <= last } else { now >= last }, "{kind:?} {reading}");
                }
                last = Some(now);
            }
        }
    }
}
