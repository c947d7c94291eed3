//! How Kerf is asked in each dialect, as data: requests, and how their answers are read.

mod grbl;
mod reprap;
pub(crate) mod tinyg;

pub use grbl::GRBL;
pub use reprap::REPRAP;
pub use tinyg::TINYG;

use crate::random::Random;

/// Number of axes that the job moves: X, Y, Z.
pub const AXES: usize = 3;

/// A number for each axis.
pub type Each = [f64; AXES];

/// A request, and how its answer is read.
pub struct Question<T> {
    /// The request.
    pub request: &'static str,
    /// Finds the value in the lines of the answer.
    pub find: fn(&[String]) -> Option<T>,
}

/// A value that Kerf stores.
pub struct Stored {
    /// The request that reads it, and others perhaps.
    pub read: &'static str,
    /// Finds it in the answer.
    pub find: fn(&[String]) -> Option<String>,
    /// Returns the requests that store it.
    pub store: fn(&str) -> Vec<String>,
    /// Returns another value for the test.
    pub other: fn(&mut Random) -> String,
}

/// A dialect.
pub struct Dialect {
    /// Its name.
    pub name: &'static str,
    /// Whether a line is the greeting behind a reset.
    pub is_greeting: fn(&str) -> bool,
    /// `None` if a line answers no request; an error if it refuses the request.
    pub answer: fn(&str) -> Option<Result<(), String>>,
    /// The version of Kerf.
    pub version: Question<String>,
    /// The line that makes a port whose dialect is undecided speak it; `None` if no line is needed.
    pub opening: Option<&'static str>,
    /// Values that the test stores, and restores.
    pub stored: &'static [Stored],
    /// The requests that switch check mode on and off; `None` if the dialect has none.
    pub check_mode: Option<[&'static str; 2]>,
    /// A dwell of this many milliseconds.
    pub dwell: fn(u32) -> String,
    /// Whether the machine is at rest.
    pub rest: Question<bool>,
    /// What is known of the drivers in the job.
    pub drivers: &'static str,
    /// Values that the job needs otherwise: they are restored behind it.
    pub for_job: &'static [ForJob],
    /// The lines before the job's.
    pub before_job: &'static [&'static str],
    /// The requests for steps/mm.
    pub scale_requests: &'static [&'static str],
    /// Finds the steps/mm of each axis in all answers to them together.
    pub scale: fn(&[String]) -> Option<Each>,
    /// The request for the position.
    pub steps_request: &'static str,
    /// Finds the position in its answer, in steps. The second argument is the steps/mm.
    pub steps: fn(&[String], &Each) -> Option<Each>,
    /// The number of segments that came too late.
    pub late: Option<Question<String>>,
}

impl std::fmt::Debug for Dialect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// A value that the job needs otherwise.
pub struct ForJob {
    /// The value.
    pub value: Stored,
    /// What the job needs.
    pub needed: &'static str,
}

/// The dialect with this feature of an image, `dialect-tinyg` and so on.
pub fn of_feature(feature: &str) -> Option<&'static Dialect> {
    [&TINYG, &GRBL, &REPRAP].into_iter().find(|one| feature == format!("dialect-{}", one.name))
}

/// Returns the text between two others, in the first line that has both.
fn between(lines: &[String], before: &str, after: &[char]) -> Option<String> {
    lines.iter().find_map(|line| {
        let (_, rest) = line.split_once(before)?;
        let end = rest.find(after).unwrap_or(rest.len());
        Some(rest[..end].trim().to_owned())
    })
}

fn number(lines: &[String], before: &str, after: &[char]) -> Option<f64> {
    between(lines, before, after)?.parse().ok()
}
