//! Measures what exec takes for a segment of a job, the longest segment, and each call of some functions.
//! `KERF_CALLS` lists the ends of their names, separated by commas: `cargo run -p kerf-sim --example laps -- ELF
//! BOARD JOB [SETTING...]`.

use std::path::Path;

use anyhow::{Context, Result};
use kerf_sim::job::{self, Options};
use kerf_sim::{Image, Machine, Stopwatch};

/// The interrupt that exec runs in.
const EXEC: u8 = 52;

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
            machine.add_stopwatch(Stopwatch::laps(EXEC, *entry));
        }
    }
    let wanted = std::env::var("KERF_CALLS").unwrap_or_default();
    let wanted: Vec<_> = wanted.split(',').filter(|name| !name.is_empty()).collect();
    let plain = |name: &str| name.split("::<").next().unwrap_or(name).to_string();
    let mut names = Vec::new();
    for (entry, name) in image.functions() {
        if wanted.iter().any(|end| plain(name).ends_with(end)) {
            machine.add_stopwatch(Stopwatch::calls_in(EXEC, *entry));
            names.push(plain(name));
        }
    }
    let lines = job::read_lines(Path::new(&path))?;
    let options = Options::with_settings(args);
    let report = job::run(&mut machine, &lines, &options, |_| {})?;
    let cost = machine.stopwatches()[0].cost();
    println!("{} segments, mean {:.0}, longest {}", cost.count, cost.mean(), cost.max);
    for (name, watch) in names.iter().zip(machine.stopwatches().iter().skip(1)) {
        let cost = watch.cost();
        println!("{:8} x {:7.0}, longest {:6}  {name}", cost.count, cost.mean(), cost.max);
    }
    println!("{report}");
    Ok(())
}
