//! Text mode: lists settings and values, one per line.
//!
//! ```text
//! [xvm] x velocity maximum        800 mm/min
//! [1po] m1 polarity                 0 [0=normal,1=reverse]
//! ```
//!
//! The last digit of the integer part, or the first letter of a text, is in column 35. Values that are not settings
//! are shown as in the status report.

use super::place::Place;
use super::request::{Context, Phase, Request};
use super::screen::Label;
use super::token::{Group, Shown, Token};
use super::write::Writer;
use crate::config::table::{MODE, RADIUS};
use crate::config::{Fixed, Owner, Setting, Words};
use crate::gcode::tables::TableRow;
use crate::progmem;
use crate::progmem::Text;
use crate::protocol::{Machine, Out, Span};
use crate::text;

/// The number of parts of a line. Each step writes one part.
const PARTS: u8 = 3;
/// The column at which descriptions begin.
const TITLE_START: usize = 6;
/// The column at which the integer part of a number ends.
const UNITS_END: usize = 35;
/// In the group `p1`, numbers without decimals end this much further right, below the decimals of the others.
const PWM_SHIFT: usize = 4;

progmem! {
    static MODES: [Text; 4] = [
        text!(" [disabled]"),
        text!(" [standard]"),
        text!(" [inhibited]"),
        text!(" [radius]"),
    ];
}

/// A range of groups that are listed in a row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Series {
    first: u8,
    end: u8,
}

#[small]
impl Series {
    /// Returns the groups that a letter stands for; `None` for other letters. `m`: motors. `q`: axes. `$`: settings,
    /// coordinate systems, G92, stored positions. `o`: coordinate systems, G92, stored positions, work offset, tool
    /// length.
    pub fn of_letter(letter: u8) -> Option<Series> {
        let (first, end) = match letter {
            b'$' => (0, 27),
            b'm' => (1, 5),
            b'q' => (5, 11),
            b'o' => (15, 29),
            _ => return None,
        };
        Some(Series { first, end })
    }

    /// Returns the group with that number.
    fn group(number: u8) -> Group {
        match number {
            0 => Group::Settings(Owner::System),
            1..5 => Group::Settings(Owner::Motor(number - 1)),
            5..11 => Group::Settings(Owner::Axis(number - 5)),
            11 => Group::Settings(Owner::Pwm),
            12 => Group::Settings(Owner::Spindle),
            13 => Group::Settings(Owner::Coolant),
            14 => Group::Settings(Owner::Squaring),
            15..24 => Group::TableRow(TableRow::system(number - 15)),
            24 => Group::SHIFT,
            25 | 26 => Group::TableRow(TableRow::stored(number - 25)),
            27 => Group::OFFSETS,
            _ => Group::TOOL_OFFSETS,
        }
    }
}

#[small]
impl Request {
    /// Starts to list a group, or the groups of a series.
    pub(super) fn enlist(&mut self, group: Option<Group>, series: Option<Series>) {
        self.group = group;
        self.item = 0;
        self.block = series.map_or(Span::default(), |s| Span { start: s.first, end: s.end });
        self.phase = Phase::Listing;
    }

    /// Writes a part of one line of a group.
    pub(super) fn listing<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let member = self.group.and_then(|group| group.member(self.item / PARTS, c.machine));
        let Some((index, token)) = member else { return self.next_group() };
        c.machine.moment(self.item == 0);
        let part = self.item % PARTS;
        self.item = index * PARTS + part + 1;
        put_part(token, part, c.machine, &mut Writer::body(c.out, &mut self.format));
    }

    fn next_group(&mut self) {
        self.item = 0;
        self.group = None;
        if self.block.start < self.block.end {
            self.group = Some(Series::group(self.block.start));
            self.block.start += 1;
        } else {
            self.block = Span::default();
            self.phase = Phase::Prompt;
        }
    }
}

/// Writes a part of a token's line: its title, its value, or its unit.
#[inline(never)]
#[small]
fn put_part<M: Machine, O: Out>(
    token: Token,
    part: u8,
    machine: &mut M,
    writer: &mut Writer<'_, O>,
) {
    if let Some(place) = Place::of(token) {
        return match part {
            0 => place.title(writer),
            1 => put_number(place.value(machine), UNITS_END - place.title_end(), writer),
            _ => place.unit(machine, writer),
        };
    }
    let setting = token.setting();
    match (setting.and_then(|setting| Some((setting, setting.words()?))), part) {
        (None, 0) => Label::of(token).write(token, writer),
        (None, 1) => Label::of(token).value(token, machine, writer),
        (None, _) => {}
        (Some((setting, words)), 0) => put_title(setting, &words, writer),
        (Some((setting, words)), 1) => {
            put_value(setting, &words, token.read(machine), machine, writer);
        }
        (Some((setting, words)), _) => put_tail(setting, &words, machine, writer),
    }
}

/// Returns the column at which the description of a setting starts, behind its name in brackets.
#[small]
fn title_start(setting: Setting) -> usize {
    TITLE_START.max(setting.name().bytes().len() + 3)
}

/// Returns the length of the owner's name in a description, as in `m1 ` or `x `.
#[small]
fn owner_len(setting: Setting) -> usize {
    match setting.owner() {
        Owner::Motor(_) => 3,
        Owner::Axis(_) => 2,
        _ => 0,
    }
}

#[small]
fn put_title<O: Out>(setting: Setting, words: &Words, writer: &mut Writer<'_, O>) {
    let name = setting.name();
    writer.byte(b'[');
    writer.lower(name.bytes());
    writer.byte(b']');
    writer.blanks(title_start(setting) - name.bytes().len() - 2);
    if let Owner::Motor(_) = setting.owner() {
        writer.byte(b'm');
    }
    if matches!(setting.owner(), Owner::Motor(_) | Owner::Axis(_)) {
        writer.byte(name.first());
        writer.byte(b' ');
    }
    writer.text(words.title);
}

/// Writes the value of a setting in its column.
#[small]
fn put_value<M: Machine, O: Out>(
    setting: Setting,
    words: &Words,
    shown: Shown,
    machine: &mut M,
    writer: &mut Writer<'_, O>,
) {
    let column = title_start(setting) + owner_len(setting) + words.title.len();
    let width = UNITS_END.saturating_sub(column);
    match (shown, words.decimals) {
        (Shown::Text(text), _) => {
            writer.blanks(width.saturating_sub(1));
            writer.text(text);
        }
        (Shown::Data(bits), _) => {
            writer.blanks(width.saturating_sub(1));
            writer.bits(bits);
        }
        (Shown::Number(fixed), None) if setting.owner() == Owner::Pwm && fixed.decimals == 0 => {
            put_number(fixed, width + PWM_SHIFT, writer);
        }
        (Shown::Number(fixed), None) => put_number(fixed, width, writer),
        (Shown::Number(_), Some(decimals)) => {
            let (inches, value) = (machine.inches(), machine.setting(setting));
            let fixed = machine.settings().show_as(setting, value, inches, decimals);
            put_number(fixed.padded(decimals), width, writer);
        }
    }
}

#[small]
fn put_number<O: Out>(fixed: Fixed, width: usize, writer: &mut Writer<'_, O>) {
    let decimals = usize::from(fixed.decimals);
    writer.aligned(fixed, width + decimals + usize::from(decimals > 0));
}

/// Writes the unit of a setting, or its choices.
#[small]
fn put_tail<M: Machine, O: Out>(
    setting: Setting,
    words: &Words,
    machine: &mut M,
    writer: &mut Writer<'_, O>,
) {
    let row = setting.row();
    if words.length {
        let is_length = machine.settings().shows_length(setting);
        writer.text(match (is_length, machine.inches()) {
            (true, true) => text!(" in"),
            (true, false) if !row.is(RADIUS) => text!(" mm"),
            // A radius is shown in degrees too, as TinyG's senders expect.
            _ => text!(" deg"),
        });
    }
    if row.is(MODE) {
        let mode = machine.settings().get(setting) as usize;
        writer.text(MODES.at(mode).unwrap_or(text!("")));
    }
    writer.text(words.tail);
    writer.end_line();
}
