//! Comparisons of floats for dynamics. On AVR `f32::min` is a call that also sees to NaN.

/// The lesser of two numbers. Cost: 70.
#[inline]
pub fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater of two numbers. Cost: 70.
#[inline]
pub fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
