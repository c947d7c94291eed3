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

crowd::tests!(boot);

fn boot() -> Machine {
    firmware(&MEGA2560_GRBL)
}
