//! Step rates, high and low and mixed, measured pulse by pulse.

use kerf::boards::{Board, MEGA2560_GRBL, RAMPS14_CNC};
use kerf_sim::job::{self, Options};
use kerf_sim::{Host, Machine};

use crate::common::{booted, firmware, set};

/// Cycles in a second.
const SECOND: u64 = 16_000_000;
/// Longest time of anything here, ms.
const PATIENCE_MS: u64 = 120_000;

/// A machine with these settings that logs every step.
fn machine(board: &'static Board, settings: &[&str]) -> (Machine, Host) {
    let (mut machine, mut host) = booted(board);
    for line in settings {
        set(&mut machine, &mut host, line);
    }
    machine.recorder_mut().keep_log();
    (machine, host)
}

/// Sends a move and waits until its steps are made and the machine reports that it rests.
fn carry_out(machine: &mut Machine, host: &mut Host, line: &str, steps: u64) {
    set(machine, host, line);
    let end = machine.cycle() + machine.cycles(PATIENCE_MS);
    while machine.recorder().steps() < steps || host.idle_since().is_none() {
        assert!(machine.cycle() < end, "{} of {steps} steps", machine.recorder().steps());
        host.run_for_ms(machine, 20).unwrap();
    }
    assert_eq!(machine.recorder().steps(), steps);
    assert_eq!(machine.uart(0).overruns(), 0);
}

/// Returns the cycles of a motor's steps.
fn steps_of(machine: &Machine, motor: u8) -> Vec<u64> {
    machine.recorder().log().iter().filter(|s| s.motor == motor).map(|s| s.cycle).collect()
}

/// Returns the steps between two cycles.
fn between(steps: &[u64], from: u64, to: u64) -> &[u64] {
    let (from, to) = (steps.partition_point(|s| *s < from), steps.partition_point(|s| *s < to));
    &steps[from..to]
}

/// Checks that the mean interval is `cycles` to a part in a thousand, and that no interval is longer than twice that.
fn held(steps: &[u64], cycles: f64, motor: u8) {
    held_within(1e-3, steps, cycles, motor);
}

fn held_within(part: f64, steps: &[u64], cycles: f64, motor: u8) {
    let gaps = || steps.windows(2).map(|w| w[1] - w[0]);
    let mean = (steps[steps.len() - 1] - steps[0]) as f64 / (steps.len() - 1) as f64;
    let (least, most) = (gaps().min().unwrap(), gaps().max().unwrap());
    let all = format!("motor {}: mean {mean:.2}, {least} to {most}, not {cycles}", motor + 1);
    assert!((mean / cycles - 1.0).abs() < part, "{all}");
    assert!(most as f64 <= 2.0 * cycles, "{all}");
}

#[test]
fn three_motors_are_held_at_20000_steps_a_second() {
    three_motors_are_held_on(&MEGA2560_GRBL);
}

#[test]
fn three_motors_are_held_at_20000_steps_a_second_on_ramps() {
    three_motors_are_held_on(&RAMPS14_CNC);
}

fn three_motors_are_held_on(board: &'static Board) {
    // 1280 steps/mm: 937.5 mm/min are 20,000 steps a second.
    let settings = ["{x:{vm:937.5}}", "{y:{vm:937.5}}", "{z:{vm:937.5}}"];
    let (mut machine, mut host) = machine(board, &settings);
    carry_out(&mut machine, &mut host, "g0 x55 y55 z55", 3 * 55 * 1280);
    // The move takes 3.52 s plus the ramps, so two seconds in the middle are all cruise.
    for motor in 0..3 {
        let steps = steps_of(&machine, motor);
        let middle = steps[0].midpoint(steps[steps.len() - 1]);
        let cruise = between(&steps, middle - SECOND, middle + SECOND);
        held(cruise, 800.0, motor);
        assert!(cruise.len().abs_diff(40_000) <= 40, "{} in two seconds", cruise.len());
    }
}

#[test]
fn mixed_rates_are_held_together() {
    let settings = ["{x:{vm:937.5,fr:937.5}}"];
    let (mut machine, mut host) = machine(&MEGA2560_GRBL, &settings);
    // The ratio 70 : 10 : 0.1 gives 20,000, 2857.1 and 28.57 steps a second.
    carry_out(&mut machine, &mut host, "g0 x70 y10 z0.1", 70 * 1280 + 10 * 1280 + 128);
    let first = steps_of(&machine, 0);
    let middle = first[0].midpoint(first[first.len() - 1]);
    // A move this long is three blocks, each of which ends on whole steps: Z makes 43, 42 and 43.
    for (motor, cycles, part) in [(0, 800.0, 1e-3), (1, 5_600.0, 1e-3), (2, 560_000.0, 0.02)] {
        let steps = steps_of(&machine, motor);
        held_within(part, between(&steps, middle - SECOND, middle + SECOND), cycles, motor);
    }
}

fn ten_seconds_each(machine: &Machine) {
    for w in steps_of(machine, 0).windows(2) {
        let seconds = machine.seconds(w[1] - w[0]);
        assert!((seconds / 10.0 - 1.0).abs() < 1e-3, "{seconds} s between two steps");
    }
}

#[test]
fn one_step_every_ten_seconds_with_coarse_steps() {
    // One step a millimetre.
    let (mut machine, mut host) = machine(&MEGA2560_GRBL, &["{1:{tr:1600}}"]);
    carry_out(&mut machine, &mut host, "g1 x4 f6", 4);
    ten_seconds_each(&machine);
}

#[test]
fn one_step_every_ten_seconds_with_fine_steps() {
    // A thousand steps a millimetre.
    let (mut machine, mut host) = machine(&MEGA2560_GRBL, &["{1:{tr:1.6}}"]);
    carry_out(&mut machine, &mut host, "g1 x0.004 f0.006", 4);
    ten_seconds_each(&machine);
}

/// Loading a segment takes longest when every motor reverses. The new, shorter tick period must still take effect
/// before the timer gets there. Otherwise the timer counts on to 65,535: 4 ms without a step.
#[test]
fn reversals_of_all_motors_never_miss_a_tick() {
    let axis_a = "{aam:1,avm:3600,afr:3600}";
    let settings = ["{4ma:3}", axis_a, "{4tr:1.25}", "{xjm:2000}"];
    let (mut machine, mut host) = machine(&RAMPS14_CNC, &settings);
    let mut heard = 0;
    for n in 1..=120 {
        let to = n % 2;
        // The lines have different lengths, so that bytes come at all phases of a tick.
        let line = format!("g1 f700 x{to} y{to}.1 z{to}.01 a{to}.001{}", " ".repeat(n % 7));
        host.queue(n, &line);
        host.run_for_ms(&mut machine, 5).unwrap();
        heard += host.take_answered().len();
    }
    let end = machine.cycle() + machine.cycles(PATIENCE_MS);
    while (heard < 120 || host.idle_since().is_none()) && machine.cycle() < end {
        host.run_for_ms(&mut machine, 20).unwrap();
        heard += host.take_answered().len();
    }
    assert_eq!(heard, 120);
    assert_eq!(machine.missed_tops(), 0);
    let steps: Vec<i64> = machine.recorder().motors().iter().map(|m| m.position).collect();
    assert_eq!(steps, [0, 128, 13, 1]);
}

/// Limits of a fast axis: mm/s^2, and millions of mm/min^3.
fn limit(axis: &str, accel: f64, jerk: f64) -> String {
    format!("{{{axis}:{{vm:30000,fr:30000,ac:{accel},jm:{jerk}}}}}")
}

/// X and Y with these limits, and a junction acceleration so high that corners do not slow motion down.
fn limits(accel: f64, jerk: f64) -> Vec<String> {
    vec![limit("x", accel, jerk), limit("y", accel, jerk), "{ja:3600000}".into()]
}

/// The step interrupt takes most of the CPU here. In the rest a ramp must be laid out, or chord after chord be begun.
#[test]
fn nothing_is_late_at_high_step_rates() {
    let wide = || [limits(500.0, 2_000.0), vec!["{spw:10}".into()]].concat();
    let rotary = |jerk: f64| {
        let axis = |axis| limit(axis, 500.0, jerk);
        vec!["{4:{tr:20}}".into(), "{a:{am:1}}".into(), axis("a"), axis("x")]
    };
    for (job, settings) in [
        ("G3 X0 Y0 I-20 J0 F4200", limits(500.0, 2_000.0)),
        ("G3 X0 Y0 I-30 J0 F3900", limits(1_000.0, 5_000.0)),
        ("G3 X0 Y0 I-20 J0 F2400", wide()),
        ("G1 X60 Y60 F4800\nX0 Y30", wide()),
        ("G1 X1 A1800 F6000", rotary(1e6)),
        ("G1 X10 A3600 F600", rotary(5_000.0)),
    ] {
        let mut machine = firmware(&MEGA2560_GRBL);
        let options = Options { settings, ..Options::default() };
        let lines = job::lines_of(job);
        let report = job::run(&mut machine, &lines, &options, |_| {}).unwrap();
        assert!(report.ok, "{job}: {}", report.problems.join("; "));
    }
}

/// With a motor above the second the step interrupt goes through all motors, so two of them take as much of the CPU
/// as three.
#[test]
fn any_two_motors_make_no_pause_at_their_highest_rate() {
    let axes = ["x:{", "y:{", "z:{", "a:{am:1,"];
    let limits = axes.map(|axis| format!("{{{axis}vm:30000,fr:30000,ac:2500,jm:500000}}}}"));
    // 1,000 steps a mm.
    let motors = [1, 2, 3, 4].map(|motor| format!("{{{motor}:{{tr:1.6}}}}"));
    let settings: Vec<_> = motors.into_iter().chain(limits).collect();
    for (leads, follows) in [("x", "y"), ("z", "x"), ("x", "z"), ("a", "y"), ("y", "a"), ("z", "a")]
    {
        let moves = [2.5, 20.0].map(|mm| format!("g0 {follows}{:.4} {leads}{mm}", mm / 20.0));
        let lines = (1..).zip(std::iter::once("g91".to_string()).chain(moves)).collect::<Vec<_>>();
        let options = Options { settings: settings.clone(), ..Options::default() };
        let report = job::run(&mut firmware(&MEGA2560_GRBL), &lines, &options, |_| {}).unwrap();
        assert!(report.problems.is_empty(), "{leads} and {follows}: {:?}", report.problems);
    }
}

/// Returns the share of steps in a second of cruise whose interval is not the usual one, and by how many cycles it is
/// off at most, for a motor alone. If it is `busy`, the host asks all the time.
fn unevenness(rate: f64, busy: bool) -> (f64, u64) {
    let speed = rate / 1_280.0 * 60.0;
    let (mut machine, mut host) = machine(&MEGA2560_GRBL, &[&format!("{{x:{{vm:{speed:.3}}}}}")]);
    let way = (rate / 1_280.0 * 1.2 + 10.0).round();
    let whole = (way * 1_280.0) as u64;
    set(&mut machine, &mut host, &format!("g0 x{way}"));
    while machine.recorder().steps() < whole {
        if busy {
            machine.send(b"{posx:n}\n");
        }
        host.run_for_ms(&mut machine, 10).unwrap();
    }
    let steps = steps_of(&machine, 0);
    let middle = steps[0].midpoint(steps[steps.len() - 1]);
    let cruise = between(&steps, middle - SECOND / 2, middle + SECOND / 2);
    let mut gaps: Vec<u64> = cruise.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_unstable();
    let usual = gaps[gaps.len() / 2];
    // A period is a whole number of cycles, so intervals differ by one.
    let off = || gaps.iter().map(|gap| gap.abs_diff(usual)).filter(|off| *off > 1);
    (off().count() as f64 / gaps.len() as f64, off().max().unwrap_or(0))
}

/// README.md has these figures.
#[test]
fn the_fastest_motor_steps_evenly_up_to_66_667_steps_a_second_and_nearly_so_at_100_000() {
    for rate in [20_000.0, 66_667.0, 80_000.0, 100_000.0] {
        for busy in [false, true] {
            let (share, most) = unevenness(rate, busy);
            let percent = share * 100.0;
            println!(
                "{rate}, busy {busy}: {percent:.1} % of the intervals are off, by up to {most} cycles"
            );
            let (shares, cycles) = if rate > 66_667.0 { (0.25, 64) } else { (0.0, 0) };
            assert!(share <= shares && most <= cycles, "{rate}: {percent:.1} %, {most} cycles");
        }
    }
}
