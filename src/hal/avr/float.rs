//! The float functions of avr-libc.
//!
//! Cost, cycles: `sqrtf` 490, `sinf` and `cosf` about 1,800, `atan2f` 3,000, `powf` 4,000. Thread mode and exec.

// avr-libc's `double` is 32 bits wide, and most of its functions have the name without the `f`.
unsafe extern "C" {
    /// The square root.
    #[link_name = "sqrt"]
    pub safe fn sqrtf(x: f32) -> f32;
    /// The sine of an angle in radians.
    #[link_name = "sin"]
    pub safe fn sinf(x: f32) -> f32;
    /// The cosine of an angle in radians.
    #[link_name = "cos"]
    pub safe fn cosf(x: f32) -> f32;
    /// A number above 0 to a power.
    #[link_name = "pow"]
    pub safe fn powf(x: f32, power: f32) -> f32;
    /// The angle of the point (x, y), -pi to pi radians.
    #[link_name = "atan2"]
    pub safe fn atan2f(y: f32, x: f32) -> f32;
}

/// Links avr-libc and libgcc. The crate of the image has to use it: then the linker takes these archives before
/// `compiler_builtins`, whose float functions take five times as long.
#[macro_export]
macro_rules! link_libraries {
    () => {
        #[link(name = "c")]
        #[link(name = "m")]
        #[link(name = "gcc")]
        unsafe extern "C" {}
    };
}
