//! Thread mode gets its turns however much CPU time the computation of a ramp takes: a question during the ramp is
//! answered.

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::bench::{curve, spiral};
use kerf_sim::{Host, LINES_IN_FLIGHT, Machine};

use crate::common::share::share_of;
use crate::common::{booted, firmware, set};

/// The longest wait for an answer, ms of AVR time, with arcs of 1 mm at this jerk limit (millions of mm/min^3) and
/// feed.
fn longest(jerk: u32, feed: u32) -> f64 {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for axis in ["x", "y"] {
        set(&mut machine, &mut host, &format!("{{{axis}:{{vm:5000,fr:5000,jm:{jerk},ac:0}}}}"));
    }
    set(&mut machine, &mut host, "{sv:0,qv:0}");
    set(&mut machine, &mut host, "{mfo:1.2}");
    let _ = machine.receive();
    for n in 0..6 {
        machine.send(format!("g91 g2 f{feed} x0 y0 i1 p{}\n", n % 3 + 3).as_bytes());
    }
    machine.run_for_ms(500).unwrap();
    let (mut longest, mut heard) = (0.0f64, machine.receive());
    for _ in 0..60 {
        heard.clear();
        machine.send(b"{posx:n}\n");
        let from = machine.cycle();
        while !heard.windows(6).any(|part| part == b"\"posx\"") {
            machine.run_for_ms(1).unwrap();
            heard.extend(machine.receive());
            assert!(machine.cycle() - from < machine.cycles(3_000), "no answer");
        }
        longest = longest.max((machine.cycle() - from) as f64 / machine.cycles(1) as f64);
    }
    longest
}

#[test]
fn a_request_is_answered_in_small_fast_arcs() {
    for (jerk, feed) in [(500, 3_000), (2_000, 3_000), (2_000, 4_000), (5_000, 3_000)] {
        let ms = longest(jerk, feed);
        println!("jm {jerk}, f{feed}: {ms:.0} ms");
        // Measured: 14 ms.
        assert!(ms <= 20.0, "jm {jerk}, f{feed}: {ms} ms");
    }
}

/// The number of a line that is a question.
const ASKED: usize = usize::MAX;
/// The question that both ports are asked.
const QUESTION: &str = "{stat:n}";
/// The usual speed of the line, and a fast one.
const USUAL_BAUD: u32 = 115_200;
/// See [`USUAL_BAUD`].
const FAST_BAUD: u32 = 500_000;

/// Returns the time that `bytes` bytes take on the line, ms.
fn bytes_ms(bytes: usize, baud: u32) -> f64 {
    bytes as f64 * 1e4 / f64::from(baud)
}

/// Asks on USB. Returns how long the last bit of the question takes to arrive, ms, including the bytes that the
/// sender has sent before.
fn ask_usb(machine: &mut Machine, host: &mut Host, baud: u32) -> f64 {
    host.send(machine, ASKED, QUESTION);
    bytes_ms(machine.wire().backlog(), baud)
}

/// Asks on both ports, `times` times, while a sender streams on USB at this speed. Returns, for each port, the
/// longest wait from the last bit of a question to the last bit of its answer, ms of AVR time.
fn longest_waits(machine: &mut Machine, host: &mut Host, baud: u32, times: u64) -> [f64; 2] {
    let mut longest = [0.0f64; 2];
    for n in 0..times {
        host.run_for_ms(machine, 23 + n % 7).unwrap();
        let _ = machine.receive_from(1);
        let from = machine.cycle();
        machine.send_to(1, format!("{QUESTION}\n").as_bytes());
        let arrives = [ask_usb(machine, host, baud), bytes_ms(QUESTION.len() + 1, USUAL_BAUD)];
        let (mut heard, mut waits) = (Vec::new(), [true; 2]);
        while waits.contains(&true) {
            let next = machine.cycle() + 1_600;
            host.run_until(machine, next).unwrap();
            heard.extend(machine.receive_from(1));
            let answered = host.take_answered().iter().any(|a| a.number == ASKED);
            for (port, has) in [answered, heard.ends_with(b"\n")].into_iter().enumerate() {
                let ms = (machine.cycle() - from) as f64 / 16e3 - arrives[port];
                if has && core::mem::take(&mut waits[port]) {
                    longest[port] = longest[port].max(ms);
                }
                assert!(!waits[port] || ms < 500.0, "no answer on port {port}");
            }
        }
    }
    longest
}

/// Streams arcs as fast as the motors may go, with status reports ten times a second, and asks on both ports.
/// Returns, for each port, the longest wait from the last bit of a question to the last bit of its answer, ms of AVR
/// time.
fn longest_on_both(line: &str, setup: &[&str]) -> [f64; 2] {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for line in setup {
        set(&mut machine, &mut host, line);
    }
    (0..12_000).for_each(|n| host.queue(n, &line.replace('@', if n % 2 == 0 { "" } else { "-" })));
    host.run_for_ms(&mut machine, 700).unwrap();
    longest_waits(&mut machine, &mut host, USUAL_BAUD, 300)
}

#[test]
fn requests_on_both_ports_are_answered_in_arcs_at_the_highest_step_rate() {
    for jerk in [300, 20_000] {
        for radius in share_of(&[0.3, 2.0, 20.0], 3) {
            let axis = format!("vm:4680,fr:4680,jm:{jerk},ac:2000");
            let setup =
                [&format!("{{x:{{{axis}}},y:{{{axis}}}}}")[..], "{sv:2,si:100}", "g91f90000"];
            let ms = longest_on_both(&format!("g3x@{radius}i@{}", radius / 2.0), &setup);
            println!(
                "jm {jerk}, radius {radius}: {:.1} ms, {:.1} ms on the second port",
                ms[0], ms[1]
            );
            // Steps and exec take nine tenths of the CPU, and a report takes 12 ms on the line of USB:
            // docs/protocol.md. The slowest of 24,000 questions took 19.7 ms.
            assert!(ms.iter().all(|ms| *ms <= 20.0), "jm {jerk}, radius {radius}: {ms:?} ms");
        }
    }
}

/// Streams a job on USB at 500,000 baud, with as many lines in flight as the firmware stores, so that the sender is
/// always ahead. Returns the longest waits, as [`longest_waits`].
fn longest_beside_stream(job: &str, acceleration: u32) -> [f64; 2] {
    const IN_FLIGHT: usize = 2 * LINES_IN_FLIGHT;
    /// More copies of the job than are made in the time of the measurement.
    const REPEATS: usize = 6;
    let (mut machine, mut host) = (firmware(&MEGA2560_GRBL), Host::new(IN_FLIGHT));
    host.boot(&mut machine, 1_000).unwrap();
    host.change_speed(&mut machine, FAST_BAUD).unwrap();
    for line in ["{1:{tr:20}}", "{2:{tr:20}}", "{ja:1800000}", "{sv:0,qv:0}"] {
        set(&mut machine, &mut host, line);
    }
    for axis in ["x", "y"] {
        let limits = format!("vm:2000000,fr:2000000,jd:0.01,jm:1000000,ac:{acceleration}");
        set(&mut machine, &mut host, &format!("{{{axis}:{{{limits}}}}}"));
    }
    // Time after which the settings are in the EEPROM.
    host.run_for_ms(&mut machine, 3_000).unwrap();
    (0..REPEATS).flat_map(|_| job.lines()).enumerate().for_each(|(n, line)| host.queue(n, line));
    host.run_for_ms(&mut machine, 500).unwrap();
    let longest = longest_waits(&mut machine, &mut host, FAST_BAUD, 200);
    assert_eq!(host.in_flight(), IN_FLIGHT, "the job ended before the questions");
    longest
}

#[test]
fn a_sender_of_short_moves_that_is_always_ahead_does_not_hold_up_the_other_port() {
    for (what, job, acceleration, most) in [
        ("moves of 0.33 mm on a curve", curve(), 4_500, 25.0),
        ("moves of 0.1 mm", spiral(0.1), 500, 20.0),
    ] {
        let ms = longest_beside_stream(&job, acceleration);
        println!("{what}: {:.1} ms, {:.1} ms on the second port", ms[0], ms[1]);
        // The slowest of 1,500 questions took 18.4 and 22.4 ms on the curve, which takes all of the CPU, and 8.0 and
        // 14.5 ms on the spiral. While short moves had precedence over everything else, the second port waited for more
        // than 500 ms on both.
        assert!(ms.iter().all(|ms| *ms <= most), "{what}: {ms:?} ms");
    }
}

/// Returns the longest wait for an answer on USB, ms of AVR time, in a zigzag at the highest step rate, while the
/// second port sends the question `other` again and again.
fn longest_beside(other: &str) -> f64 {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    let axis = "vm:4680,fr:4680,jm:20000,ac:2000";
    let axes = format!("{{x:{{{axis}}},y:{{{axis}}}}}");
    for line in [&axes[..], "{sv:1,si:100}", "g91 g1 f9000 g64"] {
        set(&mut machine, &mut host, line);
    }
    (0..16_000).for_each(|n| host.queue(n, if n % 2 == 0 { "g1x5y4" } else { "g1x-5y-4" }));
    let ask = |machine: &mut Machine| machine.send_to(1, format!("{other}\n").as_bytes());
    let mut heard = Vec::new();
    let mut run = |machine: &mut Machine, host: &mut Host| {
        let next = machine.cycle() + 1_600;
        host.run_until(machine, next).unwrap();
        heard.extend(machine.receive_from(1));
        if heard.ends_with(b"\n") {
            heard.clear();
            ask(machine);
        }
    };
    host.run_for_ms(&mut machine, 700).unwrap();
    ask(&mut machine);
    let mut longest = 0.0f64;
    for n in 0..400 {
        let until = machine.cycle() + machine.cycles(23 + n % 7);
        while machine.cycle() < until {
            run(&mut machine, &mut host);
        }
        let from = machine.cycle();
        let arrives = ask_usb(&mut machine, &mut host, USUAL_BAUD);
        while !host.take_answered().iter().any(|answer| answer.number == ASKED) {
            run(&mut machine, &mut host);
            assert!(machine.cycle() - from < machine.cycles(500), "no answer");
        }
        longest = longest.max((machine.cycle() - from) as f64 / 16e3 - arrives);
    }
    longest
}

#[test]
fn groups_that_one_port_reads_do_not_hold_up_the_other() {
    for other in ["{x:n}", "{sr:n}", "{stat:n}"] {
        let ms = longest_beside(other);
        println!("{other}: {ms:.1} ms");
        // Steps take 63 % of the CPU. The slowest of 12,000 questions took 18.7 ms.
        assert!(ms <= 20.0, "{other}: {ms} ms");
    }
}

/// Lines on USB that take much time in thread mode while the machine rests.
const HEAVY: [&str; 8] = [
    "{mch:2}",
    "{mch:0}",
    "{defa:1}",
    "{x:{am:1,vm:5000,fr:5000,tn:0,tm:200,jm:500,jh:1000}}",
    "{sys:n}",
    "{1:n}",
    "$$",
    "{txt:\"$$\"}",
];

/// Returns how long a question on the second port waits for its answer, ms of AVR time, if it ends `us` us after a
/// line on USB.
fn waits_behind(machine: &mut Machine, host: &mut Host, line: &str, us: u64) -> f64 {
    host.send(machine, 0, line);
    while machine.wire().backlog() > 0 {
        machine.run_until(machine.cycle() + 160).unwrap();
    }
    machine.run_until(machine.cycle() + us * 16).unwrap();
    let _ = machine.receive_from(1);
    let from = machine.cycle();
    machine.send_to(1, b"{stat:n}\n");
    let mut heard = Vec::new();
    while !heard.ends_with(b"\n") {
        machine.run_until(machine.cycle() + 160).unwrap();
        heard.extend(machine.receive_from(1));
        assert!(machine.cycle() - from < machine.cycles(3_000), "no answer behind {line}");
    }
    let ms = (machine.cycle() - from) as f64 / machine.cycles(1) as f64;
    host.run_for_ms(machine, 1_500).unwrap();
    host.take_answered();
    ms
}

#[test]
fn a_long_answer_does_not_hold_up_the_other_port() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for line in HEAVY {
        let waits = (0..8).map(|n| waits_behind(&mut machine, &mut host, line, n * 1_500));
        let longest = waits.fold(0.0, f64::max);
        println!("{line}: {longest:.1} ms");
        assert!(longest <= 20.0, "{line}: {longest} ms");
    }
}
