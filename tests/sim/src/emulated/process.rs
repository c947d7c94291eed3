//! The processes of emulated boards.
//!
//! Node compiles the emulator while it runs, so the first second of a board takes three times as long as later
//! seconds. Therefore a process is kept when its board is no longer wanted, and serves the next board.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, ensure};

/// Processes that have no board. They end with this program, because that closes their input.
static IDLE: Mutex<Vec<Process>> = Mutex::new(Vec::new());

/// A process that answers requests, one line each.
pub struct Process {
    program: PathBuf,
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    /// Whether the last request has been answered.
    is_sound: bool,
}

impl Process {
    /// Returns a process that runs this program: an idle one, which may still hold its former board, or a new one.
    pub fn take(program: PathBuf) -> Result<Self> {
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        match idle.iter().position(|process| process.program == program) {
            Some(at) => Ok(idle.swap_remove(at)),
            None => Self::start(program),
        }
    }

    fn start(program: PathBuf) -> Result<Self> {
        let mut child = Command::new("node")
            .arg(&program)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .context("cannot start node")?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let input = input.context("no standard input")?;
        let output = BufReader::new(output.context("no standard output")?);
        Ok(Self { program, child, input, output, is_sound: true })
    }

    /// Keeps the process for another board, if it still answers.
    pub fn keep(self) {
        if self.is_sound {
            IDLE.lock().unwrap_or_else(PoisonError::into_inner).push(self);
        }
    }

    /// Sends a request and returns its answer.
    pub fn ask(&mut self, request: &str) -> Result<String> {
        self.is_sound = false;
        writeln!(self.input, "{request}").context("the emulator has ended")?;
        self.input.flush()?;
        let mut answer = String::new();
        self.output.read_line(&mut answer)?;
        ensure!(answer.ends_with('\n'), "the emulator has ended");
        self.is_sound = true;
        Ok(answer)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // The process has no state worth saving.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
