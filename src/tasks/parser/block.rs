//! Blocks of G-code, from ports and from built-in jobs: they are interpreted and handed to the planner.

use heapless::Vec;

use super::answer::has_room;
#[cfg(feature = "card-write")]
use crate::card;
use crate::hal::Thread;
use crate::hal::eeprom::Eeprom;
use crate::jobs::Job;
use crate::machine::alarm::is_program_end;
use crate::machine::{self, Alarm, Cycle};
use crate::protocol::jog;
use crate::status::Status;
use crate::tasks::alarm;
#[cfg(feature = "dialect-reprap")]
use crate::tasks::heat;
use crate::tasks::hold;
use crate::tasks::links::{Changes, Last, Links};
use crate::tasks::ports::Port;
use crate::tasks::reporter::tell_startup;
use crate::tasks::view::View;

/// Whether a block can be carried out or refused now: not while the planner or the tables are busy, or while anything
/// is being dropped.
pub fn is_free(links: &Links) -> bool {
    let waits = !links.command_sender().is_free() || links.storage.is_awaited();
    !waits && !machine::is_flushing()
}

/// Whether there is room to report the status of the job's next line, if it is to be reported.
#[inline(never)]
#[small]
pub(super) fn has_room_for_startup(links: &Links) -> bool {
    let tells = links.job.get().startup().is_some();
    !tells || has_room(links.told()) == Some(true)
}

/// Whether the next line of a built-in job waits for the end of a jog.
#[inline(never)]
#[small]
pub(super) fn waits_for_jog(links: &Links) -> bool {
    machine::cycle() == Cycle::Jog && !links.job.get().is_none()
}

/// Carries out the next line of a built-in job. A refused line is reported as an exception. The reporter reports the
/// end of the job when everything has been carried out.
#[inline(never)]
#[small]
pub(super) fn job_line(links: &Links) {
    let mut job = links.job.get();
    let mut line = Vec::new();
    let startup = job.startup();
    if !job.next_line(&Eeprom::of(links.thread), &mut line) {
        job.end();
    } else {
        match interpret(links, &line, false).0 {
            Status::Again => return,
            status if startup.is_some() => {
                if !line.is_empty() {
                    tell_startup(links, startup.unwrap_or(0), status);
                }
            }
            Status::Ok if links.command_sender().ends_program() => job.end(),
            Status::Ok | Status::Noop => {}
            status => {
                job = Job::default();
                links.except(status);
            }
        }
    }
    links.job.set(job);
    links.reporter_wake.signal();
}

/// Interprets a block that has come on a port, or refuses it if that port does not feed the machine. Returns also
/// whether the block may have a comment. A block that is `late` is treated as if the alarm were on in which it has come.
#[inline(never)]
pub fn run_block(
    links: &Links,
    port: &Port,
    block: &[u8],
    declined: bool,
    late: bool,
) -> (Status, bool) {
    // Senders of a dialect in order end an alarm by other means than the end of a program.
    let locked = match port.speech.get().is_in_order() {
        true => late || machine::is_alarmed(),
        false => late && !is_program_end(block),
    };
    match links.may_feed(port) {
        #[cfg(feature = "card-write")]
        true if card::writes() && jog(block).is_some() => (Status::NotAccepted, true),
        #[cfg(feature = "card-write")]
        true if card::writes() => (links.card.borrow_mut().append(block), true),
        // An empty line asks for nothing.
        true if locked && block.trim_ascii().is_empty() => (Status::Ok, true),
        true if locked => {
            (if jog(block).is_some() { Status::NotAccepted } else { hold::locked() }, true)
        }
        #[cfg(feature = "dialect-reprap")]
        true if port.is_plain() => interpret_rewritten(links, port, block),
        true => interpret(links, block, declined),
        false => (Status::Muted, true),
    }
}

/// Interprets a block of a printing host.
#[cfg(feature = "dialect-reprap")]
#[inline(never)]
#[small]
fn interpret_rewritten(links: &Links, port: &Port, block: &[u8]) -> (Status, bool) {
    let mut text = crate::protocol::Rewritten::new();
    let mut model = links.model.borrow_mut();
    model.begin_printing();
    heat::has_extruder(&mut links.settings.borrow_mut());
    if model.is_far() && !machine::is_alarmed() && !machine::is_checking() {
        drop(model);
        return (move_back(links), true);
    }
    drop(model);
    let done = match port.speech.get().rewrite(block, &mut text) {
        Ok(block) => interpret(links, block, false),
        Err(status) => (status, true),
    };
    if done.0 != Status::Again {
        links.model.borrow_mut().leave_out(false);
    }
    done
}

/// Redefines the position of the extruder as one nearer to the origin. A printer's extruder mostly moves forwards, and
/// would leave the range of positions otherwise. Returns [`Status::Again`]: the line is carried out afterwards.
#[cfg(feature = "dialect-reprap")]
#[inline(never)]
#[small]
fn move_back(links: &Links) -> Status {
    let mut commands = links.command_sender().slot();
    links.model.borrow_mut().move_back(&mut commands);
    links.command_sender().send();
    Status::Again
}

/// Ends a program that has been killed or reset, as M2 does. The planner is free.
pub fn end_program(links: &Links, resets: bool) {
    // M2 is never refused, not even in an alarm, and changes no table.
    let _ = carry_out(links, b"M2", false);
    if resets {
        #[cfg(feature = "sd")]
        links.card.borrow_mut().close();
        links.model.borrow_mut().reset();
        links.changes.note(Changes::ORIGIN);
    }
}

/// Carries out a block. In an alarm, refuses it unless it ends the alarm.
fn interpret(links: &Links, block: &[u8], declined: bool) -> (Status, bool) {
    let alarm = machine::alarm();
    if alarm != Alarm::None {
        if !(alarm.ends_with_program() && is_program_end(block)) {
            return (alarm.status(), true);
        }
        // The queue has been dropped already, so that the alarm can end at once.
        let _ = alarm::clear(links, &links.settings.borrow());
    }
    let done = carry_out(links, block, declined);
    if machine::is_checking() && links.command_sender().ends_program() {
        links.except(Status::ProgramChecked);
    }
    done
}

/// Whether moves are under way or queued.
#[cold]
#[inline(never)]
#[small]
pub(super) fn is_working(links: &Links) -> bool {
    View::of(links, links.feeder()).has_work()
}

/// Begins a jog of G-code, or ends it because other G-code follows.
#[cold]
#[inline(never)]
fn enter(thread: Thread, jogs: bool) {
    machine::carry_out(thread, if jogs { machine::Event::Jog } else { machine::Event::Done });
}

/// Interprets a block and hands its commands to the planner, except in check mode. Returns also whether the block may
/// have a comment. Returns [`Status::Again`] while a jog is under way, unless the block is another jog.
#[inline(never)]
fn carry_out(links: &Links, block: &[u8], declined: bool) -> (Status, bool) {
    let words = jog(block);
    let jogs = machine::cycle() == Cycle::Jog;
    if words.is_some()
        && (machine::is_held() || machine::is_checking() || (!jogs && is_working(links)))
    {
        // A jog waits for other jogs only, because the jog cancel character must find it under way.
        return (Status::NotAccepted, true);
    }
    if jogs && words.is_none() && !block.is_empty() && is_working(links) {
        // The end of a jog drops the queue. So nothing that has been answered may be queued after a jog.
        return (Status::Again, true);
    }
    let mut commands = links.command_sender().slot();
    let settings = links.settings.borrow();
    let mut model = links.model.borrow_mut();
    let done = match (words, declined) {
        (Some(words), _) => model.jog(words, &*settings, &mut commands),
        // The fast path has declined the line already.
        (None, true) => model.slow_path(block, &*settings, &mut commands),
        _ => model.interpret(block, &*settings, &mut commands),
    };
    match done {
        Ok(info) if info.deleted => (Status::Noop, true),
        Ok(info) => {
            if !commands.is_empty() && !machine::is_checking() {
                links.last.set(Last::of(&commands));
                if words.is_some() != jogs {
                    enter(links.thread, words.is_some());
                }
                links.command_sender().send();
            }
            if model.take_moved_origin() {
                // The planner tells exec before the next line that does something.
                links.changes.note(Changes::ORIGIN);
            }
            if info.lacks_length {
                links.except(Status::NoToolLength);
            }
            (Status::Ok, info.commented)
        }
        Err(status) => {
            if status.names_axis() {
                links.except(status);
            }
            (status, true)
        }
    }
}
