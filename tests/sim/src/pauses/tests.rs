use super::*;

const HZ: f64 = 16e6;
/// Steps in a millimetre.
const PER_MM: f64 = 80.0;

fn meter(ends: &[(usize, i64)]) -> Meter {
    let axes = [0, 1, 2, 3];
    let motors = axes.map(|axis| Travel { axis, step: 1.0 / PER_MM, rotary: axis == 3 });
    let ends = ends.iter().map(|(line, x)| (*line, [*x, 0, 0, 0])).collect();
    Meter::new(Scale { clock_hz: HZ, motors, ends })
}

/// Makes the steps of X and Y along a path, which gives the position in mm at a time in s.
fn walk(meter: &mut Meter, seconds: f64, path: impl Fn(f64) -> [f64; 2]) {
    let mut at = path(0.0).map(|mm| (mm * PER_MM).round());
    let tick = 100;
    for cycle in (0..(seconds * HZ) as u64).step_by(tick) {
        for (motor, mm) in path(cycle as f64 / HZ).into_iter().enumerate() {
            let off = mm * PER_MM - at[motor];
            if off.abs() > 0.5 {
                at[motor] += off.signum();
                meter.step(Step { cycle, motor: motor as u8, positive: off > 0.0 });
            }
        }
    }
}

/// The time without the pauses that begin at `starts`, each `long` seconds.
fn with_pauses(t: f64, starts: &[f64], long: f64) -> f64 {
    t - starts.iter().map(|s| (t - s).clamp(0.0, long)).sum::<f64>()
}

#[test]
fn pauses_in_steady_motion_are_found() {
    for velocity in [9.0, 40.0, 400.0] {
        let interval = 1.0 / (velocity * PER_MM);
        let mut meter = meter(&[]);
        let starts = [0.1, 0.15, 0.2];
        walk(&mut meter, 0.3, |t| {
            let x = velocity * with_pauses(t, &starts, 2.2 * interval);
            [x, x / 3.0]
        });
        let pauses = meter.found().pauses;
        assert_eq!(pauses.len(), 3, "{pauses:?}");
        for (pause, start) in pauses.iter().zip(starts) {
            assert!((pause.cycle as f64 / HZ - start).abs() < interval + 1e-4, "{pause:?}");
            assert!((pause.cycles as f64 / HZ / interval - 3.2).abs() < 0.3, "{pause:?}");
            assert!((pause.velocity / velocity / 1.054 - 1.0).abs() < 0.1, "{pause:?}");
        }
    }
}

#[test]
fn crawling_is_none() {
    let mut meter = meter(&[]);
    walk(&mut meter, 1.0, |t| [7.0 * with_pauses(t, &[0.3, 0.5], 0.02), 0.0]);
    assert_eq!(meter.found(), Found::default());
}

#[test]
fn a_pause_in_a_ramp_is_found() {
    let mut meter = meter(&[]);
    walk(&mut meter, 0.2, |t| {
        let t = with_pauses(t, &[0.1], 0.003);
        [250.0 * t * t, 0.0]
    });
    let pauses = meter.found().pauses;
    assert_eq!(pauses.len(), 1, "{pauses:?}");
    assert!((pauses[0].velocity - 50.0).abs() < 3.0, "{pauses:?}");
}

/// From 100 mm/s to rest and up again, at a place between two whole steps, in slices of constant velocity.
#[test]
fn a_stop_that_is_planned_is_none() {
    for acceleration in [200.0, 1_000.0, 5_000.0, 20_000.0] {
        for slice in [0.0005, 0.002] {
            for rest in [0.0, 0.001, 0.02] {
                for fraction in 0..10 {
                    let mut meter = meter(&[]);
                    let half = 100.0 / acceleration;
                    let place = |t: f64| 0.5 * acceleration * t * t;
                    let sliced = |t: f64| {
                        let from = (t / slice).floor() * slice;
                        place(from) + (place(from + slice) - place(from)) * (t - from) / slice
                    };
                    let off = f64::from(fraction) / 10.0 / PER_MM;
                    walk(&mut meter, 2.0 * half + rest, |t| match t - half {
                        t if t < 0.0 => [off - sliced(-t), 0.0],
                        t if t < rest => [off, 0.0],
                        t => [off + sliced(t - rest), 0.0],
                    });
                    let found = meter.found();
                    let what = (acceleration, slice, rest, fraction);
                    assert_eq!(found, Found::default(), "{what:?}");
                }
            }
        }
    }
}

#[test]
fn circles_and_corners_are_none() {
    let mut meter = meter(&[]);
    walk(&mut meter, 1.0, |t| [3.0 * (20.0 * t).cos(), 3.0 * (20.0 * t).sin()]);
    assert_eq!(meter.found(), Found::default());
    let mut meter = self::meter(&[]);
    walk(&mut meter, 1.0, |t| match t {
        t if t < 0.5 => [20.0 * t, 0.1 * t],
        t => [10.0, 0.05 + 20.0 * (t - 0.5)],
    });
    assert_eq!(meter.found(), Found::default());
}

#[test]
fn the_line_of_a_pause_is_named() {
    let ends = [(1, 0), (2, 400), (4, 400), (7, 800), (9, 1_600)];
    for (start, line) in [(0.05, 2), (0.2, 7), (0.3, 9)] {
        let mut meter = meter(&ends);
        walk(&mut meter, 0.5, |t| [40.0 * with_pauses(t, &[start], 0.002), 0.0]);
        let pauses = meter.found().pauses;
        assert_eq!(pauses.iter().map(|p| p.line).collect::<Vec<_>>(), [Some(line)]);
    }
}

/// Steps at 40 mm/s, with a timer that stops for `long` after the step at `stop`.
fn starve(stop: usize, long: u64) -> Found {
    let mut meter = meter(&[]);
    let mut cycle = 0;
    for n in 0..400 {
        meter.step(Step { cycle, motor: 0, positive: true });
        if n == stop {
            meter.timer(false);
            cycle += long;
            meter.timer(true);
        }
        cycle += 5_000;
    }
    meter.found()
}

#[test]
fn a_timer_that_stands_still_in_motion_is_found_however_short() {
    let found = starve(200, 100);
    assert_eq!((found.pauses.len(), found.starved.len()), (0, 1), "{found:?}");
    assert_eq!(found.starved[0].cycles, 5_100);
    let found = starve(200, 30_000);
    assert_eq!((found.pauses.len(), found.starved.len()), (1, 1), "{found:?}");
}
