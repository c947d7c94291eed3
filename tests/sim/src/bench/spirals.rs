//! Jobs of 2,000 short moves along a spiral at 6,000 mm/min: the time from the first step to the last, over the
//! ideal. The ideal is unlimited look-ahead with trapezoids: path length / v + v / a.

use std::collections::VecDeque;
use std::fmt::Write;

use anyhow::{Result, ensure};

use super::Figure;
use super::workload::{ACCELERATION, Bed, FAST_BAUD, How, NO_LIMIT, USUAL_JERK};
use crate::host::{Host, LINES_IN_FLIGHT};
use crate::machine::{AUX, Machine};
use crate::report::Report;

const MOVES: u32 = 2_000;
/// Feed, mm/min.
const FEED: f64 = 6_000.0;
/// The feed of [`curve`], mm/min. At that feed motion uses up 910 moves a second.
const CURVE_FEED: f64 = 18_000.0;
/// Radius at which the spiral begins, mm: wide enough that no corner limits the feed.
const RADIUS: f64 = 30.0;
/// Radial distance between two turns, mm.
const PITCH: f64 = 1.0;

/// Characters that a sender for grbl keeps in flight. Most senders use this number.
const GRBL_BYTES: usize = 128;
/// The job has ended when no step has come for this long, ms.
const GRBL_REST_MS: u64 = 500;
/// Time after which the settings are in EEPROM, ms.
const KEEPS_MS: u64 = 4_000;

/// Moves of 0.1 mm at the usual speed of the line.
pub fn tenth(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.1, How::default())
}

/// Moves of 0.1 mm at the usual speed of the line, in grbl's dialect, sent by a sender that counts characters.
pub fn tenth_grbl(bed: &Bed) -> Result<Figure> {
    let mut machine = grbl_machine(bed, How { more: &["{dia:3}"], ..How::default() })?;
    let sent = send_grbl(&mut machine, &spiral(0.1))?;
    let lines = f64::from(MOVES) / sent.moves;
    Ok(Figure { value: sent.moves / ideal(0.1), note: format!("{lines:.0} lines/s") })
}

/// Lines of a job that the firmware accepts in a second, in grbl's dialect on a fast line.
pub fn lines_grbl(bed: &Bed, job: &str, how: How) -> Result<Figure> {
    let baud = how.baud;
    let mut machine = grbl_machine(bed, how)?;
    // The `{baud}` setting is sent in TinyG's dialect over the other port. It sets the rate of this port.
    machine.send_to(AUX, format!("{{baud:{baud}}}\n").as_bytes());
    machine.run_for_ms(100)?;
    machine.set_baud(baud);
    machine.send(b"$I\n");
    machine.run_for_ms(100)?;
    let build = String::from_utf8_lossy(&machine.receive()).into_owned();
    ensure!(build.ends_with("ok\r\n"), "it answers {build}");
    let sent = send_grbl(&mut machine, job)?;
    Ok((job.lines().count() as f64 / sent.answers).into())
}

/// How long the answers to a job take and how long its steps take, s.
struct Sent {
    answers: f64,
    moves: f64,
}

/// Sends a job as a sender that counts characters.
fn send_grbl(machine: &mut Machine, job: &str) -> Result<Sent> {
    let (count, mut lines, mut flying) = (job.lines().count(), job.lines(), VecDeque::new());
    let (mut answered, mut tail) = (0, String::new());
    let mut next = lines.next();
    let (begun, mut ended) = (machine.cycle(), 0);
    let (mut first, mut last, mut steps) = (None, 0, 0);
    while answered < count || machine.cycle() < last + machine.cycles(GRBL_REST_MS) {
        while let Some(line) = next
            && flying.iter().sum::<usize>() + line.len() < GRBL_BYTES
        {
            machine.send(format!("{line}\n").as_bytes());
            flying.push_back(line.len() + 1);
            next = lines.next();
        }
        machine.run_for_ms(1)?;
        tail += &String::from_utf8_lossy(&machine.receive());
        while let Some((line, rest)) = tail.split_once("\r\n") {
            ensure!(line == "ok", "answered {line}");
            (tail, answered, ended) = (rest.to_string(), answered + 1, machine.cycle());
            flying.pop_front();
        }
        let made: u64 = machine.recorder().motors().iter().map(|motor| motor.steps).sum();
        if made != steps {
            first = first.or(Some(machine.cycle()));
            (steps, last) = (made, machine.cycle());
        }
        ensure!(machine.seconds(machine.cycle()) < 60.0, "no end: {answered} lines are answered");
    }
    Ok(Sent {
        answers: machine.seconds(ended - begun),
        moves: machine.seconds(last - first.unwrap_or(last)),
    })
}

/// Returns a machine with the usual settings that speaks grbl's dialect and has greeted.
fn grbl_machine(bed: &Bed, how: How) -> Result<Machine> {
    let mut machine = bed.machine()?;
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut machine, 1_000)?;
    for line in bed.settings(how) {
        host.ask(&mut machine, &line, 1_000)?;
    }
    host.run_for_ms(&mut machine, KEEPS_MS)?;
    let mut fresh = bed.machine()?;
    fresh.set_eeprom(machine.eeprom());
    fresh.run_for_ms(500)?;
    let greeting = String::from_utf8_lossy(&fresh.receive()).into_owned();
    ensure!(greeting.contains("Grbl 1.1h"), "it greets by {greeting}");
    Ok(fresh)
}

/// Moves of 0.2 mm.
pub fn fifth(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.2, How::default())
}

/// Moves of 0.5 mm.
pub fn half(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.5, How::default())
}

/// Moves of 0.1 mm on a fast line.
pub fn tenth_fast(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.1, fast())
}

/// Moves of 0.2 mm on a fast line.
pub fn fifth_fast(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.2, fast())
}

/// Moves of 0.5 mm on a fast line.
pub fn half_fast(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.5, fast())
}

/// Moves of 0.1 mm at the usual speed of the line, answers without the marks of strict JSON.
pub fn tenth_terse(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.1, How { more: &["{js:0}"], ..How::default() })
}

/// Moves of 0.1 mm under a jerk limit, on a fast line. The ideal is the time without the limit.
pub fn tenth_smooth(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.1, How { jerk: Some(USUAL_JERK), ..fast() })
}

/// Moves made in a second on [`curve`].
pub fn curve_lines(bed: &Bed) -> Result<Figure> {
    let how = How { acceleration: NO_LIMIT, ..fast() };
    let (_, report) = bed.run(&curve(), how)?;
    Ok(lines_per_second(&report).into())
}

/// Look-ahead of the queue in moves of 0.1 mm, mm: counts the moves that are answered while a slow move before them
/// runs.
pub fn look_ahead(bed: &Bed) -> Result<Figure> {
    let mut machine = bed.machine()?;
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut machine, 1_000)?;
    for line in bed.settings(How::default()) {
        host.ask(&mut machine, &line, 1_000)?;
    }
    host.ask(&mut machine, "G1 F1 X-1", 1_000)?;
    let job = spiral(0.1);
    job.lines().enumerate().for_each(|(n, line)| host.queue(n, line));
    host.run_for_ms(&mut machine, 3_000)?;
    // The first answer belongs to the line that sets the feed.
    let moves = host.take_answered().len().saturating_sub(1);
    Ok(Figure { value: 0.1 * moves as f64, note: format!("{moves} moves") })
}

/// Cycles that the CPU is awake for each move of 0.1 mm on a fast line, from the first step to the last.
pub fn cycles_per_line(bed: &Bed) -> Result<Figure> {
    let (machine, report) = bed.run(&spiral(0.1), fast())?;
    let awake = report.cpu_load.unwrap_or(1.0);
    let hz = f64::from(machine.board().clock_hz);
    let value = awake * report.seconds_moving * hz / f64::from(MOVES);
    Ok(Figure { value, note: format!("awake {:.0} %", 100.0 * awake) })
}

/// Time of moves of 0.1 mm under a jerk limit, over the time without the limit.
pub fn tenth_jerk(bed: &Bed) -> Result<Figure> {
    over_no_jerk_limit(bed, 0.1)
}

/// Time of moves of 0.2 mm under a jerk limit, over the time without the limit.
pub fn fifth_jerk(bed: &Bed) -> Result<Figure> {
    over_no_jerk_limit(bed, 0.2)
}

/// Time of moves of 0.5 mm under a jerk limit, over the time without the limit.
pub fn half_jerk(bed: &Bed) -> Result<Figure> {
    over_no_jerk_limit(bed, 0.5)
}

fn over_no_jerk_limit(bed: &Bed, chord: f64) -> Result<Figure> {
    let job = spiral(chord);
    let (_, without) = bed.run(&job, fast())?;
    let (_, with) = bed.try_run(&job, How { jerk: Some(USUAL_JERK), ..fast() }, Vec::new())?;
    let value = with.seconds_moving / without.seconds_moving;
    ensure!(with.ok, "{value:.3}, but {}", with.problems.join("; "));
    Ok(Figure { value, note: format!("{:.0} lines/s", lines_per_second(&with)) })
}

fn fast() -> How {
    How { baud: FAST_BAUD, ..How::default() }
}

fn over_ideal(bed: &Bed, chord: f64, how: How) -> Result<Figure> {
    let (_, report) = bed.run(&spiral(chord), how)?;
    let value = report.seconds_moving / ideal(chord);
    Ok(Figure { value, note: format!("{:.0} lines/s", lines_per_second(&report)) })
}

/// The shortest time that the job can take, s.
pub fn ideal(chord: f64) -> f64 {
    let velocity = FEED / 60.0;
    f64::from(MOVES) * chord / velocity + velocity / ACCELERATION
}

/// Lines that are answered in a second.
pub fn lines_per_second(report: &Report) -> f64 {
    report.acknowledged as f64 / report.seconds_to_answer
}

/// The spiral at the usual feed. It begins where the machine stands, at 0.
pub fn spiral(chord: f64) -> String {
    spiral_at(chord, FEED)
}

/// Moves of 0.33 mm along a curve, faster than the CPU can plan them. No two moves lie on one line.
pub fn curve() -> String {
    spiral_at(0.33, CURVE_FEED)
}

/// The spiral at another feed, mm/min.
fn spiral_at(chord: f64, feed: f64) -> String {
    let mut job = format!("G1 F{feed}\n");
    let mut angle = 0.0f64;
    let mut at = (0.0, 0.0);
    for _ in 0..MOVES {
        angle += step(angle, at, chord);
        at = point(angle);
        let _ = writeln!(job, "G1X{:.3}Y{:.3}", at.0, at.1);
    }
    job
}

/// Finds, by bisection, the angle that is one chord further along the spiral.
fn step(angle: f64, from: (f64, f64), chord: f64) -> f64 {
    let (mut low, mut high) = (0.0, 2.0 * chord / RADIUS);
    for _ in 0..40 {
        let middle = f64::midpoint(low, high);
        let to = point(angle + middle);
        let short = (to.0 - from.0).hypot(to.1 - from.1) < chord;
        *(if short { &mut low } else { &mut high }) = middle;
    }
    low
}

fn point(angle: f64) -> (f64, f64) {
    let radius = RADIUS + PITCH * angle / std::f64::consts::TAU;
    (radius * angle.cos() - RADIUS, radius * angle.sin())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_move_is_a_chord() {
        for chord in [0.1, 0.5] {
            let (mut at, mut count) = ((0.0, 0.0), 0);
            for line in spiral(chord).lines().skip(1) {
                let (x, y) = line.strip_prefix("G1X").and_then(|l| l.split_once('Y')).unwrap();
                let to: (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
                let length = (to.0 - at.0).hypot(to.1 - at.1);
                assert!((length - chord).abs() < 2e-3, "{length}");
                (at, count) = (to, count + 1);
            }
            assert_eq!(count, MOVES);
        }
    }
}
