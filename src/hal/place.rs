//! Where what lives for ever is put, and tasks: in statics on the chip, where there is one machine; on the heap of the host, where
//! each machine that is made gets its own.

/// Memory for lines, once in an image; on the host each machine that is made gets its own.
macro_rules! line_bytes {
    ($len:expr) => {{
        #[cfg(target_os = "none")]
        {
            static BYTES: static_cell::ConstStaticCell<[u8; $len]> =
                static_cell::ConstStaticCell::new([0; $len]);
            BYTES.take()
        }
        #[cfg(not(target_os = "none"))]
        std::boxed::Box::leak(std::boxed::Box::new([0; $len]))
    }};
}

/// Puts something where it stays.
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

/// Declares tasks: one of each in an image; on the host each machine that is made gets its own.
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

/// What a task returns, that never does: `!`, which is no type of stable Rust yet.
pub type Never = <fn() -> ! as Returns>::Value;

/// See [`Never`].
pub trait Returns {
    /// What the function returns.
    type Value;
}

impl<T> Returns for fn() -> T {
    type Value = T;
}
