//! G33.1, G95 and G96 at the pins of the chip, in both dialects: the normal case, and each fault of `docs/safety.md`
//! from F8 to F13.

use kerf::boards::{Board, MEGA2560_GRBL_LATHE, MEGA2560_LATHE};

use crate::common::share::share_of;
use crate::common::turning::{Lathe, MARKS, RPM, STEPS, driven};

const Z: usize = 1;
const BOARDS: [&Board; 2] = [&MEGA2560_LATHE, &MEGA2560_GRBL_LATHE];
/// Velocity in a thread of 1 mm, mm/s.
const SPEED: f64 = RPM / 60.0;
/// Depth of a tap, mm.
const DEEP: f64 = 5.0;
const TAP: &str = "g33.1 z-5 k1";

/// Checks that one exception was reported, by its number or its message, and no other, and that the position is known
/// to the step.
fn failed(lathe: &mut Lathe, exception: u16, message: &str) {
    let status = lathe.rest();
    assert_eq!(status.state, "Alarm", "{message}");
    assert_eq!(lathe.told(exception, message), 1, "{:?}", lathe.exceptions());
    assert_eq!(lathe.exceptions().len(), 1, "{:?}", lathe.exceptions());
    lathe.agrees(&status, message);
}

#[test]
fn a_tap_comes_back_to_where_it_began_and_a_hold_waits_for_that() {
    for board in BOARDS {
        let mut lathe = driven(board);
        for holds in [false, true] {
            lathe.begin(TAP, Z, 2.0);
            if holds {
                lathe.machine.send_now(b'!');
            }
            let mut deepest = 0;
            for _ in 0..2_500 {
                lathe.run_for_ms(2);
                deepest = deepest.min(lathe.motors()[Z]);
            }
            let beyond = -deepest as f64 / STEPS - DEEP;
            assert!((0.0..1.6).contains(&beyond), "{beyond} mm beyond its end");
            if holds {
                assert_eq!(lathe.status().state, "Hold");
                assert!(lathe.motors()[Z] >= 0, "it is in the hole");
                lathe.machine.send_now(b'~');
                lathe.run_for_ms(200);
            }
            let status = lathe.rest();
            assert_eq!((status.state.as_str(), lathe.motors()), ("Idle", [0, 0]));
            lathe.agrees(&status, TAP);
            assert!(lathe.exceptions().is_empty(), "{:?}", lathe.exceptions());
        }
        lathe.take("g0 z1");
        lathe.rest();
        assert_eq!(lathe.motors(), [0, STEPS as i64]);
    }
}

#[test]
fn a_spindle_that_does_not_turn_round_ends_a_tap_within_the_way_of_a_second() {
    for board in BOARDS {
        let mut lathe = driven(board);
        lathe.begin(TAP, Z, 2.0);
        for _ in 0..4_000 {
            lathe.machine.tamper(|mechanics, now| mechanics.drive_spindle_to(RPM, now));
            lathe.run_for_ms(1);
        }
        failed(&mut lathe, 47, "[MSG:Spindle did not turn round]");
        let beyond = -lathe.motors()[Z] as f64 / STEPS - DEEP;
        assert!((SPEED - 0.1..=SPEED + 0.01).contains(&beyond), "{beyond} mm beyond its end");
        lathe.recover();
    }
}

/// Stops the spindle abruptly when the tap is `deep`. Returns how far Z moves on, mm.
fn jams(lathe: &mut Lathe, deep: f64) -> f64 {
    lathe.begin(TAP, Z, deep);
    lathe.machine.tamper(|mechanics, now| mechanics.force_spindle(0.0, now));
    let at = lathe.motors()[Z];
    lathe.run_for_ms(1_000);
    (at - lathe.motors()[Z]) as f64 / STEPS
}

#[test]
fn a_spindle_that_stops_dead_on_the_way_in_stops_a_tap() {
    // Two pulses, the delay of 1 ms of the sensors, the queued segments, and the ramp.
    let most = 2.1 / f64::from(MARKS) + SPEED * 0.015 + SPEED * SPEED / 1_000.0;
    for board in BOARDS {
        let mut lathe = driven(board);
        let went = jams(&mut lathe, 2.0);
        println!("{}: Z goes on by {went:.3} mm of {most:.3}", board.name);
        assert!(went <= most, "{}: Z goes on by {went} mm", board.name);
        failed(&mut lathe, 44, "[MSG:Spindle lost in a thread]");
        lathe.recover();
    }
}

#[test]
fn a_spindle_that_stops_dead_while_it_turns_round_stops_a_tap() {
    // A pulse, the queued segments and the ramp, all at full speed although the spindle is slower by then; plus a creep
    // of 0.01 mm/s.
    let most = 1.1 / f64::from(MARKS) + SPEED * 0.02 + SPEED * SPEED / 1_000.0 + 0.01;
    let slowed = |lathe: &mut Lathe| {
        let mut rpm = RPM;
        lathe.machine.tamper(|mechanics, now| rpm = mechanics.spindle_rpm(now));
        rpm < 0.9 * RPM
    };
    for board in BOARDS {
        // The spindle stands 440 ms later, and then turns back.
        for &later in share_of(&[0, 20, 200, 350, 480, 520, 600], 2) {
            let mut lathe = driven(board);
            lathe.begin(TAP, Z, 4.0);
            while !slowed(&mut lathe) {
                lathe.run_for_ms(1);
            }
            lathe.run_for_ms(later);
            lathe.machine.tamper(|mechanics, now| mechanics.force_spindle(0.0, now));
            let at = lathe.motors()[Z];
            lathe.run_for_ms(1_000);
            let went = (at - lathe.motors()[Z]).abs() as f64 / STEPS;
            println!("{}: {later} ms later, Z goes on by {went:.3} mm of {most:.3}", board.name);
            assert!((0.0..=most).contains(&went), "{later}: {went}");
            lathe.run_for_ms(6_000);
            failed(&mut lathe, 44, "[MSG:Spindle lost in a thread]");
        }
    }
}

#[test]
fn a_feed_a_turn_ends_with_the_spindle_and_waits_six_seconds() {
    for board in BOARDS {
        let mut lathe = Lathe::new(board, MARKS, |_| {});
        lathe.take("m3 s300");
        lathe.run_for_ms(100);
        // The spindle stops in the cut, or never turns.
        for turns in [true, false] {
            lathe.forget();
            if turns {
                lathe.turn(RPM);
            }
            lathe.take("g91 g95 f0.2");
            lathe.take("g1 z-20");
            lathe.run_for_ms(2_000);
            assert_eq!(lathe.motors()[Z] != 0, turns);
            lathe.machine.tamper(|mechanics, now| mechanics.force_spindle(0.0, now));
            // Two pulses are 20 ms, exec checks every 20 ms, 1 mm/s stops in 2 ms, and the means are empty 60 ms later.
            lathe.run_for_ms(120);
            let stands = lathe.motors();
            lathe.run_for_ms(3_000);
            assert_eq!(lathe.status().state, "Run");
            lathe.run_for_ms(3_500);
            assert_eq!(lathe.motors(), stands, "it stays in the cut");
            failed(&mut lathe, 154, "[MSG:Spindle stands still]");
            lathe.recover();
            lathe.take("g94 m3");
        }
    }
}

#[test]
fn at_the_axis_of_the_spindle_surface_speed_is_limited_by_d() {
    for board in BOARDS {
        let mut lathe = Lathe::new(board, MARKS, |_| {});
        // S 24,000 is the full width of the pulses.
        for (line, share) in
            [("g96 s100 d2400 m3", 0.1), ("g96 s100", 1.0), ("g96 s100 d1200", 0.05)]
        {
            lathe.take("g90 g0 x20");
            lathe.rest();
            lathe.take(line);
            lathe.take("g0 x0");
            lathe.rest();
            lathe.run_for_ms(20);
            let is = lathe.machine.pulses().share;
            assert!((is - share).abs() < 1e-3, "{line}: {is}");
        }
        lathe.take("m5");
    }
}
