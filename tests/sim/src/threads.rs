//! Checks the threads of a job: the position of Z at each index pulse of the spindle.
//!
//! The leads are read from the job's own lines (G33 and G32: K, G76: P), and everything else from the pins. A turn in
//! which Z moves by a lead, and X not at all, is a turn of a thread. The position of Z at the index pulse, modulo the
//! lead, is the *phase*. It must be equal in all turns of all passes. A compound slide (Q of G76) shifts a pass by its
//! depth, which is read from X. Lengths are in millimetres; a job in inches is not checked.

use serde::Serialize;

use crate::machine::Machine;
use crate::oracle::{MotorSetup, Setup, UNITS};
use crate::plot::{Position, SAMPLE_S, positions};

/// X and Z among the axes.
const X: usize = 0;
const Z: usize = 2;

/// Share of the lead by which the distance in a turn may differ from it, far more than the error allowed for a phase.
const ALIKE: f64 = 0.02;

/// The thread that a line commands.
#[derive(Clone, Copy, Debug)]
struct Asked {
    lead: f64,
    /// How much further Z begins for each mm that X is further out.
    slide: f64,
}

/// The threads that were cut.
#[derive(Clone, Serialize, Debug)]
pub struct Threads {
    /// Number of passes.
    pub passes: usize,
    /// Number of turns at a steady depth, in all passes.
    pub turns: usize,
    /// From the lowest phase to the highest.
    pub spread_mm: f64,
    /// Most spread that is allowed: a step, and one more with a compound slide.
    pub most_mm: f64,
    /// Errors over the length, for each pass: the position of Z, and its distance from where the spindle's angle puts
    /// it.
    #[serde(skip)]
    pub errors: Vec<Vec<(f64, f64)>>,
}

/// A turn of the spindle in which Z follows it.
struct Turn {
    /// Cycles of the index pulses at both ends of the turn.
    cycles: [u64; 2],
    /// Positions of Z at both ends of the turn.
    z: [f64; 2],
    phase: f64,
    lead: f64,
}

impl Threads {
    /// Evaluates the threads of a job. The recorder may have kept a log of its steps. `None` if the job has no
    /// threads.
    pub fn of(machine: &Machine, setup: &Setup, lines: &[(usize, String)]) -> Option<Threads> {
        let asked: Vec<Asked> = lines.iter().filter_map(|(_, line)| asked(line)).collect();
        let mechanics = machine.mechanics()?;
        if asked.is_empty() {
            return None;
        }
        let (x_motor, z_motor) = (motor_of(setup, X)?, motor_of(setup, Z)?);
        let [x_step, z_step] = [x_motor, z_motor].map(|motor| step_of(&setup.motors[motor]));
        let turns: Vec<Option<Turn>> = mechanics
            .indexed()
            .windows(2)
            .map(|pair| {
                let [x, z] = [(x_motor, x_step), (z_motor, z_step)]
                    .map(|(motor, step)| [0, 1].map(|end: usize| pair[end].1[motor] as f64 * step));
                let went = (z[1] - z[0]).abs();
                let of = asked.iter().find(|of| (went - of.lead).abs() < ALIKE * of.lead)?;
                let unslid = z[1] - of.slide * (z[1] - z[0]).signum() * x[1];
                let phase = unslid / of.lead - (unslid / of.lead).floor();
                let cycles = [pair[0].0, pair[1].0];
                (x[0] == x[1]).then_some(Turn { cycles, z, phase, lead: of.lead })
            })
            .collect();
        Some(Self::sum_up(machine, setup, &turns, z_step, asked.iter().any(|of| of.slide != 0.0)))
    }

    fn sum_up(
        machine: &Machine,
        setup: &Setup,
        turns: &[Option<Turn>],
        step: f64,
        slides: bool,
    ) -> Threads {
        let mean = turns.iter().flatten().next().map_or(0.0, |turn| turn.phase);
        // Difference from the first phase. Phases wrap from 1 to 0, so the difference is taken modulo 1.
        let off = |turn: &Turn| {
            let off = turn.phase - mean;
            (off - off.round()) * turn.lead
        };
        let (low, high) = turns
            .iter()
            .flatten()
            .map(off)
            .fold((0.0f64, 0.0f64), |(low, high), off| (low.min(off), high.max(off)));
        let passes: Vec<&[Option<Turn>]> =
            turns.split(Option::is_none).filter(|pass| !pass.is_empty()).collect();
        let samples = positions(machine, setup);
        let begin = machine.recorder().log().first().map_or(0, |step| step.cycle);
        let errors = passes
            .iter()
            .map(|pass| {
                pass.iter()
                    .flatten()
                    .flat_map(|turn| {
                        errors(turn, off(turn), &samples, |cycle| {
                            machine.seconds(cycle.saturating_sub(begin))
                        })
                    })
                    .collect()
            })
            .collect();
        Threads {
            passes: passes.len(),
            turns: turns.iter().flatten().count(),
            spread_mm: high - low,
            most_mm: if slides { 2.0 * step } else { step },
            errors,
        }
    }

    /// Returns what is wrong with the threads; `None` if nothing is.
    pub fn problem(&self) -> Option<String> {
        if self.turns == 0 {
            return Some("the job has threads, but Z never went by a lead in a turn".into());
        }
        let (is, most) = (self.spread_mm, self.most_mm);
        (is > most + 1e-9)
            .then(|| format!("threads are {is:.4} mm apart at the index, more than {most:.4}"))
    }
}

/// Returns the samples of a turn: the position of Z, and its error.
fn errors(
    turn: &Turn,
    off: f64,
    samples: &[Position],
    seconds: impl Fn(u64) -> f64,
) -> Vec<(f64, f64)> {
    let [from, to] = turn.cycles.map(&seconds);
    let [first, last] =
        [from, to].map(|time| ((time / SAMPLE_S).ceil() as usize).min(samples.len()));
    let way = turn.lead * (turn.z[1] - turn.z[0]).signum();
    (first..last)
        .map(|n| {
            let share = (n as f64 * SAMPLE_S - from) / (to - from);
            let z = samples[n][Z];
            // The end of the turn is `off` from its ideal place.
            let ideal = turn.z[1] - off - way * (1.0 - share);
            (z, z - ideal)
        })
        .collect()
}

/// Returns the lead and the slide of a line; `None` for a line without a thread.
fn asked(line: &str) -> Option<Asked> {
    let line = line.split(['(', ';']).next().unwrap_or_default().to_ascii_uppercase();
    let word = |letter: char| {
        let rest = line.split(letter).nth(1)?;
        let end = rest.find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c)));
        rest[..end.unwrap_or(rest.len())].parse::<f64>().ok()
    };
    let is = |code: &str| line.split_whitespace().any(|word| word == code);
    if is("G76") {
        let slide = word('Q').unwrap_or(0.0).to_radians().tan();
        // X grows with the depth of an inner thread.
        let slide = slide * word('I').unwrap_or(0.0).signum();
        return Some(Asked { lead: word('P')?, slide });
    }
    let lead = if is("G33") || is("G32") { word('K')? } else { return None };
    Some(Asked { lead, slide: 0.0 })
}

/// Returns the first motor of an axis.
fn motor_of(setup: &Setup, axis: usize) -> Option<usize> {
    setup.motors.iter().position(|motor| motor.axis == axis)
}

/// Returns the millimetres in a step.
fn step_of(motor: &MotorSetup) -> f64 {
    const FAR: i64 = 1_000_000;
    FAR as f64 / motor.steps(FAR * UNITS as i64) as f64
}

#[cfg(test)]
mod tests {
    use super::asked;

    #[test]
    fn leads_are_read_from_lines() {
        let lead = |line| asked(line).map(|of| of.lead);
        assert_eq!(lead("g33 z-5 k1.25"), Some(1.25));
        assert_eq!(lead("G76 P1.5 Z-12 I-1 J.2 K.8"), Some(1.5));
        assert_eq!(lead("G1 X1 K2 (G33)"), None);
        let slide = asked("G76 P1 Z-5 I-1 J.2 K.8 Q45").unwrap().slide;
        assert!((slide + 1.0).abs() < 1e-9);
    }
}
