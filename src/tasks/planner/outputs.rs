//! Spindle and coolant, switched where they stand in the program: blocks that exec carries out at rest.

use kerf_macros::small;

use super::Planner;
use crate::boards::outputs;
use crate::gcode::command::Spindle;
use crate::gcode::modal::{self, Coolant};
use crate::motion::block::{Action, Outputs};

impl Planner {
    #[inline(never)]
    #[small]
    pub(super) fn set_coolant(&mut self, coolant: u8) {
        let bit = |which: Coolant, output| if coolant & which as u8 != 0 { output } else { 0 };
        let on = bit(Coolant::Mist, outputs::MIST) | bit(Coolant::Flood, outputs::FLOOD);
        self.switch(outputs::MIST | outputs::FLOOD, on, self.outputs.speed);
    }

    #[inline(never)]
    #[small]
    pub(super) fn set_spindle(&mut self, spindle: &Spindle) {
        let (turn, speed) = match spindle.turn {
            modal::Turn::Off => (0, 0.0),
            modal::Turn::Clockwise => (outputs::SPINDLE, spindle.speed),
            modal::Turn::Counterclockwise => {
                (outputs::SPINDLE | outputs::COUNTERCLOCKWISE, spindle.speed)
            }
        };
        self.switch(outputs::SPINDLE | outputs::COUNTERCLOCKWISE, turn, speed);
    }

    /// Switches those of `which` on that are in `on`, the others of `which` off; the spindle is to have this speed.
    #[inline(never)]
    #[small]
    pub(super) fn switch(&mut self, which: u8, on: u8, speed: f32) {
        let outputs = Outputs { on: self.outputs.on & !which | on, speed };
        if outputs != self.outputs {
            self.outputs = outputs;
            self.pause(Action::Outputs(outputs));
        }
    }
}

/// How the spindle turns, by the outputs.
pub(super) fn turn(on: u8) -> modal::Turn {
    match on & (outputs::SPINDLE | outputs::COUNTERCLOCKWISE) {
        0 => modal::Turn::Off,
        outputs::SPINDLE => modal::Turn::Clockwise,
        _ => modal::Turn::Counterclockwise,
    }
}
