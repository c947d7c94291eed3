//! The parser task: takes lines, answers them, and hands what they ask for to the planner.
//!
//! Reads the line pools, writes `Links::commands`, the G-code model, the settings and the response;
//! waits for lines, for the planner, and for room to transmit. Control lines are taken at any time,
//! data lines of the port that feeds the machine only while the planner is free and no built-in job runs, so that a long job never locks the sender out. A line
//! that has to wait for the tables ([`Status::Again`]) stays where it is, and so do those behind it. A line
//! keeps its slot until its response has been written. A usual move is done with at once, by [`usual`]. In an
//! alarm lines of G-code are refused.

use embassy_time::Timer;
use heapless::Vec;

use super::alarm;
use super::hold::Flush;
use super::lines::{Class, LineId};
use super::links::Links;
use super::ports::{Chosen, Port};
use super::tx::Tx;
use super::view::View;
use crate::alarm::{Alarm, is_program_end};
use crate::gcode::command::Stop;
use crate::hal::imp;
use crate::hal::imp::eeprom::Eeprom;
use crate::hal::serial::USB;
use crate::jobs::Job;
use crate::protocol::{Ending, Mode, Next, Out, Request, Span, is_brief, put_brief, put_line_end};
use crate::status::Status;

/// Bytes of an echo that are put at once.
const ECHO: usize = 62;

/// The task.
pub async fn run(links: &'static Links) -> ! {
    loop {
        let alarmed = alarm::is_on();
        let free = is_free(links);
        let runs_job = !links.job.get().is_none();
        let data = free && !runs_job;
        let tried = if data && !alarmed { usual(links) } else { Usual::NotTried };
        if tried == Usual::Done {
            continue;
        }
        let next = match links.flush.get() {
            Flush::None => links.next_line(data),
            flush => dropped(links, flush),
        };
        let Some(Chosen { port, id, class }) = next else {
            match free && runs_job && !links.job.get().is_over() {
                true => job_line(links),
                false => links.parser_wake.wait().await,
            }
            continue;
        };
        let echoes = links.settings.borrow().echo();
        match begin(links, port, id, class, tried) {
            Begun::Answer(mut request) => {
                if echoes || !answer_at_once(links, port, id, &mut request) {
                    answer(links, port, id, &mut request, echoes).await;
                }
            }
            Begun::Silent => {}
            Begun::Again => continue,
        }
        finish(links, port, id);
        // The reader has its turn, and stops the sender in time.
        embassy_futures::yield_now().await;
    }
}

/// The next line during a queue flush: control lines are carried out, those of data dropped.
#[inline(never)]
#[small]
fn dropped(links: &Links, flush: Flush) -> Option<Chosen<'_>> {
    links.ports.iter().find_map(|port| {
        let (id, class) = port.lines.borrow().next(true)?;
        match class {
            Class::Data if flush == Flush::Rest => None,
            Class::Data => Some(Chosen { port, id, class: Class::Fault(Status::Terminated) }),
            class => Some(Chosen { port, id, class }),
        }
    })
}

/// Whether a block can be carried out now, or refused: neither has the planner to be waited for, nor the
/// tables, and nothing is being dropped.
fn is_free(links: &Links) -> bool {
    let waits = links.commands_taken.get() || links.storage.is_awaited();
    !waits && links.flush.get() == Flush::None
}

/// Carries out the next line of a built-in job. A line that is refused is told by an exception report. The end is told by
/// the reporter, when everything is done.
#[inline(never)]
#[small]
fn job_line(links: &Links) {
    let mut job = links.job.get();
    let mut line = Vec::new();
    if !job.next_line(&Eeprom::take(), &mut line) {
        job.end();
    } else {
        match interpret(links, &line, Usual::NotTried).0 {
            Status::Again => return,
            Status::Ok if links.commands.borrow().stop == Stop::End => job.end(),
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

/// Whether the next line was a usual one.
#[derive(Clone, Copy, PartialEq)]
enum Usual {
    /// It was, and is done with.
    Done,
    /// It is none.
    No,
    /// Nobody has looked.
    NotTried,
}

/// Does all there is to do for a usual line: a move that is answered with a brief response. Nothing is
/// done if the next line is none, or if it has to wait for room to transmit. What the others do in
/// four steps and with a [`Request`], in half the time.
#[inline(never)]
fn usual(links: &Links) -> Usual {
    let port = links.feeder();
    if port.mode.get() != Mode::Json {
        return Usual::NotTried;
    }
    let Ok(mut tx) = port.tx.try_lock() else { return Usual::NotTried };
    let mut lines = port.lines.borrow_mut();
    let Some(line) = lines.oldest() else { return Usual::NotTried };
    let settings = links.settings.borrow();
    let numbered = is_brief(&settings, true);
    if !tx.has_room() || settings.echo() || !(numbered || is_brief(&settings, false)) {
        return Usual::NotTried;
    }
    let mut commands = links.commands.borrow_mut();
    if !links.model.borrow_mut().usual(line, numbered, &*settings, &mut commands) {
        return Usual::No;
    }
    links.commands_taken.set(true);
    links.planner_wake.signal();
    let ending = Ending { free: lines.free(), length: lines.oldest_length() };
    put_brief(&settings, ending, &mut *tx);
    tx.flush();
    lines.remove_oldest();
    links.pool_space.signal();
    links.reporter_wake.signal();
    Usual::Done
}

/// Answers a line as far as that goes without waiting: most of them to the end. Returns whether it was
/// this one.
#[inline(never)]
fn answer_at_once(links: &Links, port: &Port, id: LineId, request: &mut Request) -> bool {
    match port.tx.try_lock() {
        // What waits for the planner is left to `answer`.
        Ok(mut tx) if tx.has_room() && request.gcode().is_none() => {
            matches!(step(links, port, id, request, &mut tx), Next::Done(_))
        }
        _ => false,
    }
}

/// How it goes on with a line.
enum Begun {
    /// It is to be answered.
    Answer(Request),
    /// It gets no answer.
    Silent,
    /// It has to wait.
    Again,
}

/// Begins with a line. One of G-code has run after that, for data lines are taken only while the
/// planner is free.
#[inline(never)]
fn begin(links: &Links, port: &Port, id: LineId, class: Class, tried: Usual) -> Begun {
    let lines = port.lines.borrow();
    let (line, length) = (lines.text(id), lines.length(id));
    let mut mode = port.mode.get();
    let settings = links.settings.borrow();
    let mut request = match class {
        Class::Fault(status) => Request::refused(status, line, length, mode, &settings),
        _ => match Request::begin(line, length, &mut mode, &settings) {
            Some(request) => request,
            None => return Begun::Silent,
        },
    };
    drop(settings);
    port.mode.set(mode);
    if let Some(block) = request.gcode() {
        let (status, commented) = run_block(links, port, block.of(line), tried);
        if status == Status::Again {
            return Begun::Again;
        }
        request.ran(status, commented);
    }
    Begun::Answer(request)
}

/// Writes the response to a line, and before that the line if it `echoes`.
async fn answer(links: &Links, port: &Port, id: LineId, request: &mut Request, echoes: bool) {
    let mut tx = port.tx.lock().await;
    let mut at = 0;
    let mut echoes = echoes;
    while echoes {
        tx.room().await;
        echoes = echo(links, port, id, &mut at, &mut tx);
    }
    loop {
        tx.room().await;
        match step(links, port, id, request, &mut tx) {
            Next::More => {}
            // Of a response that has begun the rest is due.
            Next::Wait if request.has_begun() => tables_ready(links).await,
            Next::Wait => {
                drop(tx);
                tables_ready(links).await;
                tx = port.tx.lock().await;
            }
            Next::Gcode { start, end } => {
                let block = Span { start, end };
                while !ran(links, port, id, block, request) {
                    // Nothing of the response has been put yet: others may talk meanwhile.
                    drop(tx);
                    while !is_free(links) && links.flush.get() == Flush::None {
                        links.parser_wake.wait().await;
                    }
                    tx = port.tx.lock().await;
                }
            }
            Next::Done(_) => break,
        }
    }
    if let Some(boot) = links.restart.take() {
        tx.drain().await;
        if boot {
            imp::boot()
        } else {
            imp::reset()
        };
    }
    drop(tx);
    if let Some(rate) = links.rate.take() {
        links.port(USB).tx.lock().await.set_rate(rate).await;
    }
}

/// Waits until the tables take another change. A program that is being stored has only to be asked again.
async fn tables_ready(links: &Links) {
    Timer::after_ticks(1).await;
    while links.storage.is_awaited() {
        links.parser_wake.wait().await;
    }
}

/// Sends a part of the line back, from `at` on. Whether there is more. It is done by the line, not by the byte, so
/// that it never stands in the midst of a response or a report, and never loses anything.
#[inline(never)]
#[small]
fn echo(links: &Links, port: &Port, id: LineId, at: &mut u8, tx: &mut Tx) -> bool {
    let lines = port.lines.borrow();
    let rest = lines.text(id).get(usize::from(*at)..).unwrap_or(&[]);
    let part = rest.get(..ECHO).unwrap_or(rest);
    tx.put_all(part.iter().copied());
    *at += part.len() as u8;
    let more = part.len() == ECHO;
    if !more {
        put_line_end(&links.settings.borrow(), tx);
    }
    tx.flush();
    more
}

/// Carries out the block of a request, if that can be done now; or drops it in a queue flush.
#[inline(never)]
fn ran(links: &Links, port: &Port, id: LineId, block: Span, request: &mut Request) -> bool {
    if links.flush.get() != Flush::None {
        let alarm = alarm::now();
        request.ran(if alarm == Alarm::None { Status::Terminated } else { alarm.status() }, false);
        return true;
    }
    if links.may_feed(port) && !is_free(links) {
        return false;
    }
    let lines = port.lines.borrow();
    let (status, commented) = run_block(links, port, block.of(lines.text(id)), Usual::NotTried);
    if status == Status::Again {
        return false;
    }
    request.ran(status, commented);
    true
}

/// The line's slot is free again.
#[inline(never)]
fn finish(links: &Links, port: &Port, id: LineId) {
    port.lines.borrow_mut().remove(id);
    links.pool_space.signal();
    links.reporter_wake.signal();
}

#[inline(never)]
#[small]
fn step(links: &Links, port: &Port, id: LineId, request: &mut Request, tx: &mut Tx) -> Next {
    let lines = port.lines.borrow();
    let next = request.step(lines.text(id), &mut View::of(links, port), tx);
    tx.flush();
    next
}

/// Interprets a block of a port's, if that feeds the machine.
#[inline(never)]
fn run_block(links: &Links, port: &Port, block: &[u8], tried: Usual) -> (Status, bool) {
    match links.may_feed(port) {
        true => interpret(links, block, tried),
        false => (Status::Muted, true),
    }
}

/// Ends the program, as M2 does, for one that has been killed. The planner is free.
pub fn end_program(links: &Links) {
    // It is never refused, not in an alarm either, and changes no table.
    let _ = carry_out(links, b"M2", Usual::NotTried);
}

/// Refuses a block in an alarm, unless it ends that, and else carries it out.
fn interpret(links: &Links, block: &[u8], tried: Usual) -> (Status, bool) {
    let alarm = alarm::now();
    if alarm != Alarm::None {
        if !(alarm.ends_with_program() && is_program_end(block)) {
            return (alarm.status(), true);
        }
        // The queue has been dropped, so that nothing is waited for.
        let _ = alarm::clear(links, &links.settings.borrow());
    }
    carry_out(links, block, tried)
}

/// Interprets a block and hands its commands to the planner. Returns also whether it may have a
/// comment.
#[inline(never)]
fn carry_out(links: &Links, block: &[u8], tried: Usual) -> (Status, bool) {
    let mut commands = links.commands.borrow_mut();
    let settings = links.settings.borrow();
    let mut model = links.model.borrow_mut();
    let done = match tried {
        // No need to look twice.
        Usual::No => model.general(block, &*settings, &mut commands),
        _ => model.interpret(block, &*settings, &mut commands),
    };
    match done {
        Ok(info) if info.deleted => (Status::Noop, true),
        Ok(info) => {
            if !commands.is_empty() {
                links.commands_taken.set(true);
                links.planner_wake.signal();
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
