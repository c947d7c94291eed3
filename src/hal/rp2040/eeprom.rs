//! Memory that keeps its bytes: a copy in RAM, and in the last 64 KiB of the flash the same in pieces, by `sequential-storage`.
//!
//! A byte that is written goes to the copy at once; its piece of 32 bytes becomes an item of the map in the flash, whole or not at all. Items of the
//! map are written one behind the other over all sectors, which wear alike.
//!
//! **While the flash is written nothing else runs from it**: for 1 ms, and each 80 items for 45 ms, in which a sector is erased. So a piece waits
//! until the motors rest and no byte has come for [`QUIET_MS`]; [`Memory::is_busy`] says so until then. Meanwhile it takes more bytes, so that a record of
//! the log is two or three items, not one for each byte. One piece waits at most: who writes to another one before its turn has it written at once.
//!
//! Thread mode alone uses it, after start-up. RAM: 8.4 KB.

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
/// Of the flash, and where pieces are in it: `memory.x` leaves that part free.
const FLASH_BYTES: usize = 2 << 20;
const PLACE: Range<u32> = (FLASH_BYTES - (64 << 10)) as u32..FLASH_BYTES as u32;
/// Without a byte for so long a sender waits for an answer, or has nothing to say.
const QUIET_MS: u32 = 5;
/// Room for an item with what the map puts beside it.
const ITEM: usize = 64;

/// The driver of the flash.
type Chip = BlockingAsync<Flash<'static, FLASH, Blocking, FLASH_BYTES>>;
/// The map: pieces by their numbers.
type Map = MapStorage<u8, Chip, Cache<Uncached, Uncached, Uncached, u8>>;

struct State {
    bytes: [u8; BYTES],
    map: Option<Map>,
    /// The piece that the flash has not got yet.
    waiting: Option<u8>,
}

struct Shared(UnsafeCell<State>);

// SAFETY: thread mode alone uses it: see `with`.
unsafe impl Sync for Shared {}

static STATE: Shared =
    Shared(UnsafeCell::new(State { bytes: [0xFF; BYTES], map: None, waiting: None }));

fn with<R>(act: impl FnOnce(&mut State) -> R) -> R {
    // SAFETY: thread mode, in which nothing preempts anything; `act` does not come back here.
    act(unsafe { &mut *STATE.0.get() })
}

/// Reads what has been kept. Start-up.
pub(super) fn start(flash: embassy_rp::Peri<'static, FLASH>) {
    let chip = BlockingAsync::new(Flash::new_blocking(flash));
    let mut map = Map::new(chip, const { MapConfig::new(PLACE) }, Cache::new_uncached());
    with(|state| {
        read(&mut map, &mut state.bytes);
        state.map = Some(map);
    });
}

/// Puts all pieces where they belong; of a piece that is there several times the last one counts. What cannot be read is as erased.
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
    /// Writes the piece that waits.
    fn put_away(&mut self) {
        let (Some(number), Some(map)) = (self.waiting.take(), self.map.as_mut()) else { return };
        let at = usize::from(number) * PIECE;
        let Some(piece) = self.bytes.get(at..at + PIECE) else { return };
        // Erasing takes as long as the flash pleases, at worst longer than the watchdog waits.
        watchdog::off();
        let mut room = [0; ITEM];
        let mut store = || block_on(map.store_item(&mut room, &number, &piece)).is_ok();
        // A part of the flash that makes no sense is begun anew: all pieces follow, a turn each.
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

/// The number of the piece that has an address.
fn number(at: u16) -> u8 {
    (usize::from(at) / PIECE) as u8
}

/// Writes the piece that waits, if nothing is disturbed by it. Whether none waits any more.
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
    /// Access from thread mode. One task at most is to write each part.
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

/// A turn of the main loop, each millisecond.
pub(super) fn look() {
    is_kept();
}
