//! The governor alone, under a jerk limit, over random paths: its limits, its time, and its work for a stretch.
//!
//! `KERF_SEED=n` plays one path and prints what happens.

use std::cell::Cell;

use kerf::motion::governor::{Ahead, Governor};
use kerf::motion::queue::Constraint;
use kerf::motion::short::Short;
use kerf::motion::speed_constraints;

use crate::optimum::rest_to_rest;

/// Nominal time of a slice, s.
const SLICE: f64 = 0.002;

/// Most constraints that may be asked for in one stretch: those that are checked exactly, those that are passed, and
/// one that stands for the rest, each for three velocities.
const ASKED_MOST: u32 = 16;

/// A generator of pseudo-random numbers.
struct Dice(u64);

impl Dice {
    fn new(seed: u64) -> Self {
        let mut dice = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        (0..5).for_each(|_| _ = dice.roll());
        dice
    }
    /// Returns a number from 0 to 1.
    fn roll(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    /// Returns a number from `low` to `high`, with all decades equally likely.
    fn decades(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.roll())
    }
}

#[derive(Clone, Copy, Debug)]
struct Block {
    length: f64,
    cruise: f64,
    entry: f64,
}

struct Path {
    accel: f64,
    jerk: f64,
    blocks: Vec<Block>,
    /// Most blocks in the queue.
    queue: usize,
    holds: bool,
}

/// The blocks queued behind the block that runs: their velocities, and their brake potentials from its end.
struct Queue<'a> {
    constraints: Vec<(f32, f32)>,
    asked: &'a Cell<u32>,
}

impl Ahead for Queue<'_> {
    fn headroom(&self) -> f32 {
        0.0
    }
    fn slower(&self, n: u8, velocity: Short) -> (u8, Constraint) {
        self.asked.set(self.asked.get() + 1);
        let last = self.constraints.len() - 1;
        let slower = |at: &usize| *at == last || Short::new(self.constraints[*at].0) < velocity;
        let at = (usize::from(n)..last).find(slower).unwrap_or(last);
        let (velocity, ahead) = self.constraints[at];
        let velocity = Short::new(velocity);
        (at as u8, Constraint { velocity, ahead, firm: at == last })
    }
    fn end(&self) -> f32 {
        self.constraints[self.constraints.len() - 1].1
    }
}

impl Path {
    fn random(dice: &mut Dice) -> Self {
        let accel = dice.decades(50.0, 5_000.0);
        let jerk = accel / dice.decades(0.0015, 0.3);
        let feed = dice.decades(2.0, 200.0);
        let scale = dice.decades(0.05, 30.0);
        let style = (dice.roll() * 4.0) as u32;
        let count = (20.0 + dice.roll() * 150.0) as usize;
        let mut blocks: Vec<Block> = Vec::new();
        for _ in 0..count {
            let cruise = if style == 1 { feed * dice.decades(0.2, 1.0) } else { feed };
            let length = (scale * dice.decades(0.3, 3.0)).max(cruise * 0.000_75);
            let entry = match style {
                0 => cruise,
                1 => dice.decades(0.05, 1.0) * cruise,
                2 => 0.4 * cruise,
                _ => dice.decades(0.01, 4.0) * cruise,
            };
            let before = blocks.last().map_or(0.0, |b| b.cruise);
            blocks.push(Block { length, cruise, entry: entry.min(cruise).min(before) });
        }
        let queue = [64, 64, 8, 2][(dice.roll() * 4.0) as usize];
        let holds = dice.roll() < 0.3;
        Self { accel, jerk, blocks, queue, holds }
    }

    /// Returns the constraints behind block `at`, of the blocks up to `end`, with rising keys as in the speed
    /// constraints.
    fn ahead<'a>(&self, at: usize, end: usize, asked: &'a Cell<u32>) -> Queue<'a> {
        let kappa = speed_constraints::kappa(self.accel as f32, self.jerk as f32);
        let key = |w: f32, ahead: f32| speed_constraints::key(w, kappa) + ahead;
        let mut constraints: Vec<(f32, f32)> = Vec::new();
        let mut ahead = 0.0;
        for n in at + 1..=end {
            let last = n == end;
            let entry = if last { 0.0 } else { self.blocks[n].entry as f32 };
            let slowest = |n: usize| self.blocks[n].cruise.min(self.blocks[n - 1].cruise) as f32;
            if last || entry < 0.999 * slowest(n) || slowest(n) < self.blocks[n - 1].cruise as f32 {
                while !last
                    && constraints.last().is_some_and(|&(w, s)| key(w, s) >= key(entry, ahead))
                {
                    constraints.pop();
                }
                constraints.push((entry, ahead));
            }
            if !last {
                ahead += (2.0 * self.accel * self.blocks[n].length) as f32;
            }
        }
        Queue { constraints, asked }
    }
}

#[derive(Clone, Copy, Debug)]
struct State {
    clock: f64,
    velocity: f64,
    /// Whether the machine has stood still before it.
    restarted: bool,
}

/// The results of a path.
#[derive(Debug, Default)]
struct Outcome {
    seconds: f64,
    /// Acceleration and jerk over their limits, the largest of the path.
    accel: f64,
    jerk: f64,
    corner: f64,
    cruise: f64,
    /// Most constraints that were asked for in a stretch.
    asked: u32,
    /// Most stretches in a row that end no block and are together shorter than a slice.
    tiny: u32,
    /// Number of stretches, number of stretches that looked ahead, and number of constraints that were asked for.
    work: [u64; 3],
}

fn run(path: &Path, dice: &mut Dice, trace: bool) -> Outcome {
    let mut governor = Governor::new();
    let asked = Cell::new(0);
    let mut out = Outcome::default();
    let (mut at, mut left) = (0, path.blocks[0].length as f32);
    let mut end = path.queue.min(path.blocks.len());
    let mut states = vec![State { clock: 0.0, velocity: 0.0, restarted: true }];
    let mut corners = Vec::new();
    let (mut clock, mut place, mut hold, mut stretches) = (0.0, 0.0, 0, 0);
    let (mut short, mut tiny) = (0.0, 0);
    governor.begin(path.accel as f32, path.jerk as f32);
    while at < path.blocks.len() {
        if end < path.blocks.len() && end - at < path.queue && dice.roll() < 0.7 {
            end += 1;
            governor.look_again();
        }
        end = end.max(at + 1);
        let ahead = path.ahead(at, end, &asked);
        asked.set(0);
        if path.holds && hold == 0 && dice.roll() < 0.01 {
            hold = 1 + (dice.roll() * 40.0) as usize;
        }
        let block = path.blocks[at];
        hold = usize::saturating_sub(hold, 1);
        let stretch = if hold > 0 {
            if governor.is_at_rest() {
                governor.stop();
                states.push(State { clock, velocity: 0.0, restarted: true });
                continue;
            }
            governor.halt(left, &ahead, SLICE as f32)
        } else {
            governor.stretch(left, block.cruise as f32, &ahead, SLICE as f32)
        };
        if trace {
            println!(
                "{clock:.5} {place:.5} block {at} left {left:.5} hold {hold} {stretch:?} asked {} ahead {:?}\n    {governor:?}",
                asked.get(),
                &ahead.constraints[..ahead.constraints.len().min(4)]
            );
        }
        assert!(stretch.seconds > 0.0 && stretch.seconds.is_finite(), "{stretch:?} {governor:?}");
        assert!(stretch.distance >= 0.0, "{stretch:?} {governor:?}");
        out.asked = out.asked.max(asked.get());
        let looks = [1, u64::from(asked.get() > 0), asked.get().into()];
        out.work.iter_mut().zip(looks).for_each(|(sum, more)| *sum += more);
        short += f64::from(stretch.seconds);
        tiny += u32::from(!stretch.ends);
        if short > 0.5 * SLICE || hold > 0 {
            (short, tiny) = (0.0, 0);
        }
        if trace && tiny > out.tiny {
            println!("tiny {tiny} at {clock}");
        }
        out.tiny = out.tiny.max(tiny);
        clock += f64::from(stretch.seconds);
        place += f64::from(stretch.distance);
        stretches += 1;
        assert!(clock < 1e5 && stretches < 3_000_000, "it does not end: {governor:?} {left} {at}");
        let (more, _) = governor.pending();
        let next = State {
            clock: clock + f64::from(more),
            velocity: governor.velocity().into(),
            restarted: false,
        };
        if next.clock > states[states.len() - 1].clock + 2e-5 {
            states.push(next);
        }
        let mean = f64::from(stretch.distance) / f64::from(stretch.seconds);
        // At a stop 0.5 um are made at once.
        let at_once = if governor.velocity() == 0.0 { 5.1e-4 } else { 1e-5 };
        let over = (mean - at_once / f64::from(stretch.seconds)) / block.cruise;
        if trace && over > out.cruise && over > 1.0 {
            println!("cruise {over} at {clock}");
        }
        out.cruise = out.cruise.max(over);
        if stretch.ends {
            at += 1;
            if let Some(block) = path.blocks.get(at) {
                left = block.length as f32;
                corners.push((clock, block.entry, at));
            }
        } else {
            left -= stretch.distance;
        }
    }
    out.seconds = clock;
    // Rounding may leave over 0.01 um of the last ramp: d = J t^3 / 6, v = J t^2 / 2.
    let rounding = 0.5 * path.jerk * (6.0 * 1e-5 / path.jerk).powf(2.0 / 3.0);
    let little = rounding.max(2.0 * path.jerk * SLICE * SLICE);
    assert!(f64::from(governor.velocity()) <= little, "it ends at {}", governor.velocity());
    check(path, &states, &corners, &mut out, trace);
    out
}

/// Checks changes of velocity and corners, from the states.
fn check(
    path: &Path,
    states: &[State],
    corners: &[(f64, f64, usize)],
    out: &mut Outcome,
    trace: bool,
) {
    // The change of velocity that a slice makes unavoidable.
    let little = path.jerk * SLICE * SLICE * 1.01;
    let worse = |value: f64, worst: &mut f64, what: &str, clock: f64| {
        if value > *worst {
            *worst = value;
            if trace {
                println!("{what} {value} at {clock}");
            }
        }
    };
    let mut n = 0;
    for &(clock, most, at) in corners {
        while n + 2 < states.len() && states[n + 1].clock < clock {
            n += 1;
        }
        let (a, b) = (states[n], states[n + 1]);
        let part = ((clock - a.clock) / (b.clock - a.clock)).clamp(0.0, 1.0);
        let velocity = a.velocity + (b.velocity - a.velocity) * part;
        let over = (velocity - most - little) / most.max(little);
        worse(1.0 + over, &mut out.corner, &format!("corner {at}"), clock);
    }
    let mut before: Option<(f64, f64)> = None;
    for pair in states.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (seconds, change) = (b.clock - a.clock, b.velocity - a.velocity);
        if b.restarted || seconds <= 0.0 {
            before = None;
            continue;
        }
        let accel = change / seconds;
        if change.abs() > little {
            worse(accel.abs() / path.accel, &mut out.accel, "accel", a.clock);
        }
        if let Some((accel_before, seconds_before)) = before {
            let time = 0.5 * (seconds + seconds_before);
            let jerk = ((accel - accel_before).abs() - path.jerk * SLICE) / time;
            worse(jerk / path.jerk, &mut out.jerk, "jerk", a.clock);
        }
        before = Some((accel, seconds));
    }
}

/// Returns the seeds of the paths: `count` of them, or the one of `KERF_SEED`. Also returns whether it is a single
/// one.
fn seeds(count: u64) -> (Vec<u64>, bool) {
    let one = std::env::var("KERF_SEED").ok().map(|seed| seed.parse().expect("a number"));
    let cases = std::env::var("KERF_CASES").ok().map(|n| n.parse().expect("a number"));
    match one {
        Some(seed) => (vec![seed], true),
        None => ((1..=cases.unwrap_or(count)).collect(), false),
    }
}

#[test]
fn any_path_is_within_its_limits_and_work() {
    let (seeds, trace) = seeds(3_000);
    let (mut bad, count) = (Vec::new(), seeds.len() as f64);
    let (mut worst, mut most_tiny) = (0, 0);
    // Means over all paths: the logarithm of the time, looks ahead in a stretch, constraints in a stretch.
    let mut means = [0.0; 3];
    for seed in seeds {
        let dice = &mut Dice::new(seed);
        let path = Path::random(dice);
        let run = || run(&path, dice, trace);
        let found = std::panic::catch_unwind(std::panic::AssertUnwindSafe(run));
        let Ok(out) = found else {
            bad.push(format!("seed {seed}: panic"));
            continue;
        };
        worst = worst.max(out.asked);
        let [stretches, looks, asked] = out.work.map(|n| n as f64);
        let more = [out.seconds.ln(), looks / stretches, asked / stretches];
        means.iter_mut().zip(more).for_each(|(sum, more)| *sum += more / count);
        let within = out.accel <= 1.02 && out.jerk <= 1.05 && out.corner <= 1.01;
        most_tiny = most_tiny.max(out.tiny);
        if out.tiny > 1 {
            println!("seed {seed} tiny {}", out.tiny);
        }
        if !within || out.cruise > 1.01 || out.asked > ASKED_MOST {
            bad.push(format!("seed {seed}: {out:?}"));
        }
    }
    println!(
        "mean time {:.4} s, a stretch has {:.4} looks at {:.4} constraints, {worst} at most",
        means[0].exp(),
        means[1],
        means[2]
    );
    assert!(bad.is_empty(), "{} paths, worst work {worst}:\n{}", bad.len(), bad.join("\n"));
}

#[test]
fn lone_moves_take_little_longer_than_the_optimum() {
    for (length, most) in [(0.1, 1.10), (1.0, 1.05), (10.0, 1.02), (100.0, 1.01)] {
        for jerk in [2_315.0, 23_148.0, 231_481.0] {
            let block = Block { length, cruise: 100.0, entry: 0.0 };
            let blocks = vec![block];
            let path = Path { accel: 500.0, jerk, blocks, queue: 64, holds: false };
            let out = run(&path, &mut Dice::new(1), false);
            let best = rest_to_rest(length, 100.0, 500.0, jerk);
            println!(
                "{length} mm, jerk {jerk}: {:.4} s, {:.3} of the optimum",
                out.seconds,
                out.seconds / best
            );
            assert!(out.seconds <= best * most + SLICE, "{} s, not {best}", out.seconds);
        }
    }
}
