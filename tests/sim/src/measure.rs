//! `kerf-sim bench`.

use std::io::stdout;

use anyhow::{Context, Result};
use kerf_sim::bench::{self, Bed, ROWS, Row};

use crate::cli::BenchArgs;
use crate::run::board;

/// Measures and prints the table. True when every row could be measured.
pub fn bench(args: &BenchArgs) -> Result<bool> {
    let rows: Vec<&Row> = match args.rows.is_empty() {
        true => ROWS.iter().collect(),
        false => args.rows.iter().map(|name| named(name)).collect::<Result<_>>()?,
    };
    let bed = Bed::new(&args.target.elf, board(&args.target.board)?)?;
    bench::print(&bed, &rows, &mut stdout().lock())
}

fn named(name: &str) -> Result<&'static Row> {
    bench::row(name).with_context(|| {
        let known: Vec<_> = ROWS.iter().map(|row| row.name).collect();
        format!("no row {name}; there are {}", known.join(", "))
    })
}
