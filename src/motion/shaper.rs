//! Input shaping: filters that keep axes from ringing at their resonances.
//!
//! Owned by exec (level 2), behind the means of [`Smooth`](super::smooth::Smooth); the planner computes the same filter
//! to know how far it puts the path off ([`Kernel`](super::blend)). An axis rings at its resonance after each change of
//! acceleration. A filter whose response is small there leaves little to ring:
//!
//! - [`MEAN`]: a mean over one period of the resonance. It needs no damping ratio.
//! - [`EXTRA_INSENSITIVE`](crate::config::shape::EXTRA_INSENSITIVE): three impulses, half a period apart, so weighted
//!   that 5 % is left at the resonance and less than that near it (Singhose, Seering, Singer: residual vibration
//!   reduction using vector diagrams, 1990). So it still works if the resonance is up to 20 % off.
//!
//! **All axes have the same filter**, the product of the filters of all resonances: straight lines stay straight, and
//! motors that turn X and Y together need no filter of their own. Weights are not negative, and their sum is exactly 1.
//! So accelerations, jerks and the hull of the path stay within what they are without it, and ends are exact. What it
//! costs is time at each stop (a period for each resonance) and rounder corners, which [`Blend`](super::blend::Blend)
//! keeps within P.
//!
//! **Rubbish.** A resonance out of range counts as none, and so does one for whose filter there is no room: the settings
//! refuse both ([`Resonances::fits`]).
//!
//! Units: 0.1 Hz, samples of [`SAMPLE_S`]. Cost on the RP2040: 10 cycles for each weight, sample and motor that moves;
//! 30,000 for a change. RAM: 4 bytes for each weight and channel.

use super::smooth::SAMPLE_S;
use crate::config::shape::{MEAN, PERIODS_MS, RINGING, Resonances, SHAPED};
use crate::hal::SAMPLE_MS;
use crate::math::{round, sqrt};
use kerf_macros::small;

/// The most weights: damping makes periods up to 1.05 times as long, and each filter ends within a sample.
pub const WEIGHTS: usize = SHAPED * (PERIODS_MS * 21 / 20 / SAMPLE_MS as usize + 2 * RINGING);

/// 1 in the units of a weight.
const ONE: u16 = 1 << ONE_LOG2;
const ONE_LOG2: u8 = 15;

/// What is left of a vibration at the resonance behind a filter of three impulses.
const LEFT: f32 = 0.05;

/// The weights of a filter: what part of a distance comes out in each sample.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    parts: [u16; WEIGHTS],
    len: u8,
}

#[small]
impl Weights {
    /// No filter.
    pub const NONE: Self = Self { parts: [0; WEIGHTS], len: 1 };

    /// Returns the product of the filters of all resonances.
    pub fn of(resonances: &Resonances) -> Self {
        let mut all = Self::NONE;
        for hertz in resonances.different() {
            let period = 10.0 / (f32::from(hertz) * SAMPLE_S);
            all = all.and(&Self::one(period, resonances));
        }
        all
    }

    /// Returns the filter for one period, samples.
    fn one(period: f32, resonances: &Resonances) -> Self {
        let mut parts = [0.0; WEIGHTS];
        let len = match resonances.kind {
            MEAN => mean(&mut parts, period),
            _ => impulses(&mut parts, period, f32::from(resonances.damping) * 0.01),
        };
        let (mut sum, all) = (0.0, parts.iter().sum::<f32>());
        let sums = parts.map(|part| {
            sum += part;
            round(sum / all * f32::from(ONE)) as u16
        });
        Self::of_sums(&sums, len)
    }

    /// Returns the weights whose sums up to each of them are these: so the sum of all is exactly 1, however they are
    /// rounded.
    fn of_sums(sums: &[u16; WEIGHTS], len: u8) -> Self {
        let (mut parts, mut last) = ([0; WEIGHTS], 0);
        for (part, sum) in parts.iter_mut().zip(sums) {
            *part = sum - last;
            last = *sum;
        }
        Self { parts, len }
    }

    /// Returns the product with another filter; this one if there is no room for it.
    fn and(&self, other: &Self) -> Self {
        let Some(len) = self.joined(other) else {
            return if self.len > 1 { *self } else { *other };
        };
        let mut products = [0u32; WEIGHTS];
        for (n, one) in self.parts().iter().enumerate() {
            for (product, two) in products.iter_mut().skip(n).zip(other.parts()) {
                *product += u32::from(*one) * u32::from(*two);
            }
        }
        let mut sum = 1 << (ONE_LOG2 - 1);
        let sums = products.map(|product| {
            sum += product;
            (sum >> ONE_LOG2) as u16
        });
        Self::of_sums(&sums, len)
    }

    /// Returns the number of weights of the product with another filter, if both are some and there is room.
    fn joined(&self, other: &Self) -> Option<u8> {
        let len = usize::from(self.len) + usize::from(other.len) - 1;
        (self.len > 1 && len <= WEIGHTS).then_some(len as u8)
    }

    /// The weights, in 2^-15; none without a filter.
    #[inline(always)]
    pub fn parts(&self) -> &[u16] {
        let len = if self.len > 1 { self.len.into() } else { 0 };
        self.parts.get(..len).unwrap_or(&[])
    }

    /// For how many samples a distance goes on to come out, after the sample in which it went in.
    #[inline(always)]
    pub fn lag(&self) -> u8 {
        self.len - 1
    }
}

/// Writes the weights of a mean over `period` samples, the same from either end. Returns their number.
fn mean(parts: &mut [f32; WEIGHTS], period: f32) -> u8 {
    let whole = period as u8;
    let end = 0.5 * (period - f32::from(whole));
    for (n, part) in parts.iter_mut().take(usize::from(whole) + 2).enumerate() {
        *part = if n == 0 || n == usize::from(whole) + 1 { end } else { 1.0 };
    }
    whole + 2
}

/// Writes the weights of three impulses over a period, the second at a sample. Those between two samples are split
/// between these. Returns the number of weights.
fn impulses(parts: &mut [f32; WEIGHTS], period: f32, damping: f32) -> u8 {
    let free = sqrt(1.0 - damping * damping);
    let half = 0.5 * period / free;
    // By how much a vibration decays in half a period.
    let decay = falls(core::f32::consts::PI * damping / free);
    let heights =
        [0.25 * (1.0 + LEFT), 0.5 * (1.0 - LEFT) * decay, 0.25 * (1.0 + LEFT) * decay * decay];
    let middle = half as u8 + 1;
    for (n, height) in heights.into_iter().enumerate() {
        let at = f32::from(middle) + half * (n as f32 - 1.0);
        let (sample, share) = (at as usize, at - (at as usize) as f32);
        for (place, share) in [(sample, 1.0 - share), (sample + 1, share)] {
            if let Some(part) = parts.get_mut(place) {
                *part += height * share;
            }
        }
    }
    2 * middle + 1
}

/// Returns e^-x for 0 to 1, to 0.2 %.
fn falls(x: f32) -> f32 {
    let even = 1.0 + x * x * (1.0 / 12.0);
    (even - 0.5 * x) / (even + 0.5 * x)
}

/// The last samples of a channel, for its filter.
#[derive(Clone, Copy, Debug)]
pub struct Shaped {
    last: [i32; WEIGHTS],
    /// The remainder of the last sum, in 2^-15.
    rest: [u16; SHAPED],
}

impl Shaped {
    /// No distance.
    pub const NONE: Self = Self { last: [0; WEIGHTS], rest: [0; SHAPED] };

    /// Takes in the distance of a sample at the place `at` of the ring, and returns what comes out.
    #[inline(always)]
    pub fn put(&mut self, new: i32, at: u8, weights: &[u16]) -> i32 {
        let at = usize::from(at);
        let Some(rest) = self.rest.first_mut() else { return new };
        let Some(ring) = self.last.get_mut(..weights.len()) else { return new };
        let Some(place) = ring.get_mut(at) else { return new };
        *place = new;
        let Some((old, young)) = ring.split_at_checked(at + 1) else { return new };
        let samples = old.iter().rev().chain(young.iter().rev());
        // In halves of 16 bits: a product has 32 bits then, and the sum of the weights is 2^15.
        let (mut upper, mut lower) = (0i32, 0u32);
        for (sample, weight) in samples.zip(weights) {
            upper += (sample >> 16) * i32::from(*weight);
            lower += (*sample as u16 as u32) * u32::from(*weight);
        }
        let sum = (i64::from(upper) << 16) + i64::from(lower) + i64::from(*rest);
        *rest = (sum & i64::from(ONE - 1)) as u16;
        (sum >> ONE_LOG2) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::shape::{DAMPING_MOST, EXTRA_INSENSITIVE, HERTZ};
    use proptest::prelude::*;
    use std::f64::consts::TAU;
    use std::vec::Vec;

    fn weights(hertz: [u16; RINGING], kind: u8) -> Weights {
        Weights::of(&Resonances { hertz, kind, ..Resonances::NONE })
    }

    /// What is left of a vibration of this frequency, Hz, and damping ratio behind the filter.
    fn left(weights: &Weights, hertz: f64, damping: f64) -> f64 {
        let free = (1.0 - damping * damping).sqrt();
        let (mut cos, mut sin) = (0.0, 0.0);
        let end = f64::from(weights.lag()) * f64::from(SAMPLE_S);
        for (n, part) in weights.parts().iter().enumerate() {
            let at = n as f64 * f64::from(SAMPLE_S);
            let angle = TAU * hertz * free * at;
            let height =
                f64::from(*part) / f64::from(ONE) * (-damping * TAU * hertz * (end - at)).exp();
            (cos, sin) = (cos + height * angle.cos(), sin + height * angle.sin());
        }
        cos.hypot(sin)
    }

    fn any_resonances() -> impl Strategy<Value = Resonances> {
        let one = || prop_oneof![Just(0), HERTZ.0..=HERTZ.1, any::<u16>()];
        ([one(), one(), one()], 0..=DAMPING_MOST, 0..=EXTRA_INSENSITIVE)
            .prop_map(|(hertz, damping, kind)| Resonances { hertz, damping, kind })
    }

    proptest! {
        #[test]
        fn the_sum_of_all_weights_is_one(resonances in any_resonances()) {
            let weights = Weights::of(&resonances);
            let sum: u32 = weights.parts().iter().map(|part| u32::from(*part)).sum();
            prop_assert_eq!(sum, if weights.parts().is_empty() { 0 } else { ONE.into() });
            prop_assert_eq!(weights.parts().is_empty(), resonances.different().count() == 0);
            prop_assert!(usize::from(weights.lag()) < WEIGHTS);
        }

        #[test]
        fn what_goes_in_comes_out(
            resonances in any_resonances(), inputs in prop::collection::vec(-10_000_000i32..10_000_000, 1..150),
        ) {
            let weights = Weights::of(&resonances);
            let mut shaped = Shaped::NONE;
            let after = core::iter::repeat_n(&0, weights.lag().into());
            let (mut at, mut sum) = (0, 0);
            for input in inputs.iter().chain(after) {
                sum += shaped.put(*input, at, weights.parts());
                at = if at == weights.lag() { 0 } else { at + 1 };
            }
            prop_assert_eq!(sum, inputs.iter().sum::<i32>());
            prop_assert_eq!(shaped.rest, [0; SHAPED]);
        }
    }

    #[test]
    fn three_resonances_that_fit_have_room() {
        for hertz in [[200, 201, 0], [300, 301, 302], [250, 400, 288], [1_000, 999, 998]] {
            for (damping, kind) in [(0, MEAN), (DAMPING_MOST, EXTRA_INSENSITIVE)] {
                let resonances = Resonances { hertz, damping, kind };
                let samples: f32 =
                    resonances.different().map(|f| 10.0 / f32::from(f) / SAMPLE_S).sum();
                if resonances.fits() {
                    assert!(
                        f32::from(Weights::of(&resonances).lag()) >= samples - 0.1,
                        "{hertz:?}"
                    );
                }
            }
        }
        assert!(!Resonances { hertz: [199, 0, 0], ..Resonances::NONE }.fits());
        assert!(!Resonances { hertz: [0, 1_001, 0], ..Resonances::NONE }.fits());
        assert!(!Resonances { hertz: [250, 300, 350], ..Resonances::NONE }.fits());
        assert!(Resonances { hertz: [200, 200, 200], ..Resonances::NONE }.fits());
    }

    #[test]
    fn little_is_left_of_a_resonance() {
        // Samples of 4 ms, as on the host, are a tenth of a period at 25 Hz; those of the RP2040 are so at 50 Hz.
        let tenth_of_period = (10.0 / (10.0 * SAMPLE_S)) as u16 * 10;
        for (kind, at, near) in [(MEAN, 0.13, 0.25), (EXTRA_INSENSITIVE, 0.06, 0.07)] {
            for damping in [0.05, 0.1, 0.15] {
                let resonances = Resonances { hertz: [tenth_of_period, 0, 0], damping: 10, kind };
                let weights = Weights::of(&resonances);
                let hertz = f64::from(tenth_of_period) / 10.0;
                let here = left(&weights, hertz, damping);
                let around = [0.8, 0.9, 1.1, 1.2].map(|off| left(&weights, off * hertz, damping));
                assert!(here < at, "{kind} {damping}: {here}");
                assert!(around.iter().all(|left| *left < near), "{kind} {damping}: {around:?}");
            }
        }
    }

    #[test]
    fn equal_frequencies_share_a_filter() {
        let (one, two) = (weights([400, 0, 0], MEAN), weights([400, 400, 0], MEAN));
        assert_eq!(one.parts(), two.parts());
        let both = weights([400, 550, 0], MEAN);
        for hertz in [40.0, 55.0] {
            assert!(left(&both, hertz, 0.1) < 0.13);
        }
    }

    #[test]
    fn a_mean_is_the_same_from_either_end() {
        let parts: Vec<_> = weights([433, 0, 0], MEAN).parts().to_vec();
        let turned: Vec<_> = parts.iter().rev().copied().collect();
        assert!(parts.iter().zip(&turned).all(|(a, b)| a.abs_diff(*b) <= 1), "{parts:?}");
    }
}
