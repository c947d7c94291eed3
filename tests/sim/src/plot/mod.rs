//! A picture of a job, made from the steps that the firmware emitted and not from what it planned. It shows the path,
//! coloured by speed, and velocity, acceleration and jerk along the path over time.
//!
//! [`track`] turns steps into positions, [`smooth`] fits local cubics to the distance along the path, [`chart`]
//! draws. Distances are in millimetres; in degrees when only rotary axes move.

mod chart;
mod smooth;
mod track;

pub use track::{Position, SAMPLE_S, positions};

use std::fs;
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result};

use crate::machine::Machine;
use crate::oracle::Setup;
use crate::thermal::{BED, HOT_END, Sample};
use crate::threads::Threads;

/// Indices of X and Y among the axes.
const X: usize = 0;
const Y: usize = 1;
const Z: usize = 2;

/// Default width of the window that a cubic is fitted to, ms. It covers some ten segments of the firmware, so that
/// their steps in velocity do not show.
pub const WINDOW_MS: u32 = 60;

/// How to draw a picture.
#[derive(Clone, Debug)]
pub struct Look {
    /// The time that the curves show, s from the first step; all of it if `None`.
    pub span: Option<Range<f64>>,
    /// Width of the window of the fit, ms.
    pub window_ms: u32,
}

impl Default for Look {
    fn default() -> Self {
        Look { span: None, window_ms: WINDOW_MS }
    }
}

/// The job as it was carried out, sampled each millisecond.
#[derive(Clone, Default, Debug)]
pub struct Motion {
    /// Positions of the tool in the plane of X and Y; on a machine without Y, in the plane of Z and X.
    pub path: Vec<(f64, f64)>,
    /// The names of the plane's axes.
    pub plane: [char; 2],
    /// Units a second, along the path.
    pub velocity: Vec<f64>,
    /// Units a second squared.
    pub acceleration: Vec<f64>,
    /// Units a second cubed.
    pub jerk: Vec<f64>,
}

impl Motion {
    /// The motion that the logged steps of the machine's recorder make.
    pub fn of(machine: &Machine, setup: &Setup, window_ms: u32) -> Motion {
        let positions = track::positions(machine, setup);
        let curves = smooth::derivatives(&track::way(&positions), window_ms, track::SAMPLE_S);
        let turns = setup.motors.iter().all(|motor| motor.axis != Y);
        let (across, up) = if turns { (Z, X) } else { (X, Y) };
        let plane = [across, up].map(|axis| ['X', 'Y', 'Z'][axis]);
        let path = positions.iter().map(|p| (p[across], p[up])).collect();
        let [velocity, acceleration, jerk] = curves;
        Motion { path, plane, velocity, acceleration, jerk }
    }
}

/// Returns the temperatures of each heater over time; empty if there are no heaters.
fn temperatures(machine: &Machine) -> Vec<chart::Points> {
    let Some(thermal) = machine.thermal() else { return Vec::new() };
    let of = |heater: usize| {
        let point = |s: &Sample| (machine.seconds(s.cycle), s.degrees[heater]);
        thermal.samples().iter().map(point).collect()
    };
    [HOT_END, BED].map(of).to_vec()
}

/// Draws the logged steps into an SVG file. An error says that the file cannot be written.
///
/// The picture also shows the error of threads over their length, each pass in its own colour, and the temperatures
/// of heaters.
pub fn write(
    path: &Path,
    machine: &Machine,
    setup: &Setup,
    look: &Look,
    threads: Option<&Threads>,
) -> Result<()> {
    let motion = Motion::of(machine, setup, look.window_ms);
    let threads = threads.map_or(&[][..], |of| &of.errors);
    let svg = chart::draw(&motion, look.span.clone(), threads, &temperatures(machine))?;
    fs::write(path, svg).with_context(|| format!("cannot write {}", path.display()))
}
