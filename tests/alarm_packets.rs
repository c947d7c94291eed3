//! Packets of lines that arrive in an alarm. A move is carried out if a line before it in the packet ends the alarm,
//! and refused otherwise, whatever questions stand between them and however they overtake.

use std::thread;

use kerf::hal::imp::Machine;

use crate::heat_patterns::Random;
use crate::seeds::try_all;

/// How a dialect says things.
struct Words {
    /// Selects the dialect, and makes distances incremental.
    first: &'static [&'static str],
    /// Begins an alarm.
    alarm: &'static [u8],
    ends: &'static [&'static str],
    asks: &'static [&'static str],
    /// What stands in the answer to a refused move.
    refused: &'static str,
}

const TINYG: Words = Words {
    first: &["{xvm:n}", "g91"],
    alarm: b"{alarm:1}\n",
    ends: &["{clear:n}", "{clr:n}", "m2"],
    asks: &["{stat:n}", "{xvm:n}", "{sys:n}"],
    refused: "\"f\":[1,203,",
};
const GRBL: Words = Words {
    first: &["$I", "g91"],
    alarm: b"\x18",
    ends: &["$X", "$x"],
    asks: &["?$G", "$I", ""],
    refused: "error:9",
};
const REPRAP: Words = Words {
    first: &["M105", "G91"],
    alarm: b"M112\n",
    ends: &["M999"],
    asks: &["M105", "M114", "M115"],
    refused: "Error:",
};

fn hear(machine: &Machine, ms: u64) -> String {
    machine.run_ms(ms);
    String::from_utf8(machine.received()).expect("UTF-8")
}

fn packets(words: &Words, seed: u64) -> Result<(), String> {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    let mut random = Random::new(seed);
    hear(&machine, 200);
    for line in words.first {
        machine.send(format!("{line}\n").as_bytes());
        hear(&machine, 100);
    }
    for _ in 0..4 {
        // A reset of grbl's dialect is an alarm if the machine moves.
        machine.send(b"G91 G1 X0.5 F300\n");
        hear(&machine, 50);
        machine.send(words.alarm);
        hear(&machine, 300);
        let from = machine.emitted().position[0];
        let (mut packet, mut ended, mut moves, mut refused) = (String::new(), false, 0, 0);
        for _ in 0..2 + random.below(9) {
            let line = match random.below(4) {
                0 => {
                    ended = true;
                    words.ends[random.below(words.ends.len())]
                }
                1 => words.asks[random.below(words.asks.len())],
                _ => {
                    let count = if ended { &mut moves } else { &mut refused };
                    *count += 1;
                    "G91 G1 X0.1 F3000"
                }
            };
            packet += line;
            packet.push('\n');
        }
        machine.send(packet.as_bytes());
        let heard = hear(&machine, 1_500);
        let told = heard.matches(words.refused).count();
        let went = (machine.emitted().position[0] - from) as f64 / 128.0;
        if went != f64::from(moves as u32) || told != refused {
            return Err(format!(
                "{moves} moves to make, {went} made; {refused} to refuse, {told} refused\n{packet}{heard}"
            ));
        }
    }
    Ok(())
}

fn try_packets(words: &'static Words) {
    try_all(60, |seed| {
        thread::spawn(move || packets(words, seed)).join().unwrap_or_else(|_| Err("a panic".into()))
    });
}

#[test]
fn of_tinyg() {
    try_packets(&TINYG);
}

#[test]
fn of_grbl() {
    try_packets(&GRBL);
}

#[test]
fn of_printing_hosts() {
    try_packets(&REPRAP);
}
