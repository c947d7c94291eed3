//! Pressure advance: the steps of the extruder agree with its line plus K times its velocity. At rest they agree with
//! the line alone, whatever holds, drops and stops come before.

use kerf::config::StepRatio;
use kerf::dda::{STEP, Segment};
use kerf::motion::advance::Lead;
use kerf::motion::block::{Block, QueuedAction};
use kerf::motion::exec::Step;
use kerf::motion::short::Short;
use proptest::prelude::*;

use crate::cases::cases;
use crate::rig::{Config, Rig, at};

const E: usize = 3;
/// Steps in a mm of X, Y and Z, and of filament.
const STEPS: [f64; 4] = [80.0, 80.0, 400.0, 93.0];

fn printer(jerk: f32) -> Config {
    let mut config = Config::new(200.0, 1_000.0, jerk);
    config.accel[E] = 960.0;
    config.velocity[E] = 48.0;
    config.ratio = STEPS.map(|steps| StepRatio { num: steps as u32, den: 10_000 });
    config
}

fn lead(k: f64) -> Lead {
    Lead {
        motor: E as u8,
        time: (k * 1e4).round() as u16,
        accel: Short::new(960.0 * 93.0),
        velocity: Short::new(48.0 * 93.0),
        slack: Lead::slack(93.0),
    }
}

fn rig(jerk: f32, k: f64) -> Rig {
    let mut rig = Rig::new(printer(jerk));
    rig.pins.keep_edges = true;
    rig.pins.keep_trail = true;
    rig.leads = Some(E);
    if k > 0.0 {
        rig.aside(Block::action(QueuedAction::Advance(lead(k)), 0));
    }
    rig
}

/// A line to X, Y, Z and E in mm, at a speed in mm/s.
type To = ([f64; 4], f32);

fn run(rig: &mut Rig, lines: &[To]) {
    for (n, (to, velocity)) in lines.iter().enumerate() {
        while rig.free() == 0 {
            rig.turn();
        }
        rig.line(at(*to), *velocity, n as u32 + 1);
    }
    rig.finish();
}

/// The commanded path along X, from the segments. The lead is compared with it, between the steps too. The pulses
/// alone do not show position and velocity where they are far apart, as near the ends of a ramp: the lead would be
/// measured up to 0.7 steps worse than it is.
struct Path(Vec<(f64, f64)>);

impl Path {
    /// Takes the path from the segments. Checks that the steps of X are on it to 1/20 step, because otherwise it
    /// would be no measure.
    fn of(rig: &Rig) -> Self {
        let mut ends = vec![(0.0, 0.0)];
        let (mut time, mut at) = (0.0, 0.0);
        for emitted in &rig.emitted {
            let segment = &emitted.segment;
            let ticks = f64::from(segment.ticks);
            time += ticks * f64::from(segment.period);
            let way = ticks * f64::from(segment.increment[0]) / f64::from(STEP);
            at += if segment.backwards & 1 != 0 { -way } else { way };
            ends.push((time, at / STEPS[0]));
        }
        let path = Self(ends);
        for (n, edge) in rig.pins.edges[0].iter().enumerate() {
            let at = path.at(*edge as f64) * STEPS[0];
            assert!((at - n as f64 - 0.5).abs() < 0.05, "step {n} of X at {at}");
        }
        path
    }

    /// Returns the position, mm, at a time in cycles.
    fn at(&self, time: f64) -> f64 {
        let n = self.0.partition_point(|(end, _)| *end < time).clamp(1, self.0.len() - 1);
        let ((before, from), (after, to)) = (self.0[n - 1], self.0[n]);
        from + (to - from) * ((time - before) / (after - before)).min(1.0)
    }

    /// Returns the velocity, mm/s: the mean of 6 ms, over which jerk changes it by 0.05 mm/s.
    fn velocity(&self, time: f64) -> f64 {
        let half = 0.003 * 16e6;
        (self.at(time + half) - self.at((time - half).max(0.0))) / 0.006
    }
}

/// Returns how far the extruder is off at each step of any motor, in steps, each with the time in s, on lines along
/// X. The half step by which positions are rounded counts.
fn off(rig: &Rig, k: f64, lines: &[To]) -> Vec<(f64, f64)> {
    let path = Path::of(rig);
    let off = |(position, time): &([i64; 4], u64)| {
        let at = path.at(*time as f64);
        let n = lines.partition_point(|(to, _)| to[0] < at).min(lines.len() - 1);
        let from = if n == 0 { [0.0; 4] } else { lines[n - 1].0 };
        let ratio = (lines[n].0[3] - from[3]) / (lines[n].0[0] - from[0]);
        let line = from[3] + (at - from[0]) * ratio;
        let model = (line + k * path.velocity(*time as f64) * ratio) * STEPS[E];
        (position[E] as f64 - model, *time as f64 / 16e6)
    };
    rig.pins.trail.iter().map(off).collect()
}

/// Returns the largest of these errors.
fn worst(rig: &Rig, k: f64, lines: &[To]) -> f64 {
    off(rig, k, lines).iter().map(|(off, _)| off.abs()).fold(0.0, f64::max)
}

/// A path along X of `lines` lines of `length` mm, whose speeds change.
fn along_x(lines: usize, length: f64, speeds: &[f32], ratio: f64) -> Vec<To> {
    (1..=lines)
        .map(|n| {
            let x = n as f64 * length;
            ([x, 0.0, 0.0, x * ratio], speeds[n * speeds.len() / (lines + 1)])
        })
        .collect()
}

const RATIO: f64 = 0.0333;
const SPEEDS: [f32; 3] = [60.0, 20.0, 100.0];
const ALL_K: [f64; 5] = [0.0, 0.02, 0.05, 0.1, 0.2];

/// Returns the largest error of a job along X with this K.
fn worst_of(lines: usize, length: f64, jerk: f32, k: f64) -> f64 {
    let (mut rig, lines) = (rig(jerk, k), along_x(lines, length, &SPEEDS, RATIO));
    run(&mut rig, &lines);
    assert_eq!(rig.pins.position, rig.target());
    worst(&rig, k, &lines)
}

#[test]
fn the_extruder_is_ahead_by_k_times_its_velocity() {
    for (lines, length) in [(6, 20.0), (40, 2.0), (400, 0.2), (1_600, 0.05)] {
        for k in ALL_K {
            let worst = worst_of(lines, length, 33_333.0, k);
            assert!(worst < 1.0, "{lines} x {length} mm, K {k}: {worst:.2}");
        }
    }
}

#[test]
fn ends_of_far_lines_are_whole_steps_and_the_lead_is_as_good_there() {
    // The lines have more than 2,030 steps, so the line of the extruder is half a step off there, even without a
    // lead.
    for k in ALL_K {
        let worst = worst_of(3, 50.0, 33_333.0, k);
        assert!(worst < 1.2, "K {k}: {worst:.2}");
    }
}

#[test]
fn without_a_jerk_limit_the_lead_follows_as_fast_as_its_motor_may() {
    for (lines, length) in [(6, 20.0), (40, 2.0), (400, 0.2)] {
        for k in ALL_K {
            let worst = worst_of(lines, length, 0.0, k);
            // Where the machine begins to accelerate, the lead's velocity jumps by K times the acceleration. A motor
            // cannot jump, so it uses its own acceleration, and falls behind meanwhile. With K up to 0.1 that is less
            // than half a step.
            let jump = k * 1_000.0 * RATIO * STEPS[E];
            let late = jump * jump / (2.0 * 960.0 * STEPS[E]);
            let most = if k <= 0.1 { 1.0 } else { 0.6 + late };
            assert!(worst < most, "{lines} x {length} mm, K {k}: {worst:.2} of {most:.2}");
        }
    }
}

#[test]
fn without_a_jerk_limit_the_lead_is_late_at_a_peak_of_velocity() {
    for k in ALL_K {
        let (mut rig, lines) = (rig(0.0, k), along_x(4, 2.0, &[100.0], RATIO));
        run(&mut rig, &lines);
        // The velocity of the lead reverses, so its jump is twice the jump at a ramp's end.
        let jump = 2.0 * k * 1_000.0 * RATIO * STEPS[E];
        let most = 0.6 + jump * jump / (2.0 * 960.0 * STEPS[E]);
        let worst = worst(&rig, k, &lines);
        assert!(worst < most.max(1.0), "K {k}: {worst:.2} of {most:.2}");
    }
}

#[test]
fn where_the_amount_of_filament_changes_the_lead_goes_over_as_fast_as_its_motor_may() {
    let k = 0.1;
    // 1.9 steps of lead at 89,280 steps/s^2 take 9 ms. On short lines, files with three decimals round the amount of
    // filament. A smaller change than this rounding comes with the mean, within 0.1 mm of filament, 3 mm of path.
    for (lines, length, most) in [(120, 1.0, 0.012), (600, 0.2, 0.04)] {
        let mut at = 0.0;
        // The amount changes by 10 %, four times.
        let thick = |n: usize| 1.0 + 0.1 * ((n * 5 / lines) % 2) as f64;
        let line = |n| {
            at += RATIO * thick(n - 1) * length;
            ([n as f64 * length, 0.0, 0.0, at], 60.0)
        };
        let lines: Vec<To> = (1..=lines).map(line).collect();
        let mut rig = rig(33_333.0, k);
        run(&mut rig, &lines);
        let off = off(&rig, k, &lines);
        let bad = off.iter().filter(|(off, _)| off.abs() >= 1.0);
        let mut changes: Vec<(f64, f64)> = Vec::new();
        for (_, time) in bad {
            match changes.last_mut() {
                Some(last) if *time < last.1 + 0.05 => last.1 = *time,
                _ => changes.push((*time, *time)),
            }
        }
        assert_eq!(changes.len(), 4, "{changes:?}");
        assert!(changes.iter().all(|(from, to)| to - from < most), "{changes:?}");
    }
}

#[test]
fn travels_and_retractions_have_no_lead() {
    let mut rig = rig(33_333.0, 0.1);
    run(&mut rig, &[([50.0, 0.0, 0.0, 0.0], 100.0), ([50.0, 0.0, 0.0, 3.0], 30.0)]);
    run(&mut rig, &[([50.0, 0.0, 0.0, 1.0], 30.0), ([20.0, 10.0, 0.0, 0.5], 60.0)]);
    // Each step of the extruder goes in the direction of its line.
    let mut before = 0;
    let mut turns = 0;
    let mut direction = 0;
    for (position, _) in &rig.pins.trail {
        let way = position[E] - before;
        if way != 0 && way != direction {
            direction = way;
            turns += 1;
        }
        before = position[E];
    }
    assert_eq!((turns, rig.pins.position), (2, rig.target()));
}

/// A printer whose lead takes long to give up: its extruder is limited to 48 mm/s and 3,000 mm/s^2.
fn slow_extruder(jerk: [f32; 3], steps: u32) -> Rig {
    let mut config = printer(jerk[0]);
    config.velocity[..4].copy_from_slice(&[250.0, 250.0, 12.0, 48.0]);
    config.accel[..4].copy_from_slice(&[1_000.0, 1_000.0, 100.0, 3_000.0]);
    config.jerk[..3].copy_from_slice(&jerk);
    config.ratio = [80, 80, 400, steps].map(|steps| StepRatio { num: steps, den: 10_000 });
    let mut rig = Rig::new(config);
    rig.leads = Some(E);
    let steps = steps as f32;
    let lead = Lead {
        motor: E as u8,
        time: 10_000,
        accel: Short::new(3_000.0 * steps),
        velocity: Short::new(48.0 * steps),
        slack: Lead::slack(steps),
    };
    rig.aside(Block::action(QueuedAction::Advance(lead), 0));
    rig
}

/// Returns the time of each segment, s, and the velocity of the extruder in it, mm/s.
fn extruder_speeds(rig: &Rig, steps: f64) -> Vec<(f64, f64)> {
    let speed = |segment: &Segment| {
        let time = f64::from(segment.ticks) * f64::from(segment.period) / 16e6;
        let way = f64::from(segment.increment[E]) * f64::from(segment.ticks) / f64::from(STEP);
        let way = if segment.backwards & 1 << E != 0 { -way } else { way };
        (time, way / steps / time)
    };
    rig.emitted.iter().map(|emitted| speed(&emitted.segment)).collect()
}

#[test]
fn the_extruder_keeps_to_its_acceleration_while_it_gives_up_its_lead() {
    const FAST: f32 = 33_333.0;
    let print = ([30.0, 0.0, 0.0, 3.9], 100.0);
    let ways: [&[To]; 6] = [
        &[],
        &[([30.0, 0.14, 0.0, 3.9], 100.0), ([30.2, 0.14, 0.0, 3.89], 100.0)],
        &[([30.0, 10.0, 0.0, 3.9], 100.0)],
        &[([30.0, 1.0, 0.0, 3.9], 2.0)],
        &[([30.0, 0.0, 0.5, 3.9], 12.0)],
        &[([0.0, 0.0, 0.0, 7.8], 100.0)],
    ];
    let jerks = [[0.0; 3], [FAST; 3], [FAST, 50.0, 10.0]];
    let each = |way| {
        let jerks = jerks.iter();
        jerks.flat_map(move |jerk| [93, 420, 840].map(|steps| (way, *jerk, steps)))
    };
    for (way, jerk, steps) in ways.into_iter().flat_map(each) {
        let mut rig = slow_extruder(jerk, steps);
        let lines = [&[print], way].concat();
        run(&mut rig, &lines);
        assert_eq!(rig.pins.position, rig.target());
        let speeds = extruder_speeds(&rig, f64::from(steps));
        for pair in speeds.windows(2) {
            let [(before, from), (time, to)] = pair else { unreachable!() };
            let most = 3_030.0 * before.max(*time) + 0.5;
            assert!((to - from).abs() < most, "{way:?}, jerk {jerk:?}, {steps} steps/mm: {pair:?}");
        }
    }
}

#[test]
fn what_is_off_costs_nothing() {
    let lines = along_x(40, 2.0, &[60.0, 20.0], 0.0333);
    let (mut without, mut zero) = (rig(33_333.0, 0.0), rig(33_333.0, 0.0));
    zero.aside(Block::action(QueuedAction::Advance(lead(0.0)), 0));
    run(&mut without, &lines);
    run(&mut zero, &lines);
    assert_eq!(without.pins.edges, zero.pins.edges);
}

#[derive(Clone, Debug)]
enum Op {
    Line([f64; 4], f32),
    K(f64),
    Dwell,
    Hold(u16, bool),
    Stop(u16, usize, usize),
    Turns(u16),
}

fn any_deed() -> impl Strategy<Value = Op> {
    let way = || prop_oneof![3 => Just(0.0), 5 => -3.0..3.0f64, 1 => -60.0..60.0f64];
    let filament = prop_oneof![2 => Just(0.0), 5 => 0.0..0.2f64, 1 => -5.0..8.0f64];
    let speed = prop_oneof![1f32..20.0, 20f32..200.0];
    prop_oneof![
        20 => (way(), way(), prop_oneof![9 => Just(0.0), 1 => -0.4..0.4f64], filament, speed)
            .prop_map(|(x, y, z, e, speed)| Op::Line([x, y, z, e], speed)),
        2 => prop_oneof![Just(0.0), 0.01..0.2f64, Just(2.0)].prop_map(Op::K),
        1 => Just(Op::Dwell),
        1 => (0u16..200, prop::bool::weighted(0.4)).prop_map(|(turns, drop)| Op::Hold(turns, drop)),
        1 => (0u16..100, 0usize..6, 0usize..400).prop_map(|(a, b, c)| Op::Stop(a, b, c)),
        4 => (0u16..60).prop_map(Op::Turns),
    ]
}

fn carry_out(rig: &mut Rig, op: &Op, place: &mut [f64; 4]) {
    while rig.free() < 2 {
        rig.turn();
    }
    match op {
        Op::Line(way, speed) => {
            for (place, way) in place.iter_mut().zip(way) {
                *place += way;
            }
            let to = at(*place);
            if to != rig.position {
                rig.line(to, *speed, 1);
            }
        }
        Op::K(k) => rig.aside(Block::action(QueuedAction::Advance(lead(*k)), 0)),
        Op::Dwell => rig.push(Block::action(QueuedAction::Dwell(5), 0)),
        Op::Turns(turns) => (0..*turns).for_each(|_| _ = rig.turn()),
        Op::Hold(turns, drop) => {
            (0..*turns).for_each(|_| _ = rig.turn());
            rig.hold(true);
            let mut turns = 0;
            while rig.turn() != Step::Held {
                turns += 1;
                assert!(turns < 20_000, "it does not rest");
            }
            if *drop {
                rig.drop_all();
                assert_eq!(rig.pins.position, rig.snapshot.target.map(i64::from));
                *place = core::array::from_fn(|m| f64::from(rig.position[m].0) * 1e-4);
            }
            rig.hold(false);
        }
        Op::Stop(turns, segments, ticks) => {
            (0..*turns).for_each(|_| _ = rig.turn());
            rig.stop_short(*segments, *ticks);
            assert_eq!(rig.pins.position, rig.snapshot.target.map(i64::from));
            *place = core::array::from_fn(|m| f64::from(rig.position[m].0) * 1e-4);
        }
    }
}

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn at_rest_the_extruder_is_where_its_line_ends(
        jerk in prop_oneof![Just(0f32), Just(33_333f32), 2_000f32..100_000.0],
        ops in prop::collection::vec(any_deed(), 1..150),
    ) {
        let mut rig = rig(jerk, 0.05);
        let mut place = [0.0; 4];
        for op in &ops {
            carry_out(&mut rig, op, &mut place);
        }
        rig.finish();
        let at_rest = rig.target();
        prop_assert_eq!(rig.pins.position, at_rest);
    }
}
