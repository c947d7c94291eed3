//! Non-volatile memory: [`pieces`](super::pieces) in the last 64 KiB of the flash, and when they are written.
//!
//! A byte that is written goes to the copy in RAM at once. Its piece of 32 bytes becomes an item of the map in the
//! flash, whole or not at all. Items of the map are written one after the other over all sectors, so the sectors wear
//! alike.
//!
//! **While the flash is written nothing else runs from it**: for 1 ms, and every 80 items for 45 ms, in which a sector
//! is erased; by the data sheet of the flash 400 ms at worst. Heaters are off meanwhile. So a piece waits until the
//! motors stand still and no byte has come for [`QUIET_MS`]; until then [`Memory::is_busy`] is true. The waiting piece
//! takes more bytes meanwhile, so a record of the log makes two or three items, not one for each byte. At most one
//! piece waits: a write to another piece makes the waiting one be stored at once.
//!
//! Only thread mode uses it, after start-up. RAM: 8.4 KB.

use core::cell::UnsafeCell;
use core::ops::Range;

use embassy_embedded_hal::adapter::BlockingAsync;
use embassy_rp::flash::{Blocking, Flash};
use embassy_rp::peripherals::FLASH;

use super::pieces::{BYTES, Pieces, number};
use super::{heaters, stepper, time, uart, watchdog};
use crate::hal::{Boot, Thread};
use crate::store::Memory;
use crate::store::program::AREA;

/// The size of the flash, and the place of the pieces in it. `memory.x` leaves that part free, and the sector before
/// it.
const FLASH_BYTES: usize = 2 << 20;
const PLACE: Range<u32> = (FLASH_BYTES - (64 << 10)) as u32..FLASH_BYTES as u32;
/// If no byte has come for this time, ms, the sender waits for an answer, or is idle.
const QUIET_MS: u32 = 5;

/// The driver of the flash.
type Chip = BlockingAsync<Flash<'static, FLASH, Blocking, FLASH_BYTES>>;

struct Shared(UnsafeCell<Pieces<Chip>>);

// SAFETY: `with` takes a `Thread`, which no other level has.
unsafe impl Sync for Shared {}

static PIECES: Shared = Shared(UnsafeCell::new(Pieces::new()));

fn with<R>(_: Thread, act: impl FnOnce(&mut Pieces<Chip>) -> R) -> R {
    // SAFETY: `Thread` shows thread mode, in which nothing preempts anything; `act` does not come back here.
    act(unsafe { &mut *PIECES.0.get() })
}

/// Reads the bytes from the flash. The first call.
pub(super) fn start(_: &Boot, flash: embassy_rp::Peri<'static, FLASH>) {
    let chip = BlockingAsync::new(Flash::new_blocking(flash));
    // SAFETY: nothing runs yet, as `Boot` shows.
    let thread = unsafe { Thread::assume() };
    with(thread, |pieces| pieces.start(chip, PLACE));
}

/// Writes the piece that waits to the flash.
fn put_away(thread: Thread, pieces: &mut Pieces<Chip>) {
    // Erasing takes as long as the flash needs, at worst 400 ms, or for ever if the flash is broken: nobody looks after
    // the heaters meanwhile, nor can the watchdog.
    heaters::pause(thread);
    watchdog::off();
    pieces.put_away();
    watchdog::start();
}

/// Writes the piece that waits, if that disturbs nothing now. Returns whether no piece waits any more.
fn is_kept(thread: Thread) -> bool {
    with(thread, |pieces| {
        let quiet = time::millis().wrapping_sub(uart::heard_at()) >= QUIET_MS;
        if pieces.waiting().is_some() && quiet && !stepper::running() {
            put_away(thread, pieces);
        }
        pieces.waiting().is_none()
    })
}

/// Access to the memory.
pub struct Eeprom(Thread);

impl Eeprom {
    /// Returns access. At most one task may write each part.
    pub fn of(thread: Thread) -> Self {
        Self(thread)
    }
}

impl Memory for Eeprom {
    const SIZE: u16 = BYTES as u16;
    const LOG: u16 = Self::SIZE - AREA;

    fn read(&self, at: u16) -> u8 {
        with(self.0, |pieces| pieces.read(at))
    }

    fn is_lost(&self) -> bool {
        with(self.0, |pieces| pieces.is_lost())
    }

    fn is_busy(&self) -> bool {
        !is_kept(self.0)
    }

    fn takes(&self, at: u16) -> bool {
        with(self.0, |pieces| pieces.waiting() == Some(number(at))) || is_kept(self.0)
    }

    fn write(&mut self, at: u16, byte: u8) {
        let thread = self.0;
        with(thread, |pieces| {
            if pieces.waiting().is_some_and(|waiting| waiting != number(at)) {
                put_away(thread, pieces);
            }
            pieces.write(at, byte);
        });
    }
}

/// Writes the waiting piece when that is possible. Called each millisecond.
pub(super) fn look(thread: Thread) {
    is_kept(thread);
}
