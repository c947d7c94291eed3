//! A run of one fuzzer: passes its output on, and extracts results from it.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};

use super::{Target, make};
use crate::process::{root, shown};

/// Longest time of an input, s. Usually an input takes milliseconds.
const TIMEOUT: u64 = 20;
/// Most memory of a fuzzer, MiB. This is far more than it leaks before it restarts.
const MEMORY: u64 = 4_096;

/// The text before the name of a file that a fuzzer has written an input to.
const WRITTEN: &str = "Test unit written to ";

/// The results of a run.
#[derive(Debug, Default, PartialEq)]
pub struct Session {
    runs: u64,
    /// Number of edges, and of features, which also count how often edges were taken.
    coverage: (u64, u64),
    /// Number of inputs in the corpus.
    corpus: u64,
    /// Inputs that break something.
    pub findings: Vec<PathBuf>,
}

impl Session {
    /// Runs a fuzzer for a time, or until it finds something.
    pub fn run(target: Target, program: &Path, time: Duration) -> Result<Self> {
        let (end, mut session) = (Instant::now() + time, Session::default());
        loop {
            let left = end.saturating_duration_since(Instant::now());
            if left.as_secs() == 0 || !session.findings.is_empty() {
                return Ok(session);
            }
            session.turn(target, program, left)?;
        }
    }

    /// Runs the fuzzer until it restarts or the time is over.
    fn turn(&mut self, target: Target, program: &Path, time: Duration) -> Result<()> {
        make(&target.folder("corpus"))?;
        make(&target.folder("findings"))?;
        let mut fuzzer = command(target, program, time);
        let child = fuzzer.stderr(Stdio::piped()).spawn();
        let mut child = child.with_context(|| format!("cannot run `{}`", shown(&fuzzer)))?;
        let said = child.stderr.take().context("a fuzzer that says nothing")?;
        let before = self.runs;
        for line in BufReader::new(said).split(b'\n') {
            let line = line?;
            let line = String::from_utf8_lossy(&line);
            eprintln!("{line}");
            self.hear(&line, before);
        }
        let status = child.wait()?;
        let explained = status.success() || !self.findings.is_empty();
        ensure!(explained, "`{}` failed ({status})", shown(&fuzzer));
        Ok(())
    }

    /// Takes the results from a line such as `#4096 pulse  cov: 905 ft: 3301 corp: 364/30Kb ...`.
    fn hear(&mut self, line: &str, before: u64) {
        if let Some((_, file)) = line.split_once(WRITTEN) {
            self.findings.extend(Some(PathBuf::from(file)).filter(|file| !is_slow_unit(file)));
        }
        let Some((count, rest)) =
            line.strip_prefix('#').and_then(|l| l.split_once(char::is_whitespace))
        else {
            return;
        };
        let number = |text: &str| text.split('/').next()?.parse::<u64>().ok();
        let mut words = rest.split_whitespace();
        self.runs = number(count).map_or(self.runs, |count| before + count);
        while let Some(word) = words.next() {
            let place = match word {
                "cov:" => &mut self.coverage.0,
                "ft:" => &mut self.coverage.1,
                "corp:" => &mut self.corpus,
                _ => continue,
            };
            *place = words.next().and_then(number).unwrap_or(*place);
        }
    }

    /// Prints the results.
    pub fn tell(&self, target: Target, program: &Path) {
        let Self { runs, coverage: (edges, features), corpus, findings } = self;
        let name = target.name();
        let found = findings.len();
        println!(
            "fuzz {name}: {runs} runs, {edges} edges and {features} features covered, \
             {corpus} inputs in the corpus, {found} findings"
        );
        for file in findings {
            println!("  to see it: {} {}", program.display(), file.display());
        }
    }
}

fn command(target: Target, program: &Path, time: Duration) -> Command {
    let [corpus, seeds, found] = ["corpus", "seeds", "findings"].map(|what| target.folder(what));
    let mut fuzzer = Command::new(program);
    fuzzer.current_dir(root());
    fuzzer.arg(format!("-max_total_time={}", time.as_secs()));
    fuzzer.arg(format!("-max_len={}", target.longest()));
    fuzzer.args(target.runs().map(|runs| format!("-runs={runs}")));
    fuzzer.arg(format!("-timeout={TIMEOUT}")).arg(format!("-rss_limit_mb={MEMORY}"));
    fuzzer.arg(format!("-dict={}", root().join("tests/fuzz/words.dict").display()));
    fuzzer.arg(format!("-artifact_prefix={}/", found.display()));
    fuzzer.args([corpus, seeds, found]);
    fuzzer
}

/// Whether a file is an input that takes long, but not too long.
fn is_slow_unit(file: &Path) -> bool {
    file.file_name().is_some_and(|name| name.to_string_lossy().starts_with("slow-unit-"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_is_understood() {
        let mut session = Session::default();
        for line in [
            "INFO: Loaded 1 modules   (22058 inline 8-bit counters)",
            "#2\tINITED cov: 12 ft: 13 corp: 1/1b exec/s: 0 rss: 39Mb",
            "#4096\tpulse  cov: 905 ft: 3301 corp: 364/30Kb lim: 70 exec/s: 682 rss: 55Mb",
            "#5000\tDONE   cov: 906 ft: 3302 corp: 365/30Kb lim: 70 exec/s: 682 rss: 55Mb",
            "thread panicked: #1 is a line",
            "artifact_prefix='f/'; Test unit written to f/slow-unit-12",
            "artifact_prefix='f/'; Test unit written to f/crash-12",
        ] {
            session.hear(line, 100);
        }
        let expected = Session {
            runs: 5_100,
            coverage: (906, 3_302),
            corpus: 365,
            findings: vec!["f/crash-12".into()],
        };
        assert_eq!(session, expected);
    }
}
