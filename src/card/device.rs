//! The card as blocks of 512 bytes, by SPI (SD Physical Layer, simplified, chapter 7).
//!
//! A command waits for its answer for some bytes. A block is asked for (CMD17) and comes when the card has it, 100 ms
//! later at most: [`Device::read`] waits for that if it [is patient](set_patient), else says [`Fault::Later`] and is to
//! be asked for the same block again. The card stays selected meanwhile.

use core::cell::Cell;
use core::fmt;

use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx};

use crate::hal::byte::SharedByte;
use crate::hal::{card, time::millis};

/// What is wrong.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fault {
    /// Nothing: the block is on its way.
    Later,
    /// The card does not answer, or refuses.
    Failed,
}

impl fmt::Display for Fault {
    fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        Ok(())
    }
}

impl core::error::Error for Fault {}

/// How long a card may take for a block, and until it is ready, ms.
const BLOCK_MS: u32 = 100;
const READY_MS: u32 = 1_000;
/// How long it may write, ms.
const WRITE_MS: u32 = 250;
/// Bytes in which an answer comes, and looks for a block at once.
const ANSWER: u8 = 10;
const LOOKS: u8 = 8;
/// A block begins.
const START: u8 = 0xFE;
/// Answers.
const IDLE: u8 = 1;
const ILLEGAL: u8 = 4;
/// Tries with CMD0.
const TRIES: u8 = 10;

/// Whether a block is not waited for. Beside the card, for `embedded-sdmmc` forgets its block when it lends the card.
static HASTE: SharedByte = SharedByte::new(0);

/// Whether blocks are waited for from now on. Thread mode.
pub fn set_patient(patient: bool) {
    HASTE.set((!patient).into());
}

/// How far the card is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stage {
    /// Nothing has been said to it.
    Fresh,
    /// It has been told to get ready, at that time, ms; whether it knows high capacity.
    Wakes(u32, bool),
    /// It is ready.
    Ready,
}

/// The card.
#[derive(Debug)]
pub struct Device {
    stage: Stage,
    /// Blocks are counted, not bytes.
    is_high: bool,
    /// The block that is on its way, and since when.
    awaited: Cell<Option<(u32, u32)>>,
}

#[small]
impl Device {
    pub const fn new() -> Self {
        Self { stage: Stage::Fresh, is_high: false, awaited: Cell::new(None) }
    }

    /// A try to get the card ready. Whether it is.
    pub fn begin(&mut self) -> Result<bool, Fault> {
        let done = match self.stage {
            Stage::Fresh | Stage::Ready => self.reset(),
            Stage::Wakes(since, version_2) => self.wake(since, version_2),
        };
        if done.is_err() {
            self.stage = Stage::Fresh;
        }
        if done != Ok(true) {
            card::release();
        }
        done
    }

    fn reset(&mut self) -> Result<bool, Fault> {
        self.awaited.set(None);
        card::release();
        card::set_fast(false);
        // 74 clocks with nothing selected.
        (0..10).for_each(|_| _ = card::exchange(0xFF));
        if !(0..TRIES).any(|_| command(0, 0) == IDLE) {
            return Err(Fault::Failed);
        }
        let version_2 = command(8, 0x1AA) & ILLEGAL == 0;
        if version_2 && word() & 0xFFF != 0x1AA {
            return Err(Fault::Failed);
        }
        self.stage = Stage::Wakes(millis(), version_2);
        Ok(false)
    }

    fn wake(&mut self, since: u32, version_2: bool) -> Result<bool, Fault> {
        command(55, 0);
        match command(41, u32::from(version_2) << 30) {
            0 => {}
            IDLE if millis().wrapping_sub(since) < READY_MS => return Ok(false),
            _ => return Err(Fault::Failed),
        }
        self.is_high = version_2 && command(58, 0) == 0 && word() & 1 << 30 != 0;
        if !self.is_high && command(16, Block::LEN_U32) != 0 {
            return Err(Fault::Failed);
        }
        card::release();
        card::set_fast(true);
        self.stage = Stage::Ready;
        Ok(true)
    }

    fn address(&self, block: u32) -> u32 {
        if self.is_high { block } else { block << 9 }
    }

    /// Asks for a block, unless it is on its way already. Since when it is, ms.
    fn ask(&self, block: u32) -> Result<u32, Fault> {
        match self.awaited.get() {
            Some((awaited, since)) if awaited == block => return Ok(since),
            // Nobody wants that any more: the card begins anew.
            Some(_) => return Err(Fault::Failed),
            None => {}
        }
        if HASTE.get() != 0 && card::is_wanted() {
            // A sensor on the same lines comes first.
            return Err(Fault::Later);
        }
        if self.stage != Stage::Ready || command(17, self.address(block)) != 0 {
            return Err(Fault::Failed);
        }
        let now = millis();
        self.awaited.set(Some((block, now)));
        Ok(now)
    }

    fn fetch(&self, block: u32, place: &mut Block) -> Result<(), Fault> {
        let since = self.ask(block)?;
        loop {
            match (0..LOOKS).map(|_| card::exchange(0xFF)).find(|byte| *byte != 0xFF) {
                Some(START) => break,
                Some(_) => return Err(Fault::Failed),
                None if millis().wrapping_sub(since) > BLOCK_MS => return Err(Fault::Failed),
                None if HASTE.get() != 0 => return Err(Fault::Later),
                None => {}
            }
        }
        card::read(&mut place.contents);
        // Its checksum.
        card::exchange(0xFF);
        card::exchange(0xFF);
        Ok(())
    }

    fn put(&self, block: u32, from: &Block) -> Result<(), Fault> {
        if self.stage != Stage::Ready || command(24, self.address(block)) != 0 {
            return Err(Fault::Failed);
        }
        card::exchange(0xFF);
        card::exchange(START);
        from.contents.iter().for_each(|byte| _ = card::exchange(*byte));
        card::exchange(0xFF);
        card::exchange(0xFF);
        if card::exchange(0xFF) & 0x1F != 5 {
            return Err(Fault::Failed);
        }
        let since = millis();
        while card::exchange(0xFF) != 0xFF {
            if millis().wrapping_sub(since) > WRITE_MS {
                return Err(Fault::Failed);
            }
        }
        Ok(())
    }

    /// After a command: the card is let go, and one that failed has to begin anew.
    fn end(&self, done: Result<(), Fault>) -> Result<(), Fault> {
        if done != Err(Fault::Later) {
            self.awaited.set(None);
            card::release();
        }
        done
    }
}

impl BlockDevice for Device {
    type Error = Fault;

    #[inline(never)]
    fn read(&self, blocks: &mut [Block], first: BlockIdx) -> Result<(), Fault> {
        // The cache has one.
        let Some(place) = blocks.first_mut() else { return Ok(()) };
        self.end(self.fetch(first.0, place))
    }

    #[inline(never)]
    fn write(&self, blocks: &[Block], first: BlockIdx) -> Result<(), Fault> {
        let Some(from) = blocks.first() else { return Ok(()) };
        self.end(self.put(first.0, from))
    }

    fn num_blocks(&self) -> Result<BlockCount, Fault> {
        Ok(BlockCount(u32::MAX))
    }
}

/// Sends a command; the first byte of its answer, 0xFF if none comes.
#[inline(never)]
#[small]
fn command(number: u8, argument: u32) -> u8 {
    card::select();
    card::exchange(0xFF);
    card::exchange(0x40 | number);
    argument.to_be_bytes().iter().for_each(|byte| _ = card::exchange(*byte));
    // A checksum counts only until the card knows that SPI is spoken.
    card::exchange(match number {
        0 => 0x95,
        8 => 0x87,
        _ => 0x01,
    });
    (0..ANSWER).map(|_| card::exchange(0xFF)).find(|byte| *byte & 0x80 == 0).unwrap_or(0xFF)
}

/// The rest of an answer.
#[small]
fn word() -> u32 {
    (0..4).fold(0, |word, _| word << 8 | u32::from(card::exchange(0xFF)))
}
