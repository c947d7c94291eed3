//! Heaters and their sensors: what tests say that the converter reads, and what the firmware has switched.

use super::Local;
use crate::heat::sensor::SAMPLES;

machine_static! {
    fn readings() -> Local<[u16; 2]> = Local::new([SAMPLES * 1_023; 2]);
}

machine_static! {
    fn begun() -> Local<u8> = Local::new(0);
}

machine_static! {
    fn switched() -> Local<u8> = Local::new(0);
}

/// Begins a reading of a heater's sensor.
pub fn begin(heater: u8) {
    begun().set(heater);
}

/// The reading that has been begun last.
pub fn reading() -> Option<u16> {
    readings().get().get(usize::from(begun().get())).copied()
}

/// Switches heaters and the fan: bits 0 hot end, 1 bed, 2 fan.
pub fn switch(on: u8) {
    switched().set(on);
}

/// The converter reads this of a heater's sensor from now on.
pub fn set(heater: usize, reading: u16) {
    let mut all = readings().get();
    if let Some(place) = all.get_mut(heater) {
        *place = reading;
    }
    readings().set(all);
}

/// What [`switch`] was told last.
pub fn on() -> u8 {
    switched().get()
}
