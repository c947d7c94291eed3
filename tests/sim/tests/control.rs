//! Control gets through whatever data does, on the simulated chip: the crowds are those of `tests/control.rs`.

mod common;
#[path = "../../support/crowd.rs"]
mod crowd;
#[path = "../../support/side.rs"]
mod side;
#[path = "common/simulated.rs"]
mod simulated;

use common::firmware;
use kerf::boards::MEGA2560_GRBL;
use kerf_sim::Machine;

fn boot() -> Machine {
    firmware(&MEGA2560_GRBL)
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
fn a_stopped_port_does_not_stop_the_other() {
    crowd::a_stopped_port_does_not_stop_the_other(boot);
}

#[test]
fn data_does_not_hold_up_control() {
    crowd::data_does_not_hold_up_control(boot);
}
