//! Every fault of a spindle, and every stop, within a pass or before it, on the images of both dialects. The tests
//! check the exception, alarm or error; that X has retracted where a retract is set; the position to the step; the
//! answers meanwhile; and the recovery.
//!
//! Faults that leave the machine unchanged are tested in sequence in one run of the simulator.

use kerf::boards::inputs::{DOOR, STOP};
use kerf::boards::{Board, MEGA2560_GRBL_LATHE, MEGA2560_LATHE};
use kerf_sim::mechanics::{Build, Switch, Wiring};

use crate::common::turning::{Lathe, STEPS, Status};

const X: usize = 0;
const Z: usize = 1;
const BOARDS: [&Board; 2] = [&MEGA2560_LATHE, &MEGA2560_GRBL_LATHE];
/// The input of the lower switch of X.
const XMIN: usize = 0;
/// Longest time from a question to its answer, ms.
const ANSWERED_MS: f64 = 20.0;
/// Length of a thread, mm, and the distance by which X retracts from the cut.
const LENGTH: f64 = 12.0;
const RETRACT: f64 = 2.0;
/// End of the thread, in steps.
const END: [i64; 2] = [0, -(LENGTH * STEPS) as i64];

/// Marks in a turn, and turns a minute.
type Spindle = (u32, f64);

/// What happens during a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Stops,
    Reverses,
    Races,
    OneMissing,
    FourMissing,
    Extra,
    Hold,
    Door,
    Limit,
    Stop,
    Alarm,
    Reset,
}

/// Returns what is reported: the number in TinyG's dialect, and the text in grbl's.
fn exception(fault: Fault) -> Option<(u16, &'static str)> {
    Some(match fault {
        Fault::Stops | Fault::Reverses | Fault::FourMissing => {
            (44, "[MSG:Spindle lost in a thread]")
        }
        Fault::Races => (46, "[MSG:Thread too far off]"),
        Fault::OneMissing | Fault::Extra => (40, "[MSG:Spindle pulses do not fit]"),
        Fault::Limit => (204, "ALARM:1"),
        Fault::Stop => (205, "ALARM:3"),
        // The first exists in TinyG's dialect alone, the second in grbl's.
        Fault::Alarm => (203, ""),
        Fault::Reset => (0, "ALARM:3"),
        Fault::Hold | Fault::Door => return None,
    })
}

/// A lathe with a door, an emergency stop and a limit of X, all in use.
fn lathe(board: &'static Board, (marks, rpm): Spindle) -> Lathe {
    let mut build = Build::lathe(board, marks).unwrap();
    build.spindle.pwm = None;
    // The switch of X is far off, and the test closes it by hand.
    let far = Switch { at: -1e6, hysteresis: 0.0, wiring: Wiring::NormallyOpen };
    build.axes[X].min = Some(far);
    let mut lathe = Lathe::of(board, &build, marks);
    ["xsn:2", "saf:1", "est:1"].iter().for_each(|setting| lathe.set(setting));
    lathe.turn(rpm);
    lathe
}

/// Begins a thread, makes a fault happen after `far` mm of it, and checks the result.
fn cut(lathe: &mut Lathe, (marks, rpm): Spindle, retract: f64, far: f64, fault: Fault) {
    let dialect = if lathe.grbl { "grbl" } else { "tinyg" };
    let why = format!("{dialect}: {fault:?} at {far} mm, N {marks}, {rpm} rpm, spr {retract}");
    lathe.set(&format!("spr:{retract}"));
    lathe.set(&format!("spdi:{}", u8::from(fault == Fault::Reverses)));
    let (limit, most) = if fault == Fault::Races { (0.1, rpm * 1.1) } else { (0.0, 1_500.0) };
    lathe.set(&format!("spl:{limit}"));
    lathe.set(&format!("zfr:{most}"));
    lathe.set(&format!("zvm:{most}"));
    lathe.turn(rpm);
    lathe.forget();
    lathe.take("g91");
    lathe.begin(&format!("g33 z-{LENGTH} k1"), Z, far);
    let begun = lathe.motors()[Z];
    happen(lathe, (marks, rpm), fault);
    let mut longest = 0.0f64;
    for _ in 0..10 {
        longest = longest.max(lathe.status().took_ms).max(lathe.ask_other_port());
        lathe.run_for_ms(20);
    }
    let status = lathe.rest();
    lathe.agrees(&status, &why);
    let told = exception(fault).map(|(number, line)| lathe.told(number, line));
    assert!(told.is_none_or(|told| told == 1), "{:?}: {why}", lathe.exceptions());
    assert!(told.is_some() || lathe.exceptions().is_empty(), "{:?}: {why}", lathe.exceptions());
    judge(lathe, (marks, rpm), retract, begun, &status, fault, &why);
    println!("{why}: {}, {:?}, {longest:.1} ms", status.state, lathe.motors());
    assert!(longest <= ANSWERED_MS, "an answer took {longest:.1} ms: {why}");
    assert_eq!(lathe.machine.missed_tops(), 0, "{why}");
    // The machine works as before.
    lathe.turn(rpm);
    if status.state == "Alarm" {
        lathe.recover();
    } else {
        lathe.take("g90 g53 g0 x0 z0");
        lathe.rest();
        assert_eq!(lathe.motors(), [0, 0], "{why}");
    }
}

fn happen(lathe: &mut Lathe, (marks, rpm): Spindle, fault: Fault) {
    let pulse = (60_000.0 / rpm / f64::from(marks) * 16_000.0) as u64;
    let work = |lathe: &mut Lathe, input| {
        lathe.machine.tamper(|mechanics, now| mechanics.close(input, true, now));
    };
    match fault {
        Fault::Stops => lathe.machine.tamper(|mechanics, now| mechanics.force_spindle(0.0, now)),
        Fault::Reverses => {
            lathe.machine.tamper(|mechanics, now| mechanics.force_spindle(-rpm, now))
        }
        Fault::Races => {
            lathe.machine.tamper(|mechanics, now| mechanics.drive_spindle_to(2.0 * rpm, now))
        }
        Fault::OneMissing => {
            lathe.machine.tamper(|mechanics, _| mechanics.encoder().unwrap().miss(false, 1));
        }
        Fault::Extra => lathe.machine.tamper(|mechanics, now| {
            _ = mechanics.encoder().unwrap().add(false, now + 4_000, 1_600)
        }),
        Fault::FourMissing => {
            for _ in 0..4 {
                lathe.machine.tamper(|mechanics, _| mechanics.encoder().unwrap().miss(false, 0));
                lathe.machine.run_until(lathe.machine.cycle() + pulse).unwrap();
            }
        }
        Fault::Hold => lathe.machine.send_now(b'!'),
        Fault::Door => work(lathe, DOOR),
        Fault::Limit => work(lathe, XMIN),
        Fault::Stop => work(lathe, STOP),
        Fault::Alarm => drop(lathe.ask("{alarm:n}")),
        Fault::Reset => lathe.machine.send_now(0x18),
    }
}

/// Checks that the machine, at rest, has reacted to a fault as required.
fn judge(
    lathe: &mut Lathe,
    (marks, rpm): Spindle,
    retract: f64,
    begun: i64,
    status: &Status,
    fault: Fault,
    why: &str,
) {
    let (steps, state) = (lathe.motors(), status.state.as_str());
    let out = (retract * STEPS).round() as i64;
    // The move that joins what is queued may end a step before its length.
    let is_out = (steps[X] - out).abs() <= 1;
    let went = (begun - steps[Z]) as f64 / STEPS;
    let speed = rpm / 60.0;
    match fault {
        Fault::Stops | Fault::Reverses | Fault::FourMissing => {
            assert_eq!(state, "Alarm", "{why}");
            assert!(is_out, "{steps:?}: {why}");
            // Two pulses (or those that are missing), the queued segments, and the ramp.
            let pulses = if fault == Fault::FourMissing { 4.0 } else { 3.1 };
            let most = pulses / f64::from(marks) + speed * 0.015 + speed * speed / 1_000.0;
            assert!(went <= most, "{went} mm of {most}: {why}");
        }
        Fault::Races => {
            assert_eq!(state, "Alarm", "{why}");
            assert!(is_out && steps[Z] > END[Z], "{steps:?}: {why}");
        }
        Fault::OneMissing | Fault::Extra => {
            assert_eq!((state, steps), ("Idle", END), "{why}");
        }
        Fault::Hold | Fault::Door => {
            let wanted = if fault == Fault::Door && lathe.grbl { "Door" } else { "Hold" };
            assert_eq!(state, wanted, "{why}");
            let left =
                if retract == 0.0 { steps == END } else { steps[X] == out && steps[Z] > END[Z] };
            assert!(left, "{steps:?}: {why}");
            if fault == Fault::Door {
                lathe.machine.tamper(|mechanics, now| mechanics.close(DOOR, false, now));
                lathe.run_for_ms(100);
                assert_eq!(lathe.motors(), steps, "{why}: a door that is shut moves nothing");
            }
            lathe.machine.send_now(b'~');
            lathe.run_for_ms(200);
            let status = lathe.rest();
            assert_eq!((status.state.as_str(), lathe.motors()), ("Idle", END), "{why}");
            lathe.agrees(&status, why);
        }
        Fault::Limit | Fault::Stop => {
            assert_eq!(state, "Alarm", "{why}");
            // At once: Z has moved for 1 ms after the edge at most.
            assert!(steps[X] == 0 && went <= speed * 0.001 + 0.01, "{steps:?}: {why}");
            let input = if fault == Fault::Stop { STOP } else { XMIN };
            lathe.machine.tamper(|mechanics, now| mechanics.close(input, false, now));
            lathe.run_for_ms(50);
        }
        Fault::Alarm | Fault::Reset => {
            assert_eq!(state, "Alarm", "{why}");
            // The line takes 1 ms on the wire, and 9 ms are queued.
            let most = speed * 0.025 + speed * speed / 1_000.0;
            assert!(went <= most && is_out, "{steps:?}, {went} mm of {most}: {why}");
        }
    }
}

/// Makes faults happen in turn to a spindle, each a bit further into the thread.
fn all(spindle: Spindle, retract: f64, faults: &[Fault]) {
    for board in BOARDS {
        let mut lathe = lathe(board, spindle);
        for (n, fault) in faults.iter().enumerate() {
            let retract = if n % 2 == 0 { retract } else { -retract };
            cut(&mut lathe, spindle, retract, 2.0 + 0.625 * n as f64, *fault);
        }
    }
}

#[test]
fn with_few_pulses_each_fault_ends_a_thread_as_it_has_to() {
    use Fault::{Door, Extra, FourMissing, Hold, Limit, OneMissing, Races, Stop, Stops};
    let faults = [Stops, OneMissing, Hold, FourMissing, Limit, Extra, Races, Door, Stop];
    all((4, 300.0), RETRACT, &faults);
}

#[test]
fn an_alarm_and_a_reset_leave_the_cut() {
    // Only in grbl's dialect does a reset keep the position.
    for (board, fault) in [(BOARDS[0], Fault::Alarm), (BOARDS[1], Fault::Reset)] {
        for (spindle, retract) in [((4, 300.0), RETRACT), ((100, 600.0), 0.0)] {
            cut(&mut lathe(board, spindle), spindle, retract, 3.0, fault);
        }
    }
}

#[test]
fn without_a_retract_each_fault_ends_a_thread_as_it_has_to() {
    use Fault::{Door, FourMissing, Hold, Limit, Races, Reverses, Stops};
    let faults = [Hold, Stops, Reverses, FourMissing, Races, Limit, Door];
    all((8, 600.0), 0.0, &faults);
}

#[test]
fn with_many_pulses_each_fault_ends_a_thread_as_it_has_to() {
    use Fault::{Hold, OneMissing, Races, Reverses, Stop, Stops};
    let faults = [Stops, Reverses, OneMissing, Hold, Races, Stop];
    all((100, 600.0), RETRACT, &faults);
}

#[test]
fn with_the_index_alone_each_fault_ends_a_thread_as_it_has_to() {
    use Fault::{Hold, Limit, Stops};
    all((1, 1_000.0), RETRACT, &[Stops, Hold, Limit]);
}

/// Spindles that no thread can follow: turns a minute, whether there are sync pulses, and the exception or the error.
const REFUSED: [(f64, bool, u16, &str); 3] =
    [(0.0, true, 42, "error:18"), (300.0, false, 43, "error:19"), (2_000.0, true, 146, "error:12")];

#[test]
fn a_spindle_that_cannot_be_followed_moves_nothing() {
    for board in BOARDS {
        for (rpm, syncs, exception, error) in REFUSED {
            let mut lathe = Lathe::new(board, 4, |of| of.sync = of.sync.filter(|_| syncs));
            lathe.turn(rpm);
            lathe.take("g91");
            for line in ["g33 z-5 k1", "g32 x5 z-1 k1", "g76 p1 z-5 i-1 j0.2 k0.6"] {
                lathe.forget();
                refused(&mut lathe, line, exception, error);
            }
        }
        // The spindle turns in the opposite direction to that of M3.
        let mut lathe = Lathe::new(board, 8, |_| {});
        lathe.set("spdi:1");
        for line in ["g33 z-5 k1", "g76 p1 z-5 i-1 j0.2 k0.6"] {
            lathe.forget();
            lathe.take("m3 s300");
            lathe.run_for_ms(200);
            lathe.turn(-300.0);
            refused(&mut lathe, line, 55, "error:19");
            lathe.take("g91");
        }
        // No encoder is configured.
        lathe.set("spn:0");
        let answer = lathe.ask("g33 z-5 k1");
        assert!(answer == "error:39" || answer.contains("[1,41,"), "{answer}");
    }
}

/// Checks that a line is refused, and that the machine answers meanwhile on both ports. The same must hold for a
/// machine that is held while it waits, or reset.
fn refused(lathe: &mut Lathe, line: &str, exception: u16, error: &str) {
    let steps = lathe.machine.recorder().steps();
    lathe.machine.send(format!("{line}\n").as_bytes());
    // It waits six seconds for the spindle. Which of two tasks sees the refusal first changes with the time of the question.
    for n in 0..400 {
        let status = lathe.status();
        assert!(status.took_ms <= ANSWERED_MS, "{line}, {error}: {status:?}");
        assert!(lathe.ask_other_port() <= ANSWERED_MS, "{line}, {error}");
        lathe.run_for_ms(14 + n % 8);
        if status.state == "Alarm" {
            break;
        }
    }
    // A report may show the alarm just before the line is answered.
    lathe.run_for_ms(100);
    let told = if lathe.grbl { lathe.told(0, error) } else { lathe.told(exception, "") };
    assert_eq!(told, 1, "{line}, {error}: {:?} {:?}", lathe.exceptions(), lathe.all_heard());
    let status = lathe.status();
    assert_eq!(status.state, "Alarm", "{line}, {error}");
    assert_eq!(lathe.machine.recorder().steps(), steps, "{line}, {error}: it moves");
    lathe.agrees(&status, line);
    lathe.recover();
}
