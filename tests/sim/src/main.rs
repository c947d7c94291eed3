//! `kerf-sim`: runs the firmware on a simulated board.

mod arrival;
mod cli;
mod damage;
mod gdb;
mod measure;
mod run;
mod serve;

use std::process::ExitCode;

use clap::Parser;

use crate::cli::{Cli, Command};

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Run(args) => run::run(&args),
        Command::Serve(args) => serve::serve(&args),
        Command::Bench(args) => measure::bench(&args),
    };
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("kerf-sim: {error:#}");
            ExitCode::from(2)
        }
    }
}
