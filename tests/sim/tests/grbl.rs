//! Random conversations in grbl's dialect with the image on the simulated chip: shorter ones of the kind in
//! `tests/grbl_random.rs`. `tests/support/grbl_session.rs` judges them.
//!
//! One machine plays them all in sequence: `KERF_SEED=47 KERF_CASES=1 cargo test -p kerf-sim-tests grbl::` plays a
//! single one.

use std::collections::VecDeque;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::Machine;
use proptest::strategy::ValueTree;

use crate::alarm_model::{Cause, LINES, Model, Op};
use crate::common::firmware;
use crate::grbl_session::Session;
use crate::side::Side;
use crate::{grbl_ops, seeds};

/// See [`Session`]. The longest of 2,800 took 38 ms, at 64,000 steps a second in a ramp; 14 took more than 20.
const REPORT_MS: u64 = 40;

#[test]
fn any_conversation_keeps_to_the_dialect() {
    let mut session = Session::new(firmware(&MEGA2560_GRBL), REPORT_MS);
    let mut played = session.begin();
    for seed in seeds::seeds(60) {
        let (tree, _) = seeds::case(seed, &grbl_ops::conversation(20, 300));
        played = played.and_then(|()| session.play(&tree.current()));
        if let Err(why) = &played {
            panic!("seed {seed}: {why}\n{}", session.story());
        }
    }
    session.check_prompt();
}

/// A selection of what `tests/grbl_alarms.rs` plays.
#[test]
fn an_alarm_ends_by_what_ends_it() {
    let line = |wanted: &str, resets| {
        let row = LINES.iter().position(|(line, _)| *line == wanted);
        Op::Line(row.unwrap_or_else(|| panic!("{wanted}")), resets)
    };
    let refused = || ["$HB", "$RST=#", "G0X1", "$SLP", "M2"].map(|text| line(text, false));
    let mut model = Model::boot(firmware(&MEGA2560_GRBL)).unwrap();
    for (cause, ends) in [
        (Cause::RunsIntoLimit, line("$H", false)),
        (Cause::Limit("G90G1F600X8", true), line("$HX", true)),
        (Cause::StopStays, line("$H", false)),
        (Cause::Reset, line("$H", true)),
    ] {
        let begin = [Op::Raise(cause, 500), line("$HB", true)];
        let ops: Vec<_> = begin.into_iter().chain(refused()).chain([ends]).collect();
        let played = model.play(&ops).and_then(|()| model.recover());
        played.unwrap_or_else(|why| panic!("{cause:?}: {why}\n{}", model.story()));
    }
}

/// Characters in flight that a sender may have, and single-byte commands that it may send in a second.
const IN_FLIGHT: usize = 254;
const QUESTIONS: u64 = 200;
/// Longest time until all lines are answered, ms.
const ANSWERED_MS: u64 = 20_000;

/// A sender that counts characters.
struct Sender {
    machine: Machine,
    in_flight: VecDeque<usize>,
    heard: String,
}

impl Sender {
    /// Takes the answers that come in a millisecond.
    fn run(&mut self) {
        self.machine.run_for_ms(1).unwrap();
        self.heard += &String::from_utf8_lossy(&self.machine.receive());
        while let Some((line, rest)) = self.heard.split_once('\n') {
            assert!(!line.starts_with("error"), "{line}");
            if line.starts_with("ok") {
                self.in_flight.pop_front().expect("an answer to a line");
            }
            self.heard = rest.to_string();
        }
    }

    /// Streams lines for a second with as many characters in flight as are allowed, and `?` in between.
    fn stream(&mut self, lines: &[&str]) {
        let mut lines = lines.iter().cycle().copied().peekable();
        for ms in 0..1_000 {
            let due = (ms + 1) * QUESTIONS / 1_000 - ms * QUESTIONS / 1_000;
            let mut bytes = vec![b'?'; due as usize];
            // The serial line carries 11 bytes in a millisecond.
            while let Some(line) = lines.next_if(|line| {
                bytes.len() + line.len() < 11
                    && self.in_flight.iter().sum::<usize>() + line.len() < IN_FLIGHT
            }) {
                bytes.extend(line.bytes().chain([b'\n']));
                self.in_flight.push_back(line.len() + 1);
            }
            Side::send(&mut self.machine, &bytes);
            self.run();
        }
    }
}

/// The shortest lines leave the least room, because few of them have a place outside the receive ring. The machine
/// moves at 64,000 steps a second, or holds.
#[test]
fn questions_between_lines_lose_none() {
    for lines in [&[""][..], &["T1"], &["X.1", "X-.1"]] {
        for holds in [false, true] {
            let mut machine = firmware(&MEGA2560_GRBL);
            machine.run_for_ms(1_500).unwrap();
            for line in ["$I", "$110=3000", "G21G91G1F3000X100"] {
                Side::send(&mut machine, format!("{line}\n").as_bytes());
                machine.run_for_ms(300).unwrap();
            }
            machine.receive();
            let mut sender = Sender { machine, in_flight: VecDeque::new(), heard: String::new() };
            if holds {
                Side::send(&mut sender.machine, b"!");
            }
            sender.stream(lines);
            Side::send(&mut sender.machine, b"~");
            let answered = (0..ANSWERED_MS).any(|_| {
                sender.run();
                sender.in_flight.is_empty()
            });
            assert!(answered, "{lines:?}, holds: {holds}: {} unanswered", sender.in_flight.len());
        }
    }
}
