//! Bytes that are kept in a flash: a copy in RAM, and its pieces of 32 bytes as items of a map (`sequential-storage`).
//!
//! Whenever power fails, each piece is its old one or its new one, and pieces change in the order in which they were
//! stored. An item is valid or not by its checksum, and sectors are erased as a whole ([`whole`]). The tests cut power at
//! every byte that is written and at every word that is erased.
//!
//! Plain Rust over any flash, so the tests run on the host.

mod whole;

use core::ops::Range;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{MultiwriteNorFlash, NorFlash, ReadNorFlash};
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use whole::Whole;

/// Bytes that are kept.
pub const BYTES: usize = 8_192;
/// Bytes of a piece.
pub const PIECE: usize = 32;
/// Room for any item that could be found in a sector, which others may have written.
const ROOM: usize = 4_096;

/// The map: pieces by their numbers.
type Map<F> = MapStorage<u8, Whole<F>, Cache<Uncached, Uncached, Uncached, u8>>;

/// The bytes. 8.4 KB of RAM; another 4 KB of stack while the flash is read or written.
pub struct Pieces<F: MultiwriteNorFlash> {
    bytes: [u8; BYTES],
    /// `None` before the start, and if the flash cannot be used.
    map: Option<Map<F>>,
    /// The piece that is not in the flash yet.
    waiting: Option<u8>,
    /// Some pieces could not be read.
    lost: bool,
    /// The pieces in the flash have been compared with those in RAM since a sector was erased.
    sure: bool,
}

/// Returns the number of the piece that contains an address.
pub fn number(at: u16) -> u8 {
    (usize::from(at) / PIECE) as u8
}

impl<F: MultiwriteNorFlash> Pieces<F> {
    /// Returns erased bytes, without a flash.
    pub const fn new() -> Self {
        Self { bytes: [0xFF; BYTES], map: None, waiting: None, lost: false, sure: false }
    }

    /// Reads the bytes. They are in the sectors of `place`; the sector before it is for notes. Takes 0.1 s; up to
    /// some seconds if the map is damaged.
    pub fn start(&mut self, flash: F, place: Range<u32>) {
        let base = place.start.saturating_sub(F::ERASE_SIZE as u32);
        let (Ok(config), mut flash) = (MapConfig::try_new(place.clone()), Whole::new(flash, base))
        else {
            self.lost = true;
            return;
        };
        self.lost = block_on(flash.finish()).unwrap_or(true);
        self.lost |= block_on(erase_cut_short(&mut flash, &place)).is_err();
        let map = self.map.insert(Map::new(flash, config, Cache::new_uncached()));
        if !read(map, &mut self.bytes) && !read_each(map, &mut self.bytes) {
            self.lost = true;
        }
    }

    /// Whether some pieces could not be read at the start. Their bytes are as if erased, or older ones.
    pub fn is_lost(&self) -> bool {
        self.lost
    }

    /// Returns the byte at an address.
    pub fn read(&self, at: u16) -> u8 {
        self.bytes.get(usize::from(at)).copied().unwrap_or(0xFF)
    }

    /// Writes a byte. Its piece waits then. No other piece may wait.
    pub fn write(&mut self, at: u16, byte: u8) {
        if let Some(place) = self.bytes.get_mut(usize::from(at)) {
            *place = byte;
            self.waiting = Some(number(at));
        }
    }

    /// Returns the number of the piece that waits.
    pub fn waiting(&self) -> Option<u8> {
        self.waiting
    }

    /// Writes the piece that waits to the flash. 1 ms, and every 80 pieces 45 ms, in which a sector is erased. Behind
    /// the first erasing since the start all pieces are read again, because it may be that of a repair: 0.1 s.
    pub fn put_away(&mut self) {
        let (Some(number), Some(map)) = (self.waiting.take(), self.map.as_mut()) else { return };
        let mut is_stored = store(map, &self.bytes, number);
        if is_stored && !self.sure && map.flash().has_erased() {
            self.sure = true;
            is_stored = settle(map, &self.bytes);
        }
        if !is_stored {
            write_anew(map, &self.bytes);
        }
    }
}

/// Erases a sector whose erasing was cut short by firmware that wrote no notes. The map fills one sector at a time, and
/// then erases the next one. So if two in a row look as if they were being filled, the second one is to be erased: its
/// items are old ones, but could be taken for the newest.
async fn erase_cut_short<F: MultiwriteNorFlash>(
    flash: &mut Whole<F>,
    place: &Range<u32>,
) -> Result<(), F::Error> {
    let size = F::ERASE_SIZE as u32;
    let mut was_filled = is_being_filled(flash, place.end - size).await?;
    for sector in place.clone().step_by(F::ERASE_SIZE) {
        let is_filled = is_being_filled(flash, sector).await?;
        if was_filled && is_filled {
            flash.erase(sector, sector + size).await?;
        }
        was_filled = is_filled;
    }
    Ok(())
}

/// Whether the first byte of a sector has been written and the last one has not. The map writes 0 to both.
async fn is_being_filled<F: MultiwriteNorFlash>(
    flash: &mut Whole<F>,
    sector: u32,
) -> Result<bool, F::Error> {
    let mut ends = [[0], [0]];
    for (at, end) in [sector, sector + F::ERASE_SIZE as u32 - 1].into_iter().zip(&mut ends) {
        flash.read(at, end).await?;
    }
    Ok(ends.map(|[byte]| byte.count_zeros() >= 4) == [true, false])
}

/// Returns a piece of the bytes.
fn piece(bytes: &[u8; BYTES], number: u8) -> [u8; PIECE] {
    let (pieces, _) = bytes.as_chunks();
    pieces.get(usize::from(number)).copied().unwrap_or([0xFF; PIECE])
}

/// Calls `each` for every item of the map, from the oldest one on: of several versions of a piece the last one counts.
/// Returns false if the map is damaged.
fn for_each<F: MultiwriteNorFlash>(
    map: &mut Map<F>,
    mut each: impl FnMut(u8, &[u8; PIECE]),
) -> bool {
    let mut room = [0; ROOM];
    block_on(async {
        let Ok(mut items) = map.fetch_all_items(&mut room).await else { return false };
        loop {
            match items.next::<[u8; PIECE]>(&mut room).await {
                Ok(Some((number, piece))) => each(number, &piece),
                Ok(None) => return true,
                Err(_) => return false,
            }
        }
    })
}

/// Copies all pieces to their places. Returns false if the map is damaged.
fn read<F: MultiwriteNorFlash>(map: &mut Map<F>, bytes: &mut [u8; BYTES]) -> bool {
    for_each(map, |number, piece| put(bytes, number, piece))
}

fn put(bytes: &mut [u8; BYTES], number: u8, piece: &[u8; PIECE]) {
    let (places, _) = bytes.as_chunks_mut();
    if let Some(place) = places.get_mut(usize::from(number)) {
        *place = *piece;
    }
}

/// Copies the pieces to their places one by one; the map repairs itself for each of them. Returns false if one cannot
/// be read.
fn read_each<F: MultiwriteNorFlash>(map: &mut Map<F>, bytes: &mut [u8; BYTES]) -> bool {
    let mut room = [0; ROOM];
    let mut is_whole = true;
    for number in 0..=u8::MAX {
        match block_on(map.fetch_item::<[u8; PIECE]>(&mut room, &number)) {
            Ok(Some(piece)) => put(bytes, number, &piece),
            Ok(None) => {}
            Err(_) => is_whole = false,
        }
    }
    is_whole
}

/// Stores a piece. Returns whether that succeeded.
fn store<F: MultiwriteNorFlash>(map: &mut Map<F>, bytes: &[u8; BYTES], number: u8) -> bool {
    let mut room = [0; PIECE * 2];
    block_on(map.store_item(&mut room, &number, &piece(bytes, number))).is_ok()
}

/// Stores all pieces that the map does not have as they are in RAM: it may have lost some in a repair. Returns whether
/// the map has all of them.
fn settle<F: MultiwriteNorFlash>(map: &mut Map<F>, bytes: &[u8; BYTES]) -> bool {
    let mut kept = [false; BYTES / PIECE];
    for (number, kept) in (0..=u8::MAX).zip(&mut kept) {
        *kept = piece(bytes, number) == [0xFF; PIECE];
    }
    let is_read = for_each(map, |number, found| {
        if let Some(kept) = kept.get_mut(usize::from(number)) {
            *kept = piece(bytes, number) == *found;
        }
    });
    let mut missing = (0..=u8::MAX).zip(&kept).filter(|(_, kept)| !**kept);
    is_read && missing.all(|(number, _)| store(map, bytes, number))
}

/// Erases the map and stores all pieces. Only if nothing can be stored otherwise.
fn write_anew<F: MultiwriteNorFlash>(map: &mut Map<F>, bytes: &[u8; BYTES]) {
    let Ok(note) = block_on(map.flash().begin_anew()) else { return };
    let _ = block_on(map.erase_all());
    for number in 0..=u8::MAX {
        if piece(bytes, number) != [0xFF; PIECE] {
            store(map, bytes, number);
        }
    }
    let _ = block_on(map.flash().end(note));
}

#[cfg(test)]
mod tests;
