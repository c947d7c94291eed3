//! A value that handlers and tasks of both levels use in turn. A byte, the stage of the value, says whose turn it is.
//!
//! No level waits for another, and nothing is masked. A caller that finds a stage other than its own, or the value in
//! use, gets `None`.

use crate::byte::SharedByte;
use crate::value::Value;

/// The stage while the value is in use.
const IN_USE: u8 = u8::MAX;

/// A value and its stage: 0 at first, at most 254. The program decides what each stage means.
///
/// ```
/// use avr_embassy::Baton;
/// const FILLED: u8 = 1;
///
/// let baton = Baton::new(0);
/// // A handler measures,
/// assert_eq!(baton.pass(0, FILLED, |value| *value = 7), Some(()));
/// // and measures no more until
/// assert_eq!(baton.pass(0, FILLED, |value| *value = 8), None);
/// // a task has had the value.
/// assert_eq!(baton.pass(FILLED, 0, |value| *value), Some(7));
/// ```
pub struct Baton<T> {
    stage: SharedByte,
    value: Value<T>,
}

impl<T> Baton<T> {
    /// Creates it in stage 0.
    pub const fn new(value: T) -> Self {
        Self { stage: SharedByte::new(0), value: Value::new(value) }
    }

    /// Returns the stage; 255 while the value is in use. Any level.
    #[inline(always)]
    pub fn stage(&self) -> u8 {
        self.stage.get()
    }

    /// Sets the stage, whatever it was. Does nothing while somebody uses the value. Any level. Cost: 6 cycles.
    #[inline(always)]
    pub fn set_stage(&self, to: u8) {
        if self.stage.get() != IN_USE {
            self.stage.set(to);
        }
    }

    /// Lets `act` use the value if the stage is `from`, then sets the stage to `to`. `None` if the stage is another.
    /// Any level. Cost: 12 cycles and `act`.
    #[inline(always)]
    pub fn pass<R>(&self, from: u8, to: u8, act: impl FnOnce(&mut T) -> R) -> Option<R> {
        if from == IN_USE || self.stage.get() != from {
            return None;
        }
        // A level that preempts here has ended before this level goes on: levels nest like calls.
        self.stage.set(IN_USE);
        // SAFETY: whoever uses the value has set the stage to `IN_USE`, and in that stage nobody else takes it.
        let result = unsafe { self.value.with(act) };
        self.stage.set(to);
        Some(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_gets_what_another_has() {
        let baton = Baton::new(1);
        let inner = baton.pass(0, 2, |value| {
            *value += 1;
            let stage = baton.stage();
            baton.set_stage(0);
            (baton.pass(0, 1, |_| ()), baton.pass(2, 1, |_| ()), baton.pass(stage, 1, |_| ()))
        });
        assert_eq!(inner, Some((None, None, None)));
        assert_eq!((baton.stage(), baton.pass(2, 0, |value| *value)), (2, Some(2)));
    }
}
