//! A flash whose sectors are erased as a whole, also if power fails meanwhile.
//!
//! A sector whose erasing was cut short may hold anything: old bytes, erased ones, a mix of both. The map of
//! `sequential-storage` knows such a sector only if its first byte is erased and its last one is not. It takes any
//! other for a good sector, and its repair then loses values.
//!
//! So each erasing is noted first, in a sector of its own. The note is overwritten with zeros when the sector is
//! erased. A note that is found at the start means that its sector is to be erased again.

use embedded_storage_async::nor_flash::{ErrorType, MultiwriteNorFlash, NorFlash, ReadNorFlash};

/// Bytes of a note: a number, its complement, and [`MARK`]. A write that was cut short makes no valid note, because it
/// leaves bits of the number or of its complement set. Neither does an erasing of the notes, which are all zeros then.
const NOTE: usize = 8;
const MARK: [u8; NOTE - 2] = *b"ERASE:";
const BLANK: [u8; NOTE] = [0xFF; NOTE];
const DONE: [u8; NOTE] = [0; NOTE];

/// The number of the note that all is being written anew. The other numbers are those of sectors.
const ALL: u8 = 0xFF;

/// The flash. The sectors behind that of the notes are erased as a whole.
pub struct Whole<F> {
    flash: F,
    /// The address of the notes.
    base: u32,
    has_erased: bool,
}

/// Returns the note with this number.
fn note(number: u8) -> [u8; NOTE] {
    let [a, b, c, d, e, f] = MARK;
    [number, !number, a, b, c, d, e, f]
}

impl<F: MultiwriteNorFlash> Whole<F> {
    /// Returns the flash with its notes at `base`.
    pub const fn new(flash: F, base: u32) -> Self {
        Self { flash, base, has_erased: false }
    }

    /// Erases what was to be erased when power failed. Call it before the flash is used. Returns whether all was
    /// being written anew: then some of it may be missing.
    pub async fn finish(&mut self) -> Result<bool, F::Error> {
        let (mut is_anew, mut is_damaged) = (false, false);
        for at in self.places() {
            match self.read_note(at).await? {
                BLANK | DONE => continue,
                found if found == note(found[0]) && found[0] == ALL => is_anew = true,
                found if found == note(found[0]) => self.erase_sector(found[0]).await?,
                _ => is_damaged = true,
            }
            self.flash.write(at, &DONE).await?;
        }
        if is_damaged {
            self.erase_notes().await?;
        }
        Ok(is_anew)
    }

    /// Returns the flash itself.
    #[cfg(test)]
    pub fn flash(&mut self) -> &mut F {
        &mut self.flash
    }

    /// Whether a sector has been erased.
    pub fn has_erased(&self) -> bool {
        self.has_erased
    }

    /// Notes that all is being written anew. Returns the place of the note, for [`Whole::end`].
    pub async fn begin_anew(&mut self) -> Result<u32, F::Error> {
        self.begin(ALL).await
    }

    /// Overwrites a note: what it says has been done.
    pub async fn end(&mut self, at: u32) -> Result<(), F::Error> {
        self.flash.write(at, &DONE).await
    }

    /// Writes a note into the first place that is blank, and returns the place.
    async fn begin(&mut self, number: u8) -> Result<u32, F::Error> {
        let mut place = None;
        for at in self.places() {
            if self.read_note(at).await? == BLANK {
                place = Some(at);
                break;
            }
        }
        let at = match place {
            Some(at) => at,
            None => {
                self.erase_notes().await?;
                self.base
            }
        };
        self.flash.write(at, &note(number)).await?;
        Ok(at)
    }

    fn places(&self) -> impl Iterator<Item = u32> + use<F> {
        (self.base..self.base + F::ERASE_SIZE as u32).step_by(NOTE)
    }

    async fn read_note(&mut self, at: u32) -> Result<[u8; NOTE], F::Error> {
        let mut bytes = [0; NOTE];
        self.flash.read(at, &mut bytes).await?;
        Ok(bytes)
    }

    async fn erase_notes(&mut self) -> Result<(), F::Error> {
        self.flash.erase(self.base, self.base + F::ERASE_SIZE as u32).await
    }

    async fn erase_sector(&mut self, number: u8) -> Result<(), F::Error> {
        self.has_erased = true;
        let from = self.base + (u32::from(number) + 1) * F::ERASE_SIZE as u32;
        self.flash.erase(from, from + F::ERASE_SIZE as u32).await
    }
}

impl<F: NorFlash> ErrorType for Whole<F> {
    type Error = F::Error;
}

impl<F: NorFlash> ReadNorFlash for Whole<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), F::Error> {
        self.flash.read(offset, bytes).await
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl<F: MultiwriteNorFlash> NorFlash for Whole<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), F::Error> {
        for sector in (from..to).step_by(F::ERASE_SIZE) {
            let number = (sector - self.base) / F::ERASE_SIZE as u32 - 1;
            let at = self.begin(number as u8).await?;
            self.erase_sector(number as u8).await?;
            self.end(at).await?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), F::Error> {
        self.flash.write(offset, bytes).await
    }
}
