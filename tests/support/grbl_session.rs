//! Plays and judges a random conversation in grbl's dialect, on the host or on the simulated chip. The first port
//! speaks grbl's dialect, the second TinyG's.
//!
//! What must hold:
//!
//! - Each line is answered once, in order, by `ok` or `error:N`. All other output keeps to grbl's grammar.
//! - Each `?` is answered by a whole report within `report_ms`, also in a hold, an alarm, in sleep and in a list.
//! - Real-time bytes are no part of a line.
//! - A sender that counts characters for a buffer of [`BUFFER`] bytes loses nothing, and `Bf` is true.
//! - At rest `MPos` agrees with the steps, and X is where the accepted moves lead.

use std::collections::VecDeque;

use crate::grbl_ops::Op;
use crate::side::Side;

/// The size of the buffer that a sender which counts characters assumes.
const BUFFER: usize = 128;
/// Time within which all reports but one in a hundred must come, ms.
const PROMPT_MS: u64 = 20;
/// The size of the buffer that the machine reports.
const TOLD: usize = 254;
/// Bytes that may be on their way to the sender.
const RING: usize = 128;
/// Free blocks of an empty queue.
const BLOCKS: usize = 61;
/// Longest time until the machine is at rest, ms.
const REST_MS: u64 = 60_000;
const STEPS: f64 = 1280.0;

type Outcome<T> = Result<T, String>;

/// A status report.
#[derive(Clone, Debug, Default)]
struct Report {
    state: String,
    places: Vec<f64>,
    buffer: Option<(usize, usize)>,
}

/// A line that has not been answered.
#[derive(Debug)]
struct Sent {
    bytes: usize,
    /// The distance that the line moves X if it is accepted; `None` if that is unknown.
    way: Option<f64>,
    /// Whether the line homes. Meanwhile no `?` is answered.
    homes: bool,
}

/// A sender's side of a conversation, and the known state of the machine.
pub struct Session<S> {
    side: S,
    /// Longest time until a report has come, ms. A report takes about 10 ms on the wire. The time of bytes that were
    /// queued for the port before the report does not count.
    report_ms: u64,
    /// The longest time of a report so far, the number of reports, and the number that took more than [`PROMPT_MS`].
    longest_ms: u64,
    reports: usize,
    late: usize,
    ms: u64,
    partial: String,
    in_flight: VecDeque<Sent>,
    /// The time at which the oldest unanswered `?` was sent.
    asked: Option<u64>,
    /// Bytes other than reports that have come since that `?`.
    before: usize,
    /// Whether a reset has been sent and the greeting has not come.
    resets: bool,
    /// Whether the machine has reported the end of check mode, which a greeting follows.
    greets: bool,
    report: Report,
    /// Tildes sent since the buffer was last empty.
    tildes: usize,
    /// The position of X by the lines that were accepted, mm; `None` if it is unknown.
    x: Option<f64>,
    /// The positions at the beginning, steps.
    base: [i64; 4],
    /// Number of unanswered lines on the second port, and the part of the next answer that has come.
    aside: usize,
    heard_aside: String,
    log: Vec<String>,
}

impl<S: Side> Session<S> {
    /// A session with a machine that is about to boot.
    pub fn new(side: S, report_ms: u64) -> Self {
        let base = side.steps();
        Session {
            side,
            report_ms,
            longest_ms: 0,
            reports: 0,
            late: 0,
            ms: 0,
            partial: String::new(),
            in_flight: VecDeque::new(),
            asked: None,
            before: 0,
            resets: false,
            greets: false,
            report: Report::default(),
            tildes: 0,
            x: None,
            base,
            aside: 0,
            heard_aside: String::new(),
            log: Vec::new(),
        }
    }

    /// Boots a machine with empty EEPROM, and makes it fast.
    pub fn begin(&mut self) -> Outcome<()> {
        self.side.run_ms(1_500);
        for setting in [
            "{x:{vm:3000,fr:3000,jm:2000,ac:0}}",
            "{y:{vm:3000,fr:3000,jm:2000,ac:0}}",
            "{z:{vm:3000,fr:3000,jm:2000,ac:0}}",
        ] {
            self.side.send_aux(format!("{setting}\n").as_bytes());
            self.side.run_ms(1_000);
        }
        self.side.heard();
        self.side.heard_aux();
        for line in ["$$", "$10=3"] {
            self.line(line, &[])?;
        }
        self.rest()
    }

    /// Plays the conversation, up to a rest.
    pub fn play(&mut self, ops: &[Op]) -> Outcome<()> {
        for op in ops {
            self.log.push(format!("{op:?}"));
            match op {
                Op::Line(line, within) => self.line(line, within)?,
                Op::Bytes(bytes) => bytes.iter().for_each(|byte| self.act(*byte)),
                Op::Aside(line) => self.aside(line)?,
                Op::Wait(ms) => self.run(*ms)?,
                Op::Rest => self.rest()?,
                Op::Reset => {
                    self.side.send(b"G91 G0 X5");
                    self.reset()?;
                }
            }
        }
        self.rest()?;
        self.log.clear();
        Ok(())
    }

    /// Returns all that was done and heard.
    pub fn story(&self) -> String {
        self.log.iter().map(|line| format!("  {line}\n")).collect()
    }

    /// Checks that nearly all reports have come promptly.
    #[allow(dead_code)]
    pub fn check_prompt(&self) {
        let Self { longest_ms, reports, late, .. } = self;
        println!("{reports} reports, {late} later than {PROMPT_MS} ms, the last at {longest_ms}");
        assert!(late * 100 <= *reports, "{late} of {reports} reports are late");
    }

    /// Plays a job that fills the buffer, is held for a minute while the sender asks eight times a second, as senders
    /// do, and then goes on.
    #[allow(dead_code)]
    pub fn hold_long(&mut self) -> Outcome<()> {
        for line in ["G21G94G91G1F3000X0", "X5"] {
            self.line(line, &[])?;
        }
        self.run(50)?;
        self.side.send(b"!");
        // The queue of blocks fills first, and then the buffer.
        while self.in_flight.len() < BUFFER / 5 {
            self.line("X-.1", &[])?;
            self.run(10)?;
        }
        for _ in 0..480 {
            self.ask()?;
            self.run(120)?;
        }
        if !self.report.state.starts_with("Hold") {
            return Err(format!("it does not hold: {:?}", self.report));
        }
        self.rest()
    }

    fn act(&mut self, byte: u8) {
        self.side.send(&[byte]);
        self.tildes += usize::from(byte == b'~');
        if byte == b'?' && self.asked.is_none() {
            (self.asked, self.before) = (Some(self.ms), 0);
        }
        if matches!(byte, 0x84 | 0x85 | b'!') {
            // The byte may end a jog.
            self.doubt();
        }
    }

    /// Gives up the position of X: from now on it is unknown where the accepted moves lead.
    fn doubt(&mut self) {
        self.x = None;
        self.in_flight.iter_mut().for_each(|sent| sent.way = None);
    }

    /// Sends a line as soon as the buffer has room for it, with real-time bytes within it.
    fn line(&mut self, line: &str, within: &[(usize, u8)]) -> Outcome<()> {
        let bytes = line.len() + 1;
        let mut waited = 0;
        while self.in_flight.iter().map(|sent| sent.bytes).sum::<usize>() + bytes > BUFFER {
            self.run(10)?;
            waited += 10;
            if waited % 500 == 0 {
                self.relieve()?;
            }
            if waited > REST_MS {
                return Err(format!("{line} finds no room behind {:?}", self.in_flight));
            }
        }
        let way = line.strip_prefix("G21G94G91G1F3000X").map(|way| way.parse().expect("a number"));
        let way = way.or(is_still(line).then_some(0.0));
        for (at, byte) in line.bytes().chain([b'\n']).enumerate() {
            let acting = within.iter().filter(|(place, _)| *place == at);
            acting.for_each(|(_, acting)| self.act(*acting));
            self.side.send(&[byte]);
        }
        let homes = line.get(..2).is_some_and(|begin| begin.eq_ignore_ascii_case("$H"));
        self.in_flight.push_back(Sent { bytes, way, homes });
        match line {
            "$C" => self.settle(),
            _ => self.run(0),
        }
    }

    /// Waits until all lines are answered. If the line ends check mode, also waits for the greeting, because lines
    /// that come before the greeting are dropped.
    fn settle(&mut self) -> Outcome<()> {
        let end = self.ms + REST_MS;
        while self.greets || !self.in_flight.is_empty() {
            self.run(20)?;
            self.act(b'~');
            if self.ms > end {
                return Err(format!("{:?} unanswered", self.in_flight));
            }
        }
        Ok(())
    }

    fn aside(&mut self, line: &str) -> Outcome<()> {
        let mut waited = 0;
        while self.aside > 1 {
            self.run(10)?;
            waited += 10;
            if waited > REST_MS {
                return Err("no answer on the second port".to_string());
            }
        }
        self.side.send_aux(format!("{line}\n").as_bytes());
        self.aside += 1;
        Ok(())
    }

    /// Lets time pass, and handles what comes.
    fn run(&mut self, ms: u64) -> Outcome<()> {
        self.hear()?;
        for _ in 0..ms {
            self.side.run_ms(1);
            self.ms += 1;
            self.hear()?;
            if let Some(waits) = self.waits().filter(|waits| *waits > self.report_ms) {
                return Err(format!("a ? has no answer after {waits} ms, in {:?}", self.report));
            }
        }
        Ok(())
    }

    /// Returns how long the oldest `?` has waited, ms, without the time of the bytes that were on their way before
    /// its answer.
    fn waits(&self) -> Option<u64> {
        let before = self.before.min(RING) as u64 * 10 / 115;
        let homes = self.in_flight.iter().any(|sent| sent.homes);
        self.asked
            .filter(|_| !self.resets && !homes)
            .map(|at| (self.ms - at).saturating_sub(before))
    }

    fn hear(&mut self) -> Outcome<()> {
        self.heard_aside += &String::from_utf8_lossy(&self.side.heard_aux());
        while let Some((line, rest)) = self.heard_aside.split_once('\n') {
            self.aside -= usize::from(line.starts_with("{\"r\":")).min(self.aside);
            self.heard_aside = rest.to_string();
        }
        self.partial += &String::from_utf8_lossy(&self.side.heard());
        while let Some((line, rest)) = self.partial.split_once('\n') {
            let line =
                line.strip_suffix('\r').ok_or_else(|| format!("{line:?} has no CR"))?.to_string();
            self.partial = rest.to_string();
            self.log.push(format!("    < {line}"));
            if !line.starts_with('<') {
                self.before += line.len() + 2;
            }
            self.judge(&line)?;
        }
        Ok(())
    }

    fn judge(&mut self, line: &str) -> Outcome<()> {
        match line {
            "ok" => return self.answered(true),
            "" => {}
            "[MSG:Disabled]" => self.greets = true,
            "Grbl 1.1h ['$' for help]" if self.resets || self.greets => {
                (self.resets, self.greets) = (false, false);
                self.doubt();
                self.in_flight.clear();
                self.asked = self.asked.map(|_| self.ms);
                self.asked = self.asked.map(|_| self.ms);
            }
            _ if line.starts_with("error:") => {
                number(&line[6..], 1..=40)?;
                return self.answered(false);
            }
            _ if line.starts_with("ALARM:") => {
                number(&line[6..], 1..=10)?;
                self.doubt();
            }
            _ if line.starts_with('<') => {
                self.report = report(line).ok_or_else(|| format!("{line} is no report"))?;
                let waited = self.waits().unwrap_or(0);
                self.longest_ms = self.longest_ms.max(waited);
                self.reports += 1;
                self.late += usize::from(waited > PROMPT_MS);
                self.asked = None;
                self.check_buffer(line)?;
            }
            _ if line.starts_with('[') && line.ends_with(']') => {
                let name = line[1..].split(':').next().unwrap_or_default();
                if !BRACKETS.contains(&name) {
                    return Err(format!("{line} is no message of grbl's"));
                }
            }
            _ if line.starts_with('$') && line.contains('=') => {}
            _ if line.starts_with('>') && line.contains(':') => {}
            _ => return Err(format!("{line} is no line of grbl's")),
        }
        Ok(())
    }

    fn answered(&mut self, taken: bool) -> Outcome<()> {
        let Some(sent) = self.in_flight.pop_front() else {
            return Err("an answer to nothing".to_string());
        };
        if sent.homes {
            self.asked = self.asked.map(|_| self.ms);
        }
        if taken {
            self.x = self.x.zip(sent.way).map(|(x, way)| x + way);
        }
        Ok(())
    }

    /// Checks that the unanswered lines account for the buffer that is in use.
    fn check_buffer(&self, line: &str) -> Outcome<()> {
        let Some((blocks, free)) = self.report.buffer else { return Ok(()) };
        let waits: usize = self.in_flight.iter().map(|sent| sent.bytes).sum();
        // 12 bytes are allowed for a line without its end that a reset has dropped. A tilde takes a place among the
        // lines.
        match blocks <= BLOCKS && free <= TOLD && free + waits + 12 + self.tildes >= TOLD {
            true => Ok(()),
            false => Err(format!("{line} while {waits} bytes wait")),
        }
    }

    fn reset(&mut self) -> Outcome<()> {
        self.resets = true;
        self.side.send(b"\x18");
        self.doubt();
        let mut waited = 0;
        while self.resets {
            self.run(1)?;
            waited += 1;
            if waited > 5_000 {
                return Err("no greeting".to_string());
            }
        }
        Ok(())
    }

    /// Releases whatever keeps the machine from moving.
    fn relieve(&mut self) -> Outcome<()> {
        if self.in_flight.is_empty() {
            self.tildes = 0;
        }
        self.act(b'~');
        self.run(5)?;
        self.ask()?;
        if self.report.state == "Sleep" {
            self.reset()?;
        }
        Ok(())
    }

    fn ask(&mut self) -> Outcome<()> {
        self.act(b'?');
        while self.asked.is_some() {
            self.run(1)?;
        }
        Ok(())
    }

    /// Waits until the machine is at rest. Then compares its position with what it reports, and with where the
    /// accepted moves lead.
    fn rest(&mut self) -> Outcome<()> {
        let end = self.ms + REST_MS;
        loop {
            self.relieve()?;
            let before = self.side.steps();
            self.run(60)?;
            self.ask()?;
            let still = before == self.side.steps() && self.in_flight.is_empty();
            match self.report.state.as_str() {
                "Idle" if still => break,
                "Alarm" if still => self.line("$X", &[])?,
                "Check" if still => self.line("$C", &[])?,
                _ => {}
            }
            if self.ms > end {
                return Err(format!("no rest: {:?}, {:?} unanswered", self.report, self.in_flight));
            }
        }
        if self.report.buffer.is_some_and(|buffer| buffer != (BLOCKS, TOLD)) {
            return Err(format!("at rest it is {:?}", self.report));
        }
        let steps = self.side.steps();
        for (n, place) in self.report.places.iter().take(3).enumerate() {
            let is = (steps[n] - self.base[n]) as f64 / STEPS;
            if (is - place).abs() > 0.0016 {
                return Err(format!("axis {n} is at {is}, and {:?}", self.report));
            }
        }
        let is = (steps[0] - self.base[0]) as f64 / STEPS;
        if self.x.is_some_and(|x| (x - is).abs() > 1.5 / STEPS) {
            return Err(format!("X is at {is}, and was sent to {:?}", self.x));
        }
        self.x = Some(is);
        Ok(())
    }
}

const BRACKETS: &[&str] = &[
    "MSG", "GC", "HLP", "VER", "OPT", "PRB", "TLO", "G54", "G55", "G56", "G57", "G58", "G59",
    "G28", "G30", "G92", "echo",
];

/// Whether a line moves nothing, whatever its answer is, and changes no mode that affects a counted move.
fn is_still(line: &str) -> bool {
    let stills = [
        "",
        "  ",
        "(a comment)",
        "$",
        "$$",
        "$#",
        "$G",
        "$I",
        "$N",
        "M5",
        "M9",
        "G4P0.05",
        "G4P0",
        "G1X",
        "G99.9",
        "M99",
        "garbage",
        "$999=1",
    ];
    stills.contains(&line)
}

fn number(text: &str, range: std::ops::RangeInclusive<u32>) -> Outcome<()> {
    match text.parse() {
        Ok(number) if range.contains(&number) => Ok(()),
        _ => Err(format!("{text} is no number of grbl's")),
    }
}

/// Parses a status report; `None` if it breaks the grammar.
fn report(line: &str) -> Option<Report> {
    let mut fields = line.strip_prefix('<')?.strip_suffix('>')?.split('|');
    let state = fields.next()?.to_string();
    let (name, sub) = state.split_once(':').unwrap_or((&state, ""));
    match name {
        "Hold" => ["0", "1"].contains(&sub),
        "Door" => ["0", "1", "2", "3"].contains(&sub),
        "Idle" | "Run" | "Jog" | "Alarm" | "Check" | "Home" | "Sleep" => sub.is_empty(),
        _ => false,
    }
    .then_some(())?;
    let places = numbers(fields.next()?.strip_prefix("MPos:")?, 3)?;
    let mut report = Report { state, places: places.clone(), buffer: None };
    let mut order = 0;
    for field in fields {
        let (name, value) = field.split_once(':')?;
        let at =
            ["Bf", "Ln", "FS", "Pn", "WCO", "Ov", "A"].iter().position(|known| *known == name)? + 1;
        // Each field comes once. The order is grbl's, except for `Pn`, whose place no sender relies on.
        (at > order || name == "Pn" || order == 4).then_some(())?;
        order = at;
        match name {
            "Bf" => {
                let two = numbers(value, 0)?;
                let [blocks, bytes] = two[..] else { return None };
                report.buffer = Some((blocks as usize, bytes as usize));
            }
            "FS" => (numbers(value, 0)?.len() == 2).then_some(())?,
            "Ov" => (numbers(value, 0)?.len() == 3).then_some(())?,
            "WCO" => (numbers(value, 3)?.len() == places.len()).then_some(())?,
            "Pn" => value.chars().all(|c| "PXYZADRHS".contains(c)).then_some(())?,
            "A" => value.chars().all(|c| "SCFM".contains(c)).then_some(())?,
            _ => drop(value.parse::<u32>().ok()?),
        }
    }
    Some(report)
}

/// Parses numbers separated by commas, each with `decimals` decimals.
fn numbers(text: &str, decimals: usize) -> Option<Vec<f64>> {
    let number = |text: &str| {
        let places = text.split_once('.').map_or(0, |(_, places)| places.len());
        (places == decimals).then(|| text.parse().ok())?
    };
    text.split(',').map(number).collect()
}
