//! A program of G-code that a user keeps in EEPROM, behind the log. The area has 874 bytes (698 in an image that can
//! print). Its last 129 bytes have two start-up lines, which run at each start.
//!
//! ```text
//! byte 0      VALID, written last; any other value: there is no program
//! 1, 2        length of the text in bytes
//! 3, 4        checksum of the text
//! 5 ...       the text; each line ends in a line feed
//! ```
//! The area has two sides. The program of one side begins at the first byte and goes up. The program of the other side
//! begins at the last byte and goes down. A valid program is on one side, and a new one is written on the other. [`end`]
//! marks the new program as valid. Then it marks the old one as invalid. So after a power failure there is the old
//! program or the new one. There is an exception: both may have no room together. Then the first line that needs the room
//! of the old program marks that as invalid, and after a power failure there may be none.
//!
//! The program is written line by line, one byte per call: the caller that stores a line repeats the call until the
//! line is stored, so nothing is buffered in RAM. A byte that is already right is not written again. The program is
//! checked when it is started, which takes 10 ms on AVR, and is then read in place.
//!
//! A start-up line takes a slot of 43 bytes: its length and whose line it is, a checksum of two bytes, and at most 40
//! of text. There are three slots. A new line is written to the free one, and then the old one is made invalid. So after
//! a power failure there is the old line or the new one.
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
/// The number of slots for them.
const SLOTS: u8 = STARTUPS + 1;
/// The longest start-up line.
pub const STARTUP_MAX: u8 = 40;
/// Bytes of a slot.
const STARTUP: u16 = 3 + STARTUP_MAX as u16;
/// Bytes of both programs, with their heads.
const PROGRAM: u16 = AREA - STARTUP * SLOTS as u16;

const CRC: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_XMODEM);

/// A program, or the part of a new one that has been stored.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Program {
    /// Whether its bytes go down from the last one.
    down: bool,
    /// The length of the text in bytes.
    len: u16,
}

/// The result of one call that stores something.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Stored {
    /// Not complete: call again.
    Again,
    /// There is no room.
    Full,
    /// Complete.
    Done,
    /// Complete. This is what there is of the new program now.
    Part(Program),
}

#[small]
fn base<M: Memory>() -> u16 {
    M::SIZE - AREA
}

#[small]
impl Program {
    /// Returns the offset of a byte of the program, counted from its head, from [`base`].
    fn place(self, at: u16) -> u16 {
        if self.down { PROGRAM - 1 - at } else { at }
    }

    /// Returns the byte of the text at a place; `None` behind the end.
    pub fn byte<M: Memory>(self, memory: &M, at: u16) -> Option<u8> {
        (at < self.len).then(|| self.read(memory, HEAD + at))
    }

    fn read<M: Memory>(self, memory: &M, at: u16) -> u8 {
        memory.read(base::<M>() + self.place(at))
    }

    /// Returns the program on the other side, without text.
    fn other(self) -> Self {
        Self { down: !self.down, len: 0 }
    }

    /// Returns the two bytes of the head from `at` on.
    fn pair<M: Memory>(self, memory: &M, at: u16) -> u16 {
        u16::from_le_bytes([self.read(memory, at), self.read(memory, at + 1)])
    }

    #[inline(never)]
    fn sum<M: Memory>(self, memory: &M) -> u16 {
        let mut digest = CRC.digest();
        for at in 0..self.len {
            digest.update(&[self.read(memory, HEAD + at)]);
        }
        digest.finalize()
    }
}

/// Returns the program as its head says; `None` if there is none.
#[inline(never)]
#[small]
pub fn find<M: Memory>(memory: &M) -> Option<Program> {
    [false, true].into_iter().find_map(|down| {
        let side = Program { down, len: 0 };
        let len = side.pair(memory, 1);
        let is_valid = side.read(memory, 0) == VALID && len <= PROGRAM - 2 * HEAD;
        is_valid.then_some(Program { down, len })
    })
}

/// Whether there is a program, and its checksum is right.
#[inline(never)]
#[small]
pub fn is_whole<M: Memory>(memory: &M) -> bool {
    find(memory).is_some_and(|program| program.pair(memory, 3) == program.sum(memory))
}

/// Starts a new program, which is empty.
#[inline(never)]
#[small]
pub fn begin<M: Memory>(memory: &mut M) -> Stored {
    let new = Program { down: find(memory).is_some_and(|old| !old.down), len: 0 };
    if put(memory, new.place(0), ERASED) { Stored::Part(new) } else { Stored::Again }
}

/// Appends a line to the new program. Makes the old program invalid if the line needs its room.
#[inline(never)]
#[small]
pub fn line<M: Memory>(memory: &mut M, new: Program, text: &[u8]) -> Stored {
    let len = usize::from(new.len) + text.len() + 1;
    let Some(room) = usize::from(PROGRAM - 2 * HEAD).checked_sub(len) else { return Stored::Full };
    let old = find(memory).filter(|old| old.down != new.down);
    if old.is_some_and(|old| usize::from(old.len) > room) {
        put(memory, new.other().place(0), ERASED);
        return Stored::Again;
    }
    let is_put = put_all(memory, new.place(HEAD + new.len), new.down, text)
        && put(memory, new.place(HEAD + len as u16 - 1), b'\n');
    if is_put { Stored::Part(Program { len: len as u16, ..new }) } else { Stored::Again }
}

/// Makes the new program valid, and then the old one invalid.
#[inline(never)]
#[small]
pub fn end<M: Memory>(memory: &mut M, new: Program) -> Stored {
    if memory.is_busy() {
        return Stored::Again;
    }
    let [len0, len1] = new.len.to_le_bytes();
    let [sum0, sum1] = new.sum(memory).to_le_bytes();
    let is_put = put_all(memory, new.place(0), new.down, &[VALID, len0, len1, sum0, sum1])
        && put(memory, new.other().place(0), ERASED);
    if is_put { Stored::Done } else { Stored::Again }
}

/// A start-up line in its slot.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Startup {
    slot: u8,
    len: u8,
}

/// Returns the offset of a slot from [`base`]. Firmware with two slots had them at the end.
#[small]
fn slot_place(slot: u8) -> u16 {
    let from_end = if slot < STARTUPS { STARTUPS - slot } else { SLOTS };
    AREA - STARTUP * u16::from(from_end)
}

#[small]
impl Startup {
    /// Returns what is in a slot, if it is line `n`. 2,000 cycles for 10 bytes.
    fn in_slot<M: Memory>(memory: &M, slot: u8, n: u8) -> Option<Self> {
        let at = base::<M>() + slot_place(slot);
        let head = memory.read(at);
        let line = Self { slot, len: head & 0x3F };
        // Firmware with two slots had no number there.
        let has_number = head > 0x3F;
        if line.len > STARTUP_MAX || if has_number { head >> 6 != n + 1 } else { slot != n } {
            return None;
        }
        let mut digest = CRC.digest();
        for at in u8::from(!has_number)..=line.len {
            digest.update(&[if at == 0 { head } else { line.byte(memory, at - 1) }]);
        }
        let sum = u16::from_le_bytes([memory.read(at + 1), memory.read(at + 2)]);
        (sum == digest.finalize()).then_some(line)
    }

    /// Returns start-up line `n`; `None` if it was never stored.
    #[inline(never)]
    pub fn find<M: Memory>(memory: &M, n: u8) -> Option<Self> {
        (0..SLOTS).find_map(|slot| Self::in_slot(memory, slot, n))
    }

    /// Returns the length of the line.
    pub fn len(self) -> u8 {
        self.len
    }

    /// Whether the line has been deleted.
    pub fn is_empty(self) -> bool {
        self.len == 0
    }

    /// Returns a byte of the line.
    pub fn byte<M: Memory>(self, memory: &M, at: u8) -> u8 {
        memory.read(base::<M>() + slot_place(self.slot) + 3 + u16::from(at))
    }
}

/// Stores a start-up line, without blanks and in upper case. An empty text deletes the line.
#[inline(never)]
#[small]
pub fn put_startup<M: Memory>(memory: &mut M, n: u8, text: &[u8]) -> Stored {
    // The slot as it is to be. For the checksum its first byte is before the text.
    let mut image = [0; STARTUP as usize];
    let mut len = 0u8;
    for byte in text.iter().filter(|byte| **byte > b' ') {
        let Some(place) = image.get_mut(3 + usize::from(len)) else { return Stored::Full };
        *place = byte.to_ascii_uppercase();
        len += 1;
    }
    if n >= STARTUPS {
        return Stored::Full;
    }
    let head = (n + 1) << 6 | len;
    let end = 3 + usize::from(len);
    image[2] = head;
    let [sum0, sum1] = CRC.checksum(image.get(2..end).unwrap_or_default()).to_le_bytes();
    image[..3].copy_from_slice(&[head, sum0, sum1]);
    let image = image.get(..end).unwrap_or_default();
    if memory.is_busy() {
        return Stored::Again;
    }
    if let Some(new) = (0..SLOTS).find(|slot| holds(memory, *slot, image, 0)) {
        let is_old = |slot: &u8| *slot != new && Startup::in_slot(memory, *slot, n).is_some();
        let Some(old) = (0..SLOTS).find(is_old) else { return Stored::Done };
        put(memory, slot_place(old), ERASED);
        return Stored::Again;
    }
    let is_taken = |slot: u8| {
        (0..STARTUPS).any(|n| Startup::find(memory, n).is_some_and(|line| line.slot == slot))
    };
    let free = (0..SLOTS).find(|slot| !is_taken(*slot)).unwrap_or(0);
    // What was in the slot is invalid before its first byte changes.
    if holds(memory, free, image, 1) || put(memory, slot_place(free), ERASED) {
        put_all(memory, slot_place(free), false, image);
    }
    Stored::Again
}

/// Whether a slot holds these bytes, from this one on.
#[inline(never)]
#[small]
fn holds<M: Memory>(memory: &M, slot: u8, image: &[u8], from: usize) -> bool {
    let at = base::<M>() + slot_place(slot);
    (at..).zip(image).skip(from).all(|(at, byte)| memory.read(at) == *byte)
}

/// Writes the first of these bytes that differs. They go up or down from `start`; the first byte is the last one to be
/// written. Returns true if all are right and no write is in progress.
#[inline(never)]
#[small]
fn put_all<M: Memory>(memory: &mut M, start: u16, down: bool, bytes: &[u8]) -> bool {
    let (Some((first, rest)), mut at) = (bytes.split_first(), start) else { return true };
    for byte in rest {
        at = if down { at - 1 } else { at + 1 };
        if !put(memory, at, *byte) {
            return false;
        }
    }
    put(memory, start, *first)
}

/// Writes a byte if it differs. Returns true if it is right and no write is in progress.
#[inline(never)]
#[small]
fn put<M: Memory>(memory: &mut M, at: u16, byte: u8) -> bool {
    if memory.is_busy() {
        return false;
    }
    let at = base::<M>() + at;
    let is_right = memory.read(at) == byte;
    if !is_right {
        memory.write(at, byte);
    }
    is_right
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

    fn store(cells: &mut Cells, lines: &[&str]) -> Option<()> {
        let Stored::Part(mut new) = wait(cells, begin) else { return None };
        for text in lines {
            match wait(cells, |cells| line(cells, new, text.as_bytes())) {
                Stored::Part(now) => new = now,
                _ => return None,
            }
        }
        (wait(cells, |cells| end(cells, new)) == Stored::Done).then_some(())
    }

    fn stored(cells: &Cells) -> Option<String> {
        let program = find(cells).filter(|_| is_whole(cells))?;
        let bytes = (0..).map_while(|at| program.byte(cells, at)).collect();
        String::from_utf8(bytes).ok()
    }

    fn blank() -> Cells {
        Cells { bytes: std::vec![0xFF; SIZE], left: usize::MAX, torn: 0 }
    }

    /// Stores each program in turn, and cuts power at each byte, with all values that it may have then. What is stored
    /// is the old program or the new one, and the old one can be replaced then.
    fn cut_short(programs: &[&[&str]], mut each: impl FnMut(Option<&str>)) {
        let mut cells = blank();
        for lines in programs {
            let old = stored(&cells);
            let new = lines.iter().flat_map(|line| [*line, "\n"]).collect::<String>();
            for left in 1.. {
                let torn = (0..=u8::MAX).step_by(if left % 16 == 0 { 1 } else { 51 });
                for torn in torn {
                    let mut cut = Cells { left, torn, ..cells.clone() };
                    store(&mut cut, lines);
                    let is = stored(&cut);
                    assert!(is.is_none() || is == old || is.as_ref() == Some(&new), "{is:?}");
                    each(is.as_deref());
                    cut.left = usize::MAX;
                    assert_eq!(store(&mut cut, lines), Some(()));
                    assert_eq!(stored(&cut).as_ref(), Some(&new));
                }
                let mut cut = Cells { left, ..cells.clone() };
                store(&mut cut, lines);
                if cut.left > 0 {
                    break;
                }
            }
            store(&mut cells, lines);
            assert_eq!(stored(&cells).as_ref(), Some(&new));
        }
    }

    #[test]
    fn a_power_cut_leaves_the_old_program_or_the_new() {
        let (mut is_first, mut none) = (true, 0);
        let programs: [&[&str]; 6] = [
            &["G0 X1", "G0 X2"],
            &["G0 X1", "G1 Y7 F100", "M2"],
            &["P(PPPPPPPPPPPPPPPP)", "G4P1"],
            &[],
            &["G0 X1"],
            &["G0 X3"],
        ];
        cut_short(&programs, |is| {
            none += usize::from(is.is_none() && !is_first);
            is_first &= is.is_none();
        });
        assert_eq!(none, 0, "no program but before the first");
    }

    #[test]
    fn programs_that_have_no_room_together_leave_one_or_none() {
        let (long, longer) = (["G1 X1 Y1 Z1 F1000"; 20], ["G1 X2 Y2 Z2 F2000"; 25]);
        let mut none = 0;
        cut_short(&[&long, &longer], |is| none += usize::from(is.is_none()));
        assert!(none > 0);
    }

    /// The texts of the start-up lines.
    fn texts(cells: &Cells) -> [Vec<u8>; 2] {
        [0, 1].map(|n| {
            let line = Startup::find(cells, n);
            line.map_or(Vec::new(), |l| (0..l.len()).map(|at| l.byte(cells, at)).collect())
        })
    }

    #[test]
    fn a_power_cut_leaves_the_old_start_up_line_or_the_new() {
        let mut cells = blank();
        let long = "x".repeat(usize::from(STARTUP_MAX));
        let lines = [
            (0, "g54 g20"),
            (0, "G55"),
            (1, &*long),
            (0, ""),
            (1, "g21"),
            (0, "g20"),
            (0, &*long),
            (1, ""),
            (1, "g4 p1"),
            (0, "g4 p2"),
            (0, "g54g20"),
            (1, "g54g20"),
        ];
        for (n, text) in lines {
            let old = texts(&cells);
            let mut new = old.clone();
            new[usize::from(n)] = text.to_uppercase().replace(' ', "").into_bytes();
            let mut done = false;
            let cuts =
                (1..60).flat_map(|left| (0..=u8::MAX).step_by(5).map(move |torn| (left, torn)));
            for (left, torn) in cuts {
                // Until no power is missing.
                if torn == 0 && done {
                    break;
                }
                let mut cut = Cells { left, torn, ..cells.clone() };
                wait(&mut cut, |cells| put_startup(cells, n, text.as_bytes()));
                done = cut.left > 0;
                let is = texts(&cut);
                assert!(is == old || is == new, "{n} {text} {left} {torn}: {is:?}");
                cut.left = usize::MAX;
                // Both lines still have room.
                for n in [1 - n, n] {
                    wait(&mut cut, |cells| put_startup(cells, n, text.as_bytes()));
                }
                assert_eq!(texts(&cut)[usize::from(n)], new[usize::from(n)]);
                assert_eq!(texts(&cut)[0], texts(&cut)[1]);
            }
            wait(&mut cells, |cells| put_startup(cells, n, text.as_bytes()));
            assert_eq!(texts(&cells), new);
        }
        assert_eq!(put_startup(&mut cells, 1, &[b'x'; 41]), Stored::Full);
        assert_eq!(put_startup(&mut cells, 2, b"G0"), Stored::Full);
    }

    /// Firmware with two slots had no number in them, and a program had the room of the third one.
    #[test]
    fn start_up_lines_and_programs_of_earlier_firmware_are_read() {
        let mut cells = blank();
        for (n, text) in [(2, b"G54"), (1, b"G21")] {
            let at = SIZE - n * usize::from(STARTUP);
            cells.bytes[at] = 3;
            cells.bytes[at + 1..at + 3].copy_from_slice(&CRC.checksum(text).to_le_bytes());
            cells.bytes[at + 3..at + 6].copy_from_slice(text);
        }
        let text = "G0 X1 Y1 Z1\n".repeat(40);
        let at = SIZE - usize::from(AREA);
        cells.bytes[at] = VALID;
        cells.bytes[at + 1..at + 3].copy_from_slice(&(text.len() as u16).to_le_bytes());
        cells.bytes[at + 3..at + 5].copy_from_slice(&CRC.checksum(text.as_bytes()).to_le_bytes());
        cells.bytes[at + 5..][..text.len()].copy_from_slice(text.as_bytes());
        assert_eq!(texts(&cells), [b"G54".to_vec(), b"G21".to_vec()]);
        assert_eq!(stored(&cells), Some(text));
        wait(&mut cells, |cells| put_startup(cells, 0, b"G20"));
        assert_eq!(texts(&cells), [b"G20".to_vec(), b"G21".to_vec()]);
    }

    #[test]
    fn it_has_its_room() {
        let mut cells = blank();
        for _ in 0..2 {
            let Stored::Part(mut new) = wait(&mut cells, begin) else { panic!() };
            let mut lines = 0;
            while let Stored::Part(now) = wait(&mut cells, |cells| line(cells, new, &[b'x'; 39])) {
                (new, lines) = (now, lines + 1);
            }
            assert_eq!(lines, if Capability::Printer.is_built_in() { 13 } else { 18 });
            assert_eq!(wait(&mut cells, |cells| end(cells, new)), Stored::Done);
            assert_eq!(stored(&cells).map(|text| text.len()), Some(lines * 40));
        }
        for n in [0, 1, 0] {
            wait(&mut cells, |cells| put_startup(cells, n, &[b'x'; STARTUP_MAX as usize]));
        }
        assert!(stored(&cells).is_some());
        assert!(cells.bytes[..SIZE - usize::from(AREA)].iter().all(|byte| *byte == 0xFF));
    }
}
