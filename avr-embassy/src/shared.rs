//! State that thread mode and interrupt mode both change: thread mode under the ceiling lock, interrupt mode because
//! it preempts.
//!
//! | end | owner | why no other code uses the value meanwhile |
//! |---|---|---|
//! | [`Shared::with`] | thread mode, within [`interrupt::lock`](crate::interrupt::lock) | the lock keeps interrupt mode out |
//! | [`InterruptEnd`] | a task of interrupt mode | thread mode goes on only when that task waits, which it cannot within a closure |
//!
//! Nothing is checked or counted at run time: code that would use a value again from within its own closure does not
//! compile. (On the host, where a thread-local could smuggle a token, a second borrow is a panic.) A handler of a
//! short interrupt has no end; see [`Baton`](crate::Baton).

use core::marker::PhantomData;

use crate::byte::SharedByte;
use crate::value::Value;
use crate::{Ceiling, Interrupt};

/// A value that thread mode and interrupt mode share. The end for interrupt mode is handed out once.
///
/// ```
/// use avr_embassy::{InterruptEnd, host::Runtime, interrupt};
///
/// avr_embassy::shared_static! {
///     /// How often something has happened.
///     struct Count: u32 = 0;
/// }
///
/// let runtime = Runtime::new();
/// interrupt::start(|_, level| {
///     // This goes along with a task of interrupt mode.
///     let mut end = InterruptEnd::of(Count, level).expect("the first time");
///     end.with(|count| *count += 1);
/// });
/// let now = interrupt::lock(runtime.thread(), |ceiling| Count.with(ceiling, |count| *count));
/// assert_eq!(now, 1);
/// ```
///
/// Thread mode has no way to the value without the lock:
///
/// ```compile_fail,E0061
/// # use avr_embassy::Shared;
/// fn now(count: &Shared<u32>) -> u32 {
///     count.with(|count| *count)
/// }
/// ```
///
/// Thread mode keeps no borrow beyond the lock:
///
/// ```compile_fail
/// # use avr_embassy::{Shared, Thread, interrupt};
/// fn now(thread: Thread, count: &Shared<u32>) -> &u32 {
///     interrupt::lock(thread, |ceiling| count.with(ceiling, |count| &*count))
/// }
/// ```
///
/// Thread mode cannot use the value again from within `act`, because neither the ceiling nor the thread token can
/// enter the closure:
///
/// ```compile_fail,E0277
/// # use avr_embassy::{Ceiling, Shared};
/// fn twice(ceiling: &Ceiling, count: &Shared<u32>) {
///     count.with(ceiling, |first| count.with(ceiling, |second| *first += *second));
/// }
/// ```
///
/// ```compile_fail,E0277
/// # use avr_embassy::{Ceiling, Shared, Thread, interrupt};
/// fn twice(thread: Thread, ceiling: &Ceiling, count: &Shared<u32>) {
///     count.with(ceiling, |first| {
///         interrupt::lock(thread, |again| count.with(again, |second| *first += *second))
///     });
/// }
/// ```
///
/// Thread mode cannot have the end of interrupt mode:
///
/// ```compile_fail,E0308
/// # use avr_embassy::{InterruptEnd, Shared, Thread};
/// fn steal(thread: Thread, count: &'static Shared<u32>) {
///     InterruptEnd::of(count, thread);
/// }
/// ```
pub struct Shared<T> {
    value: Value<T>,
    /// Not 0: the end of interrupt mode has been handed out.
    taken: SharedByte,
}

impl<T: Send> Shared<T> {
    /// Creates it with a value.
    pub const fn new(value: T) -> Self {
        Self { value: Value::new(value), taken: SharedByte::new(0) }
    }

    /// Lets `act` use the value. Thread mode, which shows the ceiling.
    ///
    /// `act` is [`Send`], so it captures no [`Thread`](crate::Thread) and no [`Ceiling`] and cannot call this again.
    #[inline(always)]
    pub fn with<R>(&self, _: &Ceiling, act: impl FnOnce(&mut T) -> R + Send) -> R {
        // SAFETY: the ceiling shows that interrupt mode cannot run. Thread mode is here only once: `act` has no token
        // and gets no ceiling, and `T` holds none.
        unsafe { self.value.with(act) }
    }
}

/// Where a [`Shared`] is: a reference, or a type that [`shared_static!`](crate::shared_static!) declares and that
/// takes no room.
///
/// # Safety
/// [`Place::shared`] always returns the same reference (on the host: within a thread).
pub unsafe trait Place: Copy {
    /// The type of the shared value.
    type Value: Send + 'static;

    /// Returns the [`Shared`] at this place.
    fn shared(self) -> &'static Shared<Self::Value>;
}

// SAFETY: a reference always points to the same value.
unsafe impl<T: Send> Place for &'static Shared<T> {
    type Value = T;

    #[inline(always)]
    fn shared(self) -> &'static Shared<T> {
        self
    }
}

/// Declares a [`Shared`] that a machine has one of, as a type that stands for it.
#[macro_export]
macro_rules! shared_static {
    ($(#[$meta:meta])* $vis:vis struct $name:ident: $type:ty = $init:expr;) => {
        $(#[$meta])*
        #[derive(Clone, Copy)]
        $vis struct $name;

        // SAFETY: the type stands for this one value only.
        unsafe impl $crate::Place for $name {
            type Value = $type;

            #[inline(always)]
            fn shared(self) -> &'static $crate::Shared<$type> {
                $crate::machine_static! {
                    fn value() -> $crate::Shared<$type> = $crate::Shared::new($init);
                }
                value()
            }
        }

        impl $name {
            /// Lets `act` use the value, see [`Shared::with`]($crate::Shared::with).
            #[inline(always)]
            $vis fn with<R>(
                self,
                ceiling: &$crate::Ceiling,
                act: impl FnOnce(&mut $type) -> R + Send,
            ) -> R {
                $crate::Place::shared(self).with(ceiling, act)
            }
        }
    };
}

/// Interrupt mode's end of a [`Shared`]. It is not [`Send`], so it stays in interrupt mode.
///
/// A task keeps no reference to the value while it waits:
///
/// ```compile_fail
/// # use avr_embassy::{InterruptEnd, Shared};
/// async fn keep(mut end: InterruptEnd<&'static Shared<u32>>) {
///     let mut kept = None;
///     end.with(|count| kept = Some(count));
///     drop(kept);
/// }
/// ```
///
/// A task of thread mode cannot have an end:
///
/// ```compile_fail,E0277
/// fn is_send<T: Send>() {}
/// is_send::<avr_embassy::InterruptEnd<&'static avr_embassy::Shared<u32>>>();
/// ```
pub struct InterruptEnd<P: Place>(P, PhantomData<*mut ()>);

impl<P: Place> InterruptEnd<P> {
    /// Hands out the end in interrupt mode of the value at a place. `None` after the first time.
    pub fn of(place: P, _: Interrupt) -> Option<Self> {
        let taken = &place.shared().taken;
        if taken.get() != 0 {
            return None;
        }
        taken.set(1);
        Some(Self(place, PhantomData))
    }

    /// Lets `act` use the value.
    #[inline(always)]
    pub fn with<R>(&mut self, act: impl FnOnce(&mut P::Value) -> R) -> R {
        // SAFETY: interrupt mode runs, because the end cannot leave it. So thread mode does not run, nor is it within
        // the lock. This is the only end, and it is borrowed.
        unsafe { self.0.shared().value.with(act) }
    }

    /// Lets `act` look at the value.
    #[inline(always)]
    pub fn look<R>(&self, act: impl FnOnce(&P::Value) -> R) -> R {
        // SAFETY: as in `with`; the borrow of `self` excludes `with`.
        unsafe { self.0.shared().value.look(act) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::Runtime;
    use crate::interrupt;
    use std::boxed::Box;

    #[test]
    fn both_levels_change_the_value_and_interrupt_mode_has_one_end() {
        let shared: &'static Shared<u8> = Box::leak(Box::new(Shared::new(1)));
        let runtime = Runtime::new();
        let mut end = InterruptEnd::of(shared, runtime.interrupt()).expect("the first");
        assert!(InterruptEnd::of(shared, runtime.interrupt()).is_none());
        end.with(|value| *value += 1);
        let seen = interrupt::lock(runtime.thread(), |ceiling| {
            shared.with(ceiling, |value| {
                *value += 1;
                *value
            })
        });
        assert_eq!((seen, end.look(|value| *value)), (3, 3));
    }
}
