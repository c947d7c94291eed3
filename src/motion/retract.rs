//! Retract from the cut: X moves away at once while the axes of a thread decelerate to a standstill.
//!
//! Owned by exec, at the exec level. Exec begins it when a pass in step with the spindle ends early: the spindle is
//! lost, the error is above its limit, or a feedhold or an alarm has come ([`Exec`](super::exec::Exec)). Exec calls
//! [`Retreat::add`] for each segment while the axes slow down, and for segments of its own when they stand. The retreat
//! begins in segments that are already queued ([`Exec::lead`](super::exec::Exec::lead)), which would otherwise delay X
//! by 9 ms. The motors of X stand still in the lines of the pass in which it begins, so that no motor has both motions.
//! Segments in which they still move, at the end of a taper, are left as they are. X has a ramp up, a cruise and a ramp
//! down of its own.
//!
//! Units: steps of X, s. Distances handed out are counted in whole phase units, without rounding errors. X ends within
//! half a step, and a ten-thousandth, of the requested distance. Cost on AVR: 6,000 cycles a segment. RAM: shared with
//! the pass, which has ended.

use kerf_macros::small;

use super::float::least;
use super::short::Short;
use crate::boards::MOTORS;
use crate::dda::{STEP, STEP_LOG2, Segment};
use crate::hal::TIMER_HZ;
use crate::hal::arithmetic::product;
use crate::math::sqrt;
use crate::status::Status;

/// The remainder at the end that is not handed out, phase units. The last step is made well before it, and a slower
/// motion would be less than a unit in a tick.
const END: u32 = STEP as u32 / 16;

/// How a pass is left before its end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Retract {
    /// The motors of X, as bits; none if the tool stays in the cut.
    pub motors: u8,
    /// Distance of the motors, steps.
    pub way: i16,
    /// The acceleration limit of the motors, steps/s^2.
    pub accel: Short,
    /// The velocity limit of the motors, steps/s.
    pub velocity: Short,
}

impl Retract {
    /// The tool stays in the cut.
    pub const NONE: Self = Self { motors: 0, way: 0, accel: Short::ZERO, velocity: Short::ZERO };

    /// Whether the tool leaves the cut.
    pub fn is_some(&self) -> bool {
        self.motors != 0
    }
}

/// X on its way out.
#[derive(Clone, Copy, Debug)]
pub struct Retreat {
    how: Retract,
    /// Why the pass was left.
    pub why: Status,
    /// The remaining distance, phase units.
    left: u32,
    /// steps/s.
    velocity: f32,
    /// The distance handed out beyond whole steps, plus half a step for rounding, phase units.
    part: u16,
}

#[small]
impl Retreat {
    /// Returns a retreat at a standstill, in the cut, for this reason. `debt` is that of the motors in `Prep`, which
    /// the retreat makes good.
    pub fn new(how: Retract, why: Status, debt: i32) -> Self {
        let ahead = if how.way < 0 { -debt } else { debt };
        let left = u32::from(how.way.unsigned_abs()) << STEP_LOG2;
        let left = left.saturating_add_signed(ahead);
        let part = (STEP / 2).saturating_add_signed((ahead as i16).wrapping_neg());
        Self { how, why, left, velocity: 0.0, part }
    }

    /// Whether X is out of the cut, at a standstill.
    pub fn is_done(&self) -> bool {
        self.left == 0
    }

    /// The motors that move, as bits.
    pub fn motors(&self) -> u8 {
        self.how.motors
    }

    /// Whether the motors run backwards.
    pub fn is_backwards(&self) -> bool {
        self.how.way < 0
    }

    /// Adds the motion of X to a segment in which X would stand.
    #[inline(never)]
    pub fn add(
        &mut self,
        segment: &mut Segment,
        target: &mut [i32; MOTORS],
        debt: &mut [i32; MOTORS],
    ) {
        let increment = self.plan(segment.ticks, segment.period);
        let mut bit = 1;
        for of in &mut segment.increment {
            if self.how.motors & bit != 0 {
                *of = increment;
            }
            bit <<= 1;
        }
        self.note(increment, segment.ticks, target, debt);
    }

    /// Returns how far X is to go in each of the next `ticks`, phase units; at least 1 until it is out.
    #[inline(never)]
    pub fn plan(&mut self, ticks: u16, period: u16) -> u16 {
        const HZ: f32 = TIMER_HZ as f32;
        let accel = self.how.accel.get();
        let gain = accel * (product(ticks, period) as f32 * (1.0 / HZ));
        // The velocity from which X can stop by losing at most `gain` in each later segment.
        let twice_left = self.left as f32 * (2.0 / f32::from(STEP));
        let stops = sqrt(gain * gain + accel * twice_left) - gain;
        let period = f32::from(period);
        let wanted = least(self.velocity + gain, least(self.how.velocity.get(), stops));
        // A step in each tick at most.
        self.velocity = least(wanted, HZ / period);
        let increment = (self.velocity * period * (f32::from(STEP) / HZ) + 0.5) as u16;
        // A motion of less than a unit in a tick would never end.
        increment.max((!self.is_done()).into())
    }

    /// Counts a segment in which X moves `increment` in each of `ticks`. Adds whole steps to `target`; the remainder is
    /// a `debt` of half a step at most, as in `Prep`.
    #[inline(never)]
    pub fn note(
        &mut self,
        increment: u16,
        ticks: u16,
        target: &mut [i32; MOTORS],
        debt: &mut [i32; MOTORS],
    ) {
        let travel = product(increment, ticks);
        let left = self.left.saturating_sub(travel);
        self.left = if left < END { 0 } else { left };
        let sum = travel + u32::from(self.part);
        self.part = sum as u16 & (STEP - 1);
        let steps = (sum >> STEP_LOG2) as i32;
        // The distance required of X, less the distance in segments.
        let owed = (steps << STEP_LOG2) - travel as i32;
        let (steps, owed) = if self.is_backwards() { (-steps, -owed) } else { (steps, owed) };
        let mut bit = 1;
        for (target, debt) in target.iter_mut().zip(debt.iter_mut()) {
            if self.how.motors & bit != 0 {
                *target = target.wrapping_add(steps);
                *debt += owed;
            }
            bit <<= 1;
        }
    }

    /// Notes that a segment has run without X, which then starts again from a standstill.
    pub fn pause(&mut self) {
        self.velocity = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: u16 = 400;
    const TICKS: u16 = 80;

    /// Returns the velocity of each segment until X is out, steps/s, then how far X has gone, and its debt.
    fn run(how: Retract, debt: i32) -> (std::vec::Vec<f64>, i32, i32) {
        let (mut target, mut debt) = ([0; MOTORS], [debt; MOTORS]);
        let mut retreat = Retreat::new(how, Status::Terminated, debt[0]);
        let mut speeds = std::vec::Vec::new();
        while !retreat.is_done() {
            let mut segment = Segment { ticks: TICKS, period: PERIOD, ..Segment::default() };
            retreat.add(&mut segment, &mut target, &mut debt);
            let seconds = f64::from(TICKS) * f64::from(PERIOD) / 16e6;
            let steps = f64::from(segment.increment[0]) * f64::from(TICKS) / f64::from(STEP);
            speeds.push(steps / seconds);
            assert!(speeds.len() < 20_000, "it does not come to its end");
        }
        (speeds, target[0], debt[0])
    }

    #[test]
    fn it_comes_to_its_end_however_little_it_accelerates() {
        for (way, accel) in [(1, 1e-3), (-1, 0.1), (20, 1.0), (-20, 2.0)] {
            let (accel, velocity) = (Short::new(accel), Short::new(6_400.0));
            let (_, steps, debt) = run(Retract { motors: 1, way, accel, velocity }, 0);
            assert_eq!(steps, i32::from(way));
            assert!(debt.unsigned_abs() < u32::from(STEP) / 8, "{way}: {debt}");
        }
    }

    #[test]
    fn it_is_out_as_soon_as_may_be_and_within_its_limits() {
        for way in [640i16, -640, 20, 1, 32_000] {
            for (accel, velocity) in [(160_000.0, 6_400.0), (50_000.0, 30_000.0), (1e6, 1_000.0)] {
                let limits = (Short::new(accel), Short::new(velocity));
                let how = Retract { motors: 1, way, accel: limits.0, velocity: limits.1 };
                for before in [-16_384, -9_000, 9_000, 16_383] {
                    let (_, steps, debt) = run(how, before);
                    assert_eq!(steps, i32::from(way), "{accel} {velocity} {before}");
                    assert!(debt.unsigned_abs() < u32::from(STEP) / 8, "{way} {before}: {debt}");
                }
                let (speeds, steps, debt) = run(how, 0);
                assert_eq!(steps, i32::from(way), "{accel} {velocity}");
                assert!(debt.unsigned_abs() < u32::from(STEP) / 8, "{way}: {debt}");
                let (mut before, mut most) = (0.0f64, 0.0f64);
                for speed in &speeds {
                    // The acceleration between the mean velocities of neighbouring segments.
                    most = most.max((speed - before).abs() / 0.002);
                    before = *speed;
                    assert!(*speed <= f64::from(velocity) * 1.01, "{way}: {speed}");
                }
                let single = 1.0 / 0.002 / 0.002;
                assert!(most <= f64::from(accel) * 1.6 + single, "{way} {accel}: {most}");
                let (far, accel, v) = (f64::from(way).abs(), f64::from(accel), f64::from(velocity));
                let peak = (accel * far).sqrt();
                let best = if peak < v { 2.0 * peak / accel } else { far / v + v / accel };
                let took = speeds.len() as f64 * 0.002;
                assert!(took <= best * 1.1 + 0.008, "{way} {accel} {v}: {took} s of {best}");
            }
        }
    }
}
