//! The control task: real-time characters, which act at once and get no response.
//!
//! Reads what the receive interrupt has taken out of the streams; waits on [`Event::Realtime`]. [`hold`] says what the
//! characters lead to. Besides, `^x` resets the machine, and ENQ asks whether anybody is there, which the parser
//! answers.
//!
//! The task also sees to switches that change ([`switches`]), and to a program that opens the first port, if the chip
//! sees that.

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
