//! The pender that embassy's executors call when a task of theirs is woken; it tells the two apart by
//! their context.

use super::event::Event;
use super::imp::flags;

/// Pender context of the main executor.
pub const THREAD: *mut () = core::ptr::null_mut();
/// Pender context of the exec executor.
pub const EXEC: *mut () = core::ptr::dangling_mut();

#[unsafe(export_name = "__pender")]
fn pender(context: *mut ()) {
    // The exec task is woken by the exec interrupt only, just before it polls: nothing to pend.
    if context == THREAD {
        flags::set(Event::Thread);
    }
}
