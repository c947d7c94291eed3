//! The parser task: takes lines, answers them, and hands what they ask for to the planner.
//!
//! Reads the line pool, writes `Links::commands`, the G-code model, the settings and the response;
//! waits for lines, for the planner, and for room to transmit. Control lines are taken at any time,
//! data lines only while the planner is free, so that a long job never locks the sender out. A line
//! keeps its slot until its response has been written.

use super::lines::{Class, LineId};
use super::links::Links;
use super::tx::Tx;
use super::view::View;
use crate::gcode::command::Commands;
use crate::protocol::{Next, Request};
use crate::status::Status;

/// The task.
pub async fn run(links: &'static Links) -> ! {
    loop {
        let (id, class) = next_line(links).await;
        answer(links, id, class).await;
        links.lines.borrow_mut().remove(id);
        links.pool_space.signal(());
        links.reporter_wake.signal(());
    }
}

/// Waits for a line that can be processed now.
async fn next_line(links: &Links) -> (LineId, Class) {
    loop {
        let data = !links.commands_taken.get();
        let next = links.lines.borrow().next(data);
        if let Some(next) = next {
            return next;
        }
        links.parser_wake.wait().await;
    }
}

/// Carries a line out and writes its response.
async fn answer(links: &Links, id: LineId, class: Class) {
    let request = {
        let mut mode = links.mode.get();
        let lines = links.lines.borrow();
        let request = match class {
            Class::Fault(status) => Some(Request::refused(status, mode)),
            _ => Request::begin(lines.text(id), &mut mode),
        };
        links.mode.set(mode);
        request
    };
    let Some(mut request) = request else {
        return;
    };
    let mut tx = links.tx.lock().await;
    loop {
        tx.room().await;
        match step(links, id, &mut request, &mut tx) {
            Next::More => {}
            Next::Gcode { start, end } => {
                if links.commands_taken.get() {
                    // Nothing of the response has been put yet: others may talk meanwhile.
                    drop(tx);
                    while links.commands_taken.get() {
                        links.parser_wake.wait().await;
                    }
                    tx = links.tx.lock().await;
                }
                request.ran(interpret(links, id, start, end));
            }
            Next::Done(_) => break,
        }
    }
    tx.flush();
}

#[inline(never)]
fn step(links: &Links, id: LineId, request: &mut Request, tx: &mut Tx) -> Next {
    let lines = links.lines.borrow();
    let next = request.step(lines.text(id), &mut View::of(links), tx);
    tx.flush();
    next
}

/// Interprets a block and hands its commands to the planner.
#[inline(never)]
fn interpret(links: &Links, id: LineId, start: u8, end: u8) -> Status {
    let lines = links.lines.borrow();
    let text = lines.text(id).get(start.into()..end.into()).unwrap_or(&[]);
    let mut commands = links.commands.borrow_mut();
    let settings = links.settings.borrow();
    match links.model.borrow_mut().interpret(text, &*settings, &mut commands) {
        Ok(info) if info.deleted => Status::Noop,
        Ok(_) => {
            if asks_for_something(&commands) {
                links.commands_taken.set(true);
                links.planner_wake.signal(());
            }
            Status::Ok
        }
        Err(status) => status,
    }
}

fn asks_for_something(commands: &Commands) -> bool {
    let Commands { line, exact_stop, .. } = *commands;
    *commands != Commands { line, exact_stop, ..Commands::default() }
}
