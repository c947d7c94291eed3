//! Checks the threads of a job: the position of the axes at each index pulse of the spindle.
//!
//! The leads are read from the job's own lines (G33 and G32: K, G76: P), and everything else from the pins. The lead is
//! that of the axis that moves farthest, X or Z. A turn in which this axis moves by the lead, and the other one as the
//! line says, is a turn of a thread. Turns that follow each other are a pass. It begins at an index pulse where the
//! axes stand at the start of a line. The position of the leading axis at the index pulse, counted from there and
//! modulo the lead, is the *phase*. It must be equal in all turns of all passes with this lead. So each start of a
//! thread with several starts is shifted by as much as its line. A compound slide (Q of G76) shifts a pass by its
//! depth, which is read from X. Lengths are in millimetres.

use serde::Serialize;

use crate::machine::Machine;
use crate::oracle::{self, MotorSetup, Setup, UNITS, Word};
use crate::track::{self, Position, SAMPLE_S};

/// X and Z, among the axes and in a [`Place`].
const AXES: [usize; 2] = [0, 2];
const X: usize = 0;
const Z: usize = 1;

/// Positions of X and Z, mm.
type Place = [f64; 2];

/// How far from the lead the distance in a turn may be, steps. The axes catch up in a turn that is farther off, or
/// brake.
const ALIKE: f64 = 2.0;
/// Turns before the first one at full speed in which the start of a pass is searched.
const STARTING: usize = 12;
/// How far from the start of a line a pass may begin, and how far from a slope the other axis may be, steps.
const NEAR: f64 = 1.5;
const BESIDE: f64 = 2.0;

/// The threads that a line commands.
#[derive(Clone, Copy, Debug)]
struct Asked {
    lead: f64,
    /// How much further along Z a pass begins for each mm that X is beyond the peak of the thread, away from where the
    /// line begins.
    slide: f64,
    /// The distance along X from where the line begins to the peak.
    peak: f64,
    /// Whether X stands still in a pass (G76).
    steady: bool,
    /// Where the line begins and ends.
    from: Place,
    to: Place,
}

impl Asked {
    /// The axis that moves farthest.
    fn leader(&self) -> usize {
        let [x, z] = [X, Z].map(|axis| (self.to[axis] - self.from[axis]).abs());
        if x > z && !self.steady { X } else { Z }
    }

    /// The direction of this axis, 1 or -1.
    fn way(&self) -> f64 {
        let leader = self.leader();
        (self.to[leader] - self.from[leader]).signum()
    }

    /// How far the other axis moves with each mm of the one that moves farthest.
    fn slope(&self) -> f64 {
        let leader = self.leader();
        let [far, other] = [leader, 1 - leader].map(|axis| self.to[axis] - self.from[axis]);
        if self.steady || far == 0.0 { 0.0 } else { other / far }
    }

    /// Whether the axes move by this thread from `a` to `b`, in a turn. `step` is that of each axis.
    fn is_turn(&self, a: Place, b: Place, step: Place) -> bool {
        let leader = self.leader();
        let [far, other] = [leader, 1 - leader].map(|axis| b[axis] - a[axis]);
        let beside = (other - far * self.slope()).abs();
        let most = if self.slope() == 0.0 { 0.0 } else { BESIDE * step[1 - leader] };
        (far * self.way() - self.lead).abs() <= ALIKE * step[leader] && beside <= most
    }

    /// Returns how far the leading axis is from the start of its pass, in the direction of the thread.
    fn gone(&self, at: Place) -> f64 {
        let slid = self.slide * self.way() * (at[X] - self.from[X] - self.peak);
        let leader = self.leader();
        (at[leader] - self.from[leader] - slid) * self.way()
    }

    /// Whether a pass begins here.
    fn begins(&self, at: Place, step: Place) -> bool {
        let leader = self.leader();
        let beside = (at[1 - leader] - self.from[1 - leader]).abs();
        self.gone(at).abs() <= NEAR * step[leader]
            && (self.steady || beside <= NEAR * step[1 - leader])
    }
}

/// The threads that were cut.
#[derive(Clone, Serialize, Debug)]
pub struct Threads {
    /// Number of passes.
    pub passes: usize,
    /// Number of turns by the lead, in all passes.
    pub turns: usize,
    /// Number of lines that ask for a thread.
    pub lines: usize,
    /// From the lowest phase to the highest.
    pub spread_mm: f64,
    /// Most spread that is allowed: a step, and one more with a compound slide.
    pub most_mm: f64,
    /// Errors over the length, for each pass: the position of the leading axis, and its distance from where the
    /// spindle's angle puts it.
    #[serde(skip)]
    pub errors: Vec<Vec<(f64, f64)>>,
}

/// A turn of the spindle in which the axes follow it.
struct Turn {
    /// Cycles of the index pulses at both ends of the turn.
    cycles: [u64; 2],
    /// Positions of the leading axis at both ends of the turn.
    places: [f64; 2],
    leader: usize,
    phase: f64,
    lead: f64,
}

/// An index pulse: its cycle, and where X and Z were.
type Index = (u64, Place);

impl Threads {
    /// Evaluates the threads of a job. The recorder may have kept a log of its steps. `None` if the job has no
    /// threads.
    pub fn of(machine: &Machine, setup: &Setup, lines: &[(usize, String)]) -> Option<Threads> {
        let motors = AXES.map(|axis| motor_of(setup, axis));
        let [Some(x), Some(z)] = motors else { return None };
        let step = [x, z].map(|motor| step_of(&setup.motors[motor]));
        let asked = all_asked(lines, setup, [x, z], step);
        if asked.is_empty() {
            return None;
        }
        let indexed: Vec<Index> = machine
            .mechanics()?
            .indexed()
            .iter()
            .map(|(cycle, steps)| {
                (*cycle, [X, Z].map(|axis| steps[[x, z][axis]] as f64 * step[axis]))
            })
            .collect();
        let passes = passes(&indexed, &asked, step);
        Some(Self::sum_up(machine, setup, &passes, &asked, step))
    }

    fn sum_up(
        machine: &Machine,
        setup: &Setup,
        passes: &[Vec<Turn>],
        asked: &[Asked],
        step: Place,
    ) -> Threads {
        // Difference from the first phase of this lead. Phases wrap from 1 to 0, so it is taken modulo 1.
        let off = |turn: &Turn| {
            let first = passes.iter().flatten().find(|first| first.lead == turn.lead);
            let off = turn.phase - first.map_or(0.0, |first| first.phase);
            (off - off.round()) * turn.lead
        };
        let (low, high) = passes
            .iter()
            .flatten()
            .map(off)
            .fold((0.0f64, 0.0f64), |(low, high), off| (low.min(off), high.max(off)));
        let samples = track::positions(&track::steps(machine), setup);
        let begin = machine.recorder().log().first().map_or(0, |step| step.cycle);
        let seconds = |cycle: u64| machine.seconds(cycle.saturating_sub(begin));
        let errors = passes
            .iter()
            .map(|pass| {
                pass.iter().flat_map(|turn| errors(turn, off(turn), &samples, seconds)).collect()
            })
            .collect();
        let most = asked.iter().map(|of| step[of.leader()]).fold(0.0, f64::max);
        let slides = asked.iter().any(|of| of.slide != 0.0);
        Threads {
            passes: passes.len(),
            turns: passes.iter().flatten().count(),
            lines: asked.len(),
            spread_mm: high - low,
            most_mm: if slides { 2.0 * most } else { most },
            errors,
        }
    }

    /// Returns what is wrong with the threads; `None` if nothing is.
    pub fn problem(&self) -> Option<String> {
        let (passes, lines) = (self.passes, self.lines);
        if passes < lines {
            return Some(format!(
                "{lines} lines with threads, but {passes} passes that begin where a line does and \
                 go by its lead in a turn"
            ));
        }
        let (is, most) = (self.spread_mm, self.most_mm);
        (is > most + 1e-9)
            .then(|| format!("threads are {is:.4} mm apart at the index, more than {most:.4}"))
    }
}

/// Returns the turns of each pass.
fn passes(indexed: &[Index], asked: &[Asked], step: Place) -> Vec<Vec<Turn>> {
    let is_turn = |of: &Asked, n: usize| of.is_turn(indexed[n].1, indexed[n + 1].1, step);
    let last = indexed.len().saturating_sub(1);
    let mut passes: Vec<(&Asked, Vec<Turn>)> = Vec::new();
    let mut behind = 0;
    for n in 0..last {
        // The nearest start counts: those of other passes may be shortly before it.
        let before = (n.saturating_sub(STARTING).max(behind)..=n).rev();
        let begun =
            |at: usize| asked.iter().find(|of| is_turn(of, n) && of.begins(indexed[at].1, step));
        let turn = |of: &Asked| turn(of, &indexed[n], &indexed[n + 1]);
        let starts = before.into_iter().find_map(begun);
        match (passes.last_mut(), starts) {
            // The pass goes on, perhaps behind a turn that went by another distance.
            (Some((of, turns)), None) if is_turn(of, n) => turns.push(turn(of)),
            (_, Some(of)) => passes.push((of, vec![turn(of)])),
            _ => continue,
        }
        behind = n + 1;
    }
    passes.into_iter().map(|(_, turns)| turns).collect()
}

fn turn(of: &Asked, a: &Index, b: &Index) -> Turn {
    let leader = of.leader();
    let gone = of.gone(b.1) / of.lead;
    Turn {
        cycles: [a.0, b.0],
        places: [a.1[leader], b.1[leader]],
        leader,
        phase: gone - gone.floor(),
        lead: of.lead,
    }
}

/// Returns the samples of a turn: the position of the leading axis, and its error.
fn errors(
    turn: &Turn,
    off: f64,
    samples: &[Position],
    seconds: impl Fn(u64) -> f64,
) -> Vec<(f64, f64)> {
    let [from, to] = turn.cycles.map(&seconds);
    let [first, last] =
        [from, to].map(|time| ((time / SAMPLE_S).ceil() as usize).min(samples.len()));
    let way = (turn.places[1] - turn.places[0]).signum();
    (first..last)
        .map(|n| {
            let share = (n as f64 * SAMPLE_S - from) / (to - from);
            let place = samples[n][AXES[turn.leader]];
            // The end of the turn is `off` from its ideal place, in its own direction.
            let ideal = turn.places[1] - way * (off + turn.lead * (1.0 - share));
            (place, place - ideal)
        })
        .collect()
}

/// The modes of a job that matter to its threads.
#[derive(Default)]
struct Modes {
    inches: bool,
    diameters: bool,
    /// Whether G33 or G32 is active.
    threads: bool,
}

impl Modes {
    /// Returns the thread of a line that begins and ends there; `None` for a line without one.
    fn read(&mut self, words: &[Word], from: Place, to: Place) -> Option<Asked> {
        let word = |letter: char| words.iter().find(|word| word.letter == letter).map(Word::number);
        let codes = words.iter().filter(|word| word.letter == 'G').map(|word| word.value.tenths());
        let mut compound = false;
        for code in codes {
            match code {
                200 => self.inches = true,
                210 => self.inches = false,
                70 => self.diameters = true,
                80 => self.diameters = false,
                320 | 330 => self.threads = true,
                760 => (self.threads, compound) = (false, true),
                0 | 10 | 20 | 30 | 331 | 800 | 380..=385 | 730 | 810..=890 => self.threads = false,
                _ => {}
            }
        }
        let unit = if self.inches { 25.4 } else { 1.0 };
        if compound {
            let slide = word('Q').unwrap_or(0.0).to_radians().tan();
            // X grows with the depth of an inner thread.
            let peak = word('I').unwrap_or(0.0) * unit * if self.diameters { 0.5 } else { 1.0 };
            let (lead, slide) = (word('P')? * unit, slide * peak.signum());
            return Some(Asked { lead, slide, peak, steady: true, from, to });
        }
        let moves = word('X').or(word('Z')).is_some();
        let lead = word('K')? * unit;
        let thread = Asked { lead, slide: 0.0, peak: 0.0, steady: false, from, to };
        (self.threads && moves).then_some(thread)
    }
}

/// Returns the threads of all lines up to the first one whose end is not known.
fn all_asked(
    lines: &[(usize, String)],
    setup: &Setup,
    motors: [usize; 2],
    step: Place,
) -> Vec<Asked> {
    let ends = oracle::ends(lines.iter().map(|(n, line)| (*n, line.as_str())), setup);
    let (mut modes, mut from, mut all) = (Modes::default(), Place::default(), Vec::new());
    for ((_, line), (_, steps)) in lines.iter().zip(ends) {
        let to = [X, Z].map(|axis| steps[motors[axis]] as f64 * step[axis]);
        let words = oracle::split(line).unwrap_or_default();
        all.extend(modes.read(&words, from, to));
        from = to;
    }
    all
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
    use super::*;

    fn read(line: &str) -> Option<Asked> {
        let words = oracle::split(line).unwrap();
        Modes::default().read(&words, [9.0, 2.0], [9.0, -12.0])
    }

    #[test]
    fn leads_are_read_from_lines() {
        let lead = |line| read(line).map(|of| of.lead);
        assert_eq!(lead("g33z-5 k1.25"), Some(1.25));
        assert_eq!(lead("G76 P1.5 Z-12 I-1 J.2 K.8"), Some(1.5));
        assert_eq!(lead("G1 X1 K2 (G33)"), None);
        assert_eq!(lead("G20 G33 X1 K0.05"), Some(0.05 * 25.4));
    }

    #[test]
    fn a_compound_slide_shifts_a_pass_by_its_depth() {
        // The peak is at X 8; half a millimetre below it the pass begins half a millimetre further along Z.
        for line in ["G76 P1 Z-12 I-1 J.2 K.8 Q45", "G7 G76 P1 Z-12 I-2 J.4 K1.6 Q45"] {
            let of = read(line).unwrap();
            assert!(of.begins([7.5, 1.5], STEP) && !of.begins([7.5, 1.4], STEP), "{of:?}");
        }
    }

    const STEP: Place = [0.005, 0.005];

    fn asked(lead: f64, from: Place, to: Place) -> Asked {
        Asked { lead, slide: 0.0, peak: 0.0, steady: false, from, to }
    }

    /// Returns index pulses: a rest at the start, a turn of `late` less than the lead, then whole leads, and a jump
    /// back.
    fn cut(of: &Asked, late: f64, turns: usize) -> Vec<Index> {
        let length = [X, Z].map(|axis| of.to[axis] - of.from[axis]);
        let leader = of.leader();
        let at = |gone: f64| {
            [X, Z].map(|axis| of.from[axis] + length[axis] / length[leader].abs() * gone)
        };
        let gone = (1..=turns).map(|n| n as f64 * of.lead - late);
        let places = [0.0, 0.0].into_iter().chain(gone).map(at);
        places.map(|place| (0, place)).collect()
    }

    fn found(all: &[Asked], late: &[f64]) -> Vec<Vec<Turn>> {
        let indexed: Vec<_> =
            all.iter().zip(late).flat_map(|(of, late)| cut(of, *late, 5)).collect();
        passes(&indexed, all, STEP)
    }

    #[test]
    fn threads_along_each_axis_and_on_a_slope_are_found() {
        let lines =
            [[[12.0, 2.0], [4.0, 2.0]], [[4.0, 2.0], [6.0, -8.0]], [[6.0, -8.0], [20.0, 3.0]]];
        for [from, to] in lines {
            let passes = found(&[asked(1.5, from, to)], &[0.2]);
            assert_eq!((passes.len(), passes[0].len()), (1, 4), "{to:?}");
        }
    }

    #[test]
    fn each_start_counts_from_its_own_line() {
        let starts = [4.0, 5.0, 6.0].map(|z| asked(3.0, [10.0, z], [10.0, -9.0]));
        let phases = |late: &[f64]| {
            let phase = |pass: &Vec<Turn>| (pass[0].phase * 3.0 * 1e6).round() / 1e6;
            found(&starts, late).iter().map(phase).collect::<Vec<_>>()
        };
        assert_eq!(phases(&[0.2; 3]), [2.8; 3]);
        assert_eq!(phases(&[0.2, 0.2, 0.3]), [2.8, 2.8, 2.7]);
    }
}
