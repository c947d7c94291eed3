//! What a sender's driver tells of its steps: a line each, `step`, the result, the name, details, parted
//! by tabs.

/// What came of a step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// As it should be.
    Passed,
    /// Not as it should be.
    Failed,
    /// The firmware does not do this so far.
    NotYet,
}

impl Outcome {
    const ALL: [Outcome; 3] = [Outcome::Passed, Outcome::Failed, Outcome::NotYet];

    /// As the drivers write it.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::Passed => "passed",
            Outcome::Failed => "failed",
            Outcome::NotYet => "not yet",
        }
    }
}

/// A step of a test.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Step {
    /// What it does.
    pub name: String,
    /// What came of it.
    pub outcome: Outcome,
    /// For people.
    pub details: String,
}

impl Step {
    /// A step that has failed.
    pub fn failed(name: &str, details: impl Into<String>) -> Step {
        Step { name: name.to_owned(), outcome: Outcome::Failed, details: details.into() }
    }

    /// Reads a line of a driver; `None` if it tells of no step.
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
