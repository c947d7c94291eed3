//! The cost of interpreting a line, lexing included, and of finding a row of the tables, in cycles of the chip.

use kerf::boards::MEGA2560_GRBL;
use kerf::store::record::{self, Record};
use kerf_sim::job::{self, Options};
use kerf_sim::{Image, Machine, Stopwatch};

use crate::common::image;

/// Most cycles for a typical G1 line.
// Shared ends of its functions take 60 cycles of that, because flash is full. Names behind a percent sign, byte order
// marks and comments within comments take 100 more on the slow path. The slowest line takes 6,170 to 6,210, depending on
// what the optimizer shares.
const BUDGET: f64 = 6_300.0;
const REPEATS: usize = 20;

/// Returns the mean cycles for a line. The lines before it set its modes.
fn cost(before: &[&str], line: &str) -> f64 {
    let elf = image(&MEGA2560_GRBL);
    let image = Image::read(&elf).unwrap();
    let run = |repeats: usize| {
        let mut machine = Machine::load(&elf, &MEGA2560_GRBL).unwrap();
        for (entry, name) in image.functions() {
            if ["State>::fast_path::", ">::slow_path::"].iter().any(|part| name.contains(part)) {
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

#[test]
fn a_row_of_the_tables_is_found_in_time() {
    // The log is full, and none of its records is the one that is looked for, which makes the longest search.
    let mut eeprom = [0xFF; 4_096];
    for (number, slot) in (0u16..).zip(eeprom.chunks_exact_mut(record::SIZE.into())) {
        let key = number.wrapping_mul(40_503);
        slot.copy_from_slice(&Record { key, number, value: 7 }.bytes());
    }
    let elf = image(&MEGA2560_GRBL);
    let functions = Image::read(&elf).unwrap();
    let mut machine = Machine::load(&elf, &MEGA2560_GRBL).unwrap();
    machine.set_eeprom(&eeprom);
    for (entry, name) in functions.functions() {
        if name.contains("store::tables::row::") {
            machine.add_stopwatch(Stopwatch::calls(*entry));
        }
    }
    let lines = [(1, "G55".into()), (2, "G54".into())].into();
    job::run(&mut machine, &lines, &Options::default(), |_| {}).unwrap();
    let cost = machine.stopwatches()[0].cost();
    println!("{} searches, {} cycles at most", cost.count, cost.max);
    assert!(cost.count >= 2 && cost.max < 35_000, "{} cycles", cost.max);
}
