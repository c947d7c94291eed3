//! Holds within threads and taps at the pins of the chip, in both dialects: X leaves the cut without losing a step and
//! without leaving its travel, and the spindle pauses only where no axis follows it.

use kerf::boards::{Board, MEGA2560_GRBL_LATHE, MEGA2560_LATHE};

use crate::common::turning::{Lathe, RPM, STEPS, driven};

const X: usize = 0;
const Z: usize = 1;
const BOARDS: [&Board; 2] = [&MEGA2560_LATHE, &MEGA2560_GRBL_LATHE];
/// How far X leaves the cut, mm.
const RETRACT: i64 = 2;

/// A lathe whose X leaves the cut, and whose spindle turns whatever its outputs are.
fn turning(board: &'static Board) -> Lathe {
    let mut lathe = Lathe::new(board, 4, |_| {});
    lathe.set(&format!("spr:{RETRACT}"));
    lathe.turn(RPM);
    lathe
}

/// Holds the machine, and waits until it rests in the hold.
fn hold(lathe: &mut Lathe, why: &str) {
    lathe.machine.send_now(b'!');
    lathe.run_for_ms(1_500);
    let status = lathe.rest();
    assert_eq!(status.state, "Hold", "{why}");
    lathe.agrees(&status, why);
}

/// Drops the program, and moves back to the start.
fn start_anew(lathe: &mut Lathe) {
    lathe.machine.send_now(if lathe.grbl { 0x18 } else { 4 });
    lathe.run_for_ms(100);
    lathe.turn(RPM);
    lathe.recover();
}

#[test]
fn a_hold_in_or_behind_the_taper_of_a_thread_loses_no_step() {
    for (board, taper) in [(BOARDS[0], 1.25), (BOARDS[1], 1.2), (BOARDS[0], 0.9)] {
        let mut lathe = turning(board);
        let line = format!("g76 p1.25 z-20 i-0.5 j0.6 k0.6 e{taper} l3");
        for far in [0.3, 0.8, 1.0, 1.1, 1.2, 1.3, 1.4, 1.6, 3.0] {
            let why = format!("{line}, held at {far} mm");
            lathe.take("g90");
            lathe.begin(&line, Z, far);
            hold(&mut lathe, &why);
            let [x, z] = lathe.motors();
            // Beside the line of the cut, and not at the end of the pass.
            assert!(x >= (RETRACT as f64 * STEPS) as i64 - 250, "{why}: X at {x}");
            assert!(z > -10 * STEPS as i64, "{why}: Z at {z}");
            start_anew(&mut lathe);
        }
    }
}

#[test]
fn the_way_back_to_a_thread_stays_within_the_travel_of_x() {
    for board in BOARDS {
        let mut lathe = turning(board);
        for setting in ["xtn:-100", "xtm:1", "ztn:-100", "ztm:100", "spr:5", "sl:1"] {
            lathe.set(setting);
        }
        lathe.take("g28.3 x0 z0");
        lathe.take("g91");
        lathe.begin("g33 z-6 k1", Z, 2.0);
        hold(&mut lathe, "held");
        assert_eq!(lathe.motors()[X], STEPS as i64, "X leaves the cut to the end of its travel");
        lathe.machine.send_now(b'~');
        let mut most = 0;
        for _ in 0..400 {
            lathe.run_for_ms(5);
            most = most.max(lathe.motors()[X]);
        }
        assert_eq!(most, STEPS as i64, "X leaves its travel on the way back");
        assert_eq!(lathe.rest().state, "Idle");
        assert_eq!(lathe.motors(), [0, -6 * STEPS as i64]);
    }
}

/// Returns how often the spindle turns in a second.
fn turns(lathe: &mut Lathe) -> usize {
    let before = lathe.turns();
    lathe.run_for_ms(1_000);
    lathe.turns() - before
}

/// Lines that follow the spindle, the retract, and where Z ends, mm.
const FOLLOW: [(&str, i64, i64); 3] =
    [("g33 z-5 k1", 2, -5), ("g33 z-5 k1", 0, -5), ("g33.1 z-5 k1", 0, 0)];

#[test]
fn a_spindle_that_pauses_in_holds_cuts_threads_and_taps_all_the_same() {
    for board in BOARDS {
        let mut lathe = driven(board);
        ["spph:1", "coph:1", "spde:0.5"].iter().for_each(|setting| lathe.set(setting));
        lathe.take("m8");
        for (line, retract, end) in FOLLOW {
            let why = format!("{line}, spr {retract}");
            lathe.set(&format!("spr:{retract}"));
            lathe.begin(line, Z, 2.0);
            lathe.machine.send_now(b'!');
            lathe.run_for_ms(6_000);
            assert_eq!(lathe.status().state, "Hold", "{why}");
            assert_eq!(turns(&mut lathe), 0, "{why}: the spindle pauses");
            lathe.machine.send_now(b'~');
            lathe.run_for_ms(4_000);
            let status = lathe.rest();
            assert_eq!(status.state, "Idle", "{why}: {:?}", lathe.exceptions());
            assert!(lathe.exceptions().is_empty(), "{why}: {:?}", lathe.exceptions());
            assert_eq!(lathe.motors(), [0, end * STEPS as i64], "{why}");
            assert!(turns(&mut lathe) >= 4, "{why}: the spindle turns again");
            lathe.take("g90 g53 g0 z0");
            lathe.rest();
            lathe.take("g91");
        }
    }
}
