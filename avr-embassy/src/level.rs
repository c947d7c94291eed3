//! Levels as types: a token shows which level runs, or which cannot run meanwhile.
//!
//! Functions that belong to a level ask for its token. Tokens take no room and no cycles. [`Thread`] and
//! [`Interrupt`] are not [`Send`], so neither reaches the other level: whatever goes to a task of the interrupt
//! executor must be [`Send`].

use core::marker::PhantomData;

/// Shows that thread mode runs: the main loop, or a task of the `Executor`.
///
/// A task of the interrupt executor cannot have it:
///
/// ```compile_fail,E0277
/// fn is_send<T: Send>() {}
/// is_send::<avr_embassy::Thread>();
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Thread(PhantomData<*mut ()>);

impl Thread {
    /// Creates a token, without any proof.
    ///
    /// # Safety
    /// The token is used in thread mode only.
    #[inline(always)]
    pub const unsafe fn assume() -> Self {
        Thread(PhantomData)
    }
}

/// Shows that a task of the interrupt executor runs.
#[derive(Clone, Copy, Debug)]
pub struct Interrupt(PhantomData<*mut ()>);

impl Interrupt {
    /// Creates a token, without any proof.
    ///
    /// # Safety
    /// The token is used in tasks of the interrupt executor only.
    #[inline(always)]
    pub const unsafe fn assume() -> Self {
        Interrupt(PhantomData)
    }
}

/// Shows that the interrupt executor cannot run: [`interrupt::lock`](crate::interrupt::lock) lends it, and nobody else
/// can make one.
///
/// ```compile_fail,E0423
/// let forged = avr_embassy::Ceiling(core::marker::PhantomData);
/// ```
///
/// It does not outlive the lock:
///
/// ```compile_fail
/// # use avr_embassy::{Ceiling, Thread, interrupt};
/// fn keep(thread: Thread) -> &'static Ceiling {
///     interrupt::lock(thread, |ceiling| ceiling)
/// }
/// ```
///
/// Interrupt mode cannot get one:
///
/// ```compile_fail,E0308
/// # use avr_embassy::{Interrupt, interrupt};
/// fn lock(level: Interrupt) {
///     interrupt::lock(level, |_| ());
/// }
/// ```
///
/// A ceiling takes no room. Like the tokens it is not [`Send`], nor is a reference to it.
#[derive(Debug)]
pub struct Ceiling(PhantomData<*mut ()>);

impl Ceiling {
    /// Makes a ceiling. Interrupt mode must not be able to run now.
    #[inline(always)]
    pub(crate) const fn new() -> Self {
        Ceiling(PhantomData)
    }
}
