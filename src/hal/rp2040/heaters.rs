//! Heaters and their sensors: the analog-to-digital converter, and the pins.
//!
//! A reading is [`SAMPLES`] conversions of 12 bits one after the other, 2 us each. Their sum is scaled as if each had
//! 10 bits. [`begin`] waits for them, 64 us of thread mode each 20 ms: no interrupt, and nobody else uses the
//! converter. If the converter does not answer, there is no reading.
//!
//! `embassy-rp`'s `Adc` is not used: its `blocking_read` waits without end for a converter that does not answer, and its
//! pins are types.

use core::sync::atomic::{AtomicU16, Ordering};

use embassy_rp::pac::ADC;

use super::gpio;
use crate::boards::{ACTIVE, Heaters};
use crate::hal::{Boot, Thread};
use crate::heat::sensor::SAMPLES;

#[cfg(feature = "printer")]
const _: () = assert!(
    ACTIVE.heaters.is_some(),
    "this board has no heaters: leave `printer` out of its features"
);

const _: () = assert!(
    match &ACTIVE.heaters {
        Some(Heaters { heaters: [hot_end, bed], fan, cooler, .. }) => {
            let has_cooler = match cooler {
                Some(cooler) => !gpio::is_behind(*cooler),
                None => true,
            };
            has_cooler
                && !gpio::is_behind(hot_end.pin)
                && !gpio::is_behind(bed.pin)
                && !gpio::is_behind(*fan)
        }
        None => true,
    },
    "heaters and fans are at pins of the chip"
);

/// No reading.
const NONE: u16 = u16::MAX;
/// Polls of the converter before it counts as broken: some ten times the time of a conversion.
const PATIENCE: usize = 1_000;
/// Bits by which the sum is longer than a sum of 10-bit conversions.
const FINER: u32 = 2;

static READING: AtomicU16 = AtomicU16::new(NONE);

/// Connects the sensors.
pub(super) fn start(boot: &Boot) {
    let Some(Heaters { heaters, cooler, .. }) = ACTIVE.heaters else { return };
    heaters.iter().for_each(|heater| gpio::sense(boot, heater.channel));
    cooler.into_iter().for_each(gpio::output);
    ADC.cs().write(|w| w.set_en(true));
}

/// Takes a reading of a heater's sensor, and waits for it.
pub fn begin(_: Thread, heater: u8) {
    let Some(Heaters { heaters: [hot_end, bed], .. }) = ACTIVE.heaters else { return };
    let channel = if heater == 0 { hot_end.channel } else { bed.channel };
    ADC.cs().modify(|w| w.set_ainsel(channel));
    let sum = (0..SAMPLES).try_fold(0, |sum, _| Some(sum + u32::from(convert()?)));
    READING.store(sum.map_or(NONE, |sum| (sum >> FINER) as u16), Ordering::Relaxed);
}

/// Makes a conversion. `None` if the converter does not answer.
fn convert() -> Option<u16> {
    let is_ready = || (0..PATIENCE).any(|_| ADC.cs().read().ready());
    if !is_ready() {
        return None;
    }
    ADC.cs().modify(|w| w.set_start_once(true));
    is_ready().then(|| ADC.result().read().result())
}

/// Returns the last reading; `None` if the converter did not answer.
pub fn reading(_: Thread) -> Option<u16> {
    Some(READING.load(Ordering::Relaxed)).filter(|reading| *reading != NONE)
}

/// Always `None`: these boards have no MAX6675.
pub fn word(_: Thread, _: u8) -> Option<u16> {
    None
}

/// Switches both heaters off, until [`drive`] is called the next time: within 20 ms.
pub(super) fn pause(_: Thread) {
    let Some(Heaters { heaters, .. }) = ACTIVE.heaters else { return };
    heaters.iter().for_each(|heater| gpio::set(heater.pin, false));
}

/// Switches the hot end, the bed and the fan: off at 0, else on.
pub fn drive(_: Thread, power: [u8; 3]) {
    let Some(Heaters { heaters: [hot_end, bed], fan, .. }) = ACTIVE.heaters else { return };
    let [of_hot_end, of_bed, of_fan] = power.map(|power| power != 0);
    gpio::set(hot_end.pin, of_hot_end);
    gpio::set(bed.pin, of_bed);
    gpio::set(fan, of_fan);
}

/// Switches the fan of the heatbreak, if the board has one.
pub fn cool(_: Thread, on: bool) {
    let cooler = ACTIVE.heaters.and_then(|heaters| heaters.cooler);
    cooler.into_iter().for_each(|pin| gpio::set(pin, on));
}
