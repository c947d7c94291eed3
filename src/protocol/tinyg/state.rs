//! The state of the machine, in TinyG's numbers.

use crate::machine::{Alarm, Cycle, Doing};
use crate::motion::snapshot::Program;
use crate::protocol::{Hold, Machine, Value};

/// The values of `stat`. From [`INTERLOCK`] on, the values of `macs` are five less.
const READY: i32 = 1;
const ALARM: i32 = 2;
const STOP: i32 = 3;
const END: i32 = 4;
const RUN: i32 = 5;
const HOLD: i32 = 6;
const PROBE: i32 = 7;
const HOMING: i32 = 9;
const JOG: i32 = 10;
const INTERLOCK: i32 = 11;
const SHUTDOWN: i32 = 11;
const PANIC: i32 = 13;

/// Returns `stat`: the state in one number.
#[small]
#[inline(never)]
pub fn stat(machine: &mut impl Machine) -> i32 {
    let doing = machine.doing();
    let is_g2core = machine.settings().is_g2core();
    match doing {
        Doing::Alarm(Alarm::Shutdown) => SHUTDOWN + i32::from(is_g2core),
        Doing::Alarm(Alarm::Panic) => PANIC,
        Doing::Alarm(_) => ALARM,
        Doing::Door if is_g2core => INTERLOCK,
        Doing::Door | Doing::Holds => HOLD,
        Doing::Probes => PROBE,
        Doing::Homes => HOMING,
        Doing::Jogs => JOG,
        Doing::Runs => RUN,
        Doing::Rests => match machine.rest() {
            Program::Ready => READY,
            Program::Stopped => STOP,
            Program::Ended => END,
        },
    }
}

/// Whether the machine is shut down and shows a number that means an open door on a g2core.
#[small]
pub fn is_tinyg_shutdown(machine: &mut impl Machine) -> bool {
    matches!(machine.doing(), Doing::Alarm(Alarm::Shutdown)) && !machine.settings().is_g2core()
}

/// Returns `macs`: the machine state.
#[small]
pub fn macs(machine: &mut impl Machine) -> i32 {
    match stat(machine) {
        HOLD | PROBE | HOMING | JOG => RUN,
        state if state >= INTERLOCK => state - (INTERLOCK - 6),
        state => state,
    }
}

/// Returns `cycs`: the cycle.
#[small]
pub fn cycs(machine: &mut impl Machine) -> i32 {
    if matches!(machine.doing(), Doing::Alarm(_)) {
        return 0;
    }
    match machine.cycle() {
        Cycle::Lines | Cycle::Stopped | Cycle::Check => {
            i32::from(machine.hold() != Hold::None || machine.value(Value::Working) != 0)
        }
        Cycle::Probe => 2,
        Cycle::Homing => 3,
        Cycle::Jog => 4,
    }
}

/// Returns `mots`: the motion state.
#[small]
pub fn mots(machine: &mut impl Machine) -> i32 {
    if machine.hold() != Hold::None { 2 } else { machine.value(Value::Running) }
}

/// Returns `hold`: the state of the feedhold.
#[small]
pub fn hold(machine: &mut impl Machine) -> i32 {
    match machine.hold() {
        Hold::None => 0,
        Hold::Slows => 3,
        Hold::Rests => 4,
    }
}

#[cfg(test)]
mod tests {
    use super::super::fake::Fake;
    use super::*;
    use crate::config::{Name, Setting};

    fn told(doing: Doing, is_g2core: bool) -> (i32, i32) {
        let mut fake = Fake::new();
        let setting = Setting::find(&Name::new().with(b"dia").unwrap()).unwrap();
        fake.settings.store(setting, is_g2core.into());
        fake.doing = doing;
        (stat(&mut fake), macs(&mut fake))
    }

    #[test]
    fn each_state_has_its_numbers() {
        for (doing, tinyg, g2core) in [
            (Doing::Rests, (1, 1), (1, 1)),
            (Doing::Runs, (5, 5), (5, 5)),
            (Doing::Probes, (7, 5), (7, 5)),
            (Doing::Homes, (9, 5), (9, 5)),
            (Doing::Jogs, (10, 5), (10, 5)),
            (Doing::Holds, (6, 5), (6, 5)),
            (Doing::Door, (6, 5), (11, 6)),
            (Doing::Alarm(Alarm::Alarm), (2, 2), (2, 2)),
            (Doing::Alarm(Alarm::Limit), (2, 2), (2, 2)),
            (Doing::Alarm(Alarm::Shutdown), (11, 6), (12, 7)),
            (Doing::Alarm(Alarm::Panic), (13, 8), (13, 8)),
        ] {
            assert_eq!((told(doing, false), told(doing, true)), (tinyg, g2core), "{doing:?}");
        }
    }
}
