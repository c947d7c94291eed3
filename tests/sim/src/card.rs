//! An SD card on SPI. Its contents are the image of a card with a partition.
//!
//! The card answers CMD0, 8, 16, 17, 24, 41, 55 and 58 as the SD specification says (Physical Layer, simplified,
//! chapter 7), in the order that the specification allows. A block comes [`SdCard::access_us`] after it was
//! requested; after a block was written the card is busy for the same time.

use std::collections::VecDeque;

/// Bytes of a block.
const BLOCK: usize = 512;
/// How often CMD41 must be sent until the card is ready.
const TRIES: u32 = 5;

/// Bits of the response R1.
const IDLE: u8 = 1;
const ILLEGAL: u8 = 4;

/// The card.
pub struct SdCard {
    image: Vec<u8>,
    /// Whether addresses count blocks, not bytes (a high-capacity card).
    is_high: bool,
    /// Access time of a block, us.
    pub access_us: u64,
    /// Blocks that have been read.
    pub reads: u64,
    /// Whether the card is in its slot.
    pub is_there: bool,
    cycles_per_us: u64,
    idle: bool,
    is_application: bool,
    tries: u32,
    command: Vec<u8>,
    out: VecDeque<u8>,
    /// The block that is being read, and the cycle from which on its data is there.
    coming: Option<(usize, u64)>,
    /// The block that is being written, and the bytes of it that have come so far.
    write: Option<(usize, Vec<u8>)>,
    busy_until: u64,
}

impl SdCard {
    /// A card with these contents, ready for CMD0.
    pub fn new(image: Vec<u8>, is_high: bool, clock_hz: u32) -> Self {
        Self {
            image,
            is_high,
            access_us: 300,
            reads: 0,
            is_there: true,
            cycles_per_us: u64::from(clock_hz) / 1_000_000,
            idle: true,
            is_application: false,
            tries: 0,
            command: Vec::new(),
            out: VecDeque::new(),
            coming: None,
            write: None,
            busy_until: 0,
        }
    }

    /// Returns the contents of the card.
    pub fn image(&self) -> &[u8] {
        &self.image
    }

    pub(crate) fn select(&mut self, _: bool) {
        self.command.clear();
        self.out.clear();
        (self.coming, self.write) = (None, None);
    }

    pub(crate) fn exchange(&mut self, byte: u8, cycle: u64) -> u8 {
        if !self.is_there {
            return 0xFF;
        }
        if let Some((block, _)) = self.coming.take_if(|(_, at)| *at <= cycle) {
            let contents = &self.image[block * BLOCK..(block + 1) * BLOCK];
            self.out.push_back(0xFE);
            self.out.extend(contents);
            self.out.extend([0, 0]);
            self.reads += 1;
        }
        let busy = cycle < self.busy_until;
        let reply = self.out.pop_front().unwrap_or(if busy { 0 } else { 0xFF });
        self.take(byte, cycle);
        reply
    }

    fn take(&mut self, byte: u8, cycle: u64) {
        if let Some((block, bytes)) = &mut self.write {
            if bytes.is_empty() && byte != 0xFE {
                return;
            }
            bytes.push(byte);
            if bytes.len() == 1 + BLOCK + 2 {
                self.image[*block * BLOCK..(*block + 1) * BLOCK].copy_from_slice(&bytes[1..=BLOCK]);
                self.write = None;
                self.out.push_back(0xE5);
                self.busy_until = cycle + self.access_us * self.cycles_per_us;
            }
            return;
        }
        if self.command.is_empty() && byte & 0xC0 != 0x40 {
            return;
        }
        self.command.push(byte);
        if self.command.len() == 6 {
            let command = std::mem::take(&mut self.command);
            let argument = u32::from_be_bytes(command[1..5].try_into().expect("four bytes"));
            self.carry_out(command[0] & 0x3F, argument, command[5], cycle);
        }
    }

    fn carry_out(&mut self, number: u8, argument: u32, sum: u8, cycle: u64) {
        let application = std::mem::replace(&mut self.is_application, number == 55);
        let block = if self.is_high { argument } else { argument / BLOCK as u32 } as usize;
        let fits = (block + 1) * BLOCK <= self.image.len();
        let idle = u8::from(self.idle);
        let mut answer: Vec<u8> = match number {
            0 if sum == 0x95 => {
                (self.idle, self.tries) = (true, 0);
                vec![IDLE]
            }
            8 if sum == 0x87 => vec![idle, 0, 0, (argument >> 8) as u8, argument as u8],
            55 => vec![idle],
            41 if application => {
                self.tries += 1;
                self.idle &= self.tries < TRIES;
                vec![self.idle.into()]
            }
            58 => vec![idle, if self.is_high { 0xC0 } else { 0x80 }, 0xFF, 0x80, 0],
            16 if !self.idle && argument == BLOCK as u32 => vec![0],
            17 if !self.idle && fits => {
                self.coming = Some((block, cycle + self.access_us * self.cycles_per_us));
                vec![0]
            }
            24 if !self.idle && fits => {
                self.write = Some((block, Vec::new()));
                vec![0]
            }
            _ => vec![ILLEGAL | idle],
        };
        answer.insert(0, 0xFF);
        self.out.extend(answer);
    }
}
