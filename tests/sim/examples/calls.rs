//! Measures what calls of functions cost, with all that they call and without interrupts: `cargo run -p kerf-sim
//! --example calls -- ELF BOARD JOB PATTERNS [SETTING...]`.
//!
//! PATTERNS are parts of function names, separated by commas. Only calls from thread code count.

use std::path::Path;

use anyhow::{Context, Result};
use kerf_sim::job::{self, Options};
use kerf_sim::{Image, Machine, Stopwatch};

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let elf = args.next().context("which ELF?")?;
    let board = args.next().context("which board?")?;
    let path = args.next().context("which job?")?;
    let patterns = args.next().context("which functions?")?;
    let board = kerf::boards::by_name(&board).context("no such board")?;
    let image = Image::read(Path::new(&elf))?;
    let mut machine = Machine::load(Path::new(&elf), board)?;
    let mut names = Vec::new();
    for (entry, name) in image.functions() {
        if patterns.split(',').any(|pattern| name.contains(pattern)) {
            machine.add_stopwatch(Stopwatch::calls(*entry));
            names.push(name.clone());
        }
    }
    let lines = job::read_lines(Path::new(&path))?;
    let options = Options::with_settings(args);
    job::run(&mut machine, &lines, &options, |_| {})?;
    println!("    count      mean       max  a line");
    for (name, stopwatch) in names.iter().zip(machine.stopwatches()) {
        let cost = stopwatch.cost();
        let line = cost.sum as f64 / lines.len() as f64;
        if cost.count > 0 {
            println!("{:9} {:9.0} {:9} {line:7.0}  {name}", cost.count, cost.mean(), cost.max);
        }
    }
    Ok(())
}
