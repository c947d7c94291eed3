//! A brake: the way down from a state to a velocity at a place, in phases of constant jerk.
//!
//! Made by the [`Governor`](super::governor::Governor) when it has to slow down, and followed by it
//! stretch by stretch, whatever length they have: distances are integrals, so that it comes out where it
//! was to, to what floats are off.
//!
//! Three phases: alpha falls, is kept, and rises to 0 again. Units as in `reach`, s. Cost on AVR: 4,500
//! cycles to make, 1,500 a stretch and 1,000 more in which phases change.

use super::float::{greater, lesser};
use super::governor::{Governor, Stretch};
use super::reach::{Ahead, Demand, Reach};
use super::state::{Curve, Limits, State};
use crate::math::sqrt;

/// A part of a brake.
#[derive(Clone, Copy, Debug)]
pub struct Phase {
    /// Change of alpha in a second.
    pub rate: f32,
    /// How long it takes, s.
    pub time: f32,
}

/// What is left of a brake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brake {
    /// Velocity at its end, mm/s.
    pub velocity: f32,
    /// There are other limits to be thought of.
    pub alone: bool,
    fall: f32,
    hold: f32,
    rise: f32,
    /// How fast alpha falls, and rises, in a second.
    pace: f32,
    ease: f32,
}

impl Brake {
    /// From a state to what is demanded.
    #[inline(never)]
    pub fn new(state: &State, reach: &Reach, demand: &Demand, limits: &Limits) -> Self {
        if demand.share + state.alpha <= 0.0 {
            return Self::soft(state, demand, limits);
        }
        let mut share = demand.share;
        let pace = limits.pace;
        let drop = reach.top() - demand.velocity;
        let mut hold = drop / (share * limits.accel) - share / pace;
        if hold < 0.0 {
            share = sqrt(0.5 * drop / limits.kappa);
            hold = 0.0;
        }
        let rise = share / pace;
        let fall = rise + state.alpha / pace;
        Brake { velocity: demand.velocity, fall, hold, rise, pace, ease: pace, alone: demand.alone }
    }

    /// To a standstill, as fast as may be.
    pub fn hard(state: &State, reach: &Reach, limits: &Limits) -> Self {
        let demand = Demand { velocity: 0.0, way: 0.0, share: 1.0, fits: true, alone: true };
        Self::new(state, reach, &demand, limits)
    }

    /// It brakes as hard as it has to, or harder: keeps that, and eases it slower than it could.
    fn soft(state: &State, demand: &Demand, limits: &Limits) -> Self {
        let w = demand.velocity;
        let brake = -state.alpha * limits.accel;
        let drop = state.velocity - w;
        // The way that is left if it braked so to the end: `brake rise^2 / 24 + w rise / 2`.
        let way = 0.5 * demand.way / limits.accel;
        let rest = greater(way - 0.5 * drop * (state.velocity + w) / brake, 0.0);
        let half = 0.5 * w;
        let mut rise = 2.0 * rest / (half + sqrt(half * half + brake * rest * (1.0 / 6.0)));
        let least = -state.alpha / limits.pace;
        // What the way left does not allow, rounding asks for.
        rise = greater(rise, least);
        let mut hold = drop / brake - 0.5 * rise;
        if hold < 0.0 {
            hold = 0.0;
            // Nothing but a parabola to the end: if it is too far, from a lower acceleration.
            rise = 3.0 * way / (state.velocity + w + w);
        }
        let ease = 2.0 * drop / (limits.accel * rise * rise);
        let ease = if hold > 0.0 { -state.alpha / rise } else { ease };
        Brake { velocity: w, fall: 0.0, hold, rise, pace: limits.pace, ease, alone: demand.alone }
    }

    /// The alpha to go on with from here: easing begins with what it ends with.
    pub fn alpha(&self, alpha: f32) -> f32 {
        if self.fall <= 0.0 && self.hold <= 0.0 { -self.ease * self.rise } else { alpha }
    }

    /// The phase it is in. `None` when it is done.
    pub fn phase(&self) -> Option<Phase> {
        if self.fall > 0.0 {
            Some(Phase { rate: -self.pace, time: self.fall })
        } else if self.hold > 0.0 {
            Some(Phase { rate: 0.0, time: self.hold })
        } else if self.rise > 0.0 {
            Some(Phase { rate: self.ease, time: self.rise })
        } else {
            None
        }
    }

    /// How long it goes on, s.
    pub fn rest(&self) -> f32 {
        self.fall + self.hold + self.rise
    }

    /// So much of the phase is done.
    pub fn pass(&mut self, t: f32) {
        if self.fall > 0.0 {
            self.fall -= t;
        } else if self.hold > 0.0 {
            self.hold -= t;
        } else {
            self.rise -= t;
        }
    }
}

impl Governor {
    /// Begins to brake.
    #[inline(never)]
    pub(super) fn brake(&mut self, left: f32, ahead: &impl Ahead, nominal: f32) -> Stretch {
        let reach = Reach::new(self.state.velocity, self.state.alpha, self.limits.kappa);
        match reach.demand(2.0 * self.limits.accel * left, ahead) {
            Some(demand) if demand.fits => {
                let brake = Brake::new(&self.state, &reach, &demand, &self.limits);
                self.follow(brake, left, ahead, nominal)
            }
            _ => self.hard(left, ahead, nominal),
        }
    }

    /// Brakes as hard as it may, for a stretch.
    #[inline(never)]
    fn hard(&mut self, left: f32, ahead: &impl Ahead, nominal: f32) -> Stretch {
        let reach = Reach::new(self.state.velocity, self.state.alpha, self.limits.kappa);
        let brake = Brake::hard(&self.state, &reach, &self.limits);
        let stretch = self.run(brake, left, ahead, nominal);
        self.brake = None;
        stretch
    }

    /// Goes on with a brake; harder than that, if it would not be safe for what comes after.
    #[inline(never)]
    pub(super) fn follow(
        &mut self,
        brake: Brake,
        left: f32,
        ahead: &impl Ahead,
        nominal: f32,
    ) -> Stretch {
        let before = self.state;
        let stretch = self.run(brake, left, ahead, nominal);
        if brake.alone {
            return stretch;
        }
        let reach = Reach::new(self.state.velocity, self.state.alpha, self.limits.kappa);
        let rest = if stretch.ends { 0.0 } else { left - stretch.distance };
        if reach.safe(2.0 * self.limits.accel * rest, ahead, brake.velocity) {
            return stretch;
        }
        self.state = before;
        self.hard(left, ahead, nominal)
    }

    /// A stretch of a brake.
    #[inline(never)]
    fn run(&mut self, mut brake: Brake, left: f32, ahead: &impl Ahead, nominal: f32) -> Stretch {
        let accel = self.limits.accel;
        let mut state = self.state;
        let mut most = nominal;
        let mut stretch = Stretch { seconds: 0.0, distance: 0.0, ends: false };
        while let Some(phase) = brake.phase() {
            state.alpha = brake.alpha(state.alpha);
            let mut time = lesser(phase.time, most - stretch.seconds);
            let way = state.way(time, phase.rate, accel);
            if stretch.distance + way >= left {
                stretch.ends = true;
                let curve = Curve { t: time, rate: phase.rate, accel };
                time = state.time(left - stretch.distance, &curve);
            }
            stretch.distance += way;
            stretch.seconds += time;
            state.velocity = greater(state.velocity_after(time, phase.rate, accel), 0.0);
            state.alpha += phase.rate * time;
            brake.pass(time);
            if stretch.ends {
                break;
            }
            if time < phase.time || stretch.seconds >= most {
                // What would be left is not worth a stretch.
                if most > nominal || left - stretch.distance > 0.5 * nominal * state.velocity {
                    break;
                }
                most += nominal;
            }
        }
        self.brake = Some(brake);
        if brake.phase().is_none() {
            state = State { velocity: brake.velocity, alpha: 0.0 };
            self.brake = None;
        }
        self.state = state;
        self.close(left, stretch, ahead, nominal)
    }

    /// A stretch of a brake that has come to the end of the block, or of itself.
    fn close(&mut self, left: f32, got: Stretch, ahead: &impl Ahead, nominal: f32) -> Stretch {
        let v = self.state.velocity;
        let mut seconds = got.seconds;
        if got.ends {
            if let Some(brake) = self.brake
                && let Some(anchor) = ahead.anchor(0)
                && anchor.ahead <= 0.0
                && v > anchor.velocity
            {
                // It should have got there by now: what is left is rounding.
                seconds += lesser(brake.rest(), nominal);
                self.state = State { velocity: anchor.velocity, alpha: 0.0 };
                self.brake = None;
            }
            return Stretch { seconds, distance: left, ends: true };
        }
        let rest = left - got.distance;
        if self.brake.is_some() || rest > 0.5 * nominal * (v + self.crawl(nominal)) {
            return got;
        }
        seconds += if v * nominal > rest { rest / v } else { nominal };
        let mut state = self.state;
        self.arrive(&mut state, ahead);
        self.state = state;
        Stretch { seconds, distance: left, ends: true }
    }
}
