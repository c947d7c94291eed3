//! A machine around the chip: carriages, switches, a plate to probe, a spindle, a door, an emergency stop.
//!
//! It counts the step pulses, so it knows where each carriage is, and works the switches there. A pin changes in the
//! cycle of the pulse that brings the carriage to its switch. [`Build`] says how the machine is made. [`Mechanics`]
//! can be tampered with while it runs: switches that bounce or stick, noise on a wire, missing index pulses. (Errors
//! of the serial line belong to [`Wire`](crate::Wire).)
//!
//! Nothing here runs in each cycle: `due` says when the next event comes. Inputs are numbered as in
//! [`kerf::boards::inputs`].

mod build;
mod carriage;
mod encoder;
mod line;
mod random;
mod spindle;
#[cfg(test)]
mod tests;

use kerf::boards::{Board, MOTORS, Pin, inputs};

pub use build::{Axis, Build, Sensors, Spindle as SpindleBuild, Switch, Wiring};
pub use encoder::Encoder;
pub use line::Bounce;
pub use random::Random;

use carriage::Carriage;
use line::Line;
use spindle::Spindle;

/// The state of a machine.
pub struct Mechanics {
    carriages: [Carriage; MOTORS],
    plate: Option<i64>,
    /// Slope of the plate: its rise per millimetre along X and along Y.
    tilt: [f64; 2],
    lines: Vec<Line>,
    /// Index of each input's line; `None` for an input that is not wired.
    line_of: [Option<usize>; inputs::COUNT],
    spindle: Spindle,
    index: Option<Pin>,
    random: Random,
    /// The cycles at which index pulses of the encoder began, each with the position of every carriage, in steps.
    indexed: Vec<(u64, [i64; MOTORS])>,
}

impl Mechanics {
    /// Builds a machine on the pins of a board.
    pub fn new(build: &Build, board: &Board) -> Self {
        let mut mechanics = Mechanics {
            carriages: build.axes.each_ref().map(Carriage::new),
            plate: build.plate.map(|height| build.axes[2].steps(height)),
            tilt: [0.0; 2],
            lines: Vec::new(),
            line_of: [None; inputs::COUNT],
            spindle: Spindle::new(build.spindle, board.clock_hz),
            index: build.spindle.index,
            random: Random::new(build.seed),
            indexed: Vec::new(),
        };
        for (a, axis) in build.axes.iter().enumerate() {
            for (end, switch) in [axis.min, axis.max].into_iter().enumerate() {
                mechanics.wire(2 * a + end, switch.map(|s| s.wiring), board);
            }
        }
        mechanics.wire(inputs::PROBE, Some(build.probe), board);
        mechanics.wire(inputs::DOOR, build.door, board);
        mechanics.wire(inputs::STOP, build.stop, board);
        (0..MOTORS).for_each(|axis| mechanics.work_contacts(axis, [false; 3], 0));
        mechanics
    }

    fn wire(&mut self, input: usize, wiring: Option<Wiring>, board: &Board) {
        let (Some(wiring), Some(pin)) = (wiring, board.inputs[input]) else { return };
        let found = self.lines.iter().position(|line| line.pin() == pin);
        self.line_of[input] = Some(found.unwrap_or(self.lines.len()));
        if found.is_none() {
            self.lines.push(Line::new(pin, wiring));
        }
    }

    /// Where the carriage of an axis is, in millimetres from its lower hard end.
    pub fn position(&self, axis: usize) -> f64 {
        self.carriages[axis].position()
    }

    /// Steps that an axis has lost at its hard ends.
    pub fn lost(&self, axis: usize) -> u64 {
        self.carriages[axis].lost()
    }

    /// Whether the contact of an input is worked, whatever the level of its wire.
    pub fn is_worked(&self, input: usize) -> bool {
        self.line_of[input].is_some_and(|line| self.lines[line].is_worked(input))
    }

    /// The spindle's speed, turns a minute; negative counter-clockwise.
    pub fn spindle_rpm(&self, now: u64) -> f64 {
        self.spindle.rpm(now)
    }

    /// The spindle's turns so far.
    pub fn spindle_turns(&self) -> f64 {
        self.spindle.turns()
    }

    /// Drives the spindle by pulses that are high for `share` of their period. A timer's waveform is not simulated
    /// edge by edge, see [`Machine::pulses`](crate::Machine::pulses).
    pub fn drive_spindle(&mut self, share: f64, now: u64) {
        self.spindle.drive_by(share, now);
    }

    /// Leaves out one in every so many index pulses.
    pub fn miss_index_every(&mut self, pulses: Option<u64>) {
        self.spindle.miss_every(pulses);
    }

    /// Makes the spindle turn at this speed from now on, turns a minute, whatever drives it.
    pub fn force_spindle(&mut self, rpm: f64, now: u64) {
        self.spindle.force(rpm, now);
    }

    /// Drives the spindle to another speed from now on, turns a minute.
    pub fn drive_spindle_to(&mut self, rpm: f64, now: u64) {
        self.spindle.drive_to(rpm, now);
    }

    /// Loads the spindle with a cut from now on. The cut takes `load` turns a minute in a second from its speed, plus
    /// and minus `swing` at a frequency of `hertz`.
    pub fn load_spindle(&mut self, load: f64, swing: f64, hertz: f64, now: u64) {
        self.spindle.set_load(load, swing, hertz, now);
    }

    /// The spindle's encoder, if it has one.
    pub fn encoder(&mut self) -> Option<&mut Encoder> {
        self.spindle.encoder()
    }

    /// The cycles at which index pulses of the encoder began, each with the position of every carriage, in steps.
    pub fn indexed(&self) -> &[(u64, [i64; MOTORS])] {
        &self.indexed
    }

    /// Works the contact of an input by hand, or lets it go: for example the door or the emergency stop.
    pub fn work(&mut self, input: usize, worked: bool, now: u64) {
        if let Some(line) = self.line_of[input] {
            self.lines[line].work(input, worked, now, &mut self.random);
        }
    }

    /// Closes the contact of an input by hand, or opens it. The wiring decides whether a closed contact counts as
    /// worked.
    pub fn close(&mut self, input: usize, closed: bool, now: u64) {
        let opens = self.line_of[input].is_some_and(|line| self.lines[line].opens());
        self.work(input, closed != opens, now);
    }

    /// Puts the plate at another height, or takes it away.
    pub fn place_plate(&mut self, height: Option<f64>, now: u64) {
        let before = self.contacts(2);
        self.plate = height.map(|height| self.carriages[2].steps_at(height));
        self.work_contacts(2, before, now);
    }

    /// Tilts the plate: its rise per millimetre along X and along Y, counted from the lower hard ends of these axes.
    pub fn tilt_plate(&mut self, tilt: [f64; 2]) {
        self.tilt = tilt;
    }

    /// Sets how the contacts on the wire of an input bounce from now on; `None` ends the bouncing.
    pub fn bounce(&mut self, input: usize, bounce: Option<Bounce>) {
        self.with(input, |line| line.set_bounce(bounce));
    }

    /// Cycle at which the contacts on the wire of an input bounce for the last time.
    pub fn settles(&self, input: usize) -> u64 {
        self.line_of[input].map_or(0, |line| self.lines[line].settles())
    }

    /// Makes the wire of an input look worked or not worked from now on, whatever happens; `None` mends it.
    pub fn stick(&mut self, input: usize, worked: Option<bool>) {
        self.with(input, |line| line.set_stuck(worked));
    }

    /// Inverts the level of an input's wire for a time.
    pub fn disturb(&mut self, input: usize, from: u64, cycles: u64) {
        self.with(input, |line| line.disturb(from, cycles));
    }

    fn with(&mut self, input: usize, change: impl FnOnce(&mut Line)) {
        if let Some(line) = self.line_of[input] {
            change(&mut self.lines[line]);
        }
    }

    /// Takes a step of a motor.
    pub(crate) fn step(&mut self, motor: usize, positive: bool, now: u64) {
        for axis in 0..MOTORS {
            let before = self.contacts(axis);
            self.carriages[axis].step(motor, positive);
            self.work_contacts(axis, before, now);
        }
    }

    /// Returns which contacts the carriage of an axis works: the switches at its lower and upper end, and the probe.
    fn contacts(&self, axis: usize) -> [bool; 3] {
        let [min, max] = self.carriages[axis].ends();
        [min, max, self.touches()]
    }

    /// Whether the tool touches the plate.
    fn touches(&self) -> bool {
        let [x, y, z, _] = &self.carriages;
        let rise = self.tilt[0] * x.position() + self.tilt[1] * y.position();
        self.plate.is_some_and(|plate| z.steps() <= plate + z.steps_at(rise))
    }

    fn work_contacts(&mut self, axis: usize, before: [bool; 3], now: u64) {
        let inputs = [2 * axis, 2 * axis + 1, inputs::PROBE];
        for ((input, worked), before) in inputs.into_iter().zip(self.contacts(axis)).zip(before) {
            // A contact that was worked by hand keeps its state.
            if worked != before {
                self.work(input, worked, now);
            }
        }
    }

    /// Takes a change of a pin that drives the spindle.
    pub(crate) fn spindle(&mut self, pin: SpindlePin, high: bool, now: u64) {
        match pin {
            SpindlePin::Enable => self.spindle.enable(high, now),
            SpindlePin::Reverse => self.spindle.reverse(high, now),
            SpindlePin::Pulse => self.spindle.pulse(high, now),
        }
    }

    /// Cycle of the next event.
    pub(crate) fn due(&self) -> u64 {
        self.lines.iter().map(Line::due).fold(self.spindle.due(), u64::min)
    }

    /// Handles all events that are due by `now`, and adds the pins that change to `changed`.
    pub(crate) fn advance(&mut self, now: u64, changed: &mut Vec<(Pin, bool)>) {
        for line in &mut self.lines {
            if let Some(high) = line.advance(now) {
                changed.push((line.pin(), high));
            }
        }
        if let (Some(high), Some(pin)) = (self.spindle.advance(now), self.index) {
            changed.push((pin, high));
        }
        if let Some(encoder) = self.spindle.encoder()
            && encoder.advance(now, changed)
        {
            self.indexed.push((now, self.carriages.each_ref().map(Carriage::steps)));
        }
    }
}

/// A pin that drives the spindle.
#[derive(Clone, Copy)]
pub(crate) enum SpindlePin {
    Enable,
    Reverse,
    Pulse,
}
