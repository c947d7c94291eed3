//! Behaviour beyond the limit: one motor is commanded at twice the target rate.

use anyhow::Result;
use serde_json::Value;

use super::Figure;
use super::rates::{long_move, mean_rate};
use super::workload::{Bed, How, PER_MM};
use crate::host::{Host, LINES_IN_FLIGHT};
use crate::machine::Machine;

/// The commanded step rate, steps/s.
const ASKED: f64 = 200_000.0;
/// Time allowed for the move, s: enough for a rate well below [`ASKED`].
const PATIENCE_S: f64 = 120.0;

/// Counts how many of three facts hold: the end is exact, the rate is clamped, the sender is told of it.
pub fn twice(bed: &Bed) -> Result<Figure> {
    let mut machine = bed.machine()?;
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut machine, 1_000)?;
    let told = |value: &Value| ["er", "msg"].iter().any(|key| value.get(key).is_some());
    // The firmware may warn when the limits are set too high, or only when the move comes.
    let mut warned = false;
    for line in bed.settings(How::default()) {
        warned |= told(&host.ask(&mut machine, &line, 1_000)?.body);
    }
    machine.recorder_mut().keep_log();
    host.take_reports();
    let job = long_move(1, ASKED);
    let response = host.ask(&mut machine, job.trim(), 5_000)?;
    let wanted = rest(&mut machine, &mut host, &job)?;
    let rate = mean_rate(&machine, 0);
    let position = machine.recorder().motors()[0].position;
    let facts = [
        ("exact", position == wanted && machine.missed_tops() == 0),
        ("clamped", rate > 0.0 && rate < ASKED / 1.5),
        (
            "told",
            warned
                || response.status != 0
                || told(&response.body)
                || host.take_reports().iter().any(told),
        ),
    ];
    let said = facts.map(|(what, so)| if so { what.to_string() } else { format!("not {what}") });
    let value = facts.iter().filter(|(_, so)| *so).count() as f64;
    Ok(Figure { value, note: format!("{}; runs at {rate:.0}", said.join(", ")) })
}

/// Runs until no step has come for a while; returns where the motor should be.
fn rest(machine: &mut Machine, host: &mut Host, job: &str) -> Result<i64> {
    let end = machine.cycle() + (PATIENCE_S * f64::from(machine.board().clock_hz)) as u64;
    let mut before = u64::MAX;
    while machine.recorder().steps() != before && machine.cycle() < end {
        before = machine.recorder().steps();
        host.run_for_ms(machine, 500)?;
    }
    let mm = job.split_whitespace().find_map(|word| word.strip_prefix('X')?.parse::<f64>().ok());
    Ok((mm.unwrap_or(0.0) * PER_MM).round() as i64)
}
