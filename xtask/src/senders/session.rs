//! A session of one sender at one board.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use super::Sender;
use super::board::Board;
use super::install;
use super::step::{Outcome, Step};

/// The step that every session ends with.
pub const ARRIVAL: &str = "exact final step";
/// Longest time of a driver. A driver limits its steps itself, so one that takes longer never ends.
const LIMIT: Duration = Duration::from_secs(15 * 60);

/// The data that a session needs.
pub struct Session<'a> {
    pub sender: Sender,
    /// The path of the simulator.
    pub program: &'a Path,
    pub elf: &'a Path,
    /// The board that the image is for.
    pub board: crate::boards::Board,
    pub job: &'a Path,
    /// The folder of the installed senders.
    pub folder: &'a Path,
}

/// The result of a session.
pub struct Done {
    pub sender: &'static str,
    pub steps: Vec<Step>,
    pub seconds: u64,
}

impl Session<'_> {
    /// Returns the file for the driver's other output.
    fn log(&self) -> PathBuf {
        self.folder.join(self.sender.name()).with_extension("log")
    }

    /// Runs the session and shows its steps as they come. Any error becomes a failed step.
    pub fn run(&self) -> Done {
        let began = Instant::now();
        let sender = self.sender.name();
        let mut steps = Vec::new();
        let mut tell = |step: Step| {
            println!("{sender}: {}: {}: {}", step.name, step.outcome.name(), step.details);
            steps.push(step);
        };
        if let Err(error) = self.attempt(&mut tell) {
            tell(Step::failed("session", format!("{error:#}")));
        }
        Done { sender, steps, seconds: began.elapsed().as_secs() }
    }

    fn attempt(&self, tell: &mut impl FnMut(Step)) -> Result<()> {
        let damage = self.sender.damage(self.board);
        let board = Board::start(self.program, self.elf, self.board.name(), self.job, damage)?;
        let mut driver = Driver::start(self, &board.port)?;
        let end = Instant::now() + LIMIT;
        while let Some(line) = driver.line(end)? {
            match Step::parse(&line) {
                Some(step) => tell(step),
                None => println!("{}: {line}", self.sender.name()),
            }
        }
        let status = driver.child.wait()?;
        let (exact, details) = board.end()?;
        let outcome = if exact { Outcome::Passed } else { Outcome::Failed };
        tell(Step { name: ARRIVAL.to_owned(), outcome, details });
        if !status.success() {
            bail!("the driver ends with {status}; see {}", self.log().display());
        }
        Ok(())
    }
}

/// A sender's driver, which is in a process group with everything that it starts.
struct Driver {
    child: Child,
    lines: Receiver<String>,
}

impl Driver {
    fn start(session: &Session, port: &str) -> Result<Driver> {
        let (script, word) = session.sender.driver();
        let program = match script.ends_with(".py") {
            true => install::python_of(session.folder),
            false => "node".into(),
        };
        let mut command = Command::new(&program);
        command.arg(install::drivers().join(script)).arg(port).arg(session.job).args(word);
        // The driver of a line that damages what is sent checks that it has.
        command.args(session.sender.damage(session.board).map(|_| "damaged"));
        command.current_dir(session.folder);
        // A driver gives up when its standard input ends. That happens when this program ends, for whatever reason.
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).process_group(0);
        command.stderr(File::create(session.log()).context("no log")?);
        let child = command.spawn();
        let mut child = child.with_context(|| format!("cannot start {}", program.display()))?;
        let output = BufReader::new(child.stdout.take().context("no output")?);
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            output.lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        Ok(Driver { child, lines })
    }

    /// Returns the driver's next line; `None` when it has ended.
    fn line(&mut self, end: Instant) -> Result<Option<String>> {
        use std::sync::mpsc::RecvTimeoutError::{Disconnected, Timeout};
        match self.lines.recv_timeout(end.saturating_duration_since(Instant::now())) {
            Ok(line) => Ok(Some(line)),
            Err(Disconnected) => Ok(None),
            Err(Timeout) => bail!("the driver has not ended within {} min", LIMIT.as_secs() / 60),
        }
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // Usually the driver has ended, and nothing is left to do.
        if !matches!(self.child.try_wait(), Ok(Some(_))) {
            let kill = format!("kill -KILL -{}", self.child.id());
            let _ = Command::new("sh").args(["-c", &kill]).status();
            let _ = self.child.wait();
        }
    }
}
