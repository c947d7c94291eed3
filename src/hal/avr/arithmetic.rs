//! Integer arithmetic in assembly, where the compiler's takes two to four times as long. Any level. Costs are cycles,
//! inlined.

/// Returns `a / b` and `a % b` if the quotient fits 16 bits: `a >> 16 < b`. Otherwise the result is arbitrary,
/// without a panic. Cost: 170, 100 if the quotient fits eight bits; 195 and 115 if `b` has 16 bits; 120 and 80 if it
/// has seven.
#[inline(always)]
pub fn divide(a: u32, b: u16) -> (u16, u16) {
    // Computes the quotient bit by bit, four bits in each turn of the loop.
    let mut rest = (a >> 16) as u16;
    let mut low = a as u16;
    // SAFETY: arithmetic on its operands.
    unsafe {
        core::arch::asm!(
            "ldi  {n}, 4",
            // If the quotient has only eight bits, no more are computed.
            "cp   {low:h}, {b:l}",
            "cpc  {rest:l}, {b:h}",
            "cpc  {rest:h}, {zero}",
            "brcc 1f",
            "mov  {rest:h}, {rest:l}",
            "mov  {rest:l}, {low:h}",
            "mov  {low:h}, {low:l}",
            // The loop makes the complement of the quotient, whose upper byte has to be 0. `com` sets the carry,
            // which is the ninth bit.
            "clr  {low:l}",
            "com  {low:l}",
            "ldi  {n}, 2",
            // The tests up to the loop do not change the carry.
            "1:",
            "tst  {b:h}",
            "brne 20f",
            "sbrs {b:l}, 7",
            "rjmp 30f",
            "20:",
            "sbrc {b:h}, 7",
            "rjmp 4f",
            // The carry is the complement of the quotient's last bit.
            "2:",
            ".rept 4",
            "rol  {low:l}",
            "rol  {low:h}",
            "rol  {rest:l}",
            "rol  {rest:h}",
            "sub  {rest:l}, {b:l}",
            "sbc  {rest:h}, {b:h}",
            "brcc 3f",
            "add  {rest:l}, {b:l}",
            "adc  {rest:h}, {b:h}",
            "3:",
            ".endr",
            "dec  {n}",
            "brne 2b",
            "40:",
            "rol  {low:l}",
            "rol  {low:h}",
            "com  {low:l}",
            "com  {low:h}",
            "rjmp 9f",
            // A divisor of seven bits, usual for steps per millimetre: the remainder has seven bits, too.
            "30:",
            ".rept 4",
            "rol  {low:l}",
            "rol  {low:h}",
            "rol  {rest:l}",
            "sub  {rest:l}, {b:l}",
            "brcc 3f",
            "add  {rest:l}, {b:l}",
            "3:",
            ".endr",
            "dec  {n}",
            "brne 30b",
            "rjmp 40b",
            // A divisor of 16 bits: the shift may lose a bit of the remainder.
            "4:",
            "cpi  {n}, 2",
            "brne 5f",
            "clr  {low:l}",
            "5:",
            // Two bits in each turn: such large divisors are rare.
            "lsl  {n}",
            "6:",
            ".rept 2",
            "lsl  {low:l}",
            "rol  {low:h}",
            "rol  {rest:l}",
            "rol  {rest:h}",
            "brcs 7f",
            "cp   {rest:l}, {b:l}",
            "cpc  {rest:h}, {b:h}",
            "brcs 8f",
            "7:",
            "sub  {rest:l}, {b:l}",
            "sbc  {rest:h}, {b:h}",
            "inc  {low:l}",
            "8:",
            ".endr",
            "dec  {n}",
            "brne 6b",
            "9:",
            n = out(reg_upper) _,
            low = inout(reg_pair) low,
            rest = inout(reg_pair) rest,
            b = in(reg_pair) b,
            zero = in(reg) 0u8,
            options(pure, nomem, nostack),
        );
    }
    (low, rest)
}

/// Returns `a / b` if the quotient fits 32 bits: `a >> 32 < b`. Otherwise the result is arbitrary, without a panic.
/// Cost: 700, where the compiler calls a division of 64 bits for 4,500.
#[inline(never)]
pub fn wide_quotient(a: u64, b: u32) -> u32 {
    let (mut low, mut low_upper) = (a as u16, (a >> 16) as u16);
    // SAFETY: arithmetic on its operands.
    unsafe {
        core::arch::asm!(
            "ldi  {n}, 32",
            "1:",
            "lsl  {low:l}",
            "rol  {low:h}",
            "rol  {low_upper:l}",
            "rol  {low_upper:h}",
            "rol  {rest:l}",
            "rol  {rest:h}",
            "rol  {rest_upper:l}",
            "rol  {rest_upper:h}",
            // If the shift lost a bit, the remainder is above any divisor.
            "brcs 2f",
            "cp   {rest:l}, {b:l}",
            "cpc  {rest:h}, {b:h}",
            "cpc  {rest_upper:l}, {b_upper:l}",
            "cpc  {rest_upper:h}, {b_upper:h}",
            "brcs 3f",
            "2:",
            "sub  {rest:l}, {b:l}",
            "sbc  {rest:h}, {b:h}",
            "sbc  {rest_upper:l}, {b_upper:l}",
            "sbc  {rest_upper:h}, {b_upper:h}",
            "inc  {low:l}",
            "3:",
            "dec  {n}",
            "brne 1b",
            n = out(reg_upper) _,
            low = inout(reg_pair) low,
            low_upper = inout(reg_pair) low_upper,
            rest = inout(reg_pair) (a >> 32) as u16 => _,
            rest_upper = inout(reg_pair) (a >> 48) as u16 => _,
            b = in(reg_pair) b as u16,
            b_upper = in(reg_pair) (b >> 16) as u16,
            options(pure, nomem, nostack),
        );
    }
    u32::from(low_upper) << 16 | u32::from(low)
}

/// `a * b`. Cost: 20, where the compiler calls a multiplication of 32 bits for 80.
#[inline(always)]
pub fn product(a: u16, b: u16) -> u32 {
    let (low, high): (u16, u16);
    // SAFETY: arithmetic on its operands; r0 is scratch, and r1 is 0 again at the end.
    unsafe {
        core::arch::asm!(
            "mul  {a:l}, {b:l}",
            "movw {low:l}, r0",
            "mul  {a:h}, {b:h}",
            "movw {high:l}, r0",
            "mul  {a:h}, {b:l}",
            "add  {low:h}, r0",
            "adc  {high:l}, r1",
            "clr  r1",
            "adc  {high:h}, r1",
            "mul  {a:l}, {b:h}",
            "add  {low:h}, r0",
            "adc  {high:l}, r1",
            "clr  r1",
            "adc  {high:h}, r1",
            a = in(reg_pair) a,
            b = in(reg_pair) b,
            low = out(reg_pair) low,
            high = out(reg_pair) high,
            options(pure, nomem, nostack),
        );
    }
    u32::from(high) << 16 | u32::from(low)
}

/// `a * b`, modulo 2^32. Cost: 20, where the compiler calls a multiplication of 32 bits for 70.
#[inline(always)]
pub fn times(a: u32, b: u8) -> u32 {
    let (low, high): (u16, u16);
    // SAFETY: arithmetic on its operands; r0 is scratch, and r1 is 0 again at the end.
    unsafe {
        core::arch::asm!(
            "mul  {a:l}, {b}",
            "movw {low:l}, r0",
            "mul  {upper:l}, {b}",
            "movw {high:l}, r0",
            "mul  {upper:h}, {b}",
            "add  {high:h}, r0",
            "mul  {a:h}, {b}",
            "add  {low:h}, r0",
            "adc  {high:l}, r1",
            "clr  r1",
            "adc  {high:h}, r1",
            a = in(reg_pair) a as u16,
            upper = in(reg_pair) (a >> 16) as u16,
            b = in(reg) b,
            low = out(reg_pair) low,
            high = out(reg_pair) high,
            options(pure, nomem, nostack),
        );
    }
    u32::from(high) << 16 | u32::from(low)
}

/// `a * b / 256`, rounded down. Cost: 5, where the compiler takes 15.
#[inline(always)]
pub fn high_product(a: u8, b: u8) -> u8 {
    let high: u8;
    // SAFETY: arithmetic on its operands; r0 is scratch, and r1 is 0 again at the end.
    unsafe {
        core::arch::asm!(
            "mul  {a}, {b}",
            "mov  {high}, r1",
            "clr  r1",
            a = in(reg) a,
            b = in(reg) b,
            high = lateout(reg) high,
            options(pure, nomem, nostack),
        );
    }
    high
}

/// The square root, rounded down. Cost: 320.
#[inline(always)]
pub fn root(x: u32) -> u16 {
    // Finds the root bit by bit, from the top: a bit is 1 if the square of the root with it still fits. The remainder
    // is doubled every time, so that everything fits 16 bits and the carry.
    let mut high = (x >> 16) as u16;
    let mut low = x as u16;
    let root: u16;
    // SAFETY: arithmetic on its operands.
    unsafe {
        core::arch::asm!(
            "clr  {root:l}",
            "clr  {root:h}",
            "ldi  {half:h}, 0x40",
            "ldi  {half:l}, 0",
            "clc",
            "rjmp 2f",
            // Each turn tries half of the value before. When that bit falls into the carry, only the root's last bit
            // is left.
            "1:",
            "lsl  {low:l}",
            "rol  {low:h}",
            "rol  {high:l}",
            "rol  {high:h}",
            "2:",
            "movw {trial:l}, {root:l}",
            "or   {trial:l}, {half:l}",
            "or   {trial:h}, {half:h}",
            "brcs 3f",
            "cp   {high:l}, {trial:l}",
            "cpc  {high:h}, {trial:h}",
            "brcs 4f",
            "3:",
            "sub  {high:l}, {trial:l}",
            "sbc  {high:h}, {trial:h}",
            // The bit of the root is twice `half`. The trial contains one `half` already, so one more is added.
            "movw {root:l}, {trial:l}",
            "add  {root:l}, {half:l}",
            "adc  {root:h}, {half:h}",
            "4:",
            "lsr  {half:h}",
            "ror  {half:l}",
            "brcc 1b",
            // The last bit. Its half lies below the 16 bits, so the bit behind the remainder takes part in the
            // comparison.
            "lsl  {low:l}",
            "rol  {low:h}",
            "rol  {high:l}",
            "rol  {high:h}",
            "brcs 5f",
            "lsl  {low:h}",
            "cpc  {root:l}, {high:l}",
            "cpc  {root:h}, {high:h}",
            "5:",
            "adc  {root:l}, {half:l}",
            "adc  {root:h}, {half:l}",
            half = out(reg_iw) _,
            trial = out(reg_pair) _,
            high = inout(reg_pair) high,
            low = inout(reg_pair) low,
            root = out(reg_pair) root,
            options(pure, nomem, nostack),
        );
    }
    let _ = (high, low);
    root
}

/// Returns 2^23 over the square root of a number from 2^14 on, 0.006 % exact. For a smaller number the result is
/// arbitrary. Cost: 80.
#[inline(always)]
pub fn inverse_root(x: u16) -> u16 {
    let root: u16;
    // SAFETY: arithmetic on its operands; r0 is scratch, and r1 is 0 again at the end.
    unsafe {
        core::arch::asm!(
            // First approximation, from the upper byte, by a polynomial of the second degree: 338/128 - h (286/128 -
            // 204/128 h), 2.9 % exact.
            "ldi  {n}, 204",
            "mul  {x:h}, {n}",
            "ldi  {n}, 30",
            "sub  {n}, r1",
            "mul  {x:h}, {n}",
            "ldi  {first}, 82",
            "sub  {first}, r1",
            "ldi  {n}, 126",
            "mul  {x:h}, {n}",
            "sub  {first}, r1",
            // The square of that times the number, in units of 2^-30.
            "mul  {first}, {first}",
            "movw {square:l}, r0",
            "mul  {x:l}, {square:l}",
            "mov  {n}, r1",
            "mul  {x:h}, {square:h}",
            "movw {error:l}, r0",
            "clr  {more:h}",
            "mul  {x:h}, {square:l}",
            "add  {n}, r0",
            "adc  {error:l}, r1",
            "adc  {error:h}, {more:h}",
            "mul  {x:l}, {square:h}",
            "add  {n}, r0",
            "adc  {error:l}, r1",
            "adc  {error:h}, {more:h}",
            // How far that product is from 1, in units of 2^-16.
            ".rept 2",
            "lsl  {n}",
            "rol  {error:l}",
            "rol  {error:h}",
            ".endr",
            "com  {error:h}",
            "neg  {error:l}",
            "sbci {error:h}, 255",
            // The high byte of `more` becomes that difference, e, in units of 2^-11.
            "movw {more:l}, {error:l}",
            ".rept 3",
            "lsl  {more:l}",
            "rol  {more:h}",
            ".endr",
            // 1 / sqrt(1 - e) = 1 + e / 2 + e^2 (3 + 5/2 e) / 8: all terms except the first, in units of 2^-16.
            "mov  {n}, {more:h}",
            "sbrc {n}, 7",
            "neg  {n}",
            "mul  {n}, {n}",
            ".rept 2",
            "lsl  r0",
            "rol  r1",
            ".endr",
            "mov  {n}, {more:h}",
            ".rept 5",
            "asr  {n}",
            ".endr",
            "subi {n}, 159",
            "mul  r1, {n}",
            "asr  {error:h}",
            "ror  {error:l}",
            "clr  {more:h}",
            "sec",
            "adc  {error:l}, r1",
            "adc  {error:h}, {more:h}",
            // The first approximation, plus that share of it.
            "mul  {error:l}, {first}",
            "mov  {more:l}, r1",
            "mov  {more:h}, {first}",
            "mul  {error:h}, {first}",
            "add  {more:l}, r0",
            "adc  {more:h}, r1",
            "sbrc {error:h}, 7",
            "sub  {more:h}, {first}",
            "clr  r1",
            x = in(reg_pair) x,
            n = out(reg_upper) _,
            first = out(reg_upper) _,
            square = out(reg_pair) _,
            error = out(reg_iw) _,
            more = out(reg_pair) root,
            options(pure, nomem, nostack),
        );
    }
    root
}

/// `a / b`. Cost: 370, where the library takes 490.
#[inline(never)]
pub fn ratio(a: f32, b: f32) -> f32 {
    let (x, y) = (a.to_bits(), b.to_bits());
    let (mut low, mut upper) = (x as u16, (x >> 16) as u16);
    let (mut b_low, mut b_upper) = (y as u16, (y >> 16) as u16);
    let left: u8;
    // SAFETY: arithmetic on its operands; r0 is scratch.
    unsafe {
        core::arch::asm!(
            // Not 0 if the quotient is left to the library. The operands are unchanged in that case.
            "ldi  {left}, 0x80",
            // Separates the exponents.
            "mov  {e}, {a_upper:h}",
            "mov  {q}, {a_upper:l}",
            "lsl  {q}",
            "rol  {e}",
            "mov  {n}, {b_upper:h}",
            "mov  {q}, {b_upper:l}",
            "lsl  {q}",
            "rol  {n}",
            // Zeros, subnormal numbers, infinities and NaN, and quotients that may be one of these, are left to the
            // library.
            "mov  {q}, {e}",
            "dec  {q}",
            "cpi  {q}, 254",
            "brsh 8f",
            "mov  {q}, {n}",
            "dec  {q}",
            "cpi  {q}, 254",
            "brsh 8f",
            "sub  {e}, {n}",
            "sbc  {n}, {n}",
            "subi {e}, 130",
            "sbci {n}, 255",
            "tst  {n}",
            "brne 8f",
            "mov  {q}, {e}",
            "dec  {q}",
            "cpi  {q}, 252",
            "brsh 8f",
            // Computes the sign. Then makes the first mantissa the greater of the two.
            "eor  {b_upper:h}, {a_upper:h}",
            "or   {a_upper:l}, {left}",
            "or   {b_upper:l}, {left}",
            "cp   {a:l}, {b:l}",
            "cpc  {a:h}, {b:h}",
            "cpc  {a_upper:l}, {b_upper:l}",
            "brcs 1f",
            "inc  {e}",
            "rjmp 2f",
            "8:",
            "rjmp 9f",
            "1:",
            "lsl  {a:l}",
            "rol  {a:h}",
            "rol  {a_upper:l}",
            "2:",
            // The first bit of the quotient is 1. The other bits, and one more bit for rounding, make three bytes.
            "sub  {a:l}, {b:l}",
            "sbc  {a:h}, {b:h}",
            "sbc  {a_upper:l}, {b_upper:l}",
            "ldi  {n}, 3",
            "3:",
            "mov  {a_upper:h}, r0",
            "mov  r0, {q}",
            "ldi  {left}, 4",
            "4:",
            ".rept 2",
            "lsl  {q}",
            "lsl  {a:l}",
            "rol  {a:h}",
            "rol  {a_upper:l}",
            // If the shift lost a bit, the remainder is above any divisor.
            "brcs 5f",
            "cp   {a:l}, {b:l}",
            "cpc  {a:h}, {b:h}",
            "cpc  {a_upper:l}, {b_upper:l}",
            "brcs 6f",
            "5:",
            "sub  {a:l}, {b:l}",
            "sbc  {a:h}, {b:h}",
            "sbc  {a_upper:l}, {b_upper:l}",
            "inc  {q}",
            "6:",
            ".endr",
            "dec  {left}",
            "brne 4b",
            "dec  {n}",
            "brne 3b",
            // Puts sign, exponent and mantissa together; the last bit goes to the carry.
            "lsl  {b_upper:h}",
            "ror  {e}",
            "ror  {a_upper:h}",
            "ror  r0",
            "ror  {q}",
            "mov  {a:l}, {q}",
            "mov  {a:h}, r0",
            "mov  {a_upper:l}, {a_upper:h}",
            "mov  {a_upper:h}, {e}",
            // Rounds. A quotient never lies in the middle between two floats.
            "adc  {a:l}, r1",
            "adc  {a:h}, r1",
            "adc  {a_upper:l}, r1",
            "adc  {a_upper:h}, r1",
            "9:",
            e = out(reg_upper) _,
            n = out(reg_upper) _,
            q = out(reg_upper) _,
            left = out(reg_upper) left,
            a = inout(reg_pair) low,
            a_upper = inout(reg_pair) upper,
            b = inout(reg_pair) b_low,
            b_upper = inout(reg_pair) b_upper,
            options(pure, nomem, nostack),
        );
    }
    let whole = |low: u16, upper: u16| f32::from_bits(u32::from(upper) << 16 | u32::from(low));
    let a = whole(low, upper);
    if left != 0 { a / whole(b_low, b_upper) } else { a }
}

/// Returns a number rounded down. For 2^31 or more, for a number below 0 and for a NaN the result is 2^31. Cost: 120,
/// where `as` takes 260.
#[inline(never)]
pub fn whole(x: f32) -> u32 {
    const END: u32 = 2_147_483_648.0f32.to_bits();
    // As integers, the bits of negative numbers are above those of all positive numbers.
    if x.to_bits() >= END {
        return 1 << 31;
    }
    // SAFETY: the comparison above leaves numbers from 0 to below 2^31, and no NaN.
    unsafe { x.to_int_unchecked() }
}
