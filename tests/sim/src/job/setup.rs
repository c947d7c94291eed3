//! The settings that the oracle needs, asked of the firmware.

use anyhow::{Context, Result};
use kerf::boards::MOTORS;
use kerf::kinematics::{DIFFERENCE, SUM};
use serde_json::Value;

use super::ASK_MS;
use crate::host::Host;
use crate::oracle::{AXES, AxisMode, Decimal, MotorSetup, Setup};
use crate::runs::Runs;
use crate::speech::Speech;

const AXIS_NAMES: [char; AXES] = ['x', 'y', 'z', 'a', 'b', 'c'];

/// Reads motors and axes from the firmware.
pub fn read_setup(machine: &mut impl Runs, host: &mut Host) -> Result<Setup> {
    // The settings of a motor are asked for as a group, which other firmwares have, too. grbl's dialect has no groups.
    let mut group = (0, Value::Null);
    setup_of(|name| {
        let (owner, key) = name.split_at(1);
        if let Some(motor) = owner.parse().ok().filter(|_| host.speech() == Speech::TinyG) {
            if group.0 != motor {
                let response = host.ask(machine, &format!("{{{motor}:n}}"), ASK_MS)?;
                group = (motor, response.body.get(owner).cloned().unwrap_or_default());
            }
            return group.1.get(key).cloned().with_context(|| format!("no {name}: {}", group.1));
        }
        let response = host.ask(machine, &format!("{{{name}:n}}"), ASK_MS)?;
        let value = response.body.get(name).cloned();
        value.with_context(|| format!("no {name} in {}", response.raw))
    })
}

/// Makes the setup from the values of settings, which `value` returns by their names.
pub fn setup_of(mut value: impl FnMut(&str) -> Result<Value>) -> Result<Setup> {
    let mut motors = Vec::with_capacity(MOTORS);
    for n in 1..=MOTORS {
        let motor = motor_of(|key| value(&format!("{n}{key}")).ok());
        motors.push(motor.with_context(|| format!("no settings of motor {n}"))?);
    }
    let mut modes = [AxisMode::Standard; AXES];
    for motor in &motors {
        for axis in [motor.axis, if motor.besides == 0 { motor.axis } else { 1 }] {
            modes[axis] = mode_of(value(&format!("{}am", AXIS_NAMES[axis])).ok());
        }
    }
    Ok(Setup { motors, modes })
}

/// Reads the travel of X, Y and Z, mm: from `tn` to `tm`.
pub fn read_travels(machine: &mut impl Runs, host: &mut Host) -> Result<[f64; 3]> {
    let mut travels = [0.0; 3];
    for (travel, axis) in travels.iter_mut().zip(AXIS_NAMES) {
        let mut end = |end: &str| -> Result<f64> {
            let name = format!("{axis}{end}");
            let response = host.ask(machine, &format!("{{{name}:n}}"), ASK_MS)?;
            let value = response.body.get(&name).and_then(Value::as_f64);
            value.with_context(|| format!("no {name} in {}", response.raw))
        };
        *travel = end("tm")? - end("tn")?;
    }
    Ok(travels)
}

fn motor_of(mut value: impl FnMut(&str) -> Option<Value>) -> Option<MotorSetup> {
    let mut number = |key| Decimal::parse(&value(key)?.as_number()?.to_string());
    let drives = usize::try_from(number("ma")?.as_whole()?).ok()?;
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
        microsteps: u32::try_from(number("mi")?.as_whole()?).ok()?,
        inverted: number("po")?.as_whole()? != 0,
        // Not every firmware has this setting.
        active_low: number("sp").and_then(|value| value.as_whole()).unwrap_or(0) != 0,
    })
}

fn mode_of(value: Option<Value>) -> AxisMode {
    match value.and_then(|value| value.as_i64()) {
        Some(0) => AxisMode::Disabled,
        Some(2) => AxisMode::Inhibited,
        Some(3) => AxisMode::Radius,
        _ => AxisMode::Standard,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motor_of(group: serde_json::Value) -> Option<MotorSetup> {
        super::motor_of(|key| group.get(key).cloned())
    }

    #[test]
    fn a_motor_may_move_nothing() {
        let motor = motor_of(serde_json::json!({"ma":255,"sa":1.8,"tr":5,"mi":8,"po":0})).unwrap();
        assert_eq!(motor.steps(10_000), 0);
    }

    #[test]
    fn a_motor_may_drive_two_axes() {
        let motor = |ma: u8| {
            motor_of(serde_json::json!({"ma":ma,"sa":1.8,"tr":40,"mi":16,"po":0})).unwrap()
        };
        assert_eq!((motor(SUM).axis, motor(SUM).besides), (0, 1));
        assert_eq!((motor(DIFFERENCE).axis, motor(DIFFERENCE).besides), (0, -1));
        assert_eq!(motor(SUM).steps(10_000), 80);
    }

    #[test]
    fn reads_a_motor_group() {
        let group = serde_json::json!({"ma":2,"sa":1.8,"tr":1.25,"mi":8,"po":1,"pm":2,"sp":0});
        let motor = motor_of(group).unwrap();
        assert_eq!((motor.axis, motor.microsteps, motor.inverted), (2, 8, true));
        assert_eq!(motor.steps(10_000), 1280);
        assert!(motor_of(serde_json::json!({"ma":1})).is_none());
    }
}
