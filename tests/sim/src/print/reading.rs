//! The oracle of prints: computes the end of each line, independently of the firmware.
//!
//! It shares no code with the firmware. A position is in units of 0.1 um, and each word is rounded to that. E is the
//! fourth axis.

use crate::job::Lines;
use crate::oracle::{AXES, Decimal, Unclear};

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

/// Reads a whole file. Returns a corner for each line.
pub fn read(lines: &Lines) -> Result<Vec<Corner>, Unclear> {
    let mut reader = Reader::default();
    let corner = |(line, text): &(usize, String)| {
        let homes = reader.line(text).map_err(|what| Unclear { line: *line, what })?;
        Ok(Corner { line: *line, position: reader.position, homes })
    };
    lines.iter().map(corner).collect()
}

#[derive(Default)]
struct Reader {
    position: [i64; AXES],
    /// The offset that G92 has set.
    offset: [i64; AXES],
    relative: bool,
    relative_e: bool,
    inches: bool,
}

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
            "M220" | "M221" if words.first().is_some_and(|(_, v)| v.scaled(1) != 100) => {
                return Err(code);
            }
            _ if code.starts_with('M') || code.starts_with('T') => {}
            "G4" | "G17" | "G94" => {}
            _ => return Err(code),
        }
        Ok(false)
    }

    /// Returns the words of axes, in units.
    fn axes(&self, words: &[(char, Decimal)]) -> [Option<i64>; LETTERS.len()] {
        let unit = if self.inches { INCH } else { MM };
        LETTERS.map(|axis| {
            let word = words.iter().find(|(letter, _)| *letter == axis);
            word.map(|(_, value)| value.scaled(unit))
        })
    }

    fn travel(&mut self, words: &[(char, Decimal)]) {
        for (axis, value) in self.axes(words).into_iter().enumerate() {
            let Some(value) = value else { continue };
            let relative = if axis == E { self.relative_e } else { self.relative };
            let from = if relative { self.position[axis] } else { self.offset[axis] };
            self.position[axis] = from + value;
        }
    }

    /// G92: sets the coordinates of the position; without words all are 0.
    fn call(&mut self, words: &[(char, Decimal)]) {
        let mut values = self.axes(words);
        if values == [None; LETTERS.len()] {
            values = [Some(0); LETTERS.len()];
        }
        for (axis, value) in values.into_iter().enumerate() {
            let Some(value) = value else { continue };
            self.offset[axis] = self.position[axis] - value;
        }
    }

    /// G28: homes the named axes, or all three. The position is 0 where a machine homes to its lower end.
    fn home(&mut self, words: &[(char, Decimal)]) -> bool {
        let named = |axis: usize| words.iter().any(|(letter, _)| *letter == LETTERS[axis]);
        let all = !(0..HOMED).any(named);
        for axis in (0..HOMED).filter(|axis| all || named(*axis)) {
            (self.position[axis], self.offset[axis]) = (0, 0);
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
