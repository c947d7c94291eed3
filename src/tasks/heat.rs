//! The heat task: sensors to temperatures, temperatures to power.

use core::cell::Cell;

use kerf_macros::small;

use super::common;
use super::links::Links;
use crate::gcode::heating::{Heat, Part, Wait};
use crate::hal::Thread;
use crate::hal::event::Event;
use crate::hal::flags;
use crate::heat::{HEATERS, Orders, PRINTERS, Standing};

/// What the planner and dialects share with the task. Thread mode.
pub struct Heaters {
    parts: [Parts; PRINTERS],
}

/// Of a machine that has them.
struct Parts {
    /// How each stands.
    now: [Cell<Standing>; HEATERS],
    /// What the planner waits for.
    awaited: Cell<Heat>,
}

#[small]
impl Heaters {
    /// Everything is off.
    pub const fn new() -> Self {
        const OFF: Cell<Standing> = Cell::new(Standing { now: 0, to: 0, power: 0 });
        const NOTHING: Heat = Heat { part: Part::All, to: None, wait: Wait::Nothing };
        Self {
            parts: [const { Parts { now: [OFF; HEATERS], awaited: Cell::new(NOTHING) } }; PRINTERS],
        }
    }

    /// How a heater stands: 0 the hot end, 1 the bed. None without the capability.
    pub fn standing(&self, heater: u8) -> Option<Standing> {
        Some(self.parts.first()?.now.get(usize::from(heater))?.get())
    }

    /// The planner waits for this from now on.
    pub fn begin_wait(&self, heat: Heat) {
        if let Some(parts) = self.parts.first() {
            parts.awaited.set(heat);
        }
    }

    /// Whether it waits still.
    pub fn waits(&self) -> bool {
        self.parts.first().is_some_and(|parts| parts.awaited.get().wait != Wait::Nothing)
    }

    /// It waits no more.
    pub fn end_wait(&self) {
        self.begin_wait(Heat::default());
    }

    /// What has been waited for is not waited for any longer (M108): motion goes on.
    pub fn skip(&self) {
        self.end_wait();
        flags::set(Event::BlockDone);
    }
}

#[small]
impl Default for Heaters {
    fn default() -> Self {
        Self::new()
    }
}

/// Switches all heaters and the fan off, as if a line had asked for it.
#[small]
pub fn switch_off(thread: Thread) {
    common::with(thread, |common| {
        if let Some(orders) = common.heat.first_mut() {
            *orders = Orders::OFF;
        }
    });
}

/// How a heater stands: see [`Heaters::standing`].
#[small]
pub fn standing(links: &Links, heater: u8) -> Option<Standing> {
    let mut standing = links.heat.standing(heater)?;
    let orders = common::with(links.thread, |common| common.heat.first().copied())?;
    standing.to = *orders.to.get(usize::from(heater))?;
    Some(standing)
}
