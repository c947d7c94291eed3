//! One line, read but not yet carried out: its codes by modal group, its numbers by letter.
//!
//! The interpreter takes the numbers out as it uses them; whatever is left at the end belongs to
//! nothing on the line, which is refused. Lives on the stack for the time of one line.

use heapless::Vec;
use nom::Offset;

use super::codes::{self, Action, NonModal};
use super::command::Stop;
use super::lexer::{self, Item};
use super::modal::{Distance, FeedMode, MotionMode, PathMode, Plane, Units};
use super::number::Decimal;
use crate::status::Status;
use crate::units::AXES;

/// The words with a number that counts, axes first.
pub mod slot {
    /// I, of I J K.
    pub const I: u8 = 6;
    pub const R: u8 = 9;
    pub const P: u8 = 10;
    pub const F: u8 = 11;
    pub const N: u8 = 12;
    /// How many there are.
    pub const COUNT: usize = 13;
    /// No such word.
    pub const NONE: u8 = 255;

    /// X Y Z A B C, as bits.
    pub const AXES: u16 = 0x3F;
    /// I J K, as bits.
    pub const OFFSETS: u16 = 7 << I;
}

crate::progmem! {
    /// The slot of each letter, A to Z.
    static SLOT: [u8; 26] = {
        let mut table = [slot::NONE; 26];
        let letters = *b"XYZABCIJKRPFN";
        let mut i = 0;
        while i < slot::COUNT {
            table[(letters[i] - b'A') as usize] = i as u8;
            i += 1;
        }
        table
    };
    /// The bit of each slot: quicker than to shift one there.
    static BIT: [u16; slot::COUNT] = {
        let mut table = [0; slot::COUNT];
        let mut i = 0;
        while i < slot::COUNT {
            table[i] = 1 << i;
            i += 1;
        }
        table
    };
}

/// The parts of a line.
pub struct Block {
    pub non_modal: Option<NonModal>,
    pub motion: Option<MotionMode>,
    pub plane: Option<Plane>,
    pub distance: Option<Distance>,
    pub feed_mode: Option<FeedMode>,
    pub units: Option<Units>,
    pub path: Option<PathMode>,
    pub stop: Option<Stop>,
    /// `OnlyMode` bits.
    only: u8,
    /// Slots that are filled and not taken.
    present: u16,
    /// What was in them, in the order of the line.
    values: Vec<(u8, Decimal), { slot::COUNT }>,
    /// Begins with a slash: the rest was not looked at.
    pub deleted: bool,
    /// Where in the line the text of a message lies.
    pub message: Option<(u8, u8)>,
    /// Has a comment.
    pub commented: bool,
}

impl Block {
    /// An empty line.
    #[inline(always)]
    pub fn new() -> Self {
        Self {
            non_modal: None,
            motion: None,
            plane: None,
            distance: None,
            feed_mode: None,
            units: None,
            path: None,
            stop: None,
            only: 0,
            present: 0,
            values: Vec::new(),
            deleted: false,
            message: None,
            commented: false,
        }
    }

    /// Reads a line.
    pub fn read(&mut self, line: &[u8]) -> Result<(), Status> {
        if line.len() > u8::MAX as usize {
            return Err(Status::InputTooLong);
        }
        let (rest, _) = lexer::blanks(line).map_err(status)?;
        match rest.split_first() {
            Some((b'/', _)) => {
                self.deleted = true;
                return Ok(());
            }
            // The ends of a program file.
            Some((b'%', after)) if after.iter().all(|&byte| lexer::is_blank(byte)) => return Ok(()),
            _ => {}
        }
        self.items(line, rest)
    }

    /// Reads the items of a line, of which `rest` is the part to read.
    // By itself it has a small stack frame, which AVR reaches in one instruction; inlined into a frame
    // of more than 64 bytes every access would take five more.
    #[inline(never)]
    fn items(&mut self, line: &[u8], mut rest: &[u8]) -> Result<(), Status> {
        while !rest.is_empty() {
            let (after, item) = lexer::item(rest).map_err(status)?;
            match item {
                Item::Word(letter, value) => self.word(letter, value)?,
                Item::Comment(text) => self.comment(line, text),
            }
            rest = after;
        }
        Ok(())
    }

    fn word(&mut self, letter: u8, value: Decimal) -> Result<(), Status> {
        match letter {
            b'G' => {
                let code = value.code().and_then(|(whole, tenth)| codes::g(whole, tenth));
                self.code(code.ok_or(Status::GcodeUnsupported)?)
            }
            b'M' => {
                let code = value.code().and_then(|(whole, tenth)| codes::m(whole, tenth));
                self.code(code.ok_or(Status::McodeUnsupported)?)
            }
            _ => self.value(letter, value),
        }
    }

    fn code(&mut self, action: Action) -> Result<(), Status> {
        match action {
            Action::NonModal(code) => first(&mut self.non_modal, code),
            Action::Motion(mode) => first(&mut self.motion, mode),
            Action::Plane(plane) => first(&mut self.plane, plane),
            Action::Distance(mode) => first(&mut self.distance, mode),
            Action::FeedMode(mode) => first(&mut self.feed_mode, mode),
            Action::Units(units) => first(&mut self.units, units),
            Action::Path(mode) => first(&mut self.path, mode),
            Action::Stop(stop) => first(&mut self.stop, stop),
            Action::Only(mode) => {
                let seen = self.only & mode as u8 != 0;
                self.only |= mode as u8;
                if seen { Err(Status::ModalGroupViolation) } else { Ok(()) }
            }
        }
    }

    fn value(&mut self, letter: u8, value: Decimal) -> Result<(), Status> {
        let slot = SLOT.at(usize::from(letter.wrapping_sub(b'A'))).unwrap_or(slot::NONE);
        let bit = BIT.at(slot.into()).ok_or(Status::GcodeUnsupported)?;
        if self.present & bit != 0 {
            return Err(Status::GcodeGeneric);
        }
        self.present |= bit;
        // No slot twice, so there is room for all.
        self.values.push((slot, value)).map_err(|_| Status::InternalError)
    }

    fn comment(&mut self, line: &[u8], text: &[u8]) {
        self.commented = true;
        if let Some(text) = lexer::message(text) {
            let start = line.offset(text);
            // A line is at most 255 bytes long.
            self.message = Some((start as u8, (start + text.len()) as u8));
        }
    }

    /// Whether any of these slots (bits) is filled.
    pub fn has(&self, slots: u16) -> bool {
        self.present & slots != 0
    }

    /// The number in a slot, which is then used.
    pub fn take(&mut self, slot: u8) -> Option<Decimal> {
        let bit = BIT.at(slot.into())?;
        if self.present & bit == 0 {
            return None;
        }
        self.present &= !bit;
        self.values.iter().find(|word| word.0 == slot).map(|word| word.1)
    }

    /// The axes that the line names.
    pub fn axes(&self) -> impl Iterator<Item = u8> {
        self.values.iter().map(|word| word.0).filter(|slot| usize::from(*slot) < AXES)
    }

    /// All axis words, which are then used. Not for a line whose axes went to [`Self::take`].
    pub fn take_axes(&mut self) -> impl Iterator<Item = (u8, &Decimal)> {
        self.present &= !slot::AXES;
        let words = self.values.iter().map(|(slot, value)| (*slot, value));
        words.filter(|(slot, _)| usize::from(*slot) < AXES)
    }

    /// Refuses words that nothing on the line has used.
    pub fn finish(&self) -> Result<(), Status> {
        match self.present {
            0 => Ok(()),
            left if left & slot::AXES != 0 => Err(Status::AxisNotAllowed),
            _ => Err(Status::GcodeGeneric),
        }
    }
}

/// Fills a modal group, which takes one code per line.
fn first<T>(group: &mut Option<T>, code: T) -> Result<(), Status> {
    match group.replace(code) {
        None => Ok(()),
        Some(_) => Err(Status::ModalGroupViolation),
    }
}

fn status(error: nom::Err<lexer::Fault>) -> Status {
    match error {
        nom::Err::Error(fault) | nom::Err::Failure(fault) => fault.0,
        nom::Err::Incomplete(_) => Status::MalformedCommand,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<Block, Status> {
        let mut block = Block::new();
        block.read(line.as_bytes()).map(|()| block)
    }

    fn refusal(line: &str) -> Status {
        read(line).err().expect(line)
    }

    #[test]
    fn codes_go_to_their_groups() {
        let block = read("N5 G1 G17 G21 G40 G49 G54 G64 G90 G94 M2 X1").unwrap();
        assert_eq!(block.motion, Some(MotionMode::Feed));
        assert_eq!(block.stop, Some(Stop::End));
        assert!(block.has(slot::AXES) && !block.has(slot::OFFSETS));
    }

    #[test]
    fn one_code_of_each_group() {
        let twice = ["G0 G1", "G17 G19", "G20 G21", "G90 G91", "G93 G94", "G61 G61.1", "G4 G92"];
        for line in twice.iter().chain(&["M0 M30", "G40 G40", "G1 G1", "G80 G0"]) {
            assert_eq!(refusal(line), Status::ModalGroupViolation, "{line}");
        }
        assert_eq!(refusal("X1 Y2 X3"), Status::GcodeGeneric);
    }

    #[test]
    fn what_the_machine_does_not_have() {
        for line in ["G5", "G256", "G28", "G28.35", "G61.2", "G55", "G-1", "G41", "S100", "T1"] {
            assert_eq!(refusal(line), Status::GcodeUnsupported, "{line}");
        }
        for line in ["D1", "E1", "H1", "L1", "O1", "Q1", "U1", "V1", "W1"] {
            assert_eq!(refusal(line), Status::GcodeUnsupported, "{line}");
        }
        for line in ["M3", "M256", "M30.1", "M6"] {
            assert_eq!(refusal(line), Status::McodeUnsupported, "{line}");
        }
    }

    #[test]
    fn slash_percent_and_message() {
        assert!(read(" /G99 rubbish").unwrap().deleted);
        assert!(read(" % ").is_ok());
        assert_eq!(refusal("% G1"), Status::MalformedCommand);
        assert_eq!(read("G0 (MSG Hello) X1").unwrap().message, Some((7, 13)));
        assert_eq!(read(";msg,x").unwrap().message, Some((5, 6)));
        assert_eq!(refusal(&" ".repeat(256)), Status::InputTooLong);
    }
}
