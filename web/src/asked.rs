//! Finds the lines of a job that ask for a higher rate than the limits allow.
//!
//! [`kerf::canon`] reads the lines. On a straight feed along several axes the first axis that reaches its limit limits
//! the rate along the path. On an arc the lowest limit of the two axes of its plane applies. A move shorter than
//! [`SHORTEST_S`] at its rate is slowed down as well, whatever the limits are. Refused lines are left out. The page
//! calls this for a job before it runs the job. Cost: 2 us a line.

use std::fmt::Write;

use kerf::canon::{Canon, Reader};
use kerf::gcode::command::Feed;
use kerf::gcode::setup::Usual;
use kerf::units::{AXES, AXIS_LETTERS, Length, PerAxis};

/// The shortest duration of a block, in seconds (`BLOCK_S_MIN` of the planner).
const SHORTEST_S: f64 = 0.75e-3;
/// A rate is reported only if it exceeds the limit by more than this factor.
const SLACK: f64 = 1.005;
/// The number of findings: one for each axis that limits, and one for short moves.
const KINDS: usize = AXES + 1;
const SHORT: usize = AXES;

/// The lines that one limit slows down.
#[derive(Clone, Copy, Default)]
struct Finding {
    lines: usize,
    first: usize,
    last: usize,
    /// The highest rate that these lines ask for, and the lowest rate that is allowed, mm/min.
    asked: f64,
    allowed: f64,
}

impl Finding {
    fn add(&mut self, line: usize, asked: f64, allowed: f64) {
        if self.lines == 0 {
            *self = Self { lines: 0, first: line, last: 0, asked, allowed };
        }
        self.lines += usize::from(self.last != line);
        self.last = line;
        self.asked = self.asked.max(asked);
        self.allowed = self.allowed.min(allowed);
    }
}

/// The position and the feed rate after the lines so far.
struct Walk<'a> {
    /// Feed limits of X to C, mm/min or degrees a minute; 0 for none.
    limits: &'a [f64],
    place: PerAxis<Length>,
    rate: Option<f64>,
    found: [Finding; KINDS],
}

impl Walk<'_> {
    fn take(&mut self, line: usize, command: &Canon) {
        match command {
            Canon::Rate(Feed::PerMinute(rate)) => self.rate = Some(f64::from(*rate)),
            Canon::Rate(_) => self.rate = None,
            Canon::Feed(target) => {
                self.feed(line, target);
                self.place = *target;
            }
            Canon::Arc(target, arc, _) => {
                let plane = (0..3).filter(|axis| *axis != usize::from(arc.linear));
                self.arc(line, plane);
                self.place = *target;
            }
            Canon::Traverse(target) | Canon::Probe(target, _) | Canon::SetPosition(target) => {
                self.place = *target;
            }
            _ => {}
        }
    }

    fn feed(&mut self, line: usize, target: &PerAxis<Length>) {
        let Some(rate) = self.rate else { return };
        let unit = f64::from(Length::PER_MM);
        let way = |axis: usize| (f64::from(target[axis].0) - f64::from(self.place[axis].0)) / unit;
        let ways: Vec<f64> = (0..AXES).map(way).collect();
        let length = ways[..3].iter().map(|way| way * way).sum::<f64>().sqrt();
        if length == 0.0 {
            return;
        }
        let allowed = |axis: usize| self.limits[axis] * length / ways[axis].abs();
        let moves = (0..3).filter(|axis| ways[*axis] != 0.0 && self.limits[*axis] > 0.0);
        let slowest = moves.min_by(|a, b| allowed(*a).total_cmp(&allowed(*b)));
        if let Some(axis) = slowest
            && rate > allowed(axis) * SLACK
        {
            let allowed = allowed(axis);
            self.found[axis].add(line, rate, allowed);
        }
        let shortest = length / SHORTEST_S * 60.0;
        if rate > shortest * SLACK {
            self.found[SHORT].add(line, rate, shortest);
        }
    }

    fn arc(&mut self, line: usize, plane: impl Iterator<Item = usize>) {
        let Some(rate) = self.rate else { return };
        let limited = plane.filter(|axis| self.limits[*axis] > 0.0);
        let slowest = limited.min_by(|a, b| self.limits[*a].total_cmp(&self.limits[*b]));
        if let Some(axis) = slowest
            && rate > self.limits[axis] * SLACK
        {
            self.found[axis].add(line, rate, self.limits[axis]);
        }
    }
}

/// Returns the limits that lines of a job exceed, as JSON:
/// `[{"limit":"x","lines":2,"first":4,"last":9,"asked":900,"allowed":800}]`, with rates in mm/min. `limits` are the
/// highest feed rates of X to C and then their highest velocities, per minute; 0 for none.
pub fn findings(text: &str, limits: &[f64; 2 * AXES]) -> String {
    let feeds: Vec<f64> = (0..AXES)
        .map(|axis| {
            let of = [limits[axis], limits[axis + AXES]];
            of.into_iter().filter(|limit| *limit > 0.0).reduce(f64::min).unwrap_or(0.0)
        })
        .collect();
    let mut walk =
        Walk { limits: &feeds, place: [Length::ZERO; AXES], rate: None, found: Default::default() };
    let mut reader = Reader::new(Usual);
    for (number, line) in (1..).zip(text.lines()) {
        if reader.read(line.as_bytes()).is_ok() {
            (&mut reader).for_each(|command| walk.take(number, &command));
        }
    }
    let names =
        AXIS_LETTERS.iter().map(|letter| char::from(*letter).to_ascii_lowercase().to_string());
    let names = names.chain(["short".to_string()]);
    let mut json = String::from("[");
    for (name, found) in names.zip(walk.found).filter(|(_, found)| found.lines > 0) {
        let comma = if json.len() > 1 { "," } else { "" };
        let Finding { lines, first, last, asked, allowed } = found;
        let _ = write!(
            json,
            "{comma}{{\"limit\":\"{name}\",\"lines\":{lines},\"first\":{first},\"last\":{last},\"asked\":{asked:.0},\"allowed\":{allowed:.0}}}"
        );
    }
    json + "]"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_limit_names_its_lines() {
        let mut limits = [0.0; 12];
        limits[..3].copy_from_slice(&[800.0, 1_600.0, 300.0]);
        limits[6] = 400.0;
        let job = "G1 X10 F500\nG1 X20 Y100\nG1 Y0\nG1 Z5\nwhat\nG2 X20 Y10 J5\nG0 X0\n";
        assert_eq!(
            findings(job, &limits),
            "[{\"limit\":\"x\",\"lines\":2,\"first\":1,\"last\":6,\"asked\":500,\"allowed\":400},\
             {\"limit\":\"z\",\"lines\":1,\"first\":4,\"last\":4,\"asked\":500,\"allowed\":300}]"
        );
    }

    #[test]
    fn short_moves_are_told_and_slow_ones_are_not() {
        let job = "G1 X.01 F6000\nG1 X.02 F100\nG93 G1 X.03 F1e4\n";
        let found = findings(job, &[0.0; 12]);
        assert!(found.starts_with("[{\"limit\":\"short\",\"lines\":1,\"first\":1,"), "{found}");
        assert_eq!(findings("", &[0.0; 12]), "[]");
    }
}
