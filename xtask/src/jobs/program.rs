//! Writes a G-code program.

use std::f64::consts::PI;
use std::fmt::Write;

/// A point in the XY plane, in millimetres.
pub type Point = (f64, f64);

/// Returns the point at an angle, in degrees, on a circle.
pub fn on_circle(centre: Point, radius: f64, degrees: f64) -> Point {
    let angle = degrees * PI / 180.0;
    (centre.0 + radius * angle.cos(), centre.1 + radius * angle.sin())
}

/// The lines of a G-code program, in the order of cutting.
#[derive(Default)]
pub struct Program {
    text: String,
}

impl Program {
    /// Begins a program with a title and the modes that all examples use.
    pub fn new(title: &str) -> Program {
        let mut program = Program::default();
        program.note(title);
        program.line("G21 G17 G90 G94");
        program
    }

    /// Adds a line as it stands.
    pub fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// Adds a comment.
    pub fn note(&mut self, note: &str) {
        self.line(&format!("({note})"));
    }

    /// Adds a rapid move in the plane.
    pub fn rapid(&mut self, to: Point) {
        self.line(&format!("G0 X{} Y{}", number(to.0), number(to.1)));
    }

    /// Adds a rapid move up or down.
    pub fn rapid_z(&mut self, z: f64) {
        self.line(&format!("G0 Z{}", number(z)));
    }

    /// Adds a straight cut in the plane.
    pub fn cut(&mut self, to: Point) {
        self.line(&format!("G1 X{} Y{}", number(to.0), number(to.1)));
    }

    /// Adds a straight cut in the plane with a feed.
    pub fn cut_at(&mut self, to: Point, feed: f64) {
        self.line(&format!("G1 X{} Y{} F{}", number(to.0), number(to.1), number(feed)));
    }

    /// Adds a cut downwards.
    pub fn plunge(&mut self, z: f64, feed: f64) {
        self.line(&format!("G1 Z{} F{}", number(z), number(feed)));
    }

    /// Adds an arc from a point around a centre; counter-clockwise is G3.
    pub fn arc(&mut self, from: Point, to: Point, centre: Point, counter_clockwise: bool) {
        let word = if counter_clockwise { "G3" } else { "G2" };
        let (i, j) = (number(centre.0 - from.0), number(centre.1 - from.1));
        self.line(&format!("{word} X{} Y{} I{i} J{j}", number(to.0), number(to.1)));
    }

    /// Adds a dwell.
    pub fn wait(&mut self, seconds: f64) {
        self.line(&format!("G4 P{}", number(seconds)));
    }

    /// Returns the whole text.
    pub fn text(self) -> String {
        self.text
    }

    /// Returns the whole text with a line number on every line except comments.
    pub fn numbered(self) -> String {
        let mut text = String::new();
        let mut n = 0;
        for line in self.text.lines() {
            if line.starts_with('(') {
                let _ = writeln!(text, "{line}");
            } else {
                n += 10;
                let _ = writeln!(text, "N{n} {line}");
            }
        }
        text
    }
}

/// Formats a number with at most four decimals, without trailing zeros and without a negative zero.
fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let texts = [1.0, -0.00001, 0.12345, -2.5, 300.0, 0.1].map(number);
        assert_eq!(texts, ["1", "0", "0.1235", "-2.5", "300", "0.1"]);
    }

    #[test]
    fn comments_have_no_line_number() {
        let mut program = Program::new("a job");
        program.rapid((1.0, 2.0));
        assert_eq!(program.numbered(), "(a job)\nN10 G21 G17 G90 G94\nN20 G0 X1 Y2\n");
    }
}
