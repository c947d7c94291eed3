//! What a response reports of its G-code block: the block itself, its message, its line number.

use super::Format;
use super::request::{Context, Phase, Request};
use super::variation::Variation;
use super::wrapped::pass_on;
use super::write::Writer;
use crate::config::{Fixed, Settings};
use crate::gcode::comment;
use crate::protocol::{Ending, Machine, Out, Value};
use crate::status::Status;
use crate::{plain, progmem, text};

/// The verbosity from which each part is shown.
const FRAMES: u8 = 1;
const LINE_NUMBERS: u8 = 4;
const BLOCKS: u8 = 5;

/// One more than the highest line number.
const LINE_NUMBER_END: i32 = 1 << 24;

/// Whether the response to a block without a comment, in JSON mode, is the frame alone. `numbered`: whether the block
/// has a line number.
pub fn is_brief(settings: &Settings, numbered: bool) -> bool {
    match settings.json_verbosity() {
        FRAMES..LINE_NUMBERS => true,
        LINE_NUMBERS..BLOCKS => !numbered,
        _ => false,
    }
}

/// Writes the response to a block that has run, where the response is the frame alone.
pub fn put_brief(settings: &Settings, ending: Ending, out: &mut impl Out) {
    if Variation::of(settings) != Variation::Lines || settings.expand_line_feeds() {
        return put_other(settings, ending, out);
    }
    // The number of free line slots has one digit.
    let free = ending.free % 10;
    if settings.json_strict() {
        return out.put_plain(BRIEF.plain().behind(free * BRIEF_LEN).first(BRIEF_LEN));
    }
    out.put_plain(plain!("{r:{},f:[1,0,"));
    out.put(b'0' + free);
    out.put_plain(plain!("]}\n"));
}

/// The response with an empty body.
const BRIEF_0: [u8; BRIEF_LEN as usize] = *b"{\"r\":{},\"f\":[1,0,0]}\n";
const BRIEF_LEN: u8 = 21;

progmem! {
    /// [`BRIEF_0`] ten times, with 0 to 9 free lines, so that an answer is a single copy.
    static BRIEF: [u8; 10 * BRIEF_LEN as usize] = {
        let (mut all, mut at) = ([0; 10 * BRIEF_LEN as usize], 0);
        while at < all.len() {
            let (free, byte) = (at / BRIEF_0.len(), at % BRIEF_0.len());
            all[at] = BRIEF_0[byte];
            if byte == BRIEF_0.len() - 4 {
                all[at] += free as u8;
            }
            at += 1;
        }
        all
    };
}

/// As [`put_brief`], for the variations that do not count lines, and for `ec` 1.
#[inline(never)]
fn put_other(settings: &Settings, ending: Ending, out: &mut impl Out) {
    Writer::frame(out, &mut Format::json(settings)).empty_response(Status::Ok, ending);
}

impl Request {
    fn is_brief<M: Machine, O>(&self, c: &mut Context<'_, M, O>) -> bool {
        let quiet = is_brief(c.machine.settings(), true)
            || (is_brief(c.machine.settings(), false) && self.line_number(c) == 0);
        quiet && !self.begun && !self.is_json && !self.commented
    }

    /// Returns the block's line number; 0 for none. If the block was refused, the machine does not know its number,
    /// so it is read from the line.
    fn line_number<M: Machine, O>(&self, c: &mut Context<'_, M, O>) -> i32 {
        match self.status {
            Status::Ok => c.machine.value(Value::BlockLine),
            _ => leading_number(self.block.of(c.line)),
        }
    }

    /// Writes the whole response in one step, if it is the frame alone. This holds for most lines. Returns whether it
    /// did.
    pub(super) fn brief<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) -> bool {
        let brief = self.is_brief(c);
        if brief {
            let ending = self.ending(c.machine);
            let mut format = Format::json(c.machine.settings());
            Writer::frame(c.out, &mut format).empty_response(self.status, ending);
            self.phase = Phase::Done;
        }
        brief
    }

    pub(super) fn block<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if self.brief(c) {
            return;
        }
        self.open(c);
        self.unwrap_block(c);
        self.phase = Phase::Message;
        if self.verbosity >= BLOCKS {
            let mut writer = Writer::message(c.out, &mut self.format);
            writer.key_text(text!("gc"));
            writer.byte(b'"');
            self.item = self.block.start;
            self.phase = Phase::BlockText;
        }
    }

    /// Writes the block as the interpreter reads it: in upper case, without blanks and comments.
    pub(super) fn block_text<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let mut writer = Writer::message(c.out, &mut self.format);
        for _ in 0..super::CHUNK / 2 {
            match byte_of(c.line, self.item, self.block.end) {
                None | Some(b'(' | b';') => {
                    writer.byte(b'"');
                    self.phase = Phase::Message;
                    return;
                }
                Some(byte) if byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'.') => {
                    writer.byte(byte.to_ascii_uppercase());
                }
                Some(_) => {}
            }
            self.item = self.item.saturating_add(1);
        }
    }

    pub(super) fn message<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        self.phase = Phase::Number;
        #[cfg(feature = "language")]
        if self.begin_said(c) {
            return;
        }
        let Some(start) = message_start(c.line, self.block.start, self.block.end) else {
            return;
        };
        self.item = start;
        let text = c.line.get(start.into()..self.block.end.into()).unwrap_or(&[]);
        self.block.end = start + comment::length(text) as u8;
        self.phase = Phase::MessageText;
        if !self.format.is_plain() {
            let mut writer = Writer::message(c.out, &mut self.format);
            writer.key_text(text!("msg"));
            writer.byte(b'"');
        }
    }

    /// Begins to write what the block tells. Returns false if it tells nothing.
    #[cfg(feature = "language")]
    fn begin_said<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) -> bool {
        let tells = self.status == Status::Ok && c.machine.said(0).is_some();
        if tells {
            (self.item, self.phase) = (0, Phase::Said);
            if !self.format.is_plain() {
                let mut writer = Writer::message(c.out, &mut self.format);
                writer.key_text(text!("msg"));
                writer.byte(b'"');
            }
        }
        tells
    }

    /// Writes what the block tells.
    #[cfg(feature = "language")]
    pub(super) fn said<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let plain = self.format.is_plain();
        for _ in 0..super::CHUNK / 2 {
            let byte = c.machine.said(self.item);
            let mut writer = Writer::message(c.out, &mut self.format);
            match byte {
                Some(byte) if plain => writer.printable(byte),
                Some(byte) => writer.escaped(byte),
                None => {
                    if !plain {
                        writer.byte(b'"');
                    }
                    c.machine.hush();
                    self.phase = Phase::Number;
                    return;
                }
            }
            self.item += 1;
        }
    }

    pub(super) fn message_text<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let plain = self.format.is_plain();
        let mut writer = Writer::message(c.out, &mut self.format);
        for _ in 0..super::CHUNK / 2 {
            match byte_of(c.line, self.item, self.block.end) {
                None => {
                    if !plain {
                        writer.byte(b'"');
                    }
                    self.phase = Phase::Number;
                    return;
                }
                Some(byte) if plain => writer.printable(byte),
                Some(_) if self.is_json => {
                    self.item += pass_on(c.line, self.item, self.block.end, &mut writer);
                    continue;
                }
                Some(byte) => writer.escaped(byte),
            }
            self.item = self.item.saturating_add(1);
        }
    }

    pub(super) fn number<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if self.format.is_plain() {
            let mut writer = Writer::message(c.out, &mut self.format);
            writer.text(self.remark.text());
            writer.end_line();
            self.phase = Phase::Done;
            return;
        }
        let line = self.line_number(c);
        if self.verbosity >= LINE_NUMBERS && line != 0 {
            let mut writer = Writer::message(c.out, &mut self.format);
            writer.key_text(text!("n"));
            writer.fixed(Fixed::int(line));
        }
        let on = self.is_json && self.status == Status::Ok;
        self.phase = if on { Phase::Pair } else { Phase::Warning };
    }
}

/// Returns the number of the N word that a block begins with; 0 if there is none or it is not a valid line number.
#[inline(never)]
#[small]
fn leading_number(block: &[u8]) -> i32 {
    let mut number = -1;
    for byte in block {
        match byte {
            // A byte order mark and a percent sign may stand before it.
            b' ' | b'\t' | b'/' | b'%' | 0x80.. => {}
            b'N' | b'n' if number < 0 => number = 0,
            // A higher number is not a line number, and more digits would overflow.
            b'0'..=b'9' if (0..LINE_NUMBER_END).contains(&number) => {
                number = number * 10 + i32::from(byte - b'0');
            }
            b'0'..=b'9' | b'.' => return 0,
            _ => break,
        }
    }
    number.max(0)
}

/// Returns byte `at` of the line; `None` from `end` on.
#[inline(never)]
#[small]
pub(super) fn byte_of(line: &[u8], at: u8, end: u8) -> Option<u8> {
    line.get(usize::from(at)).copied().filter(|_| at < end)
}

/// Returns where the message of a comment `(MSG text)` begins; `None` if there is none.
fn message_start(line: &[u8], start: u8, end: u8) -> Option<u8> {
    let byte = |at| byte_of(line, at, end);
    let mut at = (start..end).find(|&at| matches!(byte(at), Some(b'(' | b';')))? + 1;
    while byte(at).is_some_and(|b| matches!(b, b' ' | b'\t')) {
        at += 1;
    }
    for letter in [b'M', b'S', b'G'] {
        if !byte(at)?.eq_ignore_ascii_case(&letter) {
            return None;
        }
        at += 1;
    }
    Some(at)
}
