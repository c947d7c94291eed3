//! Where a job that somebody else sent has to have brought the machine.

use std::fmt::{self, Display, Formatter};
use std::path::Path;

use anyhow::Result;
use kerf_sim::job::{read_lines, read_setup};
use kerf_sim::{Host, Machine, oracle, print};

/// For what is under way when the sender has left, ms of AVR time.
const SETTLE_MS: u64 = 1_000;
/// Longest time from reset to the greeting, ms of AVR time.
const BOOT_MS: u64 = 5_000;

/// A motor at the end of a job.
struct Motor {
    /// Steps on balance.
    steps: i64,
    /// The oracle's.
    expected: i64,
    /// Steps in both directions.
    total: u64,
}

/// The motors at the end of a job.
pub struct Arrival(Vec<Motor>);

impl Arrival {
    /// Asks the firmware for its motors, and an independent reading of the job for the steps. Asked is a twin with the memory of the machine, for
    /// the port of that one may speak any dialect by now.
    pub fn of(machine: &mut Machine, twin: &mut Machine, job: &Path) -> Result<Arrival> {
        let lines = read_lines(job)?;
        Host::new(1).run_for_ms(machine, SETTLE_MS)?;
        let mut host = Host::new(1);
        host.boot(twin, BOOT_MS)?;
        let setup = read_setup(twin, &mut host)?;
        let expected = match print::is_print(machine.board(), &lines) {
            true => print::end_of(&lines, &setup)?,
            false => oracle::run(lines.iter().map(|(n, l)| (*n, l.as_str())), &setup)?.steps,
        };
        let motors = setup.motors.iter().zip(machine.recorder().motors());
        let motors = motors.zip(expected).map(|((setup, motor), expected)| Motor {
            steps: if setup.inverted { -motor.position } else { motor.position },
            expected,
            total: motor.steps,
        });
        Ok(Arrival(motors.collect()))
    }

    /// Whether every motor is where it should be, to the step.
    pub fn is_exact(&self) -> bool {
        self.0.iter().all(|motor| motor.steps == motor.expected)
    }
}

impl Display for Arrival {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for (i, Motor { steps, expected, total }) in self.0.iter().enumerate() {
            let motor = i + 1;
            writeln!(f, "arrival {motor}  steps {steps}  expected {expected}  total {total}")?;
        }
        writeln!(f, "result: {}", if self.is_exact() { "OK" } else { "FAILED" })
    }
}
