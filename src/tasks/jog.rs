//! The end of a jog by hand: the character 0x85, which a sender sends when a button is let go.
//!
//! A jog under way slows down and is dropped, as by `!%`; anything else goes on. A button may be let go before its jog
//! has begun, even before the line of the jog has been read. So no jog begins whose line came before the character: it
//! is refused by [`Status::Terminated`](crate::status::Status). An exclamation mark that finds nothing to hold bars
//! such jogs as well.
//!
//! A jog whose line comes right behind the character, before tasks have had their turn, is refused too. Nobody knows
//! any more which was first, and a motor that stands is the better mistake. A [`Bar`] keeps what is waited for.

use super::hold;
use super::links::Links;
use crate::hal::event::Event;
use crate::hal::flags;
use crate::machine::jog::Bar;
use crate::machine::{self, Cycle};

/// Ends the jog that is under way, and bars any jog that waits.
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
