//! The oracle of prints: computes the end of each line, independently of the firmware.
//!
//! It shares no code with the firmware. A position is in units of 0.1 um, and each word is rounded to that. What the
//! rounding leaves is carried over to the next relative word. E, or A, is the fourth axis: it makes what M221 says of
//! its words, and G10 and G11 move it without its words.

use crate::job::Lines;
use crate::oracle::{AXES, Decimal, Exact, Unclear, divide};

/// Units in an inch and in a millimetre.
const INCH: i128 = 254_000;
const MM: i128 = crate::oracle::UNITS;
/// The axes of a printer. The first `HOMED` of them can be homed.
const LETTERS: [char; 4] = ['X', 'Y', 'Z', 'E'];
const HOMED: usize = 3;
const E: usize = 3;

/// The state after a line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Corner {
    /// Number of the line in the file.
    pub line: usize,
    /// Position of the machine after the line.
    pub position: [i64; AXES],
    /// Whether the line homes, so that positions count from another place.
    pub homes: bool,
}

/// The heater command of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Asked {
    /// Nothing.
    Nothing,
    /// Target of the hot end, degrees.
    HotEnd(i64),
    /// Target of the bed, degrees.
    Bed(i64),
}

/// Returns a line without its comment and without blanks around it.
pub fn without_comment(line: &str) -> &str {
    line.split(';').next().unwrap_or_default().trim()
}

/// Returns the code of a line in upper case, such as `G1`, and its words.
fn parts(line: &str) -> Option<(String, Vec<(char, Decimal)>)> {
    let text: String = without_comment(line).to_ascii_uppercase();
    let text: String = text.chars().filter(|c| !c.is_whitespace()).collect();
    let word_end = |text: &str| {
        let rest = text.get(1..).unwrap_or_default();
        1 + rest.find(|c: char| !c.is_ascii_digit() && !"+-.".contains(c)).unwrap_or(rest.len())
    };
    let (code, mut rest) = text.split_at_checked(word_end(&text))?;
    let mut words = Vec::new();
    while let Some(letter) = rest.chars().next().filter(char::is_ascii) {
        let (word, behind) = rest.split_at(word_end(rest));
        words.push((letter, Decimal::parse(&word[1..]).unwrap_or(Decimal::whole(0))));
        rest = behind;
    }
    Some((code.to_owned(), words))
}

/// Whether a line shows that a file is a print: it moves an extruder, or heats.
pub fn is_printing(line: &str) -> bool {
    let Some((code, words)) = parts(line) else { return false };
    match code.as_str() {
        "G0" | "G1" | "G92" => words.iter().any(|(letter, _)| *letter == 'E'),
        "M104" | "M109" | "M140" | "M190" => true,
        _ => false,
    }
}

/// Returns the heater command of a line.
pub fn asked(line: &str) -> Asked {
    let Some((code, words)) = parts(line) else { return Asked::Nothing };
    let degrees = words.iter().find(|(letter, _)| matches!(letter, 'S' | 'R'));
    match (code.as_str(), degrees) {
        ("M104" | "M109", Some((_, value))) => Asked::HotEnd(value.scaled(1)),
        ("M140" | "M190", Some((_, value))) => Asked::Bed(value.scaled(1)),
        _ => Asked::Nothing,
    }
}

/// Returns the value of the first word with this letter.
fn word(words: &[(char, Decimal)], of: char) -> Option<Decimal> {
    words.iter().find(|(letter, _)| *letter == of).map(|(_, value)| *value)
}

/// Returns S as a length.
fn length(words: &[(char, Decimal)]) -> Option<i64> {
    word(words, 'S').map(|s| s.scaled(MM))
}

/// Whether a line moves the machine: such a line must not be passed over.
pub fn moves(line: &str) -> bool {
    let code = parts(line).map(|(code, _)| code).unwrap_or_default();
    matches!(code.as_str(), "G0" | "G1" | "G2" | "G3" | "G10" | "G11" | "G28")
}

/// Reads a whole file. Returns a corner for each line.
pub fn read(lines: &Lines) -> Result<Vec<Corner>, Unclear> {
    let mut reader = Reader::default();
    let corner = |(line, text): &(usize, String)| {
        let homes = reader.line(text).map_err(|what| Unclear { line: *line, what })?;
        Ok(Corner { line: *line, position: reader.position, homes })
    };
    lines.iter().map(corner).collect()
}

struct Reader {
    position: [i64; AXES],
    /// What rounding has left of the position.
    rests: [i64; AXES],
    /// The offset that G92 has set.
    offset: [i64; AXES],
    relative: bool,
    relative_e: bool,
    inches: bool,
    /// The filament that M221 makes of that in the words, thousandths.
    flow: i128,
    /// How far G10 retracts, and how much more G11 brings back, units.
    retraction: i64,
    extra: i64,
    retracted: bool,
}

impl Default for Reader {
    fn default() -> Self {
        Reader {
            position: [0; AXES],
            rests: [0; AXES],
            offset: [0; AXES],
            relative: false,
            relative_e: false,
            inches: false,
            flow: 1_000,
            retraction: 2 * MM as i64,
            extra: 0,
            retracted: false,
        }
    }
}

/// Codes that make the end of later lines unclear, if they have words: other steps, another origin, a bed that is
/// followed.
const UNCLEAR: [&str; 5] = ["M92", "M206", "M420", "M428", "M665"];

impl Reader {
    /// Executes a line. Returns whether it homes.
    fn line(&mut self, text: &str) -> Result<bool, String> {
        let Some((code, words)) = parts(text) else { return Ok(false) };
        match code.as_str() {
            "G0" | "G1" => self.travel(&words),
            "G20" => self.inches = true,
            "G21" => self.inches = false,
            "G90" => (self.relative, self.relative_e) = (false, false),
            "G91" => (self.relative, self.relative_e) = (true, true),
            "M82" => self.relative_e = false,
            "M83" => self.relative_e = true,
            "G92" => self.call(&words),
            "G28" => return Ok(self.home(&words)),
            "M221" => self.flow = word(&words, 'S').map_or(self.flow, |s| s.scaled(10).into()),
            "M207" => self.retraction = length(&words).unwrap_or(self.retraction),
            "M208" => self.extra = length(&words).unwrap_or(self.extra),
            "M999" => self.retracted = false,
            // With words G10 sets the temperature of a tool.
            "G10" if words.is_empty() => self.retract(true),
            "G10" => {}
            "G11" => self.retract(false),
            code if UNCLEAR.contains(&code) && !words.is_empty() => return Err(code.to_owned()),
            _ if code.starts_with('M') || code.starts_with('T') => {}
            "G4" | "G17" | "G94" => {}
            _ => return Err(code),
        }
        Ok(false)
    }

    /// Returns the words of axes, in units.
    fn axes(&self, words: &[(char, Decimal)]) -> [Option<Exact>; LETTERS.len()] {
        std::array::from_fn(|axis| {
            // The filament is in mm always.
            let unit = if self.inches && axis != E { INCH } else { MM };
            let value = match axis {
                E => word(words, 'E').or_else(|| word(words, 'A')),
                _ => word(words, LETTERS[axis]),
            };
            value.map(|value| value.exact(unit, false))
        })
    }

    fn travel(&mut self, words: &[(char, Decimal)]) {
        for (axis, value) in self.axes(words).into_iter().enumerate() {
            let Some(value) = value else { continue };
            let relative = if axis == E { self.relative_e } else { self.relative };
            let (from, value) = match relative {
                true => (self.position[axis], value.with(self.rests[axis])),
                false => (self.offset[axis], value),
            };
            let (end, before) = (from + value.units, self.position[axis]);
            (self.position[axis], self.rests[axis]) = (end, value.rest);
            if axis == E {
                let flows = divide(i128::from(end - before) * self.flow, 1_000) as i64;
                self.extrude(flows - (end - before));
            }
        }
    }

    /// Moves the extruder, and the place from which its words count.
    fn extrude(&mut self, by: i64) {
        self.position[E] += by;
        self.offset[E] += by;
    }

    fn retract(&mut self, back: bool) {
        if self.retracted != back {
            self.extrude(if back { -self.retraction } else { self.retraction + self.extra });
        }
        self.retracted = back;
    }

    /// G92: sets the coordinates of the position; without words all are 0.
    fn call(&mut self, words: &[(char, Decimal)]) {
        let mut values = self.axes(words);
        if words.is_empty() {
            values = [Some(Exact::default()); LETTERS.len()];
        }
        for (axis, value) in values.into_iter().enumerate() {
            let Some(value) = value else { continue };
            self.offset[axis] = self.position[axis] - value.units;
            self.rests[axis] = value.rest;
        }
    }

    /// G28: homes the named axes, or all three. The position is 0 where a machine homes to its lower end.
    fn home(&mut self, words: &[(char, Decimal)]) -> bool {
        let named = |axis: usize| words.iter().any(|(letter, _)| *letter == LETTERS[axis]);
        let all = !(0..HOMED).any(named);
        for axis in (0..HOMED).filter(|axis| all || named(*axis)) {
            (self.position[axis], self.offset[axis], self.rests[axis]) = (0, 0, 0);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::lines_of;

    fn end(text: &str) -> [i64; 4] {
        let corners = read(&lines_of(text)).unwrap();
        std::array::from_fn(|axis| corners.last().unwrap().position[axis])
    }

    #[test]
    fn modes_and_places() {
        assert_eq!(end("G1 X10.5 Y-2 E.25 F3000 ; a move"), [105_000, -20_000, 0, 2_500]);
        assert_eq!(end("G1 X1 E1\nG92 E0\nG1 E1"), [10_000, 0, 0, 20_000]);
        assert_eq!(end("M83\nG1 X1 E1\nG1 X1 E1"), [10_000, 0, 0, 20_000]);
        assert_eq!(end("G91\nG1 X1 E1\nG1 X1 E1\nG90\nG1 E5"), [20_000, 0, 0, 50_000]);
        assert_eq!(end("G20\nG1 X1"), [254_000, 0, 0, 0]);
        assert_eq!(end("G1 X1 Y1 Z1 E1\nG28 X0"), [0, 10_000, 10_000, 10_000]);
        assert_eq!(end("g1x5\nG92\ng1x5"), [100_000, 0, 0, 0]);
        assert_eq!(end("M117 G1 X5\nM104 S200"), [0; 4]);
        assert!(read(&lines_of("G29")).is_err());
        assert_eq!(end("G1 X5 E3\nG92 A0\nG1 X6 A2"), [60_000, 0, 0, 50_000]);
        assert_eq!(end("G20\nG1 E1"), [0, 0, 0, 10_000]);
        assert!(read(&lines_of("M92 X80")).is_err() && read(&lines_of("M92")).is_ok());
    }

    #[test]
    fn filament_adds_up() {
        assert_eq!(end(&format!("M83\n{}", "G1 E.000033\n".repeat(30)))[E], 10);
        assert_eq!(end("M221 S50\nG1 E2\nM221 S200\nG1 E3\nM221 S100\nG1 E4")[E], 40_000);
        assert_eq!(end("G1 E5\nG10\nG10\nG1 X1\nG11\nG11\nG1 E6")[E], 60_000);
        assert_eq!(end("M207 S1.5\nM208 S0.5\nG1 E5\nG10")[E], 35_000);
        assert_eq!(end("M207 S1.5\nM208 S0.5\nG1 E5\nG10\nG11\nG1 E6")[E], 65_000);
        assert_eq!(end("G1 E5\nG10 P0 S205\nM220 S50\nG1 E6")[E], 60_000);
    }

    #[test]
    fn what_is_a_print() {
        for line in ["G1 X1 E1", "M104 S200", "g92 e0", "M190 S60 ; bed"] {
            assert!(is_printing(line), "{line}");
        }
        for line in ["G1 X1", "M3 S100", "G76 E1", "; E1", "M1040"] {
            assert!(!is_printing(line), "{line}");
        }
        assert_eq!(asked("M109 S215"), Asked::HotEnd(215));
        assert_eq!(asked("M190 R60"), Asked::Bed(60));
        assert_eq!(asked("M105"), Asked::Nothing);
    }
}
