//! Moving means: what limits jerk, rounds corners, and makes axes ring less.
//!
//! Owned by exec (level 2). The [`Sampler`](super::sampler::Sampler) drives along the programmed path with trapezoidal
//! velocities, and passes corners with a jump of velocity. It gives the distance of each motor in samples of
//! [`SAMPLE_S`]. Each distance goes through two means over the last samples: one over A/J, one over [`CORNER_S`]. What
//! comes out goes to the motors.
//!
//! **Acceleration.** A mean over the time T makes of a jump of velocity by d an acceleration d/T. So corners are taken
//! at a velocity at which no axis jumps by more than A T ([`Axis::corner`](super::dynamics::Axis::corner)).
//!
//! **Jerk.** The other mean makes of a jump of acceleration by A a jerk of A / (A/J) = J. The acceleration turns from A
//! to -A at once where a ramp up meets a ramp down: the jerk is 2 J there.
//!
//! **Path.** What comes out is a mean of positions of the last T1 + T2. So it stays within the hull of the path, and
//! soft limits that hold for the path hold for the motors.
//!
//! **Ends.** All is done in integers, and the remainder of each division is carried over. Each distance is counted as
//! often as its mean divides by, so that the sum of what comes out is the sum of what went in, exactly, when as many
//! samples of no distance have followed as the means are long ([`Smooth::is_empty`]).
//!
//! Behind the means is the filter against ringing, if there is one ([`shaper`](super::shaper)).
//!
//! All channels have the same means, so that straight lines stay straight. Units: phase units of a motor, in `i32`: a
//! sum over the longest mean fits at the highest step rate of each chip. Cost on AVR: 700 cycles a sample and motor, 25
//! for a motor that stands. RAM: 4 bytes for each sample of a mean and channel.

use kerf_macros::small;

use super::advance::EXTRUDERS;
use super::divide::quotient_remainder;
use super::float::whole;
use super::shaper::{Shaped, Weights};
use crate::boards::MOTORS;
use crate::config::shape::{Resonances, SHAPED};
use crate::hal::{SAMPLE_MS, TIMER_HZ};

/// Duration of a sample, s.
pub const SAMPLE_S: f32 = SAMPLE_MS as f32 * 1e-3;

/// Duration of a sample, counts of the step timer.
pub const SAMPLE_CYCLES: u32 = TIMER_HZ / 1_000 * SAMPLE_MS as u32;

/// What goes through the means: the distance of each motor, then the lead of the extruder.
pub const CHANNELS: usize = MOTORS + EXTRUDERS;

/// The channel of the extruder's lead.
pub const LEAD: usize = MOTORS;

/// How long the mean is that rounds corners, ms.
const CORNER_MS: u8 = 16;

/// How long the mean is that rounds corners, s.
pub const CORNER_S: f32 = CORNER_MS as f32 * 1e-3;

/// Samples of the mean that rounds corners.
pub const CORNER: u8 = CORNER_MS / SAMPLE_MS;
const _: () = assert!(CORNER * SAMPLE_MS == CORNER_MS, "a mean is a whole number of samples");

/// The most samples of the mean that limits jerk.
pub const JERK_MOST: u8 = if SAMPLE_MS >= 4 { 11 } else { 30 };

/// How many samples the two means cover, and the resonances of the filter behind them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spans {
    /// The mean that rounds corners: 1 for none.
    corner: u8,
    /// The mean that limits jerk: 1 for none.
    jerk: u8,
    /// The resonances; none in an image that cannot shape.
    resonances: [Resonances; SHAPED],
}

impl Default for Spans {
    fn default() -> Self {
        Self::NONE
    }
}

impl Spans {
    /// No means: motors follow the path as it is.
    pub const NONE: Self = Self { corner: 1, jerk: 1, resonances: [Resonances::NONE; SHAPED] };

    /// Returns the means for a machine whose acceleration limit builds up in `seconds` at its jerk limit; no means if
    /// that is 0. The time is rounded up to samples, up to [`JERK_MOST`].
    #[inline(never)]
    #[small]
    pub fn of(seconds: f32) -> Self {
        if seconds > 0.0 { Self { corner: CORNER, ..Self::alone(seconds) } } else { Self::NONE }
    }

    /// Returns the mean that limits jerk alone, for single moves, which have no corners.
    #[inline(never)]
    #[small]
    pub fn alone(seconds: f32) -> Self {
        let samples = whole(seconds * (1.0 / SAMPLE_S) + 0.98);
        Self { jerk: samples.clamp(1, JERK_MOST.into()) as u8, ..Self::NONE }
    }

    /// Returns these means, and the one that rounds corners.
    #[inline(always)]
    pub fn and_corner(self) -> Self {
        Self { corner: CORNER, ..self }
    }

    /// Returns these means, and the one that rounds corners, with a filter for resonances behind them.
    #[inline(always)]
    pub fn and_shaper(self, resonances: [Resonances; SHAPED]) -> Self {
        Self { resonances, ..self.and_corner() }
    }

    /// The resonances.
    pub fn resonances(&self) -> Option<&Resonances> {
        self.resonances.first()
    }

    /// Whether there is a mean.
    #[inline(always)]
    pub fn is_some(self) -> bool {
        self.corner > 1 || self.jerk > 1
    }

    /// Whether a mean rounds corners.
    #[inline(always)]
    pub fn rounds(self) -> bool {
        self.corner > 1
    }

    /// How many samples each mean covers.
    pub fn samples(self) -> (u8, u8) {
        (self.corner, self.jerk)
    }

    /// For how many samples a distance goes on to come out of the means, after the sample in which it went in.
    #[inline(always)]
    pub fn lag(self) -> u8 {
        self.corner + self.jerk - 2
    }
}

/// A mean over the last samples of a channel.
#[derive(Clone, Copy, Debug)]
struct Mean<const MOST: usize> {
    /// The last samples: a ring.
    last: [i32; MOST],
    /// Their sum.
    sum: i32,
    /// The remainder of the last division.
    rest: i32,
}

impl<const MOST: usize> Mean<MOST> {
    const NONE: Self = Self { last: [0; MOST], sum: 0, rest: 0 };

    /// Takes in a sample, in the place of the oldest, and returns the mean over `span` samples.
    #[inline(always)]
    fn put(&mut self, new: i32, at: u8, span: u8) -> i32 {
        let Some(place) = self.last.get_mut(usize::from(at)) else { return new };
        self.sum += new - *place;
        *place = new;
        let (mean, rest) = divided(self.sum + self.rest, span);
        self.rest = rest;
        mean
    }
}

/// The means of a channel.
#[derive(Clone, Copy, Debug)]
struct Channel {
    jerk: Mean<{ JERK_MOST as usize }>,
    corner: Mean<{ CORNER as usize }>,
    shaped: Shaped,
    /// How many more samples may have a distance if none goes in.
    left: u8,
}

impl Channel {
    const NONE: Self = Self { jerk: Mean::NONE, corner: Mean::NONE, shaped: Shaped::NONE, left: 0 };
}

/// The places of samples in the means, and in the filter behind them.
#[derive(Clone, Copy, Debug)]
struct Places {
    corner: u8,
    jerk: u8,
    shaped: u8,
}

impl Places {
    const FIRST: Self = Self { corner: 0, jerk: 0, shaped: 0 };
}

/// The means of all channels.
#[derive(Debug)]
pub struct Smooth {
    spans: Spans,
    weights: Weights,
    /// The places of the oldest samples.
    at: Places,
    channels: [Channel; CHANNELS],
}

impl Smooth {
    /// No means, and no samples.
    pub const fn new() -> Self {
        Self {
            spans: Spans::NONE,
            weights: Weights::NONE,
            at: Places::FIRST,
            channels: [Channel::NONE; CHANNELS],
        }
    }

    /// The means.
    #[inline(always)]
    pub fn spans(&self) -> Spans {
        self.spans
    }

    /// Sets the means, and [clears](Self::clear) them.
    #[small]
    pub fn set(&mut self, spans: Spans) {
        self.spans = spans;
        if let Some(resonances) = spans.resonances() {
            self.weights = Weights::of(resonances);
        }
        self.clear();
    }

    /// Forgets all samples: the machine stands still where it is.
    #[inline(never)]
    #[small]
    pub fn clear(&mut self) {
        self.at = Places::FIRST;
        // In place: a constant would take a copy on the stack.
        for channel in &mut self.channels {
            *channel = Channel::NONE;
        }
    }

    /// For how many samples a distance goes on to come out, after the sample in which it went in.
    #[inline(always)]
    pub fn lag(&self) -> u8 {
        self.spans.lag() + self.weights.lag()
    }

    /// Whether everything that went in has come out.
    pub fn is_empty(&self) -> bool {
        self.channels.iter().all(|channel| channel.left == 0)
    }

    /// Takes in the distances of a sample, and replaces them by their means.
    #[inline(never)]
    pub fn put(&mut self, distances: &mut [i32; CHANNELS]) {
        let (spans, at, lag) = (&self.spans, self.at, self.lag());
        let weights = self.weights.parts();
        for (channel, distance) in self.channels.iter_mut().zip(distances) {
            if *distance != 0 {
                channel.left = lag + 1;
            } else if channel.left == 0 {
                // All its samples are 0.
                continue;
            }
            channel.left -= 1;
            if spans.jerk > 1 {
                *distance = channel.jerk.put(*distance, at.jerk, spans.jerk);
            }
            if spans.corner > 1 {
                *distance = channel.corner.put(*distance, at.corner, spans.corner);
            }
            if !weights.is_empty() {
                *distance = channel.shaped.put(*distance, at.shaped, weights);
            }
            if channel.left == 0 {
                // The oldest sample would be taken out by the next one, which may not come.
                *channel = Channel::NONE;
            }
        }
        let next = |at: u8, span: u8| if at + 1 >= span { 0 } else { at + 1 };
        self.at = Places {
            corner: next(at.corner, spans.corner),
            jerk: next(at.jerk, spans.jerk),
            shaped: next(at.shaped, self.weights.lag() + 1),
        };
    }
}

impl Default for Smooth {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns `a / n`, rounded towards zero, and the remainder. Cost on AVR: 300, 60 for 2, 4 and 8.
#[inline(always)]
fn divided(a: i32, n: u8) -> (i32, i32) {
    let size = a.unsigned_abs();
    let (quotient, rest) = match n {
        4 => (size >> 2, size & 3),
        8 => (size >> 3, size & 7),
        _ => long_divided(size, n),
    };
    let (quotient, rest) = (quotient as i32, rest as i32);
    if a < 0 { (-quotient, -rest) } else { (quotient, rest) }
}

/// Returns `a / n` and `a % n`, in two divisions of 16 bits.
#[inline(never)]
fn long_divided(a: u32, n: u8) -> (u32, u32) {
    let n = u16::from(n);
    let (upper, rest) = match (a >> 16) as u16 {
        upper if upper < n => (0, upper),
        upper => quotient_remainder(upper.into(), n),
    };
    let (lower, rest) = quotient_remainder(u32::from(rest) << 16 | a & 0xFFFF, n);
    (u32::from(upper) << 16 | u32::from(lower), rest.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn smooth(corner: u8, jerk: u8) -> Smooth {
        let mut smooth = Smooth::new();
        smooth.set(Spans { corner, jerk, ..Spans::NONE });
        smooth
    }

    /// Returns what comes out of the first channel, up to the sample at which the means are empty.
    fn run(smooth: &mut Smooth, inputs: &[i32]) -> Vec<i32> {
        let mut out = Vec::new();
        let mut inputs = inputs.iter();
        loop {
            let next = inputs.next();
            if next.is_none() && smooth.is_empty() {
                return out;
            }
            let mut distances = [0; CHANNELS];
            distances[0] = next.copied().unwrap_or(0);
            smooth.put(&mut distances);
            out.push(distances[0]);
        }
    }

    proptest! {
        #[test]
        fn what_goes_in_comes_out(
            corner in prop_oneof![Just(1), Just(CORNER)], jerk in 1..=JERK_MOST,
            first in prop::collection::vec(-10_000_000i32..10_000_000, 0..60),
            second in prop::collection::vec(-9i32..9, 0..60),
        ) {
            let mut smooth = smooth(corner, jerk);
            for inputs in [&first, &second, &first] {
                let out = run(&mut smooth, inputs);
                prop_assert_eq!(out.iter().sum::<i32>(), inputs.iter().sum::<i32>());
                prop_assert!(out.len() <= inputs.len() + usize::from(smooth.spans.lag()));
            }
        }

        #[test]
        fn what_goes_in_comes_out_of_the_filter(
            hertz in [0..1_000u16, 0..1_000u16, 0..1_000u16], kind in 0..2u8,
            inputs in prop::collection::vec(-10_000_000i32..10_000_000, 0..200),
        ) {
            let resonances = Resonances { hertz, kind, ..Resonances::NONE };
            let mut smooth = Smooth::new();
            smooth.set(Spans::of(0.03).and_shaper([resonances; SHAPED]));
            for inputs in [&inputs, &inputs] {
                let out = run(&mut smooth, inputs);
                prop_assert_eq!(out.iter().sum::<i32>(), inputs.iter().sum::<i32>());
                prop_assert!(out.len() <= inputs.len() + usize::from(smooth.lag()));
            }
        }

        #[test]
        fn a_long_division_is_a_division(a: i32, n in 1u8..=64) {
            prop_assert_eq!(divided(a, n), (a / i32::from(n), a % i32::from(n)));
        }
    }

    #[test]
    fn a_jump_of_velocity_becomes_a_ramp_of_even_jerk() {
        let out = run(&mut smooth(4, 2), &[8_000; 12]);
        assert_eq!(out[..6], [1_000, 3_000, 5_000, 7_000, 8_000, 8_000]);
    }

    #[test]
    fn the_highest_rate_fits() {
        let most = (SAMPLE_CYCLES / u32::from(crate::hal::TICKS[0].step)) << 15;
        assert!(most * u32::from(JERK_MOST) <= i32::MAX as u32 / 2);
    }
}
