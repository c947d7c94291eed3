//! Storage for values that live for ever, and for tasks. On the chip, which is one machine, they are statics. On the
//! host they are on the heap, and each machine that a test makes gets its own.

/// Returns memory that begins as a constant, and is never moved. An image has it once; on the host each machine gets its
/// own.
macro_rules! memory {
    ($type:ty, $value:expr) => {{
        #[cfg(target_os = "none")]
        {
            static MEMORY: static_cell::ConstStaticCell<$type> =
                static_cell::ConstStaticCell::new($value);
            MEMORY.take()
        }
        #[cfg(not(target_os = "none"))]
        std::boxed::Box::leak(std::boxed::Box::new($value))
    }};
}

/// Moves a value to a place where it lives for ever, and returns a reference to it.
macro_rules! place {
    ($type:ty, $value:expr) => {{
        #[cfg(target_os = "none")]
        {
            static PLACE: static_cell::StaticCell<$type> = static_cell::StaticCell::new();
            PLACE.init_with(|| $value)
        }
        #[cfg(not(target_os = "none"))]
        std::boxed::Box::leak(std::boxed::Box::new($value))
    }};
}

/// Declares tasks. An image has one of each; on the host each machine gets its own.
macro_rules! tasks {
    ($(fn $name:ident($($arg:ident: $type:ty),*) = $run:path;)+) => {$(
        #[cfg(target_os = "none")]
        #[embassy_executor::task]
        fn $name($($arg: $type),*) -> impl Future<Output = crate::hal::Never> {
            $run($($arg),*)
        }

        #[cfg(not(target_os = "none"))]
        fn $name(
            $($arg: $type),*
        ) -> Result<embassy_executor::SpawnToken<impl Sized>, embassy_executor::SpawnError> {
            let storage = std::boxed::Box::new(embassy_executor::raw::TaskStorage::new());
            std::boxed::Box::leak(storage).spawn(move || $run($($arg),*))
        }
    )+};
}

/// The return type of a task that never returns: `!`, which stable Rust does not yet accept as a type.
pub type Never = <fn() -> ! as Returns>::Value;

/// Names the return type of a function, for [`Never`].
pub trait Returns {
    /// What the function returns.
    type Value;
}

impl<T> Returns for fn() -> T {
    type Value = T;
}
