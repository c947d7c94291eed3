//! `cargo xtask settings save|load`: saves all that a machine stores to a file, and loads it back.

mod json;
mod port;
mod session;

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow};
use clap::{Args, Subcommand};

use json::Json;
use port::Port;

/// `cargo xtask settings`
#[derive(Args)]
pub struct SettingsArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Write all settings, offsets, tools and stored positions to a file
    Save(Place),
    /// Send them back, and check that they have arrived. The board restarts at the end: home it
    Load(Place),
}

#[derive(Args)]
struct Place {
    /// The board's serial port, such as /dev/ttyACM0. Opening it resets the board
    #[arg(long)]
    port: PathBuf,
    /// The file, in JSON: see docs/settings.schema.json
    file: PathBuf,
}

/// Saves or loads, as the arguments say.
pub fn run(args: &SettingsArgs) -> Result<ExitCode> {
    match &args.action {
        Action::Save(place) => save(place),
        Action::Load(place) => load(place),
    }
}

fn open(place: &Place) -> Result<Port> {
    eprintln!(
        "opening {}: a real board resets, and has to be homed afterwards",
        place.port.display()
    );
    Port::open(&place.port)
}

fn save(place: &Place) -> Result<ExitCode> {
    let all = session::save(&mut open(place)?).map_err(|error| anyhow!(error))?;
    fs::write(&place.file, format!("{all}\n"))
        .with_context(|| format!("cannot write {}", place.file.display()))?;
    println!("{} groups written to {}", all.members().len(), place.file.display());
    Ok(ExitCode::SUCCESS)
}

fn load(place: &Place) -> Result<ExitCode> {
    let name = place.file.display();
    let text = fs::read_to_string(&place.file).with_context(|| format!("cannot read {name}"))?;
    let file = Json::parse(&text).with_context(|| format!("{name} is no JSON"))?;
    let wrong = session::load(&mut open(place)?, &file).map_err(|error| anyhow!(error))?;
    wrong.iter().for_each(|what| println!("{what}"));
    match wrong.len() {
        0 => println!("all of {name} is on the machine; it has started anew: home it"),
        n => println!("{n} values are not as in {name}; the machine has started anew: home it"),
    }
    Ok(if wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
