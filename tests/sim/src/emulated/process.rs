//! The processes that boards are emulated in.
//!
//! Node compiles the emulator while it runs: the first second of a board takes three times as long as later ones. So a process whose board is not wanted any
//! more is kept, for the next board.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, ensure};

/// Those that have no board. They end with this program, which closes their input.
static IDLE: Mutex<Vec<Process>> = Mutex::new(Vec::new());

/// A process that answers requests, a line each.
pub struct Process {
    program: PathBuf,
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    /// The last request has been answered.
    is_sound: bool,
}

impl Process {
    /// One that runs this program and has no board, or the board of somebody who has gone.
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

    /// Keeps it for another board, if it answers still.
    pub fn keep(self) {
        if self.is_sound {
            IDLE.lock().unwrap_or_else(PoisonError::into_inner).push(self);
        }
    }

    /// Sends a request, and takes its answer.
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
        // It has nothing to put away.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
