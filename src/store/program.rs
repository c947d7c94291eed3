//! A program of G-code that a user keeps in EEPROM, behind the log. The area has 874 bytes (698 in an image that can
//! print). Its last 86 bytes are two start-up lines, which run at each start.
//!
//! ```text
//! byte 0      VALID, written last; any other value: there is no program
//! 1, 2        length of the text in bytes
//! 3, 4        checksum of the text
//! 5 ...       the text; each line ends in a line feed
//! ```
//! The program is written line by line, one byte per call: the caller that stores a line repeats the call until the
//! line is stored, so nothing is buffered in RAM. A byte that is already right is not written again. [`begin`] makes
//! the old program invalid, [`end`] makes the new one valid. So after a power failure there is the old program, the
//! new one or none. The program is checked when it is started, which takes 10 ms on AVR, and is then read in place.
//!
//! A start-up line takes 43 bytes: its length, a checksum of two bytes, and at most 40 of text. If a power failure has
//! cut a line off, there is no line.
//!
//! If the log of earlier firmware has reached this area, the log keeps it ([`Log::is_wide`](super::Log::is_wide)). No
//! program can be stored then.

use crc::{CRC_16_XMODEM, Crc, NoTable};

use super::Memory;
use crate::capability::Capability;

/// Bytes of the area. In a printer's image it is smaller by the room of 16 records, for the printer's settings.
pub const AREA: u16 = if Capability::Printer.is_built_in() { 698 } else { 874 };
/// The value of byte 0 of a valid program. A record begins with another value.
const VALID: u8 = 0x50;
const ERASED: u8 = 0xFF;
const HEAD: u16 = 5;
/// The number of start-up lines.
pub const STARTUPS: u8 = 2;
/// The longest start-up line.
pub const STARTUP_MAX: u8 = 40;
/// Bytes of a start-up line, with its head.
const STARTUP: u16 = 3 + STARTUP_MAX as u16;
/// Bytes of the program, with its head.
const PROGRAM: u16 = AREA - STARTUP * STARTUPS as u16;

const CRC: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_XMODEM);

/// The result of one call that stores something.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Stored {
    /// Not complete: call again.
    Again,
    /// There is no room.
    Full,
    /// Complete. The text has this length now.
    Done(u16),
}

#[small]
fn base<M: Memory>() -> u16 {
    M::SIZE - AREA
}

/// Returns the byte of the text at a place; `None` from `len` on.
#[small]
pub fn byte<M: Memory>(memory: &M, len: u16, at: u16) -> Option<u8> {
    (at < len).then(|| memory.read(base::<M>() + HEAD + at))
}

/// Returns the length of the program that its head states; `None` if there is no program.
#[small]
pub fn len<M: Memory>(memory: &M) -> Option<u16> {
    let head = |at| memory.read(base::<M>() + at);
    let len = u16::from_le_bytes([head(1), head(2)]);
    (head(0) == VALID && len <= PROGRAM - HEAD).then_some(len)
}

/// Returns the length of the program; `None` if there is none or its checksum does not match.
#[inline(never)]
#[small]
pub fn check<M: Memory>(memory: &M) -> Option<u16> {
    let head = |at| memory.read(base::<M>() + at);
    len(memory).filter(|len| u16::from_le_bytes([head(3), head(4)]) == sum(memory, *len))
}

#[small]
fn sum<M: Memory>(memory: &M, len: u16) -> u16 {
    let mut digest = CRC.digest();
    for at in 0..len {
        digest.update(&[memory.read(base::<M>() + HEAD + at)]);
    }
    digest.finalize()
}

/// Deletes the old program and starts an empty one.
#[small]
pub fn begin<M: Memory>(memory: &mut M) -> Stored {
    if put(memory, [(0, ERASED)].into_iter()) { Stored::Done(0) } else { Stored::Again }
}

/// Appends a line to the first `len` bytes of the new program.
#[inline(never)]
#[small]
pub fn line<M: Memory>(memory: &mut M, len: u16, text: &[u8]) -> Stored {
    let end = usize::from(HEAD + len) + text.len() + 1;
    if end > usize::from(PROGRAM) {
        return Stored::Full;
    }
    let bytes = text.iter().chain(b"\n").copied();
    match put(memory, (HEAD + len..).zip(bytes)) {
        true => Stored::Done(end as u16 - HEAD),
        false => Stored::Again,
    }
}

/// Makes the new program of `len` bytes valid.
#[inline(never)]
#[small]
pub fn end<M: Memory>(memory: &mut M, len: u16) -> Stored {
    if memory.is_busy() {
        return Stored::Again;
    }
    let [len0, len1] = len.to_le_bytes();
    let [sum0, sum1] = sum(memory, len).to_le_bytes();
    let head = [(1, len0), (2, len1), (3, sum0), (4, sum1), (0, VALID)];
    if put(memory, head.into_iter()) { Stored::Done(len) } else { Stored::Again }
}

/// Returns the offset of a start-up line from [`base`].
#[small]
fn startup(n: u8) -> u16 {
    PROGRAM + STARTUP * u16::from(n)
}

/// Returns the length of a start-up line: 0 if there is none. 2,000 cycles for 10 bytes.
#[inline(never)]
#[small]
pub fn startup_len<M: Memory>(memory: &M, n: u8) -> u8 {
    if n >= STARTUPS {
        return 0;
    }
    let at = base::<M>() + startup(n);
    let len = memory.read(at);
    if len > STARTUP_MAX {
        return 0;
    }
    let mut digest = CRC.digest();
    (0..u16::from(len)).for_each(|byte| digest.update(&[memory.read(at + 3 + byte)]));
    let sum = u16::from_le_bytes([memory.read(at + 1), memory.read(at + 2)]);
    if sum == digest.finalize() { len } else { 0 }
}

/// Returns a byte of the text of a start-up line.
#[small]
pub fn startup_byte<M: Memory>(memory: &M, n: u8, at: u8) -> u8 {
    memory.read(base::<M>() + startup(n) + 3 + u16::from(at))
}

/// Stores a start-up line, without blanks and in upper case. An empty text deletes the line.
#[inline(never)]
#[small]
pub fn put_startup<M: Memory>(memory: &mut M, n: u8, text: &[u8]) -> Stored {
    let bytes = || text.iter().filter(|byte| **byte > b' ').map(u8::to_ascii_uppercase);
    let mut digest = CRC.digest();
    bytes().for_each(|byte| digest.update(&[byte]));
    let [sum0, sum1] = digest.finalize().to_le_bytes();
    let len = bytes().count();
    if n >= STARTUPS || len > usize::from(STARTUP_MAX) {
        return Stored::Full;
    }
    let at = startup(n);
    let head = [(at + 1, sum0), (at + 2, sum1), (at, len as u8)];
    match put(memory, (at + 3..).zip(bytes()).chain(head)) {
        true => Stored::Done(len as u16),
        false => Stored::Again,
    }
}

/// Writes the first byte that differs from its wanted value. Returns true if all bytes are right and no write is in
/// progress.
#[small]
fn put<M: Memory>(memory: &mut M, bytes: impl Iterator<Item = (u16, u8)>) -> bool {
    if memory.is_busy() {
        return false;
    }
    for (at, byte) in bytes {
        let at = base::<M>() + at;
        if memory.read(at) != byte {
            memory.write(at, byte);
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::String;
    use std::vec::Vec;

    const SIZE: usize = 1_000;

    /// A memory that loses power after a number of bytes. The last byte is then `torn`.
    #[derive(Clone)]
    struct Cells {
        bytes: Vec<u8>,
        left: usize,
        torn: u8,
    }

    impl Memory for Cells {
        const SIZE: u16 = SIZE as u16;
        const LOG: u16 = SIZE as u16 - AREA;
        fn read(&self, at: u16) -> u8 {
            self.bytes[usize::from(at)]
        }
        fn is_busy(&self) -> bool {
            false
        }
        fn write(&mut self, at: u16, byte: u8) {
            match self.left {
                0 => {}
                1 => self.bytes[usize::from(at)] = self.torn,
                _ => self.bytes[usize::from(at)] = byte,
            }
            self.left = self.left.saturating_sub(1);
        }
    }

    /// Repeats the call until it is complete or the power is gone.
    fn wait(cells: &mut Cells, mut step: impl FnMut(&mut Cells) -> Stored) -> Stored {
        loop {
            match step(cells) {
                Stored::Again if cells.left > 0 => {}
                done => return done,
            }
        }
    }

    fn store(cells: &mut Cells, lines: &[&str]) {
        let mut len = 0;
        wait(cells, begin);
        for text in lines {
            match wait(cells, |cells| line(cells, len, text.as_bytes())) {
                Stored::Done(now) => len = now,
                _ => return,
            }
        }
        wait(cells, |cells| end(cells, len));
    }

    fn stored(cells: &Cells) -> Option<String> {
        let len = check(cells)?;
        let bytes = (0..len).filter_map(|at| byte(cells, len, at)).collect();
        String::from_utf8(bytes).ok()
    }

    #[test]
    fn a_power_cut_leaves_the_old_program_the_new_or_none() {
        let mut cells = Cells { bytes: std::vec![0xFF; SIZE], left: usize::MAX, torn: 0 };
        assert_eq!(stored(&cells), None);
        store(&mut cells, &["G0 X1", "G0 X2"]);
        assert_eq!(stored(&cells).as_deref(), Some("G0 X1\nG0 X2\n"));
        let mut seen = [0; 3];
        for torn in 0..=u8::MAX {
            for left in 1..40 {
                let mut cut = Cells { left, torn, ..cells.clone() };
                store(&mut cut, &["G0 X1", "G1 Y7 F100", "M2"]);
                match stored(&cut).as_deref() {
                    None => seen[0] += 1,
                    Some("G0 X1\nG0 X2\n") => seen[1] += 1,
                    Some("G0 X1\nG1 Y7 F100\nM2\n") => seen[2] += 1,
                    Some(other) => panic!("{other}"),
                }
            }
        }
        assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
    }

    #[test]
    fn lines_for_the_start_are_beside_the_program() {
        let mut cells = Cells { bytes: std::vec![0xFF; SIZE], left: usize::MAX, torn: 0 };
        assert_eq!((startup_len(&cells, 0), startup_len(&cells, 2)), (0, 0));
        let long = [b'x'; STARTUP_MAX as usize];
        wait(&mut cells, |cells| put_startup(cells, 0, b"g54 g20"));
        wait(&mut cells, |cells| put_startup(cells, 1, &long));
        store(&mut cells, &["G0 X1"; 19]);
        let text = |cells: &Cells, n| -> Vec<u8> {
            (0..startup_len(cells, n)).map(|at| startup_byte(cells, n, at)).collect()
        };
        assert_eq!((text(&cells, 0), text(&cells, 1)), (b"G54G20".to_vec(), [b'X'; 40].to_vec()));
        assert_eq!(put_startup(&mut cells, 1, &[b'x'; 41]), Stored::Full);
        for torn in 0..=u8::MAX {
            for left in 1..10 {
                let mut cut = Cells { left, torn, ..cells.clone() };
                wait(&mut cut, |cells| put_startup(cells, 0, b"G55"));
                let text = text(&cut, 0);
                assert!(matches!(&text[..], b"" | b"G54G20" | b"G55"), "{text:?}");
            }
        }
        wait(&mut cells, |cells| put_startup(cells, 0, b""));
        assert_eq!((startup_len(&cells, 0), stored(&cells).is_some()), (0, true));
    }

    #[test]
    fn it_has_its_room() {
        let mut cells = Cells { bytes: std::vec![0xFF; SIZE], left: usize::MAX, torn: 0 };
        let mut len = 0;
        let mut lines = 0;
        while let Stored::Done(now) = wait(&mut cells, |cells| line(cells, len, &[b'x'; 39])) {
            (len, lines) = (now, lines + 1);
        }
        assert_eq!(lines, if Capability::Printer.is_built_in() { 15 } else { 19 });
        assert!(cells.bytes[..SIZE - usize::from(AREA)].iter().all(|byte| *byte == 0xFF));
    }
}
