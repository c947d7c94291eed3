//! Converts lines to canonical commands.

use std::collections::VecDeque;
use std::string::String;

use super::command::{Canon, Turns};
use crate::gcode::Interpreter;
use crate::gcode::command::{Arc, Commands, Feed, Motion, Spindle, Stop};
use crate::gcode::modal::{Coolant, Turn};
use crate::gcode::overrides::{Change, Overrides};
use crate::gcode::setup::Setup;
use crate::gcode::steps::{Step, Steps};
use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};

/// Reads a program line by line. As an iterator it returns the commands of the line that was read last.
pub struct Reader<S> {
    setup: S,
    interpreter: Interpreter,
    commands: Commands,
    steps: Steps,
    /// The present position.
    place: PerAxis<Length>,
    /// The feed and the mode of the moves so far.
    rate: Option<Feed>,
    exact_stop: bool,
    /// The direction of the spindle, the coolants and the overrides in force.
    turn: Turn,
    coolant: u8,
    overrides: Overrides,
    /// Commands of a step that has been taken.
    ready: VecDeque<Canon>,
}

impl<S: Setup> Reader<S> {
    /// Returns a reader at start-up.
    pub fn new(setup: S) -> Self {
        let mut interpreter = Interpreter::new();
        interpreter.start(&setup);
        Self {
            setup,
            interpreter,
            commands: Commands::default(),
            steps: Steps::default(),
            place: [Length::ZERO; AXES],
            rate: None,
            exact_stop: false,
            turn: Turn::Off,
            coolant: 0,
            overrides: Overrides::NONE,
            ready: VecDeque::new(),
        }
    }

    /// Returns the interpreter, in its state after the last line.
    pub fn interpreter(&self) -> &Interpreter {
        &self.interpreter
    }

    /// Reads a line without its terminator. All commands of the line before must have been taken.
    pub fn read(&mut self, line: &[u8]) -> Result<(), Status> {
        self.steps = Steps::default();
        self.ready.clear();
        let info = self.interpreter.interpret(line, &self.setup, &mut self.commands)?;
        if let Some((start, end)) = info.message {
            let text = line.get(start.into()..end.into()).unwrap_or_default();
            self.ready.push_back(Canon::Message(String::from_utf8_lossy(text).trim().into()));
        }
        Ok(())
    }

    fn step(&mut self, step: Step) {
        match step {
            Step::Tool => self.ready.push_back(Canon::Tool(self.interpreter.tool())),
            Step::Spindle(spindle) => self.spindle(spindle),
            Step::Coolant(coolant) => self.coolant(coolant),
            Step::Override(change) => self.change(change),
            Step::Dwell(ms) => self.ready.push_back(Canon::Dwell(ms)),
            Step::Line(target, None) => self.go(Canon::Traverse(target), target, None),
            Step::Line(target, feed) => self.go(Canon::Feed(target), target, feed),
            Step::Thread => self.pass(),
            Step::AwaitSpindle => {}
            Step::Arc | Step::Probe | Step::Home | Step::Jog | Step::Check => self.motion(),
            // No line of a file causes this step.
            #[cfg(feature = "bed-plane")]
            Step::FollowBed(_) => {}
            Step::Heat(heat) => self.ready.push_back(Canon::Heat(heat)),
            Step::SetPosition(position) => {
                self.place = position;
                self.ready.push_back(Canon::SetPosition(position));
            }
            Step::Stop(Stop::End) => self.end(),
            Step::Stop(_) => self.ready.push_back(Canon::Stop),
        }
    }

    fn motion(&mut self) {
        match self.commands.motion {
            Motion::Arc { target, feed, arc } => {
                let turns = turns(&arc);
                self.go(Canon::Arc(target, arc, turns), target, Some(feed));
            }
            Motion::Probe { target, feed, mode } => {
                self.go(Canon::Probe(target, mode), target, Some(feed));
            }
            Motion::Home { axes, set } => self.ready.push_back(Canon::Home(axes, set)),
            _ => {}
        }
    }

    /// Adds the lines of a pass.
    fn pass(&mut self) {
        let (start, mut line) = (self.place, 0);
        while let Some((target, lead)) = self.steps.pass(&self.commands.motion, &self.place, line) {
            self.go(Canon::Thread(target, lead), target, None);
            line += 1;
        }
        if let Motion::Thread { lead, returns: true, .. } = self.commands.motion {
            self.go(Canon::Thread(start, lead), start, None);
        }
    }

    /// Adds a move, and before it the mode and the rate if they have changed.
    fn go(&mut self, command: Canon, target: PerAxis<Length>, feed: Option<Feed>) {
        if self.exact_stop != self.commands.exact_stop {
            self.exact_stop = self.commands.exact_stop;
            self.ready.push_back(Canon::ExactStop(self.exact_stop));
        }
        if let Some(feed) = feed
            && self.rate != Some(feed)
        {
            self.rate = Some(feed);
            self.ready.push_back(Canon::Rate(feed));
        }
        self.ready.push_back(command);
        self.place = target;
    }

    fn spindle(&mut self, spindle: Spindle) {
        self.turn = spindle.turn;
        // The speed of a stopped spindle is left out.
        let spindle = if spindle.turn == Turn::Off { Spindle::default() } else { spindle };
        self.ready.push_back(Canon::Spindle(spindle));
    }

    fn coolant(&mut self, coolant: u8) {
        let changed = self.coolant ^ coolant;
        self.coolant = coolant;
        for (which, command) in [
            (Coolant::Mist, Canon::Mist as fn(bool) -> Canon),
            (Coolant::Flood, Canon::Flood as fn(bool) -> Canon),
        ] {
            let bit = which as u8;
            if changed & bit != 0 {
                self.ready.push_back(command(coolant & bit != 0));
            }
        }
    }

    fn change(&mut self, change: Change) {
        self.overrides.change(change);
        self.ready.push_back(Canon::Overrides(self.overrides));
    }

    /// Adds the end of a program: everything is switched off.
    fn end(&mut self) {
        if self.turn != Turn::Off {
            self.spindle(Spindle::default());
        }
        self.coolant(0);
        if !self.overrides.is_none() {
            self.overrides = Overrides::NONE;
            self.ready.push_back(Canon::Overrides(self.overrides));
        }
        self.ready.push_back(Canon::End);
    }
}

/// Returns the number of turns, of which the last may be incomplete: an arc without extra turns has one, and so has a
/// full circle.
fn turns(arc: &Arc) -> Turns {
    let turns = 1 + Turns::from(arc.extra_turns);
    if arc.clockwise { -turns } else { turns }
}

impl<S: Setup> Iterator for Reader<S> {
    type Item = Canon;

    fn next(&mut self) -> Option<Canon> {
        loop {
            if let Some(command) = self.ready.pop_front() {
                return Some(command);
            }
            let step = self.steps.next(&self.commands, &self.place)?;
            self.step(step);
        }
    }
}
