//! The settings that the oracle needs, asked of the firmware.

use anyhow::{Context, Result};
use kerf::boards::MOTORS;
use kerf::kinematics::{DIFFERENCE, SUM};
use serde_json::Value;

use super::ASK_MS;
use crate::host::Host;
use crate::oracle::{AXES, AxisMode, Decimal, MotorSetup, Setup};
use crate::runs::Runs;

const AXIS_NAMES: [char; AXES] = ['x', 'y', 'z', 'a', 'b', 'c'];

/// Reads motors and axes from the firmware.
pub fn read_setup(machine: &mut impl Runs, host: &mut Host) -> Result<Setup> {
    let mut motors = Vec::with_capacity(MOTORS);
    for n in 1..=MOTORS {
        let response = host.ask(machine, &format!("{{{n}:n}}"), ASK_MS)?;
        let group = response.body.get(n.to_string());
        let motor = group.and_then(motor_of);
        let raw = &response.raw;
        motors.push(motor.with_context(|| format!("no settings of motor {n} in {raw}"))?);
    }
    let mut modes = [AxisMode::Standard; AXES];
    for motor in &motors {
        for axis in [motor.axis, if motor.besides == 0 { motor.axis } else { 1 }] {
            modes[axis] = mode_of(machine, host, axis)?;
        }
    }
    Ok(Setup { motors, modes })
}

fn motor_of(group: &Value) -> Option<MotorSetup> {
    let number = |key| Decimal::parse(&group.get(key)?.as_number()?.to_string());
    let whole = |key| number(key)?.as_whole();
    let drives = usize::try_from(whole("ma")?).ok()?;
    let besides = match u8::try_from(drives) {
        Ok(SUM) => 1,
        Ok(DIFFERENCE) => -1,
        _ => 0,
    };
    let axis = if besides == 0 { drives } else { 0 };
    let moves = axis < AXES;
    Some(MotorSetup {
        // A motor that moves no axis is assigned to the last axis, with a travel of 0, and so makes no steps.
        axis: axis.min(AXES - 1),
        besides,
        step_angle: number("sa")?,
        travel: if moves { number("tr")? } else { Decimal::whole(0) },
        microsteps: u32::try_from(whole("mi")?).ok()?,
        inverted: whole("po")? != 0,
        // Not every firmware has this setting.
        active_low: whole("sp").unwrap_or(0) != 0,
    })
}

fn mode_of(machine: &mut impl Runs, host: &mut Host, axis: usize) -> Result<AxisMode> {
    let name = format!("{}am", AXIS_NAMES[axis]);
    let response = host.ask(machine, &format!("{{{name}:n}}"), ASK_MS)?;
    Ok(match response.body.get(&name).and_then(Value::as_i64) {
        Some(0) => AxisMode::Disabled,
        Some(2) => AxisMode::Inhibited,
        Some(3) => AxisMode::Radius,
        _ => AxisMode::Standard,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_may_move_nothing() {
        let motor = motor_of(&serde_json::json!({"ma":255,"sa":1.8,"tr":5,"mi":8,"po":0})).unwrap();
        assert_eq!(motor.steps(10_000), 0);
    }

    #[test]
    fn a_motor_may_drive_two_axes() {
        let motor = |ma: u8| {
            motor_of(&serde_json::json!({"ma":ma,"sa":1.8,"tr":40,"mi":16,"po":0})).unwrap()
        };
        assert_eq!((motor(SUM).axis, motor(SUM).besides), (0, 1));
        assert_eq!((motor(DIFFERENCE).axis, motor(DIFFERENCE).besides), (0, -1));
        assert_eq!(motor(SUM).steps(10_000), 80);
    }

    #[test]
    fn reads_a_motor_group() {
        let group = serde_json::json!({"ma":2,"sa":1.8,"tr":1.25,"mi":8,"po":1,"pm":2,"sp":0});
        let motor = motor_of(&group).unwrap();
        assert_eq!((motor.axis, motor.microsteps, motor.inverted), (2, 8, true));
        assert_eq!(motor.steps(10_000), 1280);
        assert!(motor_of(&serde_json::json!({"ma":1})).is_none());
    }
}
