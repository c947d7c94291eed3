//! A block: one line that has been read but not yet carried out. It has the codes by modal group, and the numbers by
//! letter.
//!
//! While a line is read, the block collects which words its codes take and need. With these sets [`Block::check`] can
//! refuse the line before anything is done. A block is on the stack for the time of one line.

use heapless::Vec;
use nom::Offset;

use super::codes::{self, Action, Code, NonModal, OverrideCode, StopCode, ToolLength};
use super::comment;
use super::decimal::Decimal;
use super::lexer::{self, Item};
use super::modal::{
    ArcDistance, Coolant, Distance, FeedMode, MotionMode, PathMode, Plane, Retract, SpeedMode,
    Turn, Units, XMode,
};
use super::words::{self, AXES};
use crate::capability::Capability;
use crate::status::Status;
use crate::units;

/// The most words with a number that a line may have. No combination of codes takes more words. The longest is an arc
/// with all axes, its offsets and P, together with G43, G96, F, S, T and N.
const MOST: usize = 16;

/// The parts of a line.
pub struct Block {
    pub non_modal: Option<NonModal>,
    motion: Option<MotionMode>,
    /// G80. It may stand beside another code of its group, because many programs begin with `G0 G80 G90`.
    cancel: Option<()>,
    pub plane: Option<Plane>,
    pub distance: Option<Distance>,
    pub arc_distance: Option<ArcDistance>,
    pub feed_mode: Option<FeedMode>,
    pub units: Option<Units>,
    cutter: Option<()>,
    pub tool_length: Option<ToolLength>,
    pub retract: Option<Retract>,
    pub speed_mode: Option<SpeedMode>,
    pub x_mode: Option<XMode>,
    pub system: Option<u8>,
    pub path: Option<PathMode>,
    pub stop: Option<StopCode>,
    tool_change: Option<()>,
    pub spindle: Option<Turn>,
    pub coolant: Option<Coolant>,
    pub overrides: Option<OverrideCode>,
    /// The words that the codes of the line take, as a set.
    taken: u32,
    /// The words that more than one code of the line takes, as a set.
    taken_twice: u32,
    /// The words that the codes of the line need, as a set.
    needed: u32,
    /// The motion that the line asks for. Set by [`Block::check`].
    does: Option<MotionMode>,
    /// The words that the line has, as a set.
    present: u32,
    /// The slots and numbers of the words, in the order of the line.
    values: Vec<(u8, Decimal), MOST>,
    /// Whether the line begins with a slash (block delete).
    pub slashed: bool,
    /// Whether the line begins with a percent sign. Text behind it that is no G-code is the name of a program.
    pub named: bool,
    /// Where in the line the text of a message lies.
    pub message: Option<(u8, u8)>,
    /// Whether the line has a comment.
    pub commented: bool,
}

impl Block {
    /// Returns an empty block.
    // Inlined, so that the block is built in its final place. Otherwise it would be copied there.
    #[inline(always)]
    pub fn new() -> Self {
        Self {
            non_modal: None,
            motion: None,
            cancel: None,
            plane: None,
            distance: None,
            arc_distance: None,
            feed_mode: None,
            units: None,
            cutter: None,
            tool_length: None,
            retract: None,
            speed_mode: None,
            x_mode: None,
            system: None,
            path: None,
            stop: None,
            tool_change: None,
            spindle: None,
            coolant: None,
            overrides: None,
            taken: 0,
            taken_twice: 0,
            needed: 0,
            does: None,
            present: 0,
            values: Vec::new(),
            slashed: false,
            named: false,
            message: None,
            commented: false,
        }
    }

    /// Reads a line into an empty block. If `deletes` is true, a line that begins with a slash is not read any further.
    // Not inlined, for the same reason as `items`.
    #[inline(never)]
    #[small]
    pub fn read(&mut self, line: &[u8], deletes: bool) -> Result<(), Status> {
        match self.begin(line, deletes)? {
            Some(rest) => self.items(line, rest),
            None => Ok(()),
        }
    }

    /// Reads what stands before the items of a line. Returns the part of the line that is still to be read; `None` if
    /// nothing is.
    #[inline(always)]
    pub fn begin<'a>(&mut self, line: &'a [u8], deletes: bool) -> Result<Option<&'a [u8]>, Status> {
        if line.len() > u8::MAX as usize {
            return Err(Status::InputTooLong);
        }
        let (rest, _) = lexer::blanks(line).map_err(status)?;
        let (mut rest, _) = lexer::blanks(comment::skip_mark(rest)).map_err(status)?;
        if let Some((&mark @ (b'/' | b'%'), after)) = rest.split_first() {
            self.slashed = mark == b'/';
            self.named = mark == b'%';
            if self.slashed && deletes {
                return Ok(None);
            }
            (rest, _) = lexer::blanks(after).map_err(status)?;
        }
        Ok(Some(rest))
    }

    /// Reads the items of a line. `rest` is the part of the line that is still to be read.
    // Not inlined: the function has a small stack frame of its own, which AVR accesses in one instruction. Inlined into
    // a frame of more than 64 bytes, every access would take five more instructions.
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

    /// Takes a word of the line.
    pub fn word(&mut self, letter: u8, value: Decimal) -> Result<(), Status> {
        match letter {
            b'G' | b'M' => {
                let is_g = letter == b'G';
                let find = |(whole, tenth)| match is_g {
                    true => codes::g(whole, tenth),
                    false => codes::m(whole, tenth),
                };
                let unknown =
                    if is_g { Status::GcodeUnsupported } else { Status::McodeUnsupported };
                self.code(&value.code().and_then(find).ok_or(unknown)?)
            }
            // The number of a program. O words of LinuxCNC go on with a keyword, which is no word.
            b'O' => Ok(()),
            _ => self.value(letter, value),
        }
    }

    #[inline(never)]
    fn code(&mut self, code: &Code) -> Result<(), Status> {
        self.taken_twice |= self.taken & code.takes;
        self.taken |= code.takes;
        self.needed |= code.needs;
        let is_first = match code.action {
            Action::NonModal(NonModal::Heat(_)) if !Capability::Printer.is_built_in() => {
                return Err(Status::NotBuiltIn);
            }
            Action::NonModal(code) => first(&mut self.non_modal, code),
            Action::Motion(mode) if !mode.is_built_in() => return Err(Status::NotBuiltIn),
            Action::Motion(MotionMode::None) => first(&mut self.cancel, ()),
            Action::Motion(mode) => first(&mut self.motion, mode),
            Action::Plane(plane) => first(&mut self.plane, plane),
            Action::Distance(mode) => first(&mut self.distance, mode),
            Action::ArcDistance(mode) => first(&mut self.arc_distance, mode),
            Action::FeedMode(mode) => first(&mut self.feed_mode, mode),
            Action::Units(units) => first(&mut self.units, units),
            Action::CutterOff => first(&mut self.cutter, ()),
            Action::CutterOn => return Err(Status::CutterCompensation),
            Action::ToolLength(code) => first(&mut self.tool_length, code),
            Action::Retract(mode) => first(&mut self.retract, mode),
            Action::SpeedMode(_) | Action::XMode(_) if !Capability::Lathe.is_built_in() => {
                return Err(Status::NotBuiltIn);
            }
            Action::SpeedMode(mode) => first(&mut self.speed_mode, mode),
            Action::XMode(mode) => first(&mut self.x_mode, mode),
            Action::System(number) => first(&mut self.system, number),
            Action::Path(mode) => first(&mut self.path, mode),
            Action::Stop(stop) => first(&mut self.stop, stop),
            Action::ToolChange => first(&mut self.tool_change, ()),
            Action::Spindle(turn) => first(&mut self.spindle, turn),
            Action::Coolant(coolant) => first(&mut self.coolant, coolant),
            Action::Override(code) => first(&mut self.overrides, code),
        };
        if is_first { Ok(()) } else { Err(Status::ModalGroupViolation) }
    }

    fn value(&mut self, letter: u8, value: Decimal) -> Result<(), Status> {
        let slot = words::slot_of(letter).ok_or(Status::GcodeUnsupported)?;
        let bit = words::bit_of(slot);
        if self.present & bit != 0 {
            return Err(Status::WordRepeated);
        }
        self.present |= bit;
        // A line with more words than [`MOST`] has at least one that no code takes.
        self.values.push((slot, value)).map_err(|_| Status::WordUnused)
    }

    /// Takes a comment of the line.
    pub fn comment(&mut self, line: &[u8], text: &[u8]) {
        self.commented = true;
        if let Some(text) = lexer::message(text) {
            let start = line.offset(text);
            // A line is at most 255 bytes long.
            self.message = Some((start as u8, (start + text.len()) as u8));
        }
    }

    /// Whether the line has any word of a set.
    pub fn has(&self, set: u32) -> bool {
        self.present & set != 0
    }

    /// Returns the number in a slot that most lines do not use. `None` if the line does not have the word. Fast if the
    /// slot is a constant.
    #[inline(always)]
    pub fn rare(&self, slot: u8) -> Option<&Decimal> {
        if self.has(words::bit(slot)) { self.get(slot) } else { None }
    }

    /// Returns the number in a slot. `None` if the line does not have the word.
    #[inline(never)]
    #[small]
    pub fn get(&self, slot: u8) -> Option<&Decimal> {
        self.values.iter().find(|word| word.0 == slot).map(|word| &word.1)
    }

    /// Converts the word in a slot from a diameter to a radius.
    #[inline(never)]
    #[small]
    pub fn halve(&mut self, slot: u8) {
        if let Some((_, value)) = self.values.iter_mut().find(|word| word.0 == slot) {
            *value = value.half();
        }
    }

    /// Returns the axis words, in the order of the line.
    pub fn axes(&self) -> impl Iterator<Item = (u8, &Decimal)> {
        let words = self.values.iter().map(|(slot, value)| (*slot, value));
        words.filter(|(slot, _)| usize::from(*slot) < units::AXES)
    }

    /// Whether the line has one of M104 to M190. Its S and T are then no spindle speed and no tool.
    pub fn heats(&self) -> bool {
        Capability::Printer.is_built_in() && matches!(self.non_modal, Some(NonModal::Heat(_)))
    }

    /// Whether the line has M6.
    pub fn changes_tool(&self) -> bool {
        self.tool_change.is_some()
    }

    /// Whether the line may change more than modes, the feed, and the position of the axes that it names.
    pub fn is_rare(&self) -> bool {
        self.non_modal.is_some()
            || self.tool_length.is_some()
            || self.system.is_some()
            || self.stop.is_some()
            || self.overrides.is_some()
            || self.tool_change.is_some()
            || self.speed_mode.is_some()
            || self.has(words::bit(words::S) | words::bit(words::T))
    }

    /// Whether the line has G80.
    pub fn cancels(&self) -> bool {
        self.cancel.is_some()
    }

    /// Returns the motion code of the line. Any other motion code takes precedence over G80.
    pub fn own_motion(&self) -> Option<MotionMode> {
        self.motion.or(self.cancel.map(|()| MotionMode::None))
    }

    /// Returns the motion that the line asks for, after [`Block::check`]: the motion of its own code, otherwise the
    /// motion in force if words are left for it, otherwise `None`.
    pub fn does(&self) -> Option<MotionMode> {
        self.does
    }

    /// Refuses words that no code takes, words that two codes take, and codes without the words that they need. `modal`
    /// is the motion in force.
    #[inline(never)]
    pub fn check(&mut self, modal: MotionMode) -> Result<(), Status> {
        self.does = self.own_motion();
        let mut twice = self.present & self.taken_twice;
        let mut unused = self.present & !(self.taken | words::ALWAYS);
        // The remaining words belong to the motion in force, unless the line has a motion code or another code takes
        // its axes.
        if self.does.is_none() && self.taken & AXES == 0 {
            let takes = codes::taken_by(modal);
            if unused & takes != 0 {
                self.does = Some(modal);
                twice |= self.present & self.taken & takes;
            }
            unused &= !takes;
        }
        match self.needed & !self.present {
            0 if twice | unused == 0 => Ok(()),
            missing => self.refusal(twice, unused, missing).map_or(Ok(()), Err),
        }
    }

    /// Returns the status with which the line is refused for these words. `None` if it is accepted.
    #[inline(never)]
    fn refusal(&self, twice: u32, unused: u32, missing: u32) -> Option<Status> {
        match () {
            () if twice & AXES != 0 => Some(Status::AxisConflict),
            () if twice != 0 => Some(Status::WordConflict),
            () if unused & AXES != 0 => Some(Status::AxisNotAllowed),
            () if unused != 0 => Some(Status::WordUnused),
            () if missing & !AXES != 0 => Some(words::missing(missing & !AXES)),
            () if missing != 0 && !self.has(AXES) => Some(Status::AxisWordMissing),
            () => None,
        }
    }
}

/// Stores a code in its modal group. Returns false if the line already had a code of this group.
fn first<T>(group: &mut Option<T>, code: T) -> bool {
    group.replace(code).is_none()
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
        block.read(line.as_bytes(), true).map(|()| block)
    }

    fn refusal(line: &str) -> Status {
        read(line).err().expect(line)
    }

    fn check(line: &str, modal: MotionMode) -> Result<(), Status> {
        read(line).and_then(|mut block| block.check(modal))
    }

    #[test]
    fn codes_go_to_their_groups() {
        let block = read("N5 G1 G17 G21 G40 G49 G54 G64 G90 G94 G98 M2 M3 M6 M7 M48 X1").unwrap();
        assert_eq!(block.motion, Some(MotionMode::Feed));
        assert_eq!(block.stop, Some(StopCode::End));
        assert!(block.has(AXES) && !block.has(words::OFFSETS) && block.changes_tool());
    }

    #[test]
    fn one_code_of_each_group() {
        let twice =
            ["G0 G1", "G80 G80", "G17 G19", "G20 G21", "G90 G91", "G93 G94", "G61 G61.1", "G4 G92"];
        let more = ["M0 M30", "G40 G40", "G1 G1", "G54 G59.3", "G98 G99", "M3 M5"];
        let last = ["M7 M9", "M6 M6", "M48 M50", "G43 G49", "G90.1 G91.1", "G38.2 G81", "G53 G10"];
        for line in twice.iter().chain(&more).chain(&last) {
            assert_eq!(refusal(line), Status::ModalGroupViolation, "{line}");
        }
        assert_eq!(refusal("X1 Y2 X3"), Status::WordRepeated);
    }

    #[test]
    fn what_the_machine_does_not_have() {
        for line in ["G5", "G256", "G28.35", "G61.2", "G59.4", "G-1", "U1", "V1"] {
            assert_eq!(refusal(line), Status::GcodeUnsupported, "{line}");
        }
        for line in ["M10", "M256", "M30.1", "M3.1"] {
            assert_eq!(refusal(line), Status::McodeUnsupported, "{line}");
        }
        assert_eq!(refusal("G41 D1"), Status::CutterCompensation);
    }

    #[test]
    fn words_belong_to_codes() {
        use MotionMode::{ClockwiseArc, Feed, None};
        for (line, modal, status) in [
            ("X1", None, Status::AxisNotAllowed),
            ("G80 X1", Feed, Status::AxisNotAllowed),
            ("G0 I1", Feed, Status::WordUnused),
            ("P1", Feed, Status::WordUnused),
            ("G92 X1 G1", Feed, Status::AxisConflict),
            ("G4 P1 G82 R1", Feed, Status::WordConflict),
            ("G4 P1 X1 R1", ClockwiseArc, Status::WordConflict),
            ("M50 P1 X1", MotionMode::DrillDwell, Status::WordConflict),
            ("G4", Feed, Status::PWordMissing),
            ("G10 P1 X1", Feed, Status::LWordMissing),
            ("G10 L2 X1", Feed, Status::PWordMissing),
            ("G10 L2 P1", Feed, Status::AxisWordMissing),
            ("G43.2", Feed, Status::HWordMissing),
            ("M48.1", Feed, Status::PWordMissing),
        ] {
            assert_eq!(check(line, modal), Err(status), "{line}");
        }
        for (line, modal) in [("I1", ClockwiseArc), ("G92 X1", Feed), ("G4 P1 X1", Feed)] {
            assert_eq!(check(line, modal), Ok(()), "{line}");
        }
        for line in ["G4 P1", "G4 P1 G0 X1", "G64 P1 G92 X1", "G64 X1 R1"] {
            assert_eq!(check(line, ClockwiseArc), Ok(()), "{line}");
        }
        let moves = |line, modal| {
            let mut block = read(line).unwrap();
            block.check(modal).unwrap();
            block.does()
        };
        assert_eq!(moves("G4 P1", ClockwiseArc), Option::None);
        assert_eq!(moves("G4 P1 X1", Feed), Some(Feed));
        assert_eq!(moves("G92 X1", Feed), Option::None);
        assert_eq!(moves("F100", Feed), Option::None);
        assert_eq!(moves("G0", Feed), Some(MotionMode::Traverse));
        assert_eq!(moves("G80", Feed), Some(None));
        assert_eq!(moves("G80 G0 X1", Feed), Some(MotionMode::Traverse));
    }

    #[test]
    fn slash_percent_and_message() {
        assert!(read(" /G99 rubbish").unwrap().slashed);
        let mut block = Block::new();
        assert_eq!(block.read(b" / G1 X1", false), Ok(()));
        assert!(block.slashed && block.has(AXES));
        assert!(read(" % ").is_ok());
        assert_eq!(read("G0 (MSG Hello) X1").unwrap().message, Some((7, 13)));
        assert_eq!(read(";msg,x").unwrap().message, Some((5, 6)));
        assert_eq!(refusal(&" ".repeat(256)), Status::InputTooLong);
    }
}
