//! The bytes that wait in a ring, to be looked at and changed where they lie.

use core::marker::PhantomData;

use super::{ConsumerView, Ring};

/// The bytes that wait in a ring, for code that is shared by rings of all sizes.
pub struct Window<'a> {
    slots: *mut u8,
    /// The highest index: one less than a power of two.
    last: u8,
    tail: u8,
    len: u8,
    /// Borrows the consumer: nobody takes bytes while the window exists.
    consumer: PhantomData<&'a mut ()>,
}

impl<const N: usize> Ring<u8, N> {
    /// Returns a window on the bytes that wait now.
    ///
    /// # Safety
    /// The caller is the consumer, or the consumer does not run meanwhile.
    pub unsafe fn window(&self) -> Window<'_> {
        const { assert!(N.is_power_of_two()) };
        Window {
            slots: self.slots.get().cast(),
            last: (N - 1) as u8,
            tail: self.tail.get() as u8,
            len: self.used() as u8,
            consumer: PhantomData,
        }
    }
}

impl ConsumerView<u8> {
    /// Returns a window on the bytes that wait now.
    pub fn window(&mut self) -> Window<'_> {
        Window {
            slots: self.slot(0),
            last: self.last as u8,
            tail: self.taken(),
            len: self.len() as u8,
            consumer: PhantomData,
        }
    }
}

impl Window<'_> {
    /// Returns the number of bytes that wait.
    pub fn len(&self) -> u8 {
        self.len
    }

    /// Whether no byte waits.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether the ring has no room for another byte.
    pub fn is_full(&self) -> bool {
        self.len == self.last
    }

    /// The slot of the byte `ahead` places behind the oldest.
    pub fn slot(&self, ahead: u8) -> u8 {
        self.tail.wrapping_add(ahead).wrapping_add(1) & self.last
    }

    /// Returns the byte `ahead` places behind the oldest, 0 if none waits there.
    pub fn get(&self, ahead: u8) -> u8 {
        if ahead >= self.len {
            return 0;
        }
        // SAFETY: the byte waits, so its slot has been filled, and `slot` is within the ring. The producer may change
        // the newest byte, in one instruction.
        unsafe { self.slots.add(self.slot(ahead).into()).read_volatile() }
    }

    /// Returns the first place from `ahead` on whose byte is below a blank, or the place behind the newest byte.
    /// Cost: 11 cycles a byte.
    #[inline(never)]
    pub fn behind_text(&self, ahead: u8) -> u8 {
        let mut at = ahead;
        let mut slot = self.slot(at);
        while at < self.len {
            // SAFETY: as in `get`.
            let byte = unsafe { self.slots.add(slot.into()).read_volatile() };
            if byte < b' ' {
                break;
            }
            slot = slot.wrapping_add(1) & self.last;
            at += 1;
        }
        at
    }

    /// Removes `count` bytes from place `at` on. The bytes before them move up, and the consumer has to release
    /// `count` bytes. The newest byte of a full ring stays. Cost: 20 cycles for each byte before them.
    #[inline(never)]
    #[cfg_attr(target_arch = "avr", optimize(size))]
    pub fn take_out(&mut self, at: u8, count: u8) {
        let most = self.len.saturating_sub(at).saturating_sub(self.is_full().into());
        let count = count.min(most);
        for n in (0..at.min(self.len)).rev() {
            let byte = self.get(n);
            // SAFETY: the slot holds a byte that waits. It is not the newest of a full ring, the only one that the
            // producer changes.
            unsafe { self.slots.add(self.slot(n + count).into()).write_volatile(byte) };
        }
        self.tail = self.tail.wrapping_add(count) & self.last;
        self.len -= count;
    }

    /// Replaces the byte at `ahead` if it is still `from`: the producer may have changed the newest one. Returns
    /// whether it was replaced. Masks interrupts for some cycles.
    #[inline(never)]
    #[cfg_attr(target_arch = "avr", optimize(size))]
    pub fn replace(&mut self, ahead: u8, from: u8, to: u8) -> bool {
        if ahead >= self.len {
            return false;
        }
        crate::mask(|| {
            // SAFETY: as in `get`; the producer does not run meanwhile, and nobody else has a reference.
            unsafe {
                let slot = self.slots.add(self.slot(ahead).into());
                let same = slot.read_volatile() == from;
                if same {
                    slot.write_volatile(to);
                }
                same
            }
        })
    }
}
