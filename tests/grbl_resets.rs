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

/// Sends to a machine, lets time pass, and returns what its first port has said since it was heard last.
fn heard_after(machine: &Machine, bytes: &[u8], ms: u64) -> String {
    machine.send(bytes);
    machine.run_ms(ms);
    String::from_utf8(machine.received()).expect("text")
}

/// Returns the answers in [`heard_after`].
fn answers_after(machine: &Machine, bytes: &[u8], ms: u64) -> Vec<String> {
    answers(heard_after(machine, bytes, ms).as_bytes())
}

/// Begins a long move, lets 300 ms pass, and forgets what has been said.
fn begin_move(machine: &Machine, line: &[u8]) {
    heard_after(machine, line, 300);
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
        begin_move(machine, b"g1 x20 f800\n");
        machine.send(b"\x18$G\ng0 x5\n");
        machine.run_ms(delay);
        machine.send_aux(b"\x18$I\n");
        machine.run_ms(1_000);
        assert_eq!(answers(&machine.received()).len(), 2);
        assert_eq!(answers(&machine.received_aux()).len(), 1);
        assert_eq!(answers_after(machine, b"$X\n$G\n", 500), ["ok", "ok"]);
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
        assert_eq!(answers_after(machine, b"$X\n$G\n", 500), ["ok", "ok"]);
    });
}

#[test]
fn a_full_pool_behind_a_reset_is_answered_though_the_other_port_kills_the_job() {
    for_all_delays(|machine, delay| {
        begin_move(machine, b"g1 x20 f3000\n");
        machine.send(&[b"\x18".as_slice(), &b"T1\n".repeat(60)].concat());
        machine.run_ms(delay);
        machine.send_aux(b"\x04");
        machine.run_ms(1_000);
        assert_eq!(answers(&machine.received()).len(), 60);
        assert!(heard_after(machine, b"?", 50).starts_with("<Alarm|"));
    });
}

#[test]
fn a_kill_behind_a_reset_leaves_no_port_without_a_greeting() {
    for_all_delays(|machine, delay| {
        begin_move(machine, b"g1 x20 f3000\n");
        machine.send(&[b"\x18".as_slice(), &b"T1\n".repeat(60)].concat());
        machine.run_ms(delay);
        machine.send(b"\x04");
        machine.run_ms(1_000);
        assert!(String::from_utf8_lossy(&machine.received()).contains("Grbl 1.1h"));
        assert_eq!(answers_after(machine, b"$X\n", 50), ["ok"]);
    });
}

#[test]
fn a_report_is_told_to_its_end_when_its_line_is_dropped() {
    for_all_delays(|machine, delay| {
        machine.send(b"g4 p1\n$#\n");
        machine.run_ms(100);
        machine.send(b"?");
        machine.run_ms(delay % 40);
        machine.send_aux(b"\x18");
        machine.run_ms(1_000);
        let heard = String::from_utf8(machine.received()).unwrap();
        let report = heard.lines().find(|line| line.starts_with('<')).expect("a report");
        assert!(report.ends_with('>'), "{heard}");
        assert_eq!(answers(heard.as_bytes()).len(), 2);
    });
}

#[test]
fn two_resets_at_rest_are_no_alarm() {
    for_all_delays(|machine, delay| {
        machine.send(b"\x18");
        machine.run_ms(delay);
        machine.send(b"\x18");
        machine.run_ms(500);
        let heard = String::from_utf8(machine.received()).unwrap();
        assert!(heard.contains("Grbl 1.1h") && !heard.contains("ALARM"), "{heard}");
        assert_eq!(answers_after(machine, b"g0 x1\n", 500), ["ok"]);
    });
}

#[test]
fn a_jog_that_is_cancelled_is_no_alarm_though_a_greeting_waits() {
    for_all_delays(|machine, delay| {
        machine.send_aux(b"$ex=2\n");
        machine.send(b"$ex=2\n");
        machine.run_ms(300);
        machine.set_aux_cts(true);
        machine.send_aux(b"$$\n$$\n");
        machine.run_ms(300);
        machine.send(b"g1 x20 f600\n");
        machine.run_ms(300);
        machine.send_aux(b"\x18");
        machine.run_ms(300);
        machine.send(b"$X\n");
        machine.run_ms(300);
        machine.send(b"$J=X12F500\n");
        machine.run_ms(300 + delay);
        machine.send(b"\x85");
        machine.run_ms(500);
        machine.received();
        assert!(heard_after(machine, b"?", 50).starts_with("<Idle|"));
    });
}

#[test]
fn a_start_up_line_that_stops_keeps_nobody_from_a_reset() {
    for_all_delays(|machine, delay| {
        machine.send(b"$N0=M0\n$N1=G20\n");
        machine.run_ms(300);
        machine.send(b"~");
        machine.run_ms(300);
        machine.send(b"$N1=G20\n\x18");
        machine.run_ms(200);
        machine.send(b"g0 x1\n$G\n");
        machine.run_ms(delay);
        machine.received();
        machine.send(b"\x18");
        machine.send_aux(b"\x18");
        machine.run_ms(500);
        assert!(String::from_utf8_lossy(&machine.received()).contains("Grbl 1.1h"));
        assert!(heard_after(machine, b"?", 50).starts_with('<'));
    });
}

#[test]
fn questions_behind_a_percent_sign_take_no_room() {
    let machine = booted();
    machine.send(b"m0\n");
    machine.run_ms(50);
    machine.send(&[&b"T1\n".repeat(20), b"%\n".as_slice()].concat());
    machine.run_ms(50);
    machine.received();
    for _ in 0..300 {
        assert!(heard_after(&machine, b"?", 40).starts_with('<'));
    }
    machine.send(b"~");
    machine.run_ms(500);
    let heard = answers(&machine.received());
    assert!(heard.iter().all(|answer| answer == "ok") && heard.len() == 21, "{heard:?}");
}

#[test]
fn a_greeting_that_waited_for_a_list_comes_though_the_machine_stops() {
    for_all_delays(|machine, delay| {
        machine.send(b"$N0=M8\n$N1=M0\n");
        machine.run_ms(300);
        machine.send(b"~");
        machine.run_ms(300);
        machine.send_aux(b"$$\n");
        machine.run_ms(delay);
        machine.send(b"\x18");
        machine.send_aux(b"\x18");
        machine.run_ms(1_000);
        for heard in [machine.received(), machine.received_aux()] {
            assert!(String::from_utf8_lossy(&heard).contains("Grbl 1.1h"));
        }
    });
}

#[test]
fn a_hold_in_an_alarm_keeps_nothing_waiting() {
    for_all_delays(|machine, delay| {
        machine.send(b"g1 x20 f800\n");
        machine.run_ms(300);
        machine.send_aux(b"\x18");
        machine.run_ms(delay);
        machine.received();
        machine.send(b"g0 x6\n$SLP\n!");
        machine.run_ms(1_000);
        assert_eq!(answers(&machine.received()).len(), 2);
    });
}

#[test]
fn start_up_lines_wait_for_a_jog_of_the_other_port() {
    for_all_delays(|machine, delay| {
        heard_after(machine, b"$N1=G21\n", 300);
        machine.send_aux(b"M0\n");
        machine.run_ms(300);
        machine.send_aux(b"M2\n$G\nG0X4F3000\nG4P0.05\n$X\n$SLP\n");
        machine.run_ms(300);
        machine.received_aux();
        machine.send_aux(b"\x18");
        machine.run_ms(delay);
        // Carried out, or refused because the machine still comes to rest.
        let mut heard = heard_after(machine, b"$J=G91 X2 F1200\n", 1_000);
        assert_eq!(answers(heard.as_bytes()).len(), 1, "{heard}");
        heard += &String::from_utf8_lossy(&machine.received_aux());
        assert_eq!(heard.matches(">G21:ok").count(), 1, "{heard}");
        assert_eq!(answers_after(machine, b"$G\n", 200), ["ok"]);
    });
}

/// Lines of every kind: answered at once, at rest, by a list, or refused.
const KINDS: &[&str] = &[
    "",
    "g0 x1",
    "g91 g1 x0.1 f600",
    "m3 s100",
    "$G",
    "$$",
    "$#",
    "$I",
    "$X",
    "$110=1200",
    "$C",
    "q",
];

#[test]
fn a_reset_cuts_between_lines_when_check_mode_begins_or_ends() {
    let mut seed = 11u32;
    let mut random = move |below: u32| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 16) % below
    };
    let machine = booted();
    let mut failed = Vec::new();
    for n in 0..1_000 {
        let kind = |n: u32| KINDS[n as usize % KINDS.len()];
        let leaves = random(2) == 1;
        if leaves {
            heard_after(&machine, b"$C\n", 60);
        }
        let (before, behind) = (kind(random(99)), kind(random(99)));
        // Bytes that do nothing take 87 us each.
        let pause = |n| vec![0x80; n as usize];
        let bytes = [
            b"$C\n".to_vec(),
            pause(random(40)),
            format!("{before}\n").into_bytes(),
            pause(random(40)),
            b"\x18".to_vec(),
            pause(if random(2) == 0 { 0 } else { random(30) }),
            format!("{behind}\n").into_bytes(),
        ];
        let heard = heard_after(&machine, &bytes.concat(), 500);
        let answered = heard.rsplit("Grbl 1.1h").next().unwrap();
        if answers(answered.as_bytes()).len() != 1 {
            let pauses = [bytes[1].len(), bytes[3].len(), bytes[5].len()];
            failed.push(format!("{n} {leaves} {before:?} {behind:?} {pauses:?}: {heard}"));
        }
        heard_after(&machine, b"\x18", 300);
    }
    assert!(failed.is_empty(), "{}\n{}", failed.len(), failed[..failed.len().min(12)].join("\n"));
}
