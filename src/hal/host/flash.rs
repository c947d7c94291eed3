//! The reads of `avr/flash.rs`, on a target where program memory is memory like any other.

/// Returns a copy of a value.
///
/// # Safety
/// `from` points to a value.
pub unsafe fn load<T: Copy>(from: *const T) -> T {
    // SAFETY: the caller's.
    unsafe { from.read() }
}

/// Copies `count` bytes.
///
/// # Safety
/// `from` and `to` point to at least `count` bytes each.
pub unsafe fn copy(from: *const u8, to: *mut u8, count: u8) {
    // SAFETY: the caller's.
    unsafe { from.copy_to_nonoverlapping(to, count.into()) }
}
