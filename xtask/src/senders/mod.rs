//! `cargo xtask senders`: real senders of G-code against the simulated board.
//!
//! | module | purpose |
//! |---|---|
//! | [`install`] | gets the senders by npm and pip |
//! | [`job`] | the job of printing hosts |
//! | [`board`] | the simulated board behind a serial port, and the end positions of its motors |
//! | [`pool`] | how many sessions run at once |
//! | [`session`] | one sender at one board |
//! | [`step`] | the steps that a sender's driver reports |
//! | [`table`] | the results of all sessions |
//!
//! The drivers are `tests/senders/*.js` and `*.py`. Each has a board of its own, which runs as fast as the computer
//! allows, and sends the whole job. At the end every motor must be where the job ends, to the step.

mod board;
mod install;
mod job;
mod pool;
mod session;
mod step;
mod table;

use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::{Args, ValueEnum};

use crate::boards::Board;
use crate::checks::cases;
use crate::machines::Machine;
use crate::process::root;
use crate::setup::{self, Scope};
use crate::sim;
pub use pool::at_once;
use session::Session;

/// `cargo xtask senders`
#[derive(Args, Default)]
pub struct SendersArgs {
    /// Only these senders
    #[arg(long, value_enum)]
    sender: Vec<Sender>,
    /// The G-code file that they send
    #[arg(long, value_name = "JOB")]
    job: Option<PathBuf>,
    /// The board: pico, which is emulated, or mega2560-grbl; for printing hosts skr-pico, which is emulated, or ramps14
    #[arg(long, value_enum)]
    board: Option<Board>,
    /// Install the senders and run none
    #[arg(long)]
    install: bool,
    /// Whether the print of printing hosts is short
    #[arg(skip)]
    brief: bool,
}

/// A sender that has a driver. The short tests run each second one, so neighbours in this list are alike.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Sender {
    Cncjs,
    CncjsGrbl,
    G2coreApi,
    BcncGrbl,
    BcncG2core,
    GrblStreamer,
    PygrblStreamer,
    GrblLink,
    Plotdeck,
    Gantrix,
    StreamPy,
    Meerk40t,
    Gscrib,
    Grblhud,
    Printcore,
    CncjsMarlin,
    Octoprint,
    MarlinHost,
    Pronsole,
}

impl Sender {
    /// Returns its name.
    fn name(self) -> &'static str {
        self.row().0
    }

    /// Returns its driver, and the driver's further argument besides port and job.
    fn driver(self) -> (&'static str, Option<&'static str>) {
        let (_, script, word) = self.row();
        (script, word)
    }

    /// Returns its name, its driver and the driver's further argument.
    fn row(self) -> (&'static str, &'static str, Option<&'static str>) {
        match self {
            Sender::Cncjs => ("cncjs", "cncjs.js", None),
            Sender::CncjsGrbl => ("cncjs-grbl", "cncjs-grbl.js", None),
            Sender::G2coreApi => ("g2core-api", "g2core-api.js", None),
            Sender::BcncGrbl => ("bcnc-grbl", "bcnc.py", Some("GRBL1")),
            Sender::BcncG2core => ("bcnc-g2core", "bcnc.py", Some("G2Core")),
            Sender::GrblStreamer => ("grbl-streamer", "grbl-streamer.py", None),
            Sender::PygrblStreamer => ("pygrbl-streamer", "pygrbl-streamer.py", None),
            Sender::GrblLink => ("grbl-link", "grbl-link.py", None),
            Sender::Plotdeck => ("plotdeck", "plot-deck.py", None),
            Sender::Gantrix => ("gantrix", "gantrix-laser.py", None),
            Sender::StreamPy => ("stream-py", "stream-py.py", None),
            Sender::Meerk40t => ("meerk40t", "meerk40t-console.py", None),
            Sender::Gscrib => ("gscrib", "gscrib-serial.py", None),
            Sender::Grblhud => ("grblhud", "grbl-hud.py", None),
            Sender::Printcore => ("printcore", "printcore.py", None),
            Sender::CncjsMarlin => ("cncjs-marlin", "cncjs-marlin.js", None),
            Sender::Octoprint => ("octoprint", "octoprint-server.py", None),
            Sender::MarlinHost => ("marlin-host", "marlin-host.py", None),
            Sender::Pronsole => ("pronsole", "pronsole-card.py", None),
        }
    }
}

impl Sender {
    /// Whether it is a printing host.
    fn prints(self) -> bool {
        matches!(
            self,
            Sender::Printcore
                | Sender::CncjsMarlin
                | Sender::Octoprint
                | Sender::MarlinHost
                | Sender::Pronsole
        )
    }

    /// Returns the boards for this sender: the one by default, and the emulated one.
    fn boards(self) -> [Board; 2] {
        match self.prints() {
            // It uploads to a card.
            _ if self == Sender::Pronsole => [Board::PicoCnc; 2],
            true => [Board::Ramps14, Board::SkrPico],
            false => [Board::default(), Board::Pico],
        }
    }

    /// Returns the damage for a host that sends checksums: one line in a hundred is damaged on its way, by a seed. USB
    /// damages nothing.
    fn damage(self, board: Board) -> Option<&'static str> {
        (self == Sender::Printcore && self.boards()[0] == board).then_some("100:21")
    }
}

/// One in this many senders runs in the short tests.
const SHARE: usize = 2;

/// Runs a share of the senders, which changes with the commit, with half of the normal job and a third of the print,
/// because the conversations are tested. Whole jobs are tested with the simulator.
pub fn run_short() -> Result<()> {
    let job = Some(root().join("examples/engraving.gcode"));
    let sender = share(cases::number());
    run(&SendersArgs { sender, job, brief: true, ..Default::default() })
}

/// Returns the share that a number chooses. The shares of consecutive numbers together are all senders but those for
/// emulated boards alone.
fn share(number: u64) -> Vec<Sender> {
    let first = (number % SHARE as u64) as usize;
    let senders = Sender::value_variants().iter().copied();
    senders.filter(|sender| !sender.boards()[0].is_rp2040()).skip(first).step_by(SHARE).collect()
}

/// Runs all senders with whole jobs.
pub fn run_long() -> Result<()> {
    run(&SendersArgs::default())
}

/// Runs a share of the senders at the emulated RP2040, one printing host among them, or all. They run in sequence, because
/// an emulator needs a core of the computer to itself.
pub fn run_emulated(all: bool) -> Result<()> {
    let (hosts, others): (Vec<_>, Vec<_>) =
        Sender::value_variants().iter().copied().partition(|sender| sender.prints());
    let number = cases::number() as usize;
    let some = [others[number % others.len()], hosts[number % hosts.len()]];
    let senders = if all { [others, hosts].concat() } else { some.to_vec() };
    for sender in senders {
        let job = Some(root().join("examples/square.gcode"));
        let board = Some(sender.boards()[1]);
        run(&SendersArgs { sender: vec![sender], job, board, brief: !all, ..Default::default() })?;
    }
    Ok(())
}

/// Runs the senders, a few at once, and shows the results. Fails if a sender failed.
pub fn run(args: &SendersArgs) -> Result<()> {
    let job = args.job.clone().unwrap_or_else(|| root().join("examples/bracket.gcode"));
    ensure!(job.is_file(), "there is no job {}", job.display());
    let job = job.canonicalize()?;
    setup::ensure(Scope::Senders)?;
    let folder = install::senders()?;
    if args.install {
        return Ok(());
    }
    let mut senders = args.sender.clone();
    if senders.is_empty() {
        senders = Sender::value_variants().to_vec();
    }
    if let Some(board) = args.board {
        senders.retain(|sender| sender.boards().contains(&board));
        ensure!(!senders.is_empty(), "none of these senders runs at {board}");
    }
    let board_of = |sender: Sender| args.board.unwrap_or(sender.boards()[0]);
    let mut elves = Vec::new();
    for &sender in &senders {
        elves.push(sim::prepare(board_of(sender), Machine::default())?);
    }
    let program = sim::program();
    // A printing host sends a print.
    let print = folder.join("print.gcode");
    std::fs::write(&print, job::prints(if args.brief { job::BRIEF } else { job::MOVES }))?;
    let session = &|(sender, elf): (Sender, &PathBuf)| {
        // The board of pronsole has no heaters.
        let job = if sender.prints() && sender != Sender::Pronsole { &print } else { &job };
        let board = board_of(sender);
        Session { sender, program: &program, elf, board, job, folder: &folder }.run()
    };
    let pairs: Vec<_> = senders.iter().copied().zip(&elves).collect();
    let results = pool::run(&pairs, at_once(), session);
    ensure!(table::show(&results), "a sender cannot work with the firmware");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_all_senders_together_and_have_hosts_of_both_kinds() {
        let shares = [41, 42].map(share);
        assert_eq!(shares.concat().len() + 1, Sender::value_variants().len());
        for share in shares {
            assert!(share.iter().any(|sender| sender.prints()), "{share:?}");
            assert!(share.iter().any(|sender| !sender.prints()), "{share:?}");
        }
    }

    /// The packages of the tested programs, and how their rows in docs/senders.md begin.
    const PROGRAMS: [(&str, &str); 14] = [
        ("bCNC", "bCNC"),
        ("cncjs", "CNCjs"),
        ("g2core-api", "g2core-api"),
        ("gantrix", "gantrix"),
        ("grbl-link", "grbl-link"),
        ("grbl-streamer", "grbl-streamer"),
        ("grblhud", "grblhud"),
        ("gscrib", "gscrib"),
        ("marlin-host", "marlin-host"),
        ("meerk40t", "MeerK40t"),
        ("OctoPrint", "OctoPrint"),
        ("plotdeck", "plotdeck"),
        ("printrun", "printcore"),
        ("pygrbl-streamer", "pygrbl-streamer"),
    ];

    #[test]
    fn the_page_names_the_versions_that_are_tested() {
        let read = |name: &str| std::fs::read_to_string(root().join(name)).unwrap();
        let lists = ["requirements.txt", "requirements-octoprint.txt", "package.json"];
        let pinned: String = lists.map(|list| read(&format!("tests/senders/{list}"))).concat();
        let page = read("docs/senders.md");
        for (package, row) in PROGRAMS {
            let marks = [format!("\n{package}=="), format!("\"{package}\": \"")];
            let rest = marks.iter().find_map(|mark| pinned.split_once(mark.as_str()));
            let (_, rest) = rest.unwrap_or_else(|| panic!("{package} is not pinned"));
            let version = rest.split(['\n', '"']).next().unwrap();
            let names = |line: &str| {
                line.starts_with(&format!("| {row}")) && line.contains(&format!("| {version} |"))
            };
            assert!(page.lines().any(names), "no row of {package} {version}");
        }
    }
}
