//! A value that one level at a time uses. [`Shared`](crate::Shared) and [`Baton`](crate::Baton), which are made of
//! it, ensure that.

pub use imp::Value;

#[cfg(target_os = "none")]
mod imp {
    use core::cell::UnsafeCell;

    pub struct Value<T>(UnsafeCell<T>);

    // SAFETY: there is one core, and one level at a time uses the value, see `with`.
    unsafe impl<T: Send> Sync for Value<T> {}

    impl<T> Value<T> {
        pub const fn new(value: T) -> Self {
            Self(UnsafeCell::new(value))
        }

        /// # Safety
        /// Nobody else uses the value.
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

    /// On the host the value is behind a lock, which is never contended.
    pub struct Value<T>(RwLock<T>);

    impl<T> Value<T> {
        pub const fn new(value: T) -> Self {
            Self(RwLock::new(value))
        }

        /// # Safety
        /// None: the lock checks it.
        pub unsafe fn with<R>(&self, act: impl FnOnce(&mut T) -> R) -> R {
            act(&mut self.0.try_write().expect("nobody else has the value"))
        }

        /// # Safety
        /// None: the lock checks it.
        pub unsafe fn look<R>(&self, act: impl FnOnce(&T) -> R) -> R {
            act(&self.0.try_read().expect("nobody else changes the value"))
        }
    }
}
