//! Thread mode has its turns however hard the mathematics of a ramp is: whoever asks in the midst of it is answered.

mod common;

use common::{booted, set};
use kerf::boards::MEGA2560_GRBL;

/// The longest wait for an answer, ms of AVR time, with arcs of 1 mm at this jerk limit (millions of mm/min^3) and feed.
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
        // The planner has its turns in between, of which a request takes some twenty. Measured: 107 ms.
        assert!(ms < 150.0, "jm {jerk}, f{feed}: {ms} ms");
    }
}
