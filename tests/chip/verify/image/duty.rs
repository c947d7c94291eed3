//! Pulses at the pin of the spindle, as Kerf makes them: by timer 4, phase and frequency correct up to ICR4, 1 kHz. A
//! jumper from that pin to A5 lets the converter measure for which share of the time the pin is high.

use super::register::Register;
use super::{converter, timers};

const TCCR4A: Register = Register::at(0xA0);
const TCCR4B: Register = Register::at(0xA1);
const ICR4L: u16 = 0xA6;
const OCR4AL: u16 = 0xA8;
const DDRH: Register = Register::at(0x101);
/// OC4A is D6, which is bit 3; OC4B, D7, is the next one.
const FIRST_PIN: u32 = 3;
/// Counts up to ICR and down again, 8 clocks a count.
const RUN: u8 = 1 << 4 | 0b010;
/// Sets the pin on the way down, and clears it on the way up. For channel A; channel B is two bits lower.
const CONNECTED: u8 = 0b10 << 6;
/// Half a millisecond.
const TOP: u16 = 1_000;

/// Returns the mean reading at A5 with pulses of a quarter, a half and three quarters. `None` if there is no such
/// channel. Afterwards all pins are inputs.
pub fn readings(channel: u32) -> Option<[u32; 3]> {
    if channel > 1 {
        return None;
    }
    timers::stop();
    put_wide(ICR4L, TOP);
    TCCR4A.put(CONNECTED >> (2 * channel));
    TCCR4B.put(RUN);
    DDRH.put(1 << (FIRST_PIN + channel));
    let readings = [TOP / 4, TOP / 2, TOP / 4 * 3].map(|compare| {
        put_wide(OCR4AL + 2 * channel as u16, compare);
        converter::mean_at_a5()
    });
    DDRH.put(0);
    timers::stop();
    Some(readings)
}

/// Writes a register of two bytes, the high one first.
fn put_wide(low: u16, value: u16) {
    let [low_byte, high_byte] = value.to_le_bytes();
    Register::at(low + 1).put(high_byte);
    Register::at(low).put(low_byte);
}
