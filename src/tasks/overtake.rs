//! Control lines that overtake data in the receive ring.
//!
//! When the pool takes no more lines in order, bytes stay in the ring. The reader scans them for short control lines,
//! so that a stop or a question never waits for the moves before it:
//!
//! ```text
//!  pool  | g1x1.. | g1x2.. | g1x3   part |  reserve  |
//!  ring  | 00 | {stat:n} | g1x4 |             the line moves in front of the part, into the reserve,
//!             | 00 | g1x4 |                   and what is before it in the ring moves up
//! ```
//!
//! A line overtakes if it has come whole, is no longer than the pool's reserve, and is a control line. A longer control
//! line waits in order, and shorter ones overtake it. The sender's character count stays right: the bytes of the line
//! count with the line, and their room is free when the line has been answered. At most one byte of the line's end
//! stays in the ring without being counted: a carriage return that a line feed may follow, or the newest byte of a full
//! ring.
//!
//! While lines are being dropped, up to a slot of the ring, bytes there do not move: `serial::TAKEN` stands for each
//! byte of a line that has been taken.
//!
//! Each byte is scanned once (11 cycles). The bytes of an unfinished line are scanned at each turn of the reader.

use super::lines::{LinePool, is_blank};
use super::links::Links;
use crate::hal::ring::Window;
use crate::hal::serial::{CLEAN, CLOSE, CUT, GO, MARKS, TAKEN, TAKEN_RETURN};
use crate::hal::uart;
use crate::machine;
use crate::protocol::may_be_control;

/// How far a ring has been scanned.
pub struct Scan {
    /// How many of the bytes that wait have been scanned.
    pub(super) looked: u8,
    /// The next bytes belong to a line that does not overtake.
    pub(super) within: bool,
    /// How many of the bytes that wait have been searched for alarms: 0, or up to the beginning of a line.
    pub(super) stops: u8,
    /// How many of the lines in the ring have begun an alarm.
    pub(super) begun: u8,
}

/// What begins at a position in the ring.
enum Found {
    /// A line that may overtake, of this many bytes without its end.
    Line(u8),
    /// A question mark, which needs no end.
    Question,
    /// A line that may overtake whose end has not come.
    Unfinished,
    /// Something else.
    Other,
}

impl Scan {
    /// A scan before the first byte.
    pub const NONE: Self = Self { looked: 0, within: false, stops: 0, begun: 0 };

    /// Notes that the reader has taken this many bytes in order.
    #[inline(always)]
    pub fn pass(&mut self, count: u8) {
        if self.looked | self.stops != 0 {
            self.looked = self.looked.saturating_sub(count);
            self.stops = self.stops.saturating_sub(count);
        }
    }

    /// Whether the next line has been searched for alarms.
    #[inline(always)]
    pub fn has_looked(&self) -> bool {
        self.stops != 0
    }

    /// Scans further, and takes the lines that overtake, as long as there is room for them: in an alarm only one.
    /// Returns whether there were any. If the ring `closes` behind them, it has fewer bytes afterwards, and the
    /// difference is to be released.
    #[inline(never)]
    #[small]
    pub fn run(
        &mut self,
        links: &Links,
        pool: &mut LinePool,
        ring: &mut Window<'_>,
        closes: bool,
    ) -> bool {
        if self.looked == 0 {
            // A question mark has no end: what follows is another line.
            self.within = pool.is_within_line() && !pool.is_asking();
        }
        let mut took = false;
        loop {
            if self.within {
                self.looked = ring.behind_text(self.looked);
            }
            if self.looked >= ring.len() {
                break;
            }
            let byte = ring.get(self.looked);
            if byte < MARKS && byte != CUT && byte != GO {
                // Bytes were lost here. If the mark is the newest byte, it may still change when more is lost.
                if self.looked + 1 == ring.len() {
                    break;
                }
                self.within = byte & CLEAN == 0;
            } else if byte == b'\n' || byte == b'\r' || is_close(byte) {
                self.within = false;
            } else if !self.within && !is_nothing(byte) {
                let (len, ends) = match find(ring, self.looked, pool.reserve()) {
                    Found::Unfinished => break,
                    Found::Line(len) => (len, true),
                    Found::Question => (1, false),
                    Found::Other => (0, false),
                };
                if len > 0 && !pool.has_reserve(len) {
                    break;
                }
                if len > 0 && take(pool, ring, self.looked, len, ends) {
                    let closed = close(ring, self.looked, len, closes);
                    let looked = self.stops > self.looked;
                    self.serve(links, pool, looked);
                    if looked {
                        self.stops -= closed;
                    }
                    took = true;
                    if machine::is_alarmed() {
                        // This line may end the alarm: what is refused ends here.
                        break;
                    }
                    continue;
                }
                self.within = true;
            }
            self.looked += 1;
        }
        took
    }
}

/// Whether a program has closed the port here.
fn is_close(byte: u8) -> bool {
    uart::sees_opening() && byte == CLOSE
}

/// Whether a byte between two lines belongs to no line.
fn is_nothing(byte: u8) -> bool {
    is_blank(byte) || byte < MARKS || byte == TAKEN || byte == TAKEN_RETURN
}

/// Returns what begins at a place in the ring. A line longer than `most` does not overtake.
#[inline(never)]
#[small]
fn find(ring: &Window<'_>, at: u8, most: u8) -> Found {
    let first = ring.get(at);
    if !may_be_control(first) {
        return Found::Other;
    }
    let mut len = 1;
    loop {
        if len >= ring.len() - at {
            return Found::Unfinished;
        }
        match ring.get(at + len) {
            b'\n' | b'\r' => return Found::Line(len),
            byte if first == b'?' && !is_blank(byte) => return Found::Question,
            ..b' ' => return Found::Other,
            _ if len == most => return Found::Other,
            _ => len += 1,
        }
    }
}

/// Takes a line out of the ring into the pool, with its end if it `ends`. Returns false if the line is no control
/// line, or if its end has been lost meanwhile.
#[inline(never)]
#[small]
fn take(pool: &mut LinePool, ring: &mut Window<'_>, at: u8, len: u8, ends: bool) -> bool {
    if !pool.is_control(ring, at, len) || (ends && !take_end(ring, at + len, pool.is_plain())) {
        return false;
    }
    pool.put_before(ring, at, len, if ends { 0 } else { u16::MAX });
    true
}

/// Frees the place of a line that has been taken, with its end if that was a line feed. If the ring does not close,
/// marks the place as taken instead. Returns how many bytes have been freed.
#[inline(never)]
#[small]
fn close(ring: &mut Window<'_>, at: u8, len: u8, closes: bool) -> u8 {
    if closes {
        let waiting = ring.len();
        ring.take_out(at, len + u8::from(ring.get(at + len) == TAKEN));
        return waiting - ring.len();
    }
    let mut place = at + len;
    while place > at {
        place -= 1;
        ring.replace(place, ring.get(place), TAKEN);
    }
    0
}

/// Takes the end of a line. Returns false if the end is no longer there. The end is the only byte that may change
/// meanwhile: if it is the newest byte of a full ring, it becomes the mark of what is lost behind it. A line feed that
/// is lost behind a carriage return there must not count as another end.
fn take_end(ring: &mut Window<'_>, at: u8, plain: bool) -> bool {
    match ring.get(at) {
        b'\n' => ring.replace(at, b'\n', TAKEN),
        b'\r' if ring.is_full() && at + 1 == ring.len() => false,
        // In the dialect of a printing host, TAKEN_RETURN is text.
        b'\r' if plain => false,
        b'\r' => ring.replace(at, b'\r', TAKEN_RETURN),
        _ => false,
    }
}
