//! The few float functions that dynamics and arcs need.
//!
//! On AVR they come from avr-libc. The image names `m` and `gcc` (`main.rs`), which puts those archives
//! before `compiler_builtins` in the link, so that every `f32` operation uses their hand-written
//! routines, five times faster than Rust's own; `cargo xtask build` checks that it stays so.
//!
//! Cost on AVR, cycles: add 130, mul 160, div 500, sqrt 490, sin and cos about 1,800, atan2 3,000.

#[cfg(target_arch = "avr")]
mod routines {
    // avr-libc's `double` is 32 bits wide, and most of its functions go by the name without the `f`.
    unsafe extern "C" {
        #[link_name = "sqrt"]
        pub safe fn sqrtf(x: f32) -> f32;
        #[link_name = "sin"]
        pub safe fn sinf(x: f32) -> f32;
        #[link_name = "cos"]
        pub safe fn cosf(x: f32) -> f32;
        #[link_name = "atan2"]
        pub safe fn atan2f(y: f32, x: f32) -> f32;
    }
}

#[cfg(not(target_arch = "avr"))]
mod routines {
    pub fn sqrtf(x: f32) -> f32 {
        x.sqrt()
    }
    pub fn sinf(x: f32) -> f32 {
        x.sin()
    }
    pub fn cosf(x: f32) -> f32 {
        x.cos()
    }
    pub fn atan2f(y: f32, x: f32) -> f32 {
        y.atan2(x)
    }
}

/// Square root; 0 for a negative argument, which rounding produces where the true value is 0.
pub fn sqrt(x: f32) -> f32 {
    if x > 0.0 { routines::sqrtf(x) } else { 0.0 }
}

/// Sine of an angle in radians.
pub fn sin(x: f32) -> f32 {
    routines::sinf(x)
}

/// Cosine of an angle in radians.
pub fn cos(x: f32) -> f32 {
    routines::cosf(x)
}

/// Angle of the point (x, y), -pi to pi radians.
pub fn atan2(y: f32, x: f32) -> f32 {
    routines::atan2f(y, x)
}
