//! The spindle's PWM output. Keeps its settings for tests.

use super::Local;
use crate::hal::Exclusive;

machine_static! {
    fn frequency() -> Local<u32> = Local::new(0);
}

machine_static! {
    fn told() -> Local<f32> = Local::new(0.0);
}

/// Sets the frequency, in thousandths of a Hz.
pub fn set_frequency(_: Exclusive<'_>, millihertz: u32) {
    frequency().set(millihertz);
    told().set(0.0);
}

/// Sets the duty cycle, in thousandths.
pub fn set_share(_: Exclusive<'_>, share: f32) {
    told().set(share);
}

/// Returns the frequency, in thousandths of a Hz, and the duty cycle, in thousandths.
pub fn output() -> (u32, f32) {
    (frequency().get(), told().get())
}
