//! An image that does the chip's arithmetic with operands that the test `tests/sim/tests/arithmetic.rs` has put into
//! its memory. `cargo xtask examples` builds it.
#![cfg_attr(target_os = "none", no_std, no_main)]
#![allow(missing_docs)] // for the items that `avr_device::entry` generates

#[cfg(target_arch = "avr")]
mod image {
    use core::sync::atomic::{AtomicU8, Ordering::Relaxed};

    use kerf::hal::arithmetic;
    use kerf::motion::divide;

    kerf::link_libraries!();

    /// Number of words in the results.
    const WORDS: usize = 16;

    // All shared data are bytes, the lowest first. LLVM 22 may load an atomic word into the registers that hold its
    // address (`ld r30, Z`, `ldd r31, Z+1`), so that the second byte comes from somewhere else.
    /// 1 when the operands are ready, 0 when the results are.
    #[unsafe(no_mangle)]
    static TURN: AtomicU8 = AtomicU8::new(0);
    /// Two operands: 64 bits and 32 bits.
    #[unsafe(no_mangle)]
    static OPERANDS: [AtomicU8; 12] = [const { AtomicU8::new(0) }; 12];
    /// The results, in the order of [`results`].
    #[unsafe(no_mangle)]
    static RESULTS: [AtomicU8; 2 * WORDS] = [const { AtomicU8::new(0) }; 2 * WORDS];

    fn byte(of: &[AtomicU8], at: usize) -> u8 {
        of.get(at).map_or(0, |byte| byte.load(Relaxed))
    }

    fn word(of: &[AtomicU8], at: usize) -> u16 {
        u16::from_le_bytes([byte(of, at), byte(of, at + 1)])
    }

    fn operand(at: usize) -> u32 {
        u32::from(word(&OPERANDS, at + 2)) << 16 | u32::from(word(&OPERANDS, at))
    }

    /// The results, in the order of the test.
    fn results() -> [u16; WORDS] {
        let (a, b) = (operand(0), operand(8));
        let wide = u64::from(operand(4)) << 32 | u64::from(a);
        let (x, y) = (f32::from_bits(a), f32::from_bits(b));
        let words = |whole: u32| [whole as u16, (whole >> 16) as u16];
        let (quotient, remainder) = divide::quotient_remainder(a, b as u16);
        let [wide_low, wide_high] = words(arithmetic::wide_quotient(wide, b));
        let [product_low, product_high] = words(arithmetic::product(a as u16, b as u16));
        let [times_low, times_high] = words(arithmetic::times(a, b as u8));
        let [ratio_low, ratio_high] = words(arithmetic::ratio(x, y).to_bits());
        let [whole_low, whole_high] = words(arithmetic::whole(x));
        [
            quotient,
            remainder,
            wide_low,
            wide_high,
            product_low,
            product_high,
            times_low,
            times_high,
            arithmetic::high_product(a as u8, b as u8).into(),
            divide::root(a),
            ratio_low,
            ratio_high,
            whole_low,
            whole_high,
            // The result of an inlined division, which uses other registers.
            arithmetic::divide(a, b as u16).0,
            arithmetic::inverse_root(a as u16),
        ]
    }

    #[avr_device::entry]
    fn main() -> ! {
        loop {
            while TURN.load(Relaxed) == 0 {}
            for (to, result) in RESULTS.chunks_exact(2).zip(results()) {
                for (to, byte) in to.iter().zip(result.to_le_bytes()) {
                    to.store(byte, Relaxed);
                }
            }
            TURN.store(0, Relaxed);
        }
    }
}

#[cfg(not(target_arch = "avr"))]
fn main() {}
