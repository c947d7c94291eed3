//! Velocity and acceleration, and how they go on at constant jerk.
//!
//! Used by the [`Governor`](super::governor::Governor). The acceleration is alpha times its limit, alpha from
//! -1 to 1, so that the arithmetic of `reach` needs neither. Cost on AVR: 1,000 cycles for a way or a velocity.

use super::float::lesser;

/// Limits of the block that runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// mm/s^2.
    pub accel: f32,
    /// mm/s^3, 0 for none.
    pub jerk: f32,
    /// `accel^2 / 2 jerk`, mm/s.
    pub kappa: f32,
    /// `jerk / accel`: how much alpha may change in a second.
    pub pace: f32,
}

/// A time of constant jerk. In one, as arguments that do not fit into registers go wrong on AVR.
#[derive(Clone, Copy, Debug)]
pub struct Curve {
    /// How long it lasts, s.
    pub t: f32,
    /// By how much alpha changes in a second.
    pub rate: f32,
    /// The acceleration limit, mm/s^2.
    pub accel: f32,
}

/// Velocity and acceleration along the path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// mm/s.
    pub velocity: f32,
    /// Share of the acceleration limit, with a jerk limit.
    pub alpha: f32,
}

impl State {
    /// The velocity after `t` seconds in which alpha changes by `rate` a second; `accel` is the limit.
    pub fn velocity_after(&self, t: f32, rate: f32, accel: f32) -> f32 {
        self.velocity + accel * t * (self.alpha + 0.5 * rate * t)
    }
    /// The way in this time.
    pub fn way(&self, t: f32, rate: f32, accel: f32) -> f32 {
        t * (self.velocity + 0.5 * accel * t * (self.alpha + rate * t * (1.0 / 3.0)))
    }
    /// The time it takes for `way`, no more than `t`; velocity does not rise.
    #[inline(never)]
    pub fn time(&self, way: f32, curve: &Curve) -> f32 {
        let Curve { t, rate, accel } = *curve;
        let mut time = lesser(way / self.velocity, t);
        for _ in 0..3 {
            let speed = self.velocity_after(time, rate, accel);
            if speed * 100.0 > self.velocity {
                time += (way - self.way(time, rate, accel)) / speed;
            }
            time = lesser(time, t);
        }
        time
    }
}
