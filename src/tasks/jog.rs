//! The end of a jog by hand: the character 0x85, which a sender sends when a button is let go.
//!
//! A jog under way slows down and is dropped, as by `!%`; anything else goes on. A button may be let go before its
//! jog has begun, even before its line has been read: no jog begins whose line came before the character
//! (it is refused by [`Status::Terminated`](crate::status::Status)). An exclamation mark that finds nothing to hold
//! bars it as well. One whose line comes in the same moment behind the character, before tasks have had their turn, is
//! refused too: nobody knows any more which was first, and a motor that stands is the better mistake.
//!
//! ```text
//!  Open    jogs begin                   bar       the control task: the character has come
//!  Barred  none does                    passed    the reader: all that came before is in the pool
//!  Passed  none does                    passes    the reader: new bytes have come, and the pool was empty
//! ```

use super::hold;
use super::links::{Cycle, Links};
use crate::hal::event::Event;
use crate::hal::imp::flags;

/// Whether a jog may begin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bar {
    /// It may.
    #[default]
    Open,
    /// It may not: its line may be in the receive ring still.
    Barred,
    /// It may not: its line is in the pool.
    Passed,
}

/// Ends the jog that is under way, and any that waits.
#[small]
pub fn end(links: &Links) {
    if links.cycle.get() == Cycle::Jog {
        hold::flush_here(links, false);
    }
    bar(links);
}

/// Bars the jogs that have come by now.
#[small]
pub fn bar(links: &Links) {
    links.jogs.set(Bar::Barred);
    flags::set(Event::Received);
}

/// The reader begins to take bytes.
#[small]
pub fn passes(links: &Links) {
    if links.jogs.get() == Bar::Passed
        && links.ports.iter().all(|port| port.lines.borrow().is_empty())
    {
        links.jogs.set(Bar::Open);
    }
}

/// The reader has emptied the receive rings.
#[small]
pub fn passed(links: &Links) {
    if links.jogs.get() == Bar::Barred {
        links.jogs.set(Bar::Passed);
    }
}
