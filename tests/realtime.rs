//! Real-time characters at random times, to the whole firmware on the host: it never freezes, every line is
//! answered once, and motors are where positions are.

#[path = "support/cases.rs"]
mod cases;

use cases::cases;
use kerf::hal::imp::Machine;
use kerf::motion::queue;
use proptest::prelude::*;

/// What a sender does.
#[derive(Clone, Debug)]
enum Deed {
    Line(String),
    Characters(&'static [u8]),
    Wait(u64),
}

fn any_line() -> impl Strategy<Value = String> {
    let way = || (-9_000i32..9_000).prop_map(|n| f64::from(n) * 1e-3);
    prop_oneof![
        4 => (way(), way()).prop_map(|(x, y)| format!("g91 g1 f3000 x{x} y{y}")),
        2 => (way(), way()).prop_map(|(x, y)| format!("g90 g0 x{x} y{y}")),
        // More chords than there are blocks.
        1 => Just("g91 g2 f3000 x0 i5 j1 p2".to_string()),
        1 => Just("g4 p0.1".to_string()),
        1 => Just("m3 s100".to_string()),
        1 => Just("m0".to_string()),
        1 => Just("g91 g81 f600 x1 y1 z-1 r0 l3".to_string()),
        1 => Just("{\"gc\":\"g91 g1 f3000 x1\"}".to_string()),
        1 => Just("{posx:n}".to_string()),
        1 => Just("{qf:1}".to_string()),
        1 => prop::sample::select(vec!["{mfo:0.3}", "{mfo:2}", "{mto:0.2}", "m50 p0.6", "m48", "m49"])
            .prop_map(str::to_string),
        1 => Just("g91 g38.3 f3000 x2 z-2".to_string()),
        1 => prop::sample::select(vec!["{alarm:1}", "{clear:1}", "{clear:1}", "{shutd:1}"])
            .prop_map(str::to_string),
    ]
}

fn any_deed() -> impl Strategy<Value = Deed> {
    let characters = prop::sample::select(vec![
        &b"!"[..],
        b"!",
        b"~",
        b"~",
        b"%",
        b"%\n",
        b"!\n%\n",
        b"!%",
        b"%!",
        b"!%~",
        b"!~",
        b"~!",
        b"\x04",
        // Overrides: 100 %, +10, -10; traverses 25 %.
        b"\x04%\n",
        b"\x90",
        b"\x91\x91!",
        b"\x92~",
        b"\x97",
    ]);
    prop_oneof![
        3 => any_line().prop_map(Deed::Line),
        2 => characters.prop_map(Deed::Characters),
        2 => prop_oneof![0u64..20, 0u64..1_500].prop_map(Deed::Wait),
    ]
}

struct Sender {
    machine: Machine,
    heard: String,
    lines: usize,
}

impl Sender {
    fn run(&mut self, ms: u64) {
        self.machine.run_ms(ms);
        self.heard += &String::from_utf8(self.machine.received()).expect("ASCII");
    }

    fn answered(&self) -> usize {
        // Probing tells what it has found by itself.
        self.heard.matches("{\"r\":").count() - self.heard.matches("{\"r\":{\"prb\"").count() - 1
    }

    fn line(&mut self, line: &str) {
        // As many in flight as a sender may have.
        let mut patience = 0;
        while self.lines - self.answered() >= 4 {
            self.run(100);
            patience += 1;
            // It may be held, with the queue full.
            if patience % 20 == 0 {
                self.machine.send(b"~");
            }
            assert!(patience < 3_000, "line {} is never answered: {}", self.lines, self.heard);
        }
        self.lines += 1;
        self.machine.send(format!("{line}\n").as_bytes());
    }
}

/// Does all that, and moves to a place in the end.
fn play(deeds: &[Deed]) {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    let mut sender = Sender { machine, heard: String::new(), lines: 0 };
    sender.run(50);
    sender.line("{psw:1}");
    for deed in deeds {
        match deed {
            Deed::Line(line) => sender.line(line),
            Deed::Characters(characters) => sender.machine.send(characters),
            Deed::Wait(ms) => sender.run(*ms),
        }
    }
    // A queue flush takes what has come until it is done.
    sender.run(1_000);
    sender.line("{clear:1}");
    sender.line("g90 g1 f3000 x3 y-4 z1");
    let mut before = None;
    for _ in 0..2_000 {
        sender.run(100);
        sender.machine.send(b"~");
        let now = Some(sender.machine.emitted().steps);
        if now == before && queue::used() == 0 && sender.answered() == sender.lines {
            break;
        }
        before = now;
    }
    sender.run(500);
    assert_eq!(sender.answered(), sender.lines, "{}", sender.heard);
    assert_eq!(sender.machine.emitted().position, [3_840, -5_120, 1_280, 0], "{}", sender.heard);
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn any_conversation_ends_where_it_is_to(deeds in prop::collection::vec(any_deed(), 1..40)) {
        let played = std::thread::scope(|scope| scope.spawn(|| play(&deeds)).join());
        prop_assert!(played.is_ok());
    }
}

/// The second move is planned while the first is in the very last of its slow-down.
#[test]
fn a_move_that_comes_at_the_last_moment_gets_going() {
    let deeds = [Deed::Line("g90 g0 x-3.202 y1.395".to_string())];
    std::thread::spawn(move || play(&deeds)).join().expect("an end");
}
