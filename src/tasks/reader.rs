//! The reader task: bytes from the receive ring of each port into its line pool.
//!
//! Reads the receive rings, writes the line pools, waits on [`Event::Received`] or for pool space. Never runs longer
//! than a full ring takes (255 bytes, about 6,000 cycles). When the pool is full, bytes stay in the ring, except for
//! short control lines, which [overtake](super::overtake). When the ring is full too, bytes are lost: damaged lines and
//! lines lost whole are refused. With `ex` 1, XOFF stops the sender before that, and the sender may stop answers by
//! XOFF; with `ex` 2, pins do both.

use embassy_futures::select::select;
use embassy_futures::yield_now;

use super::Never;
use super::hold;
use super::jog;
use super::lines::LinePool;
use super::links::Links;
use super::overtake::Scan;
use super::ports::{Cut, Port};
use super::realtime;
use crate::gcode::comment::Aside;
use crate::hal::Thread;
use crate::hal::event::{Event, next, set_asked};
use crate::hal::ring::Window;
use crate::hal::serial::{
    AUX, AUX_RING, BEHIND_END, CLEAN, CLOSE, CUT, Flow, GO, MARKS, PORTS, RETURNED, RX_RING,
    Received, TAKEN, TAKEN_RETURN, USB, high_water, is_shared, low_water,
};
use crate::hal::uart::{self, lost_ends};
use crate::machine;
use crate::protocol::Speech;
use crate::status::Status;

/// How many pieces are taken before others get a turn: a piece is a line, or a part of one, and its end.
const TURN: usize = 16;

/// What a turn has left.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Left {
    Nothing,
    /// There are bytes, but no room in the pool.
    Full,
    Bytes,
    /// There may be bytes behind this mark, which stands for a real-time character.
    Placed(u8),
    /// There may be bytes behind a mark in a comment. `%` and `~` are text there; only `^d` acts.
    Aside,
}

/// The task.
pub fn run(
    links: &'static Links,
    usb: Received,
    aux: Option<Received>,
) -> impl Future<Output = Never> {
    let mut usb = Intake::new(links.thread, links.port(USB), usb);
    let mut aux = aux
        .filter(|_| PORTS > 1)
        .map(|received| Intake::new(links.thread, links.port(AUX), received));
    async move {
        loop {
            jog::passes(links);
            let left = usb.take(links);
            let aux_left = match &mut aux {
                Some(aux) if PORTS > 1 && !aux.is_idle() => aux.take(links),
                _ => Left::Nothing,
            };
            hold::here(links);
            match left.max(aux_left) {
                Left::Nothing => {
                    jog::passed(links);
                    next(links.thread, Event::Received).await;
                }
                Left::Bytes | Left::Placed(_) | Left::Aside => yield_now().await,
                Left::Full => {
                    // The ring continues to fill.
                    select(links.pool_space.wait(), next(links.thread, Event::Received)).await;
                }
            }
        }
    }
}

/// Levels of a receive ring at which its sender is stopped, and at which the sender may resume.
struct Levels {
    /// With more bytes than this, XOFF stops the sender.
    characters: u8,
    /// With more bytes than this, a pin stops the sender.
    pins: u8,
    /// With fewer bytes than this, the sender may resume.
    low: u8,
}

impl Levels {
    /// Returns the levels of a ring of this size.
    const fn of(ring: usize) -> Self {
        Self {
            characters: high_water(Flow::Characters, ring) as u8,
            pins: high_water(Flow::Pins, ring) as u8,
            low: low_water(ring) as u8,
        }
    }
}

/// The receiving end of a port.
struct Intake {
    port: &'static Port,
    received: Received,
    /// How many of the lost line ends (`lost_ends`) have been handled.
    seen: u16,
    /// How many lost lines are still to be refused.
    refused: u16,
    /// The mark that has told of the lost lines.
    then: u8,
    /// How the sender has been stopped.
    stopped: Flow,
    /// The port has pins, so that the receive interrupt may have stopped the sender as well.
    has_pins: bool,
    /// How far the ring has been searched for control lines.
    scan: Scan,
}

impl Intake {
    fn new(thread: Thread, port: &'static Port, received: Received) -> Self {
        let seen = lost_ends(thread, port.number);
        let has_pins = Flow::of(port.number, 2) == Flow::Pins;
        Self {
            port,
            received,
            seen,
            refused: 0,
            then: 0,
            stopped: Flow::None,
            has_pins,
            scan: Scan::NONE,
        }
    }

    /// Whether there is nothing to do, as on a port that is not used.
    fn is_idle(&self) -> bool {
        self.received.is_empty() && self.refused == 0 && self.stopped == Flow::None
    }

    /// Takes the bytes of a turn, applies flow control, and acts on real-time characters where they stand.
    fn take(&mut self, links: &Links) -> Left {
        if self.port.is_eager() {
            let taken = realtime::pick(links, self.port, &mut self.received.window());
            self.received.release_many(taken);
            self.scan.pass(taken);
        }
        let left = self.turn(links);
        self.control_flow(self.received.len() as u8, links);
        match left {
            Left::Placed(mark) => hold::placed(links, self.port, mark),
            Left::Aside => hold::serve(links),
            Left::Full => {
                let taken =
                    look_ahead(links, self.port, &mut self.scan, &mut self.received.window());
                self.received.release_many(taken);
            }
            _ => {}
        }
        left
    }

    /// Takes the bytes of a turn.
    #[inline(never)]
    fn turn(&mut self, links: &Links) -> Left {
        let mut pool = self.port.lines.borrow_mut();
        let pool = &mut *pool;
        self.speak(pool);
        for _ in 0..TURN {
            if self.refused > 0 && !self.refuse(pool, links) {
                return Left::Full;
            }
            let cuts = self.cuts(pool, links);
            if self.received.is_empty() {
                return Left::Nothing;
            }
            if !cuts {
                let looked = self.scan.has_looked();
                let (text, ends) = pool.put_text(self.received.waiting());
                self.received.release_many(text);
                self.scan.pass(text);
                if ends {
                    self.ended(pool, looked, links);
                    continue;
                }
                if text > 0 && self.received.is_empty() {
                    return Left::Nothing;
                }
            }
            if !pool.ready() {
                return Left::Full;
            }
            let next = self.received.waiting().first().copied();
            if next.is_some_and(|next| pool.leaves(next)) {
                // The byte has come after the ring was searched for such bytes.
                return Left::Bytes;
            }
            if next.is_some_and(|next| pool.end_question(next)) {
                // There may be no room for the line that begins.
                links.parser_wake.signal();
                continue;
            }
            let Some(byte) = self.received.pop() else {
                return Left::Nothing;
            };
            let looked = self.scan.has_looked();
            self.scan.pass(1);
            let is_line = match byte {
                CUT | GO if cuts => false,
                CUT | GO if pool.aside() != Aside::NONE => return Left::Aside,
                CUT | GO => return Left::Placed(byte),
                ..MARKS => self.loss(pool, byte, links),
                // A line stood here that has overtaken. It has been counted already.
                TAKEN_RETURN if pool.is_plain() => pool.put(byte),
                TAKEN | TAKEN_RETURN => {
                    pool.follow(byte == TAKEN_RETURN);
                    false
                }
                // A program has closed the port. The first line of the next program must not be appended to its half
                // line.
                CLOSE if uart::sees_opening() => {
                    pool.forget();
                    false
                }
                _ => pool.put(byte),
            };
            if is_line {
                match self.port.cut.get() {
                    Cut::None => {}
                    _ if !cuts => {}
                    _ if self.port.is_resetting() => pool.drop_unanswered(),
                    Cut::Gcode(_) if pool.refuse_newest() => self.port.cut.set(Cut::None),
                    Cut::Gcode(_) => {}
                    Cut::All(_) => pool.terminate(hold::dropped()),
                }
                self.ended(pool, looked, links);
            }
        }
        Left::Bytes
    }

    /// Acts on a line that has come whole. `looked`: the line has been searched for alarms while it was in the ring.
    #[inline(always)]
    fn ended(&mut self, pool: &mut LinePool, looked: bool, links: &Links) {
        // First, because what has been selected says what the line is.
        if self.port.is_undecided() && self.port.may_decide(pool.newest().first()) {
            self.decide(pool, links);
        }
        self.scan.serve(links, pool, looked);
        if machine::is_alarmed() && pool.ends_with_control() {
            // They came before a line that may overtake them, and may end the alarm.
            pool.refuse();
        }
        if pool.has_controls() {
            set_asked(links.thread, true);
        }
        links.parser_wake.signal();
    }

    /// Sets up the pool for the dialect of the port.
    #[inline(never)]
    fn speak(&self, pool: &mut LinePool) {
        let speech = self.port.speech.get();
        pool.keep_empty(speech.answers_empty());
        let in_braces = self.port.is_undecided() && pool.is_in_braces();
        pool.keep_order(speech.is_in_order() && !in_braces);
        if Speech::HAS_PLAIN {
            pool.keep_plain(speech.is_plain());
        }
    }

    /// Lets the last line decide the dialect. The lines directly after it are then taken by the rules of that dialect.
    #[cold]
    #[inline(never)]
    #[small]
    fn decide(&self, pool: &mut LinePool, links: &Links) {
        links.decide_by(self.port, pool.newest());
        self.speak(pool);
        pool.classify_newest();
    }

    /// Whether the next byte lies before the cut and is dropped. The reader then takes it alone, not as part of a run
    /// of text.
    #[inline(always)]
    fn cuts(&self, pool: &mut LinePool, links: &Links) -> bool {
        self.port.cut.get().slot().is_some_and(|last| self.cuts_up_to(last, pool, links))
    }

    #[cold]
    #[inline(never)]
    fn cuts_up_to(&self, last: u8, pool: &mut LinePool, links: &Links) -> bool {
        let cuts = self.received.taken() != last;
        if !cuts {
            if self.port.is_resetting() {
                pool.forget();
            } else if matches!(self.port.cut.get(), Cut::All(_)) {
                pool.terminate_partial(hold::dropped());
            }
            self.port.cut.set(Cut::None);
            // A greeting may wait for the end of the cut.
            links.reporter_wake.notify_now();
        }
        cuts
    }

    /// Stops the sender, or lets it resume, with this many bytes waiting.
    #[inline(never)]
    fn control_flow(&mut self, waiting: u8, links: &Links) {
        let levels =
            if self.port.number == USB { Levels::of(RX_RING) } else { Levels::of(AUX_RING) };
        if self.stopped == Flow::None && uart::is_stopped(links.thread, self.port.number) {
            // Exec has stopped the sender.
            self.stopped = Flow::Characters;
        }
        let stop = match self.stopped {
            Flow::None if waiting <= levels.characters => false,
            Flow::None if self.flow(links) == Flow::Characters => true,
            Flow::None => waiting > levels.pins,
            _ => waiting >= levels.low,
        };
        // If the setting has changed, the sender must not stay stopped by the old means.
        let flow = if stop { self.flow(links) } else { Flow::None };
        if flow != self.stopped {
            let port = self.port.number;
            // There is time to wait for the end of a line, unless even the level for pins has been passed.
            let waits = waiting <= levels.pins;
            uart::stop_sender(links.thread, port, self.stopped, false, true);
            uart::stop_sender(links.thread, port, flow, true, waits);
            self.stopped = flow;
        } else if self.has_pins && flow == Flow::None {
            uart::stop_sender(links.thread, self.port.number, Flow::Pins, false, false);
        }
    }

    fn flow(&self, links: &Links) -> Flow {
        self.port.flow(&links.settings.borrow())
    }

    /// Handles a mark of lost bytes. Returns whether the mark stands for the end of a whole line.
    #[cold]
    #[inline(never)]
    fn loss(&mut self, pool: &mut LinePool, mark: u8, links: &Links) -> bool {
        let ends = lost_ends(links.thread, self.port.number);
        self.refused = ends.wrapping_sub(core::mem::replace(&mut self.seen, ends));
        self.then = mark;
        let is_line = mark & BEHIND_END != 0 && pool.end(mark & RETURNED != 0);
        if mark & BEHIND_END == 0 {
            pool.spoil(Status::BufferFull);
        }
        if self.refused == 0 {
            self.after(pool);
        }
        // On a bus the sender is not told: the line is refused anyway.
        if (self.refused > 0 || mark & CLEAN == 0) && !is_shared(self.port.number) {
            self.port.news.set(self.port.news.get().or(Some(Status::BufferFull)));
            links.parser_wake.signal();
        }
        is_line
    }

    /// Puts a fault into the pool for each line that was lost. Returns false if there is no room for all of them.
    #[cold]
    #[inline(never)]
    fn refuse(&mut self, pool: &mut LinePool, links: &Links) -> bool {
        while self.refused > 0 && pool.ready() {
            pool.spoil(Status::BufferFull);
            pool.end(false);
            links.parser_wake.signal();
            self.refused -= 1;
            if self.refused == 0 {
                self.after(pool);
            }
        }
        self.refused == 0
    }

    /// Decides after lost bytes whether the next bytes are a new line or the remainder of a damaged one.
    fn after(&mut self, pool: &mut LinePool) {
        if self.then & CLEAN == 0 {
            pool.spoil(Status::BufferFull);
        } else {
            pool.forget();
        }
        pool.follow(self.then & RETURNED != 0);
    }
}

/// Scans the ring while no line can be taken before the machine resumes. Acts on real-time characters that resume it,
/// and takes lines that overtake. Returns how many bytes of these lines are to be released.
#[inline(never)]
#[small]
fn look_ahead(links: &Links, port: &Port, scan: &mut Scan, ring: &mut Window<'_>) -> u8 {
    if machine::is_held() || machine::is_stopped() {
        look_for_marks(links, port, ring);
    }
    let (waiting, closes) = (ring.len(), port.cut.get().is_none());
    let mut pool = port.lines.borrow_mut();
    if scan.run(links, &mut pool, ring, closes) {
        links.parser_wake.signal();
        if machine::is_alarmed() && pool.refuse() {
            // What has been looked through came before the control line, or is that line.
            hold::refuse_up_to(port, scan.looked.checked_sub(1).map(|last| ring.slot(last)));
        }
    }
    scan.look_for_stops(links, port, &mut pool, ring);
    waiting - ring.len()
}

/// Acts on real-time characters in the ring. Cost: 30 cycles a byte.
#[inline(never)]
#[small]
fn look_for_marks(links: &Links, port: &Port, ring: &Window<'_>) {
    let mut aside = port.lines.borrow().aside();
    // Marks before a cut have already taken effect.
    let mut last = port.cut.get().slot();
    for n in 0..ring.len() {
        let (byte, slot) = (ring.get(n), ring.slot(n));
        if byte < MARKS && aside == Aside::NONE && last.is_none() {
            hold::ahead(links, port, byte, slot);
        }
        last = last.filter(|last| *last != slot);
        aside = aside.after(byte);
    }
}
