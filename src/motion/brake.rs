//! A brake: the way down from a state to a velocity at a place, in phases of constant jerk.
//!
//! Made by the [`Governor`](super::governor::Governor) when it has to slow down, and followed by it
//! stretch by stretch, whatever length they have: distances are integrals, so that it comes out where it
//! was to, to what floats are off.
//!
//! Five phases: an acceleration ends, the velocity is kept until it is time to brake, alpha falls, is kept,
//! and rises to 0 again. Units as in `reach`, s. Cost on AVR: 4,500
//! cycles to make, 1,500 a stretch and 1,000 more in which phases change.

use super::float::{greater, lesser};
use super::governor::{Governor, Stretch};
use super::reach::{Ahead, Demand, Reach};
use super::state::State;
use crate::math::sqrt;

/// What is left of a brake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brake {
    /// Velocity at its end, mm/s.
    pub velocity: f32,
    /// There are other limits to be thought of.
    pub alone: bool,
    /// What is left of the phases, s.
    level: f32,
    coast: f32,
    fall: f32,
    hold: f32,
    rise: f32,
    /// How fast alpha falls, and rises, in a second.
    pace: f32,
    ease: f32,
}

impl Brake {
    /// The alpha to go on with from here: easing begins with what it ends with.
    fn alpha(&self, alpha: f32) -> f32 {
        if self.is_easing() { -self.ease * self.rise } else { alpha }
    }

    /// It is in its last phase.
    fn is_easing(&self) -> bool {
        self.hold <= 0.0 && self.fall <= 0.0 && self.coast <= 0.0 && self.level <= 0.0
    }

    /// It is done in `t` seconds or less.
    fn is_within(&self, t: f32) -> bool {
        self.is_easing() && self.rise <= t
    }

    /// The phase it is in: change of alpha in a second, and how long it takes, s.
    fn phase(&mut self) -> (f32, &mut f32) {
        if self.level > 0.0 {
            (-self.pace, &mut self.level)
        } else if self.coast > 0.0 {
            (0.0, &mut self.coast)
        } else if self.fall > 0.0 {
            (-self.pace, &mut self.fall)
        } else if self.hold > 0.0 {
            (0.0, &mut self.hold)
        } else {
            (self.ease, &mut self.rise)
        }
    }

    /// How long it goes on, s.
    fn rest(&self) -> f32 {
        self.level + self.coast + self.fall + self.hold + self.rise
    }
}

/// The share of the acceleration limit that a ramp over `drop` gets to.
fn full_share(drop: f32, kappa: f32) -> f32 {
    let twice = kappa + kappa;
    if drop < twice { sqrt(drop / twice) } else { 1.0 }
}

/// Making brakes. They are methods of the governor, and not functions of its parts, for the sake of the
/// arguments: see `state`.
impl Governor {
    /// From where it is to what is demanded.
    #[inline(never)]
    fn brake_for(&self, reach: &Reach, demand: &Demand) -> Brake {
        if self.state.alpha < 0.0 {
            return match self.soft(demand) {
                Some(brake) => brake,
                None => self.harder(reach, demand),
            };
        }
        let (pace, velocity) = (self.limits.pace, demand.velocity);
        let drop = reach.top() - velocity;
        let share = full_share(drop, self.limits.kappa);
        let rise = share / pace;
        let hold = greater(drop / (share * self.limits.accel) - rise, 0.0);
        let coast = 0.5 * greater(demand.slack, 0.0) / (self.limits.accel * reach.top());
        let level = self.state.alpha / pace;
        let alone = demand.alone;
        Brake { velocity, level, coast, fall: rise, hold, rise, ease: pace, pace, alone }
    }

    /// It brakes already, but not as hard as it has to: just so hard.
    #[inline(never)]
    fn harder(&self, reach: &Reach, demand: &Demand) -> Brake {
        let velocity = demand.velocity;
        let (drop, sum) = (reach.top() - velocity, reach.top() + velocity);
        let product = drop * sum;
        let way = demand.way - reach.spent();
        let root = sqrt(way * way - 8.0 * self.limits.kappa * sum * product);
        let share = lesser(2.0 * product / (way + root), full_share(drop, self.limits.kappa));
        let mut brake = self.braking(share, drop);
        brake.velocity = velocity;
        brake.alone = demand.alone;
        brake
    }

    /// Three phases to a standstill, from a top that is past.
    fn braking(&self, share: f32, drop: f32) -> Brake {
        let pace = self.limits.pace;
        let rise = share / pace;
        let fall = greater(rise + self.state.alpha / pace, 0.0);
        let hold = greater(drop / (share * self.limits.accel) - rise, 0.0);
        let (velocity, level, coast) = (0.0, 0.0, 0.0);
        Brake { velocity, level, coast, fall, hold, rise, ease: pace, pace, alone: true }
    }

    /// To a standstill, as fast as may be.
    fn hardest(&self) -> Brake {
        let alpha = self.state.alpha;
        let top = self.state.velocity + self.limits.kappa * alpha * alpha;
        let share = greater(full_share(top, self.limits.kappa), -alpha);
        self.braking(share, top)
    }

    /// It brakes as hard as it has to, or harder, or else `None`: keeps that, and
    /// eases it slower than it could.
    #[inline(never)]
    fn soft(&self, demand: &Demand) -> Option<Brake> {
        let State { velocity, alpha } = self.state;
        let limits = &self.limits;
        let w = demand.velocity;
        let brake = -alpha * limits.accel;
        let drop = velocity - w;
        // The way that is left if it braked so to the end: `brake rise^2 / 24 + w rise / 2`.
        let way = 0.5 * demand.way / limits.accel;
        let rest = way - 0.5 * drop * (velocity + w) / brake;
        if rest <= 0.0 {
            return None;
        }
        let half = 0.5 * w;
        let mut rise = 2.0 * rest / (half + sqrt(half * half + brake * rest * (1.0 / 6.0)));
        if rise < -0.9999 * alpha / limits.pace {
            return None;
        }
        let mut hold = drop / brake - 0.5 * rise;
        if hold < 0.0 {
            hold = 0.0;
            // Nothing but a parabola to the end: if it is too far, from a lower acceleration.
            rise = 3.0 * way / (velocity + w + w);
        }
        let ease =
            if hold > 0.0 { -alpha / rise } else { 2.0 * drop / (limits.accel * rise * rise) };
        let (pace, alone) = (limits.pace, demand.alone);
        let fall = 0.0;
        Some(Brake { velocity: w, level: fall, coast: fall, fall, hold, rise, pace, ease, alone })
    }
}

impl Governor {
    /// Begins to brake.
    #[inline(never)]
    pub(super) fn brake(&mut self, left: f32, ahead: &impl Ahead, nominal: f32) -> Stretch {
        let reach = Reach::new(self.state.velocity, self.state.alpha, self.limits.kappa);
        match reach.demand(2.0 * self.limits.accel * left, ahead) {
            Some(demand) if demand.fits => {
                self.brake = Some(self.brake_for(&reach, &demand));
                self.follow(left, ahead, nominal)
            }
            _ => self.hard(left, ahead, nominal),
        }
    }

    /// Brakes as hard as it may, for a stretch.
    #[inline(never)]
    pub(super) fn hard(&mut self, left: f32, ahead: &impl Ahead, nominal: f32) -> Stretch {
        self.brake = Some(self.hardest());
        let stretch = self.run(left, ahead, nominal);
        self.brake = None;
        stretch
    }

    /// Goes on with a brake; harder than that, if it would not be safe for what comes after.
    #[inline(never)]
    pub(super) fn follow(&mut self, left: f32, ahead: &impl Ahead, nominal: f32) -> Stretch {
        let before = self.state;
        let (alone, velocity) = self.brake.as_ref().map_or((true, 0.0), |b| (b.alone, b.velocity));
        let stretch = self.run(left, ahead, nominal);
        if alone {
            return stretch;
        }
        let reach = Reach::new(self.state.velocity, self.state.alpha, self.limits.kappa);
        let rest = if stretch.ends { 0.0 } else { left - stretch.distance };
        if reach.safe(2.0 * self.limits.accel * rest, ahead, velocity) {
            return stretch;
        }
        self.state = before;
        self.hard(left, ahead, nominal)
    }

    /// A stretch of a brake.
    #[inline(never)]
    fn run(&mut self, left: f32, ahead: &impl Ahead, nominal: f32) -> Stretch {
        let accel = self.limits.accel;
        let state = &mut self.state;
        let mut most = nominal;
        let mut stretch = Stretch { seconds: 0.0, distance: 0.0, ends: false };
        while let Some(brake) = &mut self.brake {
            state.alpha = brake.alpha(state.alpha);
            let (rate, rest) = brake.phase();
            let mut time = lesser(*rest, most - stretch.seconds);
            let way = state.way(time, rate, accel);
            if stretch.distance + way >= left {
                stretch.ends = true;
                time = state.time(left - stretch.distance, time, rate, accel);
            }
            stretch.distance += way;
            stretch.seconds += time;
            state.velocity = greater(state.velocity_after(time, rate, accel), 0.0);
            state.alpha += rate * time;
            *rest -= time;
            let through = *rest <= 0.0;
            let done = brake.is_within(0.05 * nominal);
            if done {
                *state = State { velocity: brake.velocity, alpha: 0.0 };
            }
            let full = !through || stretch.seconds >= most;
            // What would be left, of the block or the brake, is not worth a stretch.
            let short = left - stretch.distance <= 0.5 * nominal * state.velocity
                || brake.is_within(0.25 * nominal);
            if done {
                self.brake = None;
            }
            if stretch.ends || (full && (most > nominal || !short)) {
                break;
            }
            if full {
                most += nominal;
            }
        }
        self.close(left, stretch, ahead, nominal)
    }

    /// A stretch of a brake that has come to the end of the block, or of itself.
    #[inline(never)]
    fn close(&mut self, left: f32, got: Stretch, ahead: &impl Ahead, nominal: f32) -> Stretch {
        let v = self.state.velocity;
        let mut seconds = got.seconds;
        if got.ends {
            if let Some(brake) = &self.brake
                && let Some(anchor) = ahead.anchor(0)
                && self.here(anchor.ahead)
                && v > anchor.velocity
                && self.takes(&anchor, v)
            {
                // If it is braking for this it should have got there by now: what is left is rounding.
                if brake.velocity.to_bits() == anchor.velocity.to_bits() {
                    seconds += lesser(brake.rest(), 4.0 * nominal);
                }
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
