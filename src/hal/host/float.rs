//! The functions that `avr/float.rs` takes from avr-libc, from the standard library.

/// The square root.
pub fn sqrtf(x: f32) -> f32 {
    x.sqrt()
}

/// The sine of an angle in radians.
pub fn sinf(x: f32) -> f32 {
    x.sin()
}

/// The cosine of an angle in radians.
pub fn cosf(x: f32) -> f32 {
    x.cos()
}

/// A number above 0 to a power.
pub fn powf(x: f32, power: f32) -> f32 {
    x.powf(power)
}

/// The angle of the point (x, y), -pi to pi radians.
pub fn atan2f(y: f32, x: f32) -> f32 {
    y.atan2(x)
}
