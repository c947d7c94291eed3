//! Step jitter at cruise, when X makes 20,000 steps/s and Y 7,400 in one move, and of slow lines in a row.

use std::fmt::Write;

use anyhow::Result;

use super::Figure;
use super::workload::{Bed, How, PER_MM, chatter};
use crate::machine::Machine;

/// Steps a second of the dominant motor and of the minor one.
const DOMINANT: f64 = 20_000.0;
const MINOR: f64 = 7_400.0;
/// Length of the move along X, mm: about 2 s of cruise.
const WAY: f64 = 650.0;
/// Length of one block in a row of blocks, mm.
const BLOCK: f64 = 5.0;
/// The middle part of the move that counts, s. All of it is cruise.
const COUNTED_S: f64 = 1.0;
/// Steps a second of slow lines, at which there is more than one tick a step.
const SLOW: f64 = 2_900.0;
/// Length of a slow line in the mean, mm. Lines differ by up to half of it, so that they end at all parts of a step.
const SLOW_BLOCK: f64 = 0.8007;
/// Number of slow lines: more than a second of cruise.
const SLOW_LINES: u32 = 100;
/// Number of lines behind the move, which take longer to send than the move lasts.
const LINES: u32 = 3_000;

/// Peak-to-peak jitter of the dominant motor's step interval, cycles, while the serial line is quiet.
pub fn quiet(bed: &Bed) -> Result<Figure> {
    let machine = run(bed, 0)?;
    Ok(in_cycles(&machine, peak_to_peak(&machine, 0)))
}

/// Peak-to-peak jitter of the dominant motor's step interval, cycles, while lines stream in and answers stream out.
pub fn busy(bed: &Bed) -> Result<Figure> {
    let machine = run(bed, LINES)?;
    Ok(in_cycles(&machine, peak_to_peak(&machine, 0)))
}

/// Peak-to-peak jitter of the minor motor's step interval, us, while lines stream in.
pub fn minor(bed: &Bed) -> Result<Figure> {
    let machine = run(bed, LINES)?;
    Ok((machine.seconds(peak_to_peak(&machine, 1)) * 1e6).into())
}

/// Jitter across the ends of blocks: lines of 5 mm in a row, of X alone and with Y, while the serial line is quiet.
pub fn boundaries(bed: &Bed) -> Result<Figure> {
    let (mut worst, mut note) = (0, Vec::new());
    for (name, minor) in [("alone", 0.0), ("with Y", MINOR / DOMINANT)] {
        let mut job = format!("G1 F{:.3}\n", DOMINANT / PER_MM * 60.0 * 1f64.hypot(minor));
        for n in 1..=(WAY / BLOCK) as u32 {
            let x = f64::from(n) * BLOCK;
            let _ = writeln!(job, "G1X{x:.2}Y{:.4}", x * minor);
        }
        let machine = bed.run(&job, How { log: true, ..How::default() })?.0;
        let cycles = peak_to_peak(&machine, 0);
        note.push(format!("{name} {cycles}"));
        worst = worst.max(cycles);
    }
    Ok(Figure { value: worst as f64, note: note.join(", ") })
}

/// Jitter across the ends of slow lines of X, which are not merged.
pub fn slow_boundaries(bed: &Bed) -> Result<Figure> {
    let mut job = format!("G61\nG1 F{:.3}\n", SLOW / PER_MM * 60.0);
    for n in 1..=SLOW_LINES {
        let x = f64::from(n) + 0.5 * (f64::from(n) * 0.618_034).fract();
        let _ = writeln!(job, "G1X{:.4}", x * SLOW_BLOCK);
    }
    let machine = bed.run(&job, How { log: true, ..How::default() })?.0;
    Ok(in_cycles(&machine, peak_to_peak(&machine, 0)))
}

fn in_cycles(machine: &Machine, cycles: u64) -> Figure {
    Figure { value: cycles as f64, note: format!("{:.2} us", machine.seconds(cycles) * 1e6) }
}

/// Runs the move with this many lines behind it, and returns the machine.
pub fn run(bed: &Bed, lines: u32) -> Result<Machine> {
    let y = WAY * MINOR / DOMINANT;
    let feed = DOMINANT / PER_MM * 60.0 * WAY.hypot(y) / WAY;
    let job = format!("G1 X{WAY} Y{y} F{feed:.3}\n{}", chatter(lines));
    Ok(bed.run(&job, How { log: true, ..How::default() })?.0)
}

/// Returns the longest step interval minus the shortest in the middle of the move.
fn peak_to_peak(machine: &Machine, motor: u8) -> u64 {
    let steps = machine.recorder().steps_of(motor);
    let half = (COUNTED_S / 2.0 * f64::from(machine.board().clock_hz)) as u64;
    let middle = steps.first().zip(steps.last()).map_or(0, |(a, b)| a.midpoint(*b));
    let cruise: Vec<u64> = steps.into_iter().filter(|s| s.abs_diff(middle) <= half).collect();
    let gaps = cruise.windows(2).map(|w| w[1] - w[0]);
    let (least, most) = gaps.fold((u64::MAX, 0), |(l, m), g| (l.min(g), m.max(g)));
    most.saturating_sub(least)
}
