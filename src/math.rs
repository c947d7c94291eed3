//! The few float functions that dynamics and arcs need.
//!
//! On AVR these functions and all `f32` operations come from avr-libc. Its hand-written routines are five times faster
//! than Rust's own. `cargo xtask build` checks that an image uses them.
//!
//! Cost on AVR, cycles: add 130, mul 160, div 500, sqrt 490, sin and cos about 1,800, atan2 3,000.

use crate::hal::float;

/// Square root; 0 for a negative argument, which rounding produces where the true value is 0.
#[inline(never)]
pub fn sqrt(x: f32) -> f32 {
    // The bit patterns of the positive floats. Comparing them as integers takes a sixth of the time of a float
    // comparison.
    const LEAST: u32 = 1;
    const INFINITE: u32 = f32::INFINITY.to_bits();
    if (LEAST..=INFINITE).contains(&x.to_bits()) { float::sqrtf(x) } else { 0.0 }
}

/// Returns the nearest whole number, or the end of the range of `i32`.
#[inline(never)]
#[small]
pub fn round(x: f32) -> i32 {
    (if x < 0.0 { x - 0.5 } else { x + 0.5 }) as i32
}

/// Sine of an angle in radians.
pub fn sin(x: f32) -> f32 {
    float::sinf(x)
}

/// Cosine of an angle in radians.
pub fn cos(x: f32) -> f32 {
    float::cosf(x)
}

/// Raises a number above 0 to a power. Cost on AVR: 4,000 cycles.
pub fn pow(x: f32, power: f32) -> f32 {
    float::powf(x, power)
}

/// Angle of the point (x, y), -pi to pi radians.
pub fn atan2(y: f32, x: f32) -> f32 {
    float::atan2f(y, x)
}
