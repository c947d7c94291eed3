//! What a chip has to have that touches no register: arithmetic and text by hand, floats, reads of program memory.
//!
//! These functions are for any level. A chip without better ones takes those of `host`, which are plain Rust.

use super::contract::contract;
use super::imp;
use avr_embassy::ring::Index;

contract! {
    /// Arithmetic where the compiler's takes several times as long on a small chip.
    trait Arithmetic in arithmetic {
        /// `a / b` and `a % b` if the quotient fits 16 bits: `a >> 16 < b`. Else something, without a panic. Cost: 200, 120 if the quotient
        /// fits eight bits.
        fn divide(a: u32, b: u16) -> (u16, u16);
        /// `a / b` if the quotient fits 32 bits: `a >> 32 < b`. Else something, without a panic. Cost: 700.
        fn wide_quotient(a: u64, b: u32) -> u32;
        /// `a * b`. Cost: 20.
        fn product(a: u16, b: u16) -> u32;
        /// `a * b`, modulo 2^32. Cost: 20.
        fn times(a: u32, b: u8) -> u32;
        /// `a * b / 256`, rounded down. Cost: 5.
        fn high_product(a: u8, b: u8) -> u8;
        /// The square root, rounded down. Cost: 320.
        fn root(x: u32) -> u16;
        /// 2^23 over the square root of a number from 2^14 on, 0.006 % exact. Of a smaller one something. Cost: 80.
        fn inverse_root(x: u16) -> u16;
        /// How many pairs of a mark and a value come before the first whose mark has its highest bit set, or whose value is below `least`;
        /// all of them, at most [`Index::MAX`], if there is none. Cost: 14 each.
        fn passed_over(marks: &[Index], values: &[u16], least: u16) -> Index;
        /// `a / b`, not inlined. Cost: 370, where the compiler's takes 490.
        fn ratio(a: f32, b: f32) -> f32;
        /// A number rounded down; one of 2^31 or more, or below 0, or a NaN, is 2^31. Cost: 120.
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

    /// Text. Beside the functions there is [`Cursor`](super::text::Cursor), which is what [`Reads`] says.
    trait Text in text_functions {
        /// Copies from the beginning of `from` to `to`, up to the first byte below a blank, the end of either, or 255 bytes. Returns how many.
        /// Cost: 9 a byte.
        fn copy_printing(from: &[u8], to: &mut [u8]) -> u8;
    }
}

/// Text by hand: see [`Text`] and [`Reads`].
pub mod text {
    pub use super::imp::text::Cursor;
    pub use super::text_functions::copy_printing;
}

/// A place in a line, whose current byte is its field `byte`, 0 at the end.
pub trait Reads<'a> {
    /// At `byte`, with `rest` behind it: 255 bytes at most.
    fn new(byte: u8, rest: &'a [u8]) -> Self;
    /// How many bytes there are behind the current one.
    fn left(&self) -> u8;
    /// Goes on to the next byte.
    fn step(&mut self);
    /// Takes up to four digits. Their number, and how many are missing to four.
    fn four(&mut self) -> (u16, u8);
}

// The chip's own functions, where there are such: a type's come before a trait's.
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

/// Reads of program memory, where the tables of [`progmem`](super::progmem) are.
pub trait Flash {
    /// A copy of a value. Cost: 4 a byte.
    ///
    /// # Safety
    /// `from` points to a value in program memory.
    unsafe fn load<T: Copy>(from: *const T) -> T;
    /// Copies `count` bytes, 1 to 255, out of program memory. Cost: 9 a byte.
    ///
    /// # Safety
    /// `from` points to program memory, `to` to memory, of at least as many bytes.
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
