//! Random programs of lines that both interpreters accept and read alike. Known differences (`tests/nist/README.md`,
//! `tests/support/differences.rs`) are left out.

mod series;

use std::fmt::Write;

use super::dice::Dice;

/// Least number of lines in a program.
const LINES: usize = 200;

/// A program, and the state that is needed to continue it.
pub struct Program {
    dice: Dice,
    text: String,
    lines: usize,
    inch: bool,
    incremental: bool,
    /// Index of the plane: G17, G18, G19.
    plane: usize,
    /// Whether axis words alone are a straight move.
    straight: bool,
}

/// The axes of the planes, with the depth axis last.
const PLANES: [[char; 3]; 3] = [['X', 'Y', 'Z'], ['Z', 'X', 'Y'], ['Y', 'Z', 'X']];

impl Program {
    /// Returns the program of a seed, which is always the same.
    pub fn of(seed: u64) -> String {
        let mut program = Self {
            dice: Dice::new(seed),
            text: String::new(),
            lines: 0,
            inch: false,
            incremental: false,
            plane: 0,
            straight: false,
        };
        program.say("G21 G90 G17 G94 G98 F100");
        while program.lines < LINES {
            program.group();
        }
        program.say("M2");
        program.text
    }

    fn group(&mut self) {
        match self.dice.below(16) {
            0..5 => self.straight(),
            5..7 => self.arc(),
            7 => self.modes(),
            8..10 => self.offsets(),
            10 => self.tools(),
            11 => self.machine(),
            12 => self.homes(),
            13 => self.probe(),
            _ => self.series(),
        }
    }

    fn straight(&mut self) {
        let code = match self.dice.below(8) {
            0..3 => "G0",
            3..6 => "G1",
            6 if !self.incremental => "G53 G1",
            _ if self.straight => "",
            _ => "G0",
        };
        let words = self.some("XYZABC");
        let more = self.dice.of(&["", "", "", "", "M3 S100", "M5", "M7", "M8", "M9", "M4", "M1"]);
        // The order of words does not matter.
        let line = match self.dice.below(3) {
            0 => format!("{words} {more} {code}"),
            1 => format!("{more} {code} {words}"),
            _ => format!("{code} {words} {more}").to_lowercase(),
        };
        self.say(&line);
        self.straight = true;
    }

    /// Adds an arc in G91, where a half circle has the same words wherever it begins.
    fn arc(&mut self) {
        let [first, second, depth] = PLANES[self.plane];
        let code = self.dice.of(&["G2", "G3"]);
        let (i, j) = (self.units(1, 20), self.units(-20, 20));
        let offsets = [(first, i), (second, j)].map(|(axis, at)| offset(axis, &self.number(at)));
        let more = match self.dice.below(4) {
            0 => format!("{depth}{}", self.value(-5, 5)),
            1 => format!("A{}", self.value(-5, 5)),
            _ => String::new(),
        };
        let ends = format!("{first}{} {second}{}", self.number(2 * i), self.number(2 * j));
        let mut line = match self.dice.below(3) {
            0 => format!("{code} {} {more}", offsets.concat()),
            1 => format!("G91 {code} {ends} {} {more}", offsets.concat()),
            _ => {
                let radius = self.value(50, 200);
                let sign = self.dice.of(&["", "-"]);
                format!("G91 {code} {ends} R{sign}{radius} {more}")
            }
        };
        // A helix, or a turn of A, with a zero distance is a full circle.
        if !line.starts_with("G91") && !self.incremental {
            line = format!("{code} {}", offsets.concat());
        }
        self.incremental |= line.starts_with("G91");
        self.say(&line);
        self.straight = false;
    }

    fn modes(&mut self) {
        match self.dice.below(6) {
            0 => self.distance(false),
            1 => self.distance(true),
            2 => {
                self.plane = self.dice.below(PLANES.len());
                self.say(&format!("G{}", 17 + self.plane));
            }
            3 => {
                // The other interpreter is wrong with a tool length in force when the unit changes.
                self.say("G49");
                self.inch = !self.inch;
                self.say(if self.inch { "G20" } else { "G21" });
            }
            4 => {
                let words = self.some("XYZ");
                self.say(&format!("G93 G1 {words} F2"));
                self.say("G94 F120");
                self.straight = true;
            }
            _ => {
                let system = self.dice.of(&["54", "55", "58", "59", "59.1", "59.3"]);
                self.say(&format!("G{system}"));
            }
        }
    }

    fn distance(&mut self, incremental: bool) {
        self.incremental = incremental;
        self.say(if incremental { "G91" } else { "G90" });
    }

    fn offsets(&mut self) {
        // Tool lengths along rotary axes are left out, because the other interpreter forgets them at G28.
        let axes = self.dice.of(&["XYZ", "XYZAC"]);
        let words = self.some(axes);
        let line = match self.dice.below(10) {
            0 | 1 => format!("G10 L2 P{} {words}", self.dice.below(10)),
            2 | 3 => format!("G10 L20 P{} {words}", self.dice.below(10)),
            4 | 5 => format!("G92 {words}"),
            6 => "G92.1".to_owned(),
            7 => "G92.2".to_owned(),
            8 => "G92.3".to_owned(),
            _ if axes == "XYZ" => format!("G43.1 {words}"),
            _ => "G49".to_owned(),
        };
        self.say(&line);
    }

    fn tools(&mut self) {
        let tool = 1 + self.dice.below(9);
        let line = match self.dice.below(6) {
            0 | 2 => {
                // A tool change makes the other interpreter read the position anew, and it forgets a tool length that
                // no move has used.
                self.everywhere();
                format!("T{tool} M6{}", self.dice.of(&["", "\nG43"]))
            }
            1 => format!("G43 H{tool}"),
            3 => format!("G10 L1 P{tool} {}", self.some("XZ")),
            4 => format!("G10 L10 P{tool} {}", self.some("XZ")),
            _ => "G49".to_owned(),
        };
        self.say(&line);
    }

    /// Adds a move of all linear axes.
    fn everywhere(&mut self) {
        let to = ["X", "Y", "Z"].map(|axis| format!("{axis}{}", self.value(-50, 50)));
        self.say(&format!("G90 G0 {}", to.join(" ")));
        self.incremental = false;
        self.straight = true;
    }

    fn machine(&mut self) {
        let line = self.dice.of(&[
            "M3 S500",
            "M4 S200",
            "M5",
            "S300",
            "M7",
            "M8",
            "M9",
            "M8\nM7",
            "G4 P.5",
            "M0",
            "M1",
            "M60",
            "(nothing)",
            "N7",
            "; nothing",
            "M3 M8 S9 G4 P1",
            "M48",
            "G40",
        ]);
        self.say(line);
    }

    fn homes(&mut self) {
        let words = self.some("XYZA");
        let line = match self.dice.below(6) {
            0 => format!("G28 {words}"),
            1 => format!("G30 {words}"),
            2 => "G28".to_owned(),
            3 => "G30".to_owned(),
            4 => "G28.1".to_owned(),
            _ => "G30.1".to_owned(),
        };
        self.say(&line);
    }

    fn probe(&mut self) {
        self.distance(true);
        let axis = self.dice.of(&["X", "Y", "Z"]);
        let way = self.value(1, 9);
        self.say(&format!("G38.2 {axis}{way}"));
        // The other interpreter goes on from about 0.254 mm before that position.
        self.everywhere();
    }

    /// Returns the words of some axes, at least one.
    fn some(&mut self, axes: &str) -> String {
        let chosen = 1 + self.dice.below((1 << axes.len()) - 1);
        let mut words = String::new();
        for (bit, axis) in axes.chars().enumerate() {
            if chosen & 1 << bit != 0 {
                let value = self.value(-50, 50);
                write!(words, "{axis}{value} ").expect("a string takes everything");
            }
        }
        words.trim_end().to_owned()
    }

    fn value(&mut self, low: i32, high: i32) -> String {
        let value = self.units(low, high);
        self.number(value)
    }

    /// Returns hundredths of a millimetre, never a value too small to be a move.
    fn units(&mut self, low: i32, high: i32) -> i32 {
        (low * 2 + self.dice.below((high - low) as usize * 2) as i32) * 50 + 25
    }

    /// Formats hundredths of a millimetre in the unit in force. An inch is taken as 25 mm, because only a similar
    /// size with few decimals matters.
    fn number(&self, hundredths: i32) -> String {
        let (sign, size) = (if hundredths < 0 { "-" } else { "" }, hundredths.unsigned_abs());
        match self.inch {
            false => format!("{sign}{}.{:02}", size / 100, size % 100),
            true => format!("{sign}{}.{:03}", size / 2_500, size % 2_500 * 2 / 5),
        }
    }

    fn say(&mut self, line: &str) {
        self.text += line.trim();
        self.text.push('\n');
        self.lines += 1;
    }
}

/// Returns I, J or K, which belong to X, Y and Z.
fn offset(axis: char, number: &str) -> String {
    let letter = char::from(b'I' + (axis as u8 - b'X'));
    format!(" {letter}{number}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_makes_one_program() {
        assert_eq!(Program::of(1), Program::of(1));
        assert_ne!(Program::of(1), Program::of(2));
        assert!(Program::of(3).ends_with("\nM2\n"));
    }
}
