//! CPU time of parts of the firmware.

use anyhow::{Result, ensure};

use super::Figure;
use super::jitter;
use super::spirals::{self, lines_per_second, spiral};
use super::workload::{Bed, FAST_BAUD, How, LOW_JERK, NO_LIMIT, USUAL_JERK, arcs, braid, straight};
use crate::machine::Machine;
use crate::report::Report;
use crate::stopwatch::{Cost, Stopwatch};

/// USART2_UDRE: the vector of the software interrupt that exec runs in.
const EXEC_VECTOR: u8 = 52;
/// Called once for each segment that exec has prepared.
const SEGMENT_READY: &str = "kerf::hal::imp::stepper::go";
/// Queues a block, and updates the speed constraints.
const QUEUE_PUSH: &str = "<kerf::motion::queue::BlockQueue>::push_line";

/// The short moves: their number, their length (mm) and their feed (mm/min). At that feed motion uses up 4,000 moves
/// a second.
const SHORT: (u32, f64, f64) = (3_000, 0.05, 12_000.0);
/// Short moves that the firmware accepts in a second on a fast line.
pub fn lines(bed: &Bed) -> Result<Figure> {
    let how = How { baud: FAST_BAUD, acceleration: NO_LIMIT, ..How::default() };
    let (_, report) = bed.run(&short_moves(), how)?;
    Ok(lines_per_second(&report).into())
}

/// Short moves that the firmware accepts in a second on a fast line, in grbl's dialect.
pub fn lines_grbl(bed: &Bed) -> Result<Figure> {
    let how = How { baud: FAST_BAUD, acceleration: NO_LIMIT, ..How::default() };
    spirals::lines_grbl(bed, &short_moves(), how)
}

/// Short moves that the firmware accepts in a second on a fast line, under a jerk limit.
pub fn lines_jerk(bed: &Bed) -> Result<Figure> {
    let how =
        How { baud: FAST_BAUD, acceleration: NO_LIMIT, jerk: Some(USUAL_JERK), ..How::default() };
    let (_, report) = bed.run(&short_moves(), how)?;
    Ok(lines_per_second(&report).into())
}

/// The longest time in which no tick is served outside the step interrupt, cycles.
pub fn interrupts_off(bed: &Bed) -> Result<Figure> {
    let machines = [jitter::run(bed, 1_000)?, spiral_on_fast_line(bed, Vec::new())?.0];
    let windows = machines.iter().map(|m| (m.meters().window_outside(), m));
    let worst = windows.max_by_key(|(window, _)| window.cycles);
    Ok(worst.map_or(0.0.into(), |(window, machine)| Figure {
        value: window.cycles as f64,
        note: machine.describe(&window),
    }))
}

/// Cycles that exec takes for one segment, with all work on new blocks that falls into it.
pub fn segment(bed: &Bed) -> Result<Figure> {
    let laps = bed.laps(EXEC_VECTOR, SEGMENT_READY)?;
    let (machine, _) = spiral_on_fast_line(bed, vec![laps])?;
    let cost = machine.stopwatches()[0].cost();
    let note = format!("worst {}, {} segments", cost.max, cost.count);
    Ok(Figure { value: cost.mean(), note })
}

/// Cycles that exec takes for one segment under a jerk limit, on short moves and on arcs.
pub fn segment_jerk(bed: &Bed) -> Result<Figure> {
    let jobs = [spiral(0.1), arcs(), braid(0.33, 3_000.0)];
    let costs = jerk_costs(bed, &[USUAL_JERK], &jobs)?;
    let cycles = costs.iter().map(|c| c.mean() * c.count as f64).sum::<f64>();
    let count = costs.iter().map(|c| c.count).sum::<u64>();
    Ok(Figure { value: cycles / count as f64, note: format!("{count} segments") })
}

/// The longest time that exec takes for a segment under any of three jerk limits, cycles.
pub fn segment_jerk_worst(bed: &Bed) -> Result<Figure> {
    let jobs = [arcs(), braid(0.33, 3_000.0)];
    let costs = jerk_costs(bed, &[500.0, USUAL_JERK, 50_000.0], &jobs)?;
    let count = costs.iter().map(|c| c.count).sum::<u64>();
    let worst = costs.iter().map(|c| c.max).max().unwrap_or(0);
    Ok(Figure { value: worst as f64, note: format!("{count} segments") })
}

/// Measures what exec takes for the segments of each job under each jerk limit.
fn jerk_costs(bed: &Bed, jerks: &[f64], jobs: &[String]) -> Result<Vec<Cost>> {
    let runs = jerks.iter().flat_map(|jerk| jobs.iter().map(move |job| (jerk, job)));
    runs.map(|(jerk, job)| {
        let how = How { baud: FAST_BAUD, jerk: Some(*jerk), ..How::default() };
        let laps = bed.laps(EXEC_VECTOR, SEGMENT_READY)?;
        let (machine, report) = bed.try_run(job, how, vec![laps])?;
        ensure!(report.rejected.is_empty(), "{}", report.problems.join("; "));
        Ok(machine.stopwatches()[0].cost())
    })
    .collect()
}

/// Cycles of queuing a block, at worst: with the update of the speed constraints.
pub fn replan(bed: &Bed) -> Result<Figure> {
    let (curve, _) = spiral_on_fast_line(bed, vec![bed.calls(QUEUE_PUSH)?])?;
    // With a low jerk limit the whole queue is needed to stop, the worst case of a firmware that replans its queue.
    let how = How { baud: FAST_BAUD, jerk: Some(LOW_JERK), ..How::default() };
    let (line, _) =
        bed.try_run(&straight(1_000, 0.1, 6_000.0), how, vec![bed.calls(QUEUE_PUSH)?])?;
    let costs = [&curve, &line].map(|machine| machine.stopwatches()[0].cost());
    let worst = costs[0].max.max(costs[1].max);
    let mean = costs[0].mean().max(costs[1].mean());
    Ok(Figure { value: worst as f64, note: format!("mean {mean:.0}") })
}

fn short_moves() -> String {
    let (count, mm, feed) = SHORT;
    straight(count, mm, feed)
}

fn spiral_on_fast_line(bed: &Bed, stopwatches: Vec<Stopwatch>) -> Result<(Machine, Report)> {
    bed.try_run(&spiral(0.1), How { baud: FAST_BAUD, ..How::default() }, stopwatches)
}
