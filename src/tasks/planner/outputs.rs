//! Spindle and coolant, switched at their place in the program by blocks that exec carries out at a standstill.

use kerf_macros::small;

use super::Planner;
use crate::boards::outputs;
use crate::capability::Capability;
use crate::gcode::command::{Spindle, Surface};
use crate::gcode::modal::{self, Coolant};
use crate::motion::block::{Outputs, QueuedAction};

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
        let which = outputs::SPINDLE | outputs::COUNTERCLOCKWISE;
        if Capability::Lathe.is_built_in() {
            // The G-code model has interpreted this line and no later one.
            let surface = self.links.model.borrow().surface();
            if surface.is_some() || self.has_surface {
                return self.turn_at_surface(which, turn, speed, surface);
            }
        }
        self.switch(which, turn, speed);
    }

    /// Begins a surface speed (G96), changes it, or ends it.
    #[inline(never)]
    #[small]
    fn turn_at_surface(&mut self, which: u8, on: u8, speed: f32, surface: Option<Surface>) {
        let [x, ..] = self.position;
        let speed = match surface {
            Some(surface) if on != 0 => surface.turns(x),
            _ => speed,
        };
        self.has_surface = surface.is_some();
        self.outputs = Outputs { on: self.outputs.on & !which | on, speed };
        self.pause(QueuedAction::Surface(self.outputs, surface.unwrap_or(Surface::NONE)));
    }

    /// Switches outputs of `which`: on if they are in `on`, off otherwise. The spindle is to have this speed.
    #[inline(never)]
    #[small]
    pub(super) fn switch(&mut self, which: u8, on: u8, speed: f32) {
        let outputs = Outputs { on: self.outputs.on & !which | on, speed };
        if outputs != self.outputs {
            self.outputs = outputs;
            self.pause(QueuedAction::Outputs(outputs));
        }
    }
}

/// Returns the direction of the spindle, by the outputs that are on.
pub(super) fn turn(on: u8) -> modal::Turn {
    match on & (outputs::SPINDLE | outputs::COUNTERCLOCKWISE) {
        0 => modal::Turn::Off,
        outputs::SPINDLE => modal::Turn::Clockwise,
        _ => modal::Turn::Counterclockwise,
    }
}
