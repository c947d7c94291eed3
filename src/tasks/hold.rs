//! Feedhold, resume, queue flush and kill: what real-time characters, and `{qf:1}`, lead to.
//!
//! Called by the control task, and by the reader where a tilde, `%` or `^d` stands in the stream; exec asks
//! whether a hold is on. Thread mode decides, exec comes to rest, the planner drops what is queued:
//!
//! ```text
//!  !   begin: exec slows down; Held               ~   pass: exec goes on, once it is at rest
//!  %   in a hold, and ^d:
//!      cut      Flush::Rest    lines of G-code that have come by then are refused, those behind wait
//!      planner  drop_blocks    exec, at rest, drops its blocks and has the position, to the step
//!               end            planner and model start from there; the hold is over
//! ```
//!
//! A cut goes through the streams of all ports at once. The port of the character is cut at its place, the others at the
//! byte that has come last. What the line pools hold is dropped at once. What is still in a receive ring is dropped when the
//! reader comes to it ([`Port::cut`]). Neither planner nor exec wait for that: a pool may be full, and its sender may take no answers.
//!
//! A hold is on from the character on, whatever the machine does, as long as there is anything to do: also
//! between two blocks, in a dwell, or while M0 waits. An idle machine has nothing to hold and takes no notice.
//! A `%` that does not come in a hold is none, unless an exclamation mark comes right behind it: programs begin and end
//! with one, and it may wait behind data. A tilde while the machine slows down waits until it stands. The machine does not go on if an
//! exclamation mark comes behind the tilde, nor if there is a `%` on either side.
//!
//! In a comment, tilde and `%` are text: the receive interrupt leaves marks where they stand (`serial::GO`,
//! `serial::CUT`), and the reader knows what a comment is. The exclamation mark stops the machine wherever
//! it stands, and at once.
//!
//! A line that is dropped is answered all the same, by [`Status::Terminated`](crate::status::Status): senders
//! count responses. Nothing here waits, and nothing can be full: all of it is states.

use super::jog;
use super::links::Links;
use super::ports::Port;
use super::view::View;
use crate::hal::byte::SharedByte;
use crate::hal::event::Event;
use crate::hal::imp::time::millis;
use crate::hal::imp::{exec, flags, reset, uart};
use crate::hal::serial::{CUT, GO, USB};
use crate::realtime::{ENQUIRY, FLUSH, HOLD, KILL, LET_GO, RESET, RESUME, UNPLACED};

/// How far a queue flush has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flush {
    /// There is none.
    #[default]
    None,
    /// All that has come is to be dropped, by the reader: `{qf:1}`.
    Here,
    /// The queue is to be dropped.
    Rest,
}

/// Characters of one write may come so far apart, ms.
const TOGETHER_MS: u32 = 20;

/// No hold.
const OFF: u8 = 0;
/// There is one.
const ON: u8 = 1;
/// There is one, that ends when the machine stands still.
const PASSING: u8 = 2;

machine_static! {
    // Thread mode writes it, and exec if it is `PASSING`.
    fn wanted() -> SharedByte = SharedByte::new(OFF);
    // Thread mode sets it, exec clears it.
    fn dropping() -> SharedByte = SharedByte::new(0);
}

/// Whether a hold is on. Any level.
#[inline(always)]
pub fn is_on() -> bool {
    wanted().get() != OFF
}

/// Whether a machine that is `running` is to come to rest: it does not wait for thread mode, which may have a report
/// to put, to begin the hold. Exec only.
#[inline(always)]
pub fn is_wanted(running: bool) -> bool {
    is_on() || (running && uart::asks_hold())
}

/// Whether the machine is to go on when it has come to rest.
pub fn is_passing() -> bool {
    wanted().get() == PASSING
}

/// Begins a hold.
fn begin() {
    wanted().set(ON);
    exec::pend();
}

/// Ends a hold at once.
fn end() {
    wanted().set(OFF);
    exec::pend();
}

/// Ends a hold when the machine has come to rest.
fn pass() {
    // Exec changes it only if it is `PASSING`.
    if wanted().get() == ON {
        wanted().set(PASSING);
        exec::pend();
    }
}

/// The machine has come to rest: whether it goes on. Exec only.
pub fn passes() -> bool {
    let passes = is_passing();
    if passes {
        wanted().set(OFF);
    }
    passes
}

/// Has exec drop its blocks; it sets [`Event::BlockDone`] when it [has](has_dropped).
pub fn drop_blocks() {
    dropping().set(1);
    exec::pend();
}

/// Whether exec has dropped its blocks.
pub fn has_dropped() -> bool {
    dropping().get() == 0
}

/// Exec, at rest, drops its blocks if that is wanted, by `drop_all`.
pub fn dropped(drop_all: impl FnOnce()) {
    if dropping().get() != 0 {
        drop_all();
        dropping().set(0);
        flags::set(Event::BlockDone);
    }
}

/// An alarm: drops what is queued when the machine has come to rest, which it does now.
/// What waits to be interpreted is left to the parser.
pub fn abandon(links: &Links) {
    begin();
    links.percent.set(false);
    links.resume.set(false);
    drop_queue(links);
}

/// The queue has been dropped: the hold is over, unless the door is open.
pub fn over(links: &Links) {
    links.flush.set(Flush::None);
    if !links.door_open.get() {
        end();
    }
}

/// The door has been opened: nothing moves. Or shut: what is held waits for a tilde, if there is anything.
pub fn door(links: &Links, open: bool) {
    links.door_open.set(open);
    let works = links.has_data() || View::of(links, links.feeder()).has_work();
    if open {
        begin();
    } else if !works && links.flush.get() == Flush::None {
        end();
    }
}

/// Acts upon the real-time characters that have come, on any port.
pub fn serve(links: &Links) {
    // Before the character is taken: exec has begun, and is not to go on in between.
    if uart::asks_hold() && is_busy(links) {
        // Those of a hold before this one count for nothing.
        links.percent.set(links.percent.get() && is_on());
        begin();
    }
    for port in &links.ports {
        let characters = uart::take_realtime(port.number);
        if characters != 0 {
            act(links, port, characters);
        }
    }
}

#[inline(never)]
#[small]
fn act(links: &Links, port: &Port, characters: u8) {
    if characters & RESET != 0 {
        reset();
    }
    if characters & LET_GO != 0 {
        uart::kick(port.number);
    }
    let (holds, cuts) = (characters & HOLD != 0, characters & FLUSH != 0);
    let (kills, busy) = (characters & KILL != 0, holds && is_busy(links));
    if holds {
        links.resume.set(false);
    }
    if kills || busy {
        begin();
    } else if holds {
        jog::bar(links);
    }
    if kills {
        links.killed.set(true);
        cut(links, port, uart::last_cut(port.number));
    }
    if cuts && is_on() {
        links.percent.set(true);
    } else if cuts {
        // Up to a ms early: 0 is none.
        links.percent_at.set(millis().wrapping_sub(1) | 1);
    } else if holds {
        let at = links.percent_at.take();
        if busy && at != 0 && millis().wrapping_sub(at) < TOGETHER_MS {
            flush_here(links, true);
        }
    }
    if characters & RESUME != 0 {
        links.resume.set(true);
    }
    if characters & UNPLACED != 0 {
        go_on(links);
    }
    if characters & ENQUIRY != 0 {
        port.enquiry.set(true);
        links.parser_wake.signal();
    }
    links.reporter_wake.urge();
}

/// `{qf:1}`: drops what is queued, as a `%` does. False, and nothing done, while the machine is busy without
/// a hold.
pub fn flush_here(links: &Links, busy: bool) -> bool {
    if busy && !is_on() {
        return false;
    }
    if links.flush.get() == Flush::None {
        begin();
        links.flush.set(Flush::Here);
        flags::set(Event::Received);
    }
    true
}

/// The reader drops all that has come, if that is wanted.
#[inline(always)]
pub fn here(links: &Links) {
    if links.flush.get() == Flush::Here {
        cut(links, links.port(USB), uart::newest(USB));
    }
}

/// Drops the lines of G-code that have come: on this port up to a slot of its receive ring, or what the reader has got;
/// on others all. A line that has come in part goes whole.
#[inline(never)]
#[small]
fn cut(links: &Links, port: &Port, slot: Option<u8>) {
    begin();
    links.percent.set(false);
    for each in &links.ports {
        let slot = if each.number == port.number { slot } else { uart::newest(each.number) };
        let mut lines = each.lines.borrow_mut();
        lines.terminate();
        match slot {
            Some(_) => each.cut.set(slot),
            None if each.cut.get().is_none() => lines.terminate_partial(),
            None => {}
        }
    }
    drop_queue(links);
}

/// The reader has come to the place of a real-time character on a port, outside of comments, and behind all cuts.
pub fn placed(links: &Links, port: &Port, mark: u8) {
    serve(links);
    if mark == GO {
        go_on(links);
    } else if is_on() && links.percent.get() {
        cut(links, port, None);
    }
}

/// A real-time character still waits in the receive ring, at `slot`, because the pool is full. One that is not there any
/// more has left the mark of a loss.
pub fn ahead(links: &Links, port: &Port, mark: u8, slot: u8) {
    serve(links);
    if mark != CUT {
        go_on(links);
    }
    if is_on() && mark != GO && links.percent.get() {
        cut(links, port, Some(slot));
    }
}

/// What is held goes on; and what waits at a program stop.
fn go_on(links: &Links) {
    if links.resume.take() && links.flush.get() == Flush::None && !links.door_open.get() {
        pass();
        links.cycle_start.signal();
        // It may have looked already, when the character came, and sleep again.
        links.reporter_wake.urge();
    }
}

/// The planner is to drop the queue.
fn drop_queue(links: &Links) {
    links.flush.set(Flush::Rest);
    links.parser_wake.signal();
    // Wherever the planner waits.
    links.planner_wake.signal();
    links.cycle_start.signal();
    flags::set(Event::BlockDone);
}

/// Whether there is anything to hold.
fn is_busy(links: &Links) -> bool {
    links.has_data() || View::of(links, links.feeder()).is_busy()
}
