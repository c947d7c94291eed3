//! A sender: the lines that it has to send, and what it may put on the line now.

use std::collections::VecDeque;

use super::ledger::{Cut, Ledger, Sent};
use super::lines::{Effect, End, Kind, Line, Template, What};
use super::ops::{Count, Setup};

/// Most bytes that arrive in a ms.
pub const BYTES_MS: usize = 11;
/// What may wait for answers: the lines of a sender that counts lines, and the bytes on each port of such a sender
/// and of one that counts characters. The reader may have no turn for 6 ms, in which more bytes come on the second
/// port than its ring has room for.
const LINES: usize = 4;
const BYTES: [usize; 2] = [587, 62];
const CHARACTERS: [usize; 2] = [254, 62];
/// Longest question.
const ASK: usize = 17;

const XOFF: u8 = 0x13;
const XON: u8 = 0x11;

/// A sender.
pub struct Port {
    pub number: usize,
    pub count: Count,
    margin: usize,
    late: usize,
    /// Whether it may hold the machine back by XOFF, and whether by the pin.
    by_characters: bool,
    pub by_pin: bool,
    pub queue: VecDeque<Template>,
    /// Characters to be inserted, each after this many further bytes.
    pub inserts: VecDeque<(usize, &'static [u8])>,
    /// Whether a question is to be asked.
    pub asks: bool,
    /// The rest of the line that is being sent.
    rest: VecDeque<u8>,
    pub ledger: Ledger,
    /// Whether it holds the machine's answers back.
    pub holds: bool,
    /// Whether the machine has stopped it by XOFF, and whether by the pin. `grace` is the number of bytes that it
    /// still sends before it obeys XOFF.
    stopped: bool,
    stopped_by_pin: bool,
    /// Number of ms since the pin let it go on. After some ms all that it had sent before has arrived.
    since_pin: usize,
    grace: usize,
    /// Number of characters, since all lines were answered, that keep their place among the lines.
    placed: usize,
    /// 1 if its last line has an end of two bytes, whose second byte counts with the next line.
    carry: usize,
    /// Bytes that the sender and the machine have counted. `slack` of them may count with a line that is yet to come,
    /// because they stood before a line that overtakes.
    pub counted: [usize; 2],
    slack: usize,
    before: usize,
    /// Whether lines of G-code have been sent.
    pub fed: bool,
    /// How many times it has sent the enquiry whether anybody is there.
    pub enquiries: usize,
}

/// What a sender puts on the line.
pub enum Put {
    /// Nothing more can be sent now.
    Nothing,
    /// Bytes of lines.
    Bytes(Vec<u8>),
    /// Real-time characters.
    Characters(&'static [u8]),
}

impl Port {
    pub fn new(number: usize) -> Self {
        Self {
            number,
            count: Count::Lines,
            margin: 60,
            late: 0,
            by_characters: true,
            by_pin: false,
            queue: VecDeque::new(),
            inserts: VecDeque::new(),
            asks: false,
            rest: VecDeque::new(),
            ledger: Ledger::default(),
            holds: false,
            stopped: false,
            stopped_by_pin: false,
            since_pin: 0,
            grace: 0,
            placed: 0,
            carry: 0,
            counted: [0; 2],
            slack: 0,
            before: 0,
            fed: false,
            enquiries: 0,
        }
    }

    /// Applies the setup of a conversation.
    pub fn set_up(&mut self, setup: &Setup) {
        self.count = setup.counts[self.number];
        // Flow control needs the matching `ex`. On the second port XOFF comes too late for the ring.
        let has_flow = setup.ex == 1 + self.number as u8;
        if self.count == Count::Flow && !has_flow {
            self.count = Count::Lines;
        }
        self.margin = setup.margin;
        self.late = if self.number == 0 { setup.late } else { setup.late / 2 };
        self.by_characters = setup.ex == 1;
        self.by_pin = setup.ex == 2 && self.number == 1;
    }

    /// Whether nothing is left to be sent.
    pub fn is_done(&self) -> bool {
        self.queue.is_empty() && self.inserts.is_empty() && self.rest.is_empty() && !self.asks
    }

    /// Stops the machine's answers, or lets them come. Returns what must be put on the line for that, or the level of
    /// the pin.
    pub fn hold(&mut self, holds: bool) -> (&'static [u8], Option<bool>) {
        if !self.by_characters && !self.by_pin {
            return (b"", None);
        }
        self.holds = holds;
        if holds {
            self.ledger.waiting.iter_mut().for_each(|sent| sent.due = false);
        }
        match (self.by_pin, holds) {
            (true, _) => (b"", Some(holds)),
            (_, true) => (b"\x13", None),
            _ => (b"\x11", None),
        }
    }

    /// Removes XOFF and XON from the bytes that have come, and obeys them.
    pub fn heed(&mut self, bytes: &mut Vec<u8>) {
        for byte in bytes.iter().filter(|byte| matches!(**byte, XOFF | XON)) {
            if *byte == XOFF && !self.stopped {
                self.grace = self.late;
            }
            self.stopped = *byte == XOFF;
        }
        bytes.retain(|byte| !matches!(*byte, XOFF | XON));
    }

    /// Takes note whether the machine stops it by the pin. A question that is on its way is then no longer due.
    pub fn stop_by_pin(&mut self, stopped: bool) {
        self.stopped_by_pin = stopped;
        self.since_pin = if stopped { 0 } else { self.since_pin + 1 };
        if stopped {
            self.ledger.waiting.iter_mut().for_each(|sent| sent.due = false);
        }
    }

    /// Whether flow control allows it to send a byte.
    fn flows(&self) -> bool {
        let stopped =
            self.count == Count::Flow && (self.stopped_by_pin || self.stopped && self.grace == 0);
        !stopped
    }

    fn limit(&self) -> usize {
        match self.count {
            Count::Lines => BYTES[self.number],
            Count::Characters => CHARACTERS[self.number],
            Count::Flow => usize::MAX,
        }
    }

    /// Whether a line of this many bytes may be begun.
    fn may_begin(&self, bytes: usize) -> bool {
        let used = self.ledger.bytes() + self.placed;
        let margin = self.margin.min(self.limit() / 3);
        let fits = used + bytes <= self.limit().saturating_sub(margin) || used == 0;
        fits && self.flows() && (self.count != Count::Lines || self.ledger.lines() < LINES)
    }

    /// Whether there is room for this many bytes that do not belong to a line of the stream.
    fn has_margin(&self, bytes: usize) -> bool {
        self.count == Count::Flow || self.ledger.bytes() + self.placed + bytes <= self.limit()
    }

    /// Puts something on the line, at most `most` bytes. `id` is the number of the next line, and `axis` the axis
    /// that it moves.
    pub fn put(&mut self, most: usize, now: u64, id: &mut u32, axis: usize, epoch: u32) -> Put {
        if self.ledger.waiting.is_empty() {
            self.placed = 0;
        }
        let mut bytes = Vec::new();
        while bytes.len() < most {
            let due = self.inserts.front().is_some_and(|(after, _)| *after == 0);
            if due && !bytes.is_empty() {
                break;
            }
            if due || !self.has_more(now, id, axis, epoch) {
                let blocked = bytes.is_empty();
                match self.inserts.front() {
                    // Characters are not sent while the pin has stopped the sender or released it only just, nor
                    // where the pin could stop them half-way.
                    Some(_) if self.by_pin && (self.since_pin < 4 || most < BYTES_MS) => break,
                    Some((_, characters)) if blocked => {
                        let characters = *characters;
                        self.inserts.pop_front();
                        if self.may_place(characters) {
                            return Put::Characters(characters);
                        }
                        continue;
                    }
                    _ => break,
                }
            }
            let Some(byte) = self.rest.pop_front() else { break };
            bytes.push(byte);
            self.grace = self.grace.saturating_sub(1);
            if let Some((after, _)) = self.inserts.front_mut() {
                *after -= 1;
            }
            if matches!(byte, b'\n' | b'\r')
                && let Some(sent) = self.ledger.waiting.last_mut()
            {
                sent.ended.get_or_insert(now);
            }
        }
        if bytes.is_empty() { Put::Nothing } else { Put::Bytes(bytes) }
    }

    /// Whether characters may be sent. Characters that keep their place among the lines need room.
    fn may_place(&mut self, characters: &[u8]) -> bool {
        let placed = characters.iter().filter(|byte| b"~%\x04".contains(byte)).count();
        // With the pin they may arrive much later than they were sent.
        let may = placed == 0 || !self.by_pin && self.has_margin(placed);
        if may {
            self.placed += placed;
            self.enquiries += characters.iter().filter(|byte| **byte == 5).count();
        }
        may
    }

    /// Whether a byte of a line may be sent now. Begins the next line if the present one is finished.
    fn has_more(&mut self, now: u64, id: &mut u32, axis: usize, epoch: u32) -> bool {
        if !self.rest.is_empty() {
            // A question is sent to its end: the ring of USB has room for it.
            let asks = || self.ledger.waiting.last().is_some_and(|sent| sent.due);
            return self.flows() || self.number == 0 && asks();
        }
        if self.asks {
            let may = self.ledger.may_ask() && self.has_margin(ASK);
            let waits = self.number == 1 && !self.flows() || self.stopped_by_pin;
            if may && !waits {
                self.asks = false;
                self.begin(&Template::plain(What::Ask), now, id, axis, epoch);
                return true;
            }
            // The question is given up if there is no room for it or another question is on its way.
            self.asks &= may && waits;
        }
        let Some(next) = self.queue.front() else { return false };
        let line = next.line(self.number, *id, axis);
        if !self.may_begin(line.text.len() + usize::from(next.lead) + 3) {
            return false;
        }
        let next = next.clone();
        self.queue.pop_front();
        self.begin(&next, now, id, axis, epoch);
        true
    }

    fn begin(&mut self, template: &Template, now: u64, id: &mut u32, axis: usize, epoch: u32) {
        let line = template.line(self.number, *id, axis);
        self.start(*id, line, template.lead.into(), template.end, now, epoch);
        *id += 1;
    }

    fn start(&mut self, id: u32, line: Line, lead: usize, end: End, now: u64, epoch: u32) {
        let text = format!("{}{}{}", " ".repeat(lead), line.text, end.bytes());
        self.rest.extend(text.into_bytes());
        let bytes = lead + self.carry + line.text.len() + 1;
        self.slack = if line.kind == Kind::Short { self.slack + lead + self.carry } else { 0 };
        self.carry = usize::from(matches!(end, End::Both | End::Empty));
        self.counted[0] += bytes;
        self.fed |= line.kind == Kind::Data;
        let asks = line.effect == Effect::Ask && line.kind == Kind::Short;
        let due = asks && !self.holds && self.ledger.may_ask();
        let sent =
            Sent { id, line, begun: now, ended: None, bytes, cut: Cut::No, epoch, heard: 0, due };
        self.ledger.waiting.push(sent);
    }

    /// Takes note of a character that keeps its place within the line that is being sent. The line then overtakes
    /// only in the pool.
    pub fn break_line(&mut self) {
        if self.has_only_led() {
            return;
        }
        if let Some(sent) = self.ledger.waiting.last_mut().filter(|sent| sent.ended.is_none()) {
            sent.due = false;
            if sent.line.kind == Kind::Short {
                sent.line.kind = Kind::Long;
            }
        }
    }

    /// Whether only the blanks before the line that is being sent have been sent.
    pub fn has_only_led(&self) -> bool {
        let text = self.ledger.waiting.last().map_or("", |sent| &sent.line.text);
        self.rest.len() > text.len() && self.rest.front() == text.as_bytes().first()
            || self.rest.front() == Some(&b' ') && self.rest.len() > text.len() + 1
    }

    /// Whether a line has been begun and is not sent to its end.
    pub fn has_begun(&self) -> bool {
        !self.rest.is_empty()
    }

    /// Begins a line of the dialogue itself at once. No other line may wait.
    pub fn own(&mut self, id: u32, text: &str, now: u64) {
        let line = Line {
            text: text.to_string(),
            kind: Kind::Long,
            effect: Effect::None,
            too_long: false,
        };
        self.start(id, line, 0, End::Feed, now, 0);
    }

    /// Whether nothing waits to be sent or to be answered.
    pub fn is_idle(&self) -> bool {
        self.is_done() && self.ledger.waiting.is_empty()
    }

    /// Begins a new count. Bytes that were counted but belong to no line yet may come on top.
    pub fn count_anew(&mut self) {
        (self.counted, self.before) = ([0; 2], self.slack + self.carry);
    }

    /// Whether the machine has counted all bytes that were sent, except those that count with a line to come.
    pub fn counts_right(&self) -> bool {
        let [sent, told] = self.counted;
        (sent.saturating_sub(self.slack)..=sent + self.before).contains(&told)
    }
}
