//! Heaters and their sensors. Tests set the readings of the converter, and see what the firmware has switched.

use super::Local;
use crate::hal::Thread;
use crate::heat::sensor::SAMPLES;

machine_static! {
    fn readings() -> Local<[Option<u16>; 2]> = Local::new([None; 2]);
}

machine_static! {
    fn begun() -> Local<u8> = Local::new(0);
}

machine_static! {
    fn switched() -> Local<u8> = Local::new(0);
}

/// Begins a reading of a heater's sensor.
pub fn begin(_: Thread, heater: u8) {
    begun().set(heater);
}

/// Returns the reading that was begun last; the highest one if no sensor is there.
pub fn reading(thread: Thread) -> Option<u16> {
    Some(word(thread, begun().get()).unwrap_or(SAMPLES * 1_023))
}

/// Returns the word that the MAX6675 of a heater sends; `None` if the heater has no MAX6675.
pub fn word(_: Thread, heater: u8) -> Option<u16> {
    readings().get().get(usize::from(heater)).copied().flatten()
}

/// Switches the hot end, the bed and the fan: off at 0, else on.
pub fn drive(_: Thread, power: [u8; 3]) {
    let [hot_end, bed, fan] = power.map(|power| u8::from(power != 0));
    switched().set(hot_end | bed << 1 | fan << 2);
}

/// Does nothing: the host's board has no fan for the heatbreak.
pub fn cool(_: Thread, _: bool) {}

/// Sets what the converter reads of a heater's sensor from now on.
pub fn set(heater: usize, reading: u16) {
    let mut all = readings().get();
    if let Some(place) = all.get_mut(heater) {
        *place = Some(reading);
    }
    readings().set(all);
}

/// Returns what [`drive`] has switched on: bits 0 hot end, 1 bed, 2 fan.
pub fn on() -> u8 {
    switched().get()
}
