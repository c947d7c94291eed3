//! Non-volatile memory: a copy in RAM, and its pieces of 32 bytes in the last 64 KiB of the flash, by
//! `sequential-storage`.
//!
//! A byte that is written goes to the copy at once. Its piece of 32 bytes becomes an item of the map in the flash,
//! whole or not at all. Items of the map are written one after the other over all sectors, so the sectors wear alike.
//!
//! **While the flash is written nothing else runs from it**: for 1 ms, and every 80 items for 45 ms, in which a sector
//! is erased. So a piece waits until the motors stand still and no byte has come for [`QUIET_MS`]; until then
//! [`Memory::is_busy`] is true. The waiting piece takes more bytes meanwhile, so a record of the log makes two or three
//! items, not one for each byte. At most one piece waits: a write to another piece makes the waiting one be stored at
//! once.
//!
//! Only thread mode uses it, after start-up. RAM: 8.4 KB.

use core::cell::UnsafeCell;
use core::ops::Range;

use embassy_embedded_hal::adapter::BlockingAsync;
use embassy_futures::block_on;
use embassy_rp::flash::{Blocking, Flash};
use embassy_rp::peripherals::FLASH;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use super::{stepper, time, uart, watchdog};
use crate::store::Memory;
use crate::store::program::AREA;

/// Bytes that are kept.
const BYTES: usize = 8_192;
/// Bytes of a piece.
const PIECE: usize = 32;
/// The size of the flash, and the place of the pieces in it: `memory.x` leaves that part free.
const FLASH_BYTES: usize = 2 << 20;
const PLACE: Range<u32> = (FLASH_BYTES - (64 << 10)) as u32..FLASH_BYTES as u32;
/// If no byte has come for this time, ms, the sender waits for an answer, or is idle.
const QUIET_MS: u32 = 5;
/// Room for an item, with what the map adds to it.
const ITEM: usize = 64;

/// The driver of the flash.
type Chip = BlockingAsync<Flash<'static, FLASH, Blocking, FLASH_BYTES>>;
/// The map: pieces by their numbers.
type Map = MapStorage<u8, Chip, Cache<Uncached, Uncached, Uncached, u8>>;

struct State {
    bytes: [u8; BYTES],
    map: Option<Map>,
    /// The piece that is not in the flash yet.
    waiting: Option<u8>,
}

struct Shared(UnsafeCell<State>);

// SAFETY: only thread mode uses it: see `with`.
unsafe impl Sync for Shared {}

static STATE: Shared =
    Shared(UnsafeCell::new(State { bytes: [0xFF; BYTES], map: None, waiting: None }));

fn with<R>(act: impl FnOnce(&mut State) -> R) -> R {
    // SAFETY: thread mode, in which nothing preempts anything; `act` does not come back here.
    act(unsafe { &mut *STATE.0.get() })
}

/// Reads the bytes from the flash. Start-up.
pub(super) fn start(flash: embassy_rp::Peri<'static, FLASH>) {
    let chip = BlockingAsync::new(Flash::new_blocking(flash));
    let mut map = Map::new(chip, const { MapConfig::new(PLACE) }, Cache::new_uncached());
    with(|state| {
        read(&mut map, &mut state.bytes);
        state.map = Some(map);
    });
}

/// Copies all pieces to their places. Of several versions of a piece the last one is valid. A piece that cannot be read
/// stays as if erased.
fn read(map: &mut Map, bytes: &mut [u8; BYTES]) {
    let mut room = [0; ITEM];
    block_on(async {
        let Ok(mut items) = map.fetch_all_items(&mut room).await else { return };
        let mut room = [0; ITEM];
        while let Ok(Some((number, piece))) = items.next::<[u8; PIECE]>(&mut room).await {
            let at = usize::from(number) * PIECE;
            if let Some(place) = bytes.get_mut(at..at + PIECE) {
                place.copy_from_slice(&piece);
            }
        }
    });
}

impl State {
    /// Writes the piece that waits to the flash.
    fn put_away(&mut self) {
        let (Some(number), Some(map)) = (self.waiting.take(), self.map.as_mut()) else { return };
        let at = usize::from(number) * PIECE;
        let Some(piece) = self.bytes.get(at..at + PIECE) else { return };
        // Erasing takes as long as the flash needs, at worst longer than the watchdog waits.
        watchdog::off();
        let mut room = [0; ITEM];
        let mut store = || block_on(map.store_item(&mut room, &number, &piece)).is_ok();
        // If the map in the flash is corrupt, all of it is erased, and all pieces are written again.
        if !store() {
            let _ = block_on(map.erase_all());
            for (number, piece) in (0..).zip(self.bytes.chunks_exact(PIECE)) {
                if piece.iter().any(|byte| *byte != 0xFF) {
                    let _ = block_on(map.store_item(&mut room, &number, &piece));
                }
            }
        }
        watchdog::start();
    }
}

/// Returns the number of the piece that contains an address.
fn number(at: u16) -> u8 {
    (usize::from(at) / PIECE) as u8
}

/// Writes the piece that waits, if that disturbs nothing now. Returns whether no piece waits any more.
fn is_kept() -> bool {
    with(|state| {
        let quiet = time::millis().wrapping_sub(uart::heard_at()) >= QUIET_MS;
        if state.waiting.is_some() && quiet && !stepper::running() {
            state.put_away();
        }
        state.waiting.is_none()
    })
}

/// Access to the memory.
pub struct Eeprom(());

impl Eeprom {
    /// Returns access from thread mode. At most one task may write each part.
    pub fn take() -> Self {
        Self(())
    }
}

impl Memory for Eeprom {
    const SIZE: u16 = BYTES as u16;
    const LOG: u16 = Self::SIZE - AREA;

    fn read(&self, at: u16) -> u8 {
        with(|state| state.bytes.get(usize::from(at)).copied().unwrap_or(0xFF))
    }

    fn is_busy(&self) -> bool {
        !is_kept()
    }

    fn takes(&self, at: u16) -> bool {
        with(|state| state.waiting == Some(number(at))) || is_kept()
    }

    fn write(&mut self, at: u16, byte: u8) {
        let number = number(at);
        with(|state| {
            if state.waiting.is_some_and(|waiting| waiting != number) {
                state.put_away();
            }
            if let Some(place) = state.bytes.get_mut(usize::from(at)) {
                *place = byte;
                state.waiting = Some(number);
            }
        });
    }
}

/// Writes the waiting piece when that is possible. Thread mode, each millisecond.
pub(super) fn look() {
    is_kept();
}
