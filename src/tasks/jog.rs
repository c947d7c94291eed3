//! Jog cancel: the character 0x85, which a sender sends when a button is released.
//!
//! A jog under way slows down and is dropped, as by `!%`; other motion continues. A button may be released before its
//! jog has begun, even before the line of the jog has been read. So a jog whose line came before the character is
//! refused with [`Status::Terminated`](crate::status::Status). An exclamation mark with nothing to hold refuses such
//! jogs as well.
//!
//! A jog whose line comes directly after the character, before tasks have had their turn, is refused too: their order
//! is not known any more, and standing still is the safer error. A [`Bar`] holds the state.

use super::hold;
use super::links::Links;
use crate::hal::event::Event;
use crate::hal::flags;
use crate::machine::jog::Bar;
use crate::machine::{self, Cycle};

/// Ends the jog under way, and refuses jogs whose lines wait.
#[small]
pub fn end(links: &Links) {
    if machine::cycle() == Cycle::Jog {
        hold::flush_here(links.thread);
    }
    bar(links);
}

/// Refuses the jogs received so far.
#[small]
pub fn bar(links: &Links) {
    links.signs.jogs.set(Bar::Barred);
    flags::set(Event::Received);
}

/// Notes that the reader begins to take bytes. Lifts the bar if all lines from before it have left the pools.
#[small]
pub fn passes(links: &Links) {
    if links.signs.jogs.get() == Bar::Passed
        && links.ports.iter().all(|port| port.lines.borrow().is_empty())
    {
        links.signs.jogs.set(Bar::Open);
    }
}

/// Notes that the reader has emptied the receive rings.
#[small]
pub fn passed(links: &Links) {
    if links.signs.jogs.get() == Bar::Barred {
        links.signs.jogs.set(Bar::Passed);
    }
}
