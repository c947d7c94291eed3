//! Control gets through whatever data does, on the host: what is crowded and how is in `tests/support/crowd.rs`;
//! `tests/sim/tests/control.rs` has the same with the image.

use kerf::hal::imp::Machine;

use crate::crowd;

crowd::tests!(boot);

/// In a thread of its own, for there is one machine in each.
fn boot() -> Machine {
    Machine::boot(115_200).expect("one machine for each thread")
}
