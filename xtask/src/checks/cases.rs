//! Which of the many cases the tests on boards run: all of them, or a share that changes with the commit. The tests read it
//! in `tests/sim/tests/common/share.rs`. The same number chooses the senders of the short tests.

use std::process::Command;

use crate::process::{probe, root};

/// Number of hexadecimal digits of a commit's hash that choose the share.
const DIGITS: usize = 8;
/// The variable with the number that chooses the share.
const COMMIT: &str = "KERF_COMMIT";

/// Tells a command which cases to run.
pub fn choose(command: &mut Command, long: bool) {
    if long {
        println!("all cases");
        command.env("KERF_LONG", "1");
        return;
    }
    let number = number();
    println!("a share of the cases, by the commit: {COMMIT}={number} chooses it again");
    command.env(COMMIT, number.to_string());
}

/// Returns the number that chooses the shares: that in `KERF_COMMIT`, or that of the commit.
pub fn number() -> u64 {
    let given = std::env::var(COMMIT).ok().and_then(|given| given.parse().ok());
    given.unwrap_or_else(|| of_hash(&commit()))
}

/// Returns the hash of the commit.
fn commit() -> String {
    let mut git = Command::new("git");
    probe(git.args(["rev-parse", "HEAD"]).current_dir(root())).unwrap_or_default()
}

/// Returns the number of a hash; 0 outside of a repository.
fn of_hash(hash: &str) -> u64 {
    let digits = hash.get(..DIGITS).unwrap_or_default();
    u64::from_str_radix(digits, 16).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::of_hash;

    #[test]
    fn a_hash_is_a_number() {
        assert_eq!(of_hash("000000ff66f1564b56cca0af7ff2b7c7c31566d8"), 0xFF);
        assert_eq!(of_hash("ffffffff66f1564b56cca0af7ff2b7c7c31566d8"), 0xFFFF_FFFF);
        assert_eq!([of_hash(""), of_hash("fatal: x")], [0, 0]);
    }
}
