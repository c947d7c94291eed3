//! Step and direction signals as a VCD file, for GTKWave. For each motor it has the pins, and the velocity in steps a
//! second, which returns to 0 when no step has come for a while.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

use anyhow::{Context, Result};
use kerf::boards::MOTORS;
use vcd::{IdCode, TimescaleUnit, Value, Writer};

/// A motor that makes no step for so long stands still, ms.
const STILL_MS: u64 = 200;

struct Signals {
    step: IdCode,
    dir: IdCode,
    velocity: IdCode,
    /// Cycle of the last step, while the velocity is not 0.
    stepped_at: Option<u64>,
}

/// A VCD file being written.
pub struct Trace {
    out: Writer<BufWriter<File>>,
    signals: Vec<Signals>,
    clock_hz: u32,
    /// Cycle that is time 0 in the file.
    origin: u64,
    stamped: Option<u64>,
    error: Option<io::Error>,
}

impl Trace {
    /// Creates the file; its time 0 is cycle `origin`.
    pub fn create(path: &Path, clock_hz: u32, origin: u64) -> Result<Self> {
        Self::start(path, clock_hz, origin)
            .with_context(|| format!("cannot write {}", path.display()))
    }

    fn start(path: &Path, clock_hz: u32, origin: u64) -> io::Result<Self> {
        let mut out = Writer::new(BufWriter::new(File::create(path)?));
        out.timescale(100, TimescaleUnit::PS)?;
        out.add_module("motors")?;
        let mut signals = Vec::with_capacity(MOTORS);
        for n in 1..=MOTORS {
            let step = out.add_wire(1, &format!("step{n}"))?;
            let dir = out.add_wire(1, &format!("dir{n}"))?;
            let name = format!("velocity{n}");
            let velocity = out.add_var(vcd::VarType::Real, 64, &name, None)?;
            signals.push(Signals { step, dir, velocity, stepped_at: None });
        }
        out.upscope()?;
        out.enddefinitions()?;
        out.begin(vcd::SimulationCommand::Dumpvars)?;
        for s in &signals {
            out.change_scalar(s.step, Value::V0)?;
            out.change_scalar(s.dir, Value::V0)?;
            out.change_real(s.velocity, 0.0)?;
        }
        out.end()?;
        Ok(Trace { out, signals, clock_hz, origin, stamped: None, error: None })
    }

    pub(crate) fn step(&mut self, motor: usize, high: bool, positive: bool, cycle: u64) {
        let r = self.try_step(motor, high, positive, cycle);
        self.note(r);
    }

    pub(crate) fn dir(&mut self, motor: usize, high: bool, cycle: u64) {
        let r = self.stamp(cycle);
        self.note(r);
        let r = self.out.change_scalar(self.signals[motor].dir, high);
        self.note(r);
    }

    fn try_step(&mut self, motor: usize, high: bool, positive: bool, cycle: u64) -> io::Result<()> {
        self.stamp(cycle)?;
        let s = &mut self.signals[motor];
        self.out.change_scalar(s.step, high)?;
        if !high {
            return Ok(());
        }
        if let Some(before) = s.stepped_at.replace(cycle) {
            let rate = f64::from(self.clock_hz) / (cycle - before).max(1) as f64;
            self.out.change_real(s.velocity, if positive { rate } else { -rate })?;
        }
        Ok(())
    }

    /// Writes the time. Before it, writes the velocity 0 of each motor that has come to rest since the last time.
    fn stamp(&mut self, cycle: u64) -> io::Result<()> {
        let still = u64::from(self.clock_hz) * STILL_MS / 1000;
        let due = |s: &Signals| s.stepped_at.map(|at| at + still).filter(|at| *at < cycle);
        while let Some((at, motor)) =
            (0..self.signals.len()).filter_map(|m| Some((due(&self.signals[m])?, m))).min()
        {
            self.write_time(at)?;
            self.signals[motor].stepped_at = None;
            self.out.change_real(self.signals[motor].velocity, 0.0)?;
        }
        self.write_time(cycle)
    }

    fn write_time(&mut self, cycle: u64) -> io::Result<()> {
        if self.stamped == Some(cycle) {
            return Ok(());
        }
        self.stamped = Some(cycle);
        let since = cycle.saturating_sub(self.origin);
        let units = u128::from(since) * 10_000_000_000 / u128::from(self.clock_hz);
        self.out.timestamp(units as u64)
    }

    fn note(&mut self, result: io::Result<()>) {
        if let Err(e) = result {
            self.error.get_or_insert(e);
        }
    }

    /// Ends the file, with all motors at rest. Reports any error that has occurred while writing.
    pub fn finish(mut self) -> Result<()> {
        let last = self.signals.iter().filter_map(|s| s.stepped_at).max();
        if let Some(last) = last {
            let end = last + u64::from(self.clock_hz) * STILL_MS / 1000 + 1;
            let r = self.stamp(end);
            self.note(r);
        }
        if let Some(e) = self.error.take() {
            return Err(e).context("cannot write the VCD file");
        }
        self.out.flush().context("cannot write the VCD file")
    }
}
