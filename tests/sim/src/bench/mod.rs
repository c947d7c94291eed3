//! What the firmware achieves, as one table beside other firmwares' figures.
//!
//! [`ROWS`] says what is measured, what others reach, what Kerf aims at and what it must not fall below;
//! [`Bed`] is the firmware on its board with settings like theirs. `kerf-sim bench` prints the table, and
//! the tests hold every row to its floor. All is counted in cycles and exactly repeatable.

mod beyond;
mod costs;
pub mod emulated;
mod jitter;
mod limits;
#[path = "../../../support/optimum.rs"]
mod optimum;
mod pauses;
mod places;
mod printing;
mod rates;
mod rows;
mod spirals;
mod table;
mod workload;

pub use spirals::{curve, ideal, spiral};

pub use rows::ROWS;
pub use table::{print, print_rows};
pub use workload::Bed;

use anyhow::{Result, ensure};

/// Which way is up.
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

/// A figure.
#[derive(Clone, PartialEq, Debug)]
pub struct Figure {
    /// In the unit of its row.
    pub value: f64,
    /// What else is to be said of it.
    pub note: String,
}

impl From<f64> for Figure {
    fn from(value: f64) -> Self {
        Figure { value, note: String::new() }
    }
}

/// A row of the table.
pub struct Row<B = Bed> {
    /// What it is asked for by.
    pub name: &'static str,
    /// What is measured.
    pub what: &'static str,
    /// In what.
    pub unit: &'static str,
    /// Decimals shown.
    pub decimals: usize,
    /// Which way is up.
    pub better: Better,
    /// What grbl-Mega, TinyG and Teacup reach.
    pub peers: [&'static str; 3],
    /// What Kerf aims at.
    pub target: Option<f64>,
    /// What it must not fall below, or rise above: raised when the firmware has become better.
    pub floor: Option<f64>,
    /// Measures it.
    pub measure: fn(&B) -> Result<Figure>,
}

impl<B> Row<B> {
    /// Measures the row, prints its figure, and insists on its floor, if it has one.
    pub fn keep_to_floor(&self, bed: &B) -> Result<()> {
        let figure = (self.measure)(bed)?;
        let said = format!("{}: {} {} ({})", self.what, figure.value, self.unit, figure.note);
        println!("{said}");
        let floor = self.floor.unwrap_or(figure.value);
        ensure!(self.better.reaches(figure.value, floor), "{said}, but the floor is {floor}");
        Ok(())
    }
}

/// The row of this name.
pub fn row(name: &str) -> Option<&'static Row> {
    ROWS.iter().find(|row| row.name == name)
}
