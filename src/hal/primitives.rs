//! What a chip has to provide that touches no register: fast arithmetic, text, floats, reads of program memory.
//!
//! These functions may be called at any level. A chip without faster ones takes those of `host`, which are plain
//! Rust.

use super::contract::contract;
use super::imp;

contract! {
    /// Arithmetic for which the compiler's own takes several times as long on a small chip.
    trait Arithmetic in arithmetic {
        /// Returns `a / b` and `a % b` if the quotient fits 16 bits: `a >> 16 < b`. Otherwise the result is
        /// arbitrary, without a panic. Cost: 200, 120 if the quotient fits eight bits.
        fn divide(a: u32, b: u16) -> (u16, u16);
        /// Returns `a / b` if the quotient fits 32 bits: `a >> 32 < b`. Otherwise the result is arbitrary, without a
        /// panic. Cost: 700.
        fn wide_quotient(a: u64, b: u32) -> u32;
        /// `a * b`. Cost: 20.
        fn product(a: u16, b: u16) -> u32;
        /// `a * b`, modulo 2^32. Cost: 20.
        fn times(a: u32, b: u8) -> u32;
        /// `a * b / 256`, rounded down. Cost: 5.
        fn high_product(a: u8, b: u8) -> u8;
        /// The square root, rounded down. Cost: 320.
        fn root(x: u32) -> u16;
        /// Returns 2^23 over the square root of a number from 2^14 on, 0.006 % exact. For a smaller number the result
        /// is arbitrary. Cost: 80.
        fn inverse_root(x: u16) -> u16;
        /// Returns `a / b`, not inlined. Cost: 370, where the compiler's division takes 490.
        fn ratio(a: f32, b: f32) -> f32;
        /// Returns a number rounded down. For 2^31 or more, for a number below 0 and for a NaN the result is 2^31.
        /// Cost: 120.
        fn whole(x: f32) -> u32;
    }

    /// Floats. Thread mode and exec.
    trait Float in float {
        /// The square root. Cost: 490.
        fn sqrtf(x: f32) -> f32;
        /// The sine of an angle in radians. Cost: 1,800.
        fn sinf(x: f32) -> f32;
        /// The cosine of an angle in radians. Cost: 1,800.
        fn cosf(x: f32) -> f32;
        /// A number above 0 to a power. Cost: 4,000.
        fn powf(x: f32, power: f32) -> f32;
        /// The angle of the point (x, y), -pi to pi radians. Cost: 3,000.
        fn atan2f(y: f32, x: f32) -> f32;
    }

    /// Text. The chip also provides [`Cursor`](super::text::Cursor), which implements [`Reads`].
    trait Text in text_functions {
        /// Copies from the beginning of `from` to `to`, up to the first byte below a blank, the end of either, or 255
        /// bytes. Returns how many bytes it has copied. Cost: 9 a byte.
        fn copy_printing(from: &[u8], to: &mut [u8]) -> u8;
    }
}

/// Fast text functions: see [`Text`] and [`Reads`].
pub mod text {
    pub use super::imp::text::Cursor;
    pub use super::text_functions::copy_printing;
}

/// A place in a line. Its field `byte` is the current byte, 0 at the end of the line.
pub trait Reads<'a> {
    /// Makes a place at `byte`, with `rest` behind it: 255 bytes at most.
    fn new(byte: u8, rest: &'a [u8]) -> Self;
    /// Returns how many bytes there are behind the current one.
    fn left(&self) -> u8;
    /// Goes on to the next byte.
    fn step(&mut self);
    /// Takes up to four digits. Returns their number, and how many digits are missing to four.
    fn four(&mut self) -> (u16, u8);
}

// These call the chip's own functions where it has any: a type's functions take precedence over a trait's.
impl<'a> Reads<'a> for imp::text::Cursor<'a> {
    fn new(byte: u8, rest: &'a [u8]) -> Self {
        imp::text::Cursor::new(byte, rest)
    }

    fn left(&self) -> u8 {
        imp::text::Cursor::left(self)
    }

    fn step(&mut self) {
        imp::text::Cursor::step(self);
    }

    fn four(&mut self) -> (u16, u8) {
        imp::text::Cursor::four(self)
    }
}

/// Reads of program memory, which holds the tables of [`progmem`](super::progmem).
pub trait Flash {
    /// Returns a copy of a value. Cost: 4 a byte.
    ///
    /// # Safety
    /// `from` points to a value in program memory.
    unsafe fn load<T: Copy>(from: *const T) -> T;
    /// Copies `count` bytes, 1 to 255, out of program memory. Cost: 9 a byte.
    ///
    /// # Safety
    /// `from` points to program memory, `to` to RAM, and both hold at least `count` bytes.
    unsafe fn copy(from: *const u8, to: *mut u8, count: u8);
}

impl Flash for imp::Chip {
    #[inline(always)]
    unsafe fn load<T: Copy>(from: *const T) -> T {
        // SAFETY: the caller's.
        unsafe { imp::flash::load(from) }
    }

    #[inline(always)]
    unsafe fn copy(from: *const u8, to: *mut u8, count: u8) {
        // SAFETY: the caller's.
        unsafe { imp::flash::copy(from, to, count) }
    }
}
