//! Prints the results as a table.

use super::session::{ARRIVAL, Done};
use super::step::{Outcome, Step};

/// Prints every step of every sender. Returns whether all steps have passed, except those that a sender does not offer.
pub fn show(sessions: &[Done]) -> bool {
    println!("\n{:<17}{:<20}{:<13}details", "sender", "step", "result");
    for (done, step) in steps(sessions) {
        let Step { name, outcome, details } = step;
        println!("{:<17}{name:<20}{:<13}{details}", done.sender, outcome.name());
    }
    println!();
    for done in sessions {
        println!("{}: {} s", done.sender, done.seconds);
    }
    let agree = agree(sessions);
    if !agree {
        println!("the motors have not made the same steps for every sender");
    }
    agree && steps(sessions).all(|(_, step)| is_fine(step.outcome))
}

/// Whether a step with this result does not fail the run.
fn is_fine(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Passed | Outcome::NotOffered)
}

/// Senders with a job of their own, or with a board that rounds corners by another law.
const APART: [&str; 5] = ["cncjs-marlin", "marlin-host", "octoprint", "printcore", "pronsole"];

/// Whether the motors have made the same number of steps, in both directions together, for every other sender.
fn agree(sessions: &[Done]) -> bool {
    let motors = steps(sessions).filter(|(done, _)| !APART.contains(&done.sender));
    let motors = motors.filter(|(_, step)| step.name == ARRIVAL);
    let mut motors = motors.map(|(_, step)| &step.details);
    let first = motors.next();
    motors.all(|other| Some(other) == first)
}

fn steps(sessions: &[Done]) -> impl Iterator<Item = (&Done, &Step)> {
    sessions.iter().flat_map(|done| done.steps.iter().map(move |step| (done, step)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_sender_does_not_offer_fails_nothing() {
        let fine = [Outcome::Passed, Outcome::Failed, Outcome::NotYet, Outcome::NotOffered];
        assert_eq!(fine.map(is_fine), [true, false, false, true]);
    }

    #[test]
    fn senders_have_to_agree_on_the_steps() {
        let done = |details: &str| {
            let step = Step { outcome: Outcome::Passed, ..Step::failed(ARRIVAL, details) };
            Done { sender: "s", steps: vec![step], seconds: 0 }
        };
        assert!(agree(&[]) && agree(&[done("a"), done("a")]));
        assert!(!agree(&[done("a"), done("a"), done("b")]));
    }
}
