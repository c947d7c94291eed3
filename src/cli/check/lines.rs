//! The lines of a job: which are sent, and how.

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
    /// Whether it is sent once more, because an alarm had locked it out.
    pub again: bool,
}

/// Settings that change what answers look like, or restart the board.
const NOT_SENT: [&str; 8] = ["ej", "jv", "js", "dia", "baud", "boot", "reset", "defa"];

/// The byte order mark of UTF-8, with which some programs begin a file.
const MARK: &[u8] = "\u{FEFF}".as_bytes();

/// Returns the lines that a sender sends: a mark at the beginning, blank lines and `%` are left out, and for a printing
/// host comments.
pub fn of(job: &[u8], dialect: Dialect) -> impl Iterator<Item = Line> {
    let job = job.strip_prefix(MARK).unwrap_or(job);
    let lines = (1..).zip(job.split(|byte| *byte == b'\n'));
    lines.filter_map(move |(number, line)| {
        let mut line = line.trim_ascii();
        if dialect == Dialect::RepRap {
            line = line.split(|byte| *byte == b';').next().unwrap_or_default().trim_ascii();
            line = unnumbered(line);
        }
        if line.is_empty() || line.starts_with(b"%") {
            return None;
        }
        let text = String::from_utf8_lossy(line).into_owned();
        let (bytes, acts) = dialect.take_out(line);
        let kind = kind(&text, dialect);
        Some(Line { number, text, bytes, acts, kind, again: false })
    })
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
        _ if code.starts_with('?') => Kind::Untried("a question to the machine, no G-code"),
        _ if code.starts_with('$') => Kind::Untried("a command to the machine, no G-code"),
        Dialect::TinyG if code.starts_with('H') => Kind::Untried("help, no G-code"),
        Dialect::TinyG if code.starts_with('{') => kind_of_json(line),
        _ => match has(&code, "G28.2") || has(&code, "G28.4") {
            true => Kind::Homes(named(&code)),
            false if code.contains("G38.") => Kind::Alone,
            false => Kind::Beside,
        },
    }
}

fn kind_of_print(code: &str) -> Kind {
    if has(code, "G28") || has(code, "G161") || has(code, "G162") {
        return Kind::Homes(named(code));
    }
    match () {
        () if has(code, "G29") => Kind::Untried("there is no bed to probe"),
        () if has(code, "M303") => Kind::Untried("there is no heater to tune"),
        () if has(code, "M112") => Kind::Untried("it stops the machine"),
        () if has(code, "M92") => Kind::Sets,
        () => Kind::Beside,
    }
}

fn kind_of_json(line: &str) -> Kind {
    let names = line.split(['{', ',']).filter_map(|part| part.split_once(':'));
    let mut names = names.map(|(name, _)| name.trim().trim_matches('"').to_ascii_lowercase());
    match names.any(|name| NOT_SENT.contains(&name.as_str())) {
        true => Kind::Untried("a setting of the board or of its port"),
        false => Kind::Sets,
    }
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
