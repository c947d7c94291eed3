//! Feedhold, resume, queue flush and kill: what real-time characters, and `{qf:1}`, lead to.
//!
//! Called by the control task, and by the reader where a `%` or `^d` stands in the stream; exec asks whether
//! a hold is on. Thread mode decides, exec comes to rest, the planner drops what is queued:
//!
//! ```text
//!  !   begin: exec slows down; Held               ~   pass: exec goes on, once it is at rest
//!  %   in a hold, and ^d:
//!      serve    Flush::Input   the parser refuses data lines; nothing is interpreted any more
//!      marked   Flush::Rest    the reader has come to the `%`: lines from here on are kept, and wait
//!      planner  drop_blocks    exec, at rest, drops its blocks and has the position, to the step
//!               end            planner and model start from there; the hold is over
//! ```
//!
//! A hold is on from the character on, whatever the machine does, as long as there is anything to do: also
//! between two blocks, in a dwell, or while M0 waits. An idle machine has nothing to hold and takes no notice.
//! A `%` without a hold is none, unless an exclamation mark comes right behind it: programs begin and end
//! with one. A tilde while the machine slows down
//! waits until it stands; before an exclamation mark it is forgotten, and after a `%` as well, so that the
//! machine moves in no case.
//!
//! A line that is dropped is answered all the same, by [`Status::Terminated`](crate::status::Status): senders
//! count responses. Nothing here waits, and nothing can be full: all of it is states.

use super::links::Links;
use super::view::View;
use crate::hal::byte::SharedByte;
use crate::hal::event::Event;
use crate::hal::imp::time::millis;
use crate::hal::imp::{exec, flags, reset, uart};
use crate::realtime::{ENQUIRY, FLUSH, HOLD, KILL, RESET, RESUME};

/// How far a queue flush has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flush {
    /// There is none.
    #[default]
    None,
    /// What the reader gets is dropped, as far as the mark.
    Input,
    /// The same, and the mark is here: `{qf:1}`.
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
pub fn end() {
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

/// Acts upon the real-time characters that have come.
pub fn serve(links: &Links) {
    let characters = uart::take_realtime();
    if characters & RESET != 0 {
        reset();
    }
    let kills = characters & KILL != 0;
    let holds = characters & HOLD != 0 && is_busy(links);
    if kills || holds {
        begin();
    }
    if kills {
        links.killed.set(true);
    }
    if kills || (characters & FLUSH != 0 && is_on()) {
        flush(links, Flush::Input);
    } else if characters & FLUSH != 0 {
        links.percent.set(millis());
    } else if holds && millis().wrapping_sub(links.percent.get()) < TOGETHER_MS {
        flush_here(links, true);
    }
    if characters & RESUME != 0 && links.flush.get() == Flush::None {
        pass();
        links.cycle_start.signal();
    }
    if characters & ENQUIRY != 0 {
        links.enquiry.set(true);
    }
    if characters != 0 {
        links.reporter_wake.urge();
    }
}

/// `{qf:1}`: drops what is queued, as a `%` does. False, and nothing done, while the machine is busy without
/// a hold.
pub fn flush_here(links: &Links, busy: bool) -> bool {
    if busy && !is_on() {
        return false;
    }
    flush(links, Flush::Here);
    flags::set(Event::Received);
    true
}

fn flush(links: &Links, from: Flush) {
    if links.flush.get() == Flush::None {
        begin();
        links.flush.set(from);
        links.parser_wake.signal();
    }
}

/// The reader has come to the place of a `%` or `^d`: what it has got so far is what is dropped.
pub fn marked(links: &Links) {
    serve(links);
    if links.flush.get() != Flush::None {
        links.lines.borrow_mut().terminate_partial();
        rest(links);
    }
}

/// All lines in the pool are dropped, and the queue next. For the reader.
pub fn rest(links: &Links) {
    links.lines.borrow_mut().terminate();
    links.flush.set(Flush::Rest);
    links.parser_wake.signal();
    // Wherever the planner waits.
    links.planner_wake.signal();
    links.cycle_start.signal();
    flags::set(Event::BlockDone);
}

/// Whether there is anything to hold.
fn is_busy(links: &Links) -> bool {
    links.lines.borrow().has_data() || View::of(links).is_busy()
}
