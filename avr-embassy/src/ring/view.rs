//! The reading end of a ring, without the ring's size in its type.

use core::marker::PhantomData;
use core::ptr::NonNull;

use super::{Consumer, Index, Ring};

/// The reading end of a ring, for code that is shared by rings of all sizes: the program contains that code once.
///
/// A call takes some cycles more than with a [`Consumer`].
pub struct ConsumerView<T: 'static> {
    /// Points to a `Ring<T, N>`. The fields of a `Ring<T, 1>` lie at the same places in it, except the slots after
    /// the first.
    ring: NonNull<Ring<T, 1>>,
    /// The highest index: one less than a power of two, and at least 3.
    pub(super) last: Index,
    /// The view gives out references into the ring.
    values: PhantomData<&'static T>,
}

// SAFETY: a view is a `Consumer`, which may go to another level: all that both ends touch are shared indices.
unsafe impl<T: Send> Send for ConsumerView<T> {}

impl<T: Copy, const N: usize> Consumer<T, N> {
    /// Turns this end into one without the size in its type.
    pub fn into_view(self) -> ConsumerView<T> {
        const { assert!(N.is_power_of_two() && N > 2) };
        ConsumerView {
            ring: NonNull::from(self.0).cast(),
            last: (N - 1) as Index,
            values: PhantomData,
        }
    }
}

impl<T: Copy> ConsumerView<T> {
    /// Returns the fields that lie before the slots.
    fn ring(&self) -> &Ring<T, 1> {
        // SAFETY: `Ring` is laid out as in C, so a ring with more slots begins like a ring with one slot.
        unsafe { self.ring.as_ref() }
    }

    /// Returns the address of a slot. `index` must not be higher than `last`.
    pub(super) fn slot(&self, index: Index) -> *mut T {
        let slots = self.ring.as_ptr().wrapping_byte_add(Ring::<T, 1>::SLOTS).cast::<T>();
        slots.wrapping_add(index.into())
    }

    fn next(&self, index: Index) -> Index {
        index.wrapping_add(1) & self.last
    }

    /// Returns the number of values waiting.
    pub fn len(&self) -> usize {
        let ring = self.ring();
        usize::from(ring.head.get().wrapping_sub(ring.tail.get()) & self.last)
    }

    /// Whether no value waits.
    pub fn is_empty(&self) -> bool {
        let ring = self.ring();
        ring.head.get() == ring.tail.get()
    }

    /// Returns the slot taken last.
    pub fn taken(&self) -> u8 {
        self.ring().tail()
    }

    /// Returns the oldest values, as many as lie side by side; empty only if none waits. The newest value of a full
    /// ring is not among them, because the producer may replace it.
    #[inline(always)]
    pub fn waiting(&self) -> &[T] {
        // Read once: the producer may move it meanwhile.
        let head = self.ring().head.get();
        let tail = self.ring().tail.get();
        let start = self.next(tail);
        let len = match head {
            _ if head == tail => 0,
            _ if head >= start => usize::from((head - start + 1).min(self.last - 1)),
            _ => usize::from(self.last - start) + 1,
        };
        // SAFETY: `head` has moved onto or past these slots, so they are filled, and the consumer's until `tail` moves,
        // which takes `&mut self`. `Producer::replace_newest` writes to none of them.
        unsafe { core::slice::from_raw_parts(self.slot(start), len) }
    }

    /// Releases the oldest `count` values of those that [`ConsumerView::waiting`] returned.
    pub fn release_many(&mut self, count: u8) {
        let count = usize::from(count).min(self.len()) as Index;
        let tail = &self.ring().tail;
        tail.set(tail.get().wrapping_add(count) & self.last);
    }

    /// Takes the oldest value. `None` if none waits.
    pub fn pop(&mut self) -> Option<T> {
        if self.is_empty() {
            return None;
        }
        let after = self.next(self.ring().tail.get());
        // SAFETY: the slot is the consumer's until `tail` moves onto it and the producer wraps.
        let value = unsafe { self.slot(after).read() };
        self.ring().tail.set(after);
        Some(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ring::Producer;
    use std::boxed::Box;
    use std::vec::Vec;

    fn ring<const N: usize>() -> (Producer<u32, N>, ConsumerView<u32>) {
        let ring: &'static Ring<u32, N> = Box::leak(Box::new(Ring::new()));
        let (put, got) = ring.split().expect("first split");
        (put, got.into_view())
    }

    /// A view returns the values of its ring in order, however often the ring goes round.
    fn goes_round<const N: usize>() {
        let (mut put, mut got) = ring::<N>();
        assert_eq!((got.len(), got.waiting().len()), (0, 0));
        let (mut next, mut expected) = (0u32.., 0);
        for round in 0..2 * N {
            while put.free() > round % 2 {
                let _ = put.push(next.next().unwrap_or(0));
            }
            assert_eq!(got.len(), N - 1 - round % 2);
            let mut seen: Vec<u32> = got.waiting().to_vec();
            got.release_many(seen.len() as u8);
            seen.extend(core::iter::from_fn(|| got.pop()));
            for value in seen {
                assert_eq!(value, expected);
                expected += 1;
            }
            assert!(got.is_empty() && got.pop().is_none());
        }
    }

    #[test]
    fn a_view_tells_all_in_order() {
        goes_round::<4>();
        goes_round::<64>();
        goes_round::<256>();
    }

    #[test]
    fn no_more_is_released_than_waits() {
        let (mut put, mut got) = ring::<8>();
        put.push_all(0..5);
        got.release_many(3);
        assert_eq!((got.taken(), got.pop()), (3, Some(3)));
        got.release_many(9);
        assert!(got.is_empty());
        assert_eq!(got.taken(), 5);
    }
}
