//! The control task: real-time characters, which act at once and get no response.
//!
//! Reads the characters that the receive interrupt has taken out of the streams; waits on [`Event::Realtime`]. Most of
//! them act by [`hold`]. In addition `^x` resets the machine, and ENQ is an enquiry that the parser answers.
//!
//! The task also handles switches that change ([`switches`]), and a program that opens the first port, on chips that
//! detect that.

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
        if uart::take_opened(links.thread) {
            links.open_anew();
        }
        next(links.thread, Event::Realtime).await;
    }
}
