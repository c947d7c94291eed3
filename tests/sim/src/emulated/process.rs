//! The processes of emulated boards.
//!
//! Node compiles the emulator while it runs, so the first second of a board takes three times as long as later
//! seconds. Therefore a process is kept when its board is no longer wanted, and serves the next board.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, bail, ensure};
use serde::Serialize;
use serde::de::DeserializeOwned;

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

/// A process that serves a board until the board is dropped.
pub struct Lent {
    /// `None` only while the board is dropped.
    process: Option<Process>,
    /// Whether the program has told of a fault.
    has_failed: bool,
}

/// The answer to a request.
pub trait Answers: DeserializeOwned {
    /// Why the program cannot go on, if it cannot.
    fn fault(&self) -> Option<&str>;
}

impl Lent {
    /// Returns a process that runs this program: see [`Process::take`].
    pub fn take(program: PathBuf) -> Result<Self> {
        Ok(Self { process: Some(Process::take(program)?), has_failed: false })
    }

    /// Sends a request and returns its answer. The error is the program's fault, or why there is no answer.
    pub fn ask<A: Answers>(&mut self, request: &impl Serialize) -> Result<A> {
        let process = self.process.as_mut().context("no process")?;
        let answer: A = serde_json::from_str(&process.ask(&serde_json::to_string(request)?)?)?;
        if let Some(fault) = answer.fault() {
            self.has_failed = true;
            bail!("{} fails: {fault}", process.program.display());
        }
        Ok(answer)
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        // The process of a board that has failed is not kept for another board.
        if let Some(process) = self.process.take().filter(|_| !self.has_failed) {
            process.keep();
        }
    }
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
