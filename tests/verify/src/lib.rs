//! Finds out whether a board is sound, with nothing but its serial line: the chip first, by an image that tests it
//! (`tests/chip/verify.rs`), then Kerf on it. The result is a file that can be attached to an issue.
//!
//! | module | contents |
//! |---|---|
//! | [`board`] | what the checks need of a board at the other end of a line |
//! | [`line`] | lines of text, each with a limit of time |
//! | [`chip`] | the checks of the chip |
//! | [`firmware`] | the checks of Kerf on the board |
//! | [`dialect`] | how Kerf is asked in each dialect, as data |
//! | [`job`] | the job that Kerf runs |
//! | [`jumper`] | the checks of Kerf that need jumpers |
//! | [`report`] | the findings, and the file |
//!
//! The library does no input or output of its own, and has no clock: [`Board`] does. The program (`main.rs`) is a board
//! at a serial port, the tests have simulated boards in simulated time, the page has its Web Serial port. Each check
//! ends: each wait has a limit. A check that fails says what was measured; the next one begins with a reset. When a
//! board does not come back after a reset, the other checks are not tried, and the report says so.

pub mod board;
pub mod chip;
pub mod dialect;
pub mod firmware;
pub mod job;
mod jumper;
pub mod line;
pub mod random;
pub mod report;

pub use board::{Board, Image};
pub use dialect::Dialect;
pub use report::{Finding, Outcome, Report};

use line::Line;

/// What is known of the board before it is asked.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The name of the board, as in `boards/`.
    pub board: String,
    /// The version of Kerf that it must have.
    pub version: String,
    /// How its image is spoken to.
    pub dialect: &'static Dialect,
    /// The nominal clock of a chip that the self-test image tests, Hz; `None` if there is no such image for it, or
    /// nobody can flash it.
    pub clock_hz: Option<u32>,
    /// The first address behind the image's static data, if it is known.
    pub static_end: Option<u16>,
    /// The wires between pins of the board, if there are any.
    pub jumpers: Option<Jumpers>,
    /// Seconds over which clocks are compared.
    pub seconds: u32,
    /// Chooses the random bytes.
    pub seed: u64,
}

/// The wires of docs/verify.md: from the direction pin of X to the input of its lower switch, from its step pin to D47,
/// from the pin of the spindle's pulses to A5.
#[derive(Clone, Copy, Debug)]
pub struct Jumpers {
    /// Whether the image counts pulses at D47.
    pub counts: bool,
    /// The channel of timer 4 that drives the pin of the spindle's pulses: 0 for A, 1 for B.
    pub pwm: u8,
}

/// Runs all checks. Leaves Kerf on the board, with the settings that it had.
pub async fn verify(board: &mut impl Board, plan: &Plan) -> Report {
    let mut report = Report::new(plan);
    let mut line = Line::new(board);
    let painted = match plan.clock_hz {
        Some(_) => chip::check(&mut line, plan, &mut report).await,
        None => chip::leave_out(&mut report),
    };
    let works = firmware::check(&mut line, plan, &mut report).await;
    jumper::check(&mut line, plan, &works, &mut report).await;
    chip::free_stack(&mut line, plan, &painted.and(works), &mut report).await;
    // The job has left its modes behind. A board that is silent has been told of already.
    let _ = line.reset().await;
    report
}
