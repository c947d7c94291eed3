//! What it costs to interpret a line, lexing included, in cycles of the chip.

mod common;

use common::image;
use kerf::boards::MEGA2560_GRBL;
use kerf_sim::job::{self, Options};
use kerf_sim::{Image, Machine, Stopwatch};

/// What a typical G1 line may cost.
const BUDGET: f64 = 6_000.0;
const REPEATS: usize = 20;

/// Cycles for one such line, mean of many. The lines before it set its modes.
fn cost(before: &[&str], line: &str) -> f64 {
    let elf = image(&MEGA2560_GRBL);
    let image = Image::read(&elf).unwrap();
    let run = |repeats: usize| {
        let mut machine = Machine::load(&elf, &MEGA2560_GRBL).unwrap();
        for (entry, name) in image.functions() {
            if ["State>::usual::", "Interpreter>::general::"].iter().any(|part| name.contains(part))
            {
                machine.add_stopwatch(Stopwatch::calls(*entry));
            }
        }
        assert_eq!(machine.stopwatches().len(), 2);
        let all = before.iter().copied().chain(std::iter::repeat_n(line, repeats));
        let lines = all.enumerate().map(|(i, line)| (i + 1, line.into())).collect();
        job::run(&mut machine, &lines, &Options::default(), |_| {}).unwrap();
        machine.stopwatches().iter().map(|watch| watch.cost().sum).sum::<u64>()
    };
    (run(REPEATS + 1) - run(1)) as f64 / REPEATS as f64
}

#[test]
fn typical_g1_lines_keep_to_the_budget() {
    let mut worst = 0.0f64;
    for (before, line) in [
        (&[][..], "G1 X12.345 Y-3.21 F1500"),
        (&[], "N120 G01 X10.5 Y2.25 Z-.5 F800"),
        (&["F800", "G1"], "X10.375"),
        (&["F800"], "G1 X1.25 Y2.5 (roughing)"),
        (&["G91", "F800"], "G1 X.25 Y-.125"),
        (&["G20", "F30"], "G1 X0.5 Y0.25"),
    ] {
        let cycles = cost(before, line);
        println!("{cycles:7.0} cycles: {} {line}", before.join(" "));
        worst = worst.max(cycles);
    }
    assert!(worst <= BUDGET, "{worst} cycles");
}
