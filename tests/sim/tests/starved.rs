//! The reports of the firmware and of the meter when exec is held up in mid-motion, and when motion ends for another
//! reason.

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::job;
use kerf_sim::{Host, Machine};

use crate::common::{booted, set};

/// USART2_UDRE: the vector of the software interrupt that exec runs in.
const EXEC_VECTOR: u8 = 52;
/// A time longer than the queued segments last, ms.
const HELD_UP_MS: u64 = 14;
/// The status of the exception report.
const TOLD: i64 = 37;

fn board() -> (Machine, Host) {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    set(&mut machine, &mut host, "{x:{vm:2000,fr:2000,jm:1000000}}");
    set(&mut machine, &mut host, "g1 f1500");
    let setup = job::read_setup(&mut machine, &mut host).unwrap();
    job::meter_pauses(&mut machine, &job::lines_of("g1 f1500\nx40\n"), &setup);
    (machine, host)
}

fn hold_up_exec(machine: &mut Machine, host: &mut Host) {
    machine.withhold(EXEC_VECTOR, true);
    host.run_for_ms(machine, HELD_UP_MS).unwrap();
    machine.withhold(EXEC_VECTOR, false);
    host.run_for_ms(machine, 100).unwrap();
}

fn count(machine: &mut Machine, host: &mut Host) -> i64 {
    host.ask(machine, "{stv:n}", 1_000).unwrap().body["stv"].as_i64().unwrap()
}

/// Returns how many of the reports since the last call are this exception.
fn told(host: &mut Host) -> usize {
    host.take_reports().iter().filter(|report| report["er"]["st"] == TOLD).count()
}

#[test]
fn steps_that_wait_for_exec_are_counted_and_told_once() {
    let (mut machine, mut host) = board();
    set(&mut machine, &mut host, "x40");
    host.run_for_ms(&mut machine, 500).unwrap();
    assert_eq!((count(&mut machine, &mut host), told(&mut host)), (0, 0));
    for n in 1..4 {
        hold_up_exec(&mut machine, &mut host);
        assert_eq!(count(&mut machine, &mut host), n);
        assert_eq!(told(&mut host), usize::from(n == 1));
    }
    host.run_for_ms(&mut machine, 3_000).unwrap();
    assert_eq!(count(&mut machine, &mut host), 3);
    assert_eq!(machine.recorder().motors()[0].position, 40 * 1280);
    let found = machine.recorder().pauses();
    assert_eq!((found.pauses.len(), found.starved.len()), (3, 3), "{found:?}");
    for pause in found.pauses {
        let ms = machine.seconds(pause.cycles) * 1e3;
        assert!(ms > 2.0 && ms < HELD_UP_MS as f64, "{pause:?}");
        assert!((pause.velocity - 25.0).abs() < 0.5 && pause.line == Some(2), "{pause:?}");
    }
}

#[test]
fn motion_that_is_ended_on_purpose_is_not_counted() {
    let (mut machine, mut host) = board();
    // A hold, a hold that drops the queue, and two stops at speed.
    for (end, clear) in
        [("!", "~"), ("!%", ""), ("{shutd:n}\n", "{clear:n}"), ("{alarm:n}\n", "{clear:n}")]
    {
        set(&mut machine, &mut host, "g91 g1 f1500 x10");
        host.run_for_ms(&mut machine, 200).unwrap();
        machine.send(end.as_bytes());
        host.run_for_ms(&mut machine, 300).unwrap();
        machine.send(clear.as_bytes());
        machine.send(b"\n");
        host.run_for_ms(&mut machine, 1_000).unwrap();
    }
    set(&mut machine, &mut host, "g91 g1 f1500 x10");
    host.run_for_ms(&mut machine, 1_000).unwrap();
    assert_eq!((count(&mut machine, &mut host), told(&mut host)), (0, 0));
    let found = machine.recorder().pauses();
    assert_eq!((found.pauses.len(), found.starved.len()), (0, 0), "{found:?}");
}
