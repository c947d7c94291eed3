//! The example print, on the chip with heaters around it: hot first, exact to the step, cold at the end.

use std::fs;
use std::path::Path;

use kerf::boards::{MEGA2560_GRBL, RAMPS14};
use kerf_sim::job::{self, Lines, Options};
use kerf_sim::limits;
use kerf_sim::plot::{self, Look};
use kerf_sim::print;

use crate::common::{firmware, scratch};

fn example() -> Lines {
    job::read_lines(Path::new("../../../examples/print.gcode")).unwrap()
}

#[test]
fn the_example_is_printed_exact_to_the_step() {
    let mut machine = firmware(&RAMPS14);
    let report = print::run(&mut machine, &example(), &Options::default(), |_| {}).unwrap();
    print!("{report}");
    assert!(report.ok, "{report}");
    let [hot_end, bed] = &report.heat[..] else { panic!("two heaters") };
    assert!(hot_end.peak < 202.0 && bed.peak < 62.0);
    let (low, high) = hot_end.held.unwrap();
    assert!(low > 198.0 && high < 202.0, "{low} to {high} degrees with the fan on");
    let (low, high) = bed.held.unwrap();
    assert!(low > 58.0 && high < 62.0, "{low} to {high} degrees of the bed");
    // The extruder made the steps of the filament, forward and back.
    assert!(report.motors[3].total > 5_000);
    assert!(report.free_stack.unwrap() >= 400);
    let file = scratch("print.svg");
    let limits = limits::of(&mut machine, &report.setup);
    plot::write(&file, &machine, &report.setup, &limits, &Look::default(), None).unwrap();
    let svg = fs::read_to_string(&file).unwrap();
    assert!(svg.contains("temperature, °C") && svg.len() < 1_000_000, "{} bytes", svg.len());
}

#[test]
fn a_line_that_is_refused_is_named() {
    let lines = job::lines_of("M302 P1\nM83\nG1 X5 E1 F3000\nG1 X6 E1 J5\nG1 X7 E1");
    let mut machine = firmware(&RAMPS14);
    let report = print::run(&mut machine, &lines, &Options::default(), |_| {}).unwrap();
    assert!(!report.ok);
    assert_eq!(report.rejected.len(), 1, "{report}");
    assert_eq!(report.rejected[0].line, 4);
    // The line was not executed, but the file asks for its filament.
    let extruder = &report.motors[3];
    assert_ne!(Some(extruder.steps), extruder.expected);
}

#[test]
fn cold_filament_is_a_refusal() {
    let lines = job::lines_of("M83\nG1 X5 E1 F3000");
    let mut machine = firmware(&RAMPS14);
    let report = print::run(&mut machine, &lines, &Options::default(), |_| {}).unwrap();
    assert_eq!(report.rejected.len(), 1, "{report}");
    assert_eq!((report.rejected[0].line, report.motors[3].total), (2, 0), "{report}");
}

#[test]
fn what_a_printer_is_asked_is_a_print() {
    let print = job::lines_of("M104 S200\nG1 X1 E1");
    let mill = job::lines_of("G21\nG1 X1 F100\nM3 S100");
    assert!(print::is_print(&RAMPS14, &print) && !print::is_print(&RAMPS14, &mill));
    assert!(!print::is_print(&MEGA2560_GRBL, &print));
}
