//! From moves to blocks: limits of axes, motors and feed, corners, and steps, compared with f64.

use kerf::boards::MOTORS;
use kerf::config::StepRatio;
use kerf::gcode::command::Feed;
use kerf::motion::block::{Line as Move, QueuedAction};
use kerf::motion::dynamics::Dynamics;
use kerf::motion::exec::BLOCK_S_MIN;
use kerf::motion::factors::Factors;
use kerf::motion::junction::{self, Heading, ONE, Velocities};
use kerf::motion::line::STEPS_MAX;
use kerf::motion::line::{Builder, Built, Line};
use kerf::motion::short::Short;
use kerf::units::{AXES, FIRST_ROTARY, Length, PerAxis};
use proptest::prelude::*;
use proptest::sample::select;

use crate::rig::{CORE_XY, Config, STRAIGHT, at};

/// Limits are stored in two bytes, rounded down by at most this share.
const SHORT: f64 = 1.0 / 256.0;

/// Directions have 14 bits.
const EXACT: f64 = 1.0005;

/// Returns the block of a move; there must be one.
fn built(
    builder: &mut Builder,
    config: &Config,
    ends: [PerAxis<Length>; 2],
    feed: Option<Feed>,
) -> (Move, f32) {
    let line =
        Line { from: &ends[0], to: &ends[1], feed, curve: None, may_merge: false, blends: false };
    let mut block = Move::default();
    match builder.line(&line, &Dynamics::new(config), config, &mut block) {
        Built::Line(entry) => (block, entry),
        other => panic!("{other:?}"),
    }
}

fn decades(low: f32, high: f32) -> impl Strategy<Value = f32> {
    (0u16..=10_000).prop_map(move |n| low * (high / low).powf(f32::from(n) * 1e-4))
}

prop_compose! {
    fn any_config()(
        velocity in prop::array::uniform6(decades(1.0, 500.0)),
        accel in prop::array::uniform6(prop_oneof![decades(10.0, 1e4), Just(0.0)]),
        jerk in prop::array::uniform6(prop_oneof![3 => decades(1e3, 1e8), 2 => Just(0.0)]),
        sharp in any::<bool>(),
        den in prop::array::uniform4(5u32..10_000),
        drives in select(vec![STRAIGHT, CORE_XY]),
    ) -> Config {
        let ratio = den.map(|den| StepRatio { num: 1, den });
        let jerk = if sharp { [0.0; AXES] } else { jerk };
        Config { velocity, accel, jerk, ratio, drives, ..Config::new(1.0, 1.0, 1.0) }
    }
}

/// Moves of one to six axes, from a tenth of a micrometre to metres, and their feeds.
fn any_moves() -> impl Strategy<Value = Vec<(PerAxis<Length>, Option<Feed>)>> {
    let place = prop_oneof![
        4 => Just(0),
        3 => -2000i32..2000,
        2 => -20_000_000i32..20_000_000,
        1 => -1i32..=1,
    ];
    let feed = prop_oneof![
        Just(None),
        decades(0.1, 1e5).prop_map(|f| Some(Feed::PerMinute(f))),
        decades(1e-4, 10.0).prop_map(|t| Some(Feed::Minutes(t))),
    ];
    prop::collection::vec((prop::array::uniform6(place).prop_map(|to| to.map(Length)), feed), 1..20)
}

/// Returns how far each axis moves for a unit of path length, and the path length, mm.
fn unit(from: &PerAxis<Length>, to: &PerAxis<Length>) -> (PerAxis<f64>, f64) {
    let way: PerAxis<f64> =
        std::array::from_fn(|axis| (f64::from(to[axis].0) - f64::from(from[axis].0)) * 1e-4);
    let norm = |way: &[f64]| way.iter().map(|d| d * d).sum::<f64>().sqrt();
    let length = norm(&way[..FIRST_ROTARY]).max(norm(&way[FIRST_ROTARY..]));
    (way.map(|d| d.abs() / length), length)
}

/// Checks that no limit of an axis or of the feed is exceeded, and that some limit is the reason for the velocity.
fn check_limits(
    block: &Move,
    unit: &PerAxis<f64>,
    length: f64,
    feed: Option<Feed>,
    config: &Config,
) {
    assert!((f64::from(block.extent.length()) / length - 1.0).abs() < 2e-4);
    let mut cruise = match feed {
        Some(Feed::PerMinute(feed)) => {
            let linear = unit[..FIRST_ROTARY].iter().map(|u| u * u).sum::<f64>().sqrt();
            f64::from(feed) / 60.0 / if linear > 0.0 { linear } else { 1.0 }
        }
        Some(Feed::Minutes(time)) => length / f64::from(time) / 60.0,
        None => f64::INFINITY,
    };
    let accel = f64::from(block.accel.get());
    let mut least = f64::INFINITY;
    let mut slowest = cruise;
    for axis in (0..AXES).filter(|&axis| unit[axis] > 0.0) {
        cruise = cruise.min(f64::from(config.velocity[axis]) / unit[axis]);
        let rounded = unit[axis] + 3.0 / f64::from(ONE);
        slowest = slowest.min(f64::from(config.velocity[axis]) / rounded);
        let most = f64::from(config.accel[axis]);
        if most > 0.0 {
            assert!(accel * unit[axis] <= most * EXACT, "axis {axis}: {accel} of {most}");
            // Components of a direction are rounded up.
            least = least.min(most / (unit[axis] + 3.0 / f64::from(ONE)));
        }
    }
    let limited = config.jerk.iter().any(|jerk| *jerk > 0.0);
    if !limited && least.is_finite() {
        assert!(accel >= least.min(1e6) * (1.0 - 2.5 * SHORT), "{accel} of {least} mm/s^2");
    }
    // The lowest velocity there is.
    let cruise = cruise.max(1e-6);
    let got = f64::from(block.cruise);
    assert!(got <= cruise * EXACT, "{got} of {cruise} mm/s");
    // A block is slower only because of its motors, or because it is too short for exec.
    let least = if block.extent.has_whole_steps() { 1 } else { 8 };
    let moves = block.way.iter().any(|&way| way.unsigned_abs() >= least);
    let shortest = length / f64::from(BLOCK_S_MIN);
    let slow = moves || shortest < slowest.max(1e-6);
    assert!(slow || got >= slowest.max(1e-6) * (2.0 - EXACT), "{got} of {cruise} mm/s");
    assert!(got <= shortest * EXACT);
    check_override(block, unit, feed.is_some(), config, shortest);
}

/// Checks the velocity under an override: the commanded velocity times the factor, as far as the axes allow.
fn check_override(block: &Move, unit: &PerAxis<f64>, is_feed: bool, config: &Config, most: f64) {
    let doubled = f64::from(block.velocity(&Factors { feed: 2.0, traverse: 1.0 }));
    let axes = (0..AXES).filter(|&axis| unit[axis] > 0.0);
    let most = axes.map(|axis| f64::from(config.velocity[axis]) / unit[axis]).fold(most, f64::min);
    let asked = f64::from(block.cruise) * if is_feed { 2.0 } else { 1.0 };
    assert!(doubled <= most.max(1e-6) * EXACT && doubled <= asked, "{doubled} of {most} mm/s");
    let halved = f64::from(block.velocity(&Factors { feed: 0.5, traverse: 0.5 }));
    assert_eq!(halved, f64::from(block.cruise) / 2.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// No motor exceeds its step rate under any override. A limit that applies only because of an override is at most
    /// a seventh below it.
    #[test]
    fn overrides_keep_step_rates(
        config in any_config(), x in 0.02f64..300.0, y in -100f64..100.0, feed in 1e2f32..1e6,
    ) {
        let mut wide = config.clone();
        wide.velocity = [1e6; AXES];
        let dynamics = Dynamics::new(&wide);
        let (from, to) = (at([0.0]), at([x, y]));
        let asked_for = Some(Feed::PerMinute(feed));
        let line = Line { from: &from, to: &to, feed: asked_for, curve: None, may_merge: false, blends: false };
        let mut block = Move::default();
        let Built::Line(_) = Builder::default().line(&line, &dynamics, &wide, &mut block) else {
            return Ok(());
        };
        let whole = block.extent.has_whole_steps();
        let moving = block.way.iter().filter(|way| **way != 0).count();
        let most = block.way.iter().map(|way| way.unsigned_abs()).max().unwrap();
        prop_assume!(most >= 8);
        let steps = f64::from(most) / if whole { 1.0 } else { 16.0 };
        let rate = f64::from(dynamics.rates[moving - 1]) * if whole { 1.0 } else { 0.625 };
        let length = f64::from(block.extent.length());
        let limit = rate * length / steps;
        let doubled = f64::from(block.velocity(&Factors { feed: 2.0, traverse: 1.0 }));
        prop_assert!(doubled <= limit * (1.0 + 1e-5), "{doubled} of {limit} mm/s");
        let asked = (f64::from(feed) / 30.0).min(length / f64::from(BLOCK_S_MIN));
        prop_assert!(doubled >= 0.85 * asked.min(limit), "{doubled} of {asked}, {limit} mm/s");
        let cruise = f64::from(block.cruise);
        let slow = (asked / 2.0).min(limit).min(length / f64::from(BLOCK_S_MIN));
        prop_assert!(cruise >= slow * 0.999, "{cruise} of {slow} mm/s");
    }

    /// Limits are kept, and steps are the difference of exact positions.
    #[test]
    fn builder_keeps_limits_and_steps(
        config in any_config(), moves in any_moves(), may_merge in any::<bool>(),
    ) {
        let dynamics = Dynamics::new(&config);
        let mut builder = Builder::default();
        let mut from = at([0.0]);
        let (mut motors, mut places) = ([0i64; MOTORS], [0i64; MOTORS]);
        let mut began = false;
        for (to, feed) in moves {
            let line = Line { from: &from, to: &to, feed, curve: None, may_merge, blends: false };
            let mut block = Move::default();
            match builder.line(&line, &dynamics, &config, &mut block) {
                Built::Nothing => prop_assert_eq!(from, to),
                Built::Blended(_) => prop_assert!(false, "nothing blends"),
                // The state of the builder has not changed: the next move begins where this one did.
                Built::Merge => {
                    prop_assert!(may_merge);
                    for (m, at) in motors.iter().enumerate() {
                        prop_assert!((i64::from(config.steps(m, &to)) - at).abs() <= 1);
                    }
                    continue;
                }
                // The state of the builder has not changed.
                Built::Parts(parts) => {
                    let steps =
                        |m: usize| (i64::from(config.steps(m, &to)) - motors[m]).unsigned_abs();
                    let most = (0..MOTORS).map(steps).max().unwrap();
                    let long = Some(most).filter(|&steps| steps > STEPS_MAX.into());
                    let far = (0..AXES).any(|axis| to[axis].checked_sub(from[axis]).is_none());
                    prop_assert!(parts > 1 && (far || long.is_some()));
                    if far {
                        continue;
                    }
                    let room = u64::from(parts) * u64::from(STEPS_MAX);
                    prop_assert!(room >= long.unwrap() || parts == u16::MAX);
                    continue;
                }
                Built::Line(entry) => {
                    let (unit, length) = unit(&from, &to);
                    // The moves before this one slow it down only where they are parts of a curve.
                    let mut alone = Builder::default();
                    let _ = alone.set_position(&from, &config);
                    let (alone, _) = built(&mut alone, &config, [from, to], feed);
                    check_limits(&alone, &unit, length, feed, &config);
                    // A block that begins between two steps may be half a step shorter, and components are rounded.
                    let most = block.way.iter().map(|way| way.unsigned_abs()).max().unwrap();
                    let spare = 1.0 + 10.0 / f32::from(most.max(1));
                    prop_assert!(block.cruise <= alone.cruise * spare);
                    prop_assert_eq!(block.accel, alone.accel);
                    prop_assert!(began || entry == 0.0);
                    began = true;
                    for m in 0..MOTORS {
                        let parts = if block.extent.has_whole_steps() { 16 } else { 1 };
                        places[m] += i64::from(block.way[m]) * parts;
                        motors[m] = (places[m] + 8).div_euclid(16);
                        prop_assert_eq!(motors[m], i64::from(config.steps(m, &to)));
                    }
                }
            }
            from = to;
        }
    }

    /// Splitting a line makes no corners.
    #[test]
    fn junction_of_a_split_line_is_free(
        way in prop::array::uniform3(-2_000_000i32..2_000_000), parts in 2i32..50,
    ) {
        // The line is long enough that the unit of positions does not matter.
        prop_assume!(way.iter().any(|d| d.abs() > 2_000 * parts));
        let config = Config::new(10.0, 500.0, 0.0);
        let mut builder = Builder::default();
        let mut from = at([0.0]);
        for part in 1..=parts {
            let share = |d: i32| Length((i64::from(d) * i64::from(part) / i64::from(parts)) as i32);
            let mut to = from;
            for axis in 0..3 {
                to[axis] = share(way[axis]);
            }
            let (block, entry) = built(&mut builder, &config, [from, to], None);
            prop_assert!(part == 1 || entry > 0.99 * block.cruise);
            from = to;
        }
    }
}

proptest! {
    /// From the third on, short lines on a circle keep to the limits of the axes on a curve, within a factor of 1.5.
    #[test]
    fn short_lines_on_a_curve_keep_to_its_limits(
        radius in decades(0.2, 30.0), chord in decades(0.02, 1.0), accel in decades(50.0, 5e3),
        jerk in prop_oneof![Just(0.0), decades(1e3, 1e6)], start in 0.0..6.3f64, feed in decades(60.0, 2e4),
    ) {
        // Chords this long compared with the radius make a polygon.
        prop_assume!(chord < 0.6 * radius);
        // A chord must differ from a straight line by more than three decimals can express.
        prop_assume!(chord * chord > 1.2e-3 * radius);
        let config = Config { deviation: 0.1, junction: accel, ..Config::new(500.0, accel, jerk) };
        let mut builder = Builder::default();
        let mut from = at([0.0]);
        for n in 0..30 {
            let angle = start + f64::from(n) * f64::from(chord / radius);
            let point = [angle.cos(), angle.sin()].map(|u| u * f64::from(radius));
            let to = at(point);
            let (block, _) = built(&mut builder, &config, [from, to], Some(Feed::PerMinute(feed)));
            from = to;
            if n < 4 {
                continue;
            }
            let (v, r) = (f64::from(block.velocity(&Factors { feed: 2.0, traverse: 1.0 })), f64::from(radius));
            prop_assert!(v * v / r <= 1.5 * f64::from(accel), "{v} mm/s: {} of {accel} mm/s^2", v * v / r);
            let most = if jerk > 0.0 { 1.5 * f64::from(jerk) } else { f64::MAX };
            prop_assert!(v.powi(3) / r.powi(2) <= most, "{v} mm/s: {} of {jerk} mm/s^3", v.powi(3) / r.powi(2));
            // They are not slower than necessary either.
            let (accel, jerk) = (f64::from(accel), if jerk > 0.0 { f64::from(jerk) } else { f64::MAX });
            let best = (accel * r).sqrt().min((jerk * r * r).cbrt()).min(f64::from(feed) / 30.0).min(500.0);
            let best = best.min(f64::from(block.extent.length()) / f64::from(BLOCK_S_MIN));
            prop_assert!(v > 0.8 * best, "{v} of {best} mm/s");
        }
    }

    /// A corner between long lines is no curve, nor is a corner with a chamfer.
    #[test]
    fn a_corner_is_no_curve(angle in 0.01..3.0f64, side in 5.0..50.0f64, chamfer in 0.05..1.5f64) {
        let config = Config::new(500.0, 500.0, 0.0);
        let end = [side + side * angle.cos(), side * angle.sin()];
        let (half, beyond) = (angle / 2.0, side + chamfer);
        let cut = [side + chamfer * half.cos(), chamfer * half.sin()];
        let last = [cut[0] + beyond * angle.cos(), cut[1] + beyond * angle.sin()];
        for path in [vec![[side, 0.0], end], vec![[side, 0.0], cut, last]] {
            let mut builder = Builder::default();
            let mut from = at([0.0]);
            for to in path.into_iter().map(at) {
                let (block, _) = built(&mut builder, &config, [from, to], Some(Feed::PerMinute(3000.0)));
                prop_assert!((block.cruise - 50.0).abs() < 1e-3);
                from = to;
            }
        }
    }
}

/// The velocities of an XY corner, by change of direction in degrees, mm/min: deviation 0.05 mm, junction
/// acceleration 100,000 mm/min^2.
#[test]
fn junction_velocities() {
    let mut config = Config::new(1e4, 500.0, 0.0);
    config.deviation = 0.05;
    let heading = |degrees: f64| {
        let (y, x) = degrees.to_radians().sin_cos();
        let unit = [x, y, 0.0, 0.0, 0.0, 0.0].map(|u| (u * f64::from(ONE)).round() as i16);
        Heading { unit, deviation: Short::new(config.deviation) }
    };
    for start in [0.0, 30.0, 200.0] {
        let corner = |angle: f64| {
            let (a, b) = (heading(start), heading(start + angle));
            let velocities = Velocities { cruise: 1e9, top: 1e9 };
            let turned = junction::turn(&a.unit, &b.unit);
            let deviations = (a.deviation, b.deviation);
            60.0 * junction::limit(turned, deviations, 1e5 / 3600.0, &velocities)
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
            // The deviation is stored in two bytes.
            assert!(
                limit <= velocity * 1.001 && limit >= velocity * (0.999 - SHORT as f32),
                "{angle}: {limit}"
            );
            assert!((corner(-angle) / limit - 1.0).abs() < 2e-3);
        }
        assert!(corner(0.0) > 1e30);
        assert_eq!(corner(180.0), 0.0);
        assert!(corner(1.0) > 10_000.0 && corner(179.0) < 7.0);
    }
}

/// A rotary-only move is measured in degrees; with a linear axis, the longer one counts.
#[test]
fn rotary_moves() {
    let mut config = Config::new(100.0, 500.0, 0.0);
    config.velocity[3] = 360.0;
    let zero = at([0.0]);
    let turned = at([0.0, 0.0, 0.0, 90.0]);
    let (block, _) = built(&mut Builder::default(), &config, [zero, turned], None);
    assert_eq!(block.extent.length(), 90.0);
    assert!((block.cruise - 360.0).abs() < 1e-3, "{}", block.cruise);
    let both = at([9.0, 0.0, 0.0, 90.0]);
    let (block, _) = built(&mut Builder::default(), &config, [zero, both], None);
    assert!((block.extent.length() - 90.0).abs() < 0.01, "{}", block.extent.length());
    assert!((block.cruise - 360.0).abs() < 0.05, "{}", block.cruise);
    // The feed is the feed of the linear axis.
    let feed = Some(Feed::PerMinute(60.0));
    let (block, _) = built(&mut Builder::default(), &config, [zero, both], feed);
    assert!((block.cruise - 10.0).abs() < 0.01, "{}", block.cruise);
}

/// Stops and set positions leave the builder at rest, and the next move begins there.
#[test]
fn stops() {
    let config = Config::new(100.0, 500.0, 0.0);
    let mut builder = Builder::default();
    let mut x = 0.0;
    let mut next = |builder: &mut Builder, from: Option<f64>| {
        x = from.unwrap_or(x);
        let ends = [at([x]), at([x + 10.0])];
        x += 10.0;
        built(builder, &config, ends, None)
    };
    assert_eq!(next(&mut builder, None).1, 0.0);
    let (block, entry) = next(&mut builder, None);
    assert!(entry > block.cruise && (block.cruise - 100.0).abs() < 1e-3, "{entry}");
    assert_eq!(builder.pause(QueuedAction::Dwell(1500), 3).line(), 3);
    assert_eq!(next(&mut builder, None).1, 0.0);
    builder.stopped();
    assert_eq!(next(&mut builder, None).1, 0.0);
    let body = builder.set_position(&at([1.0]), &config);
    assert!(matches!(body, QueuedAction::SetPosition([80, 0, 0, 0])), "{body:?}");
    let (block, entry) = next(&mut builder, Some(1.0));
    assert_eq!((block.way, entry), ([800 * 16, 0, 0, 0], 0.0));
}
