//! The digits of a usual number, for `usual`: up to four decimals, no blanks, no sign.
//!
//! Cost on AVR: 22 cycles a digit, and 80 for a number; of the loop the compiler makes twice as much.

use core::marker::PhantomData;

/// Where a line is read.
pub struct Digits<'a> {
    /// The byte to look at; 0 at the end.
    pub byte: u8,
    /// The byte behind it, of `left`.
    at: *const u8,
    left: u8,
    line: PhantomData<&'a [u8]>,
}

impl<'a> Digits<'a> {
    /// At `byte`, with `rest` behind it: 255 bytes at most.
    #[inline(always)]
    pub fn new(byte: u8, rest: &'a [u8]) -> Self {
        let left = u8::try_from(rest.len()).unwrap_or(u8::MAX);
        Digits { byte, at: rest.as_ptr(), left, line: PhantomData }
    }

    /// How many bytes there are behind `byte`.
    #[inline(always)]
    pub fn left(&self) -> u8 {
        self.left
    }

    /// A number below 65,530: the whole, and the decimals as ten-thousandths. More digits are left, where
    /// no word can begin with them. `None` without any digit.
    #[inline(always)]
    pub fn decimal(&mut self) -> Option<(u16, u16)> {
        let (mut whole, missing) = self.four();
        if missing == 0 && self.byte.is_ascii_digit() && whole < u16::MAX / 10 {
            whole = whole * 10 + u16::from(self.byte - b'0');
            self.step();
        }
        if self.byte != b'.' {
            return (missing < 4).then_some((whole, 0));
        }
        self.step();
        let (decimals, absent) = self.four();
        let frac = match absent {
            0 => decimals,
            1 => decimals * 10,
            2 => decimals * 100,
            3 => decimals * 1_000,
            // A lone point is no number.
            _ if missing == 4 => return None,
            _ => 0,
        };
        Some((whole, frac))
    }

    #[inline(always)]
    fn step(&mut self) {
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

    /// Takes up to four digits. Their number, and how many are missing to four.
    #[cfg(target_arch = "avr")]
    #[inline(always)]
    fn four(&mut self) -> (u16, u8) {
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

    #[cfg(not(target_arch = "avr"))]
    fn four(&mut self) -> (u16, u8) {
        let (mut value, mut missing) = (0, 4);
        while missing > 0 && self.byte.is_ascii_digit() {
            value = value * 10 + u16::from(self.byte - b'0');
            missing -= 1;
            self.step();
        }
        (value, missing)
    }
}

/// 10,000 times `whole`. The compiler's product of 32 bits takes 60 cycles more.
#[cfg(target_arch = "avr")]
#[inline(always)]
pub fn ten_thousand_times(whole: u16) -> u32 {
    let (low, high): (u16, u16);
    // SAFETY: arithmetic on its operands; r1 is 0 again.
    unsafe {
        core::arch::asm!(
            "mul  {whole:h}, {upper}",
            "movw {high:l}, r0",
            "mul  {whole:l}, {lower}",
            "movw {low:l}, r0",
            "mul  {whole:l}, {upper}",
            "add  {low:h}, r0",
            "adc  {high:l}, r1",
            "clr  r1",
            "adc  {high:h}, r1",
            "mul  {whole:h}, {lower}",
            "add  {low:h}, r0",
            "adc  {high:l}, r1",
            "clr  r1",
            "adc  {high:h}, r1",
            whole = in(reg_pair) whole,
            lower = in(reg) (10_000u16 & 0xFF) as u8,
            upper = in(reg) (10_000u16 >> 8) as u8,
            low = out(reg_pair) low,
            high = out(reg_pair) high,
            options(pure, nomem, nostack),
        );
    }
    u32::from(high) << 16 | u32::from(low)
}

/// 10,000 times `whole`.
#[cfg(not(target_arch = "avr"))]
pub fn ten_thousand_times(whole: u16) -> u32 {
    u32::from(whole) * 10_000
}
