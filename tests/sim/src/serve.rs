//! `kerf-sim serve`: the machine behind a pseudo-terminal, at the pace of real time.

mod emulated;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use kerf::boards::Board;
use kerf_sim::emulated::is_emulated;
use kerf_sim::job::{read_setup, read_travels};
use kerf_sim::mechanics::Build;
use kerf_sim::pty::{Peer, Pty};
use kerf_sim::{Host, Image, Loader, Machine, Speech};

use crate::arrival::Arrival;
use crate::cli::{ServeArgs, Speed};
use crate::damage::Damage;
use crate::gdb::Gdb;
use crate::run::board;

/// Time between two checks of the two sides.
const TICK: Duration = Duration::from_millis(2);
/// AVR time between two checks at full speed.
const SLICE_MS: u64 = 2;
/// At full speed, the wait for a sender after a slice in which nothing has happened. It keeps an idle machine from
/// using all of the computer's CPU time, while simulated time still passes ten times as fast as real time.
const REST: Duration = Duration::from_micros(100);
/// Cycles that are added to each slice until the firmware listens. If slices took whole milliseconds, each of them
/// might end within the tick's interrupt, in which the firmware does not listen.
const STRIDE: u64 = 1_009;
/// Time from opening the port to the reset, without a boot loader. Senders flush their input during this time.
const RESET_DELAY: Duration = Duration::from_millis(100);
/// Greatest lag behind real time. A machine that is further behind does not catch up.
const MAX_LAG: Duration = Duration::from_millis(200);

/// The message when a sender opens the port.
const OPENED: &str = "the port has been opened: the board resets, as a real one does, and no longer knows where it is";

/// Height of the plate for probing above the lower hard end of Z, as a share of the way to the upper one.
const PLATE: f64 = 0.45;

/// Longest time from the reset of the second board to its greeting, ms of AVR time.
const BOOT_MS: u64 = 1_500;

/// Bytes that may wait for the serial line, as in the buffer of a real port.
const BACKLOG: usize = 256;

struct Server {
    machine: Machine,
    image: Image,
    /// What is around the board.
    build: Build,
    /// Whether the board starts in a boot loader. Its machine is then never replaced.
    has_loader: bool,
    baud: u32,
    pty: Pty,
    gdb: Option<Gdb>,
    damage: Option<Damage>,
    speed: Speed,
    peer: Peer,
    reset_at: Option<Instant>,
    /// Whether the firmware has begun to take bytes since the last reset.
    listens: bool,
    /// Whether in the last turn no byte went either way and no motor moved.
    rests: bool,
    /// An instant of real time and the cycle that belongs to it.
    anchor: (Instant, u64),
    boots: u64,
}

/// Serves until interrupted. If a job is expected, serves until the standard input ends. Returns true when the
/// firmware was still alive at the end and the motors were where the job ends.
pub fn serve(args: &ServeArgs) -> Result<bool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))
        .context("cannot handle interrupts")?;
    if args.expect.is_some() {
        stop_with_input(Arc::clone(&stop));
    }
    let board = board(&args.target.board)?;
    if is_emulated(board) {
        return emulated::serve(args, board, &stop);
    }
    let mut server = Server::new(args)?;
    println!("{}", server.pty.path().display());
    if let Some(gdb) = &server.gdb {
        println!("gdb: {}", gdb.port()?);
    }
    let mut end = Ok(());
    while !stop.load(Ordering::Relaxed) && end.is_ok() {
        end = server.turn();
    }
    print!("{}", server.summary());
    if let Err(error) = &end {
        eprintln!("kerf-sim: {error:#}");
    }
    let arrived = match &args.expect {
        Some(job) if end.is_ok() => server.has_arrived(job)?,
        _ => true,
    };
    Ok(end.is_ok() && arrived)
}

/// The machine that a sender finds: in the middle of its travel, with a plate for probing below it. Its motors and its
/// travel are those of the firmware's settings, which a second board with the same EEPROM tells. If that board does not
/// answer in a dialect with settings, they are those of the default settings.
fn around(image: &Image, board: &'static Board, like: Option<&Machine>) -> Build {
    let dialects = [("dialect-tinyg", Speech::TinyG), ("dialect-grbl", Speech::Grbl)];
    let known = dialects.into_iter().filter(|(feature, _)| board.features.contains(feature));
    let mut told = known.filter_map(|(_, speech)| told(image, board, like, speech).ok());
    with_plate(told.next().unwrap_or_else(|| Build::of(board)))
}

/// Puts a plate for probing below the tool.
fn with_plate(build: Build) -> Build {
    Build { plate: Some(build.axes[2].travel * PLATE), ..build }
}

/// Asks a second board for its settings.
fn told(
    image: &Image,
    board: &'static Board,
    like: Option<&Machine>,
    speech: Speech,
) -> Result<Build> {
    let mut twin = Machine::new(image.clone(), board)?;
    if let Some(like) = like {
        twin.set_eeprom(like.eeprom());
    }
    let mut host = Host::new(1).speaking(speech);
    host.boot(&mut twin, BOOT_MS)?;
    let setup = read_setup(&mut twin, &mut host)?;
    let travels = read_travels(&mut twin, &mut host)?;
    Ok(Build::fitted(board, &setup, travels))
}

/// Stops when the standard input ends. Then the program that started this one waits for the result, or has ended.
fn stop_with_input(stop: Arc<AtomicBool>) {
    std::thread::spawn(move || {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        stop.store(true, Ordering::Relaxed);
    });
}

/// Returns whether the other side is open. With `rests`, waits up to [`REST`] for its bytes.
fn wait(pty: &Pty, rests: bool) -> Result<Peer> {
    let peer = pty.wait(if rests { REST } else { Duration::ZERO })?;
    if rests && peer == Peer::Closed {
        std::thread::sleep(REST);
    }
    Ok(peer)
}

impl Server {
    fn new(args: &ServeArgs) -> Result<Self> {
        let image = Image::read(&args.target.elf)?;
        let board = board(&args.target.board)?;
        let mut machine = Machine::new(image.clone(), board)?;
        let build = around(&image, board, None);
        if let Some(path) = &args.boot_loader {
            machine.install(&Loader::read(path)?);
        }
        machine.build(&build);
        machine.build_heaters();
        machine.set_baud(args.baud);
        machine.follow_speed();
        let mut pty = Pty::new()?;
        if let Some(link) = &args.link {
            pty.link(link)?;
        }
        Ok(Server {
            anchor: (Instant::now(), machine.cycle()),
            machine,
            image,
            build,
            has_loader: args.boot_loader.is_some(),
            baud: args.baud,
            gdb: args.gdb.map(Gdb::listen).transpose()?,
            pty,
            damage: args.damage.map(|(one_in, seed)| Damage::new(one_in, seed)),
            speed: args.speed,
            peer: Peer::Closed,
            reset_at: None,
            listens: false,
            rests: false,
            boots: 0,
        })
    }

    /// Does one turn: reads from the sender, runs the machine, carries bytes both ways.
    fn turn(&mut self) -> Result<()> {
        let peer = wait(&self.pty, self.rests && self.speed == Speed::Max)?;
        let steps = self.machine.recorder().steps();
        self.rests = self.machine.wire().backlog() == 0;
        if peer != self.peer {
            self.peer = peer;
            let delay = if self.has_loader { Duration::ZERO } else { RESET_DELAY };
            self.reset_at = (peer == Peer::Open).then(|| Instant::now() + delay);
        }
        if self.reset_at.is_some_and(|at| at <= Instant::now()) {
            self.reset_at = None;
            self.reset()?;
        }
        if self.takes_bytes() {
            let bytes = self.pty.read()?;
            let bytes = match &mut self.damage {
                Some(damage) => damage.pass(&bytes),
                None => bytes,
            };
            self.rests &= bytes.is_empty();
            self.machine.send(&bytes);
        }
        self.run()?;
        let answer = self.machine.receive();
        self.rests &= answer.is_empty() && self.machine.recorder().steps() == steps;
        match self.peer {
            Peer::Open if self.reset_at.is_none() => self.pty.write(&answer)?,
            _ => self.pty.discard(),
        }
        self.pause();
        Ok(())
    }

    /// Whether bytes go to the machine. Before the reset, and after it until the firmware listens, they wait in the
    /// pseudo-terminal; a real board would lose them, or give them to its boot loader.
    fn takes_bytes(&mut self) -> bool {
        self.listens = self.listens || self.has_loader || self.machine.is_listening();
        self.listens && self.reset_at.is_none() && self.machine.wire().backlog() < BACKLOG
    }

    fn reset(&mut self) -> Result<()> {
        eprintln!("{OPENED}");
        self.boots += 1;
        if self.has_loader {
            self.machine.reset();
            return Ok(());
        }
        if self.machine.eeprom_writes() > 0 {
            self.build = around(&self.image, self.machine.board(), Some(&self.machine));
        }
        let mut fresh = self.fresh()?;
        fresh.set_eeprom(self.machine.eeprom());
        self.machine = fresh;
        self.anchor = (Instant::now(), 0);
        self.listens = false;
        Ok(())
    }

    /// Returns another machine with empty memory.
    fn fresh(&self) -> Result<Machine> {
        let mut fresh = Machine::new(self.image.clone(), self.machine.board())?;
        fresh.build(&self.build);
        fresh.build_heaters();
        fresh.set_baud(self.baud);
        fresh.follow_speed();
        Ok(fresh)
    }

    fn run(&mut self) -> Result<()> {
        let until = match self.speed {
            Speed::Max if self.listens => self.machine.cycle() + self.machine.cycles(SLICE_MS),
            Speed::Max => self.machine.cycle() + self.machine.cycles(SLICE_MS) + STRIDE,
            Speed::Times(factor) => self.pace(factor),
        };
        let Some(gdb) = &mut self.gdb else { return Ok(self.machine.run_until(until)?) };
        gdb.turn(&mut self.machine)?;
        gdb.run_until(&mut self.machine, until)?;
        if gdb.is_halted() {
            self.anchor = (Instant::now(), self.machine.cycle());
        }
        Ok(())
    }

    /// Returns the cycle that corresponds to the present time. For a machine that lags far behind it is earlier.
    fn pace(&mut self, factor: f64) -> u64 {
        let hz = f64::from(self.machine.board().clock_hz) * factor;
        let target = self.anchor.1 + (self.anchor.0.elapsed().as_secs_f64() * hz) as u64;
        let most = self.machine.cycle() + (MAX_LAG.as_secs_f64() * hz) as u64;
        if target > most {
            self.anchor = (Instant::now(), most);
        }
        target.min(most)
    }

    /// Waits for bytes, unless the machine runs at full speed.
    fn pause(&self) {
        if self.speed != Speed::Max {
            std::thread::sleep(TICK);
        }
    }

    /// Prints the final positions of the last sender's job. Returns whether they are exact.
    fn has_arrived(&mut self, job: &Path) -> Result<bool> {
        let mut twin = self.fresh()?;
        twin.set_eeprom(self.machine.eeprom());
        let arrival = Arrival::of(&mut self.machine, &mut twin, job)?;
        print!("{arrival}");
        Ok(arrival.is_exact())
    }

    fn summary(&self) -> String {
        let m = &self.machine;
        let time = m.seconds(m.cycle());
        let mut text = format!("\n{} boots; {time:.3} s of AVR time since the last\n", self.boots);
        for (i, motor) in m.recorder().motors().iter().enumerate() {
            let rate = motor.min_interval.map_or(0.0, |c| 1.0 / m.seconds(c));
            text += &format!(
                "motor {}  position {:>10}  steps {:>10}  highest rate {rate:>7.0} Hz\n",
                i + 1,
                motor.position,
                motor.steps
            );
        }
        let off = m.meters().window_outside();
        let stack = m.free_stack().map_or("unknown".to_string(), |n| format!("{n} bytes"));
        text += &format!("interrupts off for up to {} cycles: {}\n", off.cycles, m.describe(&off));
        if let Some(damage) = &self.damage {
            let (numbered, damaged) = damage.counts();
            text += &format!("damaged {damaged} of {numbered} numbered lines\n");
        }
        text += &format!("free stack {stack}, UART overruns {}\n", m.uart(0).overruns());
        text
    }
}
