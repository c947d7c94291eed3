//! What a printer does: moves of 0.2 mm along a spiral that climbs, with X, Y, Z and the extruder, at 3,600 mm/min
//! under a jerk limit, in the dialect of printing hosts on the board `ramps14`. The figure is the time from the first
//! step to the last, over the ideal of unlimited look-ahead with trapezoids.

use std::collections::VecDeque;
use std::fmt::Write;

use anyhow::{Result, ensure};
use kerf::boards::RAMPS14;

use super::Figure;
use super::spirals::spiral;
use super::workload::{ACCELERATION, Bed, How, USUAL_JERK};
use crate::by_name;
use crate::machine::Machine;

/// Feed, mm/min.
const FEED: f64 = 3_600.0;
const CHORD: f64 = 0.2;
/// Lines that are sent and not yet answered, at most.
const WINDOW: usize = 4;
/// The job has ended when no step has come for this long, ms.
const REST_MS: u64 = 500;

/// Moves of 0.2 mm of a printing host, without line numbers.
pub fn plain(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, false, &[])
}

/// Moves of 0.2 mm of a printing host, with pressure advance.
pub fn advanced(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, false, &["{he1pa:0.05}"])
}

/// Lines with their numbers and checksums, along X and Y.
pub fn numbered(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, true, &[])
}

fn over_ideal(bed: &Bed, numbered: bool, more: &'static [&'static str]) -> Result<Figure> {
    let bed = bed.beside(&RAMPS14)?;
    let how = How { jerk: Some(USUAL_JERK), more, ..How::default() };
    let mut machine = bed.machine()?;
    by_name::boot(&mut machine)?;
    for line in bed.settings(how) {
        by_name::set(&mut machine, &line)?;
    }
    let mut fresh = bed.machine()?;
    fresh.set_eeprom(machine.eeprom());
    fresh.run_for_ms(500)?;
    let greeting = String::from_utf8_lossy(&fresh.receive()).into_owned();
    ensure!(greeting.contains("start"), "it greets by {greeting}");
    let lines = job(numbered);
    let (moves, answers) = send(&mut fresh, &lines)?;
    let count = lines.len() as f64 - 3.0;
    let velocity = FEED / 60.0;
    let ideal = count * CHORD / velocity + velocity / ACCELERATION;
    let bytes = lines.iter().map(|line| line.len() + 1).sum::<usize>() as f64;
    let note = format!(
        "{:.0} lines/s; the wire alone {:.3}",
        lines.len() as f64 / answers,
        bytes / 11_520.0 / ideal
    );
    Ok(Figure { value: moves / ideal, note })
}

/// The spiral of the other rows, which also climbs and extrudes 0.0083 mm of filament in each move.
fn job(numbered: bool) -> Vec<String> {
    let mut lines: Vec<_> = ["M302 P1", "M83"].map(String::from).into();
    lines.push(format!("G1 F{FEED}"));
    for (n, line) in spiral(CHORD).lines().skip(1).enumerate() {
        let place = line.trim_start_matches("G1X").replace('Y', " Y");
        let climb = if numbered { String::new() } else { format!(" Z{:.3}", n as f64 / 1e4) };
        lines.push(format!("G1 X{place}{climb} E0.0083"));
    }
    if numbered {
        for (n, line) in lines.iter_mut().enumerate() {
            *line = format!("N{} {line}", n + 1);
            let sum = line.bytes().fold(0, |sum, byte| sum ^ byte);
            let _ = write!(line, "*{sum}");
        }
    }
    lines
}

/// Sends the job. Returns how long its steps take and how long its answers take, s.
fn send(machine: &mut Machine, lines: &[String]) -> Result<(f64, f64)> {
    let (mut next, mut flying, mut answered) = (0, VecDeque::new(), 0);
    let (begun, mut ended) = (machine.cycle(), 0);
    let (mut first, mut last, mut steps) = (None, 0, 0);
    let mut tail = String::new();
    while answered < lines.len() || machine.cycle() < last + machine.cycles(REST_MS) {
        while flying.len() < WINDOW && next < lines.len() {
            machine.send(format!("{}\n", lines[next]).as_bytes());
            flying.push_back(next);
            next += 1;
        }
        machine.run_for_ms(1)?;
        tail += &String::from_utf8_lossy(&machine.receive());
        while let Some((line, rest)) = tail.split_once('\n') {
            ensure!(line == "ok" || line.starts_with("echo:busy"), "answered {line}");
            if line == "ok" {
                (answered, ended) = (answered + 1, machine.cycle());
                flying.pop_front();
            }
            tail = rest.to_string();
        }
        let made: u64 = machine.recorder().motors().iter().map(|motor| motor.steps).sum();
        if made != steps {
            first = first.or(Some(machine.cycle()));
            (steps, last) = (made, machine.cycle());
        }
        ensure!(machine.seconds(machine.cycle()) < 90.0, "no end: {answered} lines are answered");
    }
    Ok((machine.seconds(last - first.unwrap_or(last)), machine.seconds(ended - begun)))
}
