//! Overrides on the image: how soon the steps follow the byte that asks for an override.

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::{Host, Machine, Stopwatch};

use crate::common::{MS, booted, say_line, say_now, set};

/// Longest time for every change, ms.
const LIMIT_MS: f64 = 20.0;
/// Time that it takes to see the change in short moves, ms. 8 steps take 1 ms, and the velocity must change by 0.2 %,
/// which takes 1.3 ms under a low jerk limit.
const SEEN_MS: f64 = 2.3;
/// Two jerk limits, millions of mm/min^3: one so high that it does not limit any acceleration, and one with which an
/// acceleration takes 22 ms to build up.
const JERKS: [f64; 2] = [1e6, 5_000.0];
/// The function that computes all keys anew.
const REPLAN: &str = "<kerf::motion::queue::BlockQueue>::replan";

/// What asks for another override.
#[derive(Clone, Copy, Debug)]
enum Say {
    Character(u8),
    Line(&'static str),
}
use Say::{Character, Line};

/// Feeds go up and down, by a little and by a lot.
const FEEDS: [Say; 10] = [
    Character(0x91),
    Character(0x91),
    Character(0x90),
    Character(0x92),
    Character(0x92),
    Character(0x90),
    Line("{mfo:0.5}"),
    Line("{mfo:1.3}"),
    Line("{mfo:0.4}"),
    Line("{mfo:1}"),
];

/// Traverses are slowed down, and go back to what they were.
const TRAVERSES: [Say; 7] = [
    Character(0x96),
    Character(0x97),
    Character(0x95),
    Line("{mto:0.7}"),
    Line("{mto:0.25}"),
    Line("{mto:0.5}"),
    Character(0x95),
];

/// A board with this jerk limit, and its sender.
fn board(jerk: f64) -> (Machine, Host) {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    let limits = format!("{{x:{{vm:1500,fr:3000,ac:1000,jm:{jerk}}}}}");
    set(&mut machine, &mut host, &limits);
    (machine, host)
}

/// Adds a stopwatch for the cost of planning anew.
fn add_replan_watch(machine: &mut Machine) {
    let entry = machine.image().function(REPLAN).unwrap();
    machine.add_stopwatch(Stopwatch::calls(entry));
}

/// Sends an override, and returns the cycle at which its last bit has come.
fn say(machine: &mut Machine, host: &mut Host, what: Say) -> u64 {
    match what {
        Character(byte) => say_now(machine, byte),
        Line(text) => say_line(machine, host, text),
    }
}

/// Returns when the steps of X first differ from all steps before `from`: `steps` steps take a time that they have
/// not taken before, by more than a cycle for each step.
fn begins(machine: &Machine, from: u64, steps: usize) -> u64 {
    let x = machine.recorder().steps_of(0);
    let taken: Vec<(u64, u64)> =
        x.windows(steps + 1).map(|pair| (pair[steps], pair[steps] - pair[0])).collect();
    let (before, after) = taken.split_at(taken.partition_point(|(at, _)| *at <= from));
    let usual = before.iter().map(|(_, taken)| *taken);
    let (least, most) = (usual.clone().min().unwrap(), usual.max().unwrap());
    let usual = least - steps as u64..=most + steps as u64;
    after.iter().find(|(_, taken)| !usual.contains(taken)).expect("it follows").0
}

/// How much later in its tick a pulse comes if it waits for all other interrupts, cycles. This happens at one of two
/// velocities whose ticks are on both sides of `Pace::settles`. The step between the two takes longer by that time.
const SETTLES: u64 = 44;

/// Checks that no segment has come late: no step has taken longer than the steps at the slower of the two velocities.
fn check_no_stop(machine: &Machine) {
    let x = machine.recorder().steps_of(0);
    let taken: Vec<u64> = x.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let ends = taken[..100].iter().chain(&taken[taken.len() - 20..]);
    let (slowest, usual) = (taken.iter().max().unwrap(), ends.max().unwrap());
    assert!(*slowest <= usual + usual / 100 + SETTLES, "{slowest} cycles instead of {usual}");
}

/// Returns the longest time from any of these overrides to its effect, ms. The effect is seen in the time that
/// `steps` steps take.
fn slowest(machine: &mut Machine, host: &mut Host, says: &[Say], steps: usize) -> f64 {
    let mut worst = 0;
    for (n, what) in (0u64..).zip(says.iter().cycle().take(2 * says.len())) {
        // The overrides come at all phases of a stretch, each when the change before it is over.
        host.run_until(machine, machine.cycle() + 150 * MS).unwrap();
        machine.recorder_mut().keep_log();
        host.run_until(machine, machine.cycle() + 60 * MS + n * 5_737).unwrap();
        let from = say(machine, host, *what);
        host.run_until(machine, from + 40 * MS).unwrap();
        let at = begins(machine, from, steps);
        check_no_stop(machine);
        worst = worst.max(at - from);
    }
    worst as f64 / MS as f64
}

#[test]
fn a_long_move_follows_within_20_ms() {
    for jerk in JERKS {
        for (line, says) in [("g1 x400 f1500", &FEEDS[..]), ("g0 x400", &TRAVERSES)] {
            let (mut machine, mut host) = board(jerk);
            set(&mut machine, &mut host, line);
            host.run_for_ms(&mut machine, 100).unwrap();
            let worst = slowest(&mut machine, &mut host, says, 1);
            println!("{line}, jerk {jerk:.0}: {worst:.2} ms at most");
            // Measured: 12.8 and 14.6 ms.
            assert!(worst <= LIMIT_MS, "{worst} ms");
        }
    }
}

#[test]
fn a_queue_of_short_moves_follows_within_20_ms() {
    for jerk in JERKS {
        let (mut machine, mut host) = board(jerk);
        add_replan_watch(&mut machine);
        set(&mut machine, &mut host, "g1 f600");
        (1..1_000).for_each(|n| host.queue(n, &format!("x{:.1}", n as f64 * 0.1)));
        host.run_for_ms(&mut machine, 1_000).unwrap();
        let worst = slowest(&mut machine, &mut host, &FEEDS, 8);
        let replan = machine.stopwatches()[0].cost();
        println!("short moves, jerk {jerk:.0}: {worst:.2} ms at most, {replan:?}");
        // Measured: 13.1 and 20.9 ms.
        assert!(worst <= LIMIT_MS + SEEN_MS, "{worst} ms");
        // Measured: 51,500 cycles, 800 a block.
        assert!(replan.count >= 20 && replan.max <= 57_000, "{replan:?}");
    }
}

#[test]
fn to_plan_a_queue_of_corners_anew_makes_no_segment_late() {
    let (mut machine, mut host) = board(5_000.0);
    set(&mut machine, &mut host, "{y:{vm:1500,fr:3000,ac:1000,jm:5000}}");
    add_replan_watch(&mut machine);
    set(&mut machine, &mut host, "g91 g1 f600");
    (0..1_000).for_each(|n| host.queue(n, if n % 2 == 0 { "x.1" } else { "y.1" }));
    host.run_for_ms(&mut machine, 1_000).unwrap();
    machine.recorder_mut().keep_log();
    for what in FEEDS {
        say(&mut machine, &mut host, what);
        host.run_for_ms(&mut machine, 200).unwrap();
    }
    let replan = machine.stopwatches()[0].cost();
    println!("corners: {replan:?}");
    // Measured: 163,000 cycles, 2,500 a key with its velocity.
    assert!(replan.count >= 10 && replan.max <= 175_000, "{replan:?}");
    // At a corner up to 20,800 cycles pass from step to step. A longer time would be a stop.
    let log = machine.recorder().log();
    let longest = log.windows(2).map(|pair| pair[1].cycle - pair[0].cycle).max().unwrap();
    println!("longest {longest}");
    assert!(longest <= 22_000, "{longest} cycles without a step");
}
