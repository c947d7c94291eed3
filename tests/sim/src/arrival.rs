//! Checks the final position after a job that another program has sent.

use std::fmt::{self, Display, Formatter};
use std::path::Path;

use anyhow::Result;
use kerf::boards::Board;
use kerf_sim::emulated::{Emulated, Talks};
use kerf_sim::job::{Lines, read_lines, read_setup};
use kerf_sim::oracle::Setup;
use kerf_sim::{Host, Machine, by_name, oracle, print};

/// Time for motion that is still under way when the sender has left, ms of AVR time.
const SETTLE_MS: u64 = 1_000;
/// Longest time from reset to the greeting, ms of AVR time.
const BOOT_MS: u64 = 5_000;

/// A motor at the end of a job.
struct Motor {
    /// Steps up minus steps down.
    steps: i64,
    /// The steps that the oracle expects.
    expected: i64,
    /// Steps in both directions together.
    total: u64,
}

/// The motors at the end of a job.
pub struct Arrival(Vec<Motor>);

impl Arrival {
    /// Compares the motors of `machine` with an independent reading of the job. The settings are asked of `twin`, a
    /// second machine with the same EEPROM contents, because the port of `machine` may speak any dialect by now.
    pub fn of(machine: &mut Machine, twin: &mut Machine, job: &Path) -> Result<Arrival> {
        let lines = read_lines(job)?;
        Host::new(1).run_for_ms(machine, SETTLE_MS)?;
        let setup = setup_of(twin)?;
        let expected = end_of(machine.board(), &lines, &setup)?;
        let motors = machine.recorder().motors().iter();
        let ends: Vec<_> = motors.map(|motor| (motor.position, motor.steps)).collect();
        Ok(Self::at(&setup, &ends, &expected))
    }

    /// As [`Arrival::of`], with steps counted from `begun`. The settings are asked of the board itself, after a power
    /// cut.
    pub fn of_emulated(board: &mut Emulated, begun: &[(i64, u64)], job: &Path) -> Result<Arrival> {
        let lines = read_lines(job)?;
        board.session(Talks { open: true, reads: true });
        board.run_for_ms(SETTLE_MS)?;
        let ends = board.steps().into_iter().zip(board.totals()).zip(begun);
        let ends: Vec<_> = ends.map(|((at, total), from)| (at - from.0, total - from.1)).collect();
        board.cut_power();
        let mut host = Host::new(1);
        host.boot(board, BOOT_MS)?;
        let setup = read_setup(board, &mut host)?;
        Ok(Self::at(&setup, &ends, &end_of(board.board(), &lines, &setup)?))
    }

    /// Pairs each motor's setup with its end position and its steps in both directions, and with the position that is
    /// expected.
    fn at(setup: &Setup, ends: &[(i64, u64)], expected: &[i64]) -> Arrival {
        let motors = setup.motors.iter().zip(ends).zip(expected);
        let motors = motors.map(|((setup, (position, total)), expected)| Motor {
            steps: if setup.inverted { -position } else { *position },
            expected: *expected,
            total: *total,
        });
        Arrival(motors.collect())
    }

    /// Whether every motor is where it should be, to the step.
    pub fn is_exact(&self) -> bool {
        self.0.iter().all(|motor| motor.steps == motor.expected)
    }
}

/// Returns the steps of each motor at the end of a job, by an independent reading of it.
fn end_of(board: &Board, lines: &Lines, setup: &Setup) -> Result<Vec<i64>> {
    if print::is_print(board, lines) {
        return print::end_of(lines, setup);
    }
    Ok(oracle::run(lines.iter().map(|(n, l)| (*n, l.as_str())), setup)?.steps.to_vec())
}

/// Asks a machine that has just been started for its motors and axes.
fn setup_of(machine: &mut Machine) -> Result<Setup> {
    if machine.board().features.contains(&"dialect-tinyg") {
        let mut host = Host::new(1);
        host.boot(machine, BOOT_MS)?;
        return read_setup(machine, &mut host);
    }
    by_name::boot(machine)?;
    by_name::read_setup(machine)
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
