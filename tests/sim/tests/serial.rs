//! The serial line at full speed, at too high a speed, and while the planner is full.

use kerf::boards::MEGA2560_GRBL;
use kerf::motion::queue::CAPACITY;
use kerf_sim::Machine;
use kerf_sim::protocol::{Incoming, classify};

use crate::common::{booted, set};

/// Status of a line of which a part was lost.
const BUFFER_FULL: i64 = 13;
/// Steps in a millimetre.
const PER_MM: u64 = 1_280;

#[test]
fn two_thousand_lines_at_full_speed_are_answered_once_each_and_in_order() {
    const LINES: usize = 2_000;
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    set(&mut machine, &mut host, "{jv:4}");
    let began = machine.cycle();
    (1..=LINES).for_each(|n| host.queue(n, &format!("N{n}")));
    let end = began + machine.cycles(60_000);
    while !host.is_done() && host.run_until_line(&mut machine, end).unwrap() {}
    let seconds = machine.seconds(machine.cycle() - began);
    host.run_for_ms(&mut machine, 100).unwrap();
    let answered = host.take_answered();
    assert_eq!(answered.len(), LINES);
    for (number, answered) in (1..).zip(&answered) {
        let raw = &answered.response.raw;
        assert_eq!((answered.number, answered.response.status), (number, 0), "{raw}");
        assert_eq!(answered.response.body["n"], number, "{raw}");
    }
    assert!(host.strays().is_empty(), "{:?}", host.strays());
    assert_eq!(machine.uart(0).overruns(), 0);
    // The answers are longer than the lines, so only their time on the wire counts.
    let bytes: usize = answered.iter().map(|a| a.response.raw.len() + 1).sum();
    let least = bytes as f64 * 10.0 / 115_200.0;
    assert!(seconds < 1.1 * least, "{seconds} s for {LINES} lines instead of {least} s");
}

/// The answers to a flood of lines.
#[derive(Default)]
struct Heard {
    /// The N words of the accepted lines, in order.
    taken: Vec<u64>,
    refused: usize,
    losses: usize,
    strange: Vec<String>,
}

impl Heard {
    fn lines(&mut self, text: &str) {
        for line in text.lines() {
            match classify(line) {
                Incoming::Response(r) if r.status == 0 => {
                    self.taken.extend(r.body.get("n").and_then(|n| n.as_u64()));
                }
                Incoming::Response(r) if r.status == BUFFER_FULL => self.refused += 1,
                Incoming::Report(r) if r["er"]["st"] == BUFFER_FULL => self.losses += 1,
                Incoming::Report(r) if r.get("er").is_none() => {}
                _ => self.strange.push(line.to_string()),
            }
        }
    }
}

/// Waits until no motor has moved and nothing was heard for a second. Returns all that was heard.
fn hear_out(machine: &mut Machine) -> Heard {
    let (mut text, mut quiet_ms) = (Vec::new(), 0);
    while quiet_ms < 1_000 {
        let steps = machine.recorder().steps();
        machine.run_for_ms(100).unwrap();
        let heard = machine.receive();
        let still = machine.recorder().steps() == steps && heard.is_empty();
        quiet_ms = if still { quiet_ms + 100 } else { 0 };
        text.extend(heard);
    }
    let mut heard = Heard::default();
    heard.lines(&String::from_utf8(text).expect("no byte is garbled"));
    heard
}

#[test]
fn a_flood_without_flow_control_loses_lines_and_corrupts_none() {
    for end in ["\n", "\r\n", "\r"] {
        flood(end);
    }
}

fn flood(end: &str) {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for line in ["{ex:0}", "{jv:4}", "g91 f800"] {
        set(&mut machine, &mut host, line);
    }
    // The moves have different lengths, so that a line that is torn or joined would move differently.
    let tenths = |n: u64| n * 7 % 23 + 1;
    let back = |n: u64| n.is_multiple_of(2);
    for n in 1..=600 {
        let way = if back(n) { "-" } else { "" };
        let tenth = tenths(n);
        machine.send(format!("N{n} G1 X{way}{}.{} F800{end}", tenth / 10, tenth % 10).as_bytes());
    }
    let heard = hear_out(&mut machine);
    assert!(heard.strange.is_empty(), "{:?}", heard.strange);
    assert!(heard.refused + heard.losses > 0, "nothing was lost: no flood");
    assert!(heard.losses > 0, "losses are reported");
    assert!(heard.taken.is_sorted(), "{:?}", heard.taken);
    // Refusals take their share of the line, which responses fill faster than lines do.
    assert!(heard.taken.len() >= 20, "{} taken", heard.taken.len());
    assert_eq!(heard.taken.len() + heard.refused, 600, "each line is answered, lost or not");
    let asked = |n: &u64| tenths(*n) as i64 * if back(*n) { -128 } else { 128 };
    let want: i64 = heard.taken.iter().map(asked).sum();
    let motors = machine.recorder().motors();
    assert_eq!(motors[0].position, want, "{} lines were taken", heard.taken.len());
    assert_eq!(motors[1].steps + motors[2].steps + motors[3].steps, 0);
    // The line behind the loss is whole.
    machine.send(b"{fb:n}\n");
    machine.run_for_ms(100).unwrap();
    let after = String::from_utf8(machine.receive()).unwrap();
    assert!(after.contains("\"fb\":440.20},\"f\":[1,0,7]"), "{after}");
    assert_eq!(machine.uart(0).overruns(), 0, "the firmware itself loses them, knowingly");
}

#[test]
fn lines_with_frame_errors_are_refused_and_no_other() {
    const LINES: u64 = 300;
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for line in ["{ex:0}", "{jv:4}", "{xvm:6000,xfr:6000,xjm:1e5}", "g91 f6000"] {
        set(&mut machine, &mut host, line);
    }
    machine.break_frames(Some(150), 7);
    let tenths = |n: u64| n as i64 * 7 % 23 + 1;
    let (mut damaged, mut before) = (Vec::new(), 0);
    for n in 1..=LINES {
        machine.send(format!("N{n} G1 X{:.1}\n", tenths(n) as f64 / 10.0).as_bytes());
        // The lines come more slowly than the moves, so that nothing else is lost.
        machine.run_for_ms(60).unwrap();
        let broken = machine.uart(0).misframed();
        if core::mem::replace(&mut before, broken) != broken {
            damaged.push(n);
        }
    }
    machine.break_frames(None, 0);
    let heard = hear_out(&mut machine);
    assert!(heard.strange.is_empty(), "{:?}", heard.strange);
    // One byte in 150: 33 lines.
    assert!(damaged.len() > 20, "{damaged:?}");
    let whole: Vec<u64> = (1..=LINES).filter(|n| !damaged.contains(n)).collect();
    assert_eq!((heard.taken, heard.refused), (whole.clone(), damaged.len()));
    let want: i64 = whole.iter().map(|n| tenths(*n) * 128).sum();
    assert_eq!(machine.recorder().motors()[0].position, want);
}

#[test]
fn a_line_that_the_receiver_overruns_at_a_megabaud_is_never_carried_out() {
    const LINES: usize = 1_800;
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    let axis = "vm:6000,fr:6000,jm:1e5";
    for line in ["{ex:0}", &format!("{{x:{{{axis}}},y:{{{axis}}}}}"), "g91 g1 f4000", "{jv:5}"] {
        set(&mut machine, &mut host, line);
    }
    host.change_speed(&mut machine, 1_000_000).unwrap();
    // No line becomes another one when a byte of it is lost.
    let line = |n: usize| format!("X.{:03}Y{}1.5", n * 7 % 899 + 101, ["", "-"][n / 40 % 2]);
    let mut heard = String::new();
    for n in 0..LINES {
        machine.send(format!("{}\n", line(n)).as_bytes());
        machine.run_for_ms(if n % 4 == 3 { 90 } else { 0 }).unwrap();
        heard += &String::from_utf8(machine.receive()).expect("no byte is garbled");
    }
    let overruns = machine.uart(0).overruns();
    let sent: Vec<String> = (0..LINES).map(line).collect();
    let (mut taken, mut refused) = (0, 0);
    for line in heard.lines() {
        match classify(line) {
            Incoming::Response(r) if r.status == 0 => {
                let block = r.body["gc"].as_str().unwrap_or_else(|| panic!("{line}"));
                assert!(sent.iter().any(|sent| sent == block), "{line}");
                taken += 1;
            }
            Incoming::Response(r) => refused += usize::from(r.status == BUFFER_FULL),
            _ => {}
        }
    }
    println!("{overruns} overruns: {taken} lines carried out, {refused} refused");
    assert!(overruns > 20 && taken > 20, "{overruns} overruns, {taken} lines carried out");
    // Where the end of a line is lost, two lines are refused as one.
    assert!((taken + refused) * 4 > LINES * 3, "{refused} refused, {taken} carried out");
}

#[test]
fn answers_stop_while_the_planner_is_full_and_come_again() {
    const LINES: usize = 100;
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    set(&mut machine, &mut host, "g1 g91 f800");
    // Each move takes 0.75 s.
    (1..=LINES).for_each(|n| host.queue(n, "x10"));
    host.run_for_ms(&mut machine, 700).unwrap();
    let at_once = host.take_answered().len();
    assert!((CAPACITY + 1..CAPACITY + 11).contains(&at_once), "{at_once} lines fill the planner");
    assert_eq!(host.in_flight(), 4, "the others wait");
    host.run_for_ms(&mut machine, 3_000).unwrap();
    let later = host.take_answered().len();
    assert!((3..=6).contains(&later), "{later} answers in the time of four moves");
    // A question overtakes them.
    let queue = host.ask(&mut machine, "{qr:n}", 100).unwrap();
    // Fewer free blocks are not reported.
    assert_eq!(queue.body["qr"], 6, "{}", queue.raw);
    let end = machine.cycle() + machine.cycles(90_000);
    while !host.is_done() && host.run_until_line(&mut machine, end).unwrap() {}
    let rest = host.take_answered();
    assert_eq!(at_once + later + rest.len(), LINES);
    assert!(rest.iter().all(|a| a.response.status == 0));
    let steps = LINES as u64 * 10 * PER_MM;
    while machine.recorder().steps() < steps && machine.cycle() < end {
        host.run_for_ms(&mut machine, 100).unwrap();
    }
    assert_eq!(machine.recorder().motors()[0].position, steps as i64);
    assert!(host.strays().is_empty(), "{:?}", host.strays());
}

#[test]
fn a_line_without_a_speed_goes_along_with_the_firmware() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    machine.follow_speed();
    for baud in [500_000, 9_600, 115_200] {
        set(&mut machine, &mut host, &format!("{{baud:{baud}}}"));
        host.run_for_ms(&mut machine, 10).unwrap();
        set(&mut machine, &mut host, "{baud:n}");
    }
    assert_eq!((machine.wire().garbled(), machine.uart(0).misframed()), (0, 0));
}

#[test]
fn a_change_of_speed_spoils_no_byte_of_its_response() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for baud in [9_600, 1_000_000, 230_400, 500_000, 250_000, 115_200] {
        host.change_speed(&mut machine, baud).unwrap();
        assert_eq!(host.in_flight(), 0);
        let began = machine.cycle();
        let answer = host.ask(&mut machine, "{baud:n}", 100).unwrap();
        assert_eq!(answer.body["baud"], baud, "{}", answer.raw);
        let least = (answer.raw.len() + 10) as f64 * 10.0 / f64::from(baud);
        let seconds = machine.seconds(machine.cycle() - began);
        // The firmware takes some ms to find the name.
        assert!(seconds < 1.1 * least + 0.006, "{seconds} s at {baud} baud, not {least} s");
    }
    assert_eq!((machine.wire().garbled(), machine.uart(0).misframed()), (0, 0));
    assert!(host.strays().is_empty(), "{:?}", host.strays());
}

#[test]
fn a_reset_in_the_middle_of_a_response_leaves_the_greeting_whole() {
    for ms in [1, 3, 5] {
        let (mut machine, _) = booted(&MEGA2560_GRBL);
        machine.run_for_ms(100).unwrap();
        machine.receive();
        machine.send(b"{sys:n}\n");
        while machine.receive().is_empty() {
            machine.run_for_ms(1).unwrap();
        }
        machine.run_for_ms(ms).unwrap();
        machine.send(b"\x18");
        machine.run_for_ms(500).unwrap();
        let heard = String::from_utf8(machine.receive()).expect("no byte is garbled");
        let greeting = heard.lines().find(|line| line.contains("SYSTEM READY"));
        let greeting = greeting.unwrap_or_else(|| panic!("no greeting: {heard:?}"));
        assert!(matches!(classify(greeting), Incoming::Banner), "{heard:?}");
        assert_eq!(machine.resets(), 1);
    }
}

/// Sends lines a byte at a time as a sender that goes on for `lag` bytes behind an XOFF, and continues at an XON.
/// Returns what it hears.
fn heard_by_one_who_heeds_xoff(lines: &str, lag: usize) -> Vec<u8> {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    set(&mut machine, &mut host, "{sv:0}");
    machine.receive();
    let mut bytes = lines.as_bytes().iter();
    let (mut left, mut heard, mut quiet) = (usize::MAX, Vec::new(), 0);
    while quiet < 5_000 {
        if left > 0
            && let Some(byte) = bytes.next()
        {
            machine.send(&[*byte]);
            left = if left == usize::MAX { left } else { left - 1 };
        }
        // A little more than the time of a byte.
        machine.run_until(machine.cycle() + 1_400).unwrap();
        let said = machine.receive();
        quiet = if bytes.len() == 0 && said.is_empty() { quiet + 1 } else { 0 };
        for byte in &said {
            match byte {
                0x13 => left = lag,
                0x11 => left = usize::MAX,
                _ => {}
            }
        }
        heard.extend(said);
    }
    heard
}

/// Returns the number of XOFF and XON in all, and of those inside lines. Checks that nothing is lost.
fn flows(lines: &str, lag: usize) -> (usize, usize) {
    let heard = heard_by_one_who_heeds_xoff(lines, lag);
    let is_flow = |byte: &u8| matches!(byte, 0x11 | 0x13);
    let (mut inside, mut answered) = (0, 0);
    for line in heard.split(|byte| *byte == b'\n') {
        let text = line.iter().skip_while(|byte| is_flow(byte));
        inside += text.filter(|byte| is_flow(byte)).count();
        // A late XOFF may stand anywhere in a line, in its last characters too.
        let body: Vec<u8> = line.iter().copied().filter(|byte| !is_flow(byte)).collect();
        answered += usize::from(body.ends_with(b"]}"));
        let shown = String::from_utf8_lossy(line);
        assert!(!shown.contains("\"er\""), "{shown}");
    }
    assert_eq!(answered, lines.lines().count());
    (heard.iter().filter(|byte| is_flow(byte)).count(), inside)
}

#[test]
fn xoff_and_xon_of_a_job_stand_between_lines() {
    let lines: String = (0..300).map(|i| format!("N{i} g1 f1200 x{}.25\n", i % 2)).collect();
    for lag in [0, 100] {
        let (all, inside) = flows(&lines, lag);
        println!("{all} times XOFF or XON, {inside} inside lines, lag {lag}");
        assert!(all > 10 && inside == 0, "{inside} of {all}");
    }
}

#[test]
fn xoff_comes_in_time_among_requests() {
    // Requests take CPU time, so that some XOFF are late and do not wait for the end of a line.
    let line = |i| format!("N{i} g1 f1200 x{}.25\n{{xvm:n,yvm:n}}\n{{xvm:n}}\n", i % 2);
    let lines: String = (0..100).map(line).collect();
    for lag in [0, 32] {
        let (all, inside) = flows(&lines, lag);
        println!("{all} times XOFF or XON, {inside} inside lines, lag {lag}");
        assert!(all > 20 && inside * 3 < all, "{inside} of {all}");
    }
}
