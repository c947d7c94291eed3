//! Level 2: the exec task, alone on the interrupt executor.

pub use avr_embassy::interrupt::{lock, note_idle, pend, pend_when_idle, wait, was_idle};
