//! What came of it all, as a table.

use super::session::{ARRIVAL, Done};
use super::step::{Outcome, Step};

/// Steps that the firmware is known not to do so far.
const NOT_YET: [&str; 1] = ["override"];

/// Prints every step of every sender. Returns whether all is as it should be, or known.
pub fn show(sessions: &[Done]) -> bool {
    println!("\n{:<12}{:<20}{:<10}details", "sender", "step", "result");
    for (done, step) in steps(sessions) {
        let Step { name, outcome, details } = step;
        println!("{:<12}{name:<20}{:<10}{details}", done.sender, outcome.name());
    }
    println!();
    for done in sessions {
        println!("{}: {} s", done.sender, done.seconds);
    }
    for (done, step) in steps(sessions).filter(|(_, step)| step.outcome == Outcome::NotYet) {
        println!("{}: {}: not yet", done.sender, step.name);
    }
    for (done, step) in steps(sessions).filter(|(_, step)| is_better(step)) {
        println!(
            "{}: {}: passes now, strike it off the list in {}",
            done.sender,
            step.name,
            file!()
        );
    }
    let agree = agree(sessions);
    if !agree {
        println!("the motors have not made the same steps for every sender");
    }
    agree && steps(sessions).all(|(_, step)| is_right(step))
}

/// Whether the motors have made the same steps, not only the same way on balance, for every sender.
fn agree(sessions: &[Done]) -> bool {
    let motors = steps(sessions).filter(|(_, step)| step.name == ARRIVAL);
    let mut motors = motors.map(|(_, step)| &step.details);
    let first = motors.next();
    motors.all(|other| Some(other) == first)
}

fn steps(sessions: &[Done]) -> impl Iterator<Item = (&Done, &Step)> {
    sessions.iter().flat_map(|done| done.steps.iter().map(move |step| (done, step)))
}

fn is_right(step: &Step) -> bool {
    match step.outcome {
        Outcome::Passed => !is_better(step),
        Outcome::NotYet => is_known(step),
        Outcome::Failed => false,
    }
}

/// Whether it is on the list without need: from then on it would not be missed.
fn is_better(step: &Step) -> bool {
    step.outcome == Outcome::Passed && is_known(step)
}

fn is_known(step: &Step) -> bool {
    NOT_YET.contains(&step.name.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_known_may_be_missing() {
        let step = |name: &str, outcome| Step { outcome, ..Step::failed(name, "") };
        assert!(is_right(&step("finish", Outcome::Passed)));
        assert!(is_right(&step("override", Outcome::NotYet)));
        assert!(!is_right(&step("override", Outcome::Passed)));
        assert!(!is_right(&step("finish", Outcome::NotYet)));
        assert!(!is_right(&step("override", Outcome::Failed)));
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
