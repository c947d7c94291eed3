//! The settings of homing, in the units that the rest of the firmware works in.
//!
//! They are in EEPROM alone, for they are asked for once a cycle. Axes count from 0; one that does not home reads 0.
//! Cost on AVR: a search of the log, up to 3 ms.

use super::Storage;
use crate::config::table::homing;
use crate::config::{Owner, Setting};
use crate::units::Length;

#[small]
impl Storage {
    /// Jerk limit while homing and probing, mm or degrees per minute cubed.
    pub fn jerk_homing(&self, axis: usize) -> f32 {
        self.homing(axis, homing::JH) as f32 * 1e3
    }

    /// Speed towards a homing switch, mm or degrees per minute.
    pub fn search_velocity(&self, axis: usize) -> f32 {
        self.homing(axis, homing::SV) as f32 * 1e-3
    }

    /// Speed off a homing switch, mm or degrees per minute.
    pub fn latch_velocity(&self, axis: usize) -> f32 {
        self.homing(axis, homing::LV) as f32 * 1e-3
    }

    /// Way off a homing switch before it is latched.
    pub fn latch_backoff(&self, axis: usize) -> Length {
        Length(self.homing(axis, homing::LB))
    }

    /// Way from the latched switch to zero.
    pub fn zero_backoff(&self, axis: usize) -> Length {
        Length(self.homing(axis, homing::ZB))
    }

    #[inline(never)]
    fn homing(&self, axis: usize, row: u8) -> i32 {
        Setting::of(Owner::Axis(axis as u8), row).map_or(0, |setting| self.cold(setting))
    }
}
