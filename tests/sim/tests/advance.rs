//! Pressure advance on the chip: at the pins, the steps of the extruder agree with its line plus K times its
//! velocity, no segment comes late, and at rest the extruder is where its line ends.

use kerf::boards::RAMPS14;
use kerf_sim::job;
use kerf_sim::{Host, Machine, Step};

use crate::common::{booted, set};

const HZ: f64 = 16e6;
/// Steps in a mm along X, and in a mm of filament.
const X: f64 = 80.0;
const E: f64 = 3_200.0 / 34.4086;
/// Filament for each mm of the path, and K.
const RATIO: f64 = 0.0333;

fn printer() -> (Machine, Host) {
    let (mut machine, mut host) = booted(&RAMPS14);
    for line in ["{mch:3}", "{he1k:0}", "{sv:0}", "{he1pa:0.05}", "g21 g90"] {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, 100).unwrap();
    machine.recorder_mut().keep_log();
    (machine, host)
}

/// Sends lines and waits for rest.
fn run(machine: &mut Machine, host: &mut Host, lines: &str) {
    let setup = job::read_setup(machine, host).unwrap();
    let lines = job::lines_of(lines);
    job::meter_pauses(machine, &lines, &setup);
    for (_, line) in lines.iter() {
        set(machine, host, line);
    }
    let mut steps = u64::MAX;
    while machine.recorder().steps() != steps {
        steps = machine.recorder().steps();
        host.run_for_ms(machine, 500).unwrap();
    }
    let starved = host.ask(machine, "{stv:n}", 1_000).unwrap();
    assert_eq!(starved.body["stv"], 0, "no segment comes late");
    let found = machine.recorder().pauses();
    assert!(found.starved.is_empty(), "{found:?}");
}

/// A path along X of `lines` lines of `length` mm, in three parts with different feeds.
fn along_x(lines: usize, length: f64) -> String {
    (1..=lines)
        .map(|n| {
            let x = n as f64 * length;
            let feed = [3_600, 1_200, 4_800][3 * (n - 1) / lines];
            format!("g1 x{x:.4} a{:.4} f{feed}\n", x * RATIO)
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
        let (mut machine, mut host) = printer();
        set(&mut machine, &mut host, &format!("{{he1pa:{k}}}"));
        run(&mut machine, &mut host, &along_x(lines, length));
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
    let (mut machine, mut host) = printer();
    let mut lines = String::new();
    for n in 0..40 {
        let (x, y) = (f64::from(n % 7) * 3.0, f64::from(n % 5) * 2.5);
        let a = f64::from(n) * 0.2;
        lines += &match n % 4 {
            0 => format!("g1 x{x} y{y} f9000\n"),
            1 => format!("g1 x{x} y{y} a{a} f3600\n"),
            2 => format!("g1 a{} f1800\n", a - 1.0),
            _ => format!("g2 x{x} y{y} r9 a{a} f3000\n"),
        };
    }
    run(&mut machine, &mut host, &format!("{lines}g1 x1 y2 a3\n"));
    let at = machine.recorder().motors().each_ref().map(|motor| motor.position);
    assert_eq!(at, [80, 160, 0, (3.0 * E).round() as i64]);
}

#[test]
fn holds_and_drops_leave_the_extruder_on_its_line() {
    let (mut machine, mut host) = printer();
    set(&mut machine, &mut host, "g1 x60 a4 f3600");
    host.run_for_ms(&mut machine, 400).unwrap();
    machine.send(b"!");
    host.run_for_ms(&mut machine, 400).unwrap();
    let held = machine.recorder().steps();
    let motors = machine.recorder().motors();
    let (x, e) = (motors[0].position as f64, motors[3].position as f64);
    assert!(x > 500.0 && x < 4_000.0);
    assert!((e - x / X * (4.0 / 60.0) * E).abs() <= 1.0, "{e} steps at {x}");
    host.run_for_ms(&mut machine, 100).unwrap();
    assert_eq!(machine.recorder().steps(), held);
    machine.send(b"~");
    host.run_for_ms(&mut machine, 300).unwrap();
    machine.send(b"!%");
    host.run_for_ms(&mut machine, 400).unwrap();
    machine.send(b"~");
    for line in ["g1 x0 a0 f3600", "g1 x10 a0.7"] {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, 3_000).unwrap();
    let motors = machine.recorder().motors();
    assert_eq!((motors[0].position, motors[3].position), (800, (0.7 * E).round() as i64));
}

#[test]
fn no_segment_comes_late_whatever_k_is() {
    for (k, jerk) in [("2", 7_200), ("0.5", 1_000_000), ("0.05", 100_000)] {
        let (mut machine, mut host) = printer();
        for line in [
            &format!("{{he1pa:{k}}}") as &str,
            &format!("{{x:{{jm:{jerk},vm:36000,fr:36000}},y:{{jm:{jerk},vm:36000,fr:36000}}}}"),
            "{a:{jm:900000,vm:12000,fr:12000,ac:20000}}",
        ] {
            set(&mut machine, &mut host, line);
        }
        let mut lines = String::from("g1 f36000\n");
        for n in 0..120 {
            let (x, y) = (f64::from(n % 3) * 8.0, f64::from(n % 4) * 7.0);
            let a = f64::from(n) * 0.9;
            lines += &match n % 5 {
                4 => format!("g1 x{x} y{y} f36000\n"),
                _ => format!("g1 x{x} y{y} a{a} f{}\n", 3_000 + 8_000 * (n % 4)),
            };
        }
        run(&mut machine, &mut host, &format!("{lines}g1 x1 y2 a3 f6000\n"));
        let at = machine.recorder().motors().each_ref().map(|motor| motor.position);
        assert_eq!(at, [80, 160, 0, (3.0 * E).round() as i64], "K {k}");
    }
}
