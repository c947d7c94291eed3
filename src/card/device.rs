//! The card as a device with blocks of 512 bytes, accessed by SPI (SD Physical Layer, simplified, chapter 7).
//!
//! The answer to a command comes within some bytes. A block is requested (CMD17) and comes at most 100 ms later.
//! [`Blocks::read`] waits for the block if it is [patient](Blocks::patient). Otherwise it returns [`Fault::Later`], and
//! has to be called again for this block. The card stays selected meanwhile. A block that is written has been sent when
//! the function returns; the card is busy with it for up to 250 ms, and the next command waits for that.

use crate::hal::{Thread, card, time::millis};

/// Why a block is not available.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fault {
    /// No fault: the block has been requested and has not come yet.
    Later,
    /// The card does not answer, or refuses the command.
    Failed,
    /// There is no room for a file.
    #[cfg(feature = "card-write")]
    Full,
}

/// Bytes of a block.
pub const BLOCK: usize = 512;

/// The longest time until a requested block comes, and until the card is ready after power-up, ms.
const BLOCK_MS: u32 = 100;
const READY_MS: u32 = 1_000;
/// The longest time of a write, ms.
const WRITE_MS: u32 = 250;
/// The number of bytes within which an answer comes, and the number of bytes that are checked for a block at once.
const ANSWER: u8 = 10;
const LOOKS: u8 = 8;
/// How many times it is looked for after the longest time.
const LAST_LOOKS: u8 = 8;
/// The byte that begins a block.
const START: u8 = 0xFE;
/// Bits of an answer.
const IDLE: u8 = 1;
const ILLEGAL: u8 = 4;
/// The number of attempts with CMD0.
const TRIES: u8 = 10;

/// The state of the card.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stage {
    /// No command has been sent to it.
    Fresh,
    /// It has been asked at this time (ms) to initialize; the flag says whether it supports high capacity.
    Wakes(u32, bool),
    /// The card is ready.
    Ready,
}

/// The card, and the block that was read last.
pub struct Blocks {
    device: Device,
    /// Whether reads wait for blocks.
    pub patient: bool,
    number: Option<u32>,
    bytes: [u8; BLOCK],
}

#[small]
impl Blocks {
    /// Returns a card to which no command has been sent.
    pub const fn new(thread: Thread) -> Self {
        Self { device: Device::new(thread), patient: true, number: None, bytes: [0; BLOCK] }
    }

    /// Makes one attempt to initialize the card. Returns whether it is ready.
    pub fn begin(&mut self) -> Result<bool, Fault> {
        self.number = None;
        self.device.begin()
    }

    /// Returns a block. Cost, unless it was read last: 25,000 cycles, and the time until the card has it.
    #[inline(never)]
    pub fn read(&mut self, block: u32) -> Result<&[u8; BLOCK], Fault> {
        if self.number != Some(block) {
            self.number = None;
            self.device.read(block, &mut self.bytes, self.patient)?;
            self.number = Some(block);
        }
        Ok(&self.bytes)
    }

    /// Takes the block that has been requested, if there is one, and waits until the card has written the last one: the
    /// card is not selected any more.
    #[inline(never)]
    pub fn settle(&mut self) {
        if let Some((block, _)) = self.device.awaited {
            let _ = self.read(block);
        }
        let _ = self.device.rest(true);
    }

    /// Changes a block on the card. Nothing has changed when this returns [`Fault::Later`].
    #[inline(always)]
    pub fn change(
        &mut self,
        block: u32,
        change: impl FnOnce(&mut [u8; BLOCK]),
    ) -> Result<(), Fault> {
        self.device.rest(self.patient)?;
        self.read(block)?;
        change(&mut self.bytes);
        self.device.write(block, &self.bytes, self.patient)
    }

    /// Waits until the card has written its last block, if reads are [patient](Self::patient).
    #[cfg(feature = "card-write")]
    pub fn rest(&mut self) -> Result<(), Fault> {
        self.device.rest(self.patient)
    }

    /// Writes a whole block.
    #[cfg(feature = "card-write")]
    #[inline(never)]
    pub fn write(&mut self, block: u32, bytes: &[u8; BLOCK]) -> Result<(), Fault> {
        if self.number == Some(block) {
            self.number = None;
        }
        self.device.write(block, bytes, self.patient)
    }

    /// Writes the contents of one block to another one as well.
    #[cfg(feature = "card-write")]
    #[inline(never)]
    pub fn copy(&mut self, from: u32, to: u32) -> Result<(), Fault> {
        self.read(from)?;
        self.device.write(to, &self.bytes, self.patient)
    }
}

/// The card.
struct Device {
    thread: Thread,
    stage: Stage,
    /// Whether addresses count blocks, not bytes.
    is_high: bool,
    /// The block that has been requested, and the time of the request, ms.
    awaited: Option<(u32, u32)>,
    /// Since when the card has been writing a block, ms.
    writes: Option<u32>,
}

#[small]
impl Device {
    const fn new(thread: Thread) -> Self {
        Self { thread, stage: Stage::Fresh, is_high: false, awaited: None, writes: None }
    }

    /// Makes one attempt to initialize the card. Returns whether it is ready.
    fn begin(&mut self) -> Result<bool, Fault> {
        let done = match self.stage {
            Stage::Fresh | Stage::Ready => self.reset(),
            Stage::Wakes(since, version_2) => self.wake(since, version_2),
        };
        if done.is_err() {
            self.stage = Stage::Fresh;
        }
        if done != Ok(true) {
            card::release(self.thread);
        }
        done
    }

    fn reset(&mut self) -> Result<bool, Fault> {
        let _ = self.rest(true);
        self.awaited = None;
        card::release(self.thread);
        card::set_fast(self.thread, false);
        // 80 clock cycles while no device is selected; the card needs 74.
        (0..10).for_each(|_| _ = card::exchange(self.thread, 0xFF));
        if !(0..TRIES).any(|_| command(self.thread, 0, 0) == IDLE) {
            return Err(Fault::Failed);
        }
        let version_2 = command(self.thread, 8, 0x1AA) & ILLEGAL == 0;
        if version_2 && word(self.thread) & 0xFFF != 0x1AA {
            return Err(Fault::Failed);
        }
        self.stage = Stage::Wakes(millis(), version_2);
        Ok(false)
    }

    fn wake(&mut self, since: u32, version_2: bool) -> Result<bool, Fault> {
        command(self.thread, 55, 0);
        match command(self.thread, 41, u32::from(version_2) << 30) {
            0 => {}
            IDLE if millis().wrapping_sub(since) < READY_MS => return Ok(false),
            _ => return Err(Fault::Failed),
        }
        self.is_high =
            version_2 && command(self.thread, 58, 0) == 0 && word(self.thread) & 1 << 30 != 0;
        if !self.is_high && command(self.thread, 16, BLOCK as u32) != 0 {
            return Err(Fault::Failed);
        }
        card::release(self.thread);
        card::set_fast(self.thread, true);
        self.stage = Stage::Ready;
        Ok(true)
    }

    fn address(&self, block: u32) -> u32 {
        if self.is_high { block } else { block << 9 }
    }

    /// Waits until the card has written its last block, at most 250 ms. Not `patient`: returns [`Fault::Later`] instead.
    fn rest(&mut self, patient: bool) -> Result<(), Fault> {
        let Some(since) = self.writes else { return Ok(()) };
        card::select(self.thread);
        // A selected card shows that it is busy from the second byte on.
        card::exchange(self.thread, 0xFF);
        let done = loop {
            if card::exchange(self.thread, 0xFF) == 0xFF {
                break Ok(());
            }
            if millis().wrapping_sub(since) > WRITE_MS {
                break Err(Fault::Failed);
            }
            if !patient {
                break Err(Fault::Later);
            }
        };
        card::release(self.thread);
        if done != Err(Fault::Later) {
            self.writes = None;
        }
        done
    }

    /// Requests a block, unless it has been requested already. Returns the time of the request, ms.
    fn ask(&mut self, block: u32, patient: bool) -> Result<u32, Fault> {
        if let Some((_, since)) = self.awaited {
            return Ok(since);
        }
        if !patient && card::is_wanted(self.thread) {
            // A sensor on the SPI has priority.
            return Err(Fault::Later);
        }
        self.rest(patient)?;
        if self.stage != Stage::Ready || command(self.thread, 17, self.address(block)) != 0 {
            return Err(Fault::Failed);
        }
        let now = millis();
        self.awaited = Some((block, now));
        Ok(now)
    }

    fn fetch(&mut self, block: u32, place: &mut [u8; BLOCK], patient: bool) -> Result<(), Fault> {
        let since = self.ask(block, patient)?;
        // Nobody may have looked for a long time, so the last looks come after it.
        let mut looks = LAST_LOOKS;
        loop {
            match (0..LOOKS).map(|_| card::exchange(self.thread, 0xFF)).find(|byte| *byte != 0xFF) {
                Some(START) => break,
                Some(_) => return Err(Fault::Failed),
                None if millis().wrapping_sub(since) > BLOCK_MS => {
                    looks = looks.checked_sub(1).ok_or(Fault::Failed)?;
                }
                None if !patient => return Err(Fault::Later),
                None => {}
            }
        }
        card::read(self.thread, place);
        // The checksum, which is not checked.
        card::exchange(self.thread, 0xFF);
        card::exchange(self.thread, 0xFF);
        Ok(())
    }

    fn put(&mut self, block: u32, from: &[u8; BLOCK]) -> Result<(), Fault> {
        if self.stage != Stage::Ready || command(self.thread, 24, self.address(block)) != 0 {
            return Err(Fault::Failed);
        }
        card::exchange(self.thread, 0xFF);
        card::exchange(self.thread, START);
        from.iter().for_each(|byte| _ = card::exchange(self.thread, *byte));
        card::exchange(self.thread, 0xFF);
        card::exchange(self.thread, 0xFF);
        let taken =
            (0..ANSWER).map(|_| card::exchange(self.thread, 0xFF)).find(|byte| *byte != 0xFF);
        if taken.is_none_or(|byte| byte & 0x1F != 5) {
            return Err(Fault::Failed);
        }
        self.writes = Some(millis());
        Ok(())
    }

    /// Ends a command: deselects the card, unless a block is still to come.
    fn end(&mut self, done: Result<(), Fault>) -> Result<(), Fault> {
        if done != Err(Fault::Later) {
            self.awaited = None;
            card::release(self.thread);
        }
        done
    }

    #[inline(never)]
    fn read(&mut self, block: u32, place: &mut [u8; BLOCK], patient: bool) -> Result<(), Fault> {
        if let Some((other, _)) = self.awaited.filter(|(awaited, _)| *awaited != block) {
            // Another block was requested before and is not wanted any more. The card sends it first.
            let done = self.fetch(other, place, true);
            self.end(done)?;
        }
        let done = self.fetch(block, place, patient);
        self.end(done)
    }

    #[inline(never)]
    fn write(&mut self, block: u32, from: &[u8; BLOCK], patient: bool) -> Result<(), Fault> {
        self.rest(patient)?;
        let done = self.put(block, from);
        self.end(done)
    }
}

/// Sends a command. Returns the first byte of its answer, 0xFF if none comes.
#[inline(never)]
#[small]
fn command(thread: Thread, number: u8, argument: u32) -> u8 {
    card::select(thread);
    card::exchange(thread, 0xFF);
    card::exchange(thread, 0x40 | number);
    argument.to_be_bytes().iter().for_each(|byte| _ = card::exchange(thread, *byte));
    // The checksum counts only until the card is in SPI mode.
    card::exchange(
        thread,
        match number {
            0 => 0x95,
            8 => 0x87,
            _ => 0x01,
        },
    );
    (0..ANSWER).map(|_| card::exchange(thread, 0xFF)).find(|byte| *byte & 0x80 == 0).unwrap_or(0xFF)
}

/// Reads the other four bytes of an answer.
#[small]
fn word(thread: Thread) -> u32 {
    (0..4).fold(0, |word, _| word << 8 | u32::from(card::exchange(thread, 0xFF)))
}
