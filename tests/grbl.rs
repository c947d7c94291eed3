//! grbl's dialect with a sender that counts characters. No line is lost, whatever the sender does.

use std::collections::VecDeque;
use std::thread;

use kerf::hal::imp::{Machine, eeprom};

/// A sender that keeps as many bytes in flight as the machine has reported room for.
struct Sender {
    machine: Machine,
    /// The lengths of the lines that have not been answered.
    waits: VecDeque<usize>,
    heard: String,
    reports: Vec<String>,
    room: usize,
}

impl Sender {
    fn boot() -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        let (waits, heard, reports) = (VecDeque::new(), String::new(), Vec::new());
        let mut sender = Self { machine, waits, heard, reports, room: 128 };
        sender.machine.run_ms(100);
        sender.machine.received();
        sender.machine.send(b"$I\n");
        sender.machine.run_ms(50);
        let build = String::from_utf8(sender.machine.received()).unwrap();
        let options = build.split("[OPT:").nth(1).and_then(|rest| rest.split(']').next());
        let room = options.and_then(|options| options.split(',').nth(2)).expect("bytes of room");
        sender.room = room.parse().unwrap();
        assert!(sender.room >= 128 && build.ends_with("ok\r\n"), "{build}");
        sender
    }

    /// Lets time pass, and takes the answers.
    fn run_ms(&mut self, ms: u64) {
        self.machine.run_ms(ms);
        self.heard += &String::from_utf8(self.machine.received()).unwrap();
        while let Some((line, rest)) = self.heard.split_once("\r\n") {
            match line {
                "ok" => {
                    self.waits.pop_front().expect("an answer to a line");
                }
                _ if line.starts_with('<') => self.reports.push(line.to_string()),
                _ => panic!("{line}"),
            }
            self.heard = rest.to_string();
        }
    }

    fn in_flight(&self) -> usize {
        self.waits.iter().sum()
    }

    /// Sends a line if it fits. Returns whether it did.
    fn send(&mut self, line: &str) -> bool {
        let fits = self.in_flight() + line.len() <= self.room;
        if fits {
            self.machine.send(line.as_bytes());
            self.waits.push_back(line.len());
        }
        fits
    }

    /// Returns the free blocks and bytes of the last report.
    fn free(&self) -> (usize, usize) {
        let report = self.reports.last().expect("a report");
        let field = report.split('|').find_map(|field| field.strip_prefix("Bf:")).expect("Bf");
        let (blocks, bytes) = field.split_once(',').unwrap();
        (blocks.parse().unwrap(), bytes.parse().unwrap())
    }
}

#[test]
fn a_sender_that_counts_characters_overruns_nothing() {
    let mut sender = Sender::boot();
    let mut seed = 20u32;
    let mut random = |below: u32| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 16) % below
    };
    let (mut x, mut lines) = (0i32, 0);
    while lines < 3_000 {
        let step = random(100) as i32 - 50;
        let line = match random(5) {
            0 => "\n".to_string(),
            1 => format!(
                "g1 x{}.{:02} f6000 (a line that is longer than most)\n",
                (x + step) / 100,
                (x + step).abs() % 100
            ),
            _ => format!("x{}\n", f64::from(x + step) / 100.0),
        };
        let line = if lines == 0 { "g1 x0 f6000\n".to_string() } else { line };
        if line.contains('x') && x + step < 0 && lines > 0 {
            continue;
        }
        if sender.send(&line) {
            lines += 1;
            if line.contains('x') && lines > 1 {
                x += step;
            }
            continue;
        }
        sender.run_ms(1 + u64::from(random(30)));
        if random(200) == 0 {
            // A long hold, with all buffers full, and a sender that asks continually.
            sender.machine.send(b"!");
            for _ in 0..300 {
                sender.machine.send(b"?");
                sender.run_ms(10);
                while sender.send("\n") {}
            }
            sender.machine.send(b"~");
        }
    }
    while sender.in_flight() > 0 {
        sender.run_ms(10);
    }
    sender.run_ms(30_000);
    sender.machine.send(b"?");
    sender.run_ms(20);
    let position = format!("<Idle|MPos:{:.3},", f64::from(x) / 100.0);
    let report = sender.reports.last().unwrap();
    assert!(report.starts_with(&position), "{report} instead of {position}");
}

#[test]
fn the_room_that_a_report_tells_is_there() {
    let mut sender = Sender::boot();
    assert!(sender.send("$10=3\n") && sender.room == 254);
    sender.run_ms(200);
    let begun = ["g1 x0.01 f60\n", "g1 x5\n"];
    for n in 0..200 {
        while !sender.send(begun[usize::from(n > 0)]) {
            sender.run_ms(5);
            if sender.in_flight() > 200 {
                break;
            }
        }
        if sender.in_flight() > 200 {
            break;
        }
    }
    // A sender that obeys the reports loses nothing, and all its lines are answered in the end.
    for _ in 0..5 {
        sender.machine.send(b"!?");
        sender.run_ms(50);
        let (blocks, bytes) = sender.free();
        assert!(blocks <= 61 && bytes <= 254, "{blocks} {bytes}");
        for _ in 0..bytes {
            sender.machine.send(b"\n");
            sender.waits.push_back(1);
        }
        sender.run_ms(100);
        sender.machine.send(b"~");
        sender.run_ms(2_000);
    }
    for _ in 0..3_000 {
        sender.run_ms(20);
    }
    assert_eq!(sender.in_flight(), 0);
}

/// Returns what the two ports send at a start with this setting of `dia`, and in answer to these bytes: the second
/// port, then the first.
fn spoken(dia: u8, bytes: &'static [u8]) -> [String; 2] {
    let set = move || {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        machine.run_ms(100);
        machine.send(format!("{{dia:{dia}}}\n").as_bytes());
        machine.run_ms(500);
        eeprom::contents()
    };
    let left = thread::spawn(set).join().unwrap();
    let start = move || {
        eeprom::put(&left);
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        machine.run_ms(100);
        machine.send(bytes);
        machine.send_aux(bytes);
        machine.run_ms(50);
        [machine.received(), machine.received_aux()].map(|heard| String::from_utf8(heard).unwrap())
    };
    thread::spawn(start).join().unwrap()
}

#[test]
fn each_port_has_the_dialect_that_is_set_for_it() {
    for (dia, ports) in
        [(3, "gg"), (2, "tt"), (0, "bb"), (11, "gt"), (14, "tg"), (7, "gb"), (12, "bg")]
    {
        for (heard, port) in spoken(dia, b"\n").iter().zip(ports.chars()) {
            let [grbl, tinyg] = ["Grbl 1.1h", "SYSTEM READY"].map(|text| heard.contains(text));
            let greets = match (grbl, tinyg) {
                (true, true) => 'b',
                (true, false) => 'g',
                _ => 't',
            };
            assert_eq!(greets, port, "{dia}: {heard}");
            // An empty line is answered in grbl's dialect alone.
            assert_eq!(heard.ends_with("ok\r\n"), port != 't', "{dia}: {heard}");
        }
    }
}

#[test]
fn each_port_tells_what_has_decided_for_its_dialect() {
    let questions = ["$I\n", "{dia:n}\n"];
    // The answer of each dialect, and the reason for the dialect.
    let told = ["[MSG:grbl's dialect, ", "\"msg\":\"TinyG's dialect on this port, "];
    for (dia, question, dialect, why) in [
        (0, 0, 0, "for it was said first"),
        (0, 1, 1, "for it was said first"),
        (3, 0, 0, "as is set"),
        (2, 1, 1, "as is set"),
        (1, 1, 1, "as is set"),
    ] {
        let question: &'static str = questions[question];
        for heard in spoken(dia, question.as_bytes()) {
            let wanted = format!("{}{why}", told[dialect]);
            assert!(heard.contains(&wanted), "{dia}: {heard} instead of {wanted}");
        }
    }
}
