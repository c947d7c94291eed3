//! What must hold of everything that a governor plans.

use kerf::motion::exec::SEGMENT_S;

use crate::jobs::Planned;

/// A stretch, s.
pub const STRETCH: f64 = SEGMENT_S as f64;

/// Velocity, acceleration and jerk along the path stay within the block's limits.
///
/// What the length of stretches adds: acceleration 1 %, and what is gone to at once, a velocity less than
/// `J t^2` away, or a thousandth of the highest feed: the queue keeps no key for less, and potentials are
/// no finer.
pub fn check_limits(planned: &[Planned]) {
    let little = planned.iter().map(|p| p.cruise).fold(0.0, f64::max) * 1e-3;
    for (n, p) in planned.iter().enumerate() {
        let seconds = f64::from(p.stretch.seconds);
        assert!(p.after <= p.cruise * 1.0011, "{n}: {p:?}");
        let change = p.after - p.before;
        assert!(change.abs() <= p.accel * seconds * 1.01 + little, "{n}: {p:?}");
        let mean = f64::from(p.stretch.distance) / seconds;
        let high = p.before.max(p.after) + 0.5 * p.accel * seconds;
        assert!(mean <= high * 1.001 || p.stretch.distance < 1e-5, "{n}: {mean} mm/s in {p:?}");
    }
    for (n, pair) in planned.windows(2).enumerate() {
        let [a, b] = pair else { unreachable!() };
        check_continuity(n + 1, a, b, 1.0);
    }
}

/// From one stretch to the next; the acceleration may change by so many times as much as usual.
pub fn check_continuity(n: usize, a: &Planned, b: &Planned, times: f64) {
    assert!(a.after == b.before || a.after < 1e-3, "{n}: {a:?} {b:?}");
    if a.jerk == 0.0 || a.jerk != b.jerk || a.accel != b.accel {
        return;
    }
    let of = |p: &Planned| (p.after - p.before) / f64::from(p.stretch.seconds);
    let seconds = f64::from(a.stretch.seconds + b.stretch.seconds);
    let change = (of(b) - of(a)).abs();
    let most = b.jerk * (0.5 * seconds + 3.0 * STRETCH) * 1.01 * times;
    assert!(change <= most, "{n}: {change} of {most} mm/s^2 from {a:?} to {b:?}");
}
