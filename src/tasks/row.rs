//! A row: lines of the [fast path](crate::gcode::fast_path) that the parser carries out one after the other, without a
//! turn for other tasks in between.
//!
//! Each line is a move with a brief response. For other lines the [parser](super::parser) takes four steps and a
//! `Request`; in a row a line takes half the time. The port, the form of the answer, the transmitter and the planner
//! are determined once for a row. Real-time characters, alarms, and a reader that must not wait end a row
//! ([`is_wanted`]). Nothing else can interrupt a row, because all other reasons to hold lines back arise in thread
//! mode.
//!
//! Thread mode, in the parser's turn. Cost: 2,400 cycles a line, and the cost of its block.

use super::links::{Last, Links};
use super::planner::{self, Planner};
use super::ports::Port;
use crate::config::Settings;
use crate::gcode::fast_path::Writer;
use crate::hal::event::{Event, is_wanted};
use crate::hal::flags;
use crate::machine;
use crate::protocol::{Ending, Speech};

/// The most lines of a row: as many as may wait.
const MOST: u8 = 8;

/// How a row has ended.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Row {
    /// There is no further line, or the line has to wait for something.
    Over,
    /// The next line is not for the fast path.
    Declined,
    /// Other tasks are to have their turn before there are more lines.
    Full,
    /// The planner's task carries out the last line. No further line is taken before that is done.
    Handed,
}

/// Carries out and answers lines of the port that feeds the machine. The caller has made sure that lines may be taken.
#[inline(never)]
pub(super) fn run(links: &Links, shared: &planner::Shared) -> Row {
    let port = links.feeder();
    let (mut speech, settings) = (port.speech.get(), links.settings.borrow());
    let prints = is_printing(port, &settings);
    let writer = match speech.brief(&settings) {
        _ if prints => Writer::Prints,
        Some(true) => Writer::Numbers,
        Some(false) => Writer::Plain,
        None => return Row::Over,
    };
    let Ok(mut tx) = port.tx.try_lock() else { return Row::Over };
    if settings.echo() || port.awaits_greeting() {
        return Row::Over;
    }
    let Ok(mut planner) = shared.try_lock() else { return Row::Over };
    let mut lines = port.lines.borrow_mut();
    let mut count = 0;
    let end = loop {
        let Some(mut line) = lines.oldest() else { break Row::Over };
        if !tx.has_room() {
            break Row::Over;
        }
        if prints {
            let Some(block) = speech.fast_path(line) else { break Row::Over };
            line = block.of(line);
        }
        let mut commands = links.command_sender().slot();
        if !links.model.borrow_mut().fast_path(line, writer, &*settings, &mut commands) {
            break Row::Declined;
        }
        drop(commands);
        if prints {
            port.speech.set(speech);
        }
        let ending =
            Ending { free: port.promise(links.thread, &lines), length: lines.oldest_length() };
        speech.put_brief(&settings, ending, &mut *tx);
        tx.flush();
        lines.remove_oldest();
        count += 1;
        if !hand_over(links, Some(&mut planner)) {
            break Row::Handed;
        }
        if count == MOST || is_wanted(links.thread) || machine::is_alarmed() {
            break Row::Full;
        }
    };
    if count > 0 {
        links.last.set(Last::Moves);
        links.pool_space.signal();
        links.reporter_wake.signal();
    }
    end
}

/// Has the planner carry out the move of a line of the fast path: at once, if possible and if no real-time character
/// waits, or else in the planner's task. Returns whether the move has been carried out, so that the next line may be
/// taken.
#[inline(always)]
pub(super) fn hand_over(links: &Links, planner: Option<&mut Planner>) -> bool {
    let done = !flags::has(Event::Realtime) && planner.is_some_and(planner::take_at_once);
    if !done {
        links.command_sender().send();
    }
    done
}

/// Interprets a line of the SD card, if the fast path can. Returns whether it has; its move is to be handed over then.
#[cfg(feature = "sd")]
#[inline(never)]
pub(super) fn interpret(links: &Links, line: &[u8]) -> bool {
    let port = links.told();
    // Before the settings are borrowed: this borrows them, too.
    if machine::is_checking() || !links.may_feed(port) {
        return false;
    }
    let settings = links.settings.borrow();
    if !is_printing(port, &settings) {
        return false;
    }
    let mut commands = links.command_sender().slot();
    links.model.borrow_mut().fast_path(line, Writer::Prints, &*settings, &mut commands)
}

/// Whether a printing host speaks on a port, and the A axis is known to be its extruder.
#[inline(always)]
fn is_printing(port: &Port, settings: &Settings) -> bool {
    Speech::HAS_PLAIN
        && port.is_plain()
        && settings.heating.first().is_none_or(|heating| heating.extruder)
}
