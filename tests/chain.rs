//! Merging of lines: whatever a program draws, the path that is driven and the path that is programmed are no further
//! apart than the tolerance.

use kerf::gcode::command::Feed;
use kerf::motion::chain::{Chain, TIME_MS};
use kerf::units::{Length, PerAxis};
use proptest::prelude::*;

type Place = PerAxis<Length>;

/// Merges the lines. Returns each straight move as the indices of the points where it begins and ends.
fn merged(points: &[Place], feed: f32, blend: u8) -> Vec<(usize, usize)> {
    let feed = Feed::PerMinute(feed);
    let (mut chain, mut ways, mut start) = (Chain::default(), Vec::new(), 0);
    let mut waits = false;
    for to in 1..points.len() {
        if waits {
            if chain.go_on(&points[start], &points[to], Some(&feed), blend) {
                assert_eq!(chain.end(&points[start]), points[to]);
                continue;
            }
            ways.push((start, to - 1));
        }
        start = to - 1;
        waits = chain.begin(&points[start], &points[to], Some(&feed), blend);
        if !waits {
            ways.push((start, to));
        }
    }
    if waits {
        ways.push((start, points.len() - 1));
    }
    ways
}

fn place(point: &Place) -> [f64; 3] {
    [0, 1, 2].map(|axis| f64::from(point[axis].0))
}

/// Distance of a point from the straight line between two others.
fn distance(point: [f64; 3], from: [f64; 3], to: [f64; 3]) -> f64 {
    let way = [0, 1, 2].map(|i| to[i] - from[i]);
    let off = [0, 1, 2].map(|i| point[i] - from[i]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let square = dot(way, way);
    let share = if square > 0.0 { (dot(off, way) / square).clamp(0.0, 1.0) } else { 0.0 };
    let rest = [0, 1, 2].map(|i| off[i] - share * way[i]);
    dot(rest, rest).sqrt()
}

/// Returns how far two paths are apart: the largest distance of a point of the drawn path from the straight one, and
/// the other way round.
fn apart(points: &[Place], (from, to): (usize, usize)) -> f64 {
    const PARTS: usize = 16;
    let (start, end) = (place(&points[from]), place(&points[to]));
    let between = |a: [f64; 3], b: [f64; 3], n: usize| {
        [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * n as f64 / PARTS as f64)
    };
    let lines: Vec<_> =
        points[from..=to].windows(2).map(|p| (place(&p[0]), place(&p[1]))).collect();
    let there = lines.iter().flat_map(|(a, b)| (0..=PARTS).map(|n| between(*a, *b, n)));
    let far = there.map(|point| distance(point, start, end)).fold(0.0, f64::max);
    let back = (0..=PARTS).map(|n| {
        let point = between(start, end, n);
        lines.iter().map(|(a, b)| distance(point, *a, *b)).fold(f64::MAX, f64::min)
    });
    back.fold(far, f64::max)
}

/// Curves of lines: some even, as chords of a circle, some that turn at random, some straight except for rounding.
fn curve() -> impl Strategy<Value = Vec<Place>> {
    let turns = prop_oneof![Just(0.0f64), -0.02..0.02f64, -0.3..0.3f64];
    let piece = (turns, 0.0..0.02f64, 1..3_000i32, 1..30usize, -0.2..0.2f64);
    let start = (0.0..7.0f64, -1_000_000..1_000_000i32, -0.5..0.5f64);
    (start, prop::collection::vec(piece, 1..8)).prop_map(|((angle, start, slope), pieces)| {
        let (mut at, mut angle) = ([f64::from(start); 3], angle);
        let mut points = vec![rounded(at)];
        for (turn, noise, length, count, climb) in pieces {
            for n in 0..count {
                angle += turn + if n % 2 == 0 { noise } else { -noise };
                let length = f64::from(length);
                at[0] += length * angle.cos();
                at[1] += length * angle.sin();
                at[2] += if climb.abs() < 0.05 { 0.0 } else { length * (climb + 0.1 * slope) };
                points.push(rounded(at));
            }
        }
        points
    })
}

fn rounded(at: [f64; 3]) -> Place {
    let mut place = Place::default();
    for (axis, value) in at.iter().enumerate() {
        place[axis] = Length(value.round() as i32);
    }
    place
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn no_path_is_left_by_more_than_the_tolerance(
        points in curve(), turn in 0..3usize, feed in 50f32..60_000.0, tolerance in 0u8..=254,
    ) {
        let points: Vec<Place> = points.into_iter().map(|mut at| {
            at[..3].rotate_right(turn);
            at
        }).collect();
        let ways = merged(&points, feed, tolerance + 1);
        // The moves follow each other and cover the whole path.
        prop_assert_eq!((ways[0].0, ways[ways.len() - 1].1), (0, points.len() - 1));
        prop_assert!(ways.windows(2).all(|pair| pair[0].1 == pair[1].0));
        for way in ways {
            let far = apart(&points, way);
            prop_assert!(far <= f64::from(tolerance) + 1e-6, "{far} over {way:?}");
            if way.1 - way.0 > 1 {
                let [from, to] = [way.0, way.1].map(|n| place(&points[n]));
                let dominant = [0, 1, 2].map(|i| (to[i] - from[i]).abs()).into_iter().fold(0.0, f64::max);
                prop_assert!(dominant <= f64::from(feed) / 6.0 * f64::from(TIME_MS) + 1.0);
            }
        }
    }

    #[test]
    fn what_lies_on_a_line_is_merged_whatever_the_tolerance(
        way in prop::array::uniform3(-80..80i32), times in prop::collection::vec(1..20i32, 2..12), tolerance in 0u8..=254,
    ) {
        prop_assume!(way.iter().any(|way| *way != 0));
        let (mut at, mut points) = (Place::default(), vec![Place::default()]);
        for times in times {
            (0..3).for_each(|axis| at[axis].0 += way[axis] * times);
            points.push(at);
        }
        prop_assert_eq!(merged(&points, 60_000.0, tolerance + 1), [(0, points.len() - 1)]);
    }
}

fn at(x: i32, y: i32) -> Place {
    let mut place = Place::default();
    (place[0], place[1]) = (Length(x), Length(y));
    place
}

#[test]
fn nothing_is_merged_that_must_not_be() {
    let (from, first, second) = (at(0, 0), at(1_000, 0), at(2_000, 0));
    let feed = Feed::PerMinute(6_000.0);
    let mut chain = Chain::default();
    let mut begins = |to: &Place, feed, blend| chain.begin(&from, to, feed, blend);
    assert!(begins(&first, Some(&feed), 11));
    // No merging with G61, for traverses, in inverse time mode, and for moves that take too long or have no length.
    assert!(!begins(&first, Some(&feed), 0));
    assert!(!begins(&first, None, 11));
    assert!(!begins(&first, Some(&Feed::Minutes(0.1)), 11));
    assert!(!begins(&at(12_000, 0), Some(&feed), 11));
    assert!(!begins(&from, Some(&feed), 11));
    let mut turning = first;
    turning[3] = Length(1);
    assert!(!begins(&turning, Some(&feed), 11));

    let goes_on = |to: &Place, feed: Option<&Feed>, blend| {
        let mut chain = Chain::default();
        assert!(chain.begin(&from, &first, Some(&Feed::PerMinute(6_000.0)), 11));
        chain.go_on(&from, to, feed, blend)
    };
    assert!(goes_on(&second, Some(&feed), 11));
    // A merge ends with another feed, another tolerance, a move back, a point too far off, or too long a move.
    assert!(!goes_on(&second, Some(&Feed::PerMinute(6_001.0)), 11));
    assert!(!goes_on(&second, Some(&feed), 21));
    assert!(!goes_on(&second, Some(&feed), 0));
    assert!(!goes_on(&at(999, 0), Some(&feed), 11));
    assert!(!goes_on(&at(-2_000, 0), Some(&feed), 11));
    assert!(goes_on(&at(2_000, 20), Some(&feed), 11));
    assert!(!goes_on(&at(2_000, 21), Some(&feed), 11));
    assert!(!goes_on(&at(12_001, 0), Some(&feed), 11));
    turning[0] = Length(2_000);
    assert!(!goes_on(&turning, Some(&feed), 11));
}
