//! Shows where the cycles of a job go, function by function: `cargo run -p kerf-sim --example profile -- ELF BOARD
//! JOB [SETTING...]`. `{baud:500000}` also counts as a setting.

use std::path::Path;

use anyhow::{Context, Result};
use kerf_sim::Machine;
use kerf_sim::job::{self, Options};

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let elf = args.next().context("which ELF?")?;
    let board = args.next().context("which board?")?;
    let path = args.next().context("which job?")?;
    let board = kerf::boards::by_name(&board).context("no such board")?;
    let mut machine = Machine::load(Path::new(&elf), board)?;
    machine.start_profile();
    let lines = job::read_lines(Path::new(&path))?;
    let options = Options::with_settings(args);
    let report = job::run(&mut machine, &lines, &options, |_| {})?;
    println!("{report}");
    let total = machine.cycle() as f64;
    for (function, cycles) in machine.profile().into_iter().take(150) {
        println!("{:6.2} %  {:>12}  {function}", cycles as f64 / total * 100.0, cycles);
    }
    Ok(())
}
