//! The control task: real-time characters, which act at once and get no response.
//!
//! Reads what the receive interrupt picked off; waits on [`Event::Realtime`]. `^x` resets the machine.
//! From any port. ENQ asks whether anybody is there, which the reporter answers on the same port. Hold, resume, flush and kill are taken
//! out of the stream and otherwise without effect so far.

use super::links::Links;
use crate::hal::event::{Event, wait};
use crate::hal::imp::{reset, uart};
use crate::realtime::{ENQUIRY, RESET, RESUME};

/// The task.
pub async fn run(links: &'static Links) -> ! {
    loop {
        let (port, characters) = wait(Event::Realtime, || {
            links.ports.iter().find_map(|port| {
                let characters = uart::take_realtime(port.number);
                (characters != 0).then_some((port, characters))
            })
        })
        .await;
        if characters & RESET != 0 {
            reset();
        }
        if characters & RESUME != 0 {
            links.cycle_start.signal();
        }
        if characters & ENQUIRY != 0 {
            port.enquiry.set(true);
            links.reporter_wake.urge();
        }
    }
}
