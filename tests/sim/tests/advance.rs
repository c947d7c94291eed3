//! Pressure advance on the chip: at the pins, the steps of the extruder agree with its line plus K times its
//! velocity, no segment comes late, and at rest the extruder is where its line ends.

use kerf::boards::{RAMPS14, inputs};
use kerf_sim::{Machine, Step, by_name};

use crate::common::printing;
use crate::common::printing::{set, take};

const HZ: f64 = 16e6;
/// Steps in a mm along X, and in a mm of filament.
const X: f64 = 80.0;
const E: f64 = 3_200.0 / 34.4086;
/// Filament for each mm of the path, and K.
const RATIO: f64 = 0.0333;

fn printer() -> Machine {
    let mut machine = printing::booted(&RAMPS14);
    for line in ["{mch:3}", "{he1k:0}", "{he1pa:0.05}"] {
        set(&mut machine, line);
    }
    machine.recorder_mut().keep_log();
    machine
}

/// Sends lines and waits for rest.
fn run(machine: &mut Machine, lines: &str) {
    let setup = by_name::read_setup(machine).unwrap();
    printing::meter_pauses(machine, lines, &setup);
    for line in lines.lines() {
        take(machine, line);
    }
    let mut steps = u64::MAX;
    while machine.recorder().steps() != steps {
        steps = machine.recorder().steps();
        machine.run_for_ms(500).unwrap();
    }
    let said = String::from_utf8(machine.receive()).unwrap();
    assert!(!said.contains("late"), "no segment comes late: {said}");
    let found = machine.recorder().pauses();
    assert!(found.starved.is_empty(), "{found:?}");
}

/// A path along X of `lines` lines of `length` mm, in three parts with different feeds.
fn along_x(lines: usize, length: f64) -> String {
    (1..=lines)
        .map(|n| {
            let x = n as f64 * length;
            let feed = [3_600, 1_200, 4_800][3 * (n - 1) / lines];
            format!("G1 X{x:.4} E{:.4} F{feed}\n", x * RATIO)
        })
        .collect()
}

/// Returns the position of a motor at a time, interpolated between its steps.
fn place(steps: &[u64], time: f64) -> f64 {
    let n = steps.partition_point(|step| (*step as f64) < time);
    if n == 0 || n == steps.len() {
        return n as f64;
    }
    let (before, after) = (steps[n - 1] as f64, steps[n] as f64);
    let span = (after - before).min(HZ / 100.0);
    n as f64 + ((time - before) / span).min(1.0) - 0.5
}

/// Returns the largest error of the extruder, steps.
fn worst(log: &[Step], k: f64) -> f64 {
    let x: Vec<_> = log.iter().filter(|step| step.motor == 0).map(|step| step.cycle).collect();
    let half = 0.003 * HZ;
    let (mut at, mut worst) = (0, 0f64);
    for step in log.iter().filter(|step| step.motor == 3) {
        let time = step.cycle as f64;
        let way = place(&x, time + half) - place(&x, time - half);
        let velocity = way / X / (2.0 * half / HZ);
        let model = (place(&x, time) / X + k * velocity) * RATIO * E;
        // Half of the step comes before its pulse.
        let way = if step.positive { 1 } else { -1 };
        worst = worst.max((f64::from(at) + f64::from(way) / 2.0 - model).abs());
        at += way;
    }
    worst
}

#[test]
fn the_extruder_is_ahead_by_k_times_its_velocity() {
    let jobs = [(6, 10.0), (30, 1.0), (150, 0.2)];
    for (k, (lines, length)) in [0.05, 0.1].into_iter().flat_map(|k| jobs.map(|job| (k, job))) {
        let mut machine = printer();
        set(&mut machine, &format!("{{he1pa:{k}}}"));
        run(&mut machine, &along_x(lines, length));
        let far = lines as f64 * length;
        let motors = machine.recorder().motors();
        assert_eq!(motors[0].position, (far * X).round() as i64);
        assert_eq!(motors[3].position, (far * RATIO * E).round() as i64);
        let worst = worst(machine.recorder().log(), k);
        println!("K {k}, {lines} lines of {length} mm: {worst:.2} steps");
        assert!(worst < 1.0, "K {k}, {lines} lines of {length} mm: {worst:.2} steps");
    }
}

#[test]
fn lines_of_all_kinds_end_on_their_steps() {
    let mut machine = printer();
    let mut lines = String::new();
    for n in 0..40 {
        let (x, y) = (f64::from(n % 7) * 3.0, f64::from(n % 5) * 2.5);
        let a = f64::from(n) * 0.2;
        lines += &match n % 4 {
            0 => format!("G1 X{x} Y{y} F9000\n"),
            1 => format!("G1 X{x} Y{y} E{a} F3600\n"),
            2 => format!("G1 E{} F1800\n", a - 1.0),
            _ => format!("G2 X{x} Y{y} R9 E{a} F3000\n"),
        };
    }
    run(&mut machine, &format!("{lines}G1 X1 Y2 E3\n"));
    let at = machine.recorder().motors().each_ref().map(|motor| motor.position);
    assert_eq!(at, [80, 160, 0, (3.0 * E).round() as i64]);
}

/// The door holds the machine, because the dialect of printing hosts has no character for it.
#[test]
fn a_hold_leaves_the_extruder_on_its_line() {
    let mut machine = printer();
    set(&mut machine, "{saf:1}");
    let door = RAMPS14.inputs[inputs::DOOR].unwrap();
    let open = |machine: &mut Machine, open: bool| {
        machine.drive_pin(door.port.letter(), door.bit, !open);
    };
    open(&mut machine, false);
    take(&mut machine, "G1 X60 E4 F3600");
    machine.run_for_ms(400).unwrap();
    open(&mut machine, true);
    machine.run_for_ms(400).unwrap();
    let held = machine.recorder().steps();
    let motors = machine.recorder().motors();
    let (x, e) = (motors[0].position as f64, motors[3].position as f64);
    assert!(x > 500.0 && x < 4_000.0, "{x}");
    assert!((e - x / X * (4.0 / 60.0) * E).abs() <= 1.0, "{e} steps at {x}");
    machine.run_for_ms(100).unwrap();
    assert_eq!(machine.recorder().steps(), held);
    open(&mut machine, false);
    machine.run_for_ms(50).unwrap();
    take(&mut machine, "M108");
    for line in ["G1 X0 E0 F3600", "G1 X10 E0.7"] {
        take(&mut machine, line);
    }
    machine.run_for_ms(4_000).unwrap();
    let motors = machine.recorder().motors();
    assert_eq!((motors[0].position, motors[3].position), (800, (0.7 * E).round() as i64));
}

#[test]
fn no_segment_comes_late_whatever_k_is() {
    for (k, jerk) in [("2", 7_200), ("0.5", 1_000_000), ("0.05", 100_000)] {
        let mut machine = printer();
        for line in [
            &format!("{{he1pa:{k}}}") as &str,
            &format!("{{x:{{jm:{jerk},vm:36000,fr:36000}},y:{{jm:{jerk},vm:36000,fr:36000}}}}"),
            "{a:{jm:900000,vm:12000,fr:12000,ac:20000}}",
        ] {
            set(&mut machine, line);
        }
        let mut lines = String::from("G1 F36000\n");
        for n in 0..120 {
            let (x, y) = (f64::from(n % 3) * 8.0, f64::from(n % 4) * 7.0);
            let a = f64::from(n) * 0.9;
            lines += &match n % 5 {
                4 => format!("G1 X{x} Y{y} F36000\n"),
                _ => format!("G1 X{x} Y{y} E{a} F{}\n", 3_000 + 8_000 * (n % 4)),
            };
        }
        run(&mut machine, &format!("{lines}G1 X1 Y2 E3 F6000\n"));
        let at = machine.recorder().motors().each_ref().map(|motor| motor.position);
        assert_eq!(at, [80, 160, 0, (3.0 * E).round() as i64], "K {k}");
    }
}
