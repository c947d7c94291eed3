//! The job that Kerf runs: short lines and arcs, relative, within 10 mm of the start. Every length is a whole number of
//! hundredths of a millimetre.

use crate::dialect::AXES;

/// A job, and where it is when its lines so far have been executed.
#[derive(Clone, Debug)]
pub struct Job {
    /// Its lines.
    pub lines: Vec<String>,
    /// The distance from the start, mm.
    pub at: [f64; AXES],
}

/// Number of rounds, each of three lines and two arcs.
const ROUNDS: i64 = 12;

/// Returns a job that ends some millimetres off its start, and the one that goes back.
pub fn out_and_back() -> [Job; 2] {
    let mut at = [0i64; AXES];
    let mut lines = Vec::new();
    for n in 0..ROUNDS {
        for by in [[13 + n, 7, 0], [-5, 11 + n % 3, 9], [3, -4 - n % 5, 21]] {
            lines.push(format!("G1 F600 X{} Y{} Z{}", mm(by[0]), mm(by[1]), mm(by[2])));
            at.iter_mut().zip(by).for_each(|(at, by)| *at += by);
        }
        // Half a circle there, and the other half back.
        lines.push("G2 F600 X1 Y0 I0.5 J0".into());
        lines.push("G2 F600 X-1 Y0 I-0.5 J0".into());
    }
    let [x, y, z] = at.map(|at| mm(-at));
    let at = at.map(|at| at as f64 / 100.0);
    let back = Job { lines: vec![format!("G1 F600 X{x} Y{y} Z{z}")], at: [0.0; AXES] };
    [Job { lines, at }, back]
}

/// Hundredths as millimetres.
fn mm(hundredths: i64) -> String {
    let sign = if hundredths < 0 { "-" } else { "" };
    let size = hundredths.unsigned_abs();
    format!("{sign}{}.{:02}", size / 100, size % 100)
}

/// Whether a number of steps is that of a length. A length that is no whole number of steps is rounded.
pub fn is_exact(steps: f64, mm: f64, scale: f64) -> bool {
    (steps - mm * scale).abs() <= 0.5 + 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_job_stays_near_its_start() {
        let [out, back] = out_and_back();
        assert!(out.at.iter().all(|at| (1.0..10.0).contains(at)), "{:?}", out.at);
        assert_eq!(back.lines.len(), 1);
        assert_eq!([mm(-7), mm(0), mm(1_234)], ["-0.07", "0.00", "12.34"]);
    }

    #[test]
    fn a_step_more_is_not_exact() {
        assert!(
            is_exact(1_280.0, 1.0, 1_280.0) && is_exact(2.0, 1.0, 2.5) && is_exact(3.0, 1.0, 2.5)
        );
        assert!(!is_exact(1_281.0, 1.0, 1_280.0) && !is_exact(4.0, 1.0, 2.5));
    }
}
