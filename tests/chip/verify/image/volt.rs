//! Converts the reference of 1.1 V against the supply.

use super::register::Register;

const ADCL: Register = Register::at(0x78);
const ADCH: Register = Register::at(0x79);
const ADCSRA: Register = Register::at(0x7A);
const ADCSRB: Register = Register::at(0x7B);
const ADMUX: Register = Register::at(0x7C);

/// Against AVCC; the input is the reference of 1.1 V.
const REFERENCE: u8 = 1 << 6 | 0b1_1110;
const ON: u8 = 1 << 7;
/// Set until the conversion is done.
const CONVERTS: u8 = 1 << 6;
/// 128 clocks for one of the converter.
const BY_128: u8 = 0b111;
/// Conversions until the reference has settled: 6 ms.
const CONVERSIONS: u8 = 60;

/// Returns the reading of ten bits: 225 at a supply of 5 V.
pub fn reading() -> u32 {
    ADCSRB.put(0);
    ADMUX.put(REFERENCE);
    for _ in 0..CONVERSIONS {
        ADCSRA.put(ON | CONVERTS | BY_128);
        while ADCSRA.get() & CONVERTS != 0 {}
    }
    // The low byte has to be read first.
    let low = ADCL.get();
    let reading = u16::from_le_bytes([low, ADCH.get()]);
    ADCSRA.put(0);
    reading.into()
}
