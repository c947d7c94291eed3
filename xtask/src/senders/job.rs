//! The job of printing hosts: up to 2,000 short moves, each relative to the one before. A line that is executed twice, or
//! not at all, shows in the end position.

use std::fmt::Write;

/// Number of moves in the job.
pub const MOVES: u32 = 2_000;
/// Number of moves in a short job. A host has more lines than any buffer on the way holds.
pub const BRIEF: u32 = 600;
/// Distance from its middle at which the job turns back, thousandths of a mm.
const FAR: i32 = 15_000;
/// One in this many moves is a travel, with the filament retracted.
const TRAVEL_EVERY: u32 = 50;

const START: &str = "\
; moves, each from where the one before ends
M104 S190
M109 S190
G21
G91 ; relative, the extruder too
G1 Z0.3 F300
";

const END: &str = "\
M104 S0
M107
G90
";

/// Returns the text of a file with so many moves.
pub fn prints(moves: u32) -> String {
    let mut text = START.to_owned();
    let (mut at, mut random) = ([0; 2], 21u32);
    for n in 0..moves {
        let mut below = |end: u32| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((random >> 16) % end) as i32
        };
        let way = at.map(|at: i32| {
            let way = 150 + below(600);
            if at > FAR || (at > -FAR && below(2) == 0) { -way } else { way }
        });
        let [x, y] = way.map(|way| f64::from(way) / 1e3);
        at = [at[0] + way[0], at[1] + way[1]];
        if n % TRAVEL_EVERY == 0 {
            let _ = writeln!(text, "G1 E-0.8 F2100\nG0 X{x:.3} Y{y:.3} F6000\nG1 E0.8 F2100");
        } else {
            let feed = 1_200 + 60 * below(40);
            let e = f64::from(10 + below(20)) / 1e3;
            let _ = writeln!(text, "G1 X{x:.3} Y{y:.3} E{e:.3} F{feed}");
        }
    }
    text.push_str(END);
    text
}

#[cfg(test)]
mod tests {
    use super::{MOVES, prints};

    #[test]
    fn it_is_long_and_stays_near() {
        let job = prints(MOVES);
        assert!(job.lines().count() > 2_000);
        let mut at = [0.0; 2];
        for line in job.lines() {
            for word in line.split(' ') {
                let (letter, number) = word.split_at(word.len().min(1));
                let axis = ["X", "Y"].iter().position(|axis| *axis == letter);
                if let Some(axis) = axis {
                    at[axis] += number.parse::<f64>().unwrap();
                    assert!(at[axis].abs() < 17.0, "{at:?}");
                }
            }
        }
        assert!(at != [0.0; 2]);
    }
}
