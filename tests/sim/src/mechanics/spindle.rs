//! A spindle that takes time to change its speed.
//!
//! Its speed approaches the speed that it is driven to exponentially, which also averages a pulse-width drive. Turns
//! are counted each millisecond. An index pulse within a millisecond is placed as if the speed were constant during
//! it.

use super::encoder::Encoder;
use super::random::Random;
use crate::mechanics::build::Spindle as Build;

const NEVER: u64 = u64::MAX;
/// Speed below which the spindle stands still, turns a minute.
const STANDSTILL: f64 = 0.5;
/// Length of an index pulse, as a share of a turn.
const PULSE: f64 = 0.01;

/// Delay of the encoder's edges behind the angle of the spindle, s. All edges have the same delay, so the firmware
/// cannot notice it.
const LATE_S: f64 = 0.001;

/// How the spindle is driven.
#[derive(Clone, Copy, Default)]
struct Drive {
    enabled: bool,
    reversed: bool,
    /// Duty cycle of the drive.
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
    /// Every how many index pulses one is left out, and the number of index pulses so far.
    missed_every: Option<u64>,
    pulses: u64,
    /// Edges of the index pin to come.
    edges: Vec<(u64, bool)>,
    encoder: Option<Encoder>,
    random: Random,
    /// Loss of speed to a cut, turns a minute in a second.
    load: f64,
    /// Amplitude and frequency (Hz) of the swing of that loss.
    swing: (f64, f64),
}

impl Spindle {
    /// A spindle at rest.
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

    /// Returns the speed at `now`, turns a minute; negative counter-clockwise.
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

    /// Whether the speed depends on more than the drive: on a limited torque or a cut.
    fn is_weak(&self) -> bool {
        self.build.torque.is_finite() || self.load != 0.0 || self.swing.0 != 0.0
    }

    /// Its encoder, if it has one.
    pub fn encoder(&mut self) -> Option<&mut Encoder> {
        self.encoder.as_mut()
    }

    /// Sets the load of a cut from now on: `load` turns a minute in a second, plus and minus `swing` at a frequency
    /// of `hertz`.
    pub fn set_load(&mut self, load: f64, swing: f64, hertz: f64, now: u64) {
        self.pass(now);
        (self.load, self.swing) = (load, (swing, hertz));
    }

    /// Makes the spindle turn at this speed from now on, and drives it to this speed, whatever its drive was.
    pub fn force(&mut self, rpm: f64, now: u64) {
        self.pass(now);
        self.rpm = rpm;
        self.build.rpm = rpm.abs();
        self.build.pwm = None;
        self.drive = Drive { enabled: rpm != 0.0, reversed: rpm < 0.0, share: 1.0 };
    }

    /// Drives the spindle to another speed from now on.
    pub fn drive_to(&mut self, rpm: f64, now: u64) {
        self.pass(now);
        self.build.rpm = rpm.abs();
        self.drive = Drive { enabled: rpm != 0.0, reversed: rpm < 0.0, share: 1.0 };
    }

    /// Turns so far.
    pub fn turns(&self) -> f64 {
        self.turns
    }

    /// Leaves out one in every so many index pulses.
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

    /// Reverses the drive.
    pub fn reverse(&mut self, reversed: bool, now: u64) {
        self.pass(now);
        self.drive.reversed = reversed;
    }

    /// An edge of the pulse-width drive.
    pub fn pulse(&mut self, high: bool, now: u64) {
        self.drive_by(f64::from(u8::from(high)), now);
    }

    /// Sets the duty cycle of the pulse-width drive from now on.
    pub fn drive_by(&mut self, share: f64, now: u64) {
        self.pass(now);
        self.drive.share = share;
    }

    /// Cycle at which `advance` must be called next.
    pub fn due(&self) -> u64 {
        if self.build.index.is_none() && self.encoder.is_none() {
            return NEVER;
        }
        let edge = self.edges.first().map_or(NEVER, |(at, _)| *at);
        let edge = edge.min(self.encoder.as_ref().map_or(NEVER, Encoder::due));
        let turns = self.target() != 0.0 || self.rpm.abs() > STANDSTILL;
        edge.min(if turns { self.at + (self.clock_hz / 1000.0) as u64 } else { NEVER })
    }

    /// Goes on to `now`. Returns the new level of the index pin if it changes.
    pub fn advance(&mut self, now: u64) -> Option<bool> {
        if now >= self.at + (self.clock_hz / 1000.0) as u64 {
            self.pass(now);
        }
        let due = self.edges.iter().take_while(|(at, _)| *at <= now).count();
        self.edges.drain(..due).next_back().map(|(_, high)| high)
    }

    /// Goes on to `now`, and plans the index pulses of the millisecond that has passed.
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
