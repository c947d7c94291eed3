//! The findings, and the file that has them: Markdown, so that it can be read as it is and pasted into an issue.

use std::fmt::{self, Display, Formatter};

use crate::Plan;
use crate::board::Board;

/// What came of a check.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// What was measured is what is wanted.
    Sound,
    /// It is not, or could not be measured.
    Failed,
    /// The check was not made.
    Untried,
}

impl Outcome {
    /// The word in the file.
    pub fn word(self) -> &'static str {
        match self {
            Outcome::Sound => "ok",
            Outcome::Failed => "FAILED",
            Outcome::Untried => "not tried",
        }
    }
}

/// A check, and what came of it.
#[derive(Clone, Debug)]
pub struct Finding {
    /// What was checked.
    pub name: &'static str,
    /// What came of it.
    pub outcome: Outcome,
    /// What was measured, or why nothing was.
    pub measured: String,
    /// What is wanted.
    pub wanted: &'static str,
}

/// What a check measured, and whether that is what is wanted.
pub struct Judged {
    /// Whether it is.
    pub is_sound: bool,
    /// What was measured.
    pub measured: String,
}

/// What a check returns. An error says why nothing could be measured.
pub type Checked = Result<Judged, String>;

/// Returns what was measured, with the verdict.
pub fn judged(is_sound: bool, measured: String) -> Checked {
    Ok(Judged { is_sound, measured })
}

/// Adds to a result what was not restored.
pub fn and_restored(result: Checked, restored: Result<(), String>) -> Checked {
    match (result, restored) {
        (result, Ok(())) => result,
        (Ok(Judged { measured, .. }), Err(why)) => Err(format!("{why}; {measured}")),
        (Err(first), Err(why)) => Err(format!("{why}; {first}")),
    }
}

/// All findings about a board.
pub struct Report {
    plan: Plan,
    findings: Vec<Finding>,
}

impl Report {
    /// A report without findings.
    pub fn new(plan: &Plan) -> Self {
        Report { plan: plan.clone(), findings: Vec::new() }
    }

    /// The findings, in the order of the checks.
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// Whether at least one check was made, and none failed.
    pub fn is_sound(&self) -> bool {
        let count = |outcome| self.findings.iter().filter(|one| one.outcome == outcome).count();
        count(Outcome::Failed) == 0 && count(Outcome::Sound) > 0
    }

    /// Adds what came of a check.
    pub fn add(&mut self, name: &'static str, wanted: &'static str, checked: Checked) {
        let (outcome, measured) = match checked {
            Ok(Judged { is_sound: true, measured }) => (Outcome::Sound, measured),
            Ok(Judged { measured, .. }) => (Outcome::Failed, measured),
            Err(why) => (Outcome::Failed, why),
        };
        let measured = plain(&measured);
        self.findings.push(Finding { name, outcome, measured, wanted });
    }

    /// Adds what came of a check, and tells the person at the board.
    pub fn add_and_tell(
        &mut self,
        board: &mut impl Board,
        name: &'static str,
        wanted: &'static str,
        checked: Checked,
    ) {
        self.add(name, wanted, checked);
        board.tell(&self.last_line());
    }

    /// Adds a check that was not made.
    pub fn leave_out(&mut self, name: &'static str, wanted: &'static str, why: &str) {
        let measured = plain(why);
        self.findings.push(Finding { name, outcome: Outcome::Untried, measured, wanted });
    }

    /// Returns the last finding as a line for a terminal.
    fn last_line(&self) -> String {
        self.findings.last().map_or(String::new(), |one| {
            format!("{:>9}  {}: {}", one.outcome.word(), one.name, one.measured)
        })
    }

    /// Returns the verdict in a sentence.
    pub fn verdict(&self) -> String {
        let count = |outcome| self.findings.iter().filter(|one| one.outcome == outcome).count();
        let (failed, untried) = (count(Outcome::Failed), count(Outcome::Untried));
        let all = self.findings.len();
        match (failed, untried) {
            (0, 0) => format!("All {all} checks passed."),
            (0, _) => {
                format!("{} of {all} checks passed, {untried} were not tried.", all - untried)
            }
            _ => format!("{failed} of {all} checks FAILED, {untried} were not tried."),
        }
    }
}

/// Most characters of what a check measured.
const LONGEST: usize = 400;

/// Makes of a board's words what harms neither a terminal nor a table: no control characters, no ends of cells and of
/// code, and not too many.
fn plain(text: &str) -> String {
    let harmless = |c: char| match c {
        '`' | '|' => '\'',
        c if c.is_control() => ' ',
        c => c,
    };
    text.chars().take(LONGEST).map(harmless).collect()
}

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Plan { board, version, .. } = &self.plan;
        writeln!(f, "# Kerf {version} on `{board}`\n\n{}\n", self.verdict())?;
        writeln!(f, "| check | result | measured | wanted |\n|---|---|---|---|")?;
        for Finding { name, outcome, measured, wanted } in &self.findings {
            writeln!(f, "| {name} | {} | `{measured}` | {wanted} |", outcome.word())?;
        }
        Ok(())
    }
}
