//! The end of a jog by hand: the character 0x85, which a sender sends when a button is let go.
//!
//! A jog under way slows down and is dropped, as by `!%`; anything else goes on. A button may be let go before its
//! jog has begun, even before its line has been read: no jog begins whose line came before the character
//! (it is refused by [`Status::Terminated`](crate::status::Status)). An exclamation mark that finds nothing to hold
//! bars it as well. One whose line comes in the same moment behind the character, before tasks have had their turn, is
//! refused too: nobody knows any more which was first, and a motor that stands is the better mistake.
//! What they wait for is a [`Bar`].

use super::hold;
use super::links::Links;
use crate::hal::event::Event;
use crate::hal::flags;
use crate::machine::jog::Bar;
use crate::machine::{self, Cycle};

/// Ends the jog that is under way, and any that waits.
#[small]
pub fn end(links: &Links) {
    if machine::cycle() == Cycle::Jog {
        hold::flush_here();
    }
    bar(links);
}

/// Bars the jogs that have come by now.
#[small]
pub fn bar(links: &Links) {
    links.signs.jogs.set(Bar::Barred);
    flags::set(Event::Received);
}

/// The reader begins to take bytes.
#[small]
pub fn passes(links: &Links) {
    if links.signs.jogs.get() == Bar::Passed
        && links.ports.iter().all(|port| port.lines.borrow().is_empty())
    {
        links.signs.jogs.set(Bar::Open);
    }
}

/// The reader has emptied the receive rings.
#[small]
pub fn passed(links: &Links) {
    if links.signs.jogs.get() == Bar::Barred {
        links.signs.jogs.set(Bar::Passed);
    }
}
