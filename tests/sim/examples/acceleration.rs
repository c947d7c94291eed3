//! Measures the acceleration of X and Y in a job, from their steps: percentiles, and the places with the highest
//! values: `cargo run -p kerf-sim --example acceleration -- ELF BOARD JOB STEPS_PER_MM WINDOW_MS LEAST [SETTING...]`.
//! Only places that are passed at LEAST mm/s or more count.

use std::path::Path;

use anyhow::{Context, Result};
use kerf_sim::Machine;
use kerf_sim::job::{self, Options};

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let elf = args.next().context("which ELF?")?;
    let board = args.next().context("which board?")?;
    let path = args.next().context("which job?")?;
    let per_mm: f64 = args.next().context("how many steps for a mm?")?.parse()?;
    let window: f64 = args.next().context("which window, ms?")?.parse::<f64>()? * 1e-3;
    let least: f64 = args.next().context("from which velocity on, mm/s?")?.parse()?;
    let board = kerf::boards::by_name(&board).context("no such board")?;
    let mut machine = Machine::load(Path::new(&elf), board)?;
    machine.recorder_mut().keep_log();
    let lines = job::read_lines(Path::new(&path))?;
    let options = Options::with_settings(args);
    let report = job::run(&mut machine, &lines, &options, |_| {})?;
    println!("{:.3} s, {}", report.seconds_moving, if report.ok { "OK" } else { "FAILED" });
    let clock = f64::from(machine.board().clock_hz);
    let tracks = [0u8, 1].map(|motor| {
        let mut place = 0.0;
        let log = machine.recorder().log().iter().filter(|s| s.motor == motor);
        let steps = log.map(|s| {
            place += if s.positive { 1.0 } else { -1.0 };
            let middle = place - if s.positive { 0.5 } else { -0.5 };
            (s.cycle as f64 / clock, middle / per_mm)
        });
        steps.collect::<Vec<(f64, f64)>>()
    });
    let at = |motor: usize, t: f64| {
        let steps = &tracks[motor];
        let next = steps.partition_point(|(s, _)| *s < t).clamp(1, steps.len() - 1);
        let ((a, x), (b, y)) = (steps[next - 1], steps[next]);
        x + (y - x) * ((t - a) / (b - a)).clamp(0.0, 1.0)
    };
    let from = tracks.iter().filter_map(|t| t.first()).map(|s| s.0).fold(f64::MAX, f64::min);
    let to = tracks.iter().filter_map(|t| t.last()).map(|s| s.0).fold(0.0, f64::max);
    let mut all = Vec::new();
    let mut t = from + window;
    while t < to - window {
        let p = [t - window, t, t + window].map(|t| [at(0, t), at(1, t)]);
        let a = [0, 1].map(|i| (p[0][i] - 2.0 * p[1][i] + p[2][i]) / (window * window));
        let v = [0, 1].map(|i| (p[2][i] - p[0][i]) / (2.0 * window));
        let speed = v[0].hypot(v[1]);
        let across = (a[0] * v[1] - a[1] * v[0]).abs() / speed.max(1e-9);
        if speed < least {
            t += window / 4.0;
            continue;
        }
        all.push((a[0].abs().max(a[1].abs()), across, t - from, p[1], speed));
        t += window / 4.0;
    }
    for (what, key) in [("axis", 0), ("across", 1)] {
        let value = |s: &(f64, f64, f64, [f64; 2], f64)| if key == 0 { s.0 } else { s.1 };
        all.sort_by(|a, b| value(a).total_cmp(&value(b)));
        let n = all.len();
        for share in [0.5, 0.9, 0.99, 0.999] {
            print!("{what} {share}: {:.0}  ", value(&all[(n as f64 * share) as usize]));
        }
        println!("most {:.0}", value(&all[n - 1]));
        for s in all[n.saturating_sub(6)..].iter().rev() {
            println!(
                "  {:.0} at {:.3} s, {:.3} {:.3} mm, {:.1} mm/s",
                value(s),
                s.2,
                s.3[0],
                s.3[1],
                s.4
            );
        }
    }
    Ok(())
}
