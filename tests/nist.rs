//! Kerf's motions compared with those of another interpreter: `tests/nist`.

use std::fs;
use std::path::{Path, PathBuf};

use kerf::canon::Reader;
use kerf::gcode::setup::{AxisMode, Setup};
use kerf::units::Length;

use crate::differences::{DIFFERENCES, Difference, edited};
use crate::motion_text::MotionText;

/// Tolerance of coordinates, mm. The other interpreter's coordinates are exact to half of its last decimal in the
/// program's unit, and they are sums.
const MM: f64 = 0.000_101;
const INCH: f64 = 0.002;
/// Tolerance for sums of many offsets that are written in both units.
const SUMS: f64 = 0.01;

/// The machine of the other interpreter: the default one, but it executes lines with a slash.
struct Other;

impl Setup for Other {
    fn mode(&self, _axis: u8) -> AxisMode {
        AxisMode::Standard
    }
    fn radius(&self, _axis: u8) -> u32 {
        1
    }
    fn travel(&self, _axis: u8) -> Option<(Length, Length)> {
        None
    }
    fn deletes_blocks(&self) -> bool {
        false
    }
}

#[test]
fn motions_agree() {
    let mut programs = programs("tests/nist");
    programs.retain(|file| !file.file_name().unwrap().to_string_lossy().starts_with("own_"));
    assert!(programs.len() > 70);
    check(&programs, |program| if program.contains("G20") { INCH } else { MM });
}

/// `cargo xtask nist --random N` makes these programs.
#[test]
#[ignore = "needs programs that are made at random"]
fn random_motions_agree() {
    let programs = programs("target/nist/random");
    assert!(!programs.is_empty());
    check(&programs, |_| SUMS);
}

fn check(programs: &[PathBuf], slack: impl Fn(&str) -> f64) {
    let faults: Vec<_> = programs.iter().filter_map(|program| fault(program, &slack)).collect();
    assert!(faults.is_empty(), "{} differ:\n{}", faults.len(), faults.join("\n"));
}

/// Every difference belongs to a program that exists.
#[test]
fn differences_are_of_programs() {
    let programs = programs("tests/nist");
    for Difference { name, .. } in DIFFERENCES {
        assert!(programs.iter().any(|program| program.ends_with(format!("{name}.ngc"))), "{name}");
    }
}

/// Returns the programs in a folder of the repository.
fn programs(folder: &str) -> Vec<PathBuf> {
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut programs: Vec<_> =
        files.filter(|file| file.extension().is_some_and(|ending| ending == "ngc")).collect();
    programs.sort();
    programs
}

/// Returns how the motions of a program differ beyond the intended differences; `None` if they do not.
fn fault(file: &Path, slack: impl Fn(&str) -> f64) -> Option<String> {
    let name = file.file_stem()?.to_str()?;
    let mut program = fs::read_to_string(file).unwrap();
    let mut theirs = fs::read_to_string(file.with_extension("motion")).unwrap();
    if let Some(Difference { why, program: lines, motion, .. }) = Difference::of(name) {
        program = edited(program, lines, why);
        theirs = edited(theirs, motion, why);
    }
    let ours = match motion(&program) {
        Ok(motion) => motion,
        Err(refusal) => return Some(format!("{name}: {refusal}")),
    };
    let slack = slack(&program);
    let (ours, theirs) = (moves(&ours, slack), moves(&theirs, slack));
    let (mut ours, mut theirs) = (ours.into_iter(), theirs.into_iter());
    for number in 1.. {
        match (ours.next(), theirs.next()) {
            (None, None) => return None,
            (Some(our), Some(their)) if agree(our, their, slack) => {}
            (our, their) => {
                let [our, their] = [our, their].map(|line| line.unwrap_or("nothing"));
                return Some(format!("{name}: motion {number}\n    is {our}\n    of {their}"));
            }
        }
    }
    None
}

/// Returns the motion that Kerf makes of a program. After each line Kerf's state must agree with the motion.
fn motion(program: &str) -> Result<String, String> {
    let mut reader = Reader::new(Other);
    let mut motion = MotionText::default();
    for (number, line) in (1..).zip(program.lines()) {
        let read = reader.read(line.as_bytes());
        read.map_err(|status| format!("line {number}: {status:?}: {line}"))?;
        for command in &mut reader {
            motion.take(&command);
        }
        motion.check(reader.interpreter());
    }
    Ok(motion.text)
}

/// Returns a motion without the straight moves that rounding alone has made.
fn moves(motion: &str, slack: f64) -> Vec<&str> {
    let mut place = "0.0000 0.0000 0.0000 0.0000 0.0000 0.0000";
    let mut moves = Vec::new();
    for line in motion.lines() {
        let straight = line.strip_prefix("TRAVERSE ").or(line.strip_prefix("FEED "));
        if !straight.is_some_and(|to| agree(to, place, slack)) {
            moves.push(line);
        }
        place = straight.or_else(|| end(line)).unwrap_or(place);
    }
    moves
}

/// Returns the end of a probing move or an arc, without its plane and centre.
fn end(line: &str) -> Option<&str> {
    if let Some(end) = line.strip_prefix("PROBE ") {
        return Some(end);
    }
    let arc = line.strip_prefix("ARC ")?.split_once(' ')?.1;
    let (last, _) = arc.match_indices(' ').nth(5)?;
    arc.get(..last)
}

/// Whether two lines agree, with numbers within `slack`.
fn agree(our: &str, their: &str, slack: f64) -> bool {
    let (mut our, mut their) = (our.split(' '), their.split(' '));
    loop {
        match (our.next(), their.next()) {
            (None, None) => return true,
            (Some(our), Some(their)) if our == their => {}
            (Some(our), Some(their)) if our.contains('.') => {
                match (our.parse::<f64>(), their.parse::<f64>()) {
                    (Ok(our), Ok(their)) if (our - their).abs() <= slack => {}
                    _ => return false,
                }
            }
            _ => return false,
        }
    }
}
