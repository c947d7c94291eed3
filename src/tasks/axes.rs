//! What the settings say of the axes to those who interpret lines and those who plan moves.

use crate::config::Settings;
use crate::gcode::axes::{Axes, AxisMode};

impl Axes for Settings {
    fn mode(&self, axis: u8) -> AxisMode {
        match self.axis_mode(axis.into()) {
            0 => AxisMode::Disabled,
            2 => AxisMode::Inhibited,
            3 => AxisMode::Radius,
            _ => AxisMode::Standard,
        }
    }

    fn radius(&self, axis: u8) -> u32 {
        self.radius_nm(axis.into())
    }
}

/// The axis whose position moves a motor; none above 5: that of an inhibited axis stands still.
pub fn moved_by(settings: &Settings, motor: usize) -> u8 {
    let axis = settings.motor_axis(motor);
    if settings.mode(axis) == AxisMode::Inhibited { u8::MAX } else { axis }
}
