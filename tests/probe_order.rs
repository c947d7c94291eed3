//! The order in which grbl's dialect reports the result of probing, whatever other reports come meanwhile: the alarm,
//! the position that was found, `ok`.

use std::thread;

use kerf::boards::inputs::PROBE;
use kerf::hal::imp::Machine;

/// A machine with a sender of grbl's dialect.
fn booted() -> Machine {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(200);
    for line in ["?", "$I\n", "g21 g90\n"] {
        machine.send(line.as_bytes());
        machine.run_ms(100);
    }
    machine.received();
    machine
}

/// Returns the answers to a probing line, without status reports, while its sender asks for reports continually.
fn probe(machine: &Machine, line: &str, asks_every: impl Fn(u32) -> u64) -> Vec<String> {
    machine.send(format!("{line}\n").as_bytes());
    let mut heard = Vec::new();
    for n in 0..300 {
        machine.run_ms(asks_every(n));
        machine.send(b"?");
        heard.extend(machine.received());
    }
    machine.run_ms(500);
    heard.extend(machine.received());
    let heard = String::from_utf8(heard).unwrap();
    let lines = heard.lines().filter(|line| !line.starts_with('<') && !line.is_empty());
    lines.map(str::to_owned).collect()
}

/// Probes over 0.3 mm in 0.2 s, with the contact at a step or without one, and checks the beginnings of the lines.
fn tells(line: &str, contact: Option<i64>, asks_every: impl Fn(u32) -> u64, wanted: &[&str]) {
    let machine = booted();
    if let Some(step) = contact {
        machine.set_near(PROBE, step, false);
    }
    let heard = probe(&machine, line, asks_every);
    let like = |(line, begin): (&String, &&str)| line.starts_with(*begin);
    assert!(heard.len() == wanted.len() && heard.iter().zip(wanted).all(like), "{heard:?}");
}

/// Checks all ways in which a probing can end.
fn all(asks_every: impl Fn(u32) -> u64 + Copy + Send + 'static) {
    let all: [(&str, Option<i64>, &[&str]); 4] = [
        ("g38.2 z-0.3 f120", None, &["ALARM:5", "[PRB:", "ok"]),
        ("g38.2 z-0.3 f120", Some(0), &["ALARM:4", "[PRB:", "ok"]),
        ("g38.3 z-0.3 f120", None, &["[PRB:", "ok"]),
        ("g38.2 z-0.3 f120", Some(-200), &["[PRB:", "ok"]),
    ];
    for (line, contact, wanted) in all {
        // One machine for each thread.
        let one = thread::spawn(move || tells(line, contact, asks_every, wanted));
        one.join().unwrap();
    }
}

#[test]
fn asked_all_the_time() {
    all(|_| 1);
}

#[test]
fn asked_now_and_then() {
    all(|n| 2 + u64::from(n % 3));
}

#[test]
fn asked_as_senders_do() {
    for at in 0..20 {
        all(move |n| if n == 0 { at } else { 20 });
    }
}
