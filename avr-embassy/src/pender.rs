//! The pender, which Embassy's executors call when one of their tasks is woken. The context tells which executor that
//! is.

use crate::event::{POLL, flags};
use crate::interrupt;

/// Context of the thread-mode executor.
pub const THREAD: *mut () = core::ptr::null_mut();
/// Context of the interrupt-mode executor.
pub const INTERRUPT: *mut () = core::ptr::dangling_mut();

#[unsafe(export_name = "__pender")]
fn pender(context: *mut ()) {
    if context == THREAD {
        flags::set(POLL);
    } else if !interrupt::is_prompt(context) {
        interrupt::woken();
    }
}
