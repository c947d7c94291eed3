//! Control gets through whatever data does, on the host: what is crowded and how is in `tests/support/crowd.rs`;
//! `tests/sim/tests/control.rs` has the same with the image.

#[path = "support/crowd.rs"]
mod crowd;
#[path = "support/host.rs"]
mod host;
#[path = "support/side.rs"]
mod side;

use kerf::hal::imp::Machine;

crowd::tests!(boot);

/// In a thread of its own, for there is one machine in each.
fn boot() -> Machine {
    Machine::boot(115_200).expect("one machine for each thread")
}
