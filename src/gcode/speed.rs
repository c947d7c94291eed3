//! The meaning of S: turns a minute (G97), or a surface speed (G96).
//!
//! A surface speed is kept in m/min. It is converted to turns a minute when the spindle is commanded: by the planner
//! when it switches the spindle, and by the power task while X moves (`tasks::surface`). The axis of rotation is X 0 in
//! the work coordinates in force, with all offsets.

use kerf_macros::small;

use super::block::Block;
use super::command::Surface;
use super::modal::{SpeedMode, Turn, Units};
use super::state::State;
use super::words::D;
use crate::capability::Capability;
use crate::status::Status;

/// Metres in a foot.
const FOOT: f32 = 0.3048;

#[small]
impl State {
    /// Carries out G96 with its D, and G97. Without S, G97 keeps the spindle speed that G96 gives at the programmed X.
    #[inline(never)]
    pub(super) fn set_speed_mode(&mut self, block: &Block, mode: SpeedMode) -> Result<(), Status> {
        match mode {
            SpeedMode::Surface => self.limit = block.get(D).map_or(Ok(0), limit)?,
            SpeedMode::Turns => {
                if let Some(surface) = self.surface() {
                    let [x, ..] = self.position;
                    self.speed = surface.turns(x);
                }
            }
        }
        self.modal.speed_mode = mode;
        Ok(())
    }

    /// Converts S from feet a minute to m/min, if S is a surface speed and G20 is in force. Call it after S has been
    /// read.
    #[inline(always)]
    pub(super) fn take_feet(&mut self) {
        if Capability::Lathe.is_built_in()
            && self.modal.speed_mode == SpeedMode::Surface
            && self.modal.units == Units::Inch
        {
            self.speed *= FOOT;
        }
    }

    /// Whether this line may move the axis of rotation while the spindle turns with a surface speed.
    pub(super) fn moves_axis_of_rotation(&self, block: &Block) -> bool {
        self.modal.speed_mode == SpeedMode::Surface
            && self.modal.spindle != Turn::Off
            && (block.system.is_some() || block.tool_length.is_some() || block.non_modal.is_some())
    }

    /// Returns the constant surface speed (G96) in force; `None` with G97, and on a machine without a lathe.
    #[inline(always)]
    pub(super) fn surface(&self) -> Option<Surface> {
        if Capability::Lathe.is_built_in() { self.surface_in_force() } else { None }
    }

    #[inline(never)]
    fn surface_in_force(&self) -> Option<Surface> {
        let [origin, ..] = self.origin;
        let surface = Surface { speed: self.speed, limit: self.limit, origin };
        (self.modal.speed_mode == SpeedMode::Surface).then_some(surface)
    }
}

/// Returns D, the highest spindle speed in turns a minute. It has to be more than 0.
fn limit(word: &super::decimal::Decimal) -> Result<u16, Status> {
    let turns = u16::try_from(word.integer()?).map_err(|_| Status::OutOfRange)?;
    if turns == 0 { Err(Status::OutOfRange) } else { Ok(turns) }
}

#[cfg(test)]
mod tests {
    use crate::gcode::command::Surface;
    use crate::units::Length;

    #[test]
    fn a_surface_speed_asks_for_turns_by_the_radius() {
        let of = |speed, limit| Surface { speed, limit, origin: Length(-50_000) };
        // At 10 mm, on either side.
        for x in [50_000, -150_000] {
            let turns = of(100.0, 0).turns(Length(x));
            assert!((turns - 1_591.549).abs() < 0.01, "{turns}");
        }
        assert_eq!(of(100.0, 1_000).turns(Length(50_000)), 1_000.0);
        assert_eq!(of(100.0, 1_000).turns(Length(-50_000)), 1_000.0);
        assert_eq!(of(100.0, 0).turns(Length(-50_000)), 65_535.0);
        assert_eq!(of(0.0, 0).turns(Length(50_000)), 0.0);
    }
}
