//! Canonical commands in the format of `tests/nist/README.md`.

use std::fmt::Write;

use kerf::canon::Canon;
use kerf::gcode::Interpreter;
use kerf::gcode::modal::{Coolant, Turn};
use kerf::units::{AXES, Length, PerAxis};

/// The motion so far, and the position that it has led to.
#[derive(Default)]
pub struct MotionText {
    pub text: String,
    place: PerAxis<Length>,
    turn: Turn,
    coolant: u8,
}

impl MotionText {
    /// Adds the effect of a command.
    pub fn take(&mut self, command: &Canon) {
        match command {
            Canon::Traverse(to) => self.line("TRAVERSE", to),
            Canon::Feed(to) => self.line("FEED", to),
            Canon::Arc(to, arc, turns) => {
                let plane = ["YZ", "ZX", "XY"][usize::from(arc.linear)];
                self.say(format!("ARC {plane}{}{} {turns}", places(to), places(&arc.center)));
                self.place = *to;
            }
            Canon::Probe(to, _) => {
                self.say(format!("PROBE{}", places(to)));
                self.place = *to;
            }
            Canon::Dwell(ms) => self.say(format!("DWELL {}.{:03}0", ms / 1_000, ms % 1_000)),
            Canon::Spindle(spindle) => self.spindle(spindle.turn),
            Canon::Mist(on) => self.switch(Coolant::Mist, *on, "MIST"),
            Canon::Flood(on) => self.switch(Coolant::Flood, *on, "FLOOD"),
            Canon::Tool(number) => self.say(format!("TOOL {number}")),
            Canon::Stop => self.say("STOP".into()),
            Canon::End => self.say("END".into()),
            Canon::SetPosition(_) | Canon::Home(..) | Canon::Thread(..) | Canon::Heat(_) => {
                panic!("the other interpreter has no {command}")
            }
            Canon::Rate(_) | Canon::ExactStop(_) | Canon::Overrides(_) | Canon::Message(_) => {}
        }
    }

    /// Checks that the interpreter's state agrees with the motion.
    pub fn check(&self, interpreter: &Interpreter) {
        assert_eq!(interpreter.position(), &self.place);
        let modal = interpreter.modal();
        assert_eq!((modal.spindle, modal.coolant), (self.turn, self.coolant));
    }

    fn line(&mut self, kind: &str, to: &PerAxis<Length>) {
        if *to != self.place {
            self.say(format!("{kind}{}", places(to)));
        }
        self.place = *to;
    }

    fn spindle(&mut self, turn: Turn) {
        if turn != self.turn {
            let name = match turn {
                Turn::Off => "OFF",
                Turn::Clockwise => "CW",
                Turn::Counterclockwise => "CCW",
            };
            self.say(format!("SPINDLE {name}"));
        }
        self.turn = turn;
    }

    /// Writes that coolant is off when neither kind is left on.
    fn switch(&mut self, which: Coolant, on: bool, name: &str) {
        let bit = which as u8;
        self.coolant = if on { self.coolant | bit } else { self.coolant & !bit };
        if on {
            self.say(format!("COOLANT {name}"));
        } else if self.coolant == 0 {
            self.say("COOLANT OFF".into());
        }
    }

    fn say(&mut self, line: String) {
        writeln!(self.text, "{line}").unwrap();
    }
}

/// Writes lengths, each after a blank.
fn places(places: &[Length]) -> String {
    assert!(places.len() <= AXES);
    places.iter().map(|at| format!(" {at}")).collect()
}
