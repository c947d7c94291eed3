//! A spindle that takes its time.
//!
//! Its speed approaches what it is driven to exponentially, which also averages a pulse-width drive. Turns are
//! counted each millisecond; an index pulse is at its place between two of these as if the speed did not change
//! there.

use super::encoder::Encoder;
use super::random::Random;
use crate::mechanics::build::Spindle as Build;

const NEVER: u64 = u64::MAX;
/// Turns a minute that are a standstill.
const STANDSTILL: f64 = 0.5;
/// The part of a turn that an index pulse lasts.
const PULSE: f64 = 0.01;

/// The edges of an encoder come so much later than the spindle turns, s: all of them, so that nobody can tell.
const LATE_S: f64 = 0.001;

/// What drives it.
#[derive(Clone, Copy, Default)]
struct Drive {
    enabled: bool,
    reversed: bool,
    /// The part of its time that it is driven.
    share: f64,
}

/// A spindle.
pub struct Spindle {
    build: Build,
    clock_hz: f64,
    drive: Drive,
    /// Turns a minute at cycle `at`, negative counter-clockwise.
    rpm: f64,
    turns: f64,
    at: u64,
    /// Index pulses that are left out: every so many, and how many there were.
    missed_every: Option<u64>,
    pulses: u64,
    /// Edges of the index pin to come.
    edges: Vec<(u64, bool)>,
    encoder: Option<Encoder>,
    random: Random,
    /// What a cut takes of its speed: turns a minute in a second.
    load: f64,
    /// How much that swings, and how often in a second.
    swing: (f64, f64),
}

impl Spindle {
    /// At rest.
    pub fn new(build: Build, clock_hz: u32) -> Self {
        Spindle {
            build,
            clock_hz: f64::from(clock_hz),
            drive: Drive::default(),
            rpm: 0.0,
            turns: 0.0,
            at: 0,
            missed_every: None,
            pulses: 0,
            edges: Vec::new(),
            encoder: build.sensors.map(Encoder::new),
            random: Random::new(1),
            load: 0.0,
            swing: (0.0, 0.0),
        }
    }

    /// Its speed at `now`, turns a minute; negative counter-clockwise.
    pub fn rpm(&self, now: u64) -> f64 {
        let seconds = now.saturating_sub(self.at) as f64 / self.clock_hz;
        let target = self.target();
        if self.is_weak() {
            let wanted = (target - self.rpm) / self.build.time_constant;
            let phase = self.at as f64 / self.clock_hz * self.swing.1 * std::f64::consts::TAU;
            let load = self.load + self.swing.0 * phase.sin();
            let change =
                wanted.clamp(-self.build.torque, self.build.torque) - load * self.rpm.signum();
            return self.rpm + change * seconds;
        }
        target + (self.rpm - target) * (-seconds / self.build.time_constant).exp()
    }

    /// Whether what it does depends on more than its drive.
    fn is_weak(&self) -> bool {
        self.build.torque.is_finite() || self.load != 0.0 || self.swing.0 != 0.0
    }

    /// Its encoder, if it has one.
    pub fn encoder(&mut self) -> Option<&mut Encoder> {
        self.encoder.as_mut()
    }

    /// A cut takes so many turns a minute in a second from now on, which swings by `swing` so often in a second.
    pub fn set_load(&mut self, load: f64, swing: f64, hertz: f64, now: u64) {
        self.pass(now);
        (self.load, self.swing) = (load, (swing, hertz));
    }

    /// Whatever drives it, from now on it turns so fast and is driven to that.
    pub fn force(&mut self, rpm: f64, now: u64) {
        self.pass(now);
        self.rpm = rpm;
        self.build.rpm = rpm.abs();
        self.build.pwm = None;
        self.drive = Drive { enabled: rpm != 0.0, reversed: rpm < 0.0, share: 1.0 };
    }

    /// Is driven to another speed from now on.
    pub fn drive_to(&mut self, rpm: f64, now: u64) {
        self.pass(now);
        self.build.rpm = rpm.abs();
        self.drive = Drive { enabled: rpm != 0.0, reversed: rpm < 0.0, share: 1.0 };
    }

    /// Turns so far.
    pub fn turns(&self) -> f64 {
        self.turns
    }

    /// Leaves every so many index pulses out.
    pub fn miss_every(&mut self, pulses: Option<u64>) {
        self.missed_every = pulses;
    }

    fn target(&self) -> f64 {
        let share = if self.build.pwm.is_none() { 1.0 } else { self.drive.share };
        let rpm = if self.drive.enabled { self.build.rpm * share } else { 0.0 };
        if self.drive.reversed { -rpm } else { rpm }
    }

    /// Switches it on or off.
    pub fn enable(&mut self, on: bool, now: u64) {
        self.pass(now);
        self.drive.enabled = on;
    }

    /// Turns its drive round.
    pub fn reverse(&mut self, reversed: bool, now: u64) {
        self.pass(now);
        self.drive.reversed = reversed;
    }

    /// An edge of the pulse-width drive.
    pub fn pulse(&mut self, high: bool, now: u64) {
        self.drive_by(f64::from(u8::from(high)), now);
    }

    /// The pulse-width drive is high for a part of its period from now on.
    pub fn drive_by(&mut self, share: f64, now: u64) {
        self.pass(now);
        self.drive.share = share;
    }

    /// When it wants to be looked at next.
    pub fn due(&self) -> u64 {
        if self.build.index.is_none() && self.encoder.is_none() {
            return NEVER;
        }
        let edge = self.edges.first().map_or(NEVER, |(at, _)| *at);
        let edge = edge.min(self.encoder.as_ref().map_or(NEVER, Encoder::due));
        let turns = self.target() != 0.0 || self.rpm.abs() > STANDSTILL;
        edge.min(if turns { self.at + (self.clock_hz / 1000.0) as u64 } else { NEVER })
    }

    /// What the index pin does at `now`.
    pub fn advance(&mut self, now: u64) -> Option<bool> {
        if now >= self.at + (self.clock_hz / 1000.0) as u64 {
            self.pass(now);
        }
        let due = self.edges.iter().take_while(|(at, _)| *at <= now).count();
        self.edges.drain(..due).next_back().map(|(_, high)| high)
    }

    /// Goes on to `now`, and plans the index pulses of the millisecond behind it.
    fn pass(&mut self, now: u64) {
        let rpm = self.rpm(now);
        let cycles = now.saturating_sub(self.at) as f64;
        let (began, from) = (self.at, self.turns);
        self.turns += (rpm + self.rpm) / 2.0 / 60.0 * cycles / self.clock_hz;
        (self.rpm, self.at) = (rpm, now);
        self.plan_index();
        if let Some(encoder) = &mut self.encoder {
            let late = (LATE_S * self.clock_hz) as u64;
            encoder.turn(from, self.turns, began + late, now + late, &mut self.random);
        }
    }

    fn plan_index(&mut self) {
        let speed = self.rpm.abs() / 60.0 / self.clock_hz;
        if self.build.index.is_none() || !self.edges.is_empty() || speed == 0.0 {
            return;
        }
        let turns = self.turns * self.rpm.signum();
        let to_index = (turns.floor() + 1.0 - turns) / speed;
        if to_index > self.clock_hz / 1000.0 {
            return;
        }
        self.pulses += 1;
        if self.missed_every.is_some_and(|n| self.pulses.is_multiple_of(n)) {
            return;
        }
        let at = self.at + to_index as u64;
        self.edges.extend([(at, true), (at + (PULSE / speed) as u64, false)]);
    }
}
