//! The hardware, and what stands in for it on the host.
//!
//! This module holds what both share: rings between interrupts and tasks, event bits, the ceiling
//! lock. `avr` owns all the registers and nearly all the `unsafe`; `host` is the same interface over
//! mocked time. Exactly one of the two is compiled, under the name [`imp`]; nothing else in Kerf
//! knows which.

/// Declares a value that a machine has one of, as a function that returns `&'static` to it.
///
/// On AVR it is a static. On the host each thread is a machine of its own, so that tests run side
/// by side: the value is made on the thread's first use.
#[macro_export]
macro_rules! machine_static {
    ($($(#[$meta:meta])* $vis:vis fn $name:ident() -> $type:ty = $init:expr;)+) => {$(
        $(#[$meta])*
        #[inline(always)]
        $vis fn $name() -> &'static $type {
            #[cfg(target_arch = "avr")]
            {
                static VALUE: $type = $init;
                &VALUE
            }
            #[cfg(not(target_arch = "avr"))]
            {
                std::thread_local!(static VALUE: &'static $type =
                    std::boxed::Box::leak(std::boxed::Box::new($init)));
                VALUE.with(|value| *value)
            }
        }
    )+};
}

pub mod byte;
pub mod event;
pub mod pender;
pub mod resets;
pub mod ring;
pub mod serial;
pub mod timers;

#[cfg(target_arch = "avr")]
#[path = "avr/mod.rs"]
pub mod imp;
#[cfg(not(target_arch = "avr"))]
#[path = "host/mod.rs"]
pub mod imp;
