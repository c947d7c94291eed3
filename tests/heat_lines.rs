//! Heaters under any lines that set targets: no lines hide a fault, and none make one of a printer that is well.
//!
//! The whole firmware runs in mocked time. TinyG's lines come on both ports, those of a printing host on one. Both
//! heaters, the fan, waits, autotunes and alarms are used.

use crate::heat::{Printer, STEP, Wire};
use crate::heat_patterns::{Random, SPARED, limit_of};
use crate::plant::AIR;
use crate::seeds::try_all;

/// What a host can send.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Host {
    /// TinyG's lines, on either port.
    Cnc,
    /// Lines of a printing host.
    Printing,
}

/// A printer with a host that sets targets at random.
struct Hosted {
    printer: Printer,
    random: Random,
    host: Host,
    /// The highest temperature that the hot end has had or has been asked for.
    asked: f64,
    /// Seconds of full power of the hot end, less [`SPARED`] of all time.
    given: f64,
    /// The highest temperature of the hot end's block.
    most: f64,
    /// What has been sent, and when, in seconds.
    lines: Vec<String>,
}

impl Hosted {
    fn new(seed: u64) -> Option<Self> {
        let mut random = Random::new(seed);
        let at = [AIR, random.between(AIR, 250.0)][random.below(2)];
        let mut printer = Printer::open_at(at)?;
        let host = [Host::Cnc, Host::Printing][random.below(2)];
        if host == Host::Printing {
            printer.ask("M105");
        } else {
            // TinyG's dialect on both ports.
            printer.machine.send_aux(b"{}\n");
            printer.ask("{}");
            printer.machine.received_aux();
        }
        printer.said.clear();
        Some(Self { printer, random, host, asked: at, given: 0.0, most: at, lines: Vec::new() })
    }

    fn send(&mut self, line: &str) {
        self.lines.push(format!("{:.1} {line}", self.printer.ms as f64 / 1e3));
        if self.host == Host::Cnc && self.random.below(2) == 0 {
            self.printer.machine.send_aux(format!("{line}\n").as_bytes());
        } else {
            self.printer.send(line);
        }
    }

    /// Runs for a time, or until a heater has a fault.
    fn run(&mut self, seconds: f64) {
        let until = self.printer.ms + (seconds * 1e3) as u64;
        while self.printer.ms < until && !self.has_fault() {
            self.printer.run(STEP, |_| {});
            let aux = String::from_utf8(self.printer.machine.received_aux()).expect("ASCII");
            self.printer.said += &aux;
            let on = self.printer.machine.heaters_on() & 1;
            let given = STEP as f64 / 1e3 * (f64::from(on) - SPARED);
            self.given = (self.given + given).max(0.0);
            self.most = self.most.max(self.printer.hot_end.block);
        }
    }

    fn has_fault(&self) -> bool {
        let Printer { said, .. } = &self.printer;
        let codes = ["st\":48", "st\":49", "st\":50", "st\":51", "st\":52"];
        let texts = ["Error:heater ", "Error:temperature sensor"];
        codes.iter().chain(&texts).any(|text| said.contains(text))
    }

    /// Sends the next line, and runs until the one after it.
    fn turn(&mut self) {
        let (hot, warm) =
            (self.random.between(25.0, 260.0).floor(), self.random.between(25.0, 90.0));
        let near =
            self.printer.loose.max(self.printer.hot_end.sensor) + self.random.between(-9.0, 9.0);
        let hot = match self.random.below(4) {
            0 => 0.0,
            1 => near.clamp(1.0, 260.0).floor(),
            _ => hot,
        };
        if self.host == Host::Printing {
            self.send("M108");
        }
        match (self.host, self.random.below(10)) {
            (_, 0) => {
                let to = if self.random.below(3) == 0 { 0.0 } else { warm.floor() };
                self.send(&format!("M140 S{to}"));
            }
            (_, 1) => {
                let speed = self.random.below(256);
                self.send(&format!("M106 S{speed}"));
            }
            (Host::Printing, 2) if hot > 0.0 => self.send(&format!("M109 S{hot}")),
            (Host::Printing, 3 | 4) => {
                let to = hot.clamp(50.0, 260.0);
                self.asked = self.asked.max(to);
                self.send(&format!("M303 E0 S{to} C3"));
            }
            (Host::Printing, 5) => {
                self.send("M112");
                self.run(0.5);
                self.send("M999");
            }
            _ => {
                self.asked = self.asked.max(hot);
                self.send(&format!("M104 S{hot}"));
            }
        }
        let seconds = match self.random.below(3) {
            0 => self.random.between(0.3, 5.0),
            _ => self.random.between(1.0, 25.0),
        };
        self.run(seconds);
    }

    fn told(&self, what: &str) -> String {
        let Self { host, asked, given, most, lines, printer, .. } = self;
        let (sensor, said) = (printer.hot_end.sensor, &printer.said);
        let said = &said[said.len().saturating_sub(300)..];
        format!(
            "{what}, {host:?}: most {most:.1}, asked {asked:.1}, {given:.1} s of power, sensor \
             {sensor:.1}\n{lines:?}\n{said}"
        )
    }
}

/// Runs the case of a seed in a thread of its own, because each thread has one machine.
fn alone(seed: u64, case: fn(Hosted) -> Result<(), String>) -> Result<(), String> {
    std::thread::spawn(move || Hosted::new(seed).map_or(Ok(()), case)).join().expect("no panic")
}

#[test]
fn no_lines_make_a_fault() {
    try_all(12, |seed| {
        alone(seed, |mut hosted| {
            (0..60).for_each(|_| hosted.turn());
            if hosted.has_fault() { Err(hosted.told("well")) } else { Ok(()) }
        })
    });
}

/// A hot end is never above its maximum and 15 degrees, whatever is defect and whatever a host sends, also if it
/// unlocks the heaters after each fault.
#[test]
fn no_lines_hide_a_loose_sensor() {
    try_all(12, |seed| {
        alone(seed, |mut hosted| {
            hosted.printer.loose = hosted.printer.hot_end.sensor;
            hosted.printer.wire = Wire::Loose;
            for _ in 0..60 {
                hosted.turn();
                if hosted.has_fault() && hosted.host == Host::Printing {
                    hosted.printer.said.clear();
                    hosted.send("M999");
                }
            }
            if hosted.most > limit_of(0) { Err(hosted.told("loose")) } else { Ok(()) }
        })
    });
}

#[test]
fn no_lines_hide_a_dead_heater_an_open_sensor_or_a_stuck_transistor() {
    try_all(18, |seed| {
        alone(seed, |mut hosted| {
            let defect = hosted.random.below(3);
            let (what, most) = match defect {
                0 => ("dead", limit_of(0)),
                1 => ("open", hosted.asked + 5.0),
                _ => ("stuck", 0.0),
            };
            match defect {
                0 => hosted.printer.hot_end.watts = 0.0,
                1 => hosted.printer.wire = Wire::Open,
                _ => hosted.printer.stuck = true,
            }
            for _ in 0..60 {
                hosted.turn();
                let most = if defect == 2 { hosted.asked.max(70.0) + 35.0 } else { most };
                let is_well = hosted.given < 20.0 && hosted.most < most.min(limit_of(0));
                if hosted.has_fault() {
                    return Ok(());
                }
                if !is_well {
                    return Err(hosted.told(what));
                }
            }
            Ok(())
        })
    });
}
