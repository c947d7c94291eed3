//! The pictures of a job, made from the steps, and checked by reading them back.

use std::fs::{self, File};
use std::io::BufReader;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::Machine;
use kerf_sim::job::{self, Options};
use kerf_sim::limits::{self, Limits};
use kerf_sim::oracle::AXES;
use kerf_sim::plot::{self, Axis, Look, Motion, WINDOW_MS};
use kerf_sim::report::Report;

use crate::common::{firmware, scratch};

/// Steps a millimetre.
const PER_MM: f64 = 1_280.0;
/// A jerk limit of 20 millions of mm/min3, in mm/s3.
const JERK: f64 = 400.0 * 1e6 / 216e3;

fn run(job: &str, options: &Options) -> (Machine, Report) {
    let mut machine = firmware(&MEGA2560_GRBL);
    machine.recorder_mut().keep_log();
    let report = job::run(&mut machine, &job::lines_of(job), options, |_| {}).unwrap();
    assert!(report.ok, "{report}");
    (machine, report)
}

fn highest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::MIN, f64::max)
}

#[test]
fn an_s_curve_is_seen_in_the_steps() {
    // The acceleration takes 43 ms to build up, as that of the other axes.
    let low = Options { settings: vec!["{xjm:400,xac:80}".to_string()], ..Options::default() };
    let (mut machine, report) = run("g1 x20 f600", &low);
    let limits = limits::of(&mut machine, &report.setup);
    let motion = Motion::of(&machine, &report.setup, &limits, WINDOW_MS);
    assert_eq!(motion.axes.iter().map(|axis| axis.name).collect::<String>(), "X");
    let Axis { curves, limits, .. } = &motion.axes[0];
    assert_eq!(limits.acceleration, 80.0);
    assert!((limits.jerk / JERK - 1.0).abs() < 1e-6 && limits.velocity > 10.0, "{limits:?}");
    let velocity = highest(&curves.velocity);
    assert!((velocity / 10.0 - 1.0).abs() < 0.02, "{velocity} mm/s");
    assert!((highest(&motion.speed) - velocity).abs() < 1e-9);
    let way: f64 = curves.velocity.iter().sum::<f64>() * 1e-3;
    assert!((way - 20.0).abs() < 0.15, "{way} mm");
    let seconds = curves.velocity.len() as f64 * 1e-3;
    // A trapezoid behind means of 44 and 16 ms, without the first and the last half step.
    let all = 2.0 + 10.0 / 80.0 + 0.060;
    assert!((all - 0.06..all).contains(&seconds), "{seconds} s of {all}");
    let acceleration = highest(&curves.acceleration);
    assert!((acceleration / 80.0 - 1.0).abs() < 0.1, "{acceleration} mm/s2");
    let jerk = highest(&curves.jerk);
    assert!(jerk > 0.7 * JERK && jerk < 1.1 * JERK, "{jerk} of {JERK} mm/s3");
}

#[test]
fn the_plot_is_complete_and_small() {
    let job = "g0 x10 y10\ng1 x20 f600\ny20\ng0 x0 y0";
    let (mut machine, report) = run(job, &Options::default());
    let limits = limits::of(&mut machine, &report.setup);
    let file = scratch("plot.svg");
    plot::write(&file, &machine, &report.setup, &limits, &Look::default(), None).unwrap();
    let svg = fs::read_to_string(&file).unwrap();
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    assert!(svg.len() < 500_000, "{} bytes", svg.len());
    for text in [
        "X, mm",
        "Y, mm",
        "time, s",
        "velocity, mm/s",
        "acceleration, mm/s²",
        "jerk, mm/s³",
        "X, limit 200",
        "Y, limit 200",
        "from positions 10 ms apart",
        "from positions 20 ms apart",
    ] {
        assert!(svg.contains(text), "no {text}");
    }
    assert!(!svg.contains("Z, limit"), "Z does not move");
    let lines = svg.split("<polyline").skip(1).filter_map(|l| l.split("points=\"").nth(1));
    let mut most = 0;
    for points in lines.filter_map(|l| l.split('"').next()) {
        let numbers = points.split([' ', ',']).filter(|n| !n.is_empty());
        let numbers: Vec<f64> = numbers.map(|n| n.parse().unwrap()).collect();
        assert!(numbers.iter().all(|n| (0.0..=1_300.0).contains(n)), "{points}");
        most = most.max(numbers.len() / 2);
    }
    assert!(most > 1_000, "{most} points in a curve");
    let part = Look { span: Some(0.5..0.6), ..Look::default() };
    plot::write(&file, &machine, &report.setup, &limits, &part, None).unwrap();
    assert!(fs::read_to_string(&file).unwrap().len() < svg.len());
}

#[test]
fn a_job_without_a_step_can_be_drawn() {
    let (machine, report) = run("g4 p0.1", &Options::default());
    let file = scratch("still.svg");
    let limits = [Limits::NONE; AXES];
    plot::write(&file, &machine, &report.setup, &limits, &Look::default(), None).unwrap();
}

#[test]
fn the_trace_has_velocities_that_end_at_rest() {
    let file = scratch("velocity.vcd");
    let options = Options { vcd: Some(file.clone()), ..Options::default() };
    let (machine, _) = run("g1 x20 f600\nx15", &options);
    let mut reader = vcd::Parser::new(BufReader::new(File::open(file).unwrap()));
    let header = reader.parse_header().unwrap();
    let code = |name: &str| header.find_var(&["motors", name]).unwrap().code;
    let (step, dir, velocity) = (code("step1"), code("dir1"), code("velocity1"));
    let (mut time, mut steps, mut turns, mut values) = (0, 0, 0, Vec::new());
    for command in reader {
        match command.unwrap() {
            vcd::Command::Timestamp(at) => {
                assert!(at >= time, "time runs back");
                time = at;
            }
            vcd::Command::ChangeScalar(id, value) => {
                steps += u64::from(id == step && value == vcd::Value::V1);
                turns += u64::from(id == dir && value == vcd::Value::V1);
            }
            vcd::Command::ChangeReal(id, value) if id == velocity => values.push(value),
            _ => {}
        }
    }
    assert_eq!((steps, turns), (machine.recorder().motors()[0].steps, 1));
    let cruise = 10.0 * PER_MM;
    let (low, high) = (values.iter().copied().fold(0.0, f64::min), highest(&values));
    assert!((high / cruise - 1.0).abs() < 0.05, "{high} instead of {cruise}");
    assert!(low < -0.3 * cruise && low >= -1.05 * cruise, "{low}");
    assert_eq!(values.last(), Some(&0.0));
}
