//! The simulated board behind a serial port, and the end positions of its motors.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

use anyhow::{Context, Result, ensure};

/// A board that serves a sender. It ends when this value is dropped.
pub struct Board {
    child: Child,
    output: BufReader<ChildStdout>,
    /// The name of the serial port.
    pub port: String,
}

impl Board {
    /// Starts a board. `damage` is the argument of the simulator's `--damage`.
    pub fn start(
        program: &Path,
        elf: &Path,
        board: &str,
        job: &Path,
        damage: Option<&str>,
    ) -> Result<Board> {
        let mut command = Command::new(program);
        command.args(["serve", "--speed", "max", "--elf"]).arg(elf).args(["--board", board]);
        command.arg("--expect").arg(job);
        if let Some(damage) = damage {
            command.args(["--damage", damage]);
        }
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().context("cannot start the simulator")?;
        let mut output = BufReader::new(child.stdout.take().context("no output")?);
        let mut port = String::new();
        output.read_line(&mut port)?;
        let port = port.trim().to_owned();
        let board = Board { child, output, port };
        ensure!(!board.port.is_empty(), "the simulator offers no serial port");
        Ok(board)
    }

    /// Ends the board's standard input, and thereby the board. Returns whether its motors are where the job ends, and
    /// their positions as text.
    pub fn end(mut self) -> Result<(bool, String)> {
        drop(self.child.stdin.take());
        let mut text = String::new();
        self.output.read_to_string(&mut text)?;
        let exact = self.child.wait()?.success() && text.contains("\nresult: OK");
        Ok((exact, motors(&text)))
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        // The board has ended already, or something has failed and was reported.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns the motors from a simulator's last lines, such as `motor 1: 0 of 0, 1931244 in all`.
fn motors(text: &str) -> String {
    let shown = |line: &str| {
        let words: Vec<_> = line.strip_prefix("arrival ")?.split_whitespace().collect();
        let [motor, "steps", steps, "expected", expected, "total", total] = words[..] else {
            return None;
        };
        (total != "0")
            .then(|| format!("motor {motor} at {steps}, right is {expected}, {total} steps"))
    };
    let damaged = text.lines().find(|line| line.starts_with("damaged ")).map(str::to_owned);
    let motors: Vec<_> = text.lines().filter_map(shown).chain(damaged).collect();
    match motors.is_empty() {
        true if text.contains("arrival ") => "no motor has moved".to_owned(),
        true => "the simulator does not tell where the motors are".to_owned(),
        false => motors.join("; "),
    }
}

#[cfg(test)]
mod tests {
    use super::motors;

    #[test]
    fn motors_that_have_moved_are_shown() {
        let text = "free stack 9 bytes\narrival 1  steps -5  expected -5  total 15\n\
                    arrival 2  steps 0  expected 0  total 0\nresult: OK\n";
        assert_eq!(motors(text), "motor 1 at -5, right is -5, 15 steps");
        assert_eq!(motors("arrival 1  steps 0  expected 0  total 0\n"), "no motor has moved");
        assert!(motors("").contains("not tell"));
    }
}
