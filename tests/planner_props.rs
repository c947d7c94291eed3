//! Properties of the planning maths: profile, junction, look-ahead and line builder, against f64.

use kerf::motion::profile::{Limits, Ramp, peak, reach};
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
