//! The limits that everything a governor plans must keep.

use kerf::motion::exec::{BLOCK_S_MIN, SEGMENT_S};

use crate::jobs::Planned;

/// Duration of a stretch, s.
pub const STRETCH: f64 = SEGMENT_S as f64;

/// The velocity at a time, as the governor has computed it.
#[derive(Clone, Copy, Debug)]
struct State {
    clock: f64,
    velocity: f64,
    /// Index of the stretch that ends in this state.
    of: usize,
}

/// Returns the states that the governor has gone through.
fn states(planned: &[Planned]) -> Vec<State> {
    let mut states = vec![State { clock: 0.0, velocity: 0.0, of: 0 }];
    for (of, p) in planned.iter().enumerate() {
        let state = State { clock: p.clock, velocity: p.after, of };
        let last = states.last_mut().expect("it begins with one");
        if state.clock - last.clock > 2e-6 {
            states.push(state);
        }
    }
    states
}

/// A difference of velocity that the governor may jump over: the share `share` of the highest feed. The queue keeps
/// no key below a thousandth, and potentials are no finer.
fn little(planned: &[Planned], share: f64) -> f64 {
    planned.iter().map(|p| p.top).fold(0.0, f64::max) * share
}

/// Checks that velocity and acceleration along the path stay within the limits of the block.
pub fn check_limits(planned: &[Planned]) {
    for (n, p) in planned.iter().enumerate() {
        let mean = f64::from(p.stretch.distance) / f64::from(p.stretch.seconds);
        let change = p.accel * 0.5 * f64::from(p.stretch.seconds);
        // The time that exec takes for a block limits the shortest moves, not a feed or an axis. The planner
        // merges moves of less than 1 um, a tenth of a step.
        let brief = p.length <= p.cruise * f64::from(BLOCK_S_MIN) * 1.001;
        let tiny = p.length < 1e-3 || p.stretch.distance < 1e-5 || brief;
        assert!(mean <= p.cruise * 1.0011 + change || tiny, "{n}: {p:?}");
        assert!(p.after <= p.cruise.max(p.before) * 1.0011 + 1e-6, "{n}: {p:?}");
    }
    check_corners(planned, 1e-3);
    check_changes(planned, 1e-3, 1.0, false);
}

/// Checks that the velocity at each corner is no higher than the corner allows. Corners of moves shorter than 1 um
/// are not checked.
pub fn check_corners(planned: &[Planned], share: f64) {
    let states = states(planned);
    let mut at = 0;
    for (n, pair) in planned.windows(2).enumerate() {
        let [a, b] = pair else { unreachable!() };
        // Moves of less than 1 um are a tenth of a step.
        if a.line == b.line || a.length < 1e-3 || b.length < 1e-3 {
            continue;
        }
        while at + 2 < states.len() && states[at + 1].clock < a.clock {
            at += 1;
        }
        let (from, to) = (states[at], states[at + 1]);
        let part = ((a.clock - from.clock) / (to.clock - from.clock)).clamp(0.0, 1.0);
        let velocity = from.velocity + (to.velocity - from.velocity) * part;
        // Places are rounded to some millionths of a mm.
        let most = b.corner * 1.004 + little(planned, share) + b.accel.max(a.accel) * 3e-6;
        assert!(velocity <= most, "{n}: {velocity} of {most} mm/s at a corner, {b:?}");
    }
}

/// Checks changes of velocity against `accel` times the limits. With `late` an override may have lowered a velocity too
/// late, which takes one more stretch.
pub fn check_changes(planned: &[Planned], share: f64, accel: f64, late: bool) {
    let little = little(planned, share);
    for pair in states(planned).windows(2) {
        let [a, b] = pair else { unreachable!() };
        let p = &planned[b.of];
        let (seconds, change) = (b.clock - a.clock, b.velocity - a.velocity);
        // Times are rounded to a tenth of a microsecond.
        // Stretches that take next to no time have no state of their own.
        let limit = planned[a.of..=b.of].iter().map(|p| p.accel).fold(0.0, f64::max);
        let more = limit * if late { STRETCH } else { 1e-7 };
        let most = limit * seconds * 1.01 * accel + little + more;
        assert!(change.abs() <= most, "{change} of {most} mm/s: {a:?} {b:?} {p:?}");
    }
}
