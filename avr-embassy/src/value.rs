//! A value that one level at a time has: what is behind [`Shared`](crate::Shared) and [`Baton`](crate::Baton), which see to that.

pub use imp::Value;

#[cfg(target_os = "none")]
mod imp {
    use core::cell::UnsafeCell;

    pub struct Value<T>(UnsafeCell<T>);

    // SAFETY: on the only core one level at a time has it, see `with`.
    unsafe impl<T: Send> Sync for Value<T> {}

    impl<T> Value<T> {
        pub const fn new(value: T) -> Self {
            Self(UnsafeCell::new(value))
        }

        /// # Safety
        /// Nobody else has the value.
        #[inline(always)]
        pub unsafe fn with<R>(&self, act: impl FnOnce(&mut T) -> R) -> R {
            // SAFETY: the caller says so.
            act(unsafe { &mut *self.0.get() })
        }

        /// # Safety
        /// Nobody else changes the value.
        #[inline(always)]
        pub unsafe fn look<R>(&self, act: impl FnOnce(&T) -> R) -> R {
            // SAFETY: the caller says so.
            act(unsafe { &*self.0.get() })
        }
    }
}

#[cfg(not(target_os = "none"))]
mod imp {
    use std::sync::RwLock;

    /// On the host it is a lock that nobody ever has to wait for.
    pub struct Value<T>(RwLock<T>);

    impl<T> Value<T> {
        pub const fn new(value: T) -> Self {
            Self(RwLock::new(value))
        }

        /// # Safety
        /// None: see above.
        pub unsafe fn with<R>(&self, act: impl FnOnce(&mut T) -> R) -> R {
            act(&mut self.0.try_write().expect("nobody else has the value"))
        }

        /// # Safety
        /// None: see above.
        pub unsafe fn look<R>(&self, act: impl FnOnce(&T) -> R) -> R {
            act(&self.0.try_read().expect("nobody else changes the value"))
        }
    }
}
