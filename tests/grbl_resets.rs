//! Resets of grbl's dialect while lines of another port, or of the same port, arrive at any moment.

use std::thread;

use kerf::boards::inputs::X_MIN;
use kerf::hal::imp::Machine;

/// The steps of a millimetre of X.
const STEPS_PER_MM: i64 = 1_280;

/// Returns a machine with a sender of grbl's dialect on each port.
fn booted() -> Machine {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(200);
    for line in ["?", "$I\n", "g21 g90\n"] {
        machine.send(line.as_bytes());
        machine.send_aux(line.as_bytes());
        machine.run_ms(100);
    }
    machine.received();
    machine.received_aux();
    machine
}

/// Returns the answers among what has been heard: `ok` and errors.
fn answers(heard: &[u8]) -> Vec<String> {
    let heard = String::from_utf8_lossy(heard);
    let is_answer = |line: &&str| *line == "ok" || line.starts_with("error:");
    heard.lines().filter(is_answer).map(str::to_owned).collect()
}

/// Calls `case` on a machine of its own for each delay from 0 to 200 ms.
fn for_all_delays(case: impl Fn(&Machine, u64) + Copy + Send + 'static) {
    let delays = (0..40).chain((40..200).step_by(7));
    for delay in delays {
        // One machine for each thread.
        let one = thread::spawn(move || case(&booted(), delay));
        assert!(one.join().is_ok(), "a delay of {delay} ms");
    }
}

#[test]
fn a_reset_in_motion_stops_the_lines_of_the_other_port() {
    for_all_delays(|machine, delay| {
        machine.send(b"g1 x20 f800\n");
        machine.run_ms(300);
        machine.send_aux(b"\x18");
        machine.run_ms(delay);
        machine.send(b"g0 x0\nm3 s1000\n");
        machine.run_ms(400);
        let stands = machine.emitted().position;
        machine.run_ms(1_000);
        assert_eq!(answers(&machine.received()), ["ok", "error:9", "error:9"]);
        let told = machine.received_aux();
        assert!(String::from_utf8_lossy(&told).contains("ALARM:3"));
        assert_eq!(machine.emitted().position, stands);
        assert!(stands[0] > 4 * STEPS_PER_MM && stands[0] < 6 * STEPS_PER_MM, "{stands:?}");
    });
}

#[test]
fn lines_behind_a_reset_are_answered_though_the_other_port_resets_too() {
    for_all_delays(|machine, delay| {
        machine.send(b"g1 x20 f800\n");
        machine.run_ms(300);
        machine.received();
        machine.send(b"\x18$G\ng0 x5\n");
        machine.run_ms(delay);
        machine.send_aux(b"\x18$I\n");
        machine.run_ms(1_000);
        assert_eq!(answers(&machine.received()).len(), 2);
        assert_eq!(answers(&machine.received_aux()).len(), 1);
        machine.send(b"$X\n$G\n");
        machine.run_ms(500);
        assert_eq!(answers(&machine.received()), ["ok", "ok"]);
    });
}

#[test]
fn the_end_of_a_program_that_is_cut_short_is_refused() {
    for_all_delays(|machine, delay| {
        machine.send(b"$21=1\n");
        machine.run_ms(500);
        machine.received();
        machine.send(b"g1 x12 f500\nm2\n");
        machine.run_ms(200);
        machine.send_aux(b"\x18");
        machine.run_ms(delay);
        machine.set_input(X_MIN, true);
        machine.run_ms(1_000);
        assert_eq!(answers(&machine.received()), ["ok", "error:9"]);
        machine.send(b"$X\n$G\n");
        machine.run_ms(500);
        assert_eq!(answers(&machine.received()), ["ok", "ok"]);
    });
}
