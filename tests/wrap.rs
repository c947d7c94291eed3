//! The millisecond count wraps after 49.7 days, at 2^32 ms, without making anything late. The clock of each machine
//! here starts 3 s before the wrap.

use kerf::hal::imp::{Machine, gpio};

/// The count of milliseconds when the machines start.
const START_MS: u64 = (1 << 32) - 3_000;

struct Sender {
    machine: Machine,
}

impl Sender {
    fn boot() -> Self {
        let machine = Machine::boot_at(115_200, START_MS).expect("one machine for each thread");
        let mut sender = Sender { machine };
        assert!(sender.ask("", 100).contains("SYSTEM READY"));
        // TinyG's dialect from now on.
        sender.set("{}\n");
        sender
    }

    /// Sends a text, and returns what the machine sends within some milliseconds.
    fn ask(&mut self, text: &str, ms: u64) -> String {
        self.machine.send(text.as_bytes());
        self.machine.run_ms(ms);
        String::from_utf8(self.machine.received()).expect("ASCII")
    }

    /// Sends lines that must be answered with status 0.
    fn set(&mut self, text: &str) {
        let answer = self.ask(text, 200);
        assert!(answer.contains("\"f\":[1,0,"), "{text}: {answer}");
    }
}

#[test]
fn idle() {
    let mut sender = Sender::boot();
    sender.ask("", 4_000);
    sender.set("{xvm:700}\n");
    let answer = sender.ask("g1x1f500\n", 500);
    assert!(answer.contains("\"stat\":3"), "{answer}");
    // The storage task waits for the EEPROM, and the parser for a line to drain.
    let answer = sender.ask("{reset:1}\n", 500);
    assert!(answer.contains("\"reset\":"), "{answer}");
    assert!(kerf::hal::imp::was_reset());
}

#[test]
fn in_a_move() {
    let mut sender = Sender::boot();
    sender.set("{si:100}\n");
    let answer = sender.ask("g1x50f500\n", 7_000);
    assert!(answer.matches("\"posx\"").count() > 55, "reports go on: {answer}");
    assert!(answer.trim_end().ends_with("\"stat\":3}}"), "{answer}");
    assert_eq!(sender.machine.emitted().position[0], 64_000);
}

/// No percent sign has ever come, so an exclamation mark right after the wrap is a hold and no flush.
#[test]
fn in_a_hold() {
    let mut sender = Sender::boot();
    sender.ask("g1x50f1000\n", 2_905);
    let answer = sender.ask("!", 300);
    assert!(answer.contains("\"stat\":6"), "{answer}");
    assert!(!answer.contains("\"rx\""), "nothing is flushed: {answer}");
    sender.ask("~", 3_000);
    assert_eq!(sender.machine.emitted().position[0], 64_000);
}

#[test]
fn in_a_dwell() {
    let mut sender = Sender::boot();
    let answer = sender.ask("g4p5\n", 4_900);
    assert!(!answer.contains("\"stat\":3"), "{answer}");
    let answer = sender.ask("", 300);
    assert!(answer.contains("\"stat\":3"), "{answer}");
}

#[test]
fn with_a_spindle() {
    let mut sender = Sender::boot();
    sender.set("{spde:4}\n");
    sender.ask("m3s1000\ng1x1f500\n", 3_500);
    assert_eq!(sender.machine.emitted().position[0], 0, "the spindle is given its time");
    assert_eq!(gpio::outputs() & 1, 1);
    sender.ask("", 1_500);
    assert_eq!(sender.machine.emitted().position[0], 1_280);
    sender.set("m5\n");
}

#[test]
fn motors_lose_their_power_in_time() {
    let mut sender = Sender::boot();
    sender.set("{mt:2}\n");
    sender.ask("g1x1f500\n", 500);
    sender.ask("", 1_000);
    assert!(sender.ask("{pwr:n}\n", 100).contains("1"), "on still");
    sender.ask("", 2_000);
    println!("{}", sender.ask("{pwr:n}\n", 100));
}

/// An exclamation mark right behind a percent sign drops what is queued. No percent sign has come here, neither at
/// time 0 nor ever.
#[test]
fn a_hold_is_no_flush() {
    let mut sender = Sender::boot();
    sender.ask("g1x1f20\ng1x2\n", 2_907);
    let answer = sender.ask("!", 500);
    assert!(!answer.contains("\"rx\""), "{answer}");
    sender.ask("~", 4_000);
    assert_eq!(sender.machine.emitted().position[0], 2_560);
}
