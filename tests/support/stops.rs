//! Crowded ports: alarms act when they arrive, and a report describes a single moment.

use super::{AUX, BYTES_MS, MOVE, USB, alone};
use crate::side::Side;

/// Alarms do not wait for the answers of their own port: neither in the pool, nor in the ring of a port whose pool is
/// full.
pub fn a_stop_acts_when_it_arrives<S: Side>(boot: impl Fn() -> S + Sync) {
    let before = ["", "$$\n", "{g59:n}\n{g59:n}\n{g59:n}\n"];
    // Several long lines come first, so that the alarm waits in the ring; then lines take the reserve of the pool,
    // too.
    let long = format!("{{{}xvm:n}}\n", "xvm:n,xfr:n,".repeat(17));
    let full = format!("{long}{long}{{g59:n}}\n{{g58:n}}\n{{g57:n}}\n{{g56:n}}\n");
    for (port, lines) in
        before.map(|lines| (USB, lines)).into_iter().chain([(AUX, before[2]), (USB, &full)])
    {
        for stop in ["{alarm:1}\n", "{\"shutd\": true}\r\n", " { Panic : n }\n"] {
            alone(&boot, |mut crowd| {
                crowd.set(USB, "{psw:1,ex:0}");
                crowd.set(USB, "{sv:0}");
                crowd.set(USB, "m3 s1000");
                crowd.send(USB, &MOVE.repeat(2));
                crowd.pass(200);
                assert!(crowd.turns());
                crowd.forget();
                // Lines and alarm are sent together, so that the alarm comes while the lines before it are being
                // answered.
                crowd.put(port, lines);
                crowd.put(port, stop);
                crowd.pass((lines.len() / BYTES_MS + 2) as u64);
                crowd.stops(stop);
                // The alarm has an answer of its own, behind the answers of the lines before it.
                let name: String = stop.chars().filter(char::is_ascii_alphabetic).take(5).collect();
                let answer = format!("{{\"r\":{{\"{}\":", name.to_lowercase());
                assert!(crowd.hears_line(port, &answer, 4_000), "{:?}", crowd.heard);
                let answers = crowd.heard[port].matches("\"f\":[1,0,").count();
                assert!(answers >= lines.lines().filter(|line| !line.starts_with('$')).count());
            });
        }
    }
}

/// An alarm that was ended from the other port does not begin again when its line has its turn.
pub fn a_stop_acts_once<S: Side>(boot: impl Fn() -> S + Sync) {
    let long = format!("{{{}xvm:n}}\n", "xvm:n,xfr:n,".repeat(17));
    // The alarm waits in the pool; in the ring behind lines that overtake; in the ring behind a line that waits for
    // room there.
    let behind_long = format!("{long}{long}{{g59:n}}\n{{g58:n}}\n{{g57:n}}\n");
    for lines in ["$$\n", &behind_long, &"{g59:n}\n".repeat(14)] {
        alone(&boot, |mut crowd| {
            crowd.set(USB, "{sv:0,ex:0}");
            crowd.put(USB, lines);
            crowd.put(USB, "{alarm:1}\n");
            crowd.pass((lines.len() / BYTES_MS + 2) as u64);
            crowd.prompt(AUX, "{stat:n}\n", "{\"stat\":2}");
            crowd.prompt(AUX, "{clear:n}\n", "{\"clear\":null}");
            crowd.prompt(AUX, "{stat:n}\n", "{\"stat\":3}");
            assert!(crowd.hears_line(USB, "\"alarm\":", 4_000), "{:?}", crowd.heard);
            crowd.pass(100);
            crowd.prompt(AUX, "{stat:n}\n", "{\"stat\":3}");
            // The next alarm counts, also behind a line on its own port that ends an alarm.
            for stops in ["{alarm:1}\n", "{clear:n}\n{alarm:1}\n"] {
                crowd.prompt(USB, stops, "{\"alarm\":1}");
                crowd.prompt(AUX, "{stat:n}\n", "{\"stat\":2}");
            }
        });
    }
}

/// An alarm acts at once, even behind bytes that form no line or that lack a line end: in the pool, and in the ring
/// behind a full pool.
pub fn a_stop_acts_behind_what_is_no_line<S: Side>(boot: impl Fn() -> S + Sync) {
    let full = "{xvm:n}\n".repeat(22);
    for (port, before) in [
        (AUX, "????????".to_string()),
        (AUX, "? ".repeat(9)),
        (USB, "?".repeat(40)),
        (USB, format!("{full}~")),
        (USB, format!("{full}%?")),
        (USB, format!("{full}{}", " ".repeat(30))),
    ] {
        for stop in ["{alarm:1}\n", "{shutd:n}\r\n"] {
            alone(&boot, |mut crowd| {
                crowd.set(USB, "{sv:0,ex:0}");
                crowd.set(USB, "m3 s1000");
                crowd.send(USB, &MOVE.repeat(2));
                crowd.pass(200);
                assert!(crowd.turns());
                crowd.forget();
                crowd.put(port, &before);
                crowd.put(port, stop);
                crowd.pass((before.len() / BYTES_MS + 2) as u64);
                crowd.stops(&format!("{before}{stop}"));
            });
        }
    }
}

/// A long move of many blocks, all of which have room in the queue, does not hold up control.
pub fn a_long_way_does_not_hold_up_control<S: Side>(boot: impl Fn() -> S + Sync) {
    for (line, stop) in [
        ("{jogx:2000}\n", "{alarm:1}\n"),
        ("g38.2 z-1000 f100\n", "{alarm:1}\n"),
        ("g0 x1000\n", "{alarm:1}\n"),
    ] {
        for wait in [1, 3, 20] {
            alone(&boot, |mut crowd| {
                crowd.set(USB, "{sv:0}");
                crowd.set(USB, "m3 s1000");
                crowd.pass(100);
                assert!(crowd.turns());
                crowd.send(USB, line);
                crowd.pass(wait);
                crowd.prompt(AUX, "{stat:n}\n", "{\"stat\":");
                crowd.put(AUX, stop);
                crowd.pass(1);
                crowd.stops(stop);
            });
        }
    }
}

/// Returns the number of a name in a line of JSON.
fn value(line: &str, name: &str) -> Option<f64> {
    let (_, rest) = line.split_once(&format!("\"{name}\":"))?;
    rest.split([',', '}']).next()?.parse().ok()
}

/// The first and the last position in a report agree, even if the other port is sent positions at the same time.
pub fn a_report_is_of_one_moment_whoever_asks_on_the_other_port<S: Side>(
    boot: impl Fn() -> S + Sync,
) {
    alone(&boot, |mut crowd| {
        crowd.set(USB, "{sv:0,xjm:5000}");
        // Longer than the transmit ring.
        let between =
            "ofsx:t,ofsy:t,ofsz:t,posa:t,posb:t,posc:t,mpoa:t,mpob:t,mpoc:t,homx:t,homy:t,homz:t";
        crowd.set(USB, &format!("{{sr:{{posx:t,{between},mpox:t}}}}"));
        crowd.set(USB, "g0x100");
        for _ in 0..60 {
            crowd.put(USB, "{sr:n}\n");
            for _ in 0..4 {
                crowd.put(AUX, "{mpo:n}\n");
                crowd.pass(9);
            }
        }
        crowd.pass(200);
        let mut moved = 0;
        for line in crowd.heard[USB].lines() {
            if let (Some(work), Some(machine)) = (value(line, "posx"), value(line, "mpox")) {
                assert_eq!(work, machine, "{line}");
                moved += usize::from(work > 0.0);
            }
        }
        assert!(moved > 30, "{:?}", crowd.heard);
    });
}
