//! What exec takes for a segment of a job, and the longest: `cargo run --profile sim -p kerf-sim --example laps -- ELF BOARD JOB [SETTING...]`.

use std::path::Path;

use anyhow::{Context, Result};
use kerf_sim::job::{self, Options};
use kerf_sim::{Image, Machine, Stopwatch};

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let elf = args.next().context("which ELF?")?;
    let board = args.next().context("which board?")?;
    let path = args.next().context("which job?")?;
    let board = kerf::boards::by_name(&board).context("no such board")?;
    let image = Image::read(Path::new(&elf))?;
    let mut machine = Machine::load(Path::new(&elf), board)?;
    for (entry, name) in image.functions() {
        if name.contains("stepper::go") {
            machine.add_stopwatch(Stopwatch::laps(52, *entry));
        }
    }
    let lines = job::read_lines(Path::new(&path))?;
    let options = Options { settings: args.collect(), ..Options::default() };
    let report = job::run(&mut machine, &lines, &options, |_| {})?;
    let cost = machine.stopwatches()[0].cost();
    println!("{} segments, mean {:.0}, longest {}", cost.count, cost.mean(), cost.max);
    println!("{report}");
    Ok(())
}
