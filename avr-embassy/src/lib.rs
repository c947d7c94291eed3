//! Embassy on 8-bit AVR with two levels of tasks: a thread-mode executor, an interrupt-mode executor that preempts it,
//! a time driver, event bits that a handler sets in one instruction, and rings between levels that never mask
//! interrupts.
//!
//! On top of it programs use Embassy as they know it: `#[embassy_executor::task]`, [`embassy_time`], [`embassy_sync`],
//! `embassy-futures`. The README has examples and what everything costs in cycles.
//!
//! [`embassy_time`]: https://docs.rs/embassy-time
//! [`embassy_sync`]: https://docs.rs/embassy-sync
//!
//! # Levels
//!
//! A level preempts the levels below it in this table.
//!
//! | level | what runs there | what it may do |
//! |---|---|---|
//! | short interrupts | the program's handlers, in Rust or assembly; the tick | [`Event::set`], [`interrupt::pend`], its ends of rings, [`SharedByte`](byte::SharedByte) |
//! | interrupt mode | tasks of the [`interrupt`] executor, with interrupts on | as short interrupts, and all of Embassy; [`interrupt::wait`] |
//! | thread mode | tasks of the `Executor`, the main loop | as short interrupts, and all of Embassy; [`Event::wait`], [`interrupt::lock`] |
//!
//! Functions that belong to a level ask for its token, [`Thread`] or [`Interrupt`], which the other level cannot
//! have. [`Level`] stands for either, [`Boot`] for start-up, [`Exclusive`] for whoever is in interrupt mode or keeps it
//! out. A value that both levels change is a [`Shared`]; a value that a handler and tasks use in turn is a
//! [`Baton`].
//!
//! # Critical sections mask nothing
//!
//! The `critical-section` of this crate is [`interrupt::lock`]: it keeps interrupt mode out, and **no other
//! interrupt**. So wake-ups and channels between the two levels are cheap, and no handler is delayed. The price: a
//! handler must not enter a critical section, so it must wake no `Waker` and use no `embassy_sync` channel. Instead it
//! sets an event, pends the interrupt executor, or fills a ring, and a task does the rest. Turn off the critical
//! sections that other crates bring along (`avr-device`: feature `critical-section-impl`).
//!
//! # What the runtime owns
//!
//! | what | ATmega2560 | ATmega1284P |
//! |---|---|---|
//! | the register of event bits; bits 0 to 3 are the program's | GPIOR0 | GPIOR0 |
//! | a software interrupt | USART2_UDRE; with it USART2's transmitter, whose pin (port H bit 1) is high | USART1_UDRE; with it USART1's transmitter, whose pin (port D bit 3) is high |
//! | a timer for the millisecond | timer 0 and TIMER0_COMPA | timer 0 and TIMER0_COMPA |
//! | the sleep mode | idle | idle |
//! | the pender of Embassy's executors and the critical section | | |
//!
//! # When full or late
//!
//! - **Events** that repeat before the main loop looks merge into one. None is lost.
//! - **A ring** that is full refuses: [`Producer::push`](ring::Producer::push) gives the value back.
//! - **Timers** of more than 4 tasks at once (features `timers-8`, `timers-16`): the tasks beyond that number are
//!   polled all the time until there is room. No time is missed, but the CPU does not sleep.
//! - **A timer** is as late as the longest poll of a thread-mode task. Work that must be on time is done by a handler
//!   of the program that pends a task of interrupt mode.
//! - **Requests** to interrupt mode merge while it cannot run, and are served right after.
//! - **A second task** that waits for an event, or in [`interrupt::wait`], takes turns with the first: both go on, at
//!   the cost of polls.
//!
//! # Host
//!
//! Everything that is not a register works on the host, too. There each thread is a machine of its own: see
//! `host::Runtime`.
#![no_std]
#![cfg_attr(target_arch = "avr", feature(asm_experimental_arch, optimize_attribute))]

#[cfg(not(target_os = "none"))]
#[doc(hidden)]
pub extern crate std;

/// Declares a value that a machine has one of, as a function that returns `&'static` to it.
///
/// In an image it is a static. On the host each thread is a machine of its own, so that tests can run side by side:
/// the value is made on the thread's first use.
///
/// ```
/// use std::sync::atomic::{AtomicU8, Ordering::Relaxed};
///
/// avr_embassy::machine_static! {
///     /// Bytes that were lost.
///     fn lost() -> AtomicU8 = AtomicU8::new(0);
/// }
///
/// lost().store(1, Relaxed);
/// assert_eq!(lost().load(Relaxed), 1);
/// ```
#[macro_export]
macro_rules! machine_static {
    ($($(#[$meta:meta])* $vis:vis fn $name:ident() -> $type:ty = $init:expr;)+) => {$(
        $(#[$meta])*
        #[inline(always)]
        $vis fn $name() -> &'static $type {
            #[cfg(target_os = "none")]
            {
                static VALUE: $type = $init;
                &VALUE
            }
            #[cfg(not(target_os = "none"))]
            {
                $crate::std::thread_local!(static VALUE: &'static $type =
                    $crate::std::boxed::Box::leak($crate::std::boxed::Box::new($init)));
                VALUE.with(|value| *value)
            }
        }
    )+};
}

#[cfg(target_arch = "avr")]
pub mod assembly;
mod baton;
pub mod byte;
#[cfg(target_arch = "avr")]
mod chip;
#[cfg(feature = "rp2040")]
#[path = "chip/rp2040.rs"]
mod chip;
#[cfg(all(target_os = "none", not(any(target_arch = "avr", feature = "_cortex-m"))))]
compile_error!("name the chip by a feature");
pub mod event;
#[cfg(target_arch = "avr")]
mod executor;
#[cfg(feature = "_cortex-m")]
#[path = "executor/cortex_m.rs"]
mod executor;
#[cfg(not(target_os = "none"))]
pub mod host;
pub mod interrupt;
mod level;
mod pender;
#[cfg(any(target_arch = "avr", test))]
mod period;
pub mod ring;
mod shared;
#[cfg(target_arch = "avr")]
pub mod time;
pub mod timers;
mod value;

pub use baton::Baton;
pub use event::{Event, Waiter};
#[cfg(target_os = "none")]
pub use executor::Executor;
pub use level::{Boot, Ceiling, Exclusive, Interrupt, Level, Thread};
pub use shared::{InterruptEnd, Place, Shared};

/// Runs `act`, which takes a few cycles, with interrupts off. Any level. Cost: 3 cycles.
///
/// On the host it only runs `act`.
#[inline(always)]
pub fn mask<R>(act: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "avr")]
    {
        let status: u8;
        // SAFETY: the status is restored below.
        unsafe { core::arch::asm!("in {status}, 0x3F", "cli", status = out(reg) status) };
        let result = act();
        // SAFETY: interrupts are as they were before.
        unsafe { core::arch::asm!("out 0x3F, {status}", status = in(reg) status) };
        result
    }
    #[cfg(feature = "_cortex-m")]
    return cortex_m::interrupt::free(|_| act());
    #[cfg(not(target_os = "none"))]
    act()
}
