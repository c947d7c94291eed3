//! Random programs that switch spindle and coolant and change the work offset between moves, while a sender asks for
//! reports at random moments. Each reported value is compared with the pins at that moment, and with the line that is
//! being executed by a model of its own. On the host and on the simulated chip.
//!
//! X goes up in each move, so the position of X says which line is being executed.
#![allow(dead_code)]

use std::fmt::Write;

use kerf::boards::outputs;

use crate::side::Side;

/// Steps in a mm.
const STEPS: f64 = 1_280.0;
/// How far a report is ahead of the motors at most, ms: exec prepares segments that long before they run.
const AHEAD: u64 = 17;

/// How far X is at most from where a line ends on the path when the report has the state of the next line, mm: what the
/// means are behind the path at 1,800 mm/min.
const BEHIND: f64 = 30.0 * 0.05;
/// The axes of which reports are compared.
const AXES: usize = 3;
/// The least difference of positions that counts, mm. Reports have three decimals.
const CLOSE: f64 = 0.002;
/// How far a part of a program is from the next, mm: a flush stops X between two grid points.
const GRID: f64 = 0.1;

/// How reports are asked for, and what they have.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Tongue {
    TinyG,
    Grbl,
    RepRap,
}

/// What a line leaves to the next.
#[derive(Clone, PartialEq, Debug)]
struct State {
    /// The origins of G54 to G59, those of G92, the tool length in Z.
    systems: [[f64; AXES]; 6],
    system: usize,
    shift: [f64; AXES],
    length: f64,
    tool: u32,
    inches: bool,
    /// 0 off, 1 clockwise, 2 counter-clockwise.
    turn: u8,
    speed: f64,
    mist: bool,
    flood: bool,
    /// The end of the last move, machine coordinates.
    at: [f64; AXES],
}

impl State {
    fn new() -> Self {
        Self {
            systems: [[0.0; AXES]; 6],
            system: 0,
            shift: [0.0; AXES],
            length: 0.0,
            tool: 0,
            inches: false,
            turn: 0,
            speed: 0.0,
            mist: false,
            flood: false,
            at: [0.0; AXES],
        }
    }

    fn offset(&self) -> [f64; AXES] {
        let mut offset = self.systems[self.system];
        offset.iter_mut().zip(self.shift).for_each(|(offset, shift)| *offset += shift);
        offset[2] += self.length;
        offset
    }

    /// Writes a length in the units in force.
    fn word(&self, letter: char, mm: f64) -> String {
        match self.inches {
            true => format!("{letter}{:.5}", mm / 25.4),
            false => format!("{letter}{mm:.3}"),
        }
    }
}

/// A line, and the state behind it.
struct Line {
    text: String,
    after: State,
    moves: bool,
}

/// What the pins were at a moment.
#[derive(Clone, Copy)]
struct Pins {
    steps: [i64; 4],
    on: u8,
    duty: f64,
}

/// A report: when it was asked for and heard, and its text.
struct Report {
    asked: u64,
    heard: u64,
    text: String,
}

/// A sender, its program, and what it has seen.
pub struct Told<S> {
    side: S,
    tongue: Tongue,
    seed: u64,
    now: u64,
    heard: String,
    seen: Vec<Pins>,
    state: State,
    reports: Vec<Report>,
    asked: Option<u64>,
    /// The newest `WCO`, and the program it belongs to.
    offset: [f64; AXES],
    story: String,
    pub compared: usize,
}

impl<S: Side> Told<S> {
    pub fn new(side: S, tongue: Tongue, seed: u64) -> Self {
        let mut told = Self {
            side,
            tongue,
            seed: seed * 2 + 1,
            now: 0,
            heard: String::new(),
            seen: Vec::new(),
            state: State::new(),
            reports: Vec::new(),
            asked: None,
            offset: [0.0; AXES],
            story: String::new(),
            compared: 0,
        };
        // Before its start a chip has no outputs.
        told.side.run_ms(300);
        told.side.heard();
        match tongue {
            Tongue::TinyG => {
                let list = "stat:t,posx:t,posy:t,posz:t,mpox:t,mpoy:t,mpoz:t,ofsx:t,ofsy:t,ofsz:t,spe:t,spd:t,sps:t,\
                            cof:t,com:t,coor:t,tool:t,unit:t";
                told.say(&format!("{{\"sr\":{{{list}}}}}"));
                told.say("{sv:0}");
                told.say("{qv:0}");
                // M6 does not wait for a sender.
                told.say("{psw:0}");
            }
            Tongue::Grbl => told.say("$I"),
            Tongue::RepRap => told.say("M105"),
        }
        told.heard.clear();
        told
    }

    pub fn story(&self) -> &str {
        &self.story
    }

    fn random(&mut self, below: u64) -> u64 {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_041);
        (self.seed >> 33) % below
    }

    /// A multiple of the grid.
    fn length(&mut self, most: u64) -> f64 {
        (self.random(2 * most + 1) as f64 - most as f64) * GRID
    }

    fn say(&mut self, line: &str) {
        self.side.send(format!("{line}\n").as_bytes());
        self.run_ms(30);
    }

    fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms {
            self.side.run_ms(1);
            self.now += 1;
            let (on, duty) = self.side.outputs();
            // The direction has no meaning while the spindle is off.
            let turns = on & outputs::SPINDLE != 0;
            let on = if turns { on } else { on & !outputs::COUNTERCLOCKWISE };
            self.seen.push(Pins { steps: self.side.steps(), on, duty });
            self.heard += &String::from_utf8_lossy(&self.side.heard()).replace('\r', "");
        }
    }

    /// Makes a random line that moves nothing.
    fn change(&mut self) -> String {
        let prints = self.tongue == Tongue::RepRap;
        let axis = self.random(AXES as u64) as usize;
        let letter = ['X', 'Y', 'Z'][axis];
        loop {
            let which = self.random(12);
            let value = self.length(500);
            let (speed, number) = ((1 + self.random(23)) as f64 * 1_000.0, self.random(6));
            let state = &mut self.state;
            let at = state.at[axis];
            match which {
                0 | 1 if !prints => {
                    state.turn = 1 + which as u8;
                    state.speed = speed;
                    return format!("M{} S{}", 3 + which, self.state.speed);
                }
                2 if !prints => {
                    state.speed = speed;
                    return format!("S{}", self.state.speed);
                }
                3 if !prints => {
                    state.turn = 0;
                    return "M5".into();
                }
                4 if !prints => {
                    (state.mist, state.flood) = (false, false);
                    return "M9".into();
                }
                5 if !prints => {
                    let flood = self.random(2) == 0;
                    let state = &mut self.state;
                    *(if flood { &mut state.flood } else { &mut state.mist }) = true;
                    return if flood { "M8" } else { "M7" }.into();
                }
                6 if !prints => {
                    state.system = number as usize;
                    return format!("G{}", 54 + self.state.system);
                }
                7 => {
                    let others = state.offset()[axis] - state.shift[axis];
                    state.shift[axis] = at - value - others;
                    return format!("G92 {}", state.word(letter, value));
                }
                8 if !prints => {
                    let system = number as usize;
                    state.systems[system][axis] = value;
                    return format!("G10 L2 P{} {}", system + 1, state.word(letter, value));
                }
                9 if !prints => {
                    let others = state.offset()[axis] - state.systems[state.system][axis];
                    state.systems[state.system][axis] = at - value - others;
                    return format!("G10 L20 P0 {}", state.word(letter, value));
                }
                10 if !prints => {
                    state.length = value;
                    return format!("G43.1 {}", state.word('Z', value));
                }
                11 if self.tongue == Tongue::TinyG => {
                    if self.random(2) == 0 {
                        self.state.inches = !self.state.inches;
                        return if self.state.inches { "G20" } else { "G21" }.into();
                    }
                    let tool = 1 + self.random(9) as u32;
                    let state = &mut self.state;
                    (state.tool, state.turn) = (tool, 0);
                    return format!("T{tool} M6");
                }
                _ => {}
            }
        }
    }

    /// Makes a random move, in which X goes up.
    fn go(&mut self) -> String {
        let before = self.state.clone();
        // Onto the grid, after a flush.
        let x = (before.at[0] / GRID).round() * GRID + GRID * (3 + self.random(12)) as f64;
        let (y, z) = (self.length(20), self.length(20));
        self.state.at = [x, y, z];
        let state = &self.state;
        let offset = state.offset();
        let feed = 900 + 300 * ((x * 10.0) as u64 % 4);
        let mut text = if ((x * 10.0) as u64).is_multiple_of(5) { "G0" } else { "G1" }.to_string();
        for (axis, letter) in ['X', 'Y', 'Z'].iter().enumerate() {
            text += &format!(" {}", state.word(*letter, state.at[axis] - offset[axis]));
        }
        let feed = if state.inches { feed as f64 / 25.4 } else { feed as f64 };
        let _ = write!(text, " F{feed:.3}");
        text
    }

    /// Makes a program of some moves with random lines among them.
    fn program(&mut self, moves: usize) -> Vec<Line> {
        let mut lines = Vec::new();
        for _ in 0..moves {
            let changes = [0, 0, 0, 1, 1, 2, 3][self.random(7) as usize];
            for _ in 0..changes {
                let text = self.change();
                lines.push(Line { text, after: self.state.clone(), moves: false });
            }
            let text = self.go();
            lines.push(Line { text, after: self.state.clone(), moves: true });
        }
        lines
    }

    /// Whether a line that has been heard answers a line of the program; `Err` if it refuses the line.
    fn is_answer(&self, line: &str) -> Result<bool, String> {
        match self.tongue {
            Tongue::TinyG if line.contains("\"f\":[1,0,") => Ok(!line.contains("\"sr\":")),
            // The flush drops the rest.
            Tongue::TinyG if line.contains("\"f\":[") => Err(line.to_string()),
            Tongue::TinyG => Ok(false),
            _ if line == "ok" => Ok(true),
            _ if line.starts_with("error") || line.starts_with("Error") => Err(line.to_string()),
            _ => Ok(false),
        }
    }

    fn is_report(&self, line: &str) -> bool {
        match self.tongue {
            Tongue::TinyG => line.starts_with("{\"r\":{\"sr\":"),
            Tongue::Grbl => line.starts_with('<'),
            Tongue::RepRap => line.starts_with("X:"),
        }
    }

    fn ask(&mut self) {
        self.asked = Some(self.now);
        match self.tongue {
            Tongue::TinyG => self.side.send(b"{sr:n}\n"),
            Tongue::Grbl => self.side.send(b"?"),
            Tongue::RepRap => self.side.send(b"M114\n"),
        }
    }

    /// Takes what has been heard. Returns how many lines of the program have been answered.
    fn take(&mut self, pending_ok: &mut usize) -> Result<usize, String> {
        let mut answers = 0;
        while let Some((line, rest)) = self.heard.split_once('\n') {
            let line = line.to_string();
            self.heard = rest.to_string();
            if self.is_report(&line) {
                let asked = self.asked.take().ok_or("a report that nobody asked for")?;
                self.reports.push(Report { asked, heard: self.now, text: line });
                // M114 has its own ok.
                *pending_ok += usize::from(self.tongue == Tongue::RepRap);
            } else if self.is_answer(&line)? {
                if *pending_ok > 0 {
                    *pending_ok -= 1;
                } else {
                    answers += 1;
                }
            }
        }
        Ok(answers)
    }

    /// Streams a program, asks at random moments, and compares all reports. If it `stops`, the program is dropped at a
    /// random moment. Returns the number of lines that have been carried out or dropped after they were answered.
    pub fn run(&mut self, moves: usize, stops: bool) -> Result<(), String> {
        let before = self.state.clone();
        let lines = self.program(moves);
        for line in &lines {
            let _ = writeln!(self.story, "{}", line.text);
        }
        let stop = self.now + 300 + self.random(moves as u64 * 60);
        let (mut sent, mut answered, mut rests) = (0, 0, 0);
        let mut extra = 0;
        let begun = self.now;
        while rests < 60 {
            let flight = if self.tongue == Tongue::RepRap { 1 } else { 4 };
            while sent < lines.len() && sent < answered + flight {
                self.side.send(format!("{}\n", lines[sent].text).as_bytes());
                sent += 1;
            }
            // An M114 that is answered would be taken for the line before it.
            if rests < 50 && self.asked.is_none() && extra == 0 && self.random(8) == 0 {
                self.ask();
            }
            self.run_ms(1);
            answered += self.take(&mut extra)?;
            let [.., one, two] = &self.seen[..] else { continue };
            let still = one.steps == two.steps && answered == lines.len() && self.asked.is_none();
            rests = if still { rests + 1 } else { 0 };
            if stops && self.now >= stop && self.asked.is_none() {
                break;
            }
            if self.now - begun > 200_000 {
                return Err(format!(
                    "takes too long: {answered} of {sent} answered, heard {}",
                    self.heard
                ));
            }
        }
        if stops {
            self.drop_all(&lines, &before, &mut answered, &mut extra)?;
        }
        self.ask();
        self.run_ms(60);
        let _ = self.take(&mut extra);
        self.compare(&before, &lines)
    }

    /// Drops what is queued. Afterwards the state is that of the last line that was read; the outputs are what they are.
    fn drop_all(
        &mut self,
        lines: &[Line],
        before: &State,
        answered: &mut usize,
        extra: &mut usize,
    ) -> Result<(), String> {
        self.side.send(b"!");
        for _ in 0..300 {
            self.run_ms(1);
            *answered += self.take(extra)?;
        }
        self.side.send(b"%\n");
        self.run_ms(200);
        let heard = std::mem::take(&mut self.heard);
        // Lines that waited are refused.
        for line in heard.lines() {
            if self.is_report(line) {
                self.asked = None;
            } else if let Ok(true) = self.is_answer(line) {
                *answered += 1;
            }
        }
        self.asked = None;
        let read = answered.checked_sub(1).and_then(|last| lines.get(last));
        self.state = read.map_or(before, |line| &line.after).clone();
        let _ = writeln!(self.story, "dropped behind line {answered}");
        let pins = *self.seen.last().ok_or("nothing seen")?;
        for (at, steps) in self.state.at.iter_mut().zip(pins.steps) {
            *at = steps as f64 / STEPS;
        }
        let is = |output| pins.on & output != 0;
        self.state.turn = match (is(outputs::SPINDLE), is(outputs::COUNTERCLOCKWISE)) {
            (false, _) => 0,
            (_, false) => 1,
            _ => 2,
        };
        if self.state.turn != 0 {
            self.state.speed = (pins.duty * 24_000.0).round();
        }
        (self.state.mist, self.state.flood) = (is(outputs::MIST), is(outputs::FLOOD));
        Ok(())
    }

    fn compare(&mut self, before: &State, lines: &[Line]) -> Result<(), String> {
        for report in std::mem::take(&mut self.reports) {
            self.judge(&report, before, lines).map_err(|why| format!("{why}: {}", report.text))?;
            self.compared += 1;
        }
        Ok(())
    }

    /// Returns the states that count at a place of X: those from the line that ends there or goes through it to the
    /// next line that moves.
    fn states<'a>(&'a self, x: f64, before: &'a State, lines: &'a [Line]) -> Vec<&'a State> {
        let mut states = Vec::new();
        let mut last = before;
        // Whether the last line that moves ends at the place.
        let mut is_here = (-CLOSE - BEHIND..=CLOSE).contains(&(x - before.at[0]));
        if is_here {
            states.push(before);
        }
        for line in lines {
            let (from, to) = (last.at[0], line.after.at[0]);
            let passes = line.moves && (from - CLOSE - BEHIND..=to + CLOSE).contains(&x);
            if passes || is_here {
                states.push(&line.after);
            }
            if line.moves {
                is_here = (to - CLOSE - BEHIND..=to + CLOSE).contains(&x);
            }
            last = &line.after;
        }
        // Behind a flush the state is that of the last line that was read.
        states.push(&self.state);
        states
    }

    fn judge(&mut self, report: &Report, before: &State, lines: &[Line]) -> Result<(), String> {
        let value = |name: &str| value(&report.text, name);
        let axes = |name: &str| -> Option<[f64; AXES]> {
            match self.tongue {
                Tongue::Grbl => list(&report.text, name),
                _ => {
                    let axis = |letter: &str| value(&format!("{name}{letter}"));
                    Some([axis("x")?, axis("y")?, axis("z")?])
                }
            }
        };
        let (machine, offset, work) = match self.tongue {
            Tongue::TinyG => {
                let mm = if value("unit") == Some(0.0) { 25.4 } else { 1.0 };
                let work = axes("pos").ok_or("no pos")?.map(|work| work * mm);
                (axes("mpo").ok_or("no mpo")?, axes("ofs").ok_or("no ofs")?, work)
            }
            Tongue::Grbl => {
                self.offset = axes("WCO:").unwrap_or(self.offset);
                let machine = axes("MPos:").ok_or("no MPos")?;
                let mut work = machine;
                work.iter_mut().zip(self.offset).for_each(|(work, offset)| *work -= offset);
                (machine, self.offset, work)
            }
            Tongue::RepRap => {
                let (work, count) = report.text.split_once("Count").ok_or("no Count")?;
                let machine = letters(count).ok_or("no steps")?.map(|steps| steps / STEPS);
                let work = letters(work).ok_or("no position")?;
                let mut offset = machine;
                offset.iter_mut().zip(work).for_each(|(offset, work)| *offset -= work);
                (machine, offset, work)
            }
        };
        // The position is where the motors are, or will be in some milliseconds.
        let (first, last) = (report.asked.saturating_sub(2), report.heard + AHEAD);
        let window = &self.seen[first as usize..(last as usize).min(self.seen.len())];
        for (axis, at) in machine.iter().enumerate() {
            let at = at * STEPS;
            let steps = || window.iter().map(|pins| pins.steps[axis] as f64);
            let (low, high) = (steps().fold(f64::MAX, f64::min), steps().fold(f64::MIN, f64::max));
            if !(low - 2.0..=high + 2.0).contains(&at) {
                return Err(format!("axis {axis} is at {at}, and the motor from {low} to {high}"));
            }
        }
        let states = self.states(machine[0], before, lines);
        let fits = |state: &&&State| {
            let is = state.offset();
            let close = (0..AXES).all(|axis| (is[axis] - offset[axis]).abs() <= CLOSE);
            let is_named = |name, is: f64| value(name).is_none_or(|told| told == is);
            close
                && is_named("coor", state.system as f64 + 1.0)
                && is_named("tool", state.tool.into())
        };
        if states.iter().find(fits).is_none() {
            let wanted: Vec<_> = states.iter().map(|state| (state.offset(), state.tool)).collect();
            return Err(format!("offset {offset:?}, and the lines that run have {wanted:?}"));
        }
        let tolerance = if value("unit") == Some(0.0) { 0.03 } else { CLOSE };
        let is_off = |axis: usize| (machine[axis] - offset[axis] - work[axis]).abs() > tolerance;
        if (0..AXES).any(is_off) {
            return Err(format!("work position {work:?} of {machine:?} - {offset:?}"));
        }
        let switched =
            &self.seen[first as usize..=(report.heard as usize).min(self.seen.len() - 1)];
        match self.tongue {
            Tongue::TinyG => {
                let is = |name| value(name) == Some(1.0);
                let on = bits(is("spe"), is("spd"), is("com"), is("cof"));
                self.switched(switched, Some(on), value("sps").filter(|_| is("spe")))
            }
            Tongue::Grbl => {
                let speed = report.text.split("|FS:").nth(1).and_then(|text| {
                    text.split(['|', '>']).next()?.split(',').nth(1)?.parse::<f64>().ok()
                });
                let on = report.text.contains("|Ov:").then(|| {
                    let is = |letter| {
                        let a = report.text.split("|A:").nth(1).unwrap_or("");
                        a.split(['|', '>']).next().unwrap_or("").contains(letter)
                    };
                    bits(is('S') || is('C'), is('C'), is('M'), is('F'))
                });
                self.switched(switched, on, speed)
            }
            Tongue::RepRap => Ok(()),
        }
    }

    /// Compares reported outputs and S with the pins. 24,000 turns are the full duty cycle.
    fn switched(&self, window: &[Pins], on: Option<u8>, speed: Option<f64>) -> Result<(), String> {
        let fits = |pins: &&Pins| {
            let turns = if pins.on & outputs::SPINDLE == 0 { 0.0 } else { pins.duty * 24_000.0 };
            on.is_none_or(|on| on == pins.on)
                && speed.is_none_or(|speed| (speed - turns).abs() <= 1.0)
        };
        match window.iter().find(fits) {
            Some(_) => Ok(()),
            None => {
                let pins = window.last().map(|pins| (pins.on, pins.duty));
                Err(format!("outputs {on:?}, S {speed:?}, and the pins {pins:?}"))
            }
        }
    }
}

fn bits(spindle: bool, ccw: bool, mist: bool, flood: bool) -> u8 {
    let bit = |is, output| if is { output } else { 0 };
    bit(spindle, outputs::SPINDLE)
        | bit(ccw, outputs::COUNTERCLOCKWISE)
        | bit(mist, outputs::MIST)
        | bit(flood, outputs::FLOOD)
}

/// Returns a number of a report in JSON.
fn value(text: &str, name: &str) -> Option<f64> {
    let (_, rest) = text.split_once(&format!("\"{name}\":"))?;
    rest.split([',', '}']).next()?.parse().ok()
}

/// Returns the first numbers of a field of a grbl report.
fn list(text: &str, name: &str) -> Option<[f64; AXES]> {
    let (_, rest) = text.split_once(name)?;
    let mut numbers = rest.split(['|', '>']).next()?.split(',').map(|number| number.parse().ok());
    Some([numbers.next()??, numbers.next()??, numbers.next()??])
}

/// Returns the numbers behind `X:`, `Y:` and `Z:`.
fn letters(text: &str) -> Option<[f64; AXES]> {
    let number =
        |letter: &str| text.split(letter).nth(1)?.split_whitespace().next()?.parse::<f64>().ok();
    Some([number("X:")?, number("Y:")?, number("Z:")?])
}
