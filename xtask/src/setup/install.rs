//! Plans how missing tools are installed, separately from the installation.

use std::io::{IsTerminal, Write};
use std::process::{Command, Stdio};

use super::needs::Need;
use crate::process::{self, probe, which};

/// The command by which rustup installs a toolchain that can build for AVR.
pub const RUSTUP: &str = "rustup toolchain install nightly --profile minimal --component rust-src";

/// The means of installation that this computer and this user have.
#[derive(Clone, Copy, Debug)]
pub struct Means {
    apt: bool,
    root: bool,
    sudo: bool,
    rustup: bool,
}

impl Means {
    /// Finds the means of installation on this computer.
    pub fn here() -> Means {
        let apt = which("apt-get").is_some();
        let root = probe(Command::new("id").arg("-u")).as_deref() == Some("0");
        let sudo = apt && !root && probe(Command::new("sudo").args(["-n", "true"])).is_some();
        Means { apt, root, sudo, rustup: which("rustup").is_some() }
    }
}

/// One command, and an alternative if it fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// The command, words separated by blanks.
    pub command: String,
    /// The command to try if the first one fails.
    pub otherwise: Option<&'static str>,
}

/// The commands to run.
#[derive(Debug)]
pub struct Plan {
    /// The commands, in order; empty if no way is known.
    pub steps: Vec<Step>,
    /// Whether this program can run them itself: as root, or with a `sudo` that asks for no password.
    pub automatic: bool,
}

/// Returns the plan for installing what is missing.
pub fn plan(missing: &[&Need], means: Means) -> Plan {
    if !means.apt {
        return Plan { steps: Vec::new(), automatic: false };
    }
    let (rust, tools): (Vec<&Need>, Vec<&Need>) = missing.iter().partition(|need| need.is_rust);
    let mut steps = vec![apt(means, "apt-get update", None)];
    if !tools.is_empty() {
        steps.push(apt(means, &install_line(&tools), None));
    }
    // Rust is a step of its own: not every release has these packages, and then rustup may help.
    if !rust.is_empty() {
        steps.push(apt(means, &install_line(&rust), means.rustup.then_some(RUSTUP)));
    }
    Plan { steps, automatic: means.root || means.sudo }
}

fn install_line(needs: &[&Need]) -> String {
    let packages: Vec<_> = needs.iter().flat_map(|need| need.packages).copied().collect();
    format!("apt-get install -y --no-install-recommends {}", packages.join(" "))
}

fn apt(means: Means, command: &str, otherwise: Option<&'static str>) -> Step {
    let rights = match (means.root, means.sudo) {
        (true, _) => "",
        (false, true) => "sudo -n ",
        (false, false) => "sudo ",
    };
    Step { command: format!("{rights}env DEBIAN_FRONTEND=noninteractive {command}"), otherwise }
}

/// Asks the user, if there is one at the terminal. Returns whether the user agrees.
pub fn agreed(steps: &[Step]) -> bool {
    if !std::io::stdin().is_terminal() {
        return true;
    }
    eprintln!("setup: to run:");
    for step in steps {
        eprintln!("  {}", step.command);
    }
    eprint!("Run these now? [Y/n] ");
    let _ = std::io::stderr().flush();
    let mut answer = String::new();
    let read = std::io::stdin().read_line(&mut answer);
    read.is_ok_and(|bytes| bytes > 0) && is_yes(&answer)
}

fn is_yes(answer: &str) -> bool {
    matches!(answer.trim().to_ascii_lowercase().as_str(), "" | "y" | "yes")
}

/// Runs the steps. A failure is reported but does not stop the rest, because only the presence of the tools
/// afterwards counts.
pub fn execute(steps: &[Step]) {
    for step in steps {
        if !execute_one(&step.command)
            && let Some(other) = step.otherwise
        {
            execute_one(other);
        }
    }
}

fn execute_one(command: &str) -> bool {
    eprintln!("setup: {command}");
    let mut words = command.split(' ');
    let mut child = Command::new(words.next().unwrap_or_default());
    child.args(words).stdin(Stdio::null());
    match process::run(child.stdout(std::io::stderr())) {
        Ok(()) => true,
        Err(error) => {
            eprintln!("setup: {error:#}");
            false
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::needs::NEEDS;
    use super::*;

    const ROOT: Means = Means { apt: true, root: true, sudo: false, rustup: true };

    fn some() -> Vec<&'static Need> {
        vec![&NEEDS[0], &NEEDS[1], &NEEDS[4]]
    }

    #[test]
    fn root_on_debian_installs() {
        let plan = plan(&some(), ROOT);
        assert!(plan.automatic);
        let commands: Vec<_> = plan.steps.iter().map(|s| s.command.as_str()).collect();
        let install = "env DEBIAN_FRONTEND=noninteractive apt-get install -y \
                       --no-install-recommends";
        assert_eq!(commands[0], "env DEBIAN_FRONTEND=noninteractive apt-get update");
        assert_eq!(commands[1], format!("{install} gcc-avr gcc libc6-dev make"));
        assert_eq!(commands[2], format!("{install} rustc-web cargo-web rust-web-src"));
        assert_eq!(plan.steps[2].otherwise, Some(RUSTUP));
    }

    #[test]
    fn sudo_without_password_installs() {
        let plan = plan(&some(), Means { root: false, sudo: true, ..ROOT });
        assert!(plan.automatic);
        assert!(plan.steps.iter().all(|s| s.command.starts_with("sudo -n env ")));
    }

    #[test]
    fn without_rights_the_commands_are_only_told() {
        let plan = plan(&some(), Means { root: false, ..ROOT });
        assert!(!plan.automatic);
        assert!(plan.steps[1].command.starts_with("sudo env "));
    }

    #[test]
    fn elsewhere_there_is_no_plan() {
        let plan = plan(&some(), Means { apt: false, ..ROOT });
        assert!(!plan.automatic && plan.steps.is_empty());
    }

    #[test]
    fn only_what_is_missing_is_installed() {
        let plan = plan(&[&NEEDS[3]], Means { rustup: false, ..ROOT });
        assert_eq!(plan.steps.len(), 2);
        assert!(plan.steps[1].command.ends_with(" avr-libc"));
        assert_eq!(plan.steps[1].otherwise, None);
    }

    #[test]
    fn an_empty_answer_is_yes() {
        assert!(is_yes("\n") && is_yes("Y\n") && !is_yes("n\n") && !is_yes("what\n"));
    }
}
