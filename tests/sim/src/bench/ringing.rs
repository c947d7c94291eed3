//! How much an axis rings behind its motor: a simulated load on a spring, moved by the recorded steps.
//!
//! X moves and stands still by turns. What is measured is the amplitude of the load, relative to the motor, at each end.

use std::f64::consts::TAU;

use crate::oracle::Setup;
use crate::track::{self, SAMPLE_S, Steps};

/// The resonance that the settings name, Hz.
pub const HERTZ: f64 = 45.0;
/// The damping ratio of the load.
const DAMPING: f64 = 0.1;
/// How far off the resonance of the load may be.
const NEAR: [f64; 5] = [0.8, 0.9, 1.0, 1.1, 1.2];
/// Parts of a sample in which the load is computed.
const PARTS: usize = 20;

/// Moves of 10,000 steps a mm, so that steps are small beside what is left of the ringing.
pub const SETTINGS: [&str; 4] = ["{mch:1}", "{1:{tr:0.16}}", "{xvm:1200}", "{xfr:1200}"];

/// The job: moves of several lengths, each behind a dwell.
pub fn job(mode: &str) -> String {
    let lengths = [1.0, 0.37, 0.05, 0.62, 0.11, 0.83, 0.21, 0.47];
    let moves = lengths.iter().map(|mm| format!("g1 x{mm} f900\ng4 p0.3\n"));
    format!("g21 g91 {mode}\n{}m2\n", moves.collect::<String>())
}

/// The greatest amplitude behind a stop, mm: at the resonance, and up to 20 % off.
#[derive(Clone, Copy, Debug)]
pub struct Amplitude {
    /// At the resonance.
    pub here: f64,
    /// Up to 20 % off.
    pub near: f64,
}

/// Measures the steps of the job.
pub fn amplitude(steps: &Steps, setup: &Setup) -> Amplitude {
    let x: Vec<f64> = track::positions(steps, setup).iter().map(|place| place[0]).collect();
    let all = NEAR.map(|off| greatest(&x, off * HERTZ));
    Amplitude { here: all[2], near: all.into_iter().fold(0.0, f64::max) }
}

/// Returns the greatest amplitude of a load with this resonance behind a stop.
fn greatest(x: &[f64], hertz: f64) -> f64 {
    let (own, free) = (TAU * hertz, TAU * hertz * (1.0 - DAMPING * DAMPING).sqrt());
    let step = SAMPLE_S / PARTS as f64;
    // The load relative to the motor, and its velocity against the ground.
    let (mut y, mut v) = (0.0f64, 0.0f64);
    let (mut most, mut stood) = (0.0f64, true);
    for pair in x.windows(2) {
        let motor = (pair[1] - pair[0]) / SAMPLE_S;
        for _ in 0..PARTS {
            v -= step * (own * own * y + 2.0 * DAMPING * own * (v - motor));
            y += step * (v - motor);
        }
        let stands = pair[0] == pair[1];
        if stands && !stood {
            most = most.max(y.hypot((v + DAMPING * own * y) / free));
        }
        stood = stands;
    }
    most
}
