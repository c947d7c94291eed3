//! Copies received text as far as it prints, for `LinePool::put_text`. Bytes of lines, no units.
//!
//! Cost on AVR: 9 cycles a byte; of the loop the compiler makes twice as much.

/// Copies from the beginning of `from` to `to`, up to the first byte below a blank, the end of either, or 255
/// bytes. Returns how many.
#[cfg(target_arch = "avr")]
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

/// The same.
#[cfg(not(target_arch = "avr"))]
#[small]
pub fn copy_printing(from: &[u8], to: &mut [u8]) -> u8 {
    let most = to.len().min(from.len()).min(255);
    let count = from.iter().take(most).take_while(|byte| **byte >= b' ').count();
    to[..count].copy_from_slice(&from[..count]);
    count as u8
}
