//! The path of an arc on the image, not only its end: the total distance of each motor.

use std::fmt::Write;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::job::{self, Options};
use kerf_sim::kinetics::{self, WINDOW_S, Windows};
use kerf_sim::track::{self, SAMPLE_S};

use crate::common::{booted, firmware, set};

/// Steps in a millimetre.
const MM: u64 = 1280;

/// Arcs of 2 mm radius around (0, 0) that begin at (2, 0) of the plane: the words, with `@` for the first axis and
/// `#` for the second, and the distances of both axes, mm.
const ARCS: [(&str, u64, u64); 6] = [
    ("g3 @0 #2", 2, 2),
    ("g2 @0 #2", 6, 6),
    ("g3 @-2 #0", 4, 4),
    ("g2 @-2 #0", 4, 4),
    ("g3 @0 #-2", 6, 6),
    ("g2 @0 #-2", 2, 2),
];

#[test]
fn every_arc_goes_its_way_round() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for line in ["{xjm:5000,yjm:5000,zjm:5000}", "g1 f800"] {
        set(&mut machine, &mut host, line);
    }
    // Axes 0 to 2 of each plane, and the letter of the offset.
    for (plane, first, second, offset) in
        [("g17", 0, 1, 'i'), ("g18", 2, 0, 'k'), ("g19", 1, 2, 'j')]
    {
        let letter = |axis: usize| ["x", "y", "z"][axis];
        for (words, first_mm, second_mm) in ARCS {
            set(&mut machine, &mut host, &format!("g28.3 {}2 {}0", letter(first), letter(second)));
            machine.run_for_ms(50).unwrap();
            let steps = |machine: &kerf_sim::Machine| {
                [first, second].map(|axis| machine.recorder().motors()[axis].steps)
            };
            let before = steps(&machine);
            let words = words.replace('@', letter(first)).replace('#', letter(second));
            set(&mut machine, &mut host, &format!("{plane} {words} {offset}-2"));
            machine.run_for_ms(3_000).unwrap();
            let after = steps(&machine);
            let went = [after[0] - before[0], after[1] - before[1]];
            let wanted = [first_mm * MM, second_mm * MM];
            // Chords are 10 um off at the turning points at most, on the way there and back.
            let near = |(went, wanted): (&u64, &u64)| went.abs_diff(*wanted) <= wanted / 50;
            assert!(went.iter().zip(&wanted).all(near), "{plane} {words}: {went:?} not {wanted:?}");
        }
    }
}

/// The acceleration limit of axes, mm/s^2.
const ACCEL: f64 = 500.0;
/// The share of all windows in which the acceleration is no greater than the result.
const PERCENTILE: f64 = 0.99;

/// A chain of arcs of 0.2 to 30 mm radius, left and right in turns, and a helix.
fn garland() -> String {
    let mut job = "g21 g90 g17 g64 f6000\n".to_string();
    let mut x = 0.0;
    for n in 0..34u32 {
        let radius = 0.2 * 150f64.powf(f64::from(n) / 33.0);
        x += 2.0 * radius;
        writeln!(job, "g{} x{x:.4} i{radius:.4}", 2 + n % 2).unwrap();
    }
    job + "g3 z-2 i-6 p3\n"
}

/// Returns the percentile of the accelerations of X and Y in windows, mm/s^2, and the time that the job takes, s.
fn acceleration(job: &str, settings: &[String]) -> (f64, f64) {
    let mut machine = firmware(&MEGA2560_GRBL);
    machine.recorder_mut().keep_log();
    let options = Options { settings: settings.to_vec(), ..Options::default() };
    let report = job::run(&mut machine, &job::lines_of(job), &options, |_| {}).unwrap();
    assert!(report.ok, "{:?}", report.problems);
    let positions = track::positions(&track::steps(&machine), &report.setup);
    let windows = Windows::new(SAMPLE_S, WINDOW_S);
    let of = |axis: usize| kinetics::curves(&positions, axis, &windows).acceleration;
    let mut all: Vec<f64> = (0..2).flat_map(of).map(f64::abs).collect();
    all.sort_by(f64::total_cmp);
    (all[(all.len() as f64 * PERCENTILE) as usize], report.seconds_moving)
}

/// 80 steps a mm, and these limits for X, Y and Z.
fn settings(jerk: u32, tolerance: f64) -> Vec<String> {
    let motors = (1..=3).map(|motor| format!("{{{motor}:{{tr:20,mi:8}}}}"));
    let axes = ["x", "y", "z"]
        .into_iter()
        .map(|axis| format!("{{{axis}:{{vm:30000,fr:30000,ac:{ACCEL},jd:0.01,jm:{jerk}}}}}"));
    let rest = ["{ja:1800000}".to_string(), format!("{{ct:{tolerance}}}")];
    motors.chain(axes).chain(rest).collect()
}

#[test]
fn arcs_keep_the_acceleration_of_their_axes() {
    for (jerk, tolerance) in [(1_000_000, 0.002), (5_000, 0.002), (1_000_000, 0.01), (5_000, 0.01)]
    {
        let (got, seconds) = acceleration(&garland(), &settings(jerk, tolerance));
        let all = format!("jm {jerk}, ct {tolerance}: {got:.0} mm/s^2, {seconds:.1} s");
        println!("{all}");
        assert!(got <= 1.1 * ACCEL, "{all}");
    }
}
