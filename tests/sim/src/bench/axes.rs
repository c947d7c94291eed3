//! What the motors are made to do in a corpus of jobs, computed from their pulses: the greatest acceleration and the
//! greatest jerk of an axis over its limit, the greatest distance of the tool from the programmed path, and the time.
//!
//! The machine is the router, with finer steps on X and Y. Its Z has a fifth of the acceleration of X and Y.

use anyhow::{Context, Result, ensure};

use super::Figure;
use super::corpus;
use super::programmed::{Path, Place};
use super::workload::{Bed, FAST_BAUD, How};
use crate::kinetics::{self, Greatest};
use crate::limits::{self, AxisLimits};
use crate::oracle::{AXES, Setup};
use crate::track::{self, Steps};

/// The router's profile. Steps of 1/320 mm, so that single steps are small beside the limits.
pub const ROUTER: [&str; 4] = ["{mch:1}", "{1:{tr:5}}", "{2:{tr:5}}", "{4:{tr:5}}"];

const AXIS_NAMES: [char; AXES] = ['X', 'Y', 'Z', 'A', 'B', 'C'];

/// The measurements of a job.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The job.
    pub name: &'static str,
    /// The greatest acceleration.
    pub acceleration: Greatest,
    /// The greatest jerk.
    pub jerk: Greatest,
    /// The greatest distance from the path, um.
    pub off: f64,
    /// From the first step to the last, s.
    pub seconds: f64,
}

impl Measured {
    /// Measures the steps of a job.
    pub fn of(
        name: &'static str,
        job: &str,
        steps: &Steps,
        setup: &Setup,
        limits: &AxisLimits,
    ) -> Result<Self> {
        let (first, last) = track::span(steps).context("nothing has moved")?;
        let positions = track::positions(steps, setup);
        let [acceleration, jerk] = kinetics::greatest(&positions, setup, limits);
        let places: Vec<Place> = positions.iter().map(|p| [p[0], p[1], p[2]]).collect();
        let off = 1e3 * Path::of(job)?.farthest(&places).0;
        Ok(Measured { name, acceleration, jerk, off, seconds: last - first })
    }
}

/// The greatest acceleration of an axis over its limit.
pub fn acceleration(bed: &Bed) -> Result<Figure> {
    Ok(acceleration_of(bed.corpus(measure)?))
}

/// The greatest jerk of an axis over its limit.
pub fn jerk(bed: &Bed) -> Result<Figure> {
    Ok(jerk_of(bed.corpus(measure)?))
}

/// The greatest distance of the tool from the programmed path, um.
pub fn off(bed: &Bed) -> Result<Figure> {
    Ok(off_of(bed.corpus(measure)?))
}

/// The time that all jobs take, s.
pub fn time(bed: &Bed) -> Result<Figure> {
    Ok(time_of(bed.corpus(measure)?))
}

/// As [`acceleration`], of jobs that have been measured.
pub fn acceleration_of(jobs: &[Measured]) -> Figure {
    over_limit(jobs, |job| job.acceleration)
}

/// As [`jerk`], of jobs that have been measured.
pub fn jerk_of(jobs: &[Measured]) -> Figure {
    over_limit(jobs, |job| job.jerk)
}

/// As [`off`], of jobs that have been measured.
pub fn off_of(jobs: &[Measured]) -> Figure {
    let value = jobs.iter().map(|job| job.off).fold(0.0, f64::max);
    Figure { value, note: each(jobs, |job| format!("{:.0}", job.off)) }
}

/// As [`time`], of jobs that have been measured.
pub fn time_of(jobs: &[Measured]) -> Figure {
    let value = jobs.iter().map(|job| job.seconds).sum();
    Figure { value, note: each(jobs, |job| format!("{:.2}", job.seconds)) }
}

fn over_limit(jobs: &[Measured], greatest: fn(&Measured) -> Greatest) -> Figure {
    let value = jobs.iter().map(|job| greatest(job).over).fold(0.0, f64::max);
    let told = |job: &Measured| {
        let of = greatest(job);
        format!("{:.2} {} at {:.2} s", of.over, AXIS_NAMES[of.axis], of.seconds)
    };
    Figure { value, note: each(jobs, told) }
}

/// Tells a value of each job.
fn each(jobs: &[Measured], value: impl Fn(&Measured) -> String) -> String {
    let told = jobs.iter().map(|job| format!("{} {}", job.name, value(job)));
    told.collect::<Vec<_>>().join(", ")
}

/// Runs all jobs.
fn measure(bed: &Bed) -> Result<Vec<Measured>> {
    let how = How { baud: FAST_BAUD, log: true, more: &ROUTER, ..How::default() };
    let measured = corpus::jobs().into_iter().map(|(name, job)| {
        let (mut machine, report) = bed.try_run(&job, how, Vec::new())?;
        ensure!(report.is_exact(), "{name}: {}", report.problems.join("; "));
        let limits = limits::of(&mut machine, &report.setup);
        Measured::of(name, &job, &track::steps(&machine), &report.setup, &limits)
    });
    measured.collect()
}
