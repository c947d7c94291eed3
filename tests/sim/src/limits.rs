//! The limits of the axes, asked of the firmware.

use serde_json::Value;

use crate::by_name;
use crate::host::Host;
use crate::machine::Machine;
use crate::oracle::{AXES, Setup};
use crate::runs::Runs;
use crate::speech::Speech;

/// Longest time of an answer, ms of the machine's time.
const ASK_MS: u64 = 5_000;
const AXIS_NAMES: [char; AXES] = ['x', 'y', 'z', 'a', 'b', 'c'];
/// mm/s3 in a million mm/min3, the unit of `jm`.
const PER_JERK: f64 = 1e6 / 216e3;
/// A jerk limit that allows the whole acceleration within this time has no effect, s.
const AT_ONCE_S: f64 = 0.001;

/// The limits of an axis, in mm or degrees and s. A limit that does not exist is infinite.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Limits {
    /// The setting `vm`.
    pub velocity: f64,
    /// The setting `ac`.
    pub acceleration: f64,
    /// The setting `jm`.
    pub jerk: f64,
}

impl Limits {
    /// No limit at all.
    pub const NONE: Self =
        Self { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };

    /// Converts settings; a missing one is no limit.
    fn of(vm: Option<f64>, ac: Option<f64>, jm: Option<f64>) -> Self {
        let acceleration = ac.filter(|ac| *ac > 0.0).unwrap_or(f64::INFINITY);
        let jerk = jm.map(|jm| jm * PER_JERK).filter(|jerk| jerk * AT_ONCE_S < acceleration);
        Self {
            velocity: vm.map_or(f64::INFINITY, |vm| vm / 60.0),
            acceleration,
            jerk: jerk.unwrap_or(f64::INFINITY),
        }
    }
}

/// The limits of all axes.
pub type AxisLimits = [Limits; AXES];

/// Asks a machine at rest for the limits of the axes that its motors drive, in the dialect of its board.
pub fn of(machine: &mut Machine, setup: &Setup) -> AxisLimits {
    match Speech::of(machine.board().features) {
        Some(speech) => asked(machine, &mut Host::new(1).speaking(speech), setup),
        None => limits(setup, |name| by_name::value(machine, name).ok()),
    }
}

/// Asks over a host for the limits of the axes that motors drive.
pub fn asked(machine: &mut impl Runs, host: &mut Host, setup: &Setup) -> AxisLimits {
    limits(setup, |name| {
        let response = host.ask(machine, &format!("{{{name}:n}}"), ASK_MS).ok()?;
        response.body.get(name).cloned()
    })
}

fn limits(setup: &Setup, mut value: impl FnMut(&str) -> Option<Value>) -> AxisLimits {
    std::array::from_fn(|axis| {
        if !setup.motors.iter().any(|motor| motor.drives(axis)) {
            return Limits::NONE;
        }
        let name = AXIS_NAMES[axis];
        let [vm, ac, jm] = ["vm", "ac", "jm"].map(|key| value(&format!("{name}{key}"))?.as_f64());
        Limits::of(vm, ac, jm)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_become_limits() {
        let router = Limits::of(Some(5_000.0), Some(500.0), Some(4_000.0));
        assert!((router.velocity - 83.333).abs() < 1e-3);
        assert_eq!(router.acceleration, 500.0);
        assert!((router.jerk - 18_518.5).abs() < 0.1);
    }

    #[test]
    fn what_has_no_effect_is_no_limit() {
        let none = Limits::of(None, Some(0.0), None);
        assert_eq!(none, Limits::NONE);
        assert_eq!(Limits::of(None, Some(500.0), Some(108_000.0)).jerk, f64::INFINITY);
    }
}
