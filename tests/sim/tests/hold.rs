//! Feedhold on the image: how soon motion slows down, how far it goes on, and where it ends.

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::{Host, Machine};

use crate::common::share::share;
use crate::common::{booted, set};

const CLOCK: f64 = 16e6;
/// Steps in a mm with the default setup of axes.
const STEPS: f64 = 1280.0;
/// Acceleration limit of the setting, mm/s^2.
const ACCEL: f64 = 1_000.0;
/// Velocity of the move, mm/s.
const VELOCITY: f64 = 25.0;
/// Millions of mm/min^3: a jerk limit so high that it does not limit any acceleration.
const SHARP: f64 = 1e6;

/// A board with this jerk limit, and its sender.
fn board(jerk: f64) -> (Machine, Host) {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    // The slowest axis with a motor decides how long the means of motion are.
    for axis in ["x", "y", "z", "a"] {
        let limits = format!("{{{axis}:{{vm:3000,fr:3000,ac:{ACCEL},jm:{jerk}}}}}");
        set(&mut machine, &mut host, &limits);
    }
    machine.recorder_mut().keep_log();
    (machine, host)
}

/// Runs for `us` microseconds and sends `!`. Returns the cycle at which it is sent.
fn hold_after(machine: &mut Machine, host: &mut Host, us: u64) -> u64 {
    let end = machine.cycle() + us * 16;
    host.run_until(machine, end).unwrap();
    machine.send_now(b'!');
    machine.cycle()
}

/// Runs until the machine reports this state.
fn until_stat(machine: &mut Machine, host: &mut Host, stat: i64) {
    let end = machine.cycle() + machine.cycles(20_000);
    while host.stat() != Some(stat) {
        assert!(machine.cycle() < end, "it never comes to stat {stat}");
        host.run_until_line(machine, end).unwrap();
    }
}

fn positions(machine: &Machine) -> [i64; 2] {
    [0, 1].map(|m| machine.recorder().motors()[m].position)
}

/// Returns the first step of X after `from` that is slower than the feed, together with all steps behind it. A single
/// late step has only waited for an interrupt.
fn first_slower(machine: &Machine, from: u64) -> u64 {
    let steady = (CLOCK / VELOCITY / STEPS) as u64;
    let steps = machine.recorder().steps_of(0);
    let is_slower = |pair: &[u64]| pair[1] - pair[0] > steady + steady / 40;
    let slow_down = |few: &&[u64]| few[1] > from && few.windows(2).all(is_slower);
    steps.windows(4).find(slow_down).expect("it slows down")[1]
}

#[test]
fn it_slows_down_within_10_ms() {
    let one = vec!["g1 x100 f1500".to_string()];
    // Blocks that take 4, 3 and 2 ms, sent meanwhile, keep all tasks busy.
    let many = |way: f64| {
        let first = std::iter::once("g1 f1500".to_string());
        first.chain((1..400).map(|n| format!("x{:.3}", f64::from(n) * way))).collect()
    };
    for job in [one, many(0.1), many(0.075), many(0.05)] {
        let mut worst = 0;
        for n in share(30, 4) {
            let (mut machine, mut host) = board(SHARP);
            (0..).zip(&job).for_each(|(n, line)| host.queue(n, line));
            // Holds come at all phases of a segment and of status reports.
            let from = hold_after(&mut machine, &mut host, 300_000 + n * 5_137);
            host.run_for_ms(&mut machine, 100).unwrap();
            worst = worst.max(first_slower(&machine, from) - from);
        }
        let ms = worst as f64 / CLOCK * 1e3;
        println!("{} lines: slower after {ms:.2} ms at most", job.len());
        // A step that is plainly slower may come a part of a segment after the first slower one.
        assert!(ms > 1.0 && ms <= 10.0, "{ms} ms");
    }
}

#[test]
fn it_is_soon_the_last_of_moves_that_each_stop() {
    // Moves to and fro: length in mm, acceleration in mm/s^2, and the longest time from the hold to the last step,
    // ms. A move that has begun within 10 ms goes on for 2.5 ms if it is one of the shortest; the others come to rest
    // in the middle. At 20,000 mm/s^2 the jerk limit has an effect, and the means take 20 ms more.
    for (way, accel, most) in
        [(0.03, 20_000.0, 34.0), (0.03, 1_000.0, 16.0), (0.003, 1_000.0, 13.0), (0.01, 200.0, 16.0)]
    {
        let mut worst = 0;
        for n in share(30, 4) {
            let (mut machine, mut host) = board(SHARP);
            set(&mut machine, &mut host, &format!("{{xac:{accel},xvm:6000,xfr:6000}}"));
            (0..400)
                .for_each(|i| host.queue(i, &format!("g1f6000x{}", f64::from(i as u8 % 2) * way)));
            let from = hold_after(&mut machine, &mut host, 300_000 + n * 5_137);
            host.run_for_ms(&mut machine, 300).unwrap();
            let last = machine.recorder().steps_of(0).last().copied().unwrap_or_default();
            worst = worst.max(last.saturating_sub(from));
        }
        let ms = worst as f64 / CLOCK * 1e3;
        println!("moves of {way} mm at {accel} mm/s^2: the last step {ms:.2} ms behind it at most");
        assert!(ms < most, "{ms} ms");
    }
}

#[test]
fn it_stops_as_soon_as_the_limits_allow_and_ends_exactly() {
    // A jerk limit that matters: the acceleration takes 22 ms to build up.
    for jerk in [SHARP, 5_000.0] {
        let (mut machine, mut host) = board(jerk);
        set(&mut machine, &mut host, "g1 x100 y10 f1500");
        let from = hold_after(&mut machine, &mut host, 500_000);
        until_stat(&mut machine, &mut host, 6);
        host.run_for_ms(&mut machine, 500).unwrap();
        let steps = machine.recorder().steps_of(0);
        let after = steps.iter().filter(|step| **step > from).count() as f64;
        let way = after / STEPS * 101f64.sqrt() / 10.0;
        let build_up = if jerk == SHARP { 0.0 } else { ACCEL / (jerk * 1e6 / 216e3) };
        let best = 0.5 * VELOCITY * (VELOCITY / ACCEL + build_up);
        // The distance of what is queued when the hold comes is added, and that of the mean that rounds corners.
        let mean = if jerk == SHARP { 0.0 } else { 0.008 };
        let queued = (0.010 + mean) * VELOCITY;
        println!("stops in {way:.3} mm, {best:.3} at best, {queued:.3} queued");
        assert!(way >= best * 0.98 && way <= best * 1.02 + queued, "{way} mm, {best} at best");
        assert!(machine.recorder().last_step().unwrap() < machine.cycle() - machine.cycles(100));
        machine.send_now(b'~');
        until_stat(&mut machine, &mut host, 3);
        assert_eq!(positions(&machine), [128_000, 12_800]);
    }
}

#[test]
fn what_is_dropped_leaves_no_step_behind() {
    let (mut machine, mut host) = board(5_000.0);
    for n in 0..15 {
        // The hold comes in the middle of a move, at some phase of the steps of both axes.
        set(&mut machine, &mut host, "g91 g1 x30.123 y17.0071 f1500");
        set(&mut machine, &mut host, "g2 x6 y0 i3");
        set(&mut machine, &mut host, "g1 x-7.3 y3.3337");
        host.run_for_ms(&mut machine, 40 + 97 * n % 1_900).unwrap();
        machine.send(b"!%\n");
        let (x, y) = (n as i64 % 7 - 3, n as i64 % 5);
        set(&mut machine, &mut host, &format!("g90 g1 x{x} y{y} f1500"));
        // Runs until no motor has moved for a while.
        let mut before = [0; 2];
        while before != positions(&machine) {
            before = positions(&machine);
            host.run_for_ms(&mut machine, 200).unwrap();
        }
        assert_eq!(positions(&machine), [x * 1280, y * 1280], "round {n}");
    }
}

#[test]
fn a_kill_at_rest_shows_no_hold() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    set(&mut machine, &mut host, "{sr:{stat:t,hold:t,mots:t}}");
    for kill in [&b"!\x04"[..], b"\x04"] {
        machine.run_for_ms(100).unwrap();
        machine.receive();
        machine.send(kill);
        machine.run_for_ms(200).unwrap();
        let heard = String::from_utf8(machine.receive()).expect("ASCII");
        assert!(heard.contains("\"st\":207"), "{heard}");
        assert!(!heard.contains("\"stat\":6") && !heard.contains("\"mots\":2"), "{heard}");
    }
}
