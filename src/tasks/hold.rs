//! Feedhold, resume, queue flush and kill: the actions of real-time characters and of `{qf:1}`.
//!
//! Called by the control task, and by the reader where a tilde, `%` or `^d` stands in the stream. Exec checks whether a
//! hold is on. Thread mode decides, exec decelerates to a standstill, and the planner drops the queue:
//!
//! ```text
//!  !   Event::Hold: exec slows down               ~   Event::Resume: exec goes on, once it is at rest
//!  %   in a hold, and ^d:
//!      cut      Event::Cut, Event::Kill   lines of G-code that have come by then are refused, later ones wait
//!      planner  drop_blocks               exec, at rest, drops its blocks and has the position, to the step
//!               Event::Dropped            planner and model start from there; the hold is over
//! ```
//!
//! The states that these events lead to are in [`machine`].
//!
//! A cut applies to the streams of all ports. The port of the character is cut where the character stands, the other
//! ports after the last byte received. Lines in the line pools are dropped at once. Bytes in a receive ring are dropped
//! when the reader reaches them ([`Port::cut`]). Neither the planner nor exec waits for the reader, because a pool may
//! be full and its sender may take no answers.
//!
//! A hold is on from the moment the character comes, as long as there is anything to do: also between two blocks, in a
//! dwell, or while M0 waits. An idle machine has nothing to hold and ignores the character.
//!
//! A `%` flushes only if it arrives in a hold, or if an exclamation mark comes directly after it. Any other `%` begins
//! or ends a program, and the name of the program may follow ([`LinePool::percent`]). The time of arrival decides, because the `%` of a program may still wait behind data when a hold
//! begins.
//!
//! A tilde that comes while the machine slows down takes effect at the standstill. The machine does not resume if an
//! exclamation mark comes after the tilde, or a `%` before or after it.
//!
//! In a comment, tilde and `%` are text. The receive interrupt puts marks in their place (`serial::GO`, `serial::CUT`),
//! and the reader knows whether a mark is in a comment. The exclamation mark stops the machine at once, also in a
//! comment.
//!
//! A dropped line still gets its response, because senders count responses: [`Status::Terminated`], or the status of
//! the alarm if there is one. Only lines before a reset of their own sender get none ([`Class::Gone`]). When a line ends
//! an alarm, G-code that has come before is refused ([`Class::Late`]), but no other line: a line that is allowed in an
//! alarm is never refused because of another port. Nothing here
//! waits, and nothing can be full, because everything is kept as states.

use super::jog;
#[cfg(doc)]
use super::lines::Class;
use super::lines::LinePool;
use super::links::Links;
use super::overrides;
use super::ports::{self, Cut, GREETING, INTERRUPTED, OPENED, OTHERS, Port};
use super::view::View;
use crate::gcode::overrides::{Change, FULL, Override};
use crate::hal::event::Event;
use crate::hal::serial::{CUT, GO, USB};
use crate::hal::system::reset;
use crate::hal::time::millis;
use crate::hal::{Interrupt, Thread, flags, uart};
use crate::machine::{self, Alarm};
use crate::protocol::{Hold, Machine, Speech};
use crate::realtime::{ENQUIRY, FLUSH, HOLD, KILL, LET_GO, RESET, RESUME, UNPLACED};
use crate::status::Status;

/// Whether a machine that is `running` must stop. The character alone begins the hold, because thread mode may be busy
/// with a report. An open door holds nothing in an alarm, where nothing moves: the end of a program need not wait for
/// the door.
#[inline(always)]
pub fn is_wanted(_: Interrupt, running: bool) -> bool {
    (machine::is_held() && !machine::is_locked()) || (running && uart::asks_hold())
}

/// Drops everything when an alarm begins: the queue, once the machine has stopped, and the lines of G-code received so
/// far. Skips a pool that is in use: the reader or the parser has found the line there that begins the alarm, and drops
/// the contents of that pool.
pub fn abandon(links: &Links) {
    links.signs.clear();
    for port in &links.ports {
        if let Ok(mut lines) = port.lines.try_borrow_mut() {
            // A probing that has failed has begun the alarm itself: its line is answered when the result has been told.
            let probed = port.speech.get().is_in_order() && links.probe.is_news();
            lines.terminate_from(probed.into(), dropped());
            cut_up_to(port, &mut lines, uart::newest(links.thread, port.number));
        }
    }
    drop_queue(links);
}

/// Has G-code refused that has come on other ports in an alarm which a line has just ended. The pool of that line is in
/// use. All bytes that wait behind a full pool came before the end of the alarm.
#[cold]
#[inline(never)]
#[small]
pub fn refuse_others(links: &Links) {
    for port in &links.ports {
        if let Ok(mut lines) = port.lines.try_borrow_mut() {
            lines.refuse();
            if !lines.ready() {
                refuse_up_to(port, uart::newest(links.thread, port.number));
            }
        }
    }
}

/// Has G-code in the stream of a port refused up to a slot of its receive ring, as [`LinePool::refuse`] does.
pub fn refuse_up_to(port: &Port, slot: Option<u8>) {
    if let Some(slot) = slot.filter(|_| !port.is_resetting()) {
        port.cut.set(match port.cut.get() {
            Cut::All(_) => Cut::All(slot),
            _ => Cut::Gcode(slot),
        });
    }
}

/// Cuts the stream of a port: behind `slot` of its receive ring, or, if that is `None`, where the reader is. Does
/// nothing on a port with a reset of its own: the greeting waits for the cut where that reset stands, and what is
/// behind that cut may have no room before the greeting.
pub fn cut_up_to(port: &Port, lines: &mut LinePool, slot: Option<u8>) {
    if !port.is_resetting() {
        cut_here(port, lines, slot);
    }
}

/// Cuts the stream of a port as [`cut_up_to`] does, on any port.
fn cut_here(port: &Port, lines: &mut LinePool, slot: Option<u8>) {
    match slot {
        Some(slot) => port.cut.set(Cut::All(slot)),
        None if port.cut.get().is_none() => lines.terminate_partial(dropped()),
        None => {}
    }
}

/// Returns the status with which lines are answered that are dropped now.
#[inline(never)]
pub fn dropped() -> Status {
    match machine::alarm() {
        Alarm::None => Status::Terminated,
        alarm => alarm.status(),
    }
}

/// Returns the status with which G-code is refused that has come in an alarm, also if that has been ended.
pub fn locked() -> Status {
    match dropped() {
        Status::Terminated => Status::Alarmed,
        status => status,
    }
}

/// Takes a change of the door. An open door holds all motion. When the door has been shut, what is held waits for a
/// tilde, if there is anything.
pub fn door(links: &Links, open: bool) {
    if open && machine::goes_on() {
        // The door begins a hold of its own: a percent sign belongs to an earlier one.
        links.signs.percent.set(false);
    }
    let works = links.has_data() || View::of(links, links.feeder()).has_work();
    links.signs.door.set(works);
    machine::take(
        links.thread,
        match works {
            _ if open => machine::Event::DoorOpened,
            true => machine::Event::DoorShut,
            false => machine::Event::DoorShutIdle,
        },
    );
}

/// Holds the machine as if the door were opened and shut at once: nothing moves until a tilde. Also holds a machine at
/// a standstill. Does nothing while the door is open, in an alarm, and in check mode.
#[inline(never)]
#[small]
pub fn knock(links: &Links) {
    if may_hold_at_rest() && !machine::has_open_door() {
        door(links, true);
        links.signs.door.set(true);
        machine::take(links.thread, machine::Event::DoorShut);
    }
}

/// Whether a machine at a standstill may be held: not in an alarm, and not in check mode.
fn may_hold_at_rest() -> bool {
    !machine::is_alarmed() && !machine::is_checking()
}

/// Acts on the real-time characters received on any port.
pub fn serve(links: &Links) {
    // Before the character is taken: exec has begun the hold because the character waits, and must not resume in
    // between.
    if uart::asks_hold() && is_busy(links) {
        // A `%` of an earlier hold is ignored.
        links.signs.percent.set(links.signs.percent.get() && machine::is_held());
        links.signs.door.set(links.signs.door.get() && machine::is_held());
        machine::take(links.thread, machine::Event::Hold);
    }
    for port in &links.ports {
        let characters = uart::take_realtime(links.thread, port.number);
        if characters != 0 {
            act(links, port, characters);
        }
        // Not if a `^x` has come meanwhile: what is behind that runs.
        if Speech::HAS_QUESTION && port.take_asked(ports::RESET) && !port.is_resetting() {
            start_over(links, port, uart::newest(links.thread, port.number), false);
        }
    }
}

#[inline(never)]
#[small]
fn act(links: &Links, port: &Port, characters: u8) {
    // A printing host sends no such character. It is a damaged byte of a line, and the host sends that line again.
    let resets = characters & RESET != 0 && machine::is_alarmed();
    let characters = match port.is_plain() && !resets {
        true => characters & LET_GO,
        false => characters,
    };
    if port.is_plain() && characters == 0 {
        return;
    }
    if characters & RESET != 0 {
        if starts_over(port) {
            // The end of the program, which an earlier reset has queued, is no motion.
            let works = !links.is_resetting() && is_moving(links, port);
            return start_over(links, port, uart::last_cut(links.thread, port.number), works);
        }
        reset(links.thread);
    }
    if characters & LET_GO != 0 {
        uart::kick(links.thread.level(), port.number);
    }
    // Senders of grbl's dialect flush nothing by a percent sign: it only begins and ends programs.
    let cuts = characters & FLUSH != 0 && !port.speech.get().is_in_order();
    let holds = characters & HOLD != 0;
    let (kills, busy) = (characters & KILL != 0, holds && is_busy(links));
    let signs = &links.signs;
    if holds {
        signs.resume.set(false);
    }
    if busy {
        machine::take(links.thread, machine::Event::Hold);
        if port.speech.get().is_in_order() && machine::cycle() == machine::Cycle::Jog {
            // In grbl's dialect a hold ends a jog.
            jog::end(links);
        }
    } else if holds && !kills {
        jog::bar(links);
        if port.speech.get().is_in_order() && may_hold_at_rest() {
            machine::take(links.thread, machine::Event::Hold);
        }
    }
    if kills {
        cut(links, port, uart::last_cut(links.thread, port.number), machine::Event::Kill);
    }
    if cuts && machine::is_held() {
        signs.percent.set(true);
    } else if cuts {
        signs.lone_percent(millis());
    } else if holds && signs.take_lone_percent(millis()) && busy {
        // Cuts at the percent sign, which the reader has mostly passed: what has come since belongs to what follows.
        cut(links, port, uart::last_cut(links.thread, port.number), machine::Event::Cut);
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

/// Whether a reset character drops the job instead of resetting the chip. It does so in a dialect that keeps its lines
/// in order, unless there is a panic.
#[inline(never)]
#[small]
fn starts_over(port: &Port) -> bool {
    port.speech.get().is_in_order() && machine::alarm() != Alarm::Panic
}

/// Carries out a reset in a dialect that keeps the position. What has come, up to a slot of the receive ring, is
/// dropped; the program ends; overrides are as programmed. When that is done, the reporter greets. If the machine
/// `works`, it is interrupted, and the reporter begins an alarm before the greeting.
#[inline(never)]
#[small]
fn start_over(links: &Links, port: &Port, slot: Option<u8>, works: bool) {
    cut(links, port, slot, machine::Event::Kill);
    let mut lines = port.lines.borrow_mut();
    lines.drop_unanswered();
    if port.cut.get().is_none() {
        // The next byte begins a line.
        lines.forget();
    }
    drop(lines);
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

/// Drops the queue, as a `%` in a hold does: for `{qf:1}`, and for the end of a jog. The caller has refused `{qf:1}` if
/// the machine is busy without a hold.
pub fn flush_here(thread: Thread) {
    machine::take(thread, machine::Event::Flush);
    flags::set(Event::Received);
}

/// Drops all lines received, if [`flush_here`] has requested it. Called by the reader.
#[inline(always)]
pub fn here(links: &Links) {
    if machine::is_to_cut() {
        // Nothing is cut a second time on a port with a reset of its own.
        let port = links.ports.iter().find(|port| !port.is_resetting());
        let port = port.unwrap_or(links.port(USB));
        cut(links, port, uart::newest(links.thread, port.number), machine::Event::Cut);
    }
}

/// Drops the lines of G-code that have come. On this port that is up to `slot` of its receive ring, or, if that is
/// `None`, up to where the reader is; on other ports it is everything. A line that has come in part is dropped whole.
#[inline(never)]
#[small]
fn cut(links: &Links, port: &Port, slot: Option<u8>, event: machine::Event) {
    machine::take(links.thread, event);
    links.signs.percent.set(false);
    for each in &links.ports {
        let mut lines = each.lines.borrow_mut();
        let is_own = each.number == port.number;
        if is_own && each.is_resetting() {
            // What waits for the greeting would keep the reader from the cut.
            lines.drop_unanswered();
        }
        lines.terminate(dropped());
        match is_own {
            true => cut_here(each, &mut lines, slot),
            false => cut_up_to(each, &mut lines, uart::newest(links.thread, each.number)),
        }
    }
    drop_queue(links);
}

/// Acts on a real-time character where it stands: the reader has come to its mark, outside comments and behind all
/// cuts.
pub fn placed(links: &Links, port: &Port, mark: u8) {
    if mark == CUT {
        // A cut, if there is one, undoes this.
        port.lines.borrow_mut().percent();
    }
    serve(links);
    if mark == GO {
        go_on(links);
    } else if machine::is_held() && links.signs.percent.get() && !port.speech.get().is_in_order() {
        cut(links, port, None, machine::Event::Cut);
    }
}

/// Acts on the mark of a real-time character that still waits in the receive ring, at `slot`, because the pool is
/// full. A loss marker counts as any of them: a mark may have been lost there.
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

/// Resumes a hold or a program stop if a tilde has come.
pub(super) fn go_on(links: &Links) {
    if links.signs.resume.take() && machine::may_resume() {
        machine::take(links.thread, machine::Event::Resume);
        links.cycle_start.signal();
        // The reporter may have checked already when the character came, and be waiting again.
        links.reporter_wake.notify_now();
    }
}

/// Makes the planner drop the queue.
fn drop_queue(links: &Links) {
    links.parser_wake.signal();
    // Wakes the planner wherever it waits.
    links.wake_planner();
    links.cycle_start.signal();
    flags::set(Event::BlockDone);
}

/// Whether motors turn, or a cycle runs in which they may stand still for a moment. Not true for a hold at standstill,
/// a dwell, a program stop, check mode, or a built-in job without a line under way.
#[inline(never)]
#[small]
fn is_moving(links: &Links, port: &Port) -> bool {
    let mut view = View::of(links, port);
    // An axis between its switch and its zero is not where it says, also in a hold.
    let homes = machine::cycle() == machine::Cycle::Homing;
    let held = (view.hold() == Hold::Rests || view.dwells()) && !homes;
    !(held || machine::is_stopped() || machine::is_checking()) && view.carries_out()
}

/// Whether there is anything to hold. In an alarm nothing moves, and lines that wait are refused.
fn is_busy(links: &Links) -> bool {
    if machine::is_alarmed() {
        return false;
    }
    links.has_data() || View::of(links, links.feeder()).is_busy()
}
