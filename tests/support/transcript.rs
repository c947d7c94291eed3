//! Transcripts: conversations with the machine, and where the motors end.
//!
//! A transcript is played from power-up. Its first line, a comment, says why it exists. Then, a line each:
//!
//! ```text
//! # a comment
//! -> g1 x10 f500              a line is sent; \x05 is the byte 5
//! <- {"r":{},"f":[1,0,7]}     the next line heard is exactly this; \x0d is a carriage return; $VERSION is Kerf's version,
//!                             which may be left out of JSON
//! <~ {"qr":*}                 from here on any number of lines like this may come; * stands for any text
//! @ +50ms                     time passes
//! baud 500000                 from here on the sender speaks and hears at this rate
//! in xmin closed              the contact of a switch closes (or: open); others are probe, door, stop
//! near xmin -1280             from power-up on, the switch is closed while its axis is at or beyond this step:
//!                             xmin to amax, or probe, which Z works; `near xmin -1280 opens`: the switch is open there
//! spindle 300 rpm 4           from here on the spindle turns at this speed; its encoder has this many pulses a turn
//! steps X=12800 Y=0           the motors come to rest there; motors that are not named are at 0
//! outputs spindle ccw 12.50%  by now exactly these of `spindle ccw mist flood` are on; the spindle's pulses have this width
//! 2-> {sr:n}                  a line is sent on the second port, whose answers are `2<-`
//! 2cts 1                      the sender on the second port stops the machine by its handshake pin (0: releases it)
//! greeting                    the greeting is heard, with any version
//! open                        from here on no port is put into TinyG's dialect (see below)
//! job examples/square.gcode   sends each line of a file when the line before it has been accepted; none may be refused
//! ```
//!
//! A transcript that expects TinyG's greeting itself is one of TinyG's dialect: right behind that line the player sends
//! `{}` on the port, which decides the dialect, and hears the answer.
//!
//! Automatic reports (`sr`, `qr`), empty lines, `start` and grbl's greeting are ignored unless they are the line
//! expected next. Any other unexpected line fails the transcript, and so does silence where a line is expected.
//! Motors 1 to 4 are named `M1` to `M4`, or `X Y Z A` after the axes that they move by default.

use std::collections::VecDeque;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use kerf::boards::inputs::PROBE;
use kerf::config::VERSION;

use crate::side::Side;

/// Longest wait for a line, ms.
const HEAR_MS: u64 = 20_000;
/// Longest wait for the motors to come to rest, and the time without a step that counts as rest, ms.
const MOVE_MS: u64 = 120_000;
const REST_MS: u64 = 200;
/// Longest wait for outputs, ms.
const SWITCH_MS: u64 = 30;
/// Longest time in which grbl's greeting comes behind that of TinyG, ms.
const GREETS_MS: u64 = 20;
/// Time at the end in which no unexpected line may come, ms.
const LAST_MS: u64 = 100;

/// One line of a transcript.
#[derive(Clone, PartialEq, Debug)]
enum Event {
    Send(Vec<u8>),
    SendAux(Vec<u8>),
    AuxCts(bool),
    Hear(String),
    HearAux(String),
    Allow(String),
    Pass(u64),
    Baud(u32),
    Input(usize, bool),
    Near(usize, i64, bool),
    Spindle(f64, u32),
    Steps([i64; 4]),
    Outputs(String),
    Job(String),
    Greeting,
    Open,
}

/// A parsed transcript.
#[derive(Clone)]
pub struct Transcript {
    /// The name of its file.
    pub name: String,
    events: Vec<(usize, Event)>,
}

impl Transcript {
    /// Whether it is about grbl's dialect, and makes no request in TinyG's.
    #[allow(dead_code)]
    pub fn is_grbl_alone(&self) -> bool {
        let is_json = |bytes: &[u8]| bytes.starts_with(b"{");
        self.name.starts_with("grbl")
            && !self.events.iter().any(|(_, event)| match event {
                Event::Send(bytes) => is_json(bytes),
                Event::SendAux(_) | Event::HearAux(_) | Event::Job(_) => true,
                Event::Hear(line) => is_json(line.as_bytes()),
                _ => false,
            })
    }
}

#[allow(dead_code)]
impl Transcript {
    /// Replaces each expected line by what `as_here` returns for it.
    pub fn expect(&mut self, as_here: impl Fn(&str) -> String) {
        for (_, event) in &mut self.events {
            if let Event::Hear(line) | Event::HearAux(line) | Event::Allow(line) = event {
                *line = as_here(line);
            }
        }
    }
}

/// Reads every transcript in a folder, or, if `KERF_TRANSCRIPT` is set, only those whose name contains it.
pub fn read_all(folder: &Path) -> Vec<Transcript> {
    let entries = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    let wanted = std::env::var("KERF_TRANSCRIPT").unwrap_or_default();
    let is_wanted = |path: &PathBuf| path.to_string_lossy().contains(&*wanted);
    paths.retain(|path| path.extension().is_some_and(|e| e == "txt") && is_wanted(path));
    paths.sort();
    assert!(!paths.is_empty(), "no transcripts in {}", folder.display());
    paths.iter().map(|path| read(path)).collect()
}

/// Plays each transcript on a machine of its own, `at_once` of them at a time. Fails with a list of all failures.
pub fn play_all<S: Side>(
    transcripts: Vec<Transcript>,
    at_once: usize,
    boot: impl Fn() -> S + Sync,
) {
    let next = AtomicUsize::new(0);
    // On the host each machine needs its own thread.
    let play = |t: &Transcript| {
        thread::scope(|own| own.spawn(|| t.play(&mut boot()).err()).join().unwrap())
    };
    let play_some = || {
        let take = || transcripts.get(next.fetch_add(1, Ordering::Relaxed));
        std::iter::from_fn(take).filter_map(play).collect::<Vec<_>>()
    };
    let failed: Vec<_> = thread::scope(|scope| {
        let threads: Vec<_> = (0..at_once).map(|_| scope.spawn(play_some)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    let (n, of) = (failed.len(), transcripts.len());
    assert!(failed.is_empty(), "{n} of {of} transcripts fail:\n{}", failed.join("\n"));
}

fn read(path: &Path) -> Transcript {
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    let text = fs::read_to_string(path).unwrap();
    assert!(text.starts_with("# "), "{name}: the first line says why it exists");
    read_text(name, &text)
}

/// Parses a transcript from its text.
pub fn read_text(name: String, text: &str) -> Transcript {
    let numbered = text.lines().enumerate().map(|(i, line)| (i + 1, line));
    let events = numbered.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let event =
        |(n, line)| (n, parse(line).unwrap_or_else(|| panic!("{name}:{n}: what is {line}?")));
    let events = events.map(event).collect();
    Transcript { name, events }
}

fn parse(line: &str) -> Option<Event> {
    let (mark, rest) = line.split_once(' ').unwrap_or((line, ""));
    match mark {
        "->" => unescape(rest).map(Event::Send),
        "2->" => unescape(rest).map(Event::SendAux),
        "2cts" => rest.parse().ok().map(|level: u8| Event::AuxCts(level != 0)),
        "<-" => Some(Event::Hear(rest.replace("\\x0d", "\r").replace("$VERSION", VERSION))),
        "2<-" => Some(Event::HearAux(rest.to_string())),
        "<~" => Some(Event::Allow(rest.to_string())),
        "@" => rest.strip_prefix('+')?.strip_suffix("ms")?.parse().ok().map(Event::Pass),
        "baud" => rest.parse().ok().map(Event::Baud),
        "in" => input(rest),
        "near" => near(rest),
        "spindle" => spindle(rest),
        "steps" => steps(rest).map(Event::Steps),
        "outputs" => Some(Event::Outputs(rest.to_string())),
        "greeting" => Some(Event::Greeting),
        "open" => Some(Event::Open),
        "job" => Some(Event::Job(rest.to_string())),
        _ => None,
    }
}

/// Returns the bytes of a line to send, with its end; `None` if an escape is malformed.
fn unescape(text: &str) -> Option<Vec<u8>> {
    let mut parts = text.split("\\x");
    let mut bytes = parts.next()?.as_bytes().to_vec();
    for part in parts {
        bytes.push(u8::from_str_radix(part.get(..2)?, 16).ok()?);
        bytes.extend(&part.as_bytes()[2..]);
    }
    bytes.push(b'\n');
    Some(bytes)
}

/// The inputs, in their order.
const INPUTS: [&str; 11] =
    ["xmin", "xmax", "ymin", "ymax", "zmin", "zmax", "amin", "amax", "probe", "door", "stop"];

fn input(text: &str) -> Option<Event> {
    let (name, state) = text.split_once(' ')?;
    let closed = match state {
        "closed" => true,
        "open" => false,
        _ => return None,
    };
    INPUTS.iter().position(|input| *input == name).map(|input| Event::Input(input, closed))
}

fn near(text: &str) -> Option<Event> {
    let (name, step) = text.split_once(' ')?;
    let input = INPUTS.iter().position(|input| *input == name).filter(|input| *input <= PROBE)?;
    let (step, opens) = step.strip_suffix(" opens").map_or((step, false), |step| (step, true));
    Some(Event::Near(input, step.parse().ok()?, opens))
}

fn spindle(text: &str) -> Option<Event> {
    let (rpm, pulses) = text.split_once(" rpm ")?;
    Some(Event::Spindle(rpm.parse().ok()?, pulses.parse().ok()?))
}

fn steps(text: &str) -> Option<[i64; 4]> {
    let mut steps = [0; 4];
    for word in text.split_whitespace() {
        let (motor, value) = word.split_once('=')?;
        let letter = "XYZA".find(motor).filter(|_| motor.len() == 1);
        let number = || motor.strip_prefix('M')?.parse::<usize>().ok()?.checked_sub(1);
        *steps.get_mut(letter.or_else(number)?)? = value.parse().ok()?;
    }
    Some(steps)
}

/// Returns the names of outputs in transcripts. The direction of a spindle that is off is ignored.
fn name_outputs((on, share): (u8, f64)) -> String {
    let turns = on & 1 != 0;
    let names = ["spindle", "ccw", "mist", "flood"].into_iter().enumerate();
    let names = names.filter(|(bit, _)| on >> bit & 1 != 0 && (*bit != 1 || turns));
    let share = format!("{:.2}%", share * 100.0);
    names.map(|(_, name)| name).chain([&*share]).collect::<Vec<_>>().join(" ")
}

/// Whether `pattern`, in which `*` stands for any text, matches all of `text`.
fn matches(pattern: &str, text: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == text,
        Some((before, after)) => text.strip_prefix(before).is_some_and(|rest| {
            (0..=rest.len()).any(|at| rest.is_char_boundary(at) && matches(after, &rest[at..]))
        }),
    }
}

impl Transcript {
    /// Returns the lines that are sent, without their ends, each with the line that is heard next.
    #[allow(dead_code)]
    pub fn exchanges(&self) -> impl Iterator<Item = (String, &str)> {
        self.events.windows(2).filter_map(|pair| match pair {
            [(_, Event::Send(sent)), (_, Event::Hear(heard))] => {
                Some((String::from_utf8_lossy(sent).trim_end().to_string(), heard.as_str()))
            }
            _ => None,
        })
    }

    /// Returns the pulses in a turn of the spindle; `None` if the transcript turns no spindle.
    pub fn spindle_pulses(&self) -> Option<u32> {
        self.events.iter().find_map(|(_, event)| match event {
            Event::Spindle(_, pulses) => Some(*pulses),
            _ => None,
        })
    }

    /// Plays the transcript. The error says where and how it fails.
    pub fn play(&self, side: &mut impl Side) -> Result<(), String> {
        let near = |(_, event): &(usize, Event)| match event {
            Event::Near(input, step, opens) => Some((*input, *step, *opens)),
            _ => None,
        };
        let pulses = self.spindle_pulses().unwrap_or(0);
        side.wire(&self.events.iter().filter_map(near).collect::<Vec<_>>(), pulses);
        let (ears, allowed) = Default::default();
        let mut player =
            Player { side, ears, allowed, greeted: false, open: false, speaks_aux: false };
        for (line, event) in &self.events {
            player.play(event).map_err(|what| format!("{}:{line}: {what}", self.name))?;
        }
        player.side.run_ms(LAST_MS);
        player.silence().map_err(|what| format!("{}: at the end: {what}", self.name))
    }
}

/// A transcript being played.
struct Player<'a, S> {
    side: &'a mut S,
    /// What each port has sent.
    ears: [Ear; 2],
    allowed: Vec<String>,
    /// Whether the last event was `greeting`, and was grbl's in an image without TinyG's dialect.
    greeted: bool,
    /// Whether the dialect of a port that has greeted is left open.
    open: bool,
    /// Whether the second port has been spoken to.
    speaks_aux: bool,
}

/// What a port has sent.
#[derive(Default)]
struct Ear {
    partial: String,
    lines: VecDeque<String>,
}

impl Ear {
    fn next_line(&mut self, heard: &[u8]) -> Option<String> {
        self.partial += &String::from_utf8_lossy(heard);
        while let Some((line, rest)) = self.partial.split_once('\n') {
            self.lines.push_back(line.to_string());
            self.partial = rest.to_string();
        }
        self.lines.pop_front()
    }
}

/// Returns a line without Kerf's version, which changes with each release. Most transcripts leave it out.
fn without_version(line: &str) -> String {
    line.replace(&format!("\"kerf\":\"{VERSION}\","), "")
}

/// How lines begin that tell of an alarm.
const ALARMS: [&str; 4] =
    ["{\"er\":", "ALARM:", "[MSG:Reset to continue]", "[MSG:'$H'|'$X' to unlock]"];

/// The greeting on the second port. Transcripts that do not use the port ignore it.
const GREETING: &str = "{\"r\":{\"fv\":*\"SYSTEM READY\"},\"f\":[1,0,0]}";

/// The answer to `{}`, which is in TinyG's dialect alone.
const SETTLED: &str = "{\"r\":{},\"f\":[1,0,7]}";

/// The greeting of grbl's dialect, which is ignored unless it is expected.
const OTHER_GREETING: &str = "Grbl 1.1h ['$' for help]";
/// The greeting of printing hosts, which is ignored unless it is expected.
const START: &str = "start";

impl<S: Side> Player<'_, S> {
    fn play(&mut self, event: &Event) -> Result<(), String> {
        match event {
            Event::Send(bytes) => self.side.send(bytes),
            Event::SendAux(bytes) => {
                self.speaks_aux = true;
                self.side.send_aux(bytes);
            }
            Event::AuxCts(stop) => self.side.set_aux_cts(*stop),
            Event::Hear(line) => {
                // `greeting` has heard it in an image that has this dialect alone.
                let greeted = std::mem::take(&mut self.greeted);
                if greeted && line == OTHER_GREETING {
                    return Ok(());
                }
                self.hear(0, line)?;
                return self.settle(0, line);
            }
            Event::HearAux(line) => {
                self.hear(1, line)?;
                return self.settle(1, line);
            }
            Event::Open => self.open = true,
            Event::Allow(pattern) => self.allowed.push(pattern.clone()),
            Event::Pass(ms) => self.side.run_ms(*ms),
            Event::Baud(baud) => self.side.set_baud(*baud),
            Event::Input(input, closed) => self.side.set_input(*input, *closed),
            Event::Near(..) => {}
            Event::Spindle(rpm, pulses) => self.side.turn_spindle(*rpm, *pulses),
            Event::Greeting => return self.greeting(),
            Event::Job(file) => return self.run(file),
            Event::Steps(steps) => return self.rest_at(steps),
            Event::Outputs(wanted) => {
                let are = (0..SWITCH_MS).find(|_| {
                    let are = name_outputs(self.side.outputs()) == *wanted;
                    if !are {
                        self.side.run_ms(1);
                    }
                    are
                });
                let are = are.ok_or_else(|| name_outputs(self.side.outputs()));
                return are.map(|_| ()).map_err(|are| format!("outputs {are}"));
            }
        }
        Ok(())
    }

    /// Waits for the greeting: of TinyG's dialect, and the one behind it, or, in an image without that dialect, of the
    /// one that it has.
    fn greeting(&mut self) -> Result<(), String> {
        match self.side.first_dialect() {
            "dialect-grbl" => {
                self.hear(0, OTHER_GREETING)?;
                self.greeted = true;
                Ok(())
            }
            "dialect-reprap" => self.hear(0, START),
            _ => {
                self.wait(0, GREETING, |line| matches(GREETING, line))?;
                self.side.run_ms(GREETS_MS);
                Ok(())
            }
        }
    }

    /// Puts a port that has said `line` into TinyG's dialect, if the line is its greeting.
    fn settle(&mut self, port: usize, line: &str) -> Result<(), String> {
        if self.open || !line.contains("SYSTEM READY") {
            return Ok(());
        }
        self.side.run_ms(GREETS_MS);
        match port {
            0 => self.side.send(b"{}\n"),
            _ => {
                self.speaks_aux = true;
                self.side.send_aux(b"{}\n");
            }
        }
        self.hear(port, SETTLED)
    }

    /// Sends a file as a sender that waits for each answer.
    fn run(&mut self, file: &str) -> Result<(), String> {
        // Tests of the simulator run in the folder of their package.
        let folder = if Path::new(file).exists() { "." } else { "../../.." };
        let job = fs::read_to_string(Path::new(folder).join(file)).expect(file);
        for line in job.lines().filter(|line| !line.trim().is_empty()) {
            self.side.send(format!("{line}\n").as_bytes());
            let done = "{\"r\":{*},\"f\":[1,0,*]}";
            self.wait(0, done, |heard| matches(done, heard)).map_err(|e| format!("{line}: {e}"))?;
        }
        Ok(())
    }

    fn hear(&mut self, port: usize, wanted: &str) -> Result<(), String> {
        self.wait(port, wanted, |line| {
            // The lines of grbl's dialect end in CR LF. Transcripts leave out the CR.
            let plain = line.strip_suffix('\r').filter(|_| !wanted.ends_with('\r'));
            let line = plain.unwrap_or(line);
            line == wanted
                || without_version(line) == wanted
                || (wanted.contains('*')
                    && (wanted.starts_with(['<', '[', 'X', 'F', 'E', 'o', '*'])
                        || wanted.starts_with("{\"sr\":"))
                    && matches(wanted, line))
        })
    }

    fn wait(
        &mut self,
        port: usize,
        wanted: &str,
        is_it: impl Fn(&str) -> bool,
    ) -> Result<(), String> {
        let mut waited = 0;
        loop {
            match self.next_line(port) {
                Some(line) if is_it(&line) => return Ok(()),
                Some(line) if self.may_come(port, &line) => {}
                Some(line) => return Err(format!("heard    {line}\ninstead of {wanted}")),
                None if waited == HEAR_MS => {
                    return Err(format!("heard nothing instead of {wanted}"));
                }
                None => {
                    self.side.run_ms(1);
                    waited += 1;
                }
            }
        }
    }

    fn may_come(&self, port: usize, line: &str) -> bool {
        let line = line.trim_start_matches('\r');
        // The second port hears of each alarm, whatever the first does, and in grbl's way until its dialect is settled.
        let is_told = || ALARMS.iter().any(|alarm| line.starts_with(alarm));
        let is_open = || !self.speaks_aux && line.starts_with("[MSG:");
        if port == 1 && (matches(GREETING, line) || is_told() || is_open()) {
            return true;
        }
        // Where no dialect is settled yet, each kind of sender gets its own greeting.
        let other = line.trim_end_matches('\r');
        if other.is_empty() || [OTHER_GREETING, START].contains(&other) {
            return true;
        }
        let report = line.starts_with("{\"sr\":") || line.starts_with("{\"qr\":");
        report || self.allowed.iter().any(|pattern| matches(pattern, other))
    }

    fn next_line(&mut self, port: usize) -> Option<String> {
        let heard = if port == 0 { self.side.heard() } else { self.side.heard_aux() };
        self.ears[port].next_line(&heard)
    }

    fn silence(&mut self) -> Result<(), String> {
        for port in 0..self.ears.len() {
            while let Some(line) = self.next_line(port) {
                if !self.may_come(port, &line) {
                    return Err(format!("port {}: heard {line}, which nothing expects", port + 1));
                }
            }
        }
        Ok(())
    }

    fn rest_at(&mut self, wanted: &[i64; 4]) -> Result<(), String> {
        let (mut before, mut waited) = (self.side.steps(), 0);
        loop {
            self.side.run_ms(REST_MS);
            let steps = self.side.steps();
            if steps == before && steps == *wanted {
                return Ok(());
            }
            if steps == before && waited >= MOVE_MS.min(10 * REST_MS) {
                return Err(format!("the motors rest at {steps:?} instead of {wanted:?}"));
            }
            waited = if steps == before { waited + REST_MS } else { 0 };
            before = steps;
        }
    }
}
