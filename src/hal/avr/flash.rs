//! Reads of program memory, below 64 KiB. Any level; 4 cycles a byte.

use core::mem::MaybeUninit;

/// Values up to this size, in bytes, are read byte by byte into registers. Larger ones are read by a loop, in half
/// the code.
const WORD: usize = 4;

/// Returns a copy of a value.
///
/// # Safety
/// `from` points to a value in program memory.
pub unsafe fn load<T: Copy>(from: *const T) -> T {
    let mut value = MaybeUninit::<T>::uninit();
    let mut to = value.as_mut_ptr().cast::<u8>();
    let mut from = from.cast::<u8>();
    if core::mem::size_of::<T>() > WORD {
        // SAFETY: as below.
        unsafe {
            copy(from, to, core::mem::size_of::<T>() as u8);
            return value.assume_init();
        }
    }
    for _ in 0..core::mem::size_of::<T>() {
        // SAFETY: `from` walks the value in program memory, `to` walks `value`; both are `size_of::<T>()` bytes long.
        unsafe {
            let byte: u8;
            core::arch::asm!("lpm {b}, Z+", b = out(reg) byte, inout("Z") from,
                options(readonly, nostack, preserves_flags));
            to.write(byte);
            to = to.add(1);
        }
    }
    // SAFETY: every byte was copied from a valid `T`.
    unsafe { value.assume_init() }
}

/// Copies `count` bytes, 1 to 255, out of program memory.
///
/// # Safety
/// `from` points to program memory, `to` to RAM, and both hold at least `count` bytes.
#[inline(always)]
pub unsafe fn copy(from: *const u8, to: *mut u8, count: u8) {
    // SAFETY: the caller's.
    unsafe {
        core::arch::asm!(
            "1:",
            "lpm  {byte}, Z+",
            "st   X+, {byte}",
            "dec  {count}",
            "brne 1b",
            byte = out(reg) _,
            count = inout(reg) count => _,
            inout("Z") from => _,
            inout("X") to => _,
            options(nostack),
        );
    }
}
