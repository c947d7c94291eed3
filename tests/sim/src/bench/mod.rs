//! The benchmark: figures of Kerf in one table with those of other firmwares.
//!
//! [`ROWS`] lists the measurements, with the figures of others, Kerf's target, and Kerf's floor. [`Bed`] is the
//! firmware on its board, with settings like those of the other firmwares. `kerf-sim bench` prints the table, and the
//! tests hold every row to its floor. All figures are counted in cycles and exactly repeatable.

mod axes;
mod beyond;
mod corpus;
mod costs;
pub mod emulated;
mod jitter;
mod limits;
#[path = "../../../support/optimum.rs"]
mod optimum;
mod pauses;
mod printing;
mod programmed;
mod rates;
mod ringing;
mod rows;
mod spirals;
mod table;
mod workload;

pub use spirals::{curve, ideal, spiral};

pub use rows::ROWS;
pub use table::{print, print_rows};
pub use workload::Bed;

use anyhow::{Result, ensure};

/// Which direction is better.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Better {
    /// Higher is better.
    Higher,
    /// Lower is better.
    Lower,
}

impl Better {
    /// Whether `value` is as good as `limit`.
    pub fn reaches(self, value: f64, limit: f64) -> bool {
        match self {
            Better::Higher => value >= limit,
            Better::Lower => value <= limit,
        }
    }
}

/// A measured figure.
#[derive(Clone, PartialEq, Debug)]
pub struct Figure {
    /// The value, in the unit of its row.
    pub value: f64,
    /// A remark on the value; may be empty.
    pub note: String,
}

impl From<f64> for Figure {
    fn from(value: f64) -> Self {
        Figure { value, note: String::new() }
    }
}

/// A row of the table.
pub struct Row<B = Bed> {
    /// The name that selects the row.
    pub name: &'static str,
    /// What is measured.
    pub what: &'static str,
    /// The unit of the value.
    pub unit: &'static str,
    /// Decimals shown.
    pub decimals: usize,
    /// Which direction is better.
    pub better: Better,
    /// The figures of grbl-Mega, TinyG and Teacup.
    pub peers: [&'static str; 3],
    /// The value that Kerf aims at.
    pub target: Option<f64>,
    /// The value that Kerf must not fall below, or must not rise above if lower is better. It is tightened when the
    /// firmware has become better.
    pub floor: Option<f64>,
    /// Measures the value.
    pub measure: fn(&B) -> Result<Figure>,
}

impl<B> Row<B> {
    /// Measures the row and prints its figure. An error if the figure misses the floor of the row.
    pub fn keep_to_floor(&self, bed: &B) -> Result<()> {
        let figure = (self.measure)(bed)?;
        let said = format!("{}: {} {} ({})", self.what, figure.value, self.unit, figure.note);
        println!("{said}");
        let floor = self.floor.unwrap_or(figure.value);
        ensure!(self.better.reaches(figure.value, floor), "{said}, but the floor is {floor}");
        Ok(())
    }
}

/// Returns the row of this name.
pub fn row(name: &str) -> Option<&'static Row> {
    ROWS.iter().find(|row| row.name == name)
}
