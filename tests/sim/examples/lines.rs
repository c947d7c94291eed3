//! Measures what the lines of a job cost, and how long interrupts are off meanwhile: `cargo run -p kerf-sim --example
//! lines -- ELF BOARD BAUD JOB [SETTING...]`.
//!
//! Measures from the first line sent to the last one answered, so the cost of motion counts only as far as motion
//! happens during that time. `KERF_ADDRESSES=FILE` writes cycles by address, for a symbolizer.

use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, Result, bail};
use kerf_sim::{Host, Machine, job};

/// Longest time of a line of the job, ms of AVR time.
const LINE_MS: u64 = 10_000;
/// Time after which the settings are in the EEPROM, ms of AVR time.
const KEEPS_MS: u64 = 4_000;
/// Lines in flight: as many as the firmware has room for.
const IN_FLIGHT: usize = 8;

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let elf = args.next().context("which ELF?")?;
    let board = args.next().context("which board?")?;
    let baud: u32 = args.next().context("which baud rate?")?.parse()?;
    let path = args.next().context("which job?")?;
    let board = kerf::boards::by_name(&board).context("no such board")?;
    let mut machine = Machine::load(Path::new(&elf), board)?;
    let mut host = Host::new(IN_FLIGHT);
    host.boot(&mut machine, 5_000)?;
    host.change_speed(&mut machine, baud)?;
    for setting in args {
        host.ask(&mut machine, &setting, LINE_MS)?;
    }
    host.run_for_ms(&mut machine, KEEPS_MS)?;
    let lines = job::read_lines(Path::new(&path))?;
    for (number, line) in &lines {
        host.queue(*number, line);
    }
    machine.start_profile();
    machine.meters_mut().clear();
    machine.meters_mut().start_places();
    let began = machine.cycle();
    while !host.is_done() {
        let limit = machine.cycle() + machine.cycles(LINE_MS);
        if !host.run_until_line(&mut machine, limit)? {
            bail!("no answer to {:?}", host.oldest());
        }
        for line in host.take_answered() {
            let status = line.response.status;
            if status != 0 {
                bail!("line {}: status {status}", line.number);
            }
        }
    }
    print(&machine, lines.len(), machine.cycle() - began)
}

fn print(machine: &Machine, lines: usize, passed: u64) -> Result<()> {
    let per_line = |cycles: u64| cycles as f64 / lines as f64;
    println!("{:.0} lines a second", lines as f64 / machine.seconds(passed));
    let awake: u64 = machine.profile().iter().map(|(_, cycles)| cycles).sum();
    println!("{:8.0} cycles a line, {:.0} of them awake", per_line(passed), per_line(awake));
    for (function, cycles) in machine.profile().into_iter().take(45) {
        println!("{:8.0} {function}", per_line(cycles));
    }
    println!("interrupts off:");
    for window in machine.meters().places().iter().take(20) {
        println!("{:8} {}", window.cycles, machine.describe(window));
    }
    if let Ok(path) = std::env::var("KERF_ADDRESSES") {
        let mut text = String::new();
        for (address, cycles) in machine.profile_by_address() {
            writeln!(text, "{address:#x} {cycles}")?;
        }
        std::fs::write(path, text)?;
    }
    Ok(())
}
