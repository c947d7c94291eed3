//! Target `serial`: an input goes to the serial line of a whole machine on the host.
//!
//! The lowest bit of the first byte selects how to send. With 0 each line is sent when the line before it has been
//! answered. With 1 everything is sent at once, more than the machine can take. (The characters `0` and `1` have the
//! right bits.) The rest of the input is sent.
//!
//! What must hold: every line is answered once; the machine sends only text; it never stands still with work left to
//! do; at the end it still answers. A job that takes too long is abandoned. Each input has a machine of its own, in a
//! thread, which leaks some memory.

mod ears;
mod lines;
mod session;

use session::Session;

/// Sends an input to a new machine; panics where a check fails.
pub fn check(input: &[u8]) {
    let Some((how, text)) = input.split_first() else { return };
    let all_at_once = how & 1 == 1;
    let session = || Session::begin(text).hold(text, all_at_once);
    let held = std::thread::scope(|scope| scope.spawn(session).join());
    held.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
}
