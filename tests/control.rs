//! Control gets through whatever data does, on the host: what is crowded and how is in `tests/support/crowd.rs`;
//! `tests/sim/tests/control.rs` has the same with the image.

#[path = "support/crowd.rs"]
mod crowd;
#[path = "support/host.rs"]
mod host;
#[path = "support/side.rs"]
mod side;

use kerf::hal::imp::Machine;

/// In a thread of its own, for there is one machine in each.
fn boot() -> Machine {
    Machine::boot(115_200).expect("one machine for each thread")
}

#[test]
fn xon_gets_through() {
    crowd::xon_gets_through(boot);
}

#[test]
fn all_that_has_come_is_dropped() {
    crowd::all_that_has_come_is_dropped(boot);
}

#[test]
fn data_does_not_hold_up_control() {
    crowd::data_does_not_hold_up_control(boot);
}

#[test]
fn a_stopped_port_does_not_stop_the_other() {
    crowd::a_stopped_port_does_not_stop_the_other(boot);
}
