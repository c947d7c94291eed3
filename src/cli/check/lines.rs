//! The lines of a job: which are sent, and how.

use std::ops::Range;

use super::dialect::{Dialect, code_of};

/// How a line is sent.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Kind {
    /// With others in flight.
    Beside,
    /// At rest, and the next line when the machine rests again: a probing.
    Alone,
    /// As [`Self::Alone`]; it may change settings.
    Sets,
    /// Not at all; the reason.
    Untried(&'static str),
    /// Not at all: it would stop the job, or the machine would not carry out the lines behind it; the reason.
    Stops(&'static str),
    /// Not at all: these axes count as homed.
    Homes([bool; 3]),
}

/// A line of a job.
#[derive(Clone, Debug)]
pub struct Line {
    /// Its number in the file.
    pub number: usize,
    /// The line as it stands in the file.
    pub text: String,
    /// What is sent of it.
    pub bytes: Vec<u8>,
    /// What characters of it would do at once.
    pub acts: Vec<&'static str>,
    pub kind: Kind,
    /// By how much its dwell was shortened, ms.
    pub skipped_ms: u64,
    /// Whether it is sent once more, because an alarm had locked it out.
    pub again: bool,
}

/// Settings that change what answers look like or when they come.
const NOT_SENT: [&str; 6] = ["ej", "jv", "js", "dia", "baud", "ex"];

const CHECKS: &str = "check mode: the lines behind it would be read and not carried out";
const SLEEPS: &str = "it puts the machine to sleep: the lines behind it would be refused";
const RESTORES: &str = "it restores defaults: the job behind it is not the one that is tried here";
const ALARMS: &str = "it raises an alarm: the lines behind it would be refused";
const RESTARTS: &str = "it restarts the machine: the lines behind it may be lost";
const BRACES: &str =
    "error:1, and at rest it selects TinyG's dialect: the sender would not know the answers";
/// Names that end or change what the lines behind them do, with the reason. They are not sent.
const STOPS: [(&str, &str); 7] = [
    ("alarm", ALARMS),
    ("shutd", ALARMS),
    ("panic", ALARMS),
    ("chk", CHECKS),
    ("defa", RESTORES),
    ("boot", RESTARTS),
    ("reset", RESTARTS),
];
/// Those that act with any value.
const RAISES: [&str; 3] = ["alarm", "shutd", "panic"];

/// A longer dwell is shortened to this, ms, and the rest added to the time.
const DWELL_MS: u64 = 60_000;

/// The byte order mark of UTF-8, with which some programs begin a file.
const MARK: &[u8] = "\u{FEFF}".as_bytes();

/// Returns the lines that a sender sends: a mark at the beginning, blank lines and those with `%` alone are left out, and
/// for a printing host comments. Line ends are those of the machine: LF, CR or both.
pub fn of(job: &[u8], dialect: Dialect) -> impl Iterator<Item = Line> {
    let job = job.strip_prefix(MARK).unwrap_or(job);
    let whole = job.split(|byte| *byte == b'\n');
    // A CR at the end belongs to the LF behind it.
    let whole = whole.map(|line| line.strip_suffix(b"\r").unwrap_or(line));
    let lines = (1..).zip(whole.flat_map(|line| line.split(|byte| *byte == b'\r')));
    lines.flat_map(move |(number, line)| pieces(number, line, dialect).into_iter().flatten())
}

/// Returns what a line of the file is to the machine: a question at its beginning, and the line.
fn pieces(number: usize, line: &[u8], dialect: Dialect) -> [Option<Line>; 2] {
    if dialect == Dialect::RepRap {
        let line = line.split(|byte| *byte == b';').next().unwrap_or_default().trim_ascii();
        return [None, piece(number, unnumbered(line), dialect)];
    }
    let is_asking = |byte: &u8| *byte == b'?' || byte.is_ascii_whitespace();
    let asks = line.iter().take_while(|byte| is_asking(byte)).count();
    let asks = if line[..asks].contains(&b'?') { asks } else { 0 };
    let (question, rest) = line.split_at(asks);
    [piece(number, question, dialect), piece(number, rest, dialect)]
}

/// Returns a line; `None` if there is nothing to send. Blanks at its ends are sent, because they count as its length.
fn piece(number: usize, line: &[u8], dialect: Dialect) -> Option<Line> {
    if line.iter().all(|byte| *byte == b'%' || byte.is_ascii_whitespace()) {
        return None;
    }
    let text = String::from_utf8_lossy(line.trim_ascii()).into_owned();
    let (bytes, acts) = dialect.take_out(line);
    let kind = kind(&text, dialect);
    let (bytes, skipped_ms) = match kind {
        Kind::Beside => shortened(bytes, dialect),
        Kind::Sets => (as_json(bytes, dialect), 0),
        _ => (bytes, 0),
    };
    Some(Line { number, text, bytes, acts, kind, skipped_ms, again: false })
}

/// Returns a line of TinyG's text mode as JSON, whose answers are JSON.
fn as_json(line: Vec<u8>, dialect: Dialect) -> Vec<u8> {
    let code = line.trim_ascii();
    match dialect == Dialect::TinyG && code.starts_with(b"$") {
        true => [b"{txt:\"", code, b"\"}"].concat(),
        false => line,
    }
}

/// Returns a line whose dwell (G4) is at most [`DWELL_MS`], and by how many ms it has become shorter.
fn shortened(line: Vec<u8>, dialect: Dialect) -> (Vec<u8>, u64) {
    let Some((place, unit)) = dwell(&line, dialect) else { return (line, 0) };
    let number =
        str::from_utf8(&line[place.clone()]).ok().and_then(|text| text.parse::<f64>().ok());
    let ms = number.map_or(0, |number| (number * unit as f64) as u64);
    // A longer one is refused.
    if ms <= DWELL_MS || ms > u64::from(u32::MAX) {
        return (line, 0);
    }
    let number = (DWELL_MS / unit).to_string();
    let line = [&line[..place.start], number.as_bytes(), &line[place.end..]].concat();
    (line, ms - DWELL_MS)
}

/// Returns where the time of a dwell (G4) stands in a line, and the ms in its unit. A printing host has S in seconds, and
/// P in ms.
fn dwell(line: &[u8], dialect: Dialect) -> Option<(Range<usize>, u64)> {
    let code = bare(&String::from_utf8_lossy(line));
    if !has(&code, "G4") && !has(&code, "G04") {
        return None;
    }
    let (letter, unit) = match dialect {
        Dialect::RepRap if code.contains('S') => (b'S', 1_000),
        Dialect::RepRap => (b'P', 1),
        _ => (b'P', 1_000),
    };
    let mut comment = false;
    let letter_at = line.iter().position(|byte| {
        comment = match byte {
            b'(' | b';' => true,
            b')' => false,
            _ => comment,
        };
        !comment && byte.eq_ignore_ascii_case(&letter)
    })?;
    let behind = letter_at + 1;
    let start = behind + line[behind..].iter().take_while(|byte| **byte == b' ').count();
    let is_digit = |byte: &&u8| byte.is_ascii_digit() || **byte == b'.';
    let end = start + line[start..].iter().take_while(is_digit).count();
    Some((start..end, unit))
}

/// Returns a line without its own number and checksum: a printing host gives each line its own.
fn unnumbered(line: &[u8]) -> &[u8] {
    let Some((b'N' | b'n', rest)) = line.split_first() else { return line };
    let rest = rest.trim_ascii_start();
    let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let rest = rest.get(digits..).unwrap_or_default().trim_ascii_start();
    rest.split(|byte| *byte == b'*').next().unwrap_or_default()
}

/// Returns a line without comments and blanks, in capitals.
pub fn bare(line: &str) -> String {
    let code = code_of(line);
    code.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_ascii_uppercase()).collect()
}

/// Whether a line taps.
pub fn taps(line: &str) -> bool {
    bare(line).contains("G33.1")
}

fn kind(line: &str, dialect: Dialect) -> Kind {
    let code = bare(line);
    match dialect {
        Dialect::RepRap => kind_of_print(&code),
        Dialect::Grbl if code.starts_with("$H") => Kind::Homes(named(&code[2..])),
        Dialect::Grbl if code.starts_with("$C") && code.len() == 2 => Kind::Stops(CHECKS),
        Dialect::Grbl if code.starts_with("$SLP") => Kind::Stops(SLEEPS),
        Dialect::Grbl if code.starts_with("$RST=") => Kind::Stops(RESTORES),
        _ if code.starts_with('?') => Kind::Untried("a question to the machine, no G-code"),
        Dialect::TinyG if line.contains(['"', '\\']) && code.starts_with('$') => {
            Kind::Untried("a command to the machine, no G-code")
        }
        _ if code.starts_with('$') => kind_of_names([text_pair(&code)].into_iter()),
        Dialect::TinyG if code.starts_with('H') => Kind::Untried("help, no G-code"),
        Dialect::TinyG if code.starts_with('{') => kind_of_json(line),
        _ if code.starts_with('{') && code.ends_with('}') => Kind::Stops(BRACES),
        _ => match has(&code, "G28.2") || has(&code, "G28.4") {
            true => Kind::Homes(named(&code)),
            false if code.contains("G38.") => Kind::Alone,
            false => Kind::Beside,
        },
    }
}

fn kind_of_print(code: &str) -> Kind {
    // Text for people.
    if has(code, "M117") || has(code, "M118") {
        return Kind::Beside;
    }
    if has(code, "G28") || has(code, "G161") || has(code, "G162") {
        return Kind::Homes(named(code));
    }
    match () {
        () if has(code, "G29") || has(code, "M420") => Kind::Untried("there is no bed to probe"),
        () if has(code, "M303") => Kind::Untried("there is no heater to tune"),
        () if has(code, "M110") => Kind::Untried("the host numbers its lines"),
        () if has(code, "M112") => Kind::Stops("it stops the machine"),
        () if has(code, "M92") => Kind::Sets,
        () => Kind::Beside,
    }
}

/// Returns the kind of a line of JSON: that of the line in it, or by its names.
fn kind_of_json(line: &str) -> Kind {
    let inner = ["gc", "txt"].into_iter().find_map(|name| {
        let (_, rest) = line.split_once(name)?;
        let (_, string) =
            rest.trim_start_matches('"').trim_start().strip_prefix(':')?.split_once('"')?;
        string.split('"').next()
    });
    if let Some(inner) = inner {
        return match kind(inner, Dialect::TinyG) {
            kind @ (Kind::Homes(_) | Kind::Stops(_)) => kind,
            kind @ Kind::Untried(_) if inner.starts_with('$') => kind,
            _ => Kind::Sets,
        };
    }
    let pairs = line.split(['{', ',']).filter_map(|part| part.split_once(':'));
    kind_of_names(pairs.map(|(name, value)| {
        let name = name.trim().trim_matches('"').to_ascii_lowercase();
        (name, value.trim().to_string())
    }))
}

/// Returns the name of a line of text mode, `$name=value`, and its value; `n` if it has none.
fn text_pair(code: &str) -> (String, String) {
    let rest = code.trim_start_matches('$').to_ascii_lowercase();
    let known = NOT_SENT.into_iter().chain(STOPS.map(|(name, _)| name)).chain(["home"]);
    let name = known.into_iter().find(|name| rest.starts_with(name)).unwrap_or_default();
    let value = rest[name.len()..].trim_start_matches('=');
    (name.to_string(), if value.is_empty() { "n" } else { value }.to_string())
}

/// Returns the kind of a line that sets these names to these values.
fn kind_of_names(pairs: impl Iterator<Item = (String, String)>) -> Kind {
    let mut kind = Kind::Sets;
    for (name, value) in pairs {
        let asks = value.starts_with('n') || value.starts_with('"');
        let is_off = asks || value.starts_with(['0', 'f']);
        let stops = STOPS.into_iter().find(|(of, _)| name == *of);
        match stops {
            Some((name, why)) if !is_off || RAISES.contains(&name) => return Kind::Stops(why),
            _ if name == "home" && !is_off => return Kind::Homes([true; 3]),
            _ if NOT_SENT.contains(&name.as_str()) => {
                kind = Kind::Untried("a setting of the board or of its port");
            }
            _ => {}
        }
    }
    kind
}

/// Whether a line without blanks has a code: G28 is not in G28.1 or G280.
fn has(code: &str, of: &str) -> bool {
    code.match_indices(of).any(|(at, _)| {
        let behind = code[at + of.len()..].chars().next();
        !behind.is_some_and(|c| c.is_ascii_digit() || c == '.')
    })
}

/// Returns which of X, Y and Z a line names; all if it names none.
fn named(code: &str) -> [bool; 3] {
    let named = ['X', 'Y', 'Z'].map(|axis| code.contains(axis));
    if named == [false; 3] { [true; 3] } else { named }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(line: &str, dialect: Dialect) -> Kind {
        kind(line, dialect)
    }

    #[test]
    fn homing_is_found_in_each_dialect() {
        let all = Kind::Homes([true; 3]);
        assert_eq!(kinds("$H", Dialect::Grbl), all);
        assert_eq!(kinds("$HZ", Dialect::Grbl), Kind::Homes([false, false, true]));
        assert_eq!(kinds("g28.2 x0 y0", Dialect::TinyG), Kind::Homes([true, true, false]));
        assert_eq!(kinds("G28", Dialect::RepRap), all);
        assert_eq!(kinds("G28.1", Dialect::RepRap), Kind::Beside);
        assert_eq!(kinds("G28 (G28.2)", Dialect::TinyG), Kind::Beside);
    }

    #[test]
    fn numbers_of_a_file_are_left_out() {
        assert_eq!(unnumbered(b"N12 G1 X1*7"), b"G1 X1");
        assert_eq!(unnumbered(b"G1 X1"), b"G1 X1");
    }
}
