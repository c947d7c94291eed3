//! The words of a thread at the pins of the chip, in both dialects: where the thread ends, and where the axes are at
//! each index pulse.
//!
//! Many passes are cut in one run of the simulator. Each begins with X and Z at 0. At an index pulse the distance
//! from the beginning must be a whole number of leads, except for the angle between the index and the next sync
//! pulse.

use kerf::boards::{Board, MEGA2560_GRBL_LATHE, MEGA2560_LATHE};
use kerf_sim::mechanics::{Bounce, Sensors};

use crate::common::turning::{Cut, Lathe, STEP, STEPS, apart};

const X: usize = 0;
const Z: usize = 1;
const BOARDS: [&Board; 2] = [&MEGA2560_LATHE, &MEGA2560_GRBL_LATHE];
/// Sync pulses in a turn. The first is half of their distance behind the index.
const PULSES: u32 = 4;

/// Returns the share of a lead by which the axes are behind a whole number of leads at an index pulse.
fn behind(pulses: u32) -> f64 {
    if pulses == 1 { 0.0 } else { 0.5 / f64::from(pulses) }
}

/// The lines before a thread, the line of the thread, how far it moves X and Z, mm, and the distance of the longer
/// axis in a turn.
struct Words {
    before: &'static [&'static str],
    line: &'static str,
    way: [f64; 2],
    lead: f64,
}

const fn words(
    before: &'static [&'static str],
    line: &'static str,
    way: [f64; 2],
    lead: f64,
) -> Words {
    Words { before, line, way, lead }
}

/// Each thread begins at 0, 0 with the modes of the beginning.
const WORDS: [Words; 22] = [
    words(&["g91"], "g33 z-6 k1", [0.0, -6.0], 1.0),
    words(&["g91"], "g33 z6 k1.25", [0.0, 6.0], 1.25),
    words(&["g91"], "g32 z-6 k1", [0.0, -6.0], 1.0),
    words(&["g90"], "g33 z-7.525 k1.5", [0.0, -7.525], 1.5),
    // A face thread, also in diameter mode, where K keeps its meaning.
    words(&["g91"], "g33 x-6 k1", [-6.0, 0.0], 1.0),
    words(&["g91 g7"], "g33 x12 k1", [6.0, 0.0], 1.0),
    words(&["g90 g7"], "g32 x-12 k0.8", [-6.0, 0.0], 0.8),
    // Tapers: the lead applies to the axis that moves farther.
    words(&["g91"], "g33 x-1 z-7 k1", [-1.0, -7.0], 1.0),
    words(&["g91"], "g33 x7 z-2 k1", [7.0, -2.0], 1.0),
    words(&["g91 g7"], "g33 x2 z-7 k1", [1.0, -7.0], 1.0),
    words(&["g91 g20"], "g33 z-0.25 k0.05", [0.0, -6.35], 1.27),
    words(&["g90 g20"], "g33 x0.25 k0.05", [6.35, 0.0], 1.27),
    words(&["g10 l2 p1 z0.5"], "g90 g54 g33 z-6.5 k1", [0.0, -6.0], 1.0),
    words(&["g10 l2 p2 z1 x3"], "g90 g55 g33 z-7 k1", [0.0, -6.0], 1.0),
    words(&["g10 l2 p3 z-1.5"], "g90 g56 g33 z-4.5 k1", [0.0, -6.0], 1.0),
    words(&["g10 l2 p4 z2"], "g90 g57 g33 z-8 k1", [0.0, -6.0], 1.0),
    words(&["g10 l2 p5 x2.5"], "g90 g58 g33 x3.5 k1", [6.0, 0.0], 1.0),
    words(&["g10 l2 p6 z-3"], "g90 g59 g33 z-3 k1", [0.0, -6.0], 1.0),
    words(&["g92 z10"], "g90 g33 z4 k1", [0.0, -6.0], 1.0),
    words(&["g43.1 z2"], "g90 g33 z-8 k1", [0.0, -6.0], 1.0),
    words(&["g43.1 z2", "g10 l2 p2 z1", "g55 g92 z4"], "g90 g33 z-2 k1", [0.0, -6.0], 1.0),
    words(&["g20 g91 g43.1 z0.1"], "g21 g90 g33 z-8.54 k1", [0.0, -6.0], 1.0),
];

/// Ends whatever an earlier line may have begun, and goes back to 0, 0.
const AFTER: [&str; 7] = [
    "g21 g90 g8 g94",
    "g92.1 g49",
    "g10 l2 p1 x0 z0",
    "g10 l2 p2 x0 z0",
    "g54",
    "g53 g0 x0 z0",
    "g4 p0.01",
];

/// Checks that the thread is where the spindle requires it at each index pulse.
fn holds(lathe: &mut Lathe, words: &Words, pulses: u32) {
    words.before.iter().for_each(|line| lathe.take(line));
    let cut = lathe.cut(words.line);
    let (line, name) = (words.line, if lathe.grbl { "grbl" } else { "tinyg" });
    let way = words.way.map(|way| (way * STEPS).round() as i64);
    assert_eq!(cut.end, way, "{name}: {line} ends elsewhere");
    let axis = if words.way[X].abs() > words.way[Z].abs() { X } else { Z };
    let phases = cut.phases(axis, words.lead);
    let off = |phase: &f64| apart(*phase, -words.lead * behind(pulses), words.lead);
    let most = phases.iter().map(off).fold(0.0, f64::max);
    println!("{name}: {:?} {line}: {} turns, {most:.4} mm", words.before, phases.len());
    assert!(phases.len() >= 2 && most < STEP, "{name}: {line}: {phases:.4?}");
    // The other axis is on the line.
    let slope = words.way[1 - axis] / words.way[axis];
    for at in &cut.indexed {
        let off = at[1 - axis] as f64 - at[axis] as f64 * slope;
        assert!(off.abs() <= 1.0 + slope.abs(), "{name}: {line}: {at:?}");
    }
    AFTER.iter().for_each(|line| lathe.take(line));
    lathe.rest();
    assert_eq!(lathe.motors(), [0, 0]);
}

/// Checks that nothing was reported, and that every pulse was as expected.
fn all_fit(lathe: &mut Lathe, why: &str) {
    let exceptions = lathe.exceptions();
    assert!(exceptions.is_empty(), "{why}: {exceptions:?}");
    // In grbl's dialect a misfit is only a message.
    if !lathe.grbl {
        assert_eq!(lathe.value("spx"), 0.0, "{why}");
    }
}

#[test]
fn each_word_of_a_thread_cuts_to_the_step_and_in_phase() {
    for board in BOARDS {
        let mut lathe = Lathe::new(board, PULSES, |_| {});
        lathe.turn(600.0);
        WORDS.iter().for_each(|words| holds(&mut lathe, words, PULSES));
        all_fit(&mut lathe, board.name);
        assert_eq!(lathe.machine.missed_tops(), 0);
    }
}

/// What is left of a long line has 24 bits, and a slow line advances by few of them in a stretch.
#[test]
fn long_slow_threads_keep_their_lead() {
    for (board, line, rpm) in
        [(BOARDS[0], "g33 z-60 k1", 120.0), (BOARDS[1], "g33 z-290 k0.75", 150.0)]
    {
        let lead = if line.ends_with("k1") { 1.0 } else { 0.75 };
        let mut lathe = Lathe::new(board, PULSES, |_| {});
        lathe.turn(rpm);
        let since = lathe.turns();
        lathe.take("g91");
        lathe.begin(line, Z, 25.0);
        let cut = Cut { start: [0, 0], end: lathe.motors(), indexed: lathe.indexed(since) };
        let phases = cut.phases(Z, lead);
        let off = |phase: &f64| apart(*phase, -lead * behind(PULSES), lead);
        let most = phases.iter().map(off).fold(0.0, f64::max);
        println!("{}: {line} at {rpm} rpm: {} turns, {most:.4} mm", board.name, phases.len());
        assert!(phases.len() >= 20 && most < STEP, "{line}: {phases:.4?}");
    }
}

#[test]
fn the_starts_of_a_thread_lie_a_part_of_its_lead_apart() {
    for (board, starts, lead, rpm) in
        [(BOARDS[0], 3, 3.0, 300.0), (BOARDS[1], 4, 2.0, 600.0), (BOARDS[0], 2, 1.5, 900.0)]
    {
        let mut lathe = Lathe::new(board, PULSES, |_| {});
        lathe.turn(rpm);
        let part = lead / f64::from(starts);
        let mut first = None;
        // Each start is cut twice, so that it must also agree with itself.
        for n in (0..starts).chain(0..starts) {
            let shift = part * f64::from(n);
            lathe.take(&format!("g90 g0 z{shift}"));
            lathe.rest();
            let cut = lathe.cut(&format!("g33 z{} k{lead}", shift - 5.0 * lead));
            // The phase of the position of Z, not of the beginning.
            for way in cut.phases(Z, lead) {
                let phase = way - shift;
                let of = *first.get_or_insert(phase);
                let off = apart(phase, of - shift, lead);
                assert!(off < STEP, "start {n} of {starts} is {off:.4} mm off");
            }
        }
        println!("{}: {starts} starts of {lead} mm at {rpm} rpm", board.name);
    }
}

/// Sends lines and characters within a pass that must have no effect on it.
fn disturb(lathe: &mut Lathe) {
    if lathe.grbl {
        // Feed and rapid overrides, down and up, and a cycle start.
        for byte in [0x92, 0x92, 0x97, 0x91, 0x91, 0x91, 0x96, b'~'] {
            lathe.machine.send(&[byte]);
            lathe.run_for_ms(40);
        }
    } else {
        for line in ["{mfo:0.5}", "{mto:0.3}", "{mfo:1.9}", "~{stat:n}"] {
            lathe.take(line);
            lathe.run_for_ms(40);
        }
    }
}

#[test]
fn overrides_and_a_hold_within_a_pass_leave_the_thread_whole() {
    for (board, pulses, rpm) in [
        (BOARDS[0], 4, 300.0),
        (BOARDS[1], 4, 300.0),
        (BOARDS[0], 100, 600.0),
        (BOARDS[1], 100, 600.0),
    ] {
        let mut lathe = Lathe::new(board, pulses, |_| {});
        lathe.turn(rpm);
        let since = lathe.turns();
        lathe.take("g91");
        lathe.begin("g33 z-14 k1", Z, 3.0);
        disturb(&mut lathe);
        lathe.machine.send_now(b'!');
        lathe.run_for_ms(20);
        assert_eq!(lathe.status().state, "Hold");
        let moves = lathe.motors();
        lathe.run_for_ms(100);
        assert_ne!(lathe.motors(), moves, "the pass goes on");
        lathe.run_for_ms(4_000);
        let status = lathe.status();
        assert_eq!((status.state.as_str(), lathe.motors()), ("Hold", [0, -2_800]));
        lathe.agrees(&status, "held");
        let cut = Cut { start: [0, 0], end: lathe.motors(), indexed: lathe.indexed(since) };
        let phases = cut.phases(Z, 1.0);
        let most =
            phases.iter().map(|phase| apart(*phase, -behind(pulses), 1.0)).fold(0.0, f64::max);
        println!("{}: N {pulses}, overrides and a hold: {most:.4} mm", board.name);
        assert!(phases.len() >= 9 && most < STEP, "{phases:.4?}");
        lathe.machine.send_now(b'~');
        lathe.take("g0 z14");
        assert_eq!(lathe.rest().state, "Idle");
        assert_eq!(lathe.motors(), [0, 0]);
    }
}

/// A spindle: pulses a turn, turns a minute, changes of its sensors, and the debounce setting, us.
type Sensed = (u32, f64, fn(&mut Sensors), u32);

/// 100 us in cycles, by which edges come late at random.
const JITTER: u64 = 1_600;

#[test]
fn sensors_that_jitter_bounce_or_are_wide_cut_as_well() {
    let sensors: [Sensed; 12] = [
        (1, 1_000.0, |of| of.jitter = JITTER, 0),
        (4, 1_000.0, |of| of.jitter = JITTER, 0),
        (100, 1_000.0, |of| of.jitter = JITTER, 0),
        (4, 300.0, |of| of.bounce = Some(Bounce { times: 3, cycles: 3_000 }), 500),
        (8, 600.0, |of| of.bounce = Some(Bounce { times: 5, cycles: 1_500 }), 200),
        // Some of 10,000 edges come while the results of the handler are being read.
        (100, 300.0, |of| of.bounce = Some(Bounce { times: 3, cycles: 3_000 }), 250),
        (100, 300.0, |of| of.bounce = Some(Bounce { times: 3, cycles: 3_000 }), 250),
        // The pulse is 50 us of a turn of 100 ms, and all but 50 us of the distance between two pulses.
        (4, 600.0, |of| (of.index_width, of.width) = (0.0006, 0.0024), 0),
        (100, 600.0, |of| (of.index_width, of.width) = (0.0006, 0.06), 0),
        (4, 600.0, |of| (of.index_width, of.width) = (0.98, 0.95), 0),
        (100, 300.0, |of| (of.index_width, of.width) = (0.98, 0.9), 0),
        // The index is next to a sync pulse.
        (4, 600.0, |of| of.phase = 0.01, 0),
    ];
    for (n, (pulses, rpm, change, bounces)) in sensors.into_iter().enumerate() {
        let mut lathe = Lathe::new(BOARDS[n % 2], pulses, change);
        lathe.set(&format!("spb:{bounces}"));
        lathe.turn(rpm);
        lathe.take("g91");
        let phases = lathe.cut("g33 z-9 k1").phases(Z, 1.0);
        let mut of = Sensors::of(BOARDS[n % 2], pulses).unwrap();
        change(&mut of);
        // If edges of the index come late, the axes have moved on by this much.
        let late = of.jitter as f64 / 16e6 * rpm / 60.0;
        let behind = if pulses == 1 { 0.0 } else { of.phase };
        let most = phases.iter().map(|phase| apart(*phase, -behind, 1.0)).fold(0.0, f64::max);
        println!("N {pulses}, {rpm} rpm, {of:?}: {most:.4} mm");
        assert!(phases.len() >= 5 && most < STEP + late, "N {pulses}, {of:?}: {phases:.4?}");
        all_fit(&mut lathe, &format!("N {pulses}, {of:?}"));
    }
}
