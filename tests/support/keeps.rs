//! The limits that everything a governor plans must keep.

use kerf::motion::exec::{BLOCK_S_MIN, SEGMENT_S};

use crate::jobs::Planned;

/// Duration of a stretch, s.
pub const STRETCH: f64 = SEGMENT_S as f64;

/// The velocity at a time, as the governor has computed it.
#[derive(Clone, Copy, Debug)]
struct State {
    clock: f64,
    place: f64,
    velocity: f64,
    /// Index of the stretch that ends in this state.
    of: usize,
}

/// Returns the states that the governor has gone through.
fn states(planned: &[Planned]) -> Vec<State> {
    let mut states = vec![State { clock: 0.0, place: 0.0, velocity: 0.0, of: 0 }];
    for (of, p) in planned.iter().enumerate() {
        let state = State { clock: p.after_clock, place: p.after_place, velocity: p.after, of };
        let last = states.last_mut().expect("it begins with one");
        // The remainder of a slice leads to the state that is known already, except for rounding.
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

/// Checks that velocity, acceleration and jerk along the path stay within the limits of the block.
pub fn check_limits(planned: &[Planned]) {
    for (n, p) in planned.iter().enumerate() {
        let mean = f64::from(p.stretch.distance) / f64::from(p.stretch.seconds);
        let change = p.accel * 0.5 * f64::from(p.stretch.seconds);
        let jump = (p.jerk * STRETCH * STRETCH).min(p.accel * STRETCH);
        // The time that exec takes for a block limits the shortest moves, not a feed or an axis. The planner
        // merges moves of less than 1 um, a tenth of a step.
        let brief = p.length <= p.cruise * f64::from(BLOCK_S_MIN) * 1.001;
        let tiny = p.length < 1e-3 || p.stretch.distance < 1e-5 || brief;
        assert!(mean <= p.cruise * 1.0011 + change || tiny, "{n}: {p:?}");
        assert!(p.after <= p.cruise.max(p.before) * 1.0011 + jump, "{n}: {p:?}");
    }
    check_corners(planned, 1e-3);
    check_changes(planned, 1e-3, 1.0, 1.0, false);
}

/// Checks that the velocity at each corner is no higher than the corner allows. Corners of moves shorter than 1 um
/// are not checked.
pub fn check_corners(planned: &[Planned], share: f64) {
    let states = states(planned);
    let mut at = 0;
    for (n, pair) in planned.windows(2).enumerate() {
        let [a, b] = pair else { unreachable!() };
        // Moves of less than 1 um are a tenth of a step. Where the limits change, the corner is what the next line
        // can stop from.
        let others = (a.accel, a.jerk) != (b.accel, b.jerk);
        if a.line == b.line || a.length < 1e-3 || b.length < 1e-3 || others {
            continue;
        }
        while at + 2 < states.len() && states[at + 1].clock < a.clock {
            at += 1;
        }
        let (from, to) = (states[at], states[at + 1]);
        let part = ((a.clock - from.clock) / (to.clock - from.clock)).clamp(0.0, 1.0);
        let velocity = from.velocity + (to.velocity - from.velocity) * part;
        let jump = b.jerk.max(a.jerk).min(b.accel / STRETCH) * STRETCH * STRETCH;
        // A distance that rounding leaves over, 0.5 um, is made at once.
        let near = (4.5 * a.jerk.max(b.jerk) * 2.5e-7).cbrt();
        let most = b.corner * 1.004 + little(planned, share) + jump + near;
        assert!(velocity <= most, "{n}: {velocity} of {most} mm/s at a corner, {b:?}");
    }
}

/// Checks changes of velocity and of acceleration against `accel` and `jerk` times the limits. With `late` an
/// override may have lowered a velocity too late, which takes one more slice.
pub fn check_changes(planned: &[Planned], share: f64, accel: f64, jerk: f64, late: bool) {
    let little = little(planned, share);
    let states = states(planned);
    let mut before: Option<(f64, f64, f64)> = None;
    for pair in states.windows(2) {
        let [a, b] = pair else { unreachable!() };
        let p = &planned[b.of];
        let (seconds, change) = (b.clock - a.clock, b.velocity - a.velocity);
        let jump = p.jerk * STRETCH * STRETCH;
        // A slice may reach from a block with a jerk limit into a block without one.
        let into = p.jerk == 0.0 && planned[a.of].jerk > 0.0;
        let more = if late || into { p.accel * STRETCH } else { jump.min(p.accel * STRETCH) };
        let most = p.accel * seconds * 1.01 * accel + little + more;
        assert!(change.abs() <= most, "{change} of {most} mm/s: {a:?} {b:?} {p:?}");
        let mean = (b.place - a.place) / seconds;
        let (low, high) = (a.velocity.min(b.velocity), a.velocity.max(b.velocity));
        // The velocity may have a peak in the middle. From rest to rest a very short move is one slice without a ramp,
        // whose mean velocity may be `least` at once.
        let least = if high == 0.0 { (2.0 * jump).min(p.accel * STRETCH) } else { 0.0 };
        let peak = high + 0.25 * p.accel * seconds + least;
        let off = 1e-3 * high + 3e-3 / seconds;
        let even = mean <= peak + off && mean >= low - off;
        assert!(p.jerk == 0.0 || even, "{mean} mm/s: {a:?} {b:?} {p:?}");
        let same = |q: &Planned| p.jerk == q.jerk && p.accel == q.accel;
        let same = planned[a.of..=b.of].iter().all(same);
        let rate = change / seconds;
        if p.jerk == 0.0 || !same {
            before = None;
            continue;
        }
        if let Some((rate_before, seconds_before, jerk_before)) = before
            && jerk_before == p.jerk
        {
            let time = 0.5 * (seconds + seconds_before) + STRETCH;
            let most = p.jerk * time * 1.02 * jerk + little / seconds.min(seconds_before);
            let change = (rate - rate_before).abs();
            // Velocities up to the creep velocity may be taken at once.
            let creep = 16.0 * p.jerk * STRETCH * STRETCH;
            let creeps = a.velocity.max(b.velocity) <= creep;
            let most = if creeps { f64::MAX } else { most };
            assert!(change <= most, "{change} of {most} mm/s^2: {a:?} {b:?} {p:?}");
        }
        before = Some((rate, seconds, p.jerk));
    }
}
