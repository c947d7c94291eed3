//! Random conversations in grbl's dialect with the image on the simulated chip: shorter ones of the kind in
//! `tests/grbl_random.rs`. `tests/support/grbl_session.rs` judges them.
//!
//! One machine plays them all in sequence: `KERF_SEED=47 KERF_CASES=1 cargo test -p kerf-sim-tests grbl::` plays a
//! single one.

use kerf::boards::MEGA2560_GRBL;
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

/// Characters in flight that a sender may have.
const IN_FLIGHT: usize = 254;

/// Streams lines for a second with as many characters in flight as are allowed, and `?` in between, this many a second,
/// while the machine moves at 64,000 steps a second, or holds. Returns how many lines have been answered, and how many
/// of them refused.
fn asked(lines: &[&str], holds: bool, questions: u64) -> (usize, usize) {
    let mut machine = firmware(&MEGA2560_GRBL);
    machine.run_for_ms(1_500).unwrap();
    for line in ["$I", "$10=3", "$110=3000", "G21G91G1F3000X100"] {
        Side::send(&mut machine, format!("{line}\n").as_bytes());
        machine.run_for_ms(300).unwrap();
    }
    machine.receive();
    if holds {
        Side::send(&mut machine, b"!");
        machine.run_for_ms(50).unwrap();
    }
    let (mut lines, mut in_flight) = (lines.iter().cycle(), std::collections::VecDeque::new());
    let (mut heard, mut answered, mut refused) = (String::new(), 0, 0);
    let mut next = lines.next().unwrap();
    for ms in 0..1_000 {
        let mut bytes =
            vec![b'?'; ((ms + 1) * questions / 1_000 - ms * questions / 1_000) as usize];
        // What the line carries in a millisecond.
        while bytes.len() + next.len() <= 11
            && in_flight.iter().sum::<usize>() + next.len() + 1 <= IN_FLIGHT
        {
            bytes.extend_from_slice(next.as_bytes());
            bytes.push(b'\n');
            in_flight.push_back(next.len() + 1);
            next = lines.next().unwrap();
        }
        Side::send(&mut machine, &bytes);
        machine.run_for_ms(1).unwrap();
        heard += &String::from_utf8_lossy(&machine.receive());
        while let Some((line, rest)) = heard.split_once('\n') {
            if line.starts_with("ok") || line.starts_with("error") {
                in_flight.pop_front();
                answered += 1;
            }
            refused += usize::from(line.starts_with("error"));
            heard = rest.to_string();
        }
    }
    (answered, refused)
}

#[test]
fn explore() {
    for lines in [&[""][..], &["X.1", "X-.1"], &["T1"]] {
        for holds in [false, true] {
            for questions in [100, 1_000, 2_000, 4_000, 6_000] {
                println!("{lines:?} {holds} {questions}: {:?}", asked(lines, holds, questions));
            }
        }
    }
}

#[test]
fn explore_resets() {
    const KINDS: &[&str] = &[
        "",
        "g0 x1",
        "g91 g1 x0.1 f600",
        "m3 s100",
        "$G",
        "$$",
        "$#",
        "$I",
        "$X",
        "$110=1200",
        "$C",
        "q",
    ];
    let mut seed = 11u32;
    let mut random = move |below: u32| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 16) % below
    };
    let mut machine = firmware(&MEGA2560_GRBL);
    machine.run_for_ms(1_500).unwrap();
    let mut say = |bytes: &[u8], ms| {
        Side::send(&mut machine, bytes);
        machine.run_for_ms(ms).unwrap();
        String::from_utf8_lossy(&machine.receive()).to_string()
    };
    say(b"$I\n", 300);
    let mut failed = Vec::new();
    for n in 0..300 {
        let kind = |n: u32| KINDS[n as usize % KINDS.len()];
        let leaves = random(2) == 1;
        if leaves {
            say(b"$C\n", 60);
        }
        let (before, behind) = (kind(random(99)), kind(random(99)));
        let (one, two, three) = (random(60), random(60), random(2) * random(30));
        let pause = |n| vec![0x80; n as usize];
        let bytes = [
            b"$C\n".to_vec(),
            pause(one),
            format!("{before}\n").into_bytes(),
            pause(two),
            b"\x18".to_vec(),
            pause(three),
            format!("{behind}\n").into_bytes(),
        ];
        let heard = say(&bytes.concat(), 250);
        let answered = heard.rsplit("Grbl 1.1h").next().unwrap();
        let is_answer = |line: &&str| *line == "ok" || line.starts_with("error:");
        if answered.lines().filter(is_answer).count() != 1 {
            failed.push(format!("{n} {leaves} {before:?} {behind:?} {one} {two} {three}: {heard}"));
        }
        say(b"\x18", 120);
    }
    println!("{} fail\n{}", failed.len(), failed.join("\n"));
}
