//! A byte that two levels share.
//!
//! An 8-bit CPU loads or stores a byte in one instruction, so a plain volatile access cannot be torn. `AtomicU8`
//! would mask interrupts around the access, which costs three cycles more in the hottest interrupts. The fences keep
//! the compiler from moving other accesses across; the CPU itself never reorders. On other targets it is an atomic.

#[cfg(target_arch = "avr")]
mod imp {
    use core::cell::UnsafeCell;
    use core::sync::atomic::{Ordering, compiler_fence};

    /// See the module's text.
    pub struct SharedByte(UnsafeCell<u8>);

    // SAFETY: loads and stores are single instructions on the only core.
    unsafe impl Sync for SharedByte {}

    impl SharedByte {
        /// Creates it with a value.
        pub const fn new(value: u8) -> Self {
            Self(UnsafeCell::new(value))
        }

        /// Returns the value. Everything written before the value was set is visible.
        #[inline(always)]
        pub fn get(&self) -> u8 {
            // SAFETY: a single load.
            let value = unsafe { self.0.get().read_volatile() };
            compiler_fence(Ordering::SeqCst);
            value
        }

        /// Sets the value. Everything written before becomes visible with it.
        #[inline(always)]
        pub fn set(&self, value: u8) {
            compiler_fence(Ordering::SeqCst);
            // SAFETY: a single store.
            unsafe { self.0.get().write_volatile(value) };
        }
    }
}

#[cfg(not(target_arch = "avr"))]
mod imp {
    use core::sync::atomic::{AtomicU8, Ordering};

    /// See the module's text.
    pub struct SharedByte(AtomicU8);

    impl SharedByte {
        /// Creates it with a value.
        pub const fn new(value: u8) -> Self {
            Self(AtomicU8::new(value))
        }

        /// Returns the value. Everything written before the value was set is visible.
        pub fn get(&self) -> u8 {
            self.0.load(Ordering::Acquire)
        }

        /// Sets the value. Everything written before becomes visible with it.
        pub fn set(&self, value: u8) {
            self.0.store(value, Ordering::Release);
        }
    }
}

pub use imp::SharedByte;

/// The number of a slot of a [ring](crate::ring), as wide as the CPU reads and writes in one instruction, at most 16
/// bits.
#[cfg(not(feature = "_cortex-m"))]
pub type Index = u8;
/// The number of a slot of a [ring](crate::ring): 16 bits on Cortex-M.
#[cfg(feature = "_cortex-m")]
pub type Index = u16;

/// An index of a ring that two levels share: a byte on AVR.
#[cfg(not(feature = "_cortex-m"))]
pub type SharedIndex = SharedByte;
#[cfg(feature = "_cortex-m")]
pub use wide::SharedIndex;

#[cfg(feature = "_cortex-m")]
mod wide {
    use core::sync::atomic::{AtomicU16, Ordering};

    /// An index of a ring that two levels share: like [`SharedByte`](super::SharedByte), with 16 bits.
    pub struct SharedIndex(AtomicU16);

    impl SharedIndex {
        /// Creates it with a value.
        pub const fn new(value: u16) -> Self {
            Self(AtomicU16::new(value))
        }

        /// Returns the value. Everything written before the value was set is visible.
        pub fn get(&self) -> u16 {
            self.0.load(Ordering::Acquire)
        }

        /// Sets the value. Everything written before becomes visible with it.
        pub fn set(&self, value: u16) {
            self.0.store(value, Ordering::Release);
        }
    }
}
