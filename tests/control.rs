//! Control lines and real-time characters are handled in time whatever data does, on the host. `tests/support/crowd.rs`
//! says which ports are crowded and how; `tests/sim/tests/control.rs` runs these tests with the image.

use kerf::hal::imp::Machine;

use crate::crowd;

crowd::tests!(boot);

/// Boots a machine. Each test has a thread of its own, because each thread has one machine.
fn boot() -> Machine {
    Machine::boot(115_200).expect("one machine for each thread")
}
