//! Converts voltages against the supply: readings of ten bits, 1,023 at the supply.

use super::register::Register;

const ADCL: Register = Register::at(0x78);
const ADCH: Register = Register::at(0x79);
const ADCSRA: Register = Register::at(0x7A);
const ADCSRB: Register = Register::at(0x7B);
const ADMUX: Register = Register::at(0x7C);

/// Against AVCC.
const AGAINST_SUPPLY: u8 = 1 << 6;
/// The input is the reference of 1.1 V.
const REFERENCE: u8 = 0b1_1110;
/// The input is A5.
const A5: u8 = 5;
const ON: u8 = 1 << 7;
/// Set until the conversion is done.
const CONVERTS: u8 = 1 << 6;
/// 128 clocks for one of the converter.
const BY_128: u8 = 0b111;
/// Conversions until the reference has settled: 6 ms.
const SETTLES: u16 = 60;
/// Conversions of a mean: 106 ms.
const MEAN: u16 = 1_024;

/// Returns the reading of the reference: 225 at a supply of 5 V.
pub fn supply() -> u32 {
    convert(REFERENCE, SETTLES).0
}

/// Returns the mean of the readings at A5 in a tenth of a second.
pub fn mean_at_a5() -> u32 {
    convert(A5, MEAN).1 / u32::from(MEAN)
}

/// Returns the last reading of an input, and the sum of all.
fn convert(input: u8, conversions: u16) -> (u32, u32) {
    ADCSRB.put(0);
    ADMUX.put(AGAINST_SUPPLY | input);
    let (mut last, mut sum) = (0, 0);
    for _ in 0..conversions {
        ADCSRA.put(ON | CONVERTS | BY_128);
        while ADCSRA.get() & CONVERTS != 0 {}
        // The low byte has to be read first.
        let low = ADCL.get();
        last = u32::from(u16::from_le_bytes([low, ADCH.get()]));
        sum += last;
    }
    ADCSRA.put(0);
    (last, sum)
}
