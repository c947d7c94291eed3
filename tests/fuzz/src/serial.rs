//! Target `serial`: an input is for the whole machine, on the host, at its serial line.
//!
//! Of its first byte the last bit counts: 0, and each line is sent when the one before has been answered;
//! 1, and all is sent at once, more than the machine can take. (`0` and `1` do as well.) The rest is what is
//! sent.
//!
//! What must hold: every line is answered once; what the machine says is text; it never stands still with
//! something left to do; when it has come to rest it answers still. A job that takes too long is not waited
//! for. Each input has a machine of its own, in a thread, which leaves some memory behind.

mod ears;
mod lines;
mod session;

use session::Session;

/// Sends an input to a new machine; panics where something does not hold.
pub fn check(input: &[u8]) {
    let Some((how, text)) = input.split_first() else { return };
    let all_at_once = how & 1 == 1;
    let session = || Session::begin(text).hold(text, all_at_once);
    let held = std::thread::scope(|scope| scope.spawn(session).join());
    held.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
}
