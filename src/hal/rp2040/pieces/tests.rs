//! Power fails at every byte that is written and at every word that is erased.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::vec::Vec;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use super::*;

const SECTOR: usize = 4_096;
const SECTORS: usize = 16;
/// Behind the sector of the notes.
const PLACE: Range<u32> = SECTOR as u32..((SECTORS + 1) * SECTOR) as u32;

/// What is done to the flash.
#[derive(Clone, Debug)]
enum Op {
    Write(usize, Vec<u8>),
    Erase(usize),
}

/// A flash in RAM, which notes what is done to it. Writing clears bits; erasing sets them.
#[derive(Clone, Default)]
struct Nor {
    bytes: Vec<u8>,
    ops: Vec<Op>,
}

#[derive(Debug)]
struct Outside;

impl NorFlashError for Outside {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::OutOfBounds
    }
}

impl Nor {
    fn new() -> Self {
        Self { bytes: std::vec![0xFF; (SECTORS + 1) * SECTOR], ops: Vec::new() }
    }

    fn act(&mut self, op: Op) {
        apply(&mut self.bytes, &op);
        self.ops.push(op);
    }
}

fn apply(bytes: &mut [u8], op: &Op) {
    match op {
        Op::Write(at, new) => {
            for (byte, new) in bytes[*at..].iter_mut().zip(new) {
                *byte &= new;
            }
        }
        Op::Erase(at) => bytes[*at..at + SECTOR].fill(0xFF),
    }
}

impl ErrorType for Nor {
    type Error = Outside;
}

impl ReadNorFlash for Nor {
    const READ_SIZE: usize = 1;
    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Outside> {
        let at = offset as usize;
        bytes.copy_from_slice(self.bytes.get(at..at + bytes.len()).ok_or(Outside)?);
        Ok(())
    }
    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for Nor {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR;
    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Outside> {
        for at in (from..to).step_by(SECTOR) {
            self.act(Op::Erase(at as usize));
        }
        Ok(())
    }
    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Outside> {
        self.act(Op::Write(offset as usize, bytes.to_vec()));
        Ok(())
    }
}

impl MultiwriteNorFlash for Nor {}

/// How far a sector that was cut short got. Each is a model of some flash.
#[derive(Clone, Copy, Debug)]
enum Tear {
    /// Erased from the first word on, or written from the first byte on.
    FromFirst,
    /// From the last one on.
    FromLast,
    /// Any bits have changed.
    Random,
    /// All bits were cleared before; any have been set since.
    Cleared,
}

const TEARS: [Tear; 4] = [Tear::FromFirst, Tear::FromLast, Tear::Random, Tear::Cleared];

/// Random numbers (xorshift).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
    /// Each bit is set in so many of 256 cases.
    fn bits(&mut self, of_256: u64) -> u8 {
        (0..8).fold(0, |bits, bit| bits | u8::from(self.next() % 256 < of_256) << bit)
    }
}

/// Does an operation up to a share of its bytes, `part` of `parts`.
fn tear(bytes: &mut [u8], op: &Op, tear: Tear, part: usize, parts: usize, random: &mut Random) {
    let (at, old, new) = match op {
        Op::Write(at, new) => (*at, bytes[*at..at + new.len()].to_vec(), new.clone()),
        Op::Erase(at) => (*at, bytes[*at..at + SECTOR].to_vec(), std::vec![0xFF; SECTOR]),
    };
    let (len, done) = (old.len(), old.len() * part / parts);
    let share = (256 * part / parts) as u64;
    for i in 0..len {
        let end = match op {
            Op::Write(..) => old[i] & new[i],
            Op::Erase(_) => 0xFF,
        };
        bytes[at + i] = match (tear, op) {
            (Tear::FromFirst, _) => {
                if i < done {
                    end
                } else {
                    old[i]
                }
            }
            (Tear::FromLast, _) => {
                if i >= len - done {
                    end
                } else {
                    old[i]
                }
            }
            (Tear::Cleared, Op::Erase(_)) => random.bits(share),
            _ => old[i] ^ (old[i] ^ end) & random.bits(share),
        };
    }
}

/// Pieces that were read from these bytes of a flash.
fn booted(bytes: &[u8]) -> Pieces<Nor> {
    let mut pieces = Pieces::new();
    pieces.start(Nor { bytes: bytes.to_vec(), ops: Vec::new() }, PLACE);
    pieces
}

fn nor(pieces: &mut Pieces<Nor>) -> &mut Nor {
    pieces.map.as_mut().unwrap().flash().flash()
}

/// Stores a piece whose bytes are all the same.
fn put(pieces: &mut Pieces<Nor>, number: u8, value: u8) {
    for at in (0..PIECE).map(|i| (usize::from(number) * PIECE + i) as u16) {
        pieces.write(at, value);
    }
    pieces.put_away();
}

/// The pieces in use: more than a sector has room for would make the test slow.
const USED: u8 = 60;

/// A flash in which each sector has been erased, and the random numbers that chose the values.
fn worn() -> (Pieces<Nor>, Random) {
    let (mut pieces, mut random) = (booted(&Nor::new().bytes), Random(0x1234_5678_9ABC_DEF1));
    for number in 0..USED {
        put(&mut pieces, number, number);
    }
    for _ in 0..1_700 {
        // The pieces above half are stored once.
        let number = random.next() % u64::from(USED / 2);
        put(&mut pieces, number as u8, random.next() as u8);
    }
    nor(&mut pieces).ops.clear();
    (pieces, random)
}

/// The images that a start has been tried with. Most of those that were cut short are the same after the repair.
#[derive(Default)]
struct Tried {
    images: HashSet<u64>,
    /// Images in all, starts that said they had lost something, and starts without all values.
    all: usize,
    told: usize,
    wrong: usize,
}

impl Tried {
    /// Starts with an image, stores a piece, and starts again. All bytes are the old ones or the new ones each time.
    fn start(&mut self, torn: &[u8], old: &[u8; BYTES], new: &[u8; BYTES]) {
        self.all += 1;
        let mut flash = Whole::new(Nor { bytes: torn.to_vec(), ops: Vec::new() }, 0);
        block_on(flash.finish()).unwrap();
        let flash = flash.flash();
        let mut hasher = DefaultHasher::new();
        (&flash.bytes, old).hash(&mut hasher);
        if !self.images.insert(hasher.finish()) {
            return;
        }
        let mut pieces = booted(torn);
        let mut is = pieces.bytes;
        self.told += usize::from(pieces.is_lost());
        let mut wrong = is != *old && is != *new;
        put(&mut pieces, USED, 0x5A);
        is[usize::from(USED) * PIECE..][..PIECE].fill(0x5A);
        wrong |= pieces.bytes != is || booted(&nor(&mut pieces).bytes).bytes != is;
        self.wrong += usize::from(wrong);
    }
}

/// Tries an operation that was cut short in each of these ways.
fn cut(
    tried: &mut Tried,
    image: &[u8],
    op: &Op,
    ways: impl Iterator<Item = (Tear, usize, usize)>,
    old: &[u8; BYTES],
    new: &[u8; BYTES],
    random: &mut Random,
) {
    for (way, part, parts) in ways {
        let mut torn = image.to_vec();
        tear(&mut torn, op, way, part, parts, random);
        tried.start(&torn, old, new);
    }
}

#[test]
fn an_erasing_may_be_cut_short_at_every_word() {
    let ((mut pieces, mut random), mut tried) = (worn(), Tried::default());
    let mut erased = HashSet::new();
    while erased.len() < SECTORS {
        let (mut image, old) = (nor(&mut pieces).bytes.clone(), pieces.bytes);
        put(&mut pieces, (random.next() % 30) as u8, random.next() as u8);
        for op in std::mem::take(&mut nor(&mut pieces).ops) {
            if let Op::Erase(at) = op {
                erased.insert(at);
                let parts = TEARS.into_iter().zip([1_024, 1_024, 32, 32]);
                let ways = parts.flat_map(|(way, parts)| (0..=parts).map(move |i| (way, i, parts)));
                cut(&mut tried, &image, &op, ways, &old, &pieces.bytes, &mut random);
            }
            apply(&mut image, &op);
        }
    }
    std::println!("{} images, {} after the repair", tried.all, tried.images.len());
    assert_eq!((tried.told, tried.wrong), (0, 0));
}

#[test]
fn a_write_may_be_cut_short_at_every_byte() {
    let ((mut pieces, mut random), mut tried) = (worn(), Tried::default());
    for n in 0.. {
        let (mut image, old) = (nor(&mut pieces).bytes.clone(), pieces.bytes);
        put(&mut pieces, (random.next() % 30) as u8, random.next() as u8);
        let ops = std::mem::take(&mut nor(&mut pieces).ops);
        // When a sector is full, pieces are moved from the next one but one: a ninth of those writes are tried.
        let (is_change, mut count) = (ops.len() > 40, 0);
        for op in ops {
            count += 1;
            if let Op::Write(_, new) = &op
                && (n < 3 || is_change && (new.len() == 1 || count % 9 == 0))
            {
                let ways = [Tear::FromFirst, Tear::Random].iter().flat_map(|way| {
                    let parts = new.len();
                    (0..parts).map(move |i| (*way, i, parts))
                });
                cut(&mut tried, &image, &op, ways, &old, &pieces.bytes, &mut random);
            }
            apply(&mut image, &op);
        }
        if is_change {
            break;
        }
    }
    std::println!("{} images, {} after the repair", tried.all, tried.images.len());
    assert_eq!((tried.told, tried.wrong), (0, 0));
}

/// Firmware before these notes wrote none. Erasing was cut short then, too.
#[test]
fn an_erasing_without_a_note_may_be_cut_short() {
    let ((mut pieces, mut random), mut tried) = (worn(), Tried::default());
    let mut erased = HashSet::new();
    while erased.len() < SECTORS {
        let (mut image, old) = (nor(&mut pieces).bytes.clone(), pieces.bytes);
        put(&mut pieces, (random.next() % 30) as u8, random.next() as u8);
        for op in std::mem::take(&mut nor(&mut pieces).ops) {
            image[..SECTOR].fill(0xFF);
            if let Op::Erase(at) = op {
                erased.insert(at);
                let ways = TEARS.into_iter().flat_map(|way| (0..=4).map(move |i| (way, i, 4)));
                cut(&mut tried, &image, &op, ways, &old, &pieces.bytes, &mut random);
            }
            apply(&mut image, &op);
        }
    }
    assert_eq!((tried.told, tried.wrong), (0, 0));
}

#[test]
fn power_may_fail_again_while_the_flash_is_repaired() {
    let (mut pieces, mut random) = worn();
    let mut tried = Tried::default();
    for _ in 0..130 {
        let (image, old) = (nor(&mut pieces).bytes.clone(), pieces.bytes);
        put(&mut pieces, (random.next() % 30) as u8, random.next() as u8);
        let ops = std::mem::take(&mut nor(&mut pieces).ops);
        let mut torn = image;
        cut_somewhere(&mut torn, &ops, &mut random);
        let mut again = booted(&torn);
        let (is, mut ops) = (again.bytes, std::mem::take(&mut nor(&mut again).ops));
        tried.wrong += usize::from(is != old && is != pieces.bytes);
        put(&mut again, USED, 0x77);
        ops.append(&mut nor(&mut again).ops);
        cut_somewhere(&mut torn, &ops, &mut random);
        tried.start(&torn, &is, &again.bytes);
    }
    assert_eq!((tried.told, tried.wrong), (0, 0));
}

/// Does some of the operations, and a part of the next one.
fn cut_somewhere(bytes: &mut [u8], ops: &[Op], random: &mut Random) {
    let at = random.next() as usize % ops.len();
    for op in &ops[..at] {
        apply(bytes, op);
    }
    let way = TEARS[random.next() as usize % TEARS.len()];
    tear(bytes, &ops[at], way, random.next() as usize % 17, 16, random);
}

#[test]
fn what_cannot_be_read_is_told() {
    let mut random = Random(77);
    for n in 0..20 {
        let mut bytes = Nor::new().bytes;
        // A map without a sector that could be filled: all begin and end with a written byte.
        for byte in &mut bytes {
            *byte = if n == 0 { 0 } else { random.next() as u8 & 0xF0 };
        }
        let mut pieces = booted(&bytes);
        assert!(pieces.is_lost());
        put(&mut pieces, 3, 33);
        put(&mut pieces, 4, 44);
        let (ops, mut pieces) = (std::mem::take(&mut nor(&mut pieces).ops), {
            let again = booted(&nor(&mut pieces).bytes);
            assert_eq!((again.is_lost(), again.read(96), again.read(128)), (false, 33, 44));
            again
        });
        assert_eq!(pieces.waiting(), None);
        assert!(nor(&mut pieces).ops.is_empty(), "nothing to repair");
        // Power fails while all of it is erased and written.
        cut_somewhere(&mut bytes, &ops[..ops.len() - 3], &mut random);
        let cut = booted(&bytes);
        assert!(cut.is_lost() || cut.read(96) == 33);
    }
    let mut cut = booted(&Nor::new().bytes);
    assert!(!cut.is_lost(), "an empty flash is no loss");
    put(&mut cut, 0, 1);
    assert!(!booted(&nor(&mut cut).bytes).is_lost());
}

#[test]
fn a_flash_of_another_size_is_told() {
    let mut pieces = Pieces::new();
    pieces.start(Nor::new(), 0..SECTOR as u32);
    assert!(pieces.is_lost());
    put(&mut pieces, 1, 7);
    assert_eq!(pieces.read(32), 7);
}
