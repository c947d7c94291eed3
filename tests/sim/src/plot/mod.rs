//! A picture of a job, made from the steps that the firmware emitted and not from what it planned: the
//! path, coloured by speed, and velocity, acceleration and jerk along the path over time.
//!
//! [`track`] turns steps into positions, [`smooth`] fits local cubics to the way they make, [`chart`]
//! draws. Distances are in millimetres; in degrees when only rotary axes move.

mod chart;
mod smooth;
mod track;

use std::fs;
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result};

use crate::machine::Machine;
use crate::oracle::Setup;

/// Width of the window that a cubic is fitted to, ms, unless asked otherwise: some ten segments of the
/// firmware, so that their steps in velocity do not show.
pub const WINDOW_MS: u32 = 60;

/// How to draw.
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
    /// Where the tool is in the plane of X and Y.
    pub path: Vec<(f64, f64)>,
    /// Units a second, along the path.
    pub velocity: Vec<f64>,
    /// Units a second squared.
    pub acceleration: Vec<f64>,
    /// Units a second cubed.
    pub jerk: Vec<f64>,
}

impl Motion {
    /// Of the steps that the machine's recorder has kept.
    pub fn of(machine: &Machine, setup: &Setup, window_ms: u32) -> Motion {
        let positions = track::positions(machine, setup);
        let curves = smooth::derivatives(&track::way(&positions), window_ms, track::SAMPLE_S);
        let path = positions.iter().map(|p| (p[0], p[1])).collect();
        let [velocity, acceleration, jerk] = curves;
        Motion { path, velocity, acceleration, jerk }
    }
}

/// Draws the steps that were kept into an SVG file. An error says that it cannot be written.
pub fn write(path: &Path, machine: &Machine, setup: &Setup, look: &Look) -> Result<()> {
    let motion = Motion::of(machine, setup, look.window_ms);
    let svg = chart::draw(&motion, look.span.clone())?;
    fs::write(path, svg).with_context(|| format!("cannot write {}", path.display()))
}
