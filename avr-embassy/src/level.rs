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
///
/// Thread mode cannot have it:
///
/// ```compile_fail,E0308
/// fn go(_: avr_embassy::Interrupt) {}
/// fn at_once(thread: avr_embassy::Thread) {
///     go(thread);
/// }
/// ```
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

/// Shows that the program starts: no task has been polled, and no interrupt of the program is on.
///
/// Start-up lends it to whatever sets up hardware. It is not [`Send`], and nobody keeps it: a task that wanted it would
/// need a `'static` one.
///
/// ```compile_fail,E0423
/// let forged = avr_embassy::Boot(core::marker::PhantomData);
/// ```
///
/// Thread mode does not have it:
///
/// ```compile_fail,E0308
/// fn set_up(_: &avr_embassy::Boot) {}
/// fn later(thread: avr_embassy::Thread) {
///     set_up(thread);
/// }
/// ```
#[derive(Debug)]
pub struct Boot(PhantomData<*mut ()>);

impl Boot {
    /// Creates a token, without any proof.
    ///
    /// # Safety
    /// Called once, by the entry point, which drops the token before interrupts are on and tasks are polled.
    #[inline(always)]
    pub const unsafe fn assume() -> Self {
        Boot(PhantomData)
    }

    /// Shows that no other code is in interrupt mode.
    #[inline(always)]
    pub const fn exclusive(&self) -> Exclusive<'_> {
        Exclusive(PhantomData)
    }
}

/// Shows that a task of either level runs, or the main loop: made from a [`Thread`] or an [`Interrupt`]. For functions
/// that both may call. A handler has none.
///
/// A ceiling is no level,
///
/// ```compile_fail,E0308
/// fn feed(_: avr_embassy::Level) {}
/// fn locked(ceiling: &avr_embassy::Ceiling) {
///     feed(ceiling);
/// }
/// ```
///
/// and no way back to one of the two:
///
/// ```compile_fail,E0308
/// fn only_here(_: avr_embassy::Thread) {}
/// fn anywhere(level: avr_embassy::Level) {
///     only_here(level);
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Level(PhantomData<*mut ()>);

impl Thread {
    /// Returns the token of either level.
    #[inline(always)]
    pub const fn level(self) -> Level {
        Level(PhantomData)
    }
}

impl Interrupt {
    /// Returns the token of either level.
    #[inline(always)]
    pub const fn level(self) -> Level {
        Level(PhantomData)
    }
}

/// Shows that no other code can be in interrupt mode, for as long as `'a`: whoever has it is in interrupt mode itself
/// ([`Interrupt::exclusive`]), keeps it out ([`Ceiling::exclusive`]), or is in start-up ([`Boot::exclusive`]).
///
/// Thread mode alone is no proof:
///
/// ```compile_fail,E0308
/// fn switch(_: avr_embassy::Exclusive<'_>) {}
/// fn at_once(thread: avr_embassy::Thread) {
///     switch(thread);
/// }
/// ```
///
/// It does not outlive the lock:
///
/// ```compile_fail
/// # use avr_embassy::{Exclusive, Thread, interrupt};
/// fn keep(thread: Thread) -> Exclusive<'static> {
///     interrupt::lock(thread, |ceiling| ceiling.exclusive())
/// }
/// ```
///
/// Unlike a [`Ceiling`] it opens no [`Shared`](crate::Shared), so a closure that already uses one may capture it.
#[derive(Clone, Copy, Debug)]
pub struct Exclusive<'a>(PhantomData<&'a ()>);

impl Exclusive<'_> {
    /// Creates a token, without any proof.
    ///
    /// # Safety
    /// Interrupt mode cannot run as long as the token is used, or the caller is in interrupt mode.
    #[inline(always)]
    pub const unsafe fn assume() -> Self {
        Exclusive(PhantomData)
    }
}

impl Interrupt {
    /// Shows that no other code is in interrupt mode: its tasks do not preempt each other. The token lives no longer
    /// than the borrow, so it crosses no `await` into another task.
    #[inline(always)]
    pub const fn exclusive(&self) -> Exclusive<'_> {
        Exclusive(PhantomData)
    }
}

impl Ceiling {
    /// Shows that no other code is in interrupt mode.
    #[inline(always)]
    pub const fn exclusive(&self) -> Exclusive<'_> {
        Exclusive(PhantomData)
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
