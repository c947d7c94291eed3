//! `kerf-sim bench`.

use std::io::stdout;

use anyhow::{Context, Result};
use kerf_sim::bench::emulated::{self, PicoBed};
use kerf_sim::bench::{self, Bed, ROWS, Row};
use kerf_sim::emulated::is_emulated;

use crate::cli::BenchArgs;
use crate::run::board;

/// Measures and prints the table. True when every row could be measured.
pub fn bench(args: &BenchArgs) -> Result<bool> {
    let board = board(&args.target.board)?;
    if is_emulated(board) {
        return bench_emulated(args);
    }
    let rows: Vec<&Row> = match args.rows.is_empty() {
        true => ROWS.iter().collect(),
        false => args.rows.iter().map(|name| named(name)).collect::<Result<_>>()?,
    };
    let bed = Bed::new(&args.target.elf, board)?;
    bench::print(&bed, &rows, &mut stdout().lock())
}

/// As [`bench`], of `pico`.
fn bench_emulated(args: &BenchArgs) -> Result<bool> {
    let known: Vec<_> = emulated::ROWS.iter().map(|row| row.name).collect();
    let asked: Vec<_> = match args.rows.is_empty() {
        true => known.clone(),
        false => args.rows.iter().map(String::as_str).collect(),
    };
    let found = asked.iter().map(|name| {
        emulated::named(name)
            .with_context(|| format!("no row {name}; there are {}", known.join(", ")))
    });
    let rows = found.collect::<Result<Vec<_>>>()?;
    bench::print_rows(&PicoBed::new(&args.target.elf), &rows, &mut stdout().lock())
}

fn named(name: &str) -> Result<&'static Row> {
    bench::row(name).with_context(|| {
        let known: Vec<_> = ROWS.iter().map(|row| row.name).collect();
        format!("no row {name}; there are {}", known.join(", "))
    })
}
