//! Tables and text in program memory.
//!
//! On AVR a constant lives in RAM unless it is placed in flash and read with `lpm`. [`Progmem`] does both: the only
//! way to a value is a copy out of flash. The linker puts these sections right behind the vectors, inside the first
//! 64 KiB, where `lpm` reaches without RAMPZ, so reading is safe in interrupts too. On the host a [`Progmem`] is an
//! ordinary constant.
//!
//! Cost on AVR: about 4 cycles a byte. The chip provides the reads (`imp::flash`).

mod text;

use core::mem::MaybeUninit;

use super::imp::flash;

pub use kerf_macros::packed;
pub use text::Text;

/// A value in program memory. Make one with [`progmem!`](crate::progmem!) only.
#[repr(transparent)]
pub struct Progmem<T>(T);

impl<T: Copy> Progmem<T> {
    /// Wraps a value.
    ///
    /// # Safety
    /// On AVR the value must be a static in a `.progmem` section: reads go to program memory at its
    /// address. [`progmem!`](crate::progmem!) sees to that.
    pub const unsafe fn new(value: T) -> Self {
        Self(value)
    }

    /// Returns a copy of the value.
    pub fn get(&self) -> T {
        load(&raw const self.0)
    }
}

impl<T: Copy, const N: usize> Progmem<[T; N]> {
    /// Returns the number of elements.
    #[allow(clippy::len_without_is_empty)]
    pub const fn len(&self) -> usize {
        N
    }

    /// Returns a copy of element `index`, or `None` beyond the end.
    pub fn at(&self, index: usize) -> Option<T> {
        // The pointer arithmetic stays inside the array, and nothing is read but through `load`.
        (index < N).then(|| load((&raw const self.0).cast::<T>().wrapping_add(index)))
    }

    /// Returns the array without its length in the type.
    pub const fn slice(&self) -> Slice<T> {
        Slice { start: (&raw const self.0).cast(), len: N }
    }
}

/// An array in program memory, without its length in the type.
#[derive(Clone, Copy)]
pub struct Slice<T> {
    start: *const T,
    len: usize,
}

/// A row of a table whose field `token` is its name, padded with zeros. Made by [`named!`](crate::named!).
///
/// # Safety
/// The bytes of the name lie at `AT` in the row, `WIDTH` of them.
pub unsafe trait Named: Copy {
    /// Offset of the name in the row.
    const AT: usize;
    /// Length of the name with its padding.
    const WIDTH: usize;
}

/// Lets rows of this type be [found](crate::progmem::Slice::find) by the name in their field `token`:
/// `named! { Row, 4 }`.
#[macro_export]
macro_rules! named {
    ($row:ty, $width:literal) => {
        const _: fn($row) -> [u8; $width] = |row| row.token;
        // SAFETY: the field is where the compiler says, and the line above holds its type.
        unsafe impl $crate::progmem::Named for $row {
            const AT: usize = core::mem::offset_of!($row, token);
            const WIDTH: usize = $width;
        }
    };
}

impl<T: Named> Slice<T> {
    /// Returns the number of the row called `name`, which is padded with zeros; `None` if there is no such row. Cost
    /// on AVR: 13 cycles a row.
    pub fn find<const N: usize>(self, name: [u8; N]) -> Option<u8> {
        const { assert!(N == T::WIDTH && size_of::<T>() < 256) }
        let start = self.start.cast::<u8>().wrapping_add(T::AT);
        find(start, size_of::<T>() as u8, self.len as u8, &name)
    }
}

/// Returns the number of the first name that equals `name`, of `count` names in program memory that lie `stride`
/// bytes apart from `start` on. `None` if there is none.
#[inline(never)]
fn find(start: *const u8, stride: u8, count: u8, name: &[u8]) -> Option<u8> {
    let first = *name.first()?;
    let mut at = start;
    // Most names differ in the first byte.
    let is_name = |at: *const u8| (0..name.len()).all(|i| load(at.wrapping_add(i)) == name[i]);
    for row in 0..count {
        if load(at) == first && is_name(at) {
            return Some(row);
        }
        at = at.wrapping_add(stride.into());
    }
    None
}

impl<T: Copy> Slice<T> {
    /// Returns a copy of element `index`, or `None` beyond the end.
    pub fn at(self, index: usize) -> Option<T> {
        // The index is checked, as in an array of known length.
        (index < self.len).then(|| load(self.start.wrapping_add(index)))
    }
}

impl<const N: usize> Progmem<[u8; N]> {
    /// Returns the bytes as [`Plain`], which can be copied fast.
    pub const fn plain(&'static self) -> Plain {
        // SAFETY: whoever made it has placed it in program memory.
        unsafe { Plain::new(self) }
    }
}

/// Returns a copy of a value that is part of a [`Progmem`].
fn load<T: Copy>(from: *const T) -> T {
    // SAFETY: the callers in this module pass a pointer into a `Progmem`.
    unsafe { flash::load(from) }
}

/// Unpacked bytes in program memory. Only this type follows its pointer. They are copied five times as fast as a
/// [`Text`].
#[derive(Clone, Copy)]
pub struct Plain {
    start: *const u8,
    len: u8,
}

// SAFETY: it points at immutable statics only.
unsafe impl Sync for Plain {}

impl Plain {
    /// The table at `bytes`.
    ///
    /// # Safety
    /// On AVR, `bytes` must lie in program memory. [`plain!`](crate::plain!) sees to that.
    pub const unsafe fn new<const N: usize>(bytes: &'static Progmem<[u8; N]>) -> Self {
        assert!(N < 256, "at most 255 bytes in program memory have a name");
        Self { start: (&raw const bytes.0).cast(), len: N as u8 }
    }

    /// Whether there are no bytes.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns byte `index`, or `None` beyond the end.
    pub fn at(&self, index: u8) -> Option<u8> {
        (index < self.len).then(|| load(self.start.wrapping_add(index.into())))
    }

    /// Copies the bytes to the beginning of `to`, as far as there is room. Returns the part of `to` that is filled
    /// now. Cost on AVR: 8 cycles a byte.
    #[inline(always)]
    pub fn copy(self, to: &mut [MaybeUninit<u8>]) -> &mut [u8] {
        let count = usize::from(self.len).min(to.len()) as u8;
        let start = to.as_mut_ptr().cast();
        // SAFETY: both have at least `count` bytes. They are copied if `count` is not 0, so all bytes of the result
        // have been written.
        unsafe {
            if count > 0 {
                flash::copy(self.start, start, count);
            }
            core::slice::from_raw_parts_mut(start, count.into())
        }
    }

    /// Returns the first `count` bytes.
    #[inline(always)]
    pub fn first(self, count: u8) -> Self {
        Self { len: count.min(self.len), ..self }
    }

    /// Returns the bytes behind the first `count`.
    #[inline(always)]
    pub fn behind(self, count: u8) -> Self {
        let count = count.min(self.len);
        Self { start: self.start.wrapping_add(usize::from(count)), len: self.len - count }
    }

    /// Returns the bytes, one by one.
    pub fn bytes(self) -> impl Iterator<Item = u8> {
        let mut left = self;
        core::iter::from_fn(move || {
            let byte = left.at(0)?;
            left = left.behind(1);
            Some(byte)
        })
    }
}

/// Declares a static in program memory: `progmem! { /// Doc
/// pub static NAME: [u8; 3] = [1, 2, 3]; }`.
#[macro_export]
macro_rules! progmem {
    ($($(#[$meta:meta])* $vis:vis static $name:ident: $type:ty = $value:expr;)+) => {$(
        $(#[$meta])*
        #[cfg_attr(target_arch = "avr", unsafe(link_section = ".progmem.data"))]
        $vis static $name: $crate::progmem::Progmem<$type> = {
            const VALUE: $type = $value;
            // SAFETY: the attribute above places it in program memory.
            unsafe { $crate::progmem::Progmem::new(VALUE) }
        };
    )+};
}

/// [`Plain`] bytes from a literal: `plain!("]}")`.
#[macro_export]
macro_rules! plain {
    ($literal:literal) => {
        $crate::flash_bytes!($literal.as_bytes())
    };
}

/// [`Plain`] bytes from a constant slice. For [`plain!`](crate::plain!) and [`text!`](crate::text!).
#[doc(hidden)]
#[macro_export]
macro_rules! flash_bytes {
    ($bytes:expr) => {{
        const BYTES: &[u8] = $bytes;
        $crate::progmem! { static TEXT: [u8; BYTES.len()] = *BYTES.first_chunk().unwrap(); }
        const {
            // SAFETY: `progmem!` placed it in program memory.
            unsafe { $crate::progmem::Plain::new(&TEXT) }
        }
    }};
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    #[derive(Clone, Copy)]
    struct Row {
        number: u16,
        token: [u8; 2],
    }

    named! { Row, 2 }

    const fn row(number: u16, token: [u8; 2]) -> Row {
        Row { number, token }
    }

    progmem! {
        static TABLE: [u16; 3] = [10, 20, 30];
        static ROWS: [Row; 3] = [row(1, *b"ab"), row(2, *b"a\0"), row(3, *b"ac")];
    }

    #[test]
    fn rows_are_found_by_their_whole_names() {
        for (name, number) in
            [(*b"ab", Some(1)), (*b"a\0", Some(2)), (*b"ac", Some(3)), (*b"b\0", None)]
        {
            let found = ROWS.slice().find(name).and_then(|row| ROWS.at(row.into()));
            assert_eq!(found.map(|row| row.number), number);
        }
    }

    #[test]
    fn reads_back_what_was_placed() {
        assert_eq!(TABLE.at(1), Some(20));
        assert_eq!(TABLE.at(3), None);
        assert_eq!(TABLE.get(), [10, 20, 30]);
        let bytes = crate::plain!("SYSTEM READY");
        assert_eq!(bytes.bytes().collect::<Vec<u8>>(), b"SYSTEM READY");
        assert_eq!((bytes.at(11), bytes.at(12)), (Some(b'Y'), None));
    }
}
