//! A ring between one producer and one consumer that may preempt each other.
//!
//! An index is as wide as the CPU reads and writes in one instruction (one byte on an 8-bit CPU), so neither side
//! ever masks interrupts. Functions that take or return slots as bytes are for rings of up to 256 slots. Slots are
//! filled and read in place. One slot stays empty to tell full from empty: a `Ring<T, N>` holds `N - 1` values.
//!
//! When the ring is full, [`Producer::slot`] is `None`; the producer waits, or counts the loss.

#![allow(
    clippy::unnecessary_cast,
    clippy::useless_conversion,
    reason = "an `Index` is a byte on some chips, and wider on others"
)]

use core::cell::UnsafeCell;
use core::marker::PhantomData;
use core::mem::MaybeUninit;
use core::ops::{Deref, DerefMut};

mod view;
mod window;
pub use view::ConsumerView;
pub use window::Window;

pub use crate::byte::Index;
use crate::byte::{SharedByte, SharedIndex};

/// The storage. `N` is 2 to 256, or up to 65,536 where an [`Index`] has 16 bits.
///
/// The fields that do not depend on `N` lie first, so that a [`ConsumerView`] finds them whatever `N` is.
#[repr(C)]
pub struct Ring<T, const N: usize> {
    /// The slot filled last; written by the producer only.
    head: SharedIndex,
    /// The slot read last; written by the consumer only.
    tail: SharedIndex,
    /// Which ends have been taken.
    taken: SharedByte,
    slots: UnsafeCell<[MaybeUninit<T>; N]>,
}

/// Bit of [`Ring::taken`]: the producer's end has been handed out.
const FILLS: u8 = 1;
/// Bit of [`Ring::taken`]: the consumer's end has been handed out.
const READS: u8 = 2;

/// Takes `ends` (bits) if none of them has been taken. Returns whether it has.
#[inline(never)]
#[cfg_attr(target_arch = "avr", optimize(size))]
fn take(taken: &SharedByte, ends: u8) -> bool {
    crate::mask(|| {
        let before = taken.get();
        if before & ends == 0 {
            taken.set(before | ends);
        }
        before & ends == 0
    })
}

// SAFETY: a slot belongs to the producer until `head` has moved onto it and to the consumer until
// `tail` has; `split` hands out one of each, once.
unsafe impl<T: Send, const N: usize> Sync for Ring<T, N> {}

const fn next<const N: usize>(index: Index) -> Index {
    let next = index.wrapping_add(1);
    if next as usize == N { 0 } else { next }
}

impl<T: Copy, const N: usize> Ring<T, N> {
    /// Offset of the slots, for interrupts in assembly that have a `push` or `pop` of their own.
    pub const SLOTS: usize = core::mem::offset_of!(Self, slots);
    /// See [`Ring::SLOTS`].
    pub const HEAD: usize = core::mem::offset_of!(Self, head);
    /// See [`Ring::SLOTS`].
    pub const TAIL: usize = core::mem::offset_of!(Self, tail);

    const SIZE_OK: () = assert!(N >= 2 && N <= Index::MAX as usize + 1);

    /// Returns an empty ring.
    pub const fn new() -> Self {
        const { Self::SIZE_OK };
        Self {
            slots: UnsafeCell::new([MaybeUninit::uninit(); N]),
            head: SharedIndex::new(0),
            tail: SharedIndex::new(0),
            taken: SharedByte::new(0),
        }
    }

    /// Hands out the two ends of the ring. `None` if one has been taken. Any level.
    pub fn split(&'static self) -> Option<(Producer<T, N>, Consumer<T, N>)> {
        take(&self.taken, FILLS | READS).then_some((Producer(self), Consumer(self)))
    }

    /// Hands out the filling end. `None` if it has been taken. Any level, such as a handler that takes it when it
    /// first runs.
    pub fn producer(&'static self) -> Option<Producer<T, N>> {
        take(&self.taken, FILLS).then_some(Producer(self))
    }

    /// Hands out the reading end. `None` if it has been taken. Any level.
    pub fn consumer(&'static self) -> Option<Consumer<T, N>> {
        take(&self.taken, READS).then_some(Consumer(self))
    }

    /// Returns a second reading end, for code that stands in for the owner of the first.
    ///
    /// # Safety
    /// The owner does not run meanwhile.
    pub unsafe fn stand_in(&'static self) -> Consumer<T, N> {
        Consumer(self)
    }

    /// Returns the number of values put in and not yet released. Each side sees what the other does at once or a
    /// little later.
    pub fn used(&self) -> usize {
        // Computed at the width of an index, which wraps. If `N` is one more than an index holds, it becomes 0 here,
        // and the sum modulo that width stays right.
        let (head, tail) = (self.head.get(), self.tail.get());
        let used = head.wrapping_sub(tail);
        usize::from(if head >= tail { used } else { used.wrapping_add(N as Index) })
    }

    /// Returns the slot filled last, `None` if it has been taken.
    pub fn newest(&self) -> Option<u8> {
        let head = self.head.get();
        (head != self.tail.get()).then_some(head as u8)
    }

    /// Returns the slot taken last.
    pub fn tail(&self) -> u8 {
        self.tail.get() as u8
    }

    /// Returns the value in a slot.
    ///
    /// # Safety
    ///
    /// The slot has been filled, and the producer is held off.
    pub unsafe fn at(&self, index: u8) -> T {
        // SAFETY: the caller says so.
        unsafe { self.slot(index.into()).read() }
    }

    /// Returns the value taken last. `None` if unknown: at first, and each time the ring has gone round.
    pub fn taken_last(&self) -> Option<T> {
        let tail = self.tail.get();
        // SAFETY: only slot 0 can be the slot read last without having been filled; no slot that `tail` is on is
        // written.
        (tail != 0).then(|| unsafe { self.slot(tail).read() })
    }

    fn slot(&self, index: Index) -> *mut T {
        // Stays inside the array: indices are below N by construction.
        self.slots.get().cast::<T>().wrapping_add(index as usize)
    }
}

impl<T: Copy, const N: usize> Default for Ring<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

/// The filling end.
pub struct Producer<T: 'static, const N: usize>(&'static Ring<T, N>);

impl<T: Copy, const N: usize> Producer<T, N> {
    /// Returns the number of slots that can be filled now.
    #[inline]
    pub fn free(&self) -> usize {
        N - 1 - self.0.used()
    }

    /// Returns the number of slots the consumer has not released.
    #[inline]
    pub fn used(&self) -> usize {
        self.0.used()
    }

    /// Returns the slot filled last.
    #[inline]
    pub fn filled(&self) -> u8 {
        self.0.head.get() as u8
    }

    /// Returns the slot behind the one filled last, `None` if that is the slot taken last.
    #[inline(always)]
    fn vacant(&self) -> Option<Index> {
        let after = next::<N>(self.0.head.get());
        (after != self.0.tail.get()).then_some(after)
    }

    /// Writes a slot behind `head`, which is vacant, or is the slot of `tail` if nothing has been taken from it; or the
    /// newest slot of a full ring.
    #[inline(always)]
    fn write(&mut self, index: Index, value: T) {
        // SAFETY: a slot behind `head` is the producer's until `head` moves onto it. For the newest slot of a full ring
        // see `replace_newest`.
        unsafe { self.0.slot(index).write(value) };
    }

    /// Puts a value in. Gives it back if the ring is full.
    #[inline]
    pub fn push(&mut self, value: T) -> Result<(), T> {
        let Some(after) = self.vacant() else { return Err(value) };
        self.write(after, value);
        self.0.head.set(after);
        Ok(())
    }

    /// Writes a value into every vacant slot. The consumer does not see them.
    pub fn prefilled(mut self, value: T) -> Prefilled<T, N> {
        let tail = self.0.tail.get();
        let mut index = self.0.head.get();
        loop {
            index = next::<N>(index);
            // Skips the slot taken last, which holds a value already. Slot 0 is always written, because at first
            // nothing has been taken from it.
            if index != tail || index == 0 {
                self.write(index, value);
            }
            if index == tail {
                return Prefilled(self);
            }
        }
    }

    /// Returns the slot of the next value, with `value` in it. `None` if the ring is full.
    ///
    /// A value that is made in its place needs no copy.
    #[inline(always)]
    pub fn slot(&mut self, value: T) -> Option<Slot<'_, T, N>> {
        self.slot_with(|| value)
    }

    /// Returns a free slot as [`Producer::slot`] does, holding what `make` returns. `make` is not called if the ring
    /// is full.
    #[inline(always)]
    pub fn slot_with(&mut self, make: impl FnOnce() -> T) -> Option<Slot<'_, T, N>> {
        let after = self.vacant()?;
        self.write(after, make());
        Some(Slot { ring: self.0, after, producer: PhantomData })
    }

    /// Returns a value pushed earlier; `back` 0 is the newest. `None` if it has been released.
    pub fn pushed(&self, back: usize) -> Option<&T> {
        if back >= self.0.used() {
            return None;
        }
        // SAFETY: the slot was written by this producer, which alone could overwrite it, and the
        // consumer never writes to slots; the borrow of `self` keeps away what writes to them.
        Some(unsafe { &*self.0.slot(self.index_of(back)) })
    }

    /// Returns the values behind slot `index`, including those that the consumer has released. None of them may have
    /// been overwritten since.
    pub fn behind(&self, index: u8) -> impl Iterator<Item = &T> {
        let (mut at, head) = (Index::from(index), self.0.head.get());
        core::iter::from_fn(move || {
            if at == head {
                return None;
            }
            at = next::<N>(at);
            // SAFETY: a slot that this producer has written, which alone could overwrite it.
            Some(unsafe { &*self.0.slot(at) })
        })
    }

    /// Puts values in, as many as there is room for, and shows all of them to the consumer at once.
    #[inline]
    pub fn push_all(&mut self, values: impl Iterator<Item = T>) {
        let tail = self.0.tail.get();
        let mut head = self.0.head.get();
        for value in values {
            let after = next::<N>(head);
            if after == tail {
                break;
            }
            self.write(after, value);
            head = after;
        }
        self.0.head.set(head);
    }

    /// Puts a run of values in. `fill` gets the vacant slots that lie side by side, writes them from the first on,
    /// and returns the part that it has written. The consumer sees that part all at once. Returns its length.
    #[inline(always)]
    pub fn fill(
        &mut self,
        fill: impl for<'a> FnOnce(&'a mut [MaybeUninit<T>]) -> &'a mut [T],
    ) -> u8 {
        let (start, tail) = (next::<N>(self.0.head.get()), self.0.tail.get());
        // The run ends before the slot of `tail`, which stays vacant, or at the end of the array. Arithmetic in bytes
        // takes half the time of words.
        let len = if tail >= start { tail - start } else { (N - usize::from(start)) as Index };
        let slots = self.0.slot(start);
        // SAFETY: the slots behind `head` are the producer's, as many as are free, and these do not
        // go beyond the end; `MaybeUninit` may lie there whatever was written.
        let vacant = unsafe { core::slice::from_raw_parts_mut(slots.cast(), len.into()) };
        let filled = fill(vacant);
        // A slice that does not begin at these slots has filled none of them.
        if filled.as_ptr() != slots.cast_const() {
            return 0;
        }
        let count = filled.len() as Index;
        if count > 0 {
            // The last value of the run: not beyond the end.
            self.0.head.set(start + (count - 1));
        }
        count as u8
    }

    /// Replaces the newest value of a full ring. Returns `false` if the ring has room.
    ///
    /// Either end may preempt the other: interrupts are off while the value is replaced.
    ///
    /// # Safety
    /// The consumer is a [`ConsumerView`], which never looks at the newest value of a full ring; or it keeps no
    /// reference to it while it can be interrupted.
    pub unsafe fn replace_newest(&mut self, value: T) -> bool {
        const { assert!(N > 2, "a ring of one value has none that is older than its newest") };
        crate::mask(|| {
            let full = self.free() == 0;
            if full {
                self.write(self.0.head.get(), value);
            }
            full
        })
    }

    /// Changes a value pushed earlier; `back` 0 is the newest. Returns `false` if it has been released, or if another
    /// value is released just then.
    ///
    /// Interrupts are off while `change` runs, so it has to be short. Cost: interrupts off for 8 cycles more than
    /// `change` takes.
    ///
    /// # Safety
    /// The consumer looks at values only at the producer's level or in an interrupt above it, and keeps no reference
    /// to one: none exists while the producer runs.
    #[inline(always)]
    pub unsafe fn amend_masked(&mut self, back: usize, change: impl FnOnce(&mut T)) -> bool {
        let tail = self.0.tail.get();
        let Some(index) = self.waiting(back) else { return false };
        // The address is computed before interrupts are off.
        let slot = core::hint::black_box(self.0.slot(index));
        crate::mask(|| {
            let waits = self.0.tail.get() == tail;
            if waits {
                // SAFETY: the consumer has not released it, cannot run, and by the contract holds no reference to it.
                change(unsafe { &mut *slot });
            }
            waits
        })
    }

    /// Returns the index of a value pushed earlier, `None` if it has been released.
    #[inline(never)]
    #[cfg_attr(target_arch = "avr", optimize(size))]
    fn waiting(&self, back: usize) -> Option<Index> {
        (back < self.0.used()).then(|| self.index_of(back))
    }

    /// Returns a copy of a value pushed earlier; `back` 0 is the newest. `None` if it has been released. Smaller code
    /// than [`Producer::pushed`].
    pub fn copy_of(&self, back: usize) -> Option<T> {
        // SAFETY: as in `pushed`.
        self.waiting(back).map(|index| unsafe { self.0.slot(index).read() })
    }

    fn index_of(&self, back: usize) -> Index {
        let head = self.0.head.get() as usize;
        let index = if head >= back { head - back } else { head + N - back };
        index as Index
    }
}

/// The filling end of a ring in which every slot holds a value ([`Producer::prefilled`]). A slot is handed out with
/// its old value, because clearing it would take time.
pub struct Prefilled<T: 'static, const N: usize>(Producer<T, N>);

impl<T: Copy, const N: usize> Prefilled<T, N> {
    /// Returns the slot of the next value, which holds an older value. `None` if the ring is full.
    #[inline(always)]
    pub fn slot(&mut self) -> Option<Slot<'_, T, N>> {
        let after = self.0.vacant()?;
        Some(Slot { ring: self.0.0, after, producer: PhantomData })
    }

    /// Returns the value of that slot, to be changed in several steps before it is [published](Slot::publish). `None`
    /// if the ring is full.
    #[inline(always)]
    pub fn vacant_mut(&mut self) -> Option<&mut T> {
        let after = self.0.vacant()?;
        // SAFETY: `Producer::prefilled` has written the slot. It belongs to the producer, which is borrowed, until it
        // is published.
        Some(unsafe { &mut *self.0.0.slot(after) })
    }

    /// The producer, which can change values that the consumer has not taken yet.
    #[inline(always)]
    pub fn producer(&mut self) -> &mut Producer<T, N> {
        &mut self.0
    }
}

impl<T: Copy, const N: usize> Deref for Prefilled<T, N> {
    type Target = Producer<T, N>;

    #[inline(always)]
    fn deref(&self) -> &Producer<T, N> {
        &self.0
    }
}

/// The reading end.
pub struct Consumer<T: 'static, const N: usize>(&'static Ring<T, N>);

impl<T: Copy, const N: usize> Consumer<T, N> {
    /// Returns the number of values waiting.
    #[inline]
    pub fn len(&self) -> usize {
        self.0.used()
    }

    /// Whether no value waits.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.0.head.get() == self.0.tail.get()
    }

    /// Returns the slot taken last.
    #[inline]
    pub fn taken(&self) -> u8 {
        self.0.tail()
    }

    /// Returns what `look` makes of the value `ahead` places behind the oldest. `None` if no value waits there.
    #[inline]
    pub fn peek<R>(&self, ahead: usize, look: impl FnOnce(&T) -> R) -> Option<R> {
        if ahead >= self.0.used() {
            return None;
        }
        let tail = self.0.tail.get() as usize;
        let index = tail + 1 + ahead;
        let index = if index >= N { index - N } else { index };
        // SAFETY: the slot is the consumer's until `tail` moves onto it and the producer wraps.
        Some(look(unsafe { &*self.0.slot(index as Index) }))
    }

    /// Releases the oldest value.
    #[inline]
    pub fn release(&mut self) {
        if !self.is_empty() {
            let tail = self.0.tail.get();
            self.0.tail.set(next::<N>(tail));
        }
    }

    /// Returns the oldest values, as many as lie side by side; empty only if none waits.
    #[inline]
    pub fn waiting(&self) -> &[T] {
        // Read once: the producer may move it meanwhile.
        let head = self.0.head.get();
        let tail = self.0.tail.get();
        let start = next::<N>(tail);
        let len = match head {
            _ if head == tail => 0,
            _ if head >= start => usize::from(head - start) + 1,
            _ => N - usize::from(start),
        };
        // SAFETY: `head` has moved onto or past these slots, so they are filled, and the consumer's until `tail` moves,
        // which takes `&mut self`.
        unsafe { core::slice::from_raw_parts(self.0.slot(start), len) }
    }

    /// Releases the oldest `count` values of those that [`Consumer::waiting`] returned.
    #[inline]
    pub fn release_many(&mut self, count: u8) {
        let count = usize::from(count).min(self.0.used());
        let tail = usize::from(self.0.tail.get()) + count;
        self.0.tail.set(if tail >= N { tail - N } else { tail } as Index);
    }

    /// Takes the oldest value. `None` if none waits.
    #[inline]
    pub fn pop(&mut self) -> Option<T> {
        if self.is_empty() {
            return None;
        }
        let tail = self.0.tail.get();
        let after = next::<N>(tail);
        // SAFETY: as in `peek`.
        let value = unsafe { self.0.slot(after).read() };
        self.0.tail.set(after);
        Some(value)
    }
}

/// A slot with a value that the consumer does not see before it is published.
pub struct Slot<'a, T: 'static, const N: usize> {
    ring: &'static Ring<T, N>,
    after: Index,
    /// The slot borrows the producer: nothing else goes into the ring while the slot exists.
    producer: PhantomData<&'a mut Producer<T, N>>,
}

impl<T: Copy, const N: usize> Slot<'_, T, N> {
    /// Shows the value to the consumer.
    #[inline(always)]
    pub fn publish(self) {
        self.ring.head.set(self.after);
    }
}

impl<T: Copy, const N: usize> Deref for Slot<'_, T, N> {
    type Target = T;

    #[inline(always)]
    fn deref(&self) -> &T {
        // SAFETY: `Producer::slot` or `Producer::prefilled` has written the slot, and it is the producer's until it
        // is published.
        unsafe { &*self.ring.slot(self.after) }
    }
}

impl<T: Copy, const N: usize> DerefMut for Slot<'_, T, N> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: as in `deref`, and `self` is the only way to the slot.
        unsafe { &mut *self.ring.slot(self.after) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::boxed::Box;
    use std::vec::Vec;

    fn ring<const N: usize>() -> (Producer<u16, N>, Consumer<u16, N>) {
        let ring: &'static Ring<u16, N> = Box::leak(Box::new(Ring::new()));
        ring.split().expect("first split")
    }

    #[test]
    fn keeps_order_and_says_when_full() {
        let (mut p, mut c) = ring::<4>();
        for round in 0..10 {
            assert_eq!(p.free(), 3);
            for i in 0..3 {
                if i == 1 {
                    p.slot(round * 10 + i).unwrap().publish();
                } else {
                    assert_eq!(p.push(round * 10 + i), Ok(()));
                }
            }
            assert_eq!(p.push(99), Err(99));
            assert!(p.slot(99).is_none());
            assert_eq!(c.len(), 3);
            assert_eq!(c.peek(2, |v| *v), Some(round * 10 + 2));
            assert_eq!(c.peek(3, |v| *v), None);
            let got: Vec<u16> = core::iter::from_fn(|| c.pop()).collect();
            assert_eq!(got, [round * 10, round * 10 + 1, round * 10 + 2]);
        }
    }

    #[test]
    fn the_producer_sees_and_amends_what_is_still_queued() {
        let (mut p, mut c) = ring::<4>();
        for v in 1..=3 {
            p.push(v).expect("room");
        }
        c.release();
        p.push(4).expect("room");
        assert_eq!((p.pushed(0), p.pushed(2), p.pushed(3)), (Some(&4), Some(&2), None));
        // SAFETY: all ends are used in turn, and no reference is kept.
        let mut amend = |back, by| unsafe { p.amend_masked(back, |v| *v += by) };
        assert!(amend(1, 27) && amend(2, 10) && !amend(3, 10));
        assert_eq!((p.copy_of(2), p.copy_of(3)), (Some(12), None));
        let got: Vec<u16> = core::iter::from_fn(|| c.pop()).collect();
        assert_eq!(got, [12, 30, 4]);
    }

    #[test]
    fn the_newest_value_of_a_full_ring_is_replaced_unseen() {
        for at in 0..8 {
            let (mut p, c) = ring::<8>();
            let mut c = c.into_view();
            for v in 0..at {
                p.push(v).expect("room");
                c.release_many(1);
            }
            // SAFETY: the consumer is a view.
            let replace = |p: &mut Producer<u16, 8>, by| unsafe { p.replace_newest(by) };
            p.push_all(10..16);
            assert!(!replace(&mut p, 99), "there is room");
            assert_eq!(p.push(16), Ok(()));
            let (seen, first) = (c.waiting().to_vec(), c.waiting().as_ptr());
            assert!(!seen.is_empty() && !seen.contains(&16), "{seen:?}");
            assert!(replace(&mut p, 99));
            // Whoever has looked at the values before finds all of them as they were.
            assert_eq!((c.waiting(), c.waiting().as_ptr()), (&seen[..], first));
            c.release_many(seen.len() as u8);
            assert!(!replace(&mut p, 98), "there is room again");
            let rest: Vec<u16> = core::iter::from_fn(|| c.pop()).collect();
            let got: Vec<u16> = seen.into_iter().chain(rest).collect();
            assert_eq!(got, [10, 11, 12, 13, 14, 15, 99]);
        }
    }

    #[test]
    fn wraps_at_256_with_byte_indices() {
        let (mut p, mut c) = ring::<256>();
        for i in 0..1000u16 {
            p.push(i).expect("room");
            assert_eq!(p.used(), 1);
            assert_eq!(c.pop(), Some(i));
        }
        for i in 0..255 {
            p.push(i).expect("room");
        }
        assert_eq!(p.free(), 0);
    }

    #[test]
    fn many_at_once() {
        let (mut p, mut c) = ring::<4>();
        assert!(c.waiting().is_empty());
        let mut next = 0u16..;
        let mut taken: Vec<u16> = Vec::new();
        while taken.len() < 20 {
            let room = p.free();
            p.push_all(next.by_ref().take(room));
            assert_eq!(p.free(), 0);
            p.push_all([99].into_iter());
            let run = c.waiting().to_vec();
            assert!(!run.is_empty());
            c.release_many(run.len().min(2) as u8);
            taken.extend(run.iter().take(2));
        }
        assert!(taken.iter().copied().eq(0..taken.len() as u16));
    }

    #[test]
    fn vacant_slots_are_filled_in_place() {
        let ring: &'static Ring<u16, 8> = Box::leak(Box::new(Ring::new()));
        let (mut p, mut c) = ring.split().unwrap();
        let (mut next, mut taken) = (0.., Vec::new());
        for round in 0..50u8 {
            let most = p.free().min(round.into());
            let count = p.fill(|slots| {
                let count = slots.len().min(usize::from(round % 5));
                let values: Vec<u16> = next.by_ref().take(count).collect();
                slots[..count].write_copy_of_slice(&values)
            });
            assert!(usize::from(count) <= most && (round % 5 == 0 || most == 0 || count > 0));
            if round % 3 != 0 {
                taken.extend_from_slice(c.waiting());
                c.release_many(c.waiting().len() as u8);
            }
        }
        assert!(taken.len() > 50 && taken.iter().copied().eq(0..taken.len() as u16));
    }

    #[test]
    fn values_from_elsewhere_fill_nothing() {
        let (mut p, c) = ring::<4>();
        assert_eq!(p.fill(|_| Box::leak(Box::new([1, 2]))), 0);
        assert!(c.is_empty());
    }

    #[test]
    fn what_waits_is_replaced_in_place() {
        let ring: &'static Ring<u8, 8> = Box::leak(Box::new(Ring::new()));
        let (mut p, c) = ring.split().unwrap();
        let mut c = c.into_view();
        for round in 0..20 {
            for byte in [round, b'x', b'y'] {
                p.push(byte).unwrap();
            }
            let mut window = c.window();
            assert_eq!((window.len(), window.get(0), window.get(3)), (3, round, 0));
            assert!(window.replace(2, b'y', b'z') && !window.replace(1, b'y', b'z'));
            assert!(!window.replace(3, 0, b'z'), "none waits there");
            let got: Vec<u8> = core::iter::from_fn(|| c.pop()).collect();
            assert_eq!(got, [round, b'x', b'z']);
        }
    }

    #[test]
    fn prefilled_slots_are_filled_in_place() {
        let (producer, mut c) = ring::<4>();
        let mut p = producer.prefilled(7);
        assert_eq!((p.used(), c.pop()), (0, None));
        for round in 0..10 {
            let mut slot = p.slot().expect("room");
            assert_eq!(*slot, if round < 4 { 7 } else { round - 4 });
            *slot = round;
            slot.publish();
            assert_eq!(c.pop(), Some(round));
        }
        for _ in 0..3 {
            p.slot().expect("room").publish();
        }
        assert!(p.slot().is_none() && p.producer().push(1) == Err(1));
        // Slots that are full, or from which a value has been taken, stay as they are.
        let mut p = p.0.prefilled(9);
        assert_eq!((c.pop(), c.pop(), c.pop()), (Some(6), Some(7), Some(8)));
        assert_eq!(p.slot().map(|slot| *slot), Some(9));
    }

    #[test]
    fn splits_once() {
        let ring: &'static Ring<u8, 4> = Box::leak(Box::new(Ring::new()));
        assert!(ring.split().is_some());
        assert!(ring.split().is_none() && ring.producer().is_none() && ring.consumer().is_none());
    }

    #[test]
    fn each_end_is_taken_once() {
        let ring: &'static Ring<u8, 4> = Box::leak(Box::new(Ring::new()));
        let (Some(mut producer), Some(mut consumer)) = (ring.producer(), ring.consumer()) else {
            panic!("neither has been taken")
        };
        assert!(ring.producer().is_none() && ring.consumer().is_none() && ring.split().is_none());
        producer.push(5).unwrap();
        assert_eq!(consumer.pop(), Some(5));
    }
}
