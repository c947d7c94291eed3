//! Checks that every step of a print is on the path from one line's end to the next.
//!
//! The steps are followed in the order in which the pins made them. After each step the motors must be on a line:
//! each motor within some steps of its ideal place on the stretch between two ends of lines. Lines must follow in
//! their order.

use std::fmt::{self, Display, Formatter};

use kerf::boards::MOTORS;
use serde::Serialize;

use crate::recorder::Step;

/// How far a motor may be off a line, steps. The ends of lines are rounded to steps here, by half a step at most.
/// Motors that do not lead are up to two steps behind or ahead where short lines join.
#[cfg(test)]
const EXACT: f64 = 2.5;
/// How far a motor may be off a line where corners are rounded, steps. This is 0.2 mm of X and Y of the printer, and
/// 0.17 mm of its extruder, whose acceleration is the highest.
pub const ROUNDED: f64 = 16.0;
/// Number of lines within which the motors' position is searched: a line shorter than a step may be left out.
const AHEAD: usize = 12;

/// Positions of the motors, in steps.
pub type Place = [i64; MOTORS];

/// The result of following the steps.
#[derive(Clone, Serialize, Debug)]
pub struct Followed {
    /// Number of steps that were checked.
    pub steps: usize,
    /// Number of stretches that they had to follow.
    pub stretches: usize,
    /// The largest distance of a motor from its line, steps.
    pub most: f64,
    /// The first line of the file that the steps have left; `None` if they left no line.
    pub left: Option<usize>,
    /// For each motor, its steps in both directions, and the number of steps that the file asks for.
    pub totals: [(u64, u64); MOTORS],
}

impl Followed {
    /// Returns what is wrong; `None` if nothing is.
    pub fn problem(&self) -> Option<String> {
        if let Some(line) = self.left {
            return Some(format!("steps leave the way of line {line}"));
        }
        // Where a path reverses, within the tolerance of the path, the steps there and back are left out.
        let is_right = |(made, asked): &(u64, u64)| {
            made <= asked && (asked - made).is_multiple_of(2) && (asked - made) * 20 <= *asked
        };
        let wrong = self.totals.iter().position(|totals| !is_right(totals))?;
        let (made, asked) = self.totals[wrong];
        Some(format!("motor {} has made {made} steps instead of {asked}", wrong + 1))
    }
}

impl Display for Followed {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Followed { steps, stretches, most, .. } = self;
        write!(f, "{steps} on {stretches} stretches of the file, {most:.2} steps beside it at most")
    }
}

/// Follows steps along the ends of lines, from `from` on. `up` says for each motor whether a step that counts upwards
/// at the pin also counts upwards in the job.
/// A motor may be off its line by `allowed` steps.
pub fn follow(
    log: &[Step],
    from: Place,
    ends: &[(usize, Place)],
    up: [bool; MOTORS],
    allowed: f64,
) -> Followed {
    let mut stretches = vec![(0, from, from)];
    for (line, end) in ends {
        let (_, _, last) = stretches[stretches.len() - 1];
        if *end != last {
            stretches.push((*line, last, *end));
        }
    }
    let made = |m: usize| log.iter().filter(|step| usize::from(step.motor) == m).count() as u64;
    let asked = |m: usize| stretches.iter().map(|(_, a, b)| a[m].abs_diff(b[m])).sum();
    let mut followed = Followed {
        steps: log.len(),
        stretches: stretches.len() - 1,
        most: 0.0,
        left: None,
        totals: std::array::from_fn(|m| (made(m), asked(m))),
    };
    let (mut at, mut now) = (from, 0);
    for step in log {
        let motor = usize::from(step.motor);
        at[motor] += if step.positive == up[motor] { 1 } else { -1 };
        // Takes the nearest stretch; among equally near ones, the first.
        let ahead = stretches.iter().enumerate().skip(now).take(AHEAD);
        let offs = ahead.map(|(n, (_, a, b))| (n, off(at, *a, *b)));
        let Some((n, off)) = offs.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        if off > allowed {
            followed.left = Some(stretches[now].0);
            return followed;
        }
        now = n;
        followed.most = followed.most.max(off);
    }
    if now + AHEAD < stretches.len() {
        followed.left = Some(stretches[now].0);
    }
    followed
}

/// Returns the distance of the worst motor from the stretch between two places, in steps.
fn off(at: Place, from: Place, to: Place) -> f64 {
    let way = |motor: usize| (to[motor] - from[motor]) as f64;
    let leads = (0..MOTORS).max_by(|a, b| way(*a).abs().total_cmp(&way(*b).abs())).unwrap_or(0);
    let share = match way(leads) {
        0.0 => 0.0,
        way => ((at[leads] - from[leads]) as f64 / way).clamp(0.0, 1.0),
    };
    let off = |motor: usize| (at[motor] as f64 - from[motor] as f64 - share * way(motor)).abs();
    (0..MOTORS).map(off).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parses steps: a letter is a motor, upper case upwards, lower case downwards.
    fn steps(text: &str) -> Vec<Step> {
        let step = |c: char| Step {
            cycle: 0,
            motor: u8::from(!matches!(c, 'x' | 'X')),
            positive: c.is_uppercase(),
        };
        text.chars().map(step).collect()
    }

    fn place(x: i64, y: i64) -> Place {
        let mut place = Place::default();
        (place[0], place[1]) = (x, y);
        place
    }

    #[test]
    fn steps_on_the_way_and_off_it() {
        let ends = [(1, place(4, 2)), (2, place(0, 2)), (3, place(0, 0))];
        let way = |text: &str| follow(&steps(text), Place::default(), &ends, [true; MOTORS], EXACT);
        assert_eq!(way("XYXXYXxxxxyy").left, None);
        assert_eq!(way("XXXXXXXYY").left, Some(1));
        assert!(way("XXXY").most > 1.0);
        let right = follow(&steps("xyxx"), Place::default(), &ends, [false; MOTORS], EXACT);
        assert_eq!(right.left, None);
        assert_eq!(way("XYXXYXxxxxyy").problem(), None);
        // A line that was never carried out.
        assert!(way("XYXXYXxxxx").problem().unwrap().contains("motor 2"));
    }
}
