//! A picture of a job, made from the steps that the firmware emitted and not from what it planned. It shows the path,
//! coloured by speed, and velocity, acceleration and jerk of each axis over time, with the limits of the axis.
//!
//! [`track`] turns steps into positions, [`kinetics`] takes their differences, [`chart`] draws. Distances are in
//! millimetres, or degrees on rotary axes.

mod chart;

use std::fs;
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result};

use crate::kinetics::{self, Curves, Windows};
use crate::limits::{AxisLimits, Limits};
use crate::machine::Machine;
use crate::oracle::{AXES, Setup};
use crate::thermal::{BED, HOT_END, Sample};
use crate::threads::Threads;
use crate::track::{self, Position, SAMPLE_S};

/// Indices of axes.
const X: usize = 0;
const Y: usize = 1;
const Z: usize = 2;
/// The number of axes that are lengths, X Y Z.
const LINEAR: usize = 3;
const NAMES: [char; AXES] = ['X', 'Y', 'Z', 'A', 'B', 'C'];

/// Default time between positions that are compared, ms.
pub const WINDOW_MS: u32 = (kinetics::WINDOW_S * 1e3) as u32;

/// How to draw a picture.
#[derive(Clone, Debug)]
pub struct Look {
    /// The time that the curves show, s from the first step; all of it if `None`.
    pub span: Option<Range<f64>>,
    /// Time between positions that are compared, ms.
    pub window_ms: u32,
}

impl Default for Look {
    fn default() -> Self {
        Look { span: None, window_ms: WINDOW_MS }
    }
}

/// The motion of an axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Its letter.
    pub name: char,
    /// Its velocity, acceleration and jerk, one each millisecond.
    pub curves: Curves,
    /// Its limits.
    pub limits: Limits,
}

/// The job as it was carried out, sampled each millisecond.
#[derive(Clone, Default, Debug)]
pub struct Motion {
    /// Positions of the tool in the plane of X and Y; on a machine without Y, in the plane of Z and X.
    pub path: Vec<(f64, f64)>,
    /// The names of the plane's axes.
    pub plane: [char; 2],
    /// Units a second, along the path.
    pub speed: Vec<f64>,
    /// The axes that move.
    pub axes: Vec<Axis>,
    /// Time between positions that were compared, s.
    pub window_s: f64,
}

impl Motion {
    /// The motion that the logged steps of the machine's recorder make.
    pub fn of(machine: &Machine, setup: &Setup, limits: &AxisLimits, window_ms: u32) -> Motion {
        let positions = track::positions(&track::steps(machine), setup);
        let windows = Windows::new(SAMPLE_S, f64::from(window_ms) * 1e-3);
        let moving = (0..AXES).filter(|axis| kinetics::moves(&positions, *axis));
        let axis = |axis: usize| {
            let curves = kinetics::curves(&positions, axis, &windows);
            Axis { name: NAMES[axis], curves, limits: limits[axis] }
        };
        let turns = setup.motors.iter().all(|motor| motor.axis != Y);
        let (across, up) = if turns { (Z, X) } else { (X, Y) };
        let axes: Vec<Axis> = moving.map(axis).collect();
        Motion {
            path: positions.iter().map(|p| (p[across], p[up])).collect(),
            plane: [across, up].map(|axis| NAMES[axis]),
            speed: speed(&positions, &axes),
            axes,
            window_s: windows.seconds(),
        }
    }
}

/// Returns the velocity along the path: of the linear axes, or of the rotary axes if no linear axis ever moves.
fn speed(positions: &[Position], axes: &[Axis]) -> Vec<f64> {
    let is_linear = |axis: &&Axis| NAMES[..LINEAR].contains(&axis.name);
    let some = axes.iter().any(|axis| is_linear(&axis));
    let counted: Vec<_> = axes.iter().filter(|axis| is_linear(axis) == some).collect();
    let at = |n: usize| counted.iter().map(|axis| axis.curves.velocity[n].powi(2)).sum::<f64>();
    (0..positions.len()).map(|n| at(n).sqrt()).collect()
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
    limits: &AxisLimits,
    look: &Look,
    threads: Option<&Threads>,
) -> Result<()> {
    let motion = Motion::of(machine, setup, limits, look.window_ms);
    let threads = threads.map_or(&[][..], |of| &of.errors);
    let svg = chart::draw(&motion, look.span.clone(), threads, &temperatures(machine))?;
    fs::write(path, svg).with_context(|| format!("cannot write {}", path.display()))
}
