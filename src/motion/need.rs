//! The distance needed to slow down, computed in integers for a scan (`constraint`).
//!
//! Floats would cost four times as much on AVR. The highest velocity of a scan is known. The unit of velocity is the
//! power of four that gives this velocity 12 to 14 bits. The unit of distance is the square of the unit of velocity, or
//! larger where a deceleration takes much distance to build up. Velocities are rounded so that the distance comes out
//! longer, by some 0.05 %.
//!
//! Called at exec level. Units at the interface: velocities mm/s, distances brake potential, (mm/s)^2 (`constraint`).

use super::divide::root;
use super::float::{scaled, some, whole};
use super::governor::Limits;
use super::short::Short;
use crate::hal::arithmetic::product;

/// Bits of the highest velocity, or one more.
const BITS: i16 = 12;

/// Distances are clamped to these. `END`, ahead, is more than slowing down ever takes; `BEHIND` is behind the machine.
const END: u32 = 3 << 29;
const BEHIND: u32 = 1 << 29;

/// The lowest velocity that a scale is made for, as a power of two.
const LEAST: i16 = -16;

/// The units of a scan, and its limits in them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// The unit of velocity is `2^velocity`; that of distance is `2^-distance`.
    velocity: i8,
    distance: i8,
    /// By how many bits the unit of distance is more than the square of the unit of velocity.
    coarse: u8,
    /// Twice kappa, rounded up; all ones if that is above any velocity of the scale.
    twice: u16,
    /// The root of 8 kappa, 16 bits; `long` is the number of bits by which its product with the root of a velocity is
    /// too long.
    root: u16,
    long: u8,
}

/// Returns the exponent and the first 16 bits of a positive number: `bits * 2^(exponent - 15)`.
fn parts(x: f32) -> (i16, u16) {
    let bits = x.to_bits();
    (((bits >> 23) as i16) - 127, (bits >> 8) as u16 | 0x8000)
}

impl Scale {
    /// Returns the scale for velocities up to `fastest`. Cost: 300.
    #[inline(never)]
    pub fn of(fastest: f32, limits: &Limits) -> Self {
        let (exponent, _) = parts(fastest);
        let unit = (exponent.max(LEAST) - BITS) & !1;
        let (of_root, root) = parts(limits.root);
        // `need` multiplies the root by 256 times the root of a velocity, and drops 16 bits. The product is too small
        // by this power of two.
        let more = of_root - (unit >> 1) - 7;
        // The distance of some hundred slices at this velocity is to be within range as well.
        let slices = exponent + parts(limits.accel).0 - unit - unit - 28;
        let coarse = more.max(slices).clamp(0, 31);
        Self {
            velocity: unit as i8,
            distance: -(unit + unit + coarse) as i8,
            coarse: coarse as u8,
            twice: above(scaled(limits.kappa, (1 - unit) as i8)),
            root,
            long: (coarse - more).min(31) as u8,
        }
    }

    /// Returns a velocity in the unit of the scale, rounded down. Cost: 60.
    #[inline(never)]
    pub fn velocity(&self, velocity: Short) -> u16 {
        let (mantissa, power) = velocity.parts();
        self.shifted(i16::from(power) - 127, 0x8000 | u16::from(mantissa) << 7)
    }

    /// Returns a velocity in the unit of the scale, rounded up. Cost: 60.
    pub fn velocity_above(&self, velocity: f32) -> u16 {
        let (exponent, bits) = parts(velocity);
        self.shifted(exponent, bits) + 1
    }

    fn shifted(&self, exponent: i16, bits: u16) -> u16 {
        // At most 13 bits before the binary point.
        let places = (exponent - i16::from(self.velocity)).min(13);
        if places < 0 { 0 } else { bits >> (15 - places) as u8 }
    }

    /// Returns a distance in the unit of the scale. Cost: 150.
    #[inline(never)]
    pub fn distance(&self, distance: f32) -> i32 {
        if !some(distance) {
            return 0;
        }
        let far = whole(scaled(distance, self.distance).abs());
        if distance.is_sign_negative() { -(far.min(BEHIND) as i32) } else { far.min(END) as i32 }
    }

    /// Returns a distance as brake potential again. Cost: 150.
    #[inline(never)]
    pub fn potential(&self, distance: i32) -> f32 {
        if distance == 0 { 0.0 } else { scaled(distance as f32, -self.distance) }
    }

    /// Returns the distance to slow down from `from` to `to`, which is not above it. Cost: 100; 450 if the
    /// deceleration does not reach its limit.
    #[inline(never)]
    pub fn need(&self, from: u16, to: u16) -> i32 {
        let (drop, sum) = (from - to, from + to);
        let need = if drop >= self.twice {
            product(sum, drop + self.twice) >> self.coarse
        } else {
            let build = (product(self.root, root(u32::from(drop) << 16) + 1) >> 16) as u16;
            product(sum, build + 1) >> self.long
        };
        need as i32 + 1
    }

    /// Returns an upper bound of the distance to slow down from `from` to any velocity. Cost: 450.
    pub fn most(&self, from: u16) -> i32 {
        let stop = self.need(from, 0);
        stop + (stop >> 3)
    }

    /// Returns an upper bound of the distance to slow down from `from` for a key: to `to` at its place, or to any
    /// constraint after it, which has a higher key. Cost: 100.
    pub fn by_key(&self, from: u16, to: u16) -> i32 {
        if self.twice > from {
            return END as i32;
        }
        // A key below twice kappa is that of a standstill.
        let to = if to < self.twice { 0 } else { to };
        (product(from + to, from - to + self.twice) >> self.coarse) as i32 + 1
    }
}

/// Returns a positive number, rounded up, in 16 bits.
fn above(x: f32) -> u16 {
    let whole = whole(x);
    if whole < 0xFFFF { whole as u16 + 1 } else { 0xFFFF }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::constraint::needed;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn is_what_it_takes(
            top in -4.0f32..3.5, part in 0.0f32..1.0, accel in 1.0f32..4.0, build in -2.8f32..0.5,
        ) {
            let (top, accel) = (10f32.powf(top), 10f32.powf(accel));
            let limits = Limits::new(accel, accel / 10f32.powf(build));
            let scale = Scale::of(top, &limits);
            let low = Short::new(top * part);
            let from = scale.velocity_above(top);
            let to = scale.velocity(low).min(from);
            let exact = f64::from(needed(top, low.get(), limits.kappa));
            let stop = f64::from(needed(top, 0.0, limits.kappa));
            let found = f64::from(scale.potential(scale.need(from, to)));
            let most = f64::from(scale.potential(scale.most(from)));
            prop_assert!(found >= 0.9999 * exact, "{found} of {exact}");
            prop_assert!(found <= exact + 0.02 * stop, "{found} of {exact}");
            prop_assert!(exact <= most && most < 1.15 * stop, "{exact} of {most}");
            let there = f64::from(scale.potential(scale.distance(exact as f32)));
            let rounding = f64::from(scale.potential(1)) + 1e-6 * stop;
            prop_assert!((there - exact).abs() <= rounding, "{there} of {exact}");
        }

        #[test]
        fn a_key_asks_for_no_less(top in 0.1f32..500.0, part in 0.0f32..1.0, kappa in 0.001f32..500.0) {
            let limits = Limits::new(1_000.0, 1e6 / (2.0 * kappa));
            let scale = Scale::of(top, &limits);
            let from = scale.velocity_above(top);
            let to = scale.velocity(Short::new(top * part)).min(from);
            // Coming to a standstill there is enough.
            let need = scale.need(from, to).min(scale.need(from, 0));
            prop_assert!(scale.by_key(from, to) >= need - (need >> 10));
        }
    }
}
