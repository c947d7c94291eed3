//! Control lines and real-time characters are handled in time whatever data does, on the simulated chip, with the
//! crowds of `tests/control.rs`.

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::Machine;

use crate::common::firmware;
use crate::crowd;

crowd::tests!(boot);

fn boot() -> Machine {
    firmware(&MEGA2560_GRBL)
}
