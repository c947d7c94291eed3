//! The control task: real-time characters, which act at once and get no response.
//!
//! Reads what the receive interrupt picked off; waits on [`Event::Realtime`]. What they lead to is in
//! [`hold`]; besides, `^x` resets the machine, and ENQ asks whether anybody is there, which the
//! reporter answers. A switch that
//! changes is seen to as well, by [`switches`], and so is a program that opens the first port, where the chip sees that.

use super::hold;
use super::links::Links;
use super::overrides;
use super::switches;
use crate::hal::event::{Event, next};
use crate::hal::uart;

/// The task.
pub async fn run(links: &'static Links) -> ! {
    loop {
        hold::serve(links);
        overrides::serve(links);
        overrides::tell(links);
        switches::serve(links);
        if uart::take_opened() {
            links.open_anew();
        }
        next(links.thread, Event::Realtime).await;
    }
}
