//! The heaters of a printer around an emulated board.
//!
//! The program that emulates the chip knows no heat. The temperatures are computed here, between two requests to it: the
//! duty cycles of the heaters' pins at the end of a request count for all of it. A request of at most [`SLICE_MS`] is
//! short enough, as a heater's period is 100 ms and more, and a sensor's time constant seconds.

use anyhow::Result;

use super::Emulated;
use crate::runs::Runs;
use crate::thermal::{EVERY_MS, SUPPLY, Thermal};

/// The longest request between two computations, ms.
const SLICE_MS: u64 = 2;
/// What the converter reads at its reference.
const FULL: f64 = 4_095.0;

/// The heaters of a board, their sensors and the fan.
pub struct Heat(Option<Thermal>);

impl Heat {
    /// Heaters at room temperature, at a board that has pins for them.
    pub fn of(board: &mut Emulated) -> Self {
        let mut heat = Self(board.board().heaters.map(Thermal::new));
        heat.pass(board, EVERY_MS);
        heat
    }

    /// Returns the heaters; `None` at a board without.
    pub fn thermal_mut(&mut self) -> Option<&mut Thermal> {
        self.0.as_mut()
    }

    /// Runs a board up to a cycle, and its heaters with it.
    pub fn run_until(&mut self, board: &mut Emulated, until: u64) -> Result<()> {
        loop {
            let left = until.saturating_sub(board.cycle()) / board.cycles(1);
            let ms = if self.0.is_some() { left.min(SLICE_MS) } else { left };
            board.run_for_ms(ms)?;
            self.pass(board, ms);
            if ms == left {
                return Ok(());
            }
        }
    }

    /// Lets the heaters be at their present power for a time, and puts the voltages at the converter.
    fn pass(&mut self, board: &mut Emulated, ms: u64) {
        let Some(thermal) = &mut self.0 else { return };
        let power = thermal.pins().heaters.map(|heater| board.share(heater.pin));
        let fan = board.share(thermal.pins().fan);
        for _ in 0..ms / EVERY_MS {
            for (channel, millivolts) in thermal.pass(power, fan, board.cycle()) {
                board.sense(channel, (f64::from(millivolts) / SUPPLY * FULL).round() as u16);
            }
        }
    }
}
