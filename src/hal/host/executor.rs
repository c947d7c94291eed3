//! The pender that tells the two executors apart.

use super::{exec, flags};
use crate::hal::event::Event;

/// Pender context of the main executor.
pub const THREAD: *mut () = core::ptr::null_mut();
/// Pender context of the exec executor.
pub const EXEC: *mut () = core::ptr::dangling_mut();

#[unsafe(export_name = "__pender")]
fn pender(context: *mut ()) {
    if context == THREAD {
        flags::set(Event::Thread);
    } else {
        exec::pend();
    }
}
