//! The reader task: bytes from the receive ring into the line pool.
//!
//! Reads the receive ring, writes the line pool, waits on [`Event::Received`] or for pool space; never
//! runs longer than the ring is full (255 bytes, about 6,000 cycles). When the pool is full the bytes
//! stay in the ring, and when that is full too bytes are lost: the line that is damaged thereby is
//! refused, and so is each line that is lost whole. With `ex` 1 the sender is stopped before that by XOFF, and
//! stops the machine's answers so.

use embassy_futures::select::select;
use embassy_futures::yield_now;

use super::hold::{self, Flush};
use super::lines::{Aside, LinePool};
use super::links::Links;
use crate::hal::event::{Event, next};
use crate::hal::imp::uart::{self, lost_ends};
use crate::hal::serial::{
    BEHIND_END, CLEAN, CUT, GO, HIGH_WATER, LOW_WATER, MARKS, RETURNED, Received, XOFF, XON,
};
use crate::protocol::Mode;
use crate::status::Status;

/// Pieces taken before others get a turn: a piece is a line, or a part of one, and its end.
const TURN: usize = 16;

/// What a turn came to.
#[derive(PartialEq, Eq)]
enum Left {
    Nothing,
    Bytes,
    /// Bytes, and no room in the pool.
    Full,
    /// Bytes, perhaps, behind this mark: the place of a real-time character.
    Placed(u8),
}

/// The task.
pub async fn run(links: &'static Links, received: Received) -> ! {
    let mut intake =
        Intake { received, seen: lost_ends(), refused: 0, then: 0, sender_stopped: false };
    loop {
        let left = intake.turn(links);
        intake.control_flow(links);
        if links.flush.get() == Flush::Here {
            hold::placed(links, CUT);
        }
        match left {
            Left::Placed(mark) => hold::placed(links, mark),
            Left::Nothing => next(Event::Received).await,
            Left::Bytes => yield_now().await,
            Left::Full => {
                intake.look_ahead(links);
                // The ring goes on filling.
                select(links.pool_space.wait(), next(Event::Received)).await;
            }
        }
    }
}

struct Intake {
    received: Received,
    /// Lost line ends that have been seen to, of `lost_ends`.
    seen: u16,
    /// Lines that are still to be refused.
    refused: u16,
    /// The mark that told of them.
    then: u8,
    /// It has been sent XOFF.
    sender_stopped: bool,
}

impl Intake {
    /// Takes a turn's bytes.
    #[inline(never)]
    fn turn(&mut self, links: &Links) -> Left {
        let mut pool = links.lines.borrow_mut();
        let pool = &mut *pool;
        pool.keep_empty(links.mode.get() == Mode::Text);
        for _ in 0..TURN {
            if self.refused > 0 && !self.refuse(pool, links) {
                return Left::Full;
            }
            if self.received.is_empty() {
                return Left::Nothing;
            }
            let text = pool.put_text(self.received.waiting());
            self.received.release_many(text);
            if !pool.ready() {
                return Left::Full;
            }
            let Some(byte) = self.received.pop() else {
                return Left::Nothing;
            };
            let is_line = match byte {
                // In a comment it is text; but nothing else is cut then.
                CUT | GO if pool.aside() != Aside::None && links.flush.get() == Flush::None => {
                    false
                }
                CUT | GO => return Left::Placed(byte),
                ..MARKS => {
                    let is_line = self.loss(pool, byte, links);
                    if links.flush.get() == Flush::Input {
                        // It may stand for the cut.
                        return Left::Placed(CUT);
                    }
                    is_line
                }
                XON | XOFF if links.settings.borrow().has_xon_xoff() => {
                    uart::hold(byte == XOFF);
                    false
                }
                _ => pool.put(byte),
            };
            if is_line {
                links.parser_wake.signal();
            }
        }
        Left::Bytes
    }

    /// No line can be taken before the machine goes on: looks for real-time characters in the ring that have
    /// it do so. Cost: 30 cycles a byte.
    #[inline(never)]
    fn look_ahead(&self, links: &Links) {
        if !hold::is_on() && !links.stopped.get() {
            return;
        }
        let mut aside = links.lines.borrow().aside();
        for n in 0..self.received.len() {
            let Some(byte) = self.received.peek(n, |byte| *byte) else { return };
            if byte < MARKS && aside == Aside::None {
                hold::ahead(links, byte);
            }
            aside = aside.after(byte);
        }
    }

    /// Stops the sender, or lets it go on.
    #[inline(never)]
    fn control_flow(&mut self, links: &Links) {
        let waiting = self.received.len();
        let stop = match self.sender_stopped {
            true => waiting >= LOW_WATER,
            false => waiting > HIGH_WATER,
        };
        // One that was stopped must not stay so when the setting changes.
        let stop = stop && links.settings.borrow().has_xon_xoff();
        if stop != self.sender_stopped {
            self.sender_stopped = stop;
            uart::send_ahead(if stop { XOFF } else { XON });
        }
    }

    /// Bytes were lost here. Returns whether the mark stands for the end of a whole line.
    #[cold]
    #[inline(never)]
    fn loss(&mut self, pool: &mut LinePool, mark: u8, links: &Links) -> bool {
        let ends = lost_ends();
        self.refused = ends.wrapping_sub(core::mem::replace(&mut self.seen, ends));
        self.then = mark;
        let is_line = mark & BEHIND_END != 0 && pool.end(mark & RETURNED != 0);
        if mark & BEHIND_END == 0 {
            pool.spoil(Status::BufferFull);
        }
        if self.refused == 0 {
            self.after(pool);
        }
        if self.refused > 0 || mark & CLEAN == 0 {
            links.exception.set(Some(Status::BufferFull));
            links.reporter_wake.signal();
        }
        is_line
    }

    /// Enters the lines that were lost. False if there is no room for all of them.
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

    /// What follows is a line of its own, or the rest of one that is damaged.
    fn after(&mut self, pool: &mut LinePool) {
        if self.then & CLEAN == 0 {
            pool.spoil(Status::BufferFull);
        } else {
            pool.forget();
        }
        pool.follow(self.then & RETURNED != 0);
    }
}
