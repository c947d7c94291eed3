//! The encoder of a spindle on the chip: its speed, pulses that do not fit, and the cost of its interrupts.

use std::path::Path;

use kerf::boards::{Board, MEGA2560_LATHE};
use kerf_sim::job::{self, Options};
use kerf_sim::limits;
use kerf_sim::mechanics::{Bounce, Build, Sensors};
use kerf_sim::plot::{self, Look};
use kerf_sim::threads::Threads;
use kerf_sim::{Host, LINES_IN_FLIGHT, Machine};

use crate::common::share::share_of;
use crate::common::{firmware, scratch, set};

/// Longest time in which no tick is served outside the step interrupt, cycles.
const OFF: u64 = 42;

/// The exception that reports a lost spindle.
const LOST: u64 = 44;
/// Delay of the simulated encoder's edges behind the angle of its spindle, ms.
const EDGES_LATE_MS: u64 = 1;
/// The exception that reports pulses which do not fit.
const MISFIT: u64 = 40;

/// A board with a spindle that has this many marks and turns at this speed.
fn turning(
    board: &'static Board,
    marks: u32,
    rpm: f64,
    change: impl Fn(&mut Sensors),
) -> (Machine, Host) {
    let mut machine = firmware(board);
    let mut build = Build::of(board);
    // The sensors' pins must not be shared with switches.
    for axis in &mut build.axes {
        (axis.min, axis.max) = (None, None);
        (axis.travel, axis.start) = (f64::INFINITY, 0.0);
    }
    let mut sensors = Sensors::of(board, marks).unwrap();
    change(&mut sensors);
    build.spindle.sensors = Some(sensors);
    machine.build(&build);
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut machine, 1_000).unwrap();
    set(&mut machine, &mut host, &format!("{{spn:{marks}}}"));
    machine.tamper(|mechanics, now| mechanics.force_spindle(rpm, now));
    (machine, host)
}

/// Asks the machine for a number.
fn asked(machine: &mut Machine, host: &mut Host, name: &str) -> f64 {
    let raw = host.ask(machine, &format!("{{{name}:n}}"), 1_000).unwrap().raw;
    let (_, rest) = raw.split_once(&format!("\"{name}\":")).unwrap_or_else(|| panic!("{raw}"));
    rest.split(['}', ',']).next().unwrap().parse().unwrap()
}

#[test]
fn the_speed_is_that_of_a_turn() {
    for board in [&MEGA2560_LATHE] {
        for (marks, rpm) in
            [(1, 60.0), (1, 1_000.0), (4, 229.0), (8, 3_000.0), (100, 1_000.0), (100, -300.0)]
        {
            let (mut machine, mut host) = turning(board, marks, rpm, |_| {});
            host.run_for_ms(&mut machine, 3_500).unwrap();
            let measured = asked(&mut machine, &mut host, "sps");
            assert!((measured / rpm.abs() - 1.0).abs() < 0.001, "{marks} at {rpm}: {measured}");
            assert_eq!(asked(&mut machine, &mut host, "spx"), 0.0, "{marks} at {rpm}");
            let window = machine.meters().window_outside();
            assert!(
                window.cycles <= OFF,
                "{} cycles in {}",
                window.cycles,
                machine.describe(&window)
            );
        }
    }
}

#[test]
fn a_second_sensor_tells_the_direction() {
    for (marks, rpm) in [(8, 300.0), (8, -300.0), (100, 1_000.0), (100, -1_000.0), (400, -600.0)] {
        let (mut machine, mut host) = turning(&MEGA2560_LATHE, marks, rpm, |_| {});
        set(&mut machine, &mut host, "{spdi:1}");
        host.run_for_ms(&mut machine, 1_500).unwrap();
        let measured = asked(&mut machine, &mut host, "sps");
        assert!((measured / rpm - 1.0).abs() < 0.001, "{marks} at {rpm}: {measured}");
        // The spindle reverses, and is measured anew.
        machine.tamper(|mechanics, now| mechanics.force_spindle(-rpm, now));
        host.run_for_ms(&mut machine, 1_500).unwrap();
        let measured = asked(&mut machine, &mut host, "sps");
        assert!((measured / -rpm - 1.0).abs() < 0.001, "{marks} at {rpm}: {measured}");
        assert_eq!(asked(&mut machine, &mut host, "spx"), 0.0, "{marks} at {rpm}");
        let window = machine.meters().window_outside();
        assert!(window.cycles <= OFF, "{} cycles in {}", window.cycles, machine.describe(&window));
    }
}

#[test]
fn contacts_that_bounce_tell_the_direction_too() {
    let bounce = Some(Bounce { times: 3, cycles: 3_000 });
    for rpm in [300.0, -300.0] {
        let (mut machine, mut host) =
            turning(&MEGA2560_LATHE, 4, rpm, |sensors| sensors.bounce = bounce);
        set(&mut machine, &mut host, "{spb:500}");
        set(&mut machine, &mut host, "{spdi:1}");
        host.run_for_ms(&mut machine, 2_000).unwrap();
        let measured = asked(&mut machine, &mut host, "sps");
        assert!((measured / rpm - 1.0).abs() < 0.001, "{measured}");
        assert_eq!(asked(&mut machine, &mut host, "spx"), 0.0);
    }
}

#[test]
fn contacts_that_bounce_are_one_pulse_and_noise_is_none() {
    let bounce = Some(Bounce { times: 3, cycles: 3_000 });
    let (mut machine, mut host) =
        turning(&MEGA2560_LATHE, 4, 300.0, |sensors| sensors.bounce = bounce);
    set(&mut machine, &mut host, "{spb:500}");
    host.run_for_ms(&mut machine, 2_000).unwrap();
    // Spikes, each right behind an edge.
    let measured = asked(&mut machine, &mut host, "sps");
    assert!((measured / 300.0 - 1.0).abs() < 0.001, "{measured}");
    assert_eq!(asked(&mut machine, &mut host, "spx"), 0.0);
}

#[test]
fn pulses_that_are_missing_or_too_many_are_counted_and_the_first_is_told() {
    for (marks, index) in [(4, false), (8, false), (100, false), (8, true)] {
        let (mut machine, mut host) = turning(&MEGA2560_LATHE, marks, 600.0, |_| {});
        host.run_for_ms(&mut machine, 1_000).unwrap();
        machine.tamper(|mechanics, _| mechanics.encoder().unwrap().miss(index, 3));
        host.run_for_ms(&mut machine, 1_000).unwrap();
        let told = host.take_reports().iter().filter(|report| report["er"]["st"] == MISFIT).count();
        assert_eq!(told, 1, "{marks}");
        assert_eq!(asked(&mut machine, &mut host, "spx"), 1.0, "{marks}");
        if marks > 8 {
            // The spike might lie within another one.
            continue;
        }
        machine.tamper(|mechanics, now| {
            assert!(mechanics.encoder().unwrap().add(false, now + 40_000, 1_600));
        });
        host.run_for_ms(&mut machine, 1_000).unwrap();
        assert_eq!(asked(&mut machine, &mut host, "spx"), 2.0, "{marks}");
    }
}

#[test]
fn a_spindle_that_stops_is_told_within_half_a_second() {
    let (mut machine, mut host) = turning(&MEGA2560_LATHE, 4, 300.0, |_| {});
    host.run_for_ms(&mut machine, 1_000).unwrap();
    machine.tamper(|mechanics, now| mechanics.force_spindle(0.0, now));
    host.run_for_ms(&mut machine, 480).unwrap();
    assert!(asked(&mut machine, &mut host, "sps") > 0.0);
    host.run_for_ms(&mut machine, 60).unwrap();
    assert_eq!(asked(&mut machine, &mut host, "sps"), 0.0);
}

/// Steps of Z in a millimetre.
const STEPS: f64 = 200.0;
const Z: usize = 2;

/// A machine with 200 steps/mm on Z and 500 mm/s2, whose spindle turns.
fn lathe(marks: u32, rpm: f64, change: impl Fn(&mut Sensors)) -> (Machine, Host) {
    let (mut machine, mut host) = turning(&MEGA2560_LATHE, marks, rpm, change);
    for line in
        ["{3tr:4}", "{3sa:1.8}", "{3mi:4}", "{zfr:1500}", "{zvm:1500}", "{zac:500}", "{zjm:200000}"]
    {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, if rpm < 100.0 { 3_500 } else { 800 }).unwrap();
    (machine, host)
}

/// Returns the position of Z in the thread at each index pulse from `from` to `to` mm along it, in mm modulo the
/// lead.
fn phases(machine: &Machine, since: usize, lead: f64, from: f64, to: f64) -> Vec<f64> {
    let mechanics = machine.mechanics().unwrap();
    let start = mechanics.indexed()[since].1[Z];
    let ways =
        mechanics.indexed()[since..].iter().map(|(_, steps)| (start - steps[Z]) as f64 / STEPS);
    let inside = ways.filter(|way| (from..=to).contains(way));
    inside.map(|way| (way / lead - (way / lead).round()) * lead).collect()
}

/// Cuts along Z and returns the phases in the middle of the pass.
fn pass(machine: &mut Machine, host: &mut Host, length: f64, lead: f64) -> Vec<f64> {
    let since = machine.mechanics().unwrap().indexed().len() - 1;
    set(machine, host, &format!("g91 g33 z-{length} k{lead}"));
    let before = machine.recorder().motors()[Z].position;
    wait_for_rest(machine, host, 60_000);
    let steps = (length * STEPS).round() as i64;
    assert_eq!(before - machine.recorder().motors()[Z].position, steps, "the end");
    phases(machine, since, lead, 1.5 * lead, length - 1.5 * lead)
}

/// Runs until the machine has moved and is at rest.
fn wait_for_rest(machine: &mut Machine, host: &mut Host, most_ms: u64) {
    let mut waited = 0;
    while machine.recorder().steps() == 0 || host.stat() == Some(5) {
        host.run_for_ms(machine, 50).unwrap();
        waited += 50;
        assert!(waited < most_ms, "it does not come to rest: {:?}", host.stat());
    }
    host.run_for_ms(machine, 1_000).unwrap();
}

fn spread(phases: &[f64]) -> f64 {
    let most = phases.iter().copied().fold(f64::MIN, f64::max);
    let least = phases.iter().copied().fold(f64::MAX, f64::min);
    most - least
}

/// Most that a phase may be off: a step.
const STEP: f64 = 1.0 / STEPS + 1e-9;

#[test]
fn z_is_where_the_spindle_says_at_each_index_whatever_its_speed() {
    for marks in [1, 4, 8, 100] {
        let mut all = Vec::new();
        for &rpm in share_of(&[60.0, 300.0, 600.0, 1_000.0], 2) {
            let (mut machine, mut host) = lathe(marks, rpm, |_| {});
            let phases = pass(&mut machine, &mut host, 10.0, 1.0);
            println!("N {marks}, {rpm} rpm: spread {:.4}", spread(&phases));
            assert!(phases.len() >= 6 && spread(&phases) < STEP, "{marks}, {rpm}: {phases:?}");
            assert_eq!(machine.missed_tops(), 0);
            let window = machine.meters().window_outside();
            assert!(window.cycles <= OFF, "{} cycles", window.cycles);
            all.extend(phases);
        }
        // All passes have the same phase.
        println!("N {marks}, all speeds: spread {:.4}", spread(&all));
        assert!(spread(&all) < STEP, "{marks}: {all:?}");
    }
}

/// Begins a pass and runs until it has come `far` mm. Returns the index of its first index pulse.
fn begin(machine: &mut Machine, host: &mut Host, line: &str, far: f64) -> usize {
    let since = machine.mechanics().unwrap().indexed().len() - 1;
    let start = machine.recorder().motors()[Z].position;
    set(machine, host, line);
    let mut waited = 0;
    while ((start - machine.recorder().motors()[Z].position) as f64) < far * STEPS {
        host.run_for_ms(machine, 2).unwrap();
        waited += 2;
        assert!(waited < 20_000, "it does not begin");
    }
    since
}

#[test]
fn a_slower_spindle_is_followed() {
    for (marks, most, after) in
        [(1, 0.1, 0.03), (4, 0.02, 0.005), (8, 0.02, 0.005), (100, 0.005, 0.005)]
    {
        let (mut machine, mut host) = lathe(marks, 300.0, |_| {});
        let since = begin(&mut machine, &mut host, "g91 g33 z-20 k1", 5.0);
        let phase = *phases(&machine, since, 1.0, 1.5, 5.0).last().unwrap();
        let turns = machine.mechanics().unwrap().indexed().len();
        // The spindle's speed takes 0.5 s to come two thirds of the way.
        machine.tamper(|mechanics, now| mechanics.drive_spindle_to(240.0, now));
        wait_for_rest(&mut machine, &mut host, 20_000);
        let off: Vec<f64> =
            phases(&machine, since, 1.0, 1.5, 18.5).iter().map(|is| (is - phase).abs()).collect();
        let peak = off.iter().copied().fold(0.0, f64::max);
        let rest = off[turns - since + 6..].iter().copied().fold(0.0, f64::max);
        println!("N {marks}, 300 to 240 rpm: peak {peak:.4}, later {rest:.4}");
        assert!(peak < most + 1e-9 && rest < after + 1e-9, "{marks}: {off:.3?}");
    }
}

#[test]
fn a_pulse_that_is_missing_shifts_nothing() {
    for marks in [4, 8, 100] {
        let (mut machine, mut host) = lathe(marks, 300.0, |_| {});
        let since = begin(&mut machine, &mut host, "g91 g33 z-12 k1", 3.0);
        machine.tamper(|mechanics, _| mechanics.encoder().unwrap().miss(false, 1));
        wait_for_rest(&mut machine, &mut host, 20_000);
        let phases = phases(&machine, since, 1.0, 1.5, 10.5);
        println!("N {marks}, a pulse lost: spread {:.4}", spread(&phases));
        assert!(spread(&phases) < STEP, "{marks}: {phases:.3?}");
        assert_eq!(asked(&mut machine, &mut host, "spx"), 1.0);
        let told = host.take_reports().iter().filter(|report| report["er"]["st"] == MISFIT).count();
        assert_eq!(told, 1, "{marks}: it is told");
    }
}

#[test]
fn a_load_that_swings_is_followed() {
    for (marks, most) in [(4, 0.015), (100, 0.01)] {
        let (mut machine, mut host) = lathe(marks, 300.0, |_| {});
        // A swing of 2 % of the speed, at 3 Hz.
        let swing = 6.0 * 3.0 * std::f64::consts::TAU;
        machine.tamper(|mechanics, now| mechanics.load_spindle(0.0, swing, 3.0, now));
        let phases = pass(&mut machine, &mut host, 20.0, 1.0);
        println!("N {marks}, 2 % at 3 Hz: spread {:.4}", spread(&phases));
        assert!(spread(&phases) < most, "{marks}: {phases:.3?}");
        // The speed does swing.
        let indexed = machine.mechanics().unwrap().indexed();
        let last: Vec<u64> =
            indexed[indexed.len() - 15..].windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
        let (least, most) = (last.iter().min().unwrap(), last.iter().max().unwrap());
        assert!(*most as f64 / *least as f64 > 1.015, "{last:?}");
    }
}

#[test]
fn a_taper_is_in_step_along_the_axis_that_moves_farther() {
    let (mut machine, mut host) = lathe(4, 300.0, |_| {});
    let since = machine.mechanics().unwrap().indexed().len() - 1;
    set(&mut machine, &mut host, "g91 g33 x1 z-10 k1");
    wait_for_rest(&mut machine, &mut host, 20_000);
    let phases = phases(&machine, since, 1.0, 2.0, 8.0);
    assert!(phases.len() >= 5 && spread(&phases) < STEP, "{phases:.3?}");
    assert_eq!(asked(&mut machine, &mut host, "mpox"), 1.0);
    assert_eq!(asked(&mut machine, &mut host, "mpoz"), -10.0);
    // In inches.
    let since = begin(&mut machine, &mut host, "g20 g33 z-0.5 k0.05", 2.0);
    wait_for_rest(&mut machine, &mut host, 20_000);
    let phases = self::phases(&machine, since, 1.27, 2.0, 10.0);
    assert!(phases.len() >= 5 && spread(&phases) < STEP, "{phases:.3?}");
}

/// Returns Z at each index pulse in the middle of the thread, in mm modulo the lead, for each pass of a threading
/// cycle.
fn cycle(machine: &mut Machine, host: &mut Host, line: &str, lead: f64) -> Vec<Vec<f64>> {
    let since = machine.mechanics().unwrap().indexed().len() - 1;
    set(machine, host, line);
    // Time until a report says that the machine runs.
    host.run_for_ms(machine, 1_000).unwrap();
    wait_for_rest(machine, host, 120_000);
    let end = machine.recorder().motors()[Z].position as f64 / STEPS;
    let indexed = &machine.mechanics().unwrap().indexed()[since..];
    let mut passes: Vec<Vec<f64>> = Vec::new();
    for pair in indexed.windows(2) {
        let (before, at) = (pair[0].1[Z] as f64 / STEPS, pair[1].1[Z] as f64 / STEPS);
        let turned = before - at;
        // In the cut Z moves a lead in a turn. On the way back and at rest it does not.
        if (turned - lead).abs() < 0.02 && at > end + 0.3 {
            if passes.is_empty() || before > -1.5 {
                passes.push(Vec::new());
            }
            passes.last_mut().unwrap().push((at / lead - (at / lead).round()) * lead);
        }
    }
    passes
}

#[test]
fn the_passes_of_a_cycle_lie_in_one_another() {
    let (mut machine, mut host) = lathe(4, 300.0, |_| {});
    set(&mut machine, &mut host, "g0 x5");
    host.run_for_ms(&mut machine, 2_000).unwrap();
    // Each pass has one turn that begins less than 1.5 mm along.
    let passes = cycle(&mut machine, &mut host, "g76 p1 z-8 i-1 j0.05 k0.75 h5", 1.0);
    let all: Vec<f64> = passes.iter().flatten().copied().collect();
    println!("{} passes, {} turns: spread {:.4}", passes.len(), all.len(), spread(&all));
    assert_eq!(passes.len(), 20);
    assert!(passes.iter().all(|pass| pass.len() >= 4), "{passes:.3?}");
    assert!(spread(&all) < STEP, "{passes:.3?}");
    assert_eq!(asked(&mut machine, &mut host, "mpox"), 5.0);
    assert_eq!(asked(&mut machine, &mut host, "mpoz"), -8.0);
    assert_eq!(machine.missed_tops(), 0);
}

#[test]
fn tapers_and_the_compound_slide_stay_in_step() {
    let (mut machine, mut host) = lathe(100, 300.0, |_| {});
    for line in ["{1mi:4}", "{xvm:1500}", "{xac:1000}", "g0 x5"] {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, 2_000).unwrap();
    let since = machine.mechanics().unwrap().indexed().len() - 1;
    // The second pass begins half a lead further on.
    let passes = cycle(&mut machine, &mut host, "g76 p1 z-12 i-1 j0.5 k1 q45 e3 l3", 1.0);
    let all: Vec<f64> = passes.iter().flatten().map(|at| at - (2.0 * at).round() / 2.0).collect();
    println!("tapers: {} turns, spread {:.4}", all.len(), spread(&all));
    assert!(all.len() >= 18 && spread(&all) < STEP, "{passes:.3?}");
    // On the tapers X is where Z requires it.
    let per_mm = machine.recorder().motors()[0].position as f64 / 5.0;
    let indexed = &machine.mechanics().unwrap().indexed()[since..];
    for (_, steps) in indexed {
        let (x, z) = (steps[0] as f64 / per_mm, steps[Z] as f64 / STEPS);
        if (-11.5..-9.2).contains(&z) && x < 3.9 {
            let along = (z + 9.0) / -3.0;
            let (first, second) = (3.5 + along, 3.0 + along);
            assert!((x - first).abs() < 0.01 || (x - second).abs() < 0.01, "{x} {z}");
        }
    }
}

#[test]
fn feeds_a_turn_go_by_the_measured_speed() {
    // S is 300, but the spindle turns at 240: 0.2 mm a turn are 48 mm/min.
    let (mut machine, mut host) = lathe(4, 240.0, |_| {});
    set(&mut machine, &mut host, "g95 f0.2 m3 s300");
    machine.tamper(|mechanics, now| mechanics.force_spindle(240.0, now));
    let way = |machine: &Machine| machine.recorder().motors()[Z].position as f64 / STEPS;
    let went = |machine: &mut Machine, host: &mut Host, ms: u64| {
        let before = way(machine);
        host.run_for_ms(machine, ms).unwrap();
        way(machine) - before
    };
    set(&mut machine, &mut host, "g91 g1 z20");
    host.run_for_ms(&mut machine, 1_000).unwrap();
    let feed = went(&mut machine, &mut host, 3_000) / 12.0;
    println!("G95 F0.2: {feed:.4} mm a turn at 240 rpm, of S300");
    assert!((feed / 0.2 - 1.0).abs() < 0.01, "{feed}");
    // The feed follows a change of speed, and motion waits for a spindle that stands still.
    machine.tamper(|mechanics, now| mechanics.force_spindle(120.0, now));
    host.run_for_ms(&mut machine, 1_200).unwrap();
    let feed = went(&mut machine, &mut host, 3_000) / 6.0;
    assert!((feed / 0.2 - 1.0).abs() < 0.01, "{feed}");
    machine.tamper(|mechanics, now| mechanics.force_spindle(0.0, now));
    let (stopped, mut last) = (machine.cycle(), (0, 0));
    while machine.cycle() < stopped + machine.cycles(1_200) {
        run_for_quarter(&mut machine);
        let z = machine.recorder().motors()[Z].position;
        if z != last.0 {
            last = (z, machine.cycle());
        }
    }
    // Two pulses are 250 ms.
    let took = machine.seconds(last.1 - stopped) * 1e3;
    println!("G95: at rest {took:.0} ms after a dead stop, two pulses are 250");
    assert!(took < 250.0 * 1.03 + 40.0, "{took} ms");
    host.run_for_ms(&mut machine, 10).unwrap();
    assert_eq!(went(&mut machine, &mut host, 1_000), 0.0);
    // A traverse does not wait, nor does a feed per minute.
    machine.tamper(|mechanics, now| mechanics.force_spindle(300.0, now));
    wait_for_rest(&mut machine, &mut host, 60_000);
    assert_eq!(way(&machine), 20.0);
    machine.tamper(|mechanics, now| mechanics.force_spindle(0.0, now));
    host.run_for_ms(&mut machine, 1_000).unwrap();
    set(&mut machine, &mut host, "g0 z1");
    set(&mut machine, &mut host, "g94 g1 z1 f300");
    host.run_for_ms(&mut machine, 3_000).unwrap();
    assert_eq!(way(&machine), 22.0);
}

#[test]
fn the_example_cuts_a_thread() {
    let mut machine = firmware(&MEGA2560_LATHE);
    machine.build(&Build::lathe(&MEGA2560_LATHE, 4).unwrap());
    machine.recorder_mut().keep_log();
    let lines = job::read_lines(Path::new("../../../examples/thread.gcode")).unwrap();
    let settings = vec!["{mch:4}".to_string(), "{spn:4}".to_string()];
    let options = Options { settings, ..Options::default() };
    let report = job::run(&mut machine, &lines, &options, |_| {}).unwrap();
    assert!(report.ok, "{report}");
    let threads = Threads::of(&machine, &report.setup, &lines).unwrap();
    assert_eq!((threads.passes, threads.problem()), (11, None), "{threads:?}");
    // Z also follows the spindle between two index pulses.
    let most = threads.errors.iter().flatten().map(|(_, off)| off.abs()).fold(0.0, f64::max);
    println!(
        "{} turns, {:.4} mm at the index, {most:.4} between",
        threads.turns, threads.spread_mm
    );
    assert!(threads.turns >= 100 && most < 0.02, "{most}");
    let file = scratch("thread.svg");
    let limits = limits::of(&mut machine, &report.setup);
    plot::write(&file, &machine, &report.setup, &limits, &Look::default(), Some(&threads)).unwrap();
    assert!(std::fs::read_to_string(file).unwrap().contains("error of the thread"));
}

#[test]
fn a_spindle_that_stops_dead_stops_the_axis() {
    let cases = [(1, 300.0), (4, 300.0), (4, 1_000.0), (100, 600.0)];
    // The stop falls anywhere within a segment of 2 ms.
    for (case, quarters) in (0..16).map(|n| (n / 4, 2 * (n % 4))) {
        let (marks, rpm) = cases[case];
        let (mut machine, mut host) = lathe(marks, rpm, |_| {});
        begin(&mut machine, &mut host, "g91 g33 z-20 k1", 4.0);
        (0..quarters).for_each(|_| run_for_quarter(&mut machine));
        machine.tamper(|mechanics, now| mechanics.force_spindle(0.0, now));
        let stopped = machine.cycle();
        let mut last = machine.recorder().motors()[Z].position;
        let mut at = stopped;
        while machine.cycle() < stopped + machine.cycles(1_500) {
            run_for_quarter(&mut machine);
            let now = machine.recorder().motors()[Z].position;
            if now != last {
                (last, at) = (now, machine.cycle());
            }
        }
        let took = machine.seconds(at - stopped) * 1e3;
        let two_pulses = 2.0 * 60_000.0 / rpm / f64::from(marks);
        println!(
            "N {marks}, {rpm} rpm: at rest {took:.0} ms after a dead stop, two pulses are {two_pulses:.0}"
        );
        // 20 ms are for queued segments and the ramp. From 5 mm/s on the ramp alone takes longer within the limits, and
        // 9.5 ms are for the four segments before it and the next look at the spindle.
        let ramp = rpm / 60.0 / 500.0 * 1e3;
        let rest = 20.0f64.max(9.5 + 0.02 * two_pulses + ramp);
        assert!(took <= two_pulses + rest, "{marks}, {rpm}: {took} ms");
        host.run_for_ms(&mut machine, 20).unwrap();
        let told = host.take_reports().iter().any(|report| report["er"]["st"] == LOST);
        assert!(told, "{marks}: nothing is told");
        // The position is known to the step.
        let position = asked(&mut machine, &mut host, "mpoz");
        assert!((position - last as f64 / STEPS).abs() < 0.0011, "{position} {last}");
    }
}

/// Runs for a quarter of a millisecond.
fn run_for_quarter(machine: &mut Machine) {
    machine.run_until(machine.cycle() + machine.cycles(1) / 4).unwrap();
}

/// A lathe whose X retracts from the cut by 2 mm, also with 200 steps/mm and 500 mm/s2.
fn retracting(marks: u32, rpm: f64) -> (Machine, Host) {
    let (mut machine, mut host) = lathe(marks, rpm, |_| {});
    for line in [
        "{1tr:4}",
        "{1sa:1.8}",
        "{1mi:4}",
        "{xfr:1500}",
        "{xvm:1500}",
        "{xac:500}",
        "{xjm:200000}",
        "{spr:2}",
    ] {
        set(&mut machine, &mut host, line);
    }
    (machine, host)
}

/// Stops the spindle abruptly in the cut. Returns, for each depth, the ms from the stop until X has retracted by that
/// depth. Checks that the position is known to the step and that the axes return to it.
fn dies<const N: usize>(
    (machine, host): &mut (Machine, Host),
    later_ms: f64,
    depths: [f64; N],
) -> [f64; N] {
    let started = machine.recorder().motors().each_ref().map(|motor| motor.position);
    begin(machine, host, "g91 g33 z-20 k1", 4.0);
    machine.run_until(machine.cycle() + (machine.cycles(1) as f64 * later_ms) as u64).unwrap();
    machine.tamper(|mechanics, now| mechanics.force_spindle(0.0, now));
    let stopped = machine.cycle() + machine.cycles(EDGES_LATE_MS);
    let mut out = [None; N];
    while machine.cycle() < stopped + machine.cycles(1_000) {
        run_for_quarter(machine);
        let x = machine.recorder().motors()[0].position;
        for (out, depth) in out.iter_mut().zip(depths) {
            if out.is_none() && (x - started[0]) as f64 / STEPS >= depth - 1e-9 {
                *out = Some(machine.cycle());
            }
        }
    }
    host.run_for_ms(machine, 10).unwrap();
    let ms = |at: u64| machine.seconds(at - stopped) * 1e3;
    let times = out.map(|at| ms(at.expect("it is out")));
    let told = host.take_reports().iter().any(|report| report["er"]["st"] == LOST);
    assert!(told, "nothing is told");
    // The position is known to the step.
    let x = machine.recorder().motors()[0].position;
    assert_eq!(x - started[0], (2.0 * STEPS) as i64);
    assert_eq!(asked(machine, host, "mpox"), x as f64 / STEPS);
    let z = machine.recorder().motors()[Z].position as f64 / STEPS;
    let position = asked(machine, host, "mpoz");
    assert!((position - z).abs() < 0.0011, "{position} {z}");
    set(machine, host, "{clear:n}");
    set(machine, host, "g90 g0 x0 z0");
    wait_for_rest(machine, host, 20_000);
    let motors = machine.recorder().motors();
    assert_eq!([motors[0].position, motors[Z].position], [0, 0]);
    times
}

#[test]
fn with_a_retract_a_spindle_that_stops_dead_has_x_leave_within_two_pulses_and_20_ms() {
    // X retracts from the cut of a pass. X is as light as most cross slides, or as slow as Z.
    for (accel, depths) in [(1_000, [0.1, 0.2, 0.3]), (500, [0.05, 0.1, 0.3])] {
        for (marks, rpm) in [(1, 300.0), (4, 300.0), (4, 1_000.0), (100, 600.0), (100, 1_000.0)] {
            let mut lathe = retracting(marks, rpm);
            set(&mut lathe.0, &mut lathe.1, &format!("{{xac:{accel}}}"));
            let two_pulses = 2.0 * 60_000.0 / rpm / f64::from(marks);
            let mut worst = [0.0f64; 3];
            for n in 0..4 {
                // The stop comes anywhere between two pulses, and between two checks of exec.
                let later = f64::from(n) * (two_pulses / 8.0 + 0.6);
                let out = dies(&mut lathe, later, depths);
                for ((worst, out), depth) in worst.iter_mut().zip(out).zip(depths) {
                    *worst = worst.max(out);
                    // Exec checks every 2 ms, and X begins with a segment, of 2 ms.
                    let ramp = (2.0 * depth / f64::from(accel)).sqrt() * 1e3;
                    let most = 1.01 * two_pulses + 5.0 + ramp;
                    assert!(out <= most, "{marks}, {rpm}, {depth}: {out} ms of {most}");
                }
                let (machine, host) = &mut lathe;
                machine.tamper(|mechanics, now| mechanics.force_spindle(rpm, now));
                host.run_for_ms(machine, 1_000).unwrap();
            }
            println!(
                "N {marks}, {rpm} rpm, {accel} mm/s2 on X, two pulses are {two_pulses:.1} ms: out by {depths:?} mm after {worst:.1?} ms at most"
            );
            assert!(worst[0] <= two_pulses + 20.0, "{marks}, {rpm}: {worst:?}");
            let window = lathe.0.meters().window_outside();
            assert!(window.cycles <= OFF, "{} cycles", window.cycles);
            assert_eq!(lathe.0.missed_tops(), 0);
        }
    }
}

#[test]
fn with_a_retract_a_hold_leaves_the_cut_and_the_pass_is_made_once_more() {
    for (marks, rpm) in [(4, 300.0), (4, 1_000.0), (100, 600.0)] {
        let (mut machine, mut host) = retracting(marks, rpm);
        let since = begin(&mut machine, &mut host, "g91 g33 z-16 k1", 6.0);
        machine.send_now(b'!');
        let held = machine.cycle();
        let mut out = None;
        while machine.cycle() < held + machine.cycles(600) {
            run_for_quarter(&mut machine);
            if out.is_none() && machine.recorder().motors()[0].position >= (0.1 * STEPS) as i64 {
                out = Some(machine.cycle());
            }
        }
        host.run_for_ms(&mut machine, 10).unwrap();
        let out = machine.seconds(out.expect("it is out") - held) * 1e3;
        println!("N {marks}, {rpm} rpm: out by 0.1 mm {out:.0} ms after the hold");
        assert!(out < 34.0, "{out} ms");
        assert_eq!(host.stat(), Some(6), "it holds");
        assert_eq!(machine.recorder().motors()[0].position, (2.0 * STEPS) as i64);
        let first = phases(&machine, since, 1.0, 1.5, 5.5);
        let since = machine.mechanics().unwrap().indexed().len();
        machine.send_now(b'~');
        host.run_for_ms(&mut machine, 500).unwrap();
        wait_for_rest(&mut machine, &mut host, 20_000);
        let motors = machine.recorder().motors();
        assert_eq!([motors[0].position, motors[Z].position], [0, (-16.0 * STEPS) as i64]);
        // Z cuts where X is back at its place.
        let indexed = &machine.mechanics().unwrap().indexed()[since..];
        let cuts = indexed.iter().filter(|(_, steps)| steps[0] == 0);
        let ways = cuts.map(|(_, steps)| -steps[Z] as f64 / STEPS);
        let second = ways.filter(|way| (1.5..=14.5).contains(way)).map(|way| way - way.round());
        let all: Vec<f64> = first.iter().copied().chain(second).collect();
        println!(
            "N {marks}, {rpm} rpm: {} turns of both passes, spread {:.4}",
            all.len(),
            spread(&all)
        );
        assert!(all.len() >= 14 && spread(&all) < STEP, "{all:.3?}");
    }
}

#[test]
fn an_error_above_its_limit_ends_the_pass() {
    // The error has an exception of its own.
    const ASTRAY: u64 = 46;
    let (mut machine, mut host) = retracting(4, 600.0);
    set(&mut machine, &mut host, "{spl:0.1}");
    // With a steady spindle, or a load that swings, no error is reported.
    let swing = 12.0 * 3.0 * std::f64::consts::TAU;
    machine.tamper(|mechanics, now| mechanics.load_spindle(0.0, swing, 3.0, now));
    pass(&mut machine, &mut host, 12.0, 2.0);
    machine.tamper(|mechanics, now| mechanics.load_spindle(0.0, 0.0, 1.0, now));
    assert!(host.take_reports().iter().all(|report| report["er"]["st"].is_null()));
    // The spindle turns faster than the axis can follow: 1,500 mm/min are 750 turns a minute.
    begin(&mut machine, &mut host, "g33 z-20 k2", 4.0);
    machine.tamper(|mechanics, now| mechanics.drive_spindle_to(1_000.0, now));
    host.run_for_ms(&mut machine, 800).unwrap();
    let told = host.take_reports().iter().any(|report| report["er"]["st"] == ASTRAY);
    assert!(told, "nothing is told");
    assert_eq!(machine.recorder().motors()[0].position, (2.0 * STEPS) as i64);
}

/// A lathe whose outputs drive the spindle in both directions. The spindle gains or loses at most `torque` turns a
/// minute in a second.
fn driven(marks: u32, rpm: f64, torque: f64) -> (Machine, Host) {
    let mut machine = firmware(&MEGA2560_LATHE);
    let mut build = Build::lathe(&MEGA2560_LATHE, marks).unwrap();
    (build.spindle.rpm, build.spindle.pwm) = (rpm, None);
    build.spindle.torque = torque;
    machine.build(&build);
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut machine, 1_000).unwrap();
    set(&mut machine, &mut host, &format!("{{spn:{marks}}}"));
    for line in
        ["{3tr:4}", "{3sa:1.8}", "{3mi:4}", "{zfr:1500}", "{zvm:1500}", "{zac:500}", "{zjm:200000}"]
    {
        set(&mut machine, &mut host, line);
    }
    (machine, host)
}

#[test]
fn a_tap_goes_in_and_out_in_step_with_the_spindle() {
    // The columns: marks, speed, torque, the largest error (near the reversal there are no pulses to go by), the
    // depth (so that the reversal is anywhere between two pulses), and whether a second sensor tells the direction. A share
    // has each number of marks.
    let rows = [
        (4, 300.0, 600.0, 0.45, 10.0, false),
        (4, 300.0, 600.0, 0.45, 10.074, false),
        (4, 300.0, 600.0, 0.45, 10.185, false),
        (20, 300.0, 600.0, 0.1, 10.0, false),
        (20, 300.0, 600.0, 0.1, 10.111, false),
        (100, 300.0, 600.0, 0.06, 10.0, false),
        (100, 300.0, 600.0, 0.06, 10.037, false),
        (100, 600.0, 900.0, 0.06, 10.0, false),
        (100, 600.0, 900.0, 0.06, 10.0025, false),
        (100, 600.0, 900.0, 0.06, 10.005, false),
        (100, 600.0, 900.0, 0.06, 10.0075, false),
        (4, 300.0, 600.0, 0.45, 10.0, true),
        (4, 300.0, 600.0, 0.45, 10.074, true),
        (4, 300.0, 600.0, 0.45, 10.185, true),
        (20, 300.0, 600.0, 0.1, 10.0, true),
        (20, 300.0, 600.0, 0.1, 10.111, true),
        (100, 300.0, 600.0, 0.06, 10.0, true),
        (100, 600.0, 900.0, 0.06, 10.005, true),
    ];
    for &(marks, rpm, torque, most, deep, tells) in share_of(&rows, 3) {
        let (mut machine, mut host) = driven(marks, rpm, torque);
        set(&mut machine, &mut host, &format!("{{spdi:{}}}", u8::from(tells)));
        set(&mut machine, &mut host, &format!("m3 s{rpm}"));
        host.run_for_ms(&mut machine, 3_000).unwrap();
        set(&mut machine, &mut host, &format!("g91 g33.1 z-{deep} k1"));
        let (mut phases, mut deepest, mut still) = (Vec::new(), 0.0f64, 0);
        let mut last = 0;
        while still < 4_000 {
            run_for_quarter(&mut machine);
            let z = machine.recorder().motors()[Z].position;
            still = if z == last && z == 0 && deepest < 0.0 { still + 1 } else { 0 };
            last = z;
            let z = z as f64 / STEPS;
            deepest = deepest.min(z);
            let turns = machine.mechanics().unwrap().spindle_turns();
            // From two turns after the beginning, where Z is in step, to two turns before the end.
            phases.push((z, z + turns));
            assert!(
                phases.len() < 80_000,
                "{marks}: it does not come to its end: {z} of {deepest}, {:?}",
                host.take_reports()
            );
        }
        host.run_for_ms(&mut machine, 10).unwrap();
        let began = phases.iter().position(|(z, _)| *z < -2.0).unwrap();
        let ended = phases.iter().rposition(|(z, _)| *z < -0.5).unwrap();
        let inside: Vec<f64> = phases[began..ended].iter().map(|(_, phase)| *phase).collect();
        let there = phases[began..].iter().position(|(z, _)| *z < -9.5).unwrap();
        let steady: Vec<f64> = inside[..there].to_vec();
        println!(
            "N {marks}, {rpm} rpm, direction {tells}: deepest {deepest:.3}, spread on the way in {:.4}, there and back {:.4}",
            spread(&steady),
            spread(&inside)
        );
        // The angle of the spindle is known to a millisecond.
        let known = rpm / 60.0 * 0.001;
        assert!(spread(&steady) < 2.0 * STEP + known, "{}", spread(&steady));
        assert!(spread(&inside) < most, "{}", spread(&inside));
        // Z goes on for the distance in which the spindle comes to rest, and no further.
        let stops = rpm / 60.0 * rpm / torque / 2.0;
        assert!((-deep - stops - 0.3..=-deep).contains(&deepest), "{deepest}");
        // The spindle turns as before, and nothing is reported.
        let told = host.take_reports();
        assert!(told.iter().all(|report| report["er"]["st"].is_null()), "{told:?}");
        let turning = machine.mechanics().unwrap().spindle_rpm(machine.cycle());
        assert!(turning > 0.7 * rpm, "{turning}");
        assert_eq!(asked(&mut machine, &mut host, "posz"), 0.0);
        set(&mut machine, &mut host, "g0 z1");
        host.run_for_ms(&mut machine, 1_000).unwrap();
        assert_eq!(machine.recorder().motors()[Z].position, STEPS as i64);
    }
}

#[test]
fn a_tap_whose_spindle_does_not_turn_round_is_an_alarm() {
    const NOT_REVERSED: u64 = 47;
    let (mut machine, mut host) = driven(20, 300.0, 600.0);
    set(&mut machine, &mut host, "m3 s300");
    host.run_for_ms(&mut machine, 3_000).unwrap();
    set(&mut machine, &mut host, "g91 g33.1 z-5 k1");
    for _ in 0..6_000 {
        machine.tamper(|mechanics, now| mechanics.drive_spindle_to(300.0, now));
        machine.run_for_ms(1).unwrap();
    }
    host.run_for_ms(&mut machine, 10).unwrap();
    let told = host.take_reports().iter().any(|report| report["er"]["st"] == NOT_REVERSED);
    assert!(told, "nothing is told");
    // Z goes on for the distance of a second beyond the bottom, and no further.
    let z = machine.recorder().motors()[Z].position as f64 / STEPS;
    assert!((-10.05..=-9.9).contains(&z), "{z}");
    let position = asked(&mut machine, &mut host, "mpoz");
    assert!((position - z).abs() < 0.0011, "{position} {z}");
}

#[test]
fn a_hold_in_a_tap_waits_for_its_end() {
    let (mut machine, mut host) = driven(20, 300.0, 600.0);
    set(&mut machine, &mut host, "m3 s300");
    host.run_for_ms(&mut machine, 3_000).unwrap();
    begin(&mut machine, &mut host, "g91 g33.1 z-5 k1", 2.0);
    machine.send_now(b'!');
    host.run_for_ms(&mut machine, 6_000).unwrap();
    assert_eq!(host.stat(), Some(6), "it holds");
    // The tap is out of the hole.
    assert!(machine.recorder().motors()[Z].position >= 0);
    machine.send_now(b'~');
    host.run_for_ms(&mut machine, 1_000).unwrap();
    assert_eq!(machine.recorder().motors()[Z].position, 0);
    set(&mut machine, &mut host, "g0 z1");
    host.run_for_ms(&mut machine, 500).unwrap();
    assert_eq!(machine.recorder().motors()[Z].position, STEPS as i64);
}

#[test]
fn a_hold_waits_for_the_end_of_the_pass() {
    let (mut machine, mut host) = lathe(4, 300.0, |_| {});
    let since = begin(&mut machine, &mut host, "g91 g33 z-12 k1", 4.0);
    machine.send_now(b'!');
    host.run_for_ms(&mut machine, 3_000).unwrap();
    assert_eq!(host.stat(), Some(6), "it holds");
    let phases = phases(&machine, since, 1.0, 1.5, 10.5);
    assert!(phases.len() >= 8 && spread(&phases) < STEP, "{phases:.3?}");
    assert_eq!(machine.recorder().motors()[Z].position, (-12.0 * STEPS) as i64);
    machine.send_now(b'~');
    set(&mut machine, &mut host, "g0 z1");
    host.run_for_ms(&mut machine, 500).unwrap();
    assert_eq!(machine.recorder().motors()[Z].position, (-11.0 * STEPS) as i64);
}

#[test]
fn an_alarm_does_not() {
    let (mut machine, mut host) = lathe(4, 300.0, |_| {});
    begin(&mut machine, &mut host, "g91 g33 z-12 k1", 4.0);
    set(&mut machine, &mut host, "{alarm:n}");
    let at = machine.recorder().motors()[Z].position;
    host.run_for_ms(&mut machine, 500).unwrap();
    let went = (at - machine.recorder().motors()[Z].position) as f64 / STEPS;
    assert!(went < 0.15, "{went} mm");
    set(&mut machine, &mut host, "{clear:n}");
    set(&mut machine, &mut host, "g0 z1");
}

#[test]
fn what_cannot_be_cut_moves_nothing() {
    for (rpm, marks, status) in [(0.0, 4, 42), (2_000.0, 4, 146)] {
        let (mut machine, mut host) = lathe(marks, rpm, |_| {});
        let steps = machine.recorder().steps();
        set(&mut machine, &mut host, "g91 g33 z-12 k1");
        host.run_for_ms(&mut machine, 7_000).unwrap();
        let told = host.take_reports().iter().any(|report| report["er"]["st"] == status);
        assert!(told, "{status}: nothing is told");
        assert_eq!(machine.recorder().steps(), steps);
    }
}

#[test]
fn a_spindle_that_turns_the_wrong_way_cuts_nothing() {
    const WRONG_WAY: u64 = 55;
    let begins = |rpm: f64, word: &str| {
        let (mut machine, mut host) = lathe(8, rpm, |_| {});
        set(&mut machine, &mut host, "{spdi:1}");
        host.run_for_ms(&mut machine, 1_000).unwrap();
        // The simulated spindle is driven by the test.
        set(&mut machine, &mut host, word);
        host.run_for_ms(&mut machine, 200).unwrap();
        machine.tamper(|mechanics, now| mechanics.force_spindle(rpm, now));
        host.run_for_ms(&mut machine, 1_000).unwrap();
        let steps = machine.recorder().steps();
        set(&mut machine, &mut host, "g91 g33 z-8 k1");
        host.run_for_ms(&mut machine, 4_000).unwrap();
        let told = host.take_reports().iter().any(|report| report["er"]["st"] == WRONG_WAY);
        (told, machine.recorder().steps() != steps)
    };
    for (rpm, word) in [(-300.0, "m3"), (300.0, "m4")] {
        assert_eq!(begins(rpm, word), (true, false), "{rpm} {word}");
    }
    for (rpm, word) in [(300.0, "m3"), (-300.0, "m4"), (300.0, "m5"), (-300.0, "m5")] {
        assert_eq!(begins(rpm, word), (false, true), "{rpm} {word}");
    }
}

#[test]
fn a_spindle_that_turns_round_in_the_pass_is_lost() {
    let (mut machine, mut host) = lathe(100, 300.0, |_| {});
    set(&mut machine, &mut host, "{spdi:1}");
    host.run_for_ms(&mut machine, 1_000).unwrap();
    begin(&mut machine, &mut host, "g91 g33 z-12 k1", 4.0);
    machine.tamper(|mechanics, now| mechanics.force_spindle(-300.0, now));
    let at = machine.recorder().motors()[Z].position;
    host.run_for_ms(&mut machine, 300).unwrap();
    let went = (at - machine.recorder().motors()[Z].position) as f64 / STEPS;
    assert!(went < 0.15, "{went} mm");
    let told = host.take_reports().iter().any(|report| report["er"]["st"] == LOST);
    assert!(told, "nothing is told");
    let z = machine.recorder().motors()[Z].position as f64 / STEPS;
    let position = asked(&mut machine, &mut host, "mpoz");
    assert!((position - z).abs() < 0.0011, "{position} {z}");
}

#[test]
fn threads_of_1_000_turns_and_100_pulses_leave_time_for_answers() {
    let (mut machine, mut host) = lathe(100, 1_000.0, |_| {});
    begin(&mut machine, &mut host, "g91 g33 z-30 k1", 2.0);
    for _ in 0..20 {
        let asked = machine.cycle();
        let answer = host.ask(&mut machine, "{sps:n}", 1_000).unwrap();
        assert_eq!(answer.status, 0);
        let took = machine.seconds(machine.cycle() - asked) * 1e3;
        assert!(took < 20.0, "{took} ms");
    }
    wait_for_rest(&mut machine, &mut host, 20_000);
    assert_eq!(asked(&mut machine, &mut host, "stv"), 0.0, "late segments");
}

/// The most pulses a second of `docs/lathe.md`: 400 pulses in a turn at 900 turns a minute.
#[test]
fn a_thread_with_6_000_pulses_a_second_leaves_time_for_answers_and_one_with_more_is_refused() {
    for (marks, rpm) in [(400, 900.0), (120, 3_000.0)] {
        let (mut machine, mut host) = lathe(marks, rpm, |_| {});
        begin(&mut machine, &mut host, "g91 g33 z-20 k0.4", 2.0);
        let mut longest = 0.0f64;
        for n in 0..40 {
            machine.send_to(kerf_sim::AUX, b"{mpoz:n}\n");
            let began = machine.cycle();
            assert_eq!(host.ask(&mut machine, "{sps:n}", 1_000).unwrap().status, 0);
            // The question and its answer are about 45 bytes, 4 ms.
            longest = longest.max(machine.seconds(host.heard_at() - began) * 1e3 - 4.0);
            host.run_for_ms(&mut machine, 7 + n % 11).unwrap();
        }
        println!("N {marks}, {rpm} rpm: an answer takes {longest:.1} ms at most");
        assert!(longest < 20.0, "{marks}, {rpm}: {longest} ms");
        wait_for_rest(&mut machine, &mut host, 20_000);
        assert_eq!(machine.recorder().motors()[Z].position, (-20.0 * STEPS) as i64);
        // A tenth more is too much.
        machine.tamper(|mechanics, now| mechanics.force_spindle(1.1 * rpm, now));
        host.run_for_ms(&mut machine, 1_000).unwrap();
        let steps = machine.recorder().steps();
        for line in ["g33 z-12 k0.4", "g33.1 z-5 k0.4", "g76 p0.4 z-5 i-1 j0.2 k0.2"] {
            host.take_reports();
            set(&mut machine, &mut host, "m3 s900");
            host.run_for_ms(&mut machine, 200).unwrap();
            machine.tamper(|mechanics, now| mechanics.force_spindle(1.1 * rpm, now));
            host.run_for_ms(&mut machine, 1_000).unwrap();
            set(&mut machine, &mut host, line);
            host.run_for_ms(&mut machine, 2_000).unwrap();
            let told = host.take_reports().iter().any(|report| report["er"]["st"] == 146);
            assert!(told, "{marks}, {line}: nothing is told");
            set(&mut machine, &mut host, "{clear:n}");
            set(&mut machine, &mut host, "g91");
        }
        assert_eq!(machine.recorder().steps(), steps);
    }
}
