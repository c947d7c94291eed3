//! The control task: real-time characters, which act at once and get no response.
//!
//! Reads what the receive interrupt picked off; waits on [`Event::Realtime`]. `^x` resets the machine.
//! ENQ asks whether anybody is there, which the reporter answers. A switch that changes is seen to as well, by
//! [`switches`]. Hold, resume, flush and kill are taken
//! out of the stream and otherwise without effect so far.

use super::links::Links;
use super::switches;
use crate::hal::event::{Event, wait};
use crate::hal::imp::{reset, uart};
use crate::realtime::{ENQUIRY, RESET, RESUME};

/// The task.
pub async fn run(links: &'static Links) -> ! {
    loop {
        let characters = wait(Event::Realtime, || {
            switches::serve(links);
            let characters = uart::take_realtime();
            (characters != 0).then_some(characters)
        })
        .await;
        if characters & RESET != 0 {
            reset();
        }
        if characters & RESUME != 0 {
            links.cycle_start.signal();
        }
        if characters & ENQUIRY != 0 {
            links.enquiry.set(true);
            links.reporter_wake.urge();
        }
    }
}
