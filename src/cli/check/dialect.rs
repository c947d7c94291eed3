//! The dialects that a job may be sent in: which one a file looks like, how its lines are framed, and what the
//! machine's lines mean.

use kerf::canon::{by_number, of_alarm, of_error, text as text_of};
use kerf::config::Settings;
use kerf::protocol::Speech;
use kerf::realtime::{self, Asked};
use kerf::status::Status;

/// A dialect.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Dialect {
    TinyG,
    Grbl,
    RepRap,
}

/// Why a line is refused.
#[derive(Clone, Debug)]
pub struct Reason {
    /// The words of the machine.
    pub text: String,
    /// The status, if it is known.
    pub status: Option<Status>,
}

/// The meaning of a line that the machine has sent.
pub enum Heard {
    /// Nothing that matters here.
    Nothing,
    /// The line is done.
    Done,
    /// The line is refused.
    Refused(Reason),
    /// The line is refused because an alarm was not cleared.
    Locked,
    /// The line is refused for this reason; its answer comes later.
    Because(Reason),
    /// A notice. The job goes on.
    Notice(String),
    /// An alarm.
    Alarm(Reason),
    /// An exception: an alarm if the machine is in one, else a notice.
    Exception(Reason),
    /// A stop that waits for M108.
    Paused,
}

/// The characters that hold a sender up, and let it go on.
const XOFF: u8 = 0x13;
const XON: u8 = 0x11;
/// Characters of grbl that act at once, beside overrides: door, spindle, flood, mist.
const OF_GRBL: [u8; 4] = [0x84, 0x9E, 0xA0, 0xA1];
/// Status of a line that was skipped.
const PASSED_OVER: u8 = 3;

impl Dialect {
    const ALL: [Self; 3] = [Self::TinyG, Self::Grbl, Self::RepRap];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::TinyG => "tinyg",
            Self::Grbl => "grbl",
            Self::RepRap => "reprap",
        }
    }

    /// Returns the dialect of this name; the error names all.
    pub fn named(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|dialect| dialect.name() == name);
        let names = Self::ALL.map(Self::name).join(", ");
        found.ok_or_else(|| format!("no dialect {name}; there are {names}"))
    }

    /// Returns the dialect of a file by its look, and why.
    pub fn of(text: &str) -> (Self, String) {
        let found = (1..).zip(text.lines()).find_map(|(number, line)| {
            let as_written = line.trim();
            let line = as_written.to_ascii_uppercase();
            if is_of_a_slicer(&line) {
                return Some((Self::RepRap, format!("line {number} is a slicer's comment")));
            }
            if is_of_a_print(&line) {
                return Some((Self::RepRap, format!("line {number} heats or extrudes")));
            }
            let device = Speech::decided_by(as_written.as_bytes(), &Settings::blank());
            if device.is_some_and(|speech| !speech.is_plain() && !speech.is_in_order()) {
                return Some((Self::TinyG, format!("line {number} is a command of TinyG's")));
            }
            is_of_grbl(as_written)
                .then(|| (Self::Grbl, format!("line {number} is a command of grbl's")))
        });
        found.unwrap_or_else(|| (Self::TinyG, "no line tells another".to_string()))
    }

    /// The line that makes an undecided port speak this dialect.
    pub fn opening(self) -> &'static str {
        match self {
            Self::TinyG => "{fv:n}",
            Self::Grbl => "$G",
            Self::RepRap => "M110 N0",
        }
    }

    /// The number of lines that a sender has in flight.
    pub fn in_flight(self) -> usize {
        if self == Self::RepRap { 1 } else { 4 }
    }

    /// Returns the bytes of a line as a sender sends them. `number` counts the lines sent.
    pub fn framed(self, number: usize, line: &[u8]) -> Vec<u8> {
        if self != Self::RepRap {
            return [line, b"\n"].concat();
        }
        let line = [format!("N{number} ").as_bytes(), line].concat();
        let sum = line.iter().fold(0, |sum, byte| sum ^ byte);
        [&line[..], format!("*{sum}\n").as_bytes()].concat()
    }

    /// Returns what a line means.
    pub fn hear(self, line: &str) -> Heard {
        match self {
            Self::TinyG => tinyg(line),
            Self::Grbl => grbl(line),
            Self::RepRap => reprap(line),
        }
    }

    /// Takes the characters that act at once out of a line, and says what they do. In the dialect of printing hosts
    /// they are text.
    pub fn take_out(self, line: &[u8]) -> (Vec<u8>, Vec<&'static str>) {
        let (mut rest, mut acts) = (Vec::new(), Vec::new());
        let mut before = 0;
        for byte in line.iter().copied() {
            match self.acts(byte, before) {
                Some(act) if !acts.contains(&act) => acts.push(act),
                Some(_) => {}
                None => rest.push(byte),
            }
            before = byte;
        }
        (rest, acts)
    }

    /// Whether the machine answers a line. TinyG's dialect answers none of which nothing is left without the characters
    /// that act at once.
    pub fn answers(self, line: &[u8]) -> bool {
        let is_left = |byte: &u8| {
            !byte.is_ascii_whitespace()
                && realtime::bit(*byte) == 0
                && *byte != XON
                && *byte != XOFF
        };
        self != Self::TinyG || line.iter().any(is_left)
    }

    /// Returns what a character does when it arrives. `before` is the one before it.
    fn acts(self, byte: u8, before: u8) -> Option<&'static str> {
        if self == Self::RepRap {
            return None;
        }
        match realtime::bit(byte) {
            realtime::HOLD => Some("! is a feedhold, in a comment too: the machine waits for ~"),
            realtime::RESET => Some("the character 18 (hex) resets the machine"),
            realtime::KILL => Some("the character 04 (hex) ends the job"),
            0 if byte == XOFF && self == Self::TinyG => {
                Some("the character 13 (hex) holds the answers back until 11 (hex)")
            }
            0 if before <= realtime::ASCII && Asked::NOTHING.with(byte).is_some() => {
                Some("a character above 7F (hex) changes an override or ends a jog")
            }
            0 if before <= realtime::ASCII && self == Self::Grbl && OF_GRBL.contains(&byte) => {
                Some("a character above 7F (hex) acts as a door or switches spindle or coolant")
            }
            _ => None,
        }
    }
}

/// Whether a line is a command that grbl alone has: those that select its dialect on a port, and `$H`, `$X`, `$110=..`.
fn is_of_grbl(line: &str) -> bool {
    let code = code_of(line);
    let code = code.trim();
    let named = code.strip_prefix('$').unwrap_or_default();
    let is_homing = named.strip_prefix('H').is_some_and(|axis| axis.len() <= 1);
    let (number, sets) = named.split_once('=').map_or(("", false), |(number, _)| (number, true));
    let is_setting = sets && !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
    let device = Speech::decided_by(code.as_bytes(), &Settings::blank());
    device.is_some_and(Speech::is_in_order) || is_homing || named == "X" || is_setting
}

/// Whether a line, in capitals, is a comment that slicers write. CAM programs write other comments with the same words,
/// as in `; Type: Pocket`.
fn is_of_a_slicer(line: &str) -> bool {
    const BEGINNINGS: [&str; 4] = ["LAYER:", "LAYER_CHANGE", "TYPE:", "FLAVOR:"];
    const NAMES: [&str; 5] =
        ["SLIC3R", "PRUSASLICER", "CURA_STEAMENGINE", "ORCASLICER", "SIMPLIFY3D"];
    line.strip_prefix(';').is_some_and(|comment| {
        BEGINNINGS.iter().any(|mark| comment.starts_with(mark))
            || NAMES.iter().any(|name| comment.contains(name))
    })
}

/// Whether a line, in capitals, heats, or moves the extruder. G28 is no sign: files for mills have it, too.
fn is_of_a_print(line: &str) -> bool {
    let code: String = code_of(line).split_whitespace().collect();
    let code = match code.strip_prefix('N') {
        Some(rest) => rest.trim_start_matches(|c: char| c.is_ascii_digit()),
        None => &code,
    };
    let end = 1 + code
        .get(1..)
        .map_or(0, |rest| rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len()));
    match code.get(..end) {
        Some("G0" | "G00" | "G1" | "G01" | "G2" | "G3" | "G92") => code.contains('E'),
        Some("M82" | "M83" | "M104" | "M109" | "M140" | "M190") => true,
        _ => false,
    }
}

/// Returns a line without comments.
pub fn code_of(line: &str) -> String {
    let mut code = String::new();
    let mut comment = false;
    for c in line.chars() {
        match c {
            '(' => comment = true,
            ')' => comment = false,
            ';' if !comment => break,
            c if !comment => code.push(c),
            _ => {}
        }
    }
    code
}

/// Returns the status of an answer in TinyG's dialect; `None` if the line answers nothing.
pub fn status(heard: &str) -> Option<u8> {
    let (body, footer) = heard.split_once(",\"f\":[1,")?;
    let is_answer = body.starts_with("{\"r\":") && !body.contains("SYSTEM READY");
    let is_unasked = body.starts_with("{\"r\":{\"prb\":");
    let status = footer.split(',').next()?.parse().ok()?;
    (is_answer && !is_unasked).then_some(status)
}

fn tinyg(line: &str) -> Heard {
    let number = by_number;
    let says = |code: u8| {
        let status = number(code);
        let text = format!("status {code} {}", status.map(text_of).unwrap_or_default());
        Reason { text, status }
    };
    let exception = || {
        let (_, rest) = line.strip_prefix("{\"er\":")?.split_once("\"st\":")?;
        rest.split([',', '}']).next()?.parse::<u8>().ok()
    };
    match (status(line), exception()) {
        (Some(0 | PASSED_OVER), _) => Heard::Done,
        (Some(code), _) if number(code) == Some(Status::Alarmed) => Heard::Locked,
        (Some(code), _) => Heard::Refused(says(code)),
        (_, Some(code)) if number(code) == Some(Status::Alarmed) => Heard::Nothing,
        (_, Some(code)) => Heard::Exception(says(code)),
        _ => Heard::Nothing,
    }
}

fn grbl(line: &str) -> Heard {
    let number = |name: &str| line.strip_prefix(name)?.parse::<u8>().ok();
    // Several statuses may have the same number.
    let one_of = |all: Vec<Status>| {
        let mut texts: Vec<String> = all.iter().map(|status| text_of(*status)).collect();
        texts.dedup();
        texts.truncate(3);
        let status = if let [only] = all[..] { Some(only) } else { None };
        Reason { text: format!("{line} {}", texts.join(" / ")), status }
    };
    if line == "ok" {
        return Heard::Done;
    }
    match (number("error:"), number("ALARM:")) {
        (Some(9), _) => Heard::Locked,
        (Some(n), _) => Heard::Refused(one_of(of_error(n))),
        (_, Some(4 | 5)) => Heard::Alarm(one_of(vec![Status::ProbeFailed])),
        (_, Some(n)) => Heard::Alarm(one_of(of_alarm(n))),
        _ => Heard::Nothing,
    }
}

fn reprap(line: &str) -> Heard {
    let because = || Heard::Because(Reason { text: line.to_string(), status: None });
    let told = line.strip_prefix("echo:").map(str::trim_start);
    match told {
        _ if line == "ok" || line.starts_with("ok ") => Heard::Done,
        _ if line.starts_with("Error:alarm") || line.starts_with("Error:stopped") => Heard::Locked,
        _ if line.starts_with("Error:") => because(),
        Some(told) if told.starts_with("busy: paused") => Heard::Paused,
        Some(told) if told.starts_with("busy:") => Heard::Nothing,
        Some(told) if told.starts_with("cold extrusion") => because(),
        Some(told) => Heard::Notice(told.to_string()),
        None => Heard::Nothing,
    }
}
