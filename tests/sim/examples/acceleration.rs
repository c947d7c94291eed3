//! Measures the acceleration and the jerk of the axes in a job, from their steps: the greatest of each over its limit,
//! percentiles, and the places with the highest accelerations:
//! `cargo run -p kerf-sim --example acceleration -- ELF BOARD JOB WINDOW_MS [SETTING...]`.

use std::path::Path;

use anyhow::{Context, Result};
use kerf_sim::Machine;
use kerf_sim::job::{self, Options};
use kerf_sim::kinetics::{self, Windows};
use kerf_sim::limits;
use kerf_sim::track::{self, SAMPLE_S};

const NAMES: [char; 6] = ['X', 'Y', 'Z', 'A', 'B', 'C'];
/// Places that are printed of each axis.
const PLACES: usize = 6;

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let elf = args.next().context("which ELF?")?;
    let board = args.next().context("which board?")?;
    let path = args.next().context("which job?")?;
    let window: f64 = args.next().context("which window, ms?")?.parse::<f64>()? * 1e-3;
    let board = kerf::boards::by_name(&board).context("no such board")?;
    let mut machine = Machine::load(Path::new(&elf), board)?;
    machine.recorder_mut().keep_log();
    let lines = job::read_lines(Path::new(&path))?;
    let report = job::run(&mut machine, &lines, &Options::with_settings(args), |_| {})?;
    println!("{:.3} s, {}", report.seconds_moving, if report.ok { "OK" } else { "FAILED" });
    let positions = track::positions(&track::steps(&machine), &report.setup);
    let limits = limits::of(&mut machine, &report.setup);
    let greatest = kinetics::greatest(&positions, &report.setup, &limits);
    for (what, of) in ["acceleration", "jerk"].iter().zip(greatest) {
        let axis = NAMES[of.axis];
        println!(
            "{what} over its limit: {:.2} ({:.2} with the error of steps) of {axis} at {:.3} s",
            of.over, of.raw, of.seconds
        );
    }
    let windows = Windows::new(SAMPLE_S, window);
    for axis in (0..NAMES.len()).filter(|axis| kinetics::moves(&positions, *axis)) {
        let curves = kinetics::curves(&positions, axis, &windows);
        let mut order: Vec<usize> = (0..positions.len()).collect();
        order.sort_by(|a, b| {
            curves.acceleration[*a].abs().total_cmp(&curves.acceleration[*b].abs())
        });
        print!("{}: ", NAMES[axis]);
        for share in [0.5, 0.9, 0.99, 0.999] {
            let at = order[(order.len() as f64 * share) as usize];
            print!("{share} {:.0}  ", curves.acceleration[at].abs());
        }
        println!("mm/s2");
        for at in order.iter().rev().take(PLACES) {
            let [x, y, z, ..] = positions[*at];
            println!(
                "  {:.0} at {:.3} s, {x:.3} {y:.3} {z:.3} mm, {:.1} mm/s",
                curves.acceleration[*at],
                *at as f64 * SAMPLE_S,
                curves.velocity[*at]
            );
        }
    }
    Ok(())
}
