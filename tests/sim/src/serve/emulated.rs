//! `kerf-sim serve` of a board whose chip is emulated: its USB behind a pseudo-terminal.
//!
//! Opening the port resets nothing, as on the real board, so a sender's job must begin where the firmware's zero is.
//! When a reset would end the connection on a real board, the pseudo-terminal stays open.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::Result;
use fatfs::FatType;
use kerf::boards::Board;
use kerf::boards::inputs::{ENDS, PROBE};
use kerf_sim::emulated::heat::Heat;
use kerf_sim::emulated::{Emulated, Near, Talks, job};
use kerf_sim::mechanics::{Axis, Build};
use kerf_sim::sd_image::image;
use kerf_sim::{Runs, USB};

use super::{MAX_LAG, SLICE_MS, TICK, wait, with_plate};
use crate::arrival::Arrival;
use crate::cli::{ServeArgs, Speed};
use kerf_sim::pty::{Peer, Pty};

/// Bytes that may wait in the computer.
const BACKLOG: usize = 256;

struct Server {
    board: Emulated,
    heat: Heat,
    pty: Pty,
    speed: Speed,
    peer: Peer,
    /// Whether in the last turn no byte went either way and no motor moved.
    rests: bool,
    /// Steps of each motor when the port was last opened: up minus down, and in both directions together.
    opened: Vec<(i64, u64)>,
    /// An instant of real time and the cycle that belongs to it.
    anchor: (Instant, u64),
}

/// As [`super::serve`], until `stop`.
pub fn serve(args: &ServeArgs, board: &'static Board, stop: &AtomicBool) -> Result<bool> {
    job::check(&[
        ("--gdb", args.gdb.is_some()),
        ("--damage", args.damage.is_some()),
        ("--boot-loader", args.boot_loader.is_some()),
    ])?;
    let mut server = Server::new(args, board)?;
    println!("{}", server.pty.path().display());
    while !stop.load(Ordering::Relaxed) {
        server.turn()?;
    }
    print!("{}", server.summary());
    let arrived = args.expect.as_ref().map(|job| server.has_arrived(job)).transpose()?;
    Ok(arrived.unwrap_or(true))
}

/// Steps of each motor: up minus down, and in both directions together.
fn steps(board: &Emulated) -> Vec<(i64, u64)> {
    board.steps().into_iter().zip(board.totals()).collect()
}

/// Returns the switches of a machine, and its plate as a switch.
fn switches(build: &Build, board: &Board) -> Vec<Near> {
    let near = |input: usize, axis: usize, at: f64, hysteresis: f64| {
        let gpio = board.inputs[input]?.bit;
        let Axis { motor, steps_per_mm, start, .. } = build.axes[axis];
        let step = ((at - start) * steps_per_mm).round() as i64;
        let above = input < ENDS && input % 2 == 1;
        let back = (hysteresis * steps_per_mm).round() as u32;
        Some(Near { gpio, motor, step, above, back, opens: false })
    };
    let ends = (0..ENDS).filter_map(|input| {
        let axis = &build.axes[input / 2];
        let switch = [axis.min, axis.max][input % 2]?;
        near(input, input / 2, switch.at, switch.hysteresis)
    });
    ends.chain(build.plate.and_then(|at| near(PROBE, 2, at, 0.0))).collect()
}

impl Server {
    fn new(args: &ServeArgs, board: &'static Board) -> Result<Self> {
        let mut emulated = Emulated::load(&args.target.elf, board)?;
        emulated.wire(&switches(&with_plate(Build::of(board)), board));
        if board.card.is_some() {
            emulated.insert_card(&image(FatType::Fat16, &[]))?;
        }
        emulated.session(Talks { open: false, reads: true });
        let mut pty = Pty::new()?;
        if let Some(link) = &args.link {
            pty.link(link)?;
        }
        Ok(Server {
            anchor: (Instant::now(), emulated.cycle()),
            heat: Heat::of(&mut emulated),
            board: emulated,
            pty,
            speed: args.speed,
            peer: Peer::Closed,
            rests: false,
            opened: Vec::new(),
        })
    }

    /// Does one turn: reads from the sender, runs the board, carries bytes both ways.
    fn turn(&mut self) -> Result<()> {
        let peer = wait(&self.pty, self.rests && self.speed == Speed::Max)?;
        let totals = self.board.totals();
        self.rests = self.board.waiting() == 0;
        let is_open = peer == Peer::Open;
        if peer != self.peer {
            self.peer = peer;
            if is_open {
                self.opened = steps(&self.board);
            }
            self.board.session(Talks { open: is_open, reads: true });
        }
        if is_open && self.board.waiting() < BACKLOG {
            let bytes = self.pty.read()?;
            self.rests &= bytes.is_empty();
            self.board.send_to(USB, &bytes);
        }
        let until = self.until();
        self.heat.run_until(&mut self.board, until)?;
        let answer = self.board.receive_from(USB);
        self.rests &= answer.is_empty() && self.board.totals() == totals;
        match is_open {
            true => self.pty.write(&answer)?,
            false => self.pty.discard(),
        }
        if !is_open || self.speed != Speed::Max {
            std::thread::sleep(TICK);
        }
        Ok(())
    }

    /// Returns the cycle to run to: the one that corresponds to the present time. For a board that lags far behind it
    /// is earlier.
    fn until(&mut self) -> u64 {
        let now = self.board.cycle();
        let Speed::Times(factor) = self.speed else { return now + self.board.cycles(SLICE_MS) };
        let hz = f64::from(self.board.board().clock_hz) * factor;
        let target = self.anchor.1 + (self.anchor.0.elapsed().as_secs_f64() * hz) as u64;
        let most = now + (MAX_LAG.as_secs_f64() * hz) as u64;
        if target > most {
            self.anchor = (Instant::now(), most);
        }
        target.min(most)
    }

    /// Prints the final positions of the last sender's job. Returns whether they are exact.
    fn has_arrived(&mut self, job: &Path) -> Result<bool> {
        let arrival = Arrival::of_emulated(&mut self.board, &self.opened, job)?;
        print!("{arrival}");
        Ok(arrival.is_exact())
    }

    fn summary(&self) -> String {
        let cycles = self.board.cycle() as f64;
        let busy = 100.0 * (1.0 - self.board.asleep() / cycles);
        let seconds = cycles / f64::from(self.board.board().clock_hz);
        let mut text = format!("\n{seconds:.3} s of the board's time, CPU {busy:.0} % busy\n");
        for (m, (position, steps)) in steps(&self.board).into_iter().enumerate() {
            let motor = m + 1;
            text += &format!("motor {motor}  position {position:>10}  steps {steps:>10}\n");
        }
        text
    }
}
