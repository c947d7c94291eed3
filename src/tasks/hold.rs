//! Feedhold, resume, queue flush and kill: what real-time characters, and `{qf:1}`, lead to.
//!
//! Called by the control task, and by the reader where a tilde, `%` or `^d` stands in the stream; exec asks
//! whether a hold is on. Thread mode decides, exec comes to rest, the planner drops what is queued:
//!
//! ```text
//!  !   Event::Hold: exec slows down               ~   Event::Resume: exec goes on, once it is at rest
//!  %   in a hold, and ^d:
//!      cut      Event::Cut, Event::Kill   lines of G-code that have come by then are refused, those behind wait
//!      planner  drop_blocks               exec, at rest, drops its blocks and has the position, to the step
//!               Event::Dropped            planner and model start from there; the hold is over
//! ```
//!
//! The states that these events lead to are in [`machine`].
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
//! A line that is dropped is answered all the same, by [`Status::Terminated`], in an alarm by that of the alarm: senders
//! count responses. Nothing here waits, and nothing can be full: all of it is states.

use super::jog;
use super::lines::LinePool;
use super::links::Links;
use super::overrides;
use super::ports::{self, GREETING, INTERRUPTED, OPENED, OTHERS, Port};
use super::view::View;
use crate::gcode::overrides::{Change, FULL, Override};
use crate::hal::event::Event;
use crate::hal::serial::{CUT, GO, USB};
use crate::hal::system::reset;
use crate::hal::time::millis;
use crate::hal::{flags, uart};
use crate::machine::{self, Alarm};
use crate::protocol::{Hold, Machine};
use crate::realtime::{ENQUIRY, FLUSH, HOLD, KILL, LET_GO, RESET, RESUME, UNPLACED};
use crate::status::Status;

/// Whether a machine that is `running` is to come to rest: it does not wait for thread mode, which may have a report
/// to put, to begin the hold. Exec only.
#[inline(always)]
pub fn is_wanted(running: bool) -> bool {
    machine::is_held() || (running && uart::asks_hold())
}

/// An alarm has begun: what is queued is dropped when the machine has come to rest, which it does now, and so are the lines of
/// G-code that have come by then. A pool that is in use is left to the task that uses it: the reader or the parser has found a line
/// there that begins the alarm, and drops what that pool holds.
pub fn abandon(links: &Links) {
    links.signs.clear();
    for port in &links.ports {
        if let Ok(mut lines) = port.lines.try_borrow_mut() {
            lines.terminate(dropped());
            cut_up_to(port, &mut lines, uart::newest(port.number));
        }
    }
    drop_queue(links);
}

/// A control line has come on a port in an alarm, whose pool this is: G-code that has come before it on any port is refused, also if
/// the line ends the alarm. Behind a full pool of another port all that waits has come before it.
#[cold]
#[inline(never)]
#[small]
pub fn refuse_older(links: &Links, pool: &mut LinePool) {
    pool.refuse(dropped());
    for port in &links.ports {
        if let Ok(mut lines) = port.lines.try_borrow_mut() {
            lines.refuse(dropped());
            if !lines.ready() {
                cut_up_to(port, &mut lines, uart::newest(port.number));
            }
        }
    }
}

/// Cuts the stream of a port at a slot of its receive ring, or at what the reader has got.
fn cut_up_to(port: &Port, lines: &mut LinePool, slot: Option<u8>) {
    match slot {
        Some(_) => port.cut.set(slot),
        None if port.cut.get().is_none() => lines.terminate_partial(dropped()),
        None => {}
    }
}

/// What lines are answered that are dropped now.
#[inline(never)]
pub fn dropped() -> Status {
    match machine::alarm() {
        Alarm::None => Status::Terminated,
        alarm => alarm.status(),
    }
}

/// The door has been opened: nothing moves. Or shut: what is held waits for a tilde, if there is anything.
pub fn door(links: &Links, open: bool) {
    if open && machine::goes_on() {
        // A hold of its own: a percent sign was of one before it.
        links.signs.percent.set(false);
    }
    let works = links.has_data() || View::of(links, links.feeder()).has_work();
    links.signs.door.set(works);
    machine::take(match works {
        _ if open => machine::Event::DoorOpened,
        true => machine::Event::DoorShut,
        false => machine::Event::DoorShutIdle,
    });
}

/// Opens the door and shuts it at once: nothing moves until a tilde, at rest too. While the door is open it does nothing.
#[inline(never)]
#[small]
pub fn knock(links: &Links) {
    if may_hold_at_rest() && !machine::has_open_door() {
        door(links, true);
        links.signs.door.set(true);
        machine::take(machine::Event::DoorShut);
    }
}

/// Whether a machine that rests may be held: not in an alarm, and not while lines are checked alone.
fn may_hold_at_rest() -> bool {
    !machine::is_alarmed() && !machine::is_checking()
}

/// Acts upon the real-time characters that have come, on any port.
pub fn serve(links: &Links) {
    // Before the character is taken: exec has begun, and is not to go on in between.
    if uart::asks_hold() && is_busy(links) {
        // Those of a hold before this one count for nothing.
        links.signs.percent.set(links.signs.percent.get() && machine::is_held());
        links.signs.door.set(links.signs.door.get() && machine::is_held());
        machine::take(machine::Event::Hold);
    }
    for port in &links.ports {
        let characters = uart::take_realtime(port.number);
        if characters != 0 {
            act(links, port, characters);
        }
        if port.take_asked(ports::RESET) {
            start_over(links, port, uart::newest(port.number), false);
        }
    }
}

#[inline(never)]
#[small]
fn act(links: &Links, port: &Port, characters: u8) {
    // A byte of a printing host that became one on its way is missing in its line, which is sent again.
    let resets = characters & RESET != 0 && machine::is_alarmed();
    let characters = match port.is_plain() && !resets {
        true => characters & LET_GO,
        false => characters,
    };
    if port.is_plain() && characters == 0 {
        return;
    }
    if characters & RESET != 0 {
        if starts_over(links, port) {
            let works = is_moving(links, port);
            return start_over(links, port, uart::last_cut(port.number), works);
        }
        reset();
    }
    if characters & LET_GO != 0 {
        uart::kick(port.number);
    }
    // Programs begin and end with a percent sign, and grbl's senders drop nothing by one.
    let cuts = characters & FLUSH != 0 && !port.speech.get().is_in_order();
    let holds = characters & HOLD != 0;
    let (kills, busy) = (characters & KILL != 0, holds && is_busy(links));
    let signs = &links.signs;
    if holds {
        signs.resume.set(false);
    }
    if busy {
        machine::take(machine::Event::Hold);
    } else if holds && !kills {
        jog::bar(links);
        if port.speech.get().is_in_order() && may_hold_at_rest() {
            machine::take(machine::Event::Hold);
        }
    }
    if kills {
        cut(links, port, uart::last_cut(port.number), machine::Event::Kill);
    }
    if cuts && machine::is_held() {
        signs.percent.set(true);
    } else if cuts {
        signs.lone_percent(millis());
    } else if holds && signs.take_lone_percent(millis()) && busy {
        // At the place of the percent sign, which the reader has passed, mostly: what has come since belongs to what follows.
        cut(links, port, uart::last_cut(port.number), machine::Event::Cut);
    }
    if characters & RESUME != 0 {
        signs.resume.set(true);
    }
    if characters & UNPLACED != 0 {
        go_on(links);
    }
    if characters & ENQUIRY != 0 {
        port.enquiry.set(true);
        links.parser_wake.signal();
    }
    links.reporter_wake.notify_now();
}

/// Whether a reset starts over instead of starting the board anew: in a dialect in which it does, and on a port that is undecided while the machine
/// has nothing to do. There a sender may begin so, and goes on with lines that the start of a board would lose.
#[inline(never)]
#[small]
fn starts_over(links: &Links, port: &Port) -> bool {
    if port.waits_for_question() {
        return machine::alarm() == Alarm::None && !is_busy(links) && !links.has_data();
    }
    port.speech.get().is_in_order() && machine::alarm() != Alarm::Panic
}

/// A reset in a dialect that keeps the position: what has come up to a slot of the receive ring is dropped, the program ends, overrides are as programmed; the reporter greets
/// when that is done, and begins an alarm before if the machine `works`, which is interrupted.
#[inline(never)]
#[small]
fn start_over(links: &Links, port: &Port, slot: Option<u8>, works: bool) {
    cut(links, port, slot, machine::Event::Kill);
    if port.cut.get().is_none() {
        // What comes next begins a line.
        port.lines.borrow_mut().forget();
    }
    for which in [Override::Feed, Override::Traverse, Override::Spindle] {
        overrides::change(links.thread, Change::to(which, FULL));
    }
    let homes = machine::cycle() == machine::Cycle::Homing;
    let interrupted = if homes { INTERRUPTED | ports::HOMING } else { INTERRUPTED };
    port.ask(if works { GREETING | interrupted } else { GREETING });
    if uart::sees_opening() {
        port.take_asked(OPENED);
    }
    if port.is_undecided() {
        port.ask(OTHERS);
    }
    links.reporter_wake.notify_now();
}

/// Drops what is queued, as a `%` does: `{qf:1}`, unless the machine is busy without a hold.
pub fn flush_here() {
    machine::take(machine::Event::Flush);
    flags::set(Event::Received);
}

/// The reader drops all that has come, if that is wanted.
#[inline(always)]
pub fn here(links: &Links) {
    if machine::is_to_cut() {
        cut(links, links.port(USB), uart::newest(USB), machine::Event::Cut);
    }
}

/// Drops the lines of G-code that have come: on this port up to a slot of its receive ring, or what the reader has got;
/// on others all. A line that has come in part goes whole.
#[inline(never)]
#[small]
fn cut(links: &Links, port: &Port, slot: Option<u8>, event: machine::Event) {
    machine::take(event);
    links.signs.percent.set(false);
    for each in &links.ports {
        let slot = if each.number == port.number { slot } else { uart::newest(each.number) };
        let mut lines = each.lines.borrow_mut();
        lines.terminate(dropped());
        cut_up_to(each, &mut lines, slot);
    }
    drop_queue(links);
}

/// The reader has come to the place of a real-time character on a port, outside of comments, and behind all cuts.
pub fn placed(links: &Links, port: &Port, mark: u8) {
    serve(links);
    if mark == GO {
        go_on(links);
    } else if machine::is_held() && links.signs.percent.get() && !port.speech.get().is_in_order() {
        cut(links, port, None, machine::Event::Cut);
    }
}

/// A real-time character still waits in the receive ring, at `slot`, because the pool is full. One that is not there any
/// more has left the mark of a loss.
pub fn ahead(links: &Links, port: &Port, mark: u8, slot: u8) {
    serve(links);
    if mark != CUT {
        go_on(links);
    }
    let counts = mark != GO && !port.speech.get().is_in_order();
    if machine::is_held() && counts && links.signs.percent.get() {
        cut(links, port, Some(slot), machine::Event::Cut);
    }
}

/// What is held goes on; and what waits at a program stop.
pub(super) fn go_on(links: &Links) {
    if links.signs.resume.take() && machine::may_resume() {
        machine::take(machine::Event::Resume);
        links.cycle_start.signal();
        // It may have looked already, when the character came, and sleep again.
        links.reporter_wake.notify_now();
    }
}

/// The planner is to drop the queue.
fn drop_queue(links: &Links) {
    links.parser_wake.signal();
    // Wherever the planner waits.
    links.planner_wake.signal();
    links.cycle_start.signal();
    flags::set(Event::BlockDone);
}

/// Whether anything is carried out that is not held at rest, at a program stop, or only checked.
#[inline(never)]
#[small]
fn is_moving(links: &Links, port: &Port) -> bool {
    let mut view = View::of(links, port);
    let rests = machine::is_stopped() || machine::is_checking() || view.hold() == Hold::Rests;
    !rests && view.has_work()
}

/// Whether there is anything to hold.
fn is_busy(links: &Links) -> bool {
    links.has_data() || View::of(links, links.feeder()).is_busy()
}
