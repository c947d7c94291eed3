//! The message of a panic, kept in RAM for after the reset.
//!
//! RAM keeps its bytes over a reset by the button or the watchdog, but not without power. A mark and a checksum tell
//! a message from what RAM contains at power-up. [`take`] returns the message once, as a line of JSON.

use crate::hal::Exclusive;
use core::cell::UnsafeCell;
use core::fmt::{Display, Write};
use core::mem::MaybeUninit;

use heapless::String;

/// Longest message, in bytes; the rest of a longer one is cut off.
const MOST: usize = 120;
/// Bytes of the JSON line with the message.
pub(super) const LINE: usize = MOST + 24;
const MARK: u32 = 0x4B5E_FA11;

/// What is kept in RAM.
#[repr(C)]
#[derive(Clone, Copy)]
struct Words {
    mark: u32,
    sum: u32,
    len: u32,
    bytes: [u8; MOST],
}

struct Place(UnsafeCell<MaybeUninit<Words>>);

// SAFETY: only the panic handler, after which nothing runs, and start-up touch it.
unsafe impl Sync for Place {}

/// The start-up code does not clear this section.
#[unsafe(link_section = ".uninit.last_words")]
static PLACE: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

/// Collects a text, as far as it fits. Characters that JSON would have to escape become blanks.
struct Cut(String<MOST>);

impl Write for Cut {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        for letter in text.chars() {
            let plain = matches!(letter, ' '..='~') && !matches!(letter, '"' | '\\');
            // Characters that find no room are cut off.
            let _ = self.0.push(if plain { letter } else { ' ' });
        }
        Ok(())
    }
}

fn sum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(MARK, |sum, byte| sum.rotate_left(5) ^ u32::from(*byte))
}

/// Keeps a message in RAM. Nothing goes on after this.
pub(super) fn leave(_: Exclusive<'_>, message: &dyn Display) {
    let mut cut = Cut(String::new());
    let _ = write!(cut, "{message}");
    let mut words = Words { mark: MARK, sum: 0, len: cut.0.len() as u32, bytes: [0; MOST] };
    words.bytes.iter_mut().zip(cut.0.bytes()).for_each(|(to, byte)| *to = byte);
    words.sum = sum(&words.bytes);
    // SAFETY: see `Place`.
    unsafe { PLACE.0.get().cast::<Words>().write_volatile(words) };
}

/// Takes the line with the message that was left; `None` if there is none. USB's task calls it, once.
pub(super) fn take() -> Option<String<LINE>> {
    let place = PLACE.0.get().cast::<Words>();
    // SAFETY: see `Place`; any bytes form a valid `Words`.
    let words = unsafe { place.read_volatile() };
    // SAFETY: as above.
    unsafe { (&raw mut (*place).mark).write_volatile(0) };
    let bytes = words.bytes.get(..words.len as usize)?;
    if words.mark != MARK || words.sum != sum(&words.bytes) {
        return None;
    }
    let mut line = String::new();
    write!(line, "{{\"er\":{{\"panic\":\"{}\"}}}}\n", core::str::from_utf8(bytes).ok()?).ok()?;
    Some(line)
}
