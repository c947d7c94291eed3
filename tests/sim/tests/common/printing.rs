//! A printer on the chip, in the dialect of printing hosts.

use kerf::boards::Board;
use kerf_sim::oracle::Setup;
use kerf_sim::{Machine, by_name, job};

use super::firmware;

/// A machine that has started.
pub fn booted(board: &'static Board) -> Machine {
    let mut machine = firmware(board);
    by_name::boot(&mut machine).unwrap();
    machine
}

/// Sends a line that must be carried out, and waits for its `ok`.
pub fn take(machine: &mut Machine, line: &str) -> Vec<String> {
    by_name::ask(machine, line).unwrap()
}

/// Sets what `{xvm:1200}` sets in TinyG's dialect.
pub fn set(machine: &mut Machine, settings: &str) {
    by_name::set(machine, settings).unwrap();
}

/// Detects pauses from now on. The machine must stand still at the start of `lines`, whose filament is E.
pub fn meter_pauses(machine: &mut Machine, lines: &str, setup: &Setup) {
    let lines = job::lines_of(&lines.replace('E', "A"));
    job::meter_pauses(machine, &lines, setup);
}
