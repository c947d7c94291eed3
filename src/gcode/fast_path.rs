//! The fast path: a line of the usual kind, read and carried out in one pass: axis words, with G0 or G1, F and N, while lengths
//! are in millimetres.
//!
//! [`Interpreter::interpret`](super::Interpreter::interpret) asks here first. Any other line is declined before anything has changed,
//! and goes through `lexer`, `block` and `motion`, which say what is wrong with it, too. The result is
//! theirs to the bit: a property of `tests` holds the two against each other.
//!
//! Of a printing host lines have E for A, with five decimals, and G0 is G1: that is [`Writer::Prints`].
//!
//! Cost on AVR: `X10.375` 1,250 cycles, `G1 X12.345 Y-3.21 F1500` 3,300 (`tests/sim/tests/interpreter.rs`).

use super::command::{Commands, Feed, Motion};
use super::decimal::{Decimal, Exact};
use super::digits::decimal;
use super::limits::is_near;
use super::modal::{Distance, FeedMode, MotionMode, PathMode, Units, XMode};
use super::printing::EXTRUDER;
use super::setup::{AxisMode, Setup};
use super::state::State;
use crate::capability::Capability;
use crate::hal::arithmetic::product;
use crate::hal::text::Cursor;
use crate::units::{AXES, FIRST_ROTARY, Length, PerAxis};

/// What tells upper from lower case.
const CASE: u8 = 0x20;
/// Whether there is a dialect of printing hosts.
const PRINTS: bool = cfg!(feature = "dialect-reprap");
/// What no line has where a word may begin: reading ends there.
const BAD: u8 = 0x7F;
/// Words that were seen: an axis has the bit of its number, N and F have these. G is in `mode`.
const AXES_SEEN: u8 = (1 << AXES) - 1;
const N_SEEN: u8 = 1 << 6;
const F_SEEN: u8 = 1 << 7;

/// Who has written a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Writer {
    /// It may have an N word.
    Numbers,
    /// It may not.
    Plain,
    /// A printing host, and there is no N word either.
    Prints,
}

/// A line that is being read, and what it has said so far.
struct Words<'a> {
    /// Where in the line reading is.
    at: Cursor<'a>,
    text: &'a [u8],
    seen: u8,
    mode: Option<MotionMode>,
    feed: f32,
    line: u32,
    /// A printing host has written it.
    prints: bool,
    /// Of a relative E word: what rounding took from those before.
    carried: Option<i16>,
    /// What rounding takes from the E word.
    rest: i16,
}

impl State {
    /// Carries a line out by the fast path: with [`Interpreter::interpret`](super::Interpreter::interpret) it would be `Ok`,
    /// without a comment, and a move. If it is none: false, and nothing done, but the motion in `out` may have changed. A line of a printing host
    /// is one that is written for the interpreter already but for E and G0.
    #[inline(never)]
    pub fn fast_path(
        &mut self,
        line: &[u8],
        writer: Writer,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> bool {
        let modal = &self.modal;
        let prints = PRINTS && writer == Writer::Prints;
        // Most of the others end in a comment.
        if line.last() == Some(&b')') {
            return false;
        }
        if modal.units != Units::Mm
            || modal.feed_mode != FeedMode::PerMinute
            || setup.reach().is_some() && !self.reaches(setup)
            || !self.printing.flows_as_programmed()
            || !prints && self.printing.distance().is_some()
            || Capability::Lathe.is_built_in() && modal.x_mode == XMode::Diameter
            || line.len() > usize::from(u8::MAX)
        {
            return false;
        }
        let mut words = Words::new(line, writer == Writer::Numbers);
        let own;
        let from = match modal.distance {
            Distance::Absolute if prints && self.printing.distance().is_some() => {
                own = self.with_own_extruder();
                &own
            }
            _ if prints && self.printing.distance().is_some() => return false,
            Distance::Absolute => &self.origin,
            Distance::Incremental if self.residue.iter().all(|rest| *rest == 0) => &self.position,
            // What rounding has taken would have to be carried on.
            Distance::Incremental => return false,
        };
        if prints {
            if self.is_far() {
                return false;
            }
            words.prints = true;
            let relative = self.printing.distance().unwrap_or(modal.distance);
            words.carried = match (relative, self.residue.get(EXTRUDER)) {
                (Distance::Incremental, Some(rest)) => Some(*rest),
                _ => None,
            };
        }
        let Some(target) = target_of(&mut out.motion) else { return false };
        words.read(from, target)
            && are_usual(words.seen & AXES_SEEN, setup)
            && (!Capability::CoreXy.is_built_in()
                || setup.reach().is_none()
                || is_near(target, setup))
            && !(Capability::Printer.is_built_in()
                && words.seen & 1 << EXTRUDER != 0
                && setup.extrudes().is_err())
            && self.carry_out(&words, out)
    }

    /// Whether all that a line from here has to be asked is where it ends, for steps to be counted: so it is on a CoreXY machine, where
    /// nothing else bounds them. Fine motors are left to the others.
    #[inline(always)]
    fn reaches(&self, setup: &impl Setup) -> bool {
        Capability::CoreXy.is_built_in() && is_near(&self.position, setup)
    }

    /// What words are measured from, those of the extruder from where it is.
    #[inline(never)]
    fn with_own_extruder(&self) -> PerAxis<Length> {
        let mut from = self.origin;
        if let (Some(from), Some(at)) = (from.get_mut(EXTRUDER), self.position.get(EXTRUDER)) {
            *from = *at;
        }
        from
    }

    #[inline(never)]
    fn carry_out(&mut self, words: &Words, out: &mut Commands) -> bool {
        let Motion::Feed { target, feed: per_minute } = &mut out.motion else { return false };
        let mode = words.mode.unwrap_or(self.modal.motion);
        let (feed, units) = match words.seen & F_SEEN {
            0 => (self.feed, self.feed_units),
            _ => (words.feed, Units::Mm),
        };
        match mode {
            MotionMode::Traverse => {}
            MotionMode::Feed if feed.to_bits() != 0 && units == Units::Mm => {}
            _ => return false,
        }
        // From here on nothing fails.
        self.modal.motion = mode;
        (self.feed, self.feed_units) = (feed, units);
        self.line = words.line;
        self.go(words.seen & AXES_SEEN, target);
        *per_minute = Feed::PerMinute(feed);
        if PRINTS
            && words.rest != 0
            && let Some(residue) = self.residue.get_mut(EXTRUDER)
        {
            *residue = words.rest;
        }
        if mode == MotionMode::Traverse {
            out.motion = Motion::Traverse { target: self.position };
        }
        out.clear_beside_motion();
        out.line = words.line;
        out.exact_stop = self.modal.path == PathMode::ExactStop;
        out.blend = self.modal.blend();
        true
    }

    /// Goes to the target on the `named` axes; the others stay, and the target is there, too.
    #[inline(always)]
    fn go(&mut self, mut named: u8, target: &mut PerAxis<Length>) {
        let axes = self.position.iter_mut().zip(&mut self.residue).zip(target);
        for ((position, residue), target) in axes {
            if named & 1 != 0 {
                (*position, *residue) = (*target, 0);
            } else {
                *target = *position;
            }
            named >>= 1;
        }
    }
}

/// Whether words of the `named` axes are positions, anywhere.
fn are_usual(mut named: u8, setup: &impl Setup) -> bool {
    let mut axis = 0;
    while named != 0 {
        let positions = named & 1 == 0
            || (matches!(setup.mode(axis), AxisMode::Standard | AxisMode::Inhibited)
                && setup.travel(axis).is_none());
        if !positions {
            return false;
        }
        named >>= 1;
        axis += 1;
    }
    true
}

/// Where a line's target is put together: it need not be copied then, and of most lines before there is such a place.
#[inline(always)]
fn target_of(motion: &mut Motion) -> Option<&mut PerAxis<Length>> {
    if !matches!(motion, Motion::Feed { .. }) {
        *motion = Motion::Feed { target: [Length::ZERO; AXES], feed: Feed::PerMinute(0.0) };
    }
    match motion {
        Motion::Feed { target, .. } => Some(target),
        _ => None,
    }
}

impl<'a> Words<'a> {
    #[inline(always)]
    fn new(text: &'a [u8], numbered: bool) -> Self {
        let seen = if numbered { 0 } else { N_SEEN };
        // A byte 0 would pass for the end of the line.
        let byte = if text.last() == Some(&0) { BAD } else { b' ' };
        let (prints, carried, rest) = (false, None, 0);
        let at = Cursor::new(byte, text);
        Words { at, text, seen, mode: None, feed: 0.0, line: 0, prints, carried, rest }
    }

    /// Reads the line, whose lengths count from `from`; where it goes on the axes that it names is put into `target`, machine coordinates. False
    /// if it is not for the fast path.
    #[inline(always)]
    fn read(&mut self, from: &PerAxis<Length>, target: &mut PerAxis<Length>) -> bool {
        loop {
            let letter = self.at.byte & !CASE;
            let axis = match letter {
                b'X'..=b'Z' => letter - b'X',
                b'A'..=b'C' => letter - b'A' + FIRST_ROTARY as u8,
                b'E' if PRINTS && self.prints => EXTRUDER as u8,
                // A blank is that without `CASE`, too.
                0 if self.at.byte == b' ' => {
                    self.at.step();
                    continue;
                }
                0 => {
                    return self.at.left() == 0 && self.seen & AXES_SEEN != 0;
                }
                _ if self.other(letter) => continue,
                _ => return false,
            };
            let bit = 1 << axis;
            if self.seen & bit != 0 {
                return false;
            }
            self.seen |= bit;
            self.at.step();
            let mut value = Length(self.number());
            if PRINTS && self.prints && usize::from(axis) == EXTRUDER {
                value = self.filament(value);
            }
            let i = usize::from(axis);
            let (Some(target), Some(origin)) = (target.get_mut(i), from.get(i)) else {
                return false;
            };
            match origin.0.checked_add(value.0).map(Length) {
                Some(sum) => *target = sum,
                None => return false,
            }
        }
    }

    /// A word that is none of an axis. False if it is not for the fast path.
    #[inline(never)]
    fn other(&mut self, letter: u8) -> bool {
        self.at.step();
        match letter {
            b'G' if self.mode.is_none() => {
                self.mode = self.mode();
                return self.mode.is_some();
            }
            b'F' if self.seen & F_SEEN == 0 => {
                self.seen |= F_SEEN;
                self.feed = self.feed();
            }
            b'N' if self.seen & N_SEEN == 0 => {
                self.seen |= N_SEEN;
                self.line = self.integer();
            }
            _ => return false,
        }
        true
    }

    /// What a G word says. `None` if it is not for the fast path: neither 0 nor 1, of one digit or behind a zero.
    #[inline(never)]
    fn mode(&mut self) -> Option<MotionMode> {
        let digit = self.at.byte;
        self.at.step();
        let has_more = matches!(self.at.byte, b'0'..=b'9' | b'.');
        let value = match digit {
            b'0' if has_more => self.number(),
            b'0' => 0,
            b'1' if !has_more => Length::PER_MM,
            _ => return None,
        };
        match value {
            0 if PRINTS && self.prints => Some(MotionMode::Feed),
            0 => Some(MotionMode::Traverse),
            Length::PER_MM => Some(MotionMode::Feed),
            _ => None,
        }
    }

    /// A number in ten-thousandths. One that is not for the fast path leaves `BAD` to be read.
    #[inline(never)]
    fn number(&mut self) -> i32 {
        let negative = self.at.byte == b'-';
        if negative {
            self.at.step();
        }
        let (whole, frac) = self.decimal();
        // 65,535.9999 at most: that fits.
        let value = (product(whole, 10_000) + u32::from(frac)) as i32;
        if negative { -value } else { value }
    }

    /// Where in the line the byte behind the current one is.
    fn next(&self) -> usize {
        self.text.len().saturating_sub(self.at.left().into())
    }

    /// An E word, whose first four decimals have been read, with a fifth one and what those before have left.
    #[inline(never)]
    fn filament(&mut self, value: Length) -> Length {
        let mut by = Exact { units: value, rest: 0 };
        let point = self.next().checked_sub(6).and_then(|at| self.text.get(at));
        if self.at.byte.is_ascii_digit() && point == Some(&b'.') {
            by = self.fifth(value);
        }
        match self.carried {
            None => {}
            Some(carried) => match by.carry(carried) {
                Some(sum) => by = sum,
                None => self.at.byte = BAD,
            },
        }
        self.rest = by.rest;
        by.units
    }

    /// With the fifth decimal; a sixth is left, where no word can begin with it.
    fn fifth(&mut self, value: Length) -> Exact {
        let digit = i16::from(self.at.byte - b'0');
        self.at.step();
        let start = self.next().saturating_sub(1);
        let word = self.text.get(..start).unwrap_or(&[]);
        let negative =
            word.iter().rev().find(|byte| !matches!(byte, b'0'..=b'9' | b'.')) == Some(&b'-');
        let up = digit >= 5;
        let rest = 1_000 * if up { digit - 10 } else { digit };
        let (step, rest) = if negative { (-i32::from(up), -rest) } else { (i32::from(up), rest) };
        Exact { units: Length(value.0 + step), rest }
    }

    /// The number of an F word.
    #[inline(never)]
    fn feed(&mut self) -> f32 {
        let Ok(value) = u32::try_from(self.number()) else {
            self.at.byte = BAD;
            return 0.0;
        };
        let (whole, frac) = (value / Length::PER_MM as u32, value % Length::PER_MM as u32);
        Decimal { whole, frac: frac as u16, ..Decimal::default() }.to_f32()
    }

    #[inline(always)]
    fn decimal(&mut self) -> (u16, u16) {
        let number = decimal(&mut self.at);
        if number.is_none() {
            self.at.byte = BAD;
        }
        number.unwrap_or_default()
    }

    /// A whole number below ten million. One that is longer is not for the fast path: its next digit is no letter.
    #[inline(never)]
    fn integer(&mut self) -> u32 {
        let mut value = 0;
        if !self.at.byte.is_ascii_digit() {
            self.at.byte = BAD;
        }
        while value < 1_000_000 && self.at.byte.is_ascii_digit() {
            value = value * 10 + u32::from(self.at.byte - b'0');
            self.at.step();
        }
        value
    }
}
