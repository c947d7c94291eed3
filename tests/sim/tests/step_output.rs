//! Step pulses as drivers need them: width, polarity, and time for directions to settle.

use kerf::boards::{Board, MEGA2560_GRBL, RAMPS14_CNC};
use kerf_sim::Machine;
use kerf_sim::job::{self, Options};

use crate::common::firmware;

/// Cycles in a microsecond.
const US: u64 = 16;
/// Most by which a pulse may be wider, cycles.
const LOADING: u64 = 240;

/// Runs a job with a setting on a fast machine. The job must end on its exact steps.
fn ran(board: &'static Board, setting: &str, job: &str) -> Machine {
    let mut machine = firmware(board);
    let fast = ["x", "y", "z", "a"]
        .map(|axis| format!("{{{axis}:{{am:1,vm:1e6,fr:1e6,jm:1e6,ac:2000,jd:1}}}}"));
    let settings = fast.into_iter().chain([setting.to_string()]).collect();
    let options = Options { settings, ..Options::default() };
    let report = job::run(&mut machine, &job::lines_of(job), &options, |_| {}).unwrap();
    assert!(report.ok, "{setting}: {:?}", report.problems);
    assert_eq!(machine.missed_tops(), 0, "{setting}: a tick is lost");
    machine
}

/// Speeds from slow to the highest, with one motor to four, in and out of lockstep.
const JOB: &str =
    "g1 f100000 x8\nx0\nf300 y0.5\nf100000 x8 y8\nx0 y3\nx5 y7 z4 a2\ng0 x0 y0 z0 a0\n";

fn pulses(machine: &Machine) -> Vec<(u64, u64)> {
    machine.recorder().motors().iter().filter_map(|m| m.pulse).collect()
}

#[test]
fn pulses_are_as_wide_as_is_asked_for() {
    for us in [1, 2, 3, 5, 10] {
        // In lockstep, with two motors out of lockstep, with four.
        for job in [JOB, "g1 f100000 x8 y5\nx0 y0\n", "g1 f1000 x8 y5 z3 a2\n"] {
            let machine = ran(&MEGA2560_GRBL, &format!("{{spw:{us}}}"), job);
            for (least, most) in pulses(&machine) {
                assert!(least >= us * US, "{least} cycles for {us} us in {job}");
                // A tick that loads a segment does so during its pulses.
                assert!(most <= us.max(2) * US + LOADING, "{most} cycles for {us} us in {job}");
            }
        }
    }
}

#[test]
fn polarity_is_each_motors_own() {
    for board in [&MEGA2560_GRBL, &RAMPS14_CNC] {
        let machine = ran(board, "{1sp:1,3sp:1,spw:4}", JOB);
        for (m, motor) in board.motors.iter().enumerate() {
            let high = machine.peek(motor.step.port.address() as u16) & 1 << motor.step.bit != 0;
            assert_eq!(high, m % 2 == 0, "motor {m} at rest");
        }
        for (least, most) in pulses(&machine) {
            assert!(least >= 4 * US && most <= 4 * US + LOADING, "{least} to {most} cycles");
        }
    }
}

#[test]
fn directions_stand_before_the_first_step() {
    for us in [0, 1, 5, 20, 100] {
        let machine = ran(&MEGA2560_GRBL, &format!("{{dsu:{us}}}"), JOB);
        let setups: Vec<_> =
            machine.recorder().motors().iter().filter_map(|m| m.min_setup).collect();
        assert_eq!(setups.len(), 4, "all motors turn round");
        assert!(setups.iter().all(|least| *least >= us * US), "{setups:?} cycles for {us} us");
    }
}
