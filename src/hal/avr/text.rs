//! Text functions in assembly, where the compiler's loops take twice as long: they copy received text and read
//! numbers.

use core::marker::PhantomData;

use kerf_macros::small;

/// Copies from the beginning of `from` to `to`, up to the first byte below a blank, the end of either, or 255 bytes.
/// Returns how many bytes it has copied. Cost: 9 cycles a byte.
#[inline(always)]
#[small]
pub fn copy_printing(from: &[u8], to: &mut [u8]) -> u8 {
    let most = u8::try_from(from.len().min(to.len())).unwrap_or(u8::MAX);
    if most == 0 {
        return 0;
    }
    let mut left = most;
    // SAFETY: reads and writes `most` bytes at most, which both have, and at least one.
    unsafe {
        core::arch::asm!(
            "1:",
            "ld   {byte}, Z+",
            "cpi  {byte}, 32",
            "brlo 2f",
            "st   X+, {byte}",
            "dec  {left}",
            "brne 1b",
            "2:",
            byte = out(reg_upper) _,
            left = inout(reg) left,
            inout("Z") from.as_ptr() => _,
            inout("X") to.as_mut_ptr() => _,
            options(nostack),
        );
    }
    most - left
}

/// A place in a line.
pub struct Cursor<'a> {
    /// The current byte; 0 at the end of the line.
    pub byte: u8,
    /// The next byte, the first of `left` bytes.
    at: *const u8,
    left: u8,
    line: PhantomData<&'a [u8]>,
}

impl<'a> Cursor<'a> {
    /// Makes a place at `byte`, with `rest` behind it: 255 bytes at most.
    #[inline(always)]
    pub fn new(byte: u8, rest: &'a [u8]) -> Self {
        let left = u8::try_from(rest.len()).unwrap_or(u8::MAX);
        Cursor { byte, at: rest.as_ptr(), left, line: PhantomData }
    }

    /// Returns how many bytes there are behind `byte`.
    #[inline(always)]
    pub fn left(&self) -> u8 {
        self.left
    }

    /// Goes on to the next byte.
    #[inline(always)]
    pub fn step(&mut self) {
        self.byte = match self.left {
            0 => 0,
            // SAFETY: there is a byte at `at`, in the slice that `new` was given.
            _ => unsafe { *self.at },
        };
        if self.left != 0 {
            self.left -= 1;
            self.at = self.at.wrapping_add(1);
        }
    }

    /// Takes up to four digits. Returns their number, and how many digits are missing to four. Cost: 22 cycles a
    /// digit.
    #[inline(always)]
    pub fn four(&mut self) -> (u16, u8) {
        let (mut value, mut missing) = (0u16, 4u8);
        // SAFETY: reads no more than the `left` bytes at `at`; r1 is 0 again.
        unsafe {
            core::arch::asm!(
                "1:",
                "mov  {digit}, {byte}",
                "subi {digit}, 48",
                "cpi  {digit}, 10",
                "brcc 4f",
                "dec  {missing}",
                "brmi 3f",
                "mul  {value:l}, {ten}",
                "movw {product:l}, r0",
                "mul  {value:h}, {ten}",
                "add  {product:h}, r0",
                "clr  r1",
                "add  {product:l}, {digit}",
                "adc  {product:h}, r1",
                "movw {value:l}, {product:l}",
                "subi {left}, 1",
                "brcs 2f",
                "ld   {byte}, X+",
                "rjmp 1b",
                // The end of the line.
                "2:",
                "inc  {left}",
                "clr  {byte}",
                "rjmp 4f",
                "3:",
                "inc  {missing}",
                "4:",
                digit = out(reg_upper) _,
                byte = inout(reg) self.byte,
                missing = inout(reg) missing,
                value = inout(reg_pair) value,
                ten = in(reg) 10u8,
                product = out(reg_pair) _,
                left = inout(reg_upper) self.left,
                inout("X") self.at,
                options(readonly, nostack),
            );
        }
        (value, missing)
    }
}
