//! The fast path: reads and carries out a usual line in one pass. A usual line has axis words, and perhaps G0 or G1, F
//! and N, while lengths are in millimetres.
//!
//! [`Interpreter::interpret`](super::Interpreter::interpret) tries the fast path first. The fast path declines any
//! other line before the state has changed. `lexer`, `block` and `motion` then interpret the line, and say what is
//! wrong with it. The results of both paths are equal to the bit: a property test in `tests` compares them.
//!
//! Lines of a printing host have E instead of A, with five decimals, and G0 means G1: see [`Writer::Prints`].
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

/// The bit that distinguishes lower from upper case.
const CASE: u8 = 0x20;
/// Whether the image has a dialect of printing hosts.
const PRINTS: bool = cfg!(feature = "dialect-reprap");
/// A byte that cannot begin a word. A parser of a number puts it in place of the next byte to make the line be
/// declined.
const BAD: u8 = 0x7F;
/// Bits of `Words::seen`. An axis has the bit of its number; N and F have the bits below. G is in `Words::mode`.
const AXES_SEEN: u8 = (1 << AXES) - 1;
const N_SEEN: u8 = 1 << 6;
const F_SEEN: u8 = 1 << 7;

/// The kind of sender that has written a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Writer {
    /// A sender whose lines may have an N word.
    Numbers,
    /// A sender whose lines may not have an N word.
    Plain,
    /// A printing host. Its lines may not have an N word.
    Prints,
}

/// A line that is being read, and the words that have been read so far.
struct Words<'a> {
    /// The place in the line up to which it has been read.
    at: Cursor<'a>,
    text: &'a [u8],
    /// The words that have been read, as bits.
    seen: u8,
    mode: Option<MotionMode>,
    feed: f32,
    line: u32,
    /// Whether a printing host has written the line.
    prints: bool,
    /// The residue of rounding from previous E words, if the E word is relative.
    carried: Option<i16>,
    /// The residue of rounding from the E word of this line.
    rest: i16,
}

impl State {
    /// Carries a line out by the fast path. This happens only for a move without a comment for which
    /// [`Interpreter::interpret`](super::Interpreter::interpret) would return `Ok`. Any other line is declined: the
    /// function returns false and has changed nothing, except perhaps the motion in `out`. A line of a printing host
    /// has to be in the form of the interpreter already, except for E and G0.
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
        // Most lines that are not for the fast path end in a comment.
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
            // The residue of rounding would have to be added.
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
            && !(Capability::Drivers.is_built_in() && setup.drives().is_err())
            && self.carry_out(&words, out)
    }

    /// Whether only the end of a move still has to be checked against [`Setup::reach`]. This is the case in an image
    /// for CoreXY if the present position is within reach. In other images a machine with a reach is left to the slow
    /// path.
    #[inline(always)]
    fn reaches(&self, setup: &impl Setup) -> bool {
        Capability::CoreXy.is_built_in() && is_near(&self.position, setup)
    }

    /// Returns what the words are measured from, for a line whose E word is relative: the origin, but for the extruder
    /// its present position.
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
        // Nothing can fail from here on.
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

    /// Moves the model to `target` on the `named` axes. The other axes stay, and their `target` is set to their
    /// position.
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

/// Whether the words of all `named` axes are plain positions without travel limits.
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

/// Returns the place in `motion` in which the target of the line is built, so that it need not be copied. The previous
/// line has mostly left a `Motion::Feed` there, which is reused.
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
        // A line that ends in a byte 0 is declined. The byte would be taken for the end of the line.
        let byte = if text.last() == Some(&0) { BAD } else { b' ' };
        let (prints, carried, rest) = (false, None, 0);
        let at = Cursor::new(byte, text);
        Words { at, text, seen, mode: None, feed: 0.0, line: 0, prints, carried, rest }
    }

    /// Reads the line. Its lengths are measured from `from`, and the machine coordinates of the named axes are put into
    /// `target`. Returns false if the line is not for the fast path.
    #[inline(always)]
    fn read(&mut self, from: &PerAxis<Length>, target: &mut PerAxis<Length>) -> bool {
        loop {
            let letter = self.at.byte & !CASE;
            let axis = match letter {
                b'X'..=b'Z' => letter - b'X',
                b'A'..=b'C' => letter - b'A' + FIRST_ROTARY as u8,
                b'E' if PRINTS && self.prints => EXTRUDER as u8,
                // A blank without the bit `CASE` is 0 as well.
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

    /// Reads a G, F or N word. Returns false if the word is not for the fast path.
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

    /// Reads the number of a G word, 0 or 1, with or without a leading zero. `None` if it is any other number.
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

    /// Reads a number and returns it in ten-thousandths. If the number is not for the fast path, `BAD` is the next
    /// byte.
    #[inline(never)]
    fn number(&mut self) -> i32 {
        let negative = self.at.byte == b'-';
        if negative {
            self.at.step();
        }
        let (whole, frac) = self.decimal();
        // Fits: the number is 65,535.9999 at most.
        let value = (product(whole, 10_000) + u32::from(frac)) as i32;
        if negative { -value } else { value }
    }

    /// Returns the index in the line of the byte behind the current one.
    fn next(&self) -> usize {
        self.text.len().saturating_sub(self.at.left().into())
    }

    /// Completes an E word whose first four decimals have been read. Adds the fifth decimal, and for a relative E word
    /// the residue of rounding from previous ones.
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

    /// Adds the fifth decimal. A sixth one is not read: no word can begin with a digit, so the line is declined.
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

    /// Reads the number of an F word.
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

    /// Reads a whole number below ten million. A longer number is declined, because its next digit is no letter.
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
