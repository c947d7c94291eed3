//! The parser task: takes lines, answers them, and hands what they ask for to the planner.
//!
//! Reads the line pool, writes `Links::commands`, the G-code model, the settings and the response;
//! waits for lines, for the planner, and for room to transmit. Control lines are taken at any time,
//! data lines only while the planner is free and no built-in job runs, so that a long job never locks the sender out. A line
//! that has to wait for the tables ([`Status::Again`]) stays where it is, and so do those behind it. A line
//! keeps its slot until its response has been written. A usual move is done with at once, by [`usual`]. After a
//! limit has been hit lines of G-code are refused.

use heapless::Vec;

use super::lines::{Class, LineId};
use super::links::Links;
use super::tx::Tx;
use super::view::View;
use crate::jobs::Job;
use crate::protocol::{Mode, Next, Request, Span, is_brief, put_brief};
use crate::status::Status;

/// The task.
pub async fn run(links: &'static Links) -> ! {
    loop {
        let alarmed = links.limits_hit.get() != 0;
        let free = is_free(links);
        let runs_job = !links.job.get().is_none();
        let data = free && !runs_job;
        let tried = if data && !alarmed { usual(links) } else { Usual::NotTried };
        if tried == Usual::Done {
            continue;
        }
        let next = links.lines.borrow().next(data);
        let Some((id, class)) = next else {
            match free && runs_job {
                true => job_line(links),
                false => links.parser_wake.wait().await,
            }
            continue;
        };
        match begin(links, id, class, tried) {
            Begun::Answer(mut request) => {
                if !answer_at_once(links, id, &mut request) {
                    answer(links, id, &mut request).await;
                }
            }
            Begun::Silent => {}
            Begun::Again => continue,
        }
        finish(links, id);
    }
}

/// Whether a block can be carried out now, or refused: neither has the planner to be waited for, nor the tables.
fn is_free(links: &Links) -> bool {
    let waits = links.commands_taken.get() || links.storage.is_awaited();
    !waits || links.limits_hit.get() != 0
}

/// Carries out the next line of a built-in job. Its end, and a line that is refused, are told by an exception
/// report.
#[inline(never)]
fn job_line(links: &Links) {
    let mut job = links.job.get();
    let mut line = Vec::new();
    let status = match job.next_line(&mut line) {
        true => interpret(links, &line, Usual::NotTried).0,
        false => Status::EndOfFile,
    };
    if status == Status::Again {
        return;
    }
    if !matches!(status, Status::Ok | Status::Noop) {
        job = Job::default();
        links.exception.set(Some(status));
        links.reporter_wake.signal();
    }
    links.job.set(job);
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
    if links.mode.get() != Mode::Json {
        return Usual::NotTried;
    }
    let Ok(mut tx) = links.tx.try_lock() else { return Usual::NotTried };
    let mut lines = links.lines.borrow_mut();
    let Some(line) = lines.oldest() else { return Usual::NotTried };
    let settings = links.settings.borrow();
    let numbered = is_brief(&settings, true);
    if !tx.has_room() || !(numbered || is_brief(&settings, false)) {
        return Usual::NotTried;
    }
    let mut commands = links.commands.borrow_mut();
    if !links.model.borrow_mut().usual(line, numbered, &*settings, &mut commands) {
        return Usual::No;
    }
    links.commands_taken.set(true);
    links.planner_wake.signal();
    put_brief(&settings, lines.free(), &mut *tx);
    tx.flush();
    lines.remove_oldest();
    links.pool_space.signal();
    links.reporter_wake.signal();
    Usual::Done
}

/// Answers a line as far as that goes without waiting: most of them to the end. Returns whether it was
/// this one.
#[inline(never)]
fn answer_at_once(links: &Links, id: LineId, request: &mut Request) -> bool {
    match links.tx.try_lock() {
        // What waits for the planner is left to `answer`.
        Ok(mut tx) if tx.has_room() && request.gcode().is_none() => {
            matches!(step(links, id, request, &mut tx), Next::Done(_))
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
fn begin(links: &Links, id: LineId, class: Class, tried: Usual) -> Begun {
    let lines = links.lines.borrow();
    let line = lines.text(id);
    let mut mode = links.mode.get();
    let mut request = match class {
        Class::Fault(status) => Request::refused(status, mode),
        _ => match Request::begin(line, &mut mode) {
            Some(request) => request,
            None => return Begun::Silent,
        },
    };
    links.mode.set(mode);
    if let Some(block) = request.gcode() {
        let (status, commented) = interpret(links, block.of(line), tried);
        if status == Status::Again {
            return Begun::Again;
        }
        request.ran(status, commented);
    }
    Begun::Answer(request)
}

/// Writes the response to a line.
async fn answer(links: &Links, id: LineId, request: &mut Request) {
    let mut tx = links.tx.lock().await;
    loop {
        tx.room().await;
        match step(links, id, request, &mut tx) {
            Next::More => {}
            Next::Gcode { start, end } => {
                let block = Span { start, end };
                while !ran(links, id, block, request) {
                    // Nothing of the response has been put yet: others may talk meanwhile.
                    drop(tx);
                    while !is_free(links) {
                        links.parser_wake.wait().await;
                    }
                    tx = links.tx.lock().await;
                }
            }
            Next::Done(_) => break,
        }
    }
    if let Some(rate) = links.rate.take() {
        tx.set_rate(rate).await;
    }
}

/// Carries out the block of a request, if that can be done now.
#[inline(never)]
fn ran(links: &Links, id: LineId, block: Span, request: &mut Request) -> bool {
    if !is_free(links) {
        return false;
    }
    let lines = links.lines.borrow();
    let (status, commented) = interpret(links, block.of(lines.text(id)), Usual::NotTried);
    if status == Status::Again {
        return false;
    }
    request.ran(status, commented);
    true
}

/// The line's slot is free again.
#[inline(never)]
fn finish(links: &Links, id: LineId) {
    links.lines.borrow_mut().remove(id);
    links.pool_space.signal();
    links.reporter_wake.signal();
}

#[inline(never)]
fn step(links: &Links, id: LineId, request: &mut Request, tx: &mut Tx) -> Next {
    let lines = links.lines.borrow();
    let next = request.step(lines.text(id), &mut View::of(links), tx);
    tx.flush();
    next
}

/// Interprets a block and hands its commands to the planner. Returns also whether it may have a
/// comment.
#[inline(never)]
fn interpret(links: &Links, block: &[u8], tried: Usual) -> (Status, bool) {
    if links.limits_hit.get() != 0 {
        return (Status::LimitHit, true);
    }
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
        Err(status) => (status, true),
    }
}
