//! The steps that a sender's driver reports, one on each line: `step`, the result, the name and details, separated by
//! tabs.

/// The result of a step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// The step did what it should.
    Passed,
    /// The step failed.
    Failed,
    /// The firmware does not support this yet.
    NotYet,
    /// The sender has no function for this step. It counts neither as passed nor as failed.
    NotOffered,
}

impl Outcome {
    const ALL: [Outcome; 4] =
        [Outcome::Passed, Outcome::Failed, Outcome::NotYet, Outcome::NotOffered];

    /// Returns the name that the drivers write.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::Passed => "passed",
            Outcome::Failed => "failed",
            Outcome::NotYet => "not yet",
            Outcome::NotOffered => "not offered",
        }
    }
}

/// A step of a test.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Step {
    /// What the step does.
    pub name: String,
    /// Its result.
    pub outcome: Outcome,
    /// Details for readers.
    pub details: String,
}

impl Step {
    /// A step that has failed.
    pub fn failed(name: &str, details: impl Into<String>) -> Step {
        Step { name: name.to_owned(), outcome: Outcome::Failed, details: details.into() }
    }

    /// Parses a line of a driver; `None` if the line is no step.
    pub fn parse(line: &str) -> Option<Step> {
        let mut parts = line.strip_prefix("step\t")?.splitn(3, '\t');
        let outcome = parts.next()?;
        let outcome = Outcome::ALL.into_iter().find(|known| known.name() == outcome)?;
        let name = parts.next()?.to_owned();
        Some(Step { name, outcome, details: parts.next()?.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_told_from_other_lines() {
        let step = Step::parse("step\tnot yet\thold\tno\tnotice").unwrap();
        let want = Step { outcome: Outcome::NotYet, ..Step::failed("hold", "no\tnotice") };
        assert_eq!(step, want);
        assert_eq!(Step::parse("step\tgreat\thold\t"), None);
        assert_eq!(Step::parse("(node:1) Warning"), None);
    }
}
