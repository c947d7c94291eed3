//! Step and direction signals as a VCD file, for GTKWave.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

use anyhow::{Context, Result};
use kerf::boards::MOTORS;
use vcd::{IdCode, TimescaleUnit, Value, Writer};

struct Signals {
    step: IdCode,
    dir: IdCode,
    speed: IdCode,
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
            let speed = out.add_var(vcd::VarType::Real, 64, &format!("speed{n}"), None)?;
            signals.push(Signals { step, dir, speed, stepped_at: None });
        }
        out.upscope()?;
        out.enddefinitions()?;
        out.begin(vcd::SimulationCommand::Dumpvars)?;
        for s in &signals {
            out.change_scalar(s.step, Value::V0)?;
            out.change_scalar(s.dir, Value::V0)?;
            out.change_real(s.speed, 0.0)?;
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
            self.out.change_real(s.speed, if positive { rate } else { -rate })?;
        }
        Ok(())
    }

    fn stamp(&mut self, cycle: u64) -> io::Result<()> {
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

    /// Ends the file; any error on the way is reported here.
    pub fn finish(mut self) -> Result<()> {
        if let Some(e) = self.error.take() {
            return Err(e).context("cannot write the VCD file");
        }
        self.out.flush().context("cannot write the VCD file")
    }
}
