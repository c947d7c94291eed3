//! Pauses (G4). In grbl's dialect and in that of printing hosts a line with G4 is answered when the motion before it
//! and the pause are over; in TinyG's when it has been read. Random lines, holds and questions, with every step watched.

use std::collections::VecDeque;

use kerf::hal::imp::{Machine, eeprom};

use crate::apart::apart;
use crate::seeds::try_all;

/// Steps in a mm of X.
const STEPS: i64 = 1_280;
/// How much later than the end of a pause its answer may have been heard, ms.
const LATE: u64 = 40;

/// A sender, and what it sees of the motor of X.
struct Sender {
    machine: Machine,
    prints: bool,
    heard: String,
    now: u64,
    /// Where X is, and since when, ms.
    at: i64,
    since: u64,
    seed: u64,
}

impl Sender {
    fn boot(prints: bool, seed: u64) -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        let heard = String::new();
        let mut sender =
            Self { machine, prints, heard, now: 0, at: 0, since: 0, seed: seed * 2 + 1 };
        sender.run_ms(100);
        sender.machine.received();
        sender.send(if prints { "M105" } else { "$I" });
        sender.run_ms(50);
        assert!(sender.heard.contains("ok"), "{}", sender.heard);
        sender.heard.clear();
        sender
    }

    fn random(&mut self, below: u64) -> u64 {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_041);
        (self.seed >> 33) % below
    }

    fn send(&mut self, line: &str) {
        self.machine.send(format!("{line}\n").as_bytes());
    }

    fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms {
            self.machine.run_ms(1);
            self.now += 1;
            self.heard += &String::from_utf8_lossy(&self.machine.received()).replace('\r', "");
            let at = self.machine.emitted().position[0];
            if at != self.at {
                (self.at, self.since) = (at, self.now);
            }
        }
    }

    /// Takes the next line that has been heard.
    fn line(&mut self) -> Option<String> {
        let (line, rest) = self.heard.split_once('\n')?;
        let line = line.to_string();
        self.heard = rest.to_string();
        Some(line)
    }

    /// Waits for the next line, for at most `ms`.
    fn hear(&mut self, ms: u64) -> Result<String, String> {
        for _ in 0..ms {
            if let Some(line) = self.line() {
                return Ok(line);
            }
            self.run_ms(1);
        }
        Err(format!("no answer in {ms} ms"))
    }

    /// A question that is answered while a line waits, and how the answer begins.
    fn question(&mut self) -> (&'static [u8], &'static str) {
        match (self.prints, self.random(2)) {
            (false, _) => (b"?", "<Run|"),
            (_, 0) => (b"M105\n", "ok T:"),
            _ => (b"M114\n", "X:"),
        }
    }

    /// Asks, and hears the answer soon.
    fn ask(&mut self) -> Result<(), String> {
        let (question, begins) = self.question();
        self.machine.send(question);
        let answer = self.hear(30)?;
        if !answer.starts_with(begins) {
            return Err(format!("{answer} for {begins}"));
        }
        if begins == "X:" && self.hear(30)? != "ok" {
            return Err("no ok behind M114".into());
        }
        Ok(())
    }

    /// The line of a pause.
    fn pause(&mut self, ms: u64) -> String {
        let seconds = format!("{}.{:03}", ms / 1_000, ms % 1_000);
        match (self.prints, self.random(3)) {
            (false, 0) => format!("G4P{seconds}"),
            (false, 1) => format!("g04 p{seconds} (waits)"),
            (false, _) => format!("N7 M9 G4 P{seconds}"),
            (true, 0) => format!("G4 P{ms}"),
            (true, 1) => format!("G4 S{seconds} ; waits"),
            (true, _) => format!("M0 P{ms}"),
        }
    }
}

/// Sends lines one by one. The answer of each pause comes when X has come to its end, and stood there for the pause.
fn one_by_one(prints: bool, seed: u64) -> Result<(), String> {
    let mut sender = Sender::boot(prints, seed);
    let mut target = 0;
    for _ in 0..20 {
        let before = sender.now;
        if sender.random(3) != 0 {
            target += STEPS / 2 * (1 + sender.random(4) as i64);
            sender.send(&format!("G1 X{:.1} F1200", target as f64 / STEPS as f64));
            if sender.hear(20)? != "ok" || sender.now - before > 20 {
                return Err("a move waits".into());
            }
            continue;
        }
        let ms = [0, 1, 7, 50, 200, 700][sender.random(6) as usize];
        let line = sender.pause(ms);
        sender.send(&line);
        let (asks, holds) = (sender.random(2) == 0, !prints && sender.random(4) == 0);
        let mut held = 0;
        if asks && (ms > 100 || sender.at < target - STEPS) {
            sender.run_ms(10);
            sender.ask()?;
        }
        if holds && ms == 700 {
            while sender.at != target || sender.now - sender.since < 100 {
                sender.run_ms(1);
            }
            let since = sender.now;
            sender.machine.send(b"!");
            sender.run_ms(900);
            if !sender.heard.is_empty() {
                return Err(format!("in a hold: {}", sender.heard));
            }
            sender.machine.send(b"~");
            held = sender.now - since;
        }
        let answer = sender.hear(5_000)?;
        let stood = sender.now - sender.since.max(before);
        if answer != "ok" || sender.at != target {
            return Err(format!("{line}: {answer} at {} of {target}", sender.at));
        }
        // The motors may have stood still before the line was sent.
        // A hold begins some milliseconds after its character.
        let early = if held == 0 { 2 } else { 12 };
        if stood + early < ms + held || stood > ms + held + LATE {
            return Err(format!("{line}: answered after {stood} ms, held {held}"));
        }
    }
    Ok(())
}

#[test]
fn a_pause_is_answered_when_it_is_over() {
    try_all(30, |seed| apart(move || one_by_one(false, seed)));
}

#[test]
fn a_pause_of_a_printing_host_is_answered_when_it_is_over() {
    try_all(30, |seed| apart(move || one_by_one(true, seed)));
}

/// A sender that counts characters: no line is lost, answers come in order, and those of pauses when they are due.
fn counted(seed: u64) -> Result<(), String> {
    let mut sender = Sender::boot(false, seed);
    let (mut lines, mut waits) = (VecDeque::new(), VecDeque::new());
    let mut target = 0;
    for _ in 0..150 {
        let is_pause = sender.random(6) == 0;
        let line = if is_pause {
            let ms = sender.random(60);
            sender.pause(ms)
        } else {
            target += STEPS / 10;
            format!("G1X{:.1}F1800", target as f64 / STEPS as f64)
        };
        lines.push_back((line, is_pause, target));
    }
    let mut flight = 0;
    while !lines.is_empty() || !waits.is_empty() {
        while let Some((line, is_pause, target)) = lines.front().cloned()
            && flight + line.len() < 254
        {
            sender.send(&line);
            flight += line.len() + 1;
            waits.push_back((line.len() + 1, is_pause, target));
            lines.pop_front();
        }
        if sender.random(20) == 0 {
            sender.machine.send(b"?");
        }
        let answer = sender.hear(5_000)?;
        if answer.starts_with('<') {
            continue;
        }
        let (length, is_pause, target) = waits.pop_front().ok_or("one answer too many")?;
        if answer != "ok" {
            return Err(answer);
        }
        flight -= length;
        // The next move may have begun while the answer was sent.
        if is_pause && !(target..target + STEPS / 10).contains(&sender.at) {
            return Err(format!("a pause answered at {}, its end is {target}", sender.at));
        }
    }
    Ok(())
}

#[test]
fn a_sender_that_counts_characters_waits_as_well() {
    try_all(20, |seed| apart(move || counted(seed)));
}

#[test]
fn a_pause_that_is_dropped_is_not_answered_by_ok() {
    apart(|| {
        let mut sender = Sender::boot(false, 1);
        sender.send("G1 X1 F600");
        sender.send("G4 P30");
        sender.run_ms(500);
        assert_eq!(sender.line().as_deref(), Some("ok"));
        assert_eq!(sender.line(), None);
        // A reset.
        sender.machine.send(b"\x18");
        sender.run_ms(100);
        let heard = std::mem::take(&mut sender.heard);
        assert!(!heard.contains("ok") && heard.contains("Grbl"), "{heard}");
        sender.send("$X");
        sender.run_ms(50);
        sender.heard.clear();
        // An alarm.
        sender.send("G4 P30");
        sender.run_ms(50);
        sender.machine.send_aux(b"{alarm:1}\n");
        sender.run_ms(100);
        assert!(sender.heard.contains("error:9\n") && !sender.heard.contains("ok"));
        sender.heard.clear();
        sender.send("$X");
        sender.run_ms(50);
        sender.heard.clear();
        // Check mode: nothing waits.
        sender.send("$C");
        sender.send("G4 P30");
        sender.run_ms(50);
        assert_eq!(sender.heard, "[MSG:Enabled]\nok\nok\n");
    });
}

#[test]
fn in_a_pause_the_other_port_is_answered() {
    apart(|| {
        let mut sender = Sender::boot(false, 1);
        sender.machine.received_aux();
        sender.send("G4 P1");
        sender.run_ms(100);
        sender.machine.send_aux(b"{stat:n}\n");
        sender.run_ms(30);
        let other = String::from_utf8(sender.machine.received_aux()).unwrap();
        assert!(other.contains("\"stat\":5"), "{other}");
        // G-code of another port is refused, as in any motion.
        sender.machine.send_aux(b"g4p0\n");
        sender.run_ms(30);
        let other = String::from_utf8(sender.machine.received_aux()).unwrap();
        assert!(other.contains(",117,"), "{other}");
        assert_eq!(sender.line(), None);
        sender.run_ms(1_000);
        assert_eq!(sender.line().as_deref(), Some("ok"));
    });
}

#[test]
fn lines_of_a_printing_host_wait_behind_a_pause() {
    apart(|| {
        let mut sender = Sender::boot(true, 1);
        sender.send("G1 X1 F600");
        sender.send("G4 P500");
        sender.send("M118 behind");
        sender.send("M105");
        sender.run_ms(300);
        // M105 has no number, so it overtakes.
        let first = [sender.line(), sender.line(), sender.line()];
        assert_eq!(first[0].as_deref(), Some("ok"));
        assert!(first[1].as_ref().is_some_and(|line| line.starts_with("ok T:")), "{first:?}");
        assert_eq!(first[2], None);
        sender.run_ms(600);
        assert_eq!(sender.heard, "ok\nbehind\nok\n");
        sender.heard.clear();
        // A long pause: the host is told that the board is busy.
        sender.send("G4 S5");
        sender.run_ms(4_900);
        assert_eq!(sender.heard, "echo:busy: processing\n".repeat(2));
        sender.run_ms(200);
        assert!(sender.heard.ends_with("\nok\n"), "{}", sender.heard);
        sender.heard.clear();
        // OctoPrint sets the period once it has heard that the board is busy.
        sender.send("M113 S1");
        sender.send("G4 S5");
        sender.run_ms(4_900);
        assert_eq!(sender.heard, format!("ok\n{}", "echo:busy: processing\n".repeat(4)));
        sender.run_ms(200);
        sender.heard.clear();
        sender.send("M113 S0");
        sender.send("G4 S5");
        sender.run_ms(5_100);
        assert_eq!(sender.heard, "ok\nok\n");
    });
}

#[test]
fn in_tinygs_dialect_a_pause_is_answered_when_it_has_been_read() {
    apart(|| {
        eeprom::put(&[]);
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        machine.run_ms(100);
        machine.send(b"{}\n");
        machine.run_ms(20);
        machine.received();
        machine.send(b"g1x5f300\ng4p1\n");
        machine.run_ms(50);
        let heard = String::from_utf8(machine.received()).unwrap();
        assert_eq!(heard.matches("\"f\":[1,0,").count(), 2, "{heard}");
    });
}
