//! Properties of the planning maths: profile, junction, look-ahead and line builder, against f64.

use kerf::boards::MOTORS;
use kerf::gcode::command::Feed;
use kerf::motion::block::{Block, Kind};
use kerf::motion::junction::{self, Heading};
use kerf::motion::line::{Builder, Line, Machine};
use kerf::motion::lookahead::{Queue, replan};
use kerf::motion::profile::{Limits, Ramp, brake, peak, reach};
use kerf::units::{AXES, FIRST_ROTARY, Length, PerAxis};
use proptest::prelude::*;

/// A positive number, evenly spread over the decades between two powers of ten.
fn decades(low: f32, high: f32) -> impl Strategy<Value = f32> {
    (low..high).prop_map(|exponent| 10f32.powf(exponent))
}

/// A velocity from 1e-3 to 1000 mm/s, or zero.
fn velocity() -> impl Strategy<Value = f32> {
    prop_oneof![1 => Just(0.0), 8 => decades(-3.0, 3.0)]
}

fn limits() -> impl Strategy<Value = Limits> {
    (prop_oneof![2 => Just(0.0), 5 => decades(-1.0, 5.0)], decades(-1.0, 9.0))
        .prop_map(|(accel, jerk)| Limits { accel, jerk })
}

/// Duration and length of a ramp in f64, from the formulas' definition.
fn exact_ramp(v0: f64, v1: f64, limits: &Limits) -> (f64, f64) {
    let (accel, jerk, dv) = (f64::from(limits.accel), f64::from(limits.jerk), (v1 - v0).abs());
    let time = if accel == 0.0 || dv <= accel * accel / jerk {
        2.0 * (dv / jerk).sqrt()
    } else {
        dv / accel + accel / jerk
    };
    (time, (v0 + v1) / 2.0 * time)
}

fn exact_length(v0: f32, v1: f64, limits: &Limits) -> f64 {
    exact_ramp(f64::from(v0), v1, limits).1
}

/// The highest velocity from `low` for which `length_of` does not exceed `length`.
fn bisect(low: f64, length: f64, length_of: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (low, low + 1e9);
    for _ in 0..200 {
        let mid = 0.5 * (low + high);
        if length_of(mid) <= length { low = mid } else { high = mid }
    }
    low
}

fn near(a: f64, b: f64, relative: f64, absolute: f64) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs()) + absolute
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    /// Integrating the jerk of the definition gives the ramp's time, length, distances, velocities.
    #[test]
    fn ramp_is_the_integral_of_its_jerk(v0 in velocity(), v1 in velocity(), limits in limits()) {
        let ramp = Ramp::new(v0, v1, &limits);
        let (time, length) = exact_ramp(f64::from(v0), f64::from(v1), &limits);
        prop_assert!(near(f64::from(ramp.time()), time, 1e-6, 0.0));
        prop_assert!(near(f64::from(ramp.length()), length, 1e-6, 0.0));

        let (accel, jerk) = (f64::from(limits.accel), f64::from(limits.jerk));
        let dv = f64::from(v1) - f64::from(v0);
        let phase = if accel == 0.0 || dv.abs() * jerk <= accel * accel { time / 2.0 } else { accel / jerk };
        let most = dv.signum() * jerk * phase;
        let (mut v, mut s) = (f64::from(v0), 0.0);
        let scale = f64::from(v0.max(v1));
        // Kinks only at the ends of phases, and a cubic between them, so that Simpson's rule is exact.
        let middle = time - 2.0 * phase;
        for (from, lasts, a0, a1) in [(0.0, phase, 0.0, most), (phase, middle, most, most), (time - phase, phase, most, 0.0)] {
            let h = lasts / 16.0;
            for i in 0..16 {
                let t = from + h * f64::from(i);
                let at = t as f32;
                prop_assert!(near(f64::from(ramp.velocity(at)), v, 1e-5, 2e-6 * scale));
                prop_assert!(near(f64::from(ramp.distance(at)), s, 1e-5, 1e-6 * length));
                prop_assert!(near(f64::from(ramp.remaining(at)), length - s, 1e-5, 1e-6 * length));
                let rise = (a1 - a0) / 16.0;
                let a = a0 + rise * f64::from(i);
                let b = a + rise;
                let v_mid = v + h / 8.0 * (3.0 * a + b);
                let v_end = v + h / 2.0 * (a + b);
                s += h / 6.0 * (v + 4.0 * v_mid + v_end);
                v = v_end;
            }
        }
        prop_assert!(near(v, f64::from(v1), 1e-6, 1e-6 * scale) && near(s, length, 1e-6, 0.0));
    }

    /// Precise at the ends: relative to what is travelled, not to the whole.
    #[test]
    fn ramp_ends_are_precise(v0 in velocity(), v1 in velocity(), limits in limits(), part in 1e-6f32..0.01) {
        let ramp = Ramp::new(v0, v1, &limits);
        let jerk = f64::from(limits.jerk);
        let accel = f64::from(limits.accel);
        let dv = f64::from(v1 - v0);
        let phase = if accel == 0.0 || dv.abs() * jerk <= accel * accel { f64::INFINITY } else { accel / jerk };
        let t = (f64::from(ramp.time() * part)).min(0.99 * phase) as f32;
        let t64 = f64::from(t);
        let start = f64::from(v0) * t64 + dv.signum() * jerk * t64.powi(3) / 6.0;
        prop_assert!(near(f64::from(ramp.distance(t)), start, 1e-6, 1e-35));
        let late = ramp.time() - t;
        let left = f64::from(ramp.time()) - f64::from(late);
        let end = f64::from(v1) * left - dv.signum() * jerk * left.powi(3) / 6.0;
        // Rounding may put it before the last phase.
        prop_assert!(left > phase || near(f64::from(ramp.remaining(late)), end, 2e-6, 1e-35));
    }

    #[test]
    fn reach_is_safe_and_close(v in velocity(), length in decades(-5.0, 3.5), limits in limits()) {
        let w = reach(v, length, &limits);
        prop_assert!(w >= v && w.is_finite());
        prop_assert!(f64::from(Ramp::new(v, w, &limits).length()) <= f64::from(length) * (1.0 + 1e-5));
        let best = bisect(f64::from(v), f64::from(length), |w| exact_length(v, w, &limits));
        prop_assert!(exact_length(v, f64::from(w), &limits) <= f64::from(length) * (1.0 + 1e-6));
        let lost = best - f64::from(w);
        prop_assert!(lost <= 5e-4 * (best - f64::from(v)) + 2e-6 * best, "{w} {best}");
    }

    /// Whoever enters at `brake` can slow down to the exit velocity, and to any higher one.
    #[test]
    fn brake_allows_for_higher_exits(
        exit in velocity(), more in prop_oneof![decades(-4.0, 1.0), decades(-1.0, 4.0)],
        length in decades(-5.0, 3.5), limits in limits(),
    ) {
        let w = brake(exit, length, &limits);
        let best = reach(exit, length, &limits);
        prop_assert!(w >= exit && w >= 0.943 * best && w <= best * 1.001, "{w} {best}");
        prop_assert!(exact_length(exit, f64::from(w), &limits) <= f64::from(length) * (1.0 + 1e-6));
        let higher = exit * (1.0 + more);
        if higher < w {
            prop_assert!(exact_length(higher, f64::from(w), &limits) <= f64::from(length) * (1.0 + 1e-6));
        }
        prop_assert!(brake(higher, length, &limits) >= w * 0.999);
    }

    #[test]
    fn peak_is_safe_and_close(
        v0 in velocity(), part in 0f32..1.2, length in decades(-5.0, 3.5), rise in decades(-3.0, 3.0),
        limits in limits(),
    ) {
        // An end velocity that the length allows, mostly; then the other way round as well.
        let v1 = v0 + (reach(v0, length, &limits) - v0) * part;
        let cruise = v0.max(v1) * (1.0 + rise) + rise;
        for (a, b) in [(v0, v1), (v1, v0)] {
            let p = peak(a, b, length, cruise, &limits);
            let high = v0.max(v1);
            prop_assert!(p >= high && p <= cruise);
            if part > 0.999 {
                continue;
            }
            let both = |p: f64| exact_length(v0, p, &limits) + exact_length(v1, p, &limits);
            prop_assert!(both(f64::from(p)) <= f64::from(length) * (1.0 + 1e-5), "{p}");
            let best = bisect(f64::from(high), f64::from(length), both).min(f64::from(cruise));
            let lost = best - f64::from(p);
            prop_assert!(lost <= 6e-4 * (best - f64::from(high)) + 2e-5 * best, "{p} {best} {a} {b}");
        }
    }

    /// Nothing but numbers comes of anything finite.
    #[test]
    fn no_nan(
        v0 in any_size(), v1 in any_size(), length in any_size(), accel in any_size(), jerk in any_size(),
        part in -0.5f32..1.5,
    ) {
        let limits = Limits { accel, jerk };
        let ramp = Ramp::new(v0, v1, &limits);
        let t = ramp.time() * part;
        for x in [
            ramp.time(), ramp.length(), ramp.distance(t), ramp.remaining(t), ramp.velocity(t),
            reach(v0, length, &limits), peak(v0, v1, length, v0.max(v1) * 2.0 + 1.0, &limits),
        ] {
            prop_assert!(x.is_finite() && x >= -1e-3 * (v0 + v1), "{x} {ramp:?}");
        }
    }
}

/// Zero, tiny, huge.
fn any_size() -> impl Strategy<Value = f32> {
    prop_oneof![1 => Just(0.0), 5 => decades(-9.0, 6.0)]
}

/// With a jerk beyond reason the ramp is the trapezoid's.
#[test]
fn endless_jerk_is_a_trapezoid() {
    for jerk in [0.0, 1e20, 1e30, f32::MAX] {
        let limits = Limits { accel: 500.0, jerk };
        let ramp = Ramp::new(10.0, 60.0, &limits);
        assert_eq!(ramp.time(), 0.1);
        assert_eq!(ramp.length(), 3.5);
        assert!((reach(10.0, 3.5, &limits) - 60.0).abs() < 1e-3);
        assert!((peak(0.0, 10.0, 7.1, 1e3, &limits) - 60.0).abs() < 1e-3);
        assert!((ramp.distance(0.05) - (0.5 + 0.625)).abs() < 1e-6);
        assert!((ramp.velocity(0.05) - 35.0).abs() < 1e-5);
    }
}

/// The planner's side of the ring, oldest block first. Exec has committed itself to the entries of
/// the first `committed`.
struct Ring {
    blocks: Vec<Block>,
    committed: usize,
    changed: usize,
}

impl Queue for Ring {
    fn block(&self, back: usize) -> Option<&Block> {
        self.blocks.iter().rev().nth(back)
    }
    fn set_entry(&mut self, back: usize, velocity: f32) -> bool {
        let index = self.blocks.len() - 1 - back;
        if index < self.committed {
            return false;
        }
        self.changed += 1;
        self.blocks[index].entry = velocity;
        true
    }
}

impl Ring {
    /// What a pass over everything gives.
    fn full_pass(&self) -> Vec<f32> {
        let mut entries: Vec<f32> = self.blocks.iter().map(|block| block.entry).collect();
        let mut exit = 0.0;
        for index in (self.committed..self.blocks.len()).rev() {
            let block = &self.blocks[index];
            let limits = Limits { accel: block.accel, jerk: block.jerk };
            let entry = brake(exit, block.length, &limits).min(block.entry_max);
            entries[index] = if block.kind == Kind::Line { entry } else { 0.0 };
            exit = entries[index];
        }
        entries
    }

    /// Every block's entry velocity allows it to end at the next one's.
    fn is_feasible(&self) -> bool {
        self.blocks.iter().enumerate().all(|(index, block)| {
            let exit = self.blocks.get(index + 1).map_or(0.0, |next| next.entry);
            let limits = Limits { accel: block.accel, jerk: block.jerk };
            block.entry <= exit
                || exact_length(exit, f64::from(block.entry), &limits)
                    <= f64::from(block.length) * (1.0 + 1e-5)
        })
    }
}

fn any_block(accel: f32, jerk: f32) -> impl Strategy<Value = Block> {
    let line = (decades(-2.0, 1.5), velocity(), 0.5f32..2.0).prop_map(
        move |(length, entry_max, scale)| Block {
            length,
            cruise: entry_max,
            entry_max,
            // Whatever is there before the pass does not matter.
            entry: entry_max,
            accel: accel * scale,
            jerk: jerk * scale,
            ..Block::default()
        },
    );
    let dwell = Block { kind: Kind::Dwell, length: 1.0, entry_max: 1.0, ..Block::default() };
    prop_oneof![15 => line, 1 => Just(dwell)]
}

fn any_blocks() -> impl Strategy<Value = Vec<(Block, usize)>> {
    let limits = (prop_oneof![Just(0.0), decades(1.0, 3.5)], decades(1.0, 5.0));
    limits.prop_flat_map(|(accel, jerk)| {
        prop::collection::vec((any_block(accel, jerk), 0usize..3), 1..40)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// After every push, with exec taking blocks or not: as if everything had been planned anew.
    #[test]
    fn replan_is_a_full_pass(pushes in any_blocks(), commit in any::<bool>()) {
        let mut ring = Ring { blocks: vec![], committed: 0, changed: 0 };
        for (block, commits) in pushes {
            ring.blocks.push(block);
            replan(&mut ring);
            prop_assert_eq!(ring.blocks.iter().map(|b| b.entry).collect::<Vec<_>>(), ring.full_pass());
            prop_assert!(ring.is_feasible());
            if commit {
                ring.committed = (ring.committed + commits).min(ring.blocks.len());
            }
        }
    }
}

/// A long run at the same velocity costs one visit for each push.
#[test]
fn replan_stops_early() {
    let mut ring = Ring { blocks: vec![], committed: 0, changed: 0 };
    for _ in 0..100 {
        ring.blocks.push(Block {
            length: 10.0,
            cruise: 10.0,
            entry_max: 10.0,
            accel: 100.0,
            jerk: 1e4,
            ..Block::default()
        });
        replan(&mut ring);
    }
    assert_eq!(ring.changed, 100);
}

/// Limits as the configuration has them: mm/min, mm/min^2, mm/min^3.
#[derive(Debug, Clone)]
struct Config {
    velocity: [f32; AXES],
    feedrate: [f32; AXES],
    jerk: [f32; AXES],
    accel: [f32; AXES],
    motor_axis: [u8; MOTORS],
    steps_per_mm: [f64; MOTORS],
    max_step_rate: f32,
}

impl Machine for Config {
    fn velocity_max(&self, axis: usize) -> f32 {
        self.velocity[axis]
    }
    fn feedrate_max(&self, axis: usize) -> f32 {
        self.feedrate[axis]
    }
    fn jerk_max(&self, axis: usize) -> f32 {
        self.jerk[axis]
    }
    fn accel_max(&self, axis: usize) -> f32 {
        self.accel[axis]
    }
    fn junction_deviation(&self, _: usize) -> f32 {
        0.05
    }
    fn junction_acceleration(&self) -> f32 {
        100_000.0
    }
    fn motor_axis(&self, motor: usize) -> u8 {
        self.motor_axis[motor]
    }
    fn steps(&self, motor: usize, position: Length) -> i32 {
        (f64::from(position.0) * 1e-4 * self.steps_per_mm[motor]).round() as i32
    }
    fn max_step_rate(&self) -> f32 {
        self.max_step_rate
    }
}

/// TinyG's default X axis on all axes.
fn tinyg() -> Config {
    Config {
        velocity: [800.0; AXES],
        feedrate: [800.0; AXES],
        jerk: [2e7; AXES],
        accel: [0.0; AXES],
        motor_axis: [0, 1, 2, 3],
        steps_per_mm: [1280.0; MOTORS],
        max_step_rate: 1e6,
    }
}

prop_compose! {
    fn any_config()(
        velocity in prop::array::uniform6(decades(2.0, 4.5)),
        feedrate in prop::array::uniform6(decades(2.0, 4.5)),
        jerk in prop::array::uniform6(prop_oneof![4 => decades(6.0, 10.0), 1 => Just(0.0)]),
        accel in prop::array::uniform6(prop_oneof![decades(5.0, 7.5), Just(0.0)]),
        motor_axis in prop::array::uniform4(0u8..7),
        steps_per_mm in prop::array::uniform4(1f64..2000.0),
        max_step_rate in decades(3.5, 5.0),
    ) -> Config {
        Config { velocity, feedrate, jerk, accel, motor_axis, steps_per_mm, max_step_rate }
    }
}

/// Moves of one to six axes, from a tenth of a micrometre to metres, and their feeds.
fn any_moves() -> impl Strategy<Value = Vec<(PerAxis<Length>, Option<Feed>)>> {
    let travel = prop_oneof![
        4 => Just(0),
        3 => -2000i32..2000,
        2 => -20_000_000i32..20_000_000,
        1 => -1i32..=1,
    ];
    let feed = prop_oneof![
        Just(None),
        decades(-1.0, 5.0).prop_map(|f| Some(Feed::PerMinute(f))),
        decades(-4.0, 1.0).prop_map(|t| Some(Feed::Minutes(t))),
    ];
    let to = prop::array::uniform6(travel).prop_map(|to| to.map(Length));
    prop::collection::vec((to, feed), 1..20)
}

fn travel(from: &PerAxis<Length>, to: &PerAxis<Length>) -> [f64; AXES] {
    std::array::from_fn(|axis| f64::from(to[axis].0 - from[axis].0) * 1e-4)
}

fn norm(travel: &[f64]) -> f64 {
    travel.iter().map(|d| d * d).sum::<f64>().sqrt()
}

/// No limit of an axis, a motor or the feed is exceeded; and some limit is the reason for each.
fn check_limits(block: &Block, travel: &[f64; AXES], feed: Option<Feed>, config: &Config) {
    let linear = norm(&travel[..FIRST_ROTARY]);
    let length = if linear > 0.0 { linear } else { norm(&travel[FIRST_ROTARY..]) };
    assert!(near(f64::from(block.length), length, 1e-6, 0.0));
    let most = block.steps.map(i32::unsigned_abs).into_iter().max().unwrap();
    let mut cruise = if most > 0 {
        f64::from(config.max_step_rate) * length / f64::from(most)
    } else {
        f64::INFINITY
    };
    match feed {
        Some(Feed::PerMinute(feed)) => cruise = cruise.min(f64::from(feed) / 60.0),
        Some(Feed::Minutes(time)) => cruise = cruise.min(length / f64::from(time) / 60.0),
        None => {}
    }
    let (mut accel, mut jerk) = (f64::INFINITY, f64::INFINITY);
    let limit = |value: f32| if value > 0.0 { f64::from(value) } else { f64::INFINITY };
    for (axis, distance) in travel.iter().enumerate() {
        let part = distance.abs() / length;
        let velocity = if feed.is_some() { config.feedrate[axis] } else { config.velocity[axis] };
        cruise = cruise.min(limit(velocity) / 60.0 / part);
        accel = accel.min(limit(config.accel[axis]) / 3.6e3 / part);
        jerk = jerk.min(limit(config.jerk[axis]) / 2.16e5 / part);
    }
    assert!(near(f64::from(block.cruise), cruise, 1e-5, 0.0), "{} {cruise}", block.cruise);
    let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
    assert!(near(f64::from(block.accel), finite(accel), 1e-5, 0.0));
    assert!(near(f64::from(block.jerk), finite(jerk), 1e-5, 0.0));
    assert!(block.entry_max <= block.cruise);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn builder_keeps_limits_and_steps(config in any_config(), moves in any_moves()) {
        let mut builder = Builder::default();
        let mut at = [Length::ZERO; AXES];
        let mut motors = [0; MOTORS];
        let mut cruise = 0.0;
        for (to, feed) in moves {
            let block = builder.line(&Line { from: &at, to: &to, feed, line: 7 }, &config);
            prop_assert_eq!(block.is_none(), at == to);
            if let Some(block) = block {
                check_limits(&block, &travel(&at, &to), feed, &config);
                prop_assert!(block.entry_max <= cruise && block.entry == 0.0 && block.line == 7);
                cruise = block.cruise;
                for (motor, steps) in block.steps.iter().enumerate() {
                    motors[motor] += steps;
                }
            }
            at = to;
            for (motor, &axis) in config.motor_axis.iter().enumerate() {
                let position = at.get(usize::from(axis));
                let steps = position.map_or(0, |&position| config.steps(motor, position));
                prop_assert_eq!(motors[motor], steps);
            }
        }
    }

    /// Splitting a line makes no corners.
    #[test]
    fn junction_of_a_split_line_is_free(
        x in -2_000_000i32..2_000_000, y in -2_000_000i32..2_000_000, z in -2_000_000i32..2_000_000,
        parts in 2i32..50,
    ) {
        // Long enough for the positions' unit not to matter.
        prop_assume!(x.abs().max(y.abs()).max(z.abs()) > 2_000 * parts);
        let config = tinyg();
        let mut builder = Builder::default();
        let mut from = [Length::ZERO; AXES];
        for part in 1..=parts {
            let share = |d: i32| Length((i64::from(d) * i64::from(part) / i64::from(parts)) as i32);
            let to = [share(x), share(y), share(z), Length::ZERO, Length::ZERO, Length::ZERO];
            let block = builder.line(&Line { from: &from, to: &to, feed: None, line: 0 }, &config).unwrap();
            prop_assert!(part == 1 || block.entry_max > 0.99 * block.cruise);
            from = to;
        }
    }
}

/// The table of junction velocities for an XY corner: change of direction in degrees, mm/min.
#[test]
fn junction_velocities() {
    let heading = |degrees: f64| {
        let (y, x) = degrees.to_radians().sin_cos();
        Heading::new([x as f32, y as f32, 0.0, 0.0, 0.0, 0.0], |_| 0.05)
    };
    for start in [0.0, 30.0, 200.0] {
        let corner = |angle: f64| {
            60.0 * junction::limit(&heading(start), &heading(start + angle), 1e5 / 3600.0)
        };
        for (angle, velocity) in [
            (10.0, 1144.10),
            (15.0, 761.21),
            (30.0, 376.48),
            (45.0, 246.34),
            (60.0, 179.78),
            (90.0, 109.87),
            (120.0, 70.71),
            (135.0, 55.67),
            (150.0, 41.79),
            (170.0, 21.85),
        ] {
            let limit = corner(angle);
            assert!(
                (limit - velocity).abs() < 5e-5 * velocity + 0.006,
                "{angle}: {limit} {velocity}"
            );
            assert!((corner(-angle) / limit - 1.0).abs() < 1e-4);
        }
        assert!(corner(0.0) > 1e30);
        assert_eq!(corner(180.0), 0.0);
        assert!(corner(1.0) > 10_000.0 && corner(179.0) < 7.0);
    }
}

/// Moves from rest to rest on TinyG's default X axis: length, feed, cruise mm/min, seconds.
#[test]
fn moves_from_rest_to_rest() {
    let config = tinyg();
    for (mm, feed, cruise, seconds) in [
        (10.0, None, 793.701, 1.5119),
        (100.0, None, 800.0, 8.2589),
        (1.0, None, 170.998, 0.7018),
        (0.1, Some(1000.0), 36.840, 0.3257),
        (0.01, Some(1000.0), 7.937, 0.1512),
        (20.0, Some(600.0), 600.0, 2.6573),
        (5.0, Some(300.0), 300.0, 1.4648),
    ] {
        let mut to = [Length::ZERO; AXES];
        to[0] = Length((mm * 10_000.0) as i32);
        let feed = feed.map(Feed::PerMinute);
        let from = [Length::ZERO; AXES];
        let block = Builder::default().line(&Line { from: &from, to: &to, feed, line: 0 }, &config);
        let block = block.unwrap();
        let limits = Limits { accel: block.accel, jerk: block.jerk };
        let p = peak(0.0, 0.0, block.length, block.cruise, &limits);
        assert!((60.0 * p / cruise - 1.0).abs() < 6e-4, "{mm}: {p}");
        let ramp = Ramp::new(0.0, p, &limits);
        let time = 2.0 * ramp.time() + (block.length - 2.0 * ramp.length()) / p;
        assert!((time / seconds - 1.0).abs() < 1e-3, "{mm}: {time}");
    }
}

/// Dwell, set position and stops are entered and left at rest.
#[test]
fn stops() {
    let config = tinyg();
    let mut builder = Builder::default();
    let mut position = [Length::ZERO; AXES];
    let mut x10 = |builder: &mut Builder| {
        let from = position;
        position[0] = Length(position[0].0 + 100_000);
        builder.line(&Line { from: &from, to: &position, feed: None, line: 0 }, &config).unwrap()
    };
    assert_eq!(x10(&mut builder).entry_max, 0.0);
    assert!(x10(&mut builder).entry_max > 13.0);
    let dwell = builder.dwell(1500, 3);
    assert_eq!(
        (dwell.kind, dwell.steps[0], dwell.entry_max, dwell.line),
        (Kind::Dwell, 1500, 0.0, 3)
    );
    assert_eq!(x10(&mut builder).entry_max, 0.0);
    builder.stopped();
    assert_eq!(x10(&mut builder).entry_max, 0.0);
    assert_eq!(builder.stop(Kind::ProgramEnd, 4).kind, Kind::ProgramEnd);
    assert_eq!(x10(&mut builder).entry_max, 0.0);
    let mut here = [Length::ZERO; AXES];
    here[0] = Length(10_000);
    let block = builder.set_position(&here, 5, &config);
    assert_eq!((block.kind, block.steps), (Kind::SetPosition, [1280, 0, 0, 0]));
    let from = here;
    here[0] = Length(20_000);
    let line = Line { from: &from, to: &here, feed: None, line: 0 };
    let block = builder.line(&line, &config).unwrap();
    assert_eq!((block.steps, block.entry_max), ([1280, 0, 0, 0], 0.0));
}
