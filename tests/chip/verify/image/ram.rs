//! Tests RAM, and finds out how much of it a program has never used.
//!
//! [`test`] tries each byte from 0x200 up to the stack in use. The last 160 bytes below 0x2200 are not tested: the
//! stack is there, and [`MARGIN`]. Initialised statics are tried one at a time with four patterns, and keep their
//! values. All others go through a march test: up, down, and with a pattern that depends on the address and its
//! complement. So bits that stay, lines of the address that do nothing, and most bytes that change with another byte are
//! found. Not tested: how long RAM keeps a value, and patterns of whole neighbourhoods. Nothing is left of what was there.

use super::register::Register;

/// The first byte of RAM, and the first behind it.
const START: u16 = 0x200;
const END: u16 = 0x2200;
/// Bytes below the stack pointer that are left alone, for calls from here. There should be none.
const MARGIN: u16 = 16;
/// The byte of [`paint`].
const PAINT: u8 = 0xC5;

const SPL: Register = Register::at(0x5D);
const SPH: Register = Register::at(0x5E);

unsafe extern "C" {
    /// Marks the end of the statics that have an initial value.
    static __data_end: u8;
}

/// A byte of RAM.
#[derive(Clone, Copy)]
struct Byte(u16);

impl Byte {
    #[inline(always)]
    fn get(self) -> u8 {
        // SAFETY: every byte of RAM may be read; the read is volatile, so the compiler assumes nothing about it.
        unsafe { (usize::from(self.0) as *const u8).read_volatile() }
    }

    #[inline(always)]
    fn put(self, value: u8) {
        // SAFETY: `statics` and `free` are the only sources of bytes to write. The first are put back before anything
        // else runs; the second lie below the stack, where no variable of this image is.
        unsafe { (usize::from(self.0) as *mut u8).write_volatile(value) }
    }

    /// Whether it holds a value.
    #[inline(always)]
    fn holds(self, value: u8) -> bool {
        self.put(value);
        self.get() == value
    }

    /// Whether it holds four values; it keeps its own.
    #[inline(always)]
    fn is_sound(self) -> bool {
        let own = self.get();
        let sound = self.holds(0x00) & self.holds(0xFF) & self.holds(0x55) & self.holds(0xAA);
        self.put(own);
        sound & (self.get() == own)
    }

    /// A value that differs from that of any byte of which the address differs in one bit.
    #[inline(always)]
    fn mark(self) -> u8 {
        let [low, high] = self.0.to_le_bytes();
        low ^ high.wrapping_mul(0x1D)
    }
}

/// The addresses of statics with an initial value: constants of this image are among them.
#[inline(always)]
fn statics() -> core::ops::Range<u16> {
    START..(&raw const __data_end) as usize as u16
}

/// The addresses behind the initialised statics and below the stack.
#[inline(always)]
fn free() -> core::ops::Range<u16> {
    statics().end..u16::from_le_bytes([SPL.get(), SPH.get()]) - MARGIN
}

/// What [`test`] has found.
pub struct Found {
    /// Number of bytes tried.
    pub tested: u32,
    /// Number of bad bytes: exact for bits that stay. Of bytes that change with other bytes it is the number that one
    /// pass of the test has found, at least one.
    pub bad: u32,
    /// The lowest address of a bad byte, 0 if there is none.
    pub first: u32,
}

/// The lowest bad address, and the most that one pass has found.
struct Tally {
    first: u16,
    most: u16,
    pass: u16,
}

impl Tally {
    #[inline(always)]
    fn note(&mut self, address: u16, sound: bool) {
        if !sound {
            self.pass += 1;
            self.first = self.first.min(address);
        }
    }

    #[inline(always)]
    fn end_pass(&mut self) {
        self.most = self.most.max(self.pass);
        self.pass = 0;
    }
}

/// Tests RAM. It takes 110 ms.
#[inline(never)]
pub fn test() -> Found {
    let (statics, free) = (statics(), free());
    let mut tally = Tally { first: u16::MAX, most: 0, pass: 0 };
    for address in statics.clone() {
        tally.note(address, Byte(address).is_sound());
    }
    let (bad_statics, tested) = (tally.pass, free.end - START);
    tally.pass = 0;
    march(&free, &mut tally);
    let bad = bad_statics + tally.most;
    let first = if bad == 0 { 0 } else { tally.first };
    Found { tested: tested.into(), bad: bad.into(), first: first.into() }
}

/// Each loop is a pass: it expects what the one before has left.
#[inline(always)]
fn march(free: &core::ops::Range<u16>, tally: &mut Tally) {
    for address in free.clone() {
        Byte(address).put(0x00);
    }
    for address in free.clone() {
        let byte = Byte(address);
        let was = byte.get() == 0x00;
        tally.note(address, was & byte.holds(0xFF) & byte.holds(0x55) & byte.holds(0xAA));
    }
    tally.end_pass();
    for address in free.clone().rev() {
        let byte = Byte(address);
        let was = byte.get() == 0xAA;
        tally.note(address, was & byte.holds(0x55) & byte.holds(0x00) & byte.holds(0xFF));
    }
    tally.end_pass();
    for flip in [false, true] {
        let mark = |byte: Byte| if flip { !byte.mark() } else { byte.mark() };
        for address in free.clone() {
            Byte(address).put(mark(Byte(address)));
        }
        for address in free.clone() {
            tally.note(address, Byte(address).get() == mark(Byte(address)));
        }
        tally.end_pass();
    }
}

/// Paints the free RAM. Returns the number of bytes.
#[inline(never)]
pub fn paint() -> u32 {
    let free = free();
    for address in free.clone() {
        Byte(address).put(PAINT);
    }
    (free.end - free.start).into()
}

/// Returns the number of bytes from an address on that still hold the paint, without a gap. `None` if the address is
/// not in RAM.
pub fn painted(from: u32) -> Option<u32> {
    let from = u16::try_from(from).ok().filter(|from| (START..END).contains(from))?;
    let end = (from..END).find(|address| Byte(*address).get() != PAINT).unwrap_or(END);
    Some((end - from).into())
}
