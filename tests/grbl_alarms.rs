//! Every command in every alarm, with and without a reset before it, and random sequences of them.
//! `tests/support/alarm_model.rs` judges them; `tests/sim/tests/grbl.rs` plays some of them with the image.

use std::thread;

use kerf::hal::imp::Machine;
use proptest::prelude::*;
use proptest::sample::select;

use crate::alarm_model::{ASIDE, BYTES, CAUSES, Cause, Class, LINES, Model, Op, PANIC};
use crate::apart::apart;
use crate::seeds;

/// Plays sequences on one machine, which recovers in between.
fn play(sequences: &[Vec<Op>]) -> Result<(), String> {
    let life = || {
        let mut model = Model::boot(Machine::boot(115_200).expect("one machine for each thread"))?;
        for (n, ops) in sequences.iter().enumerate() {
            let mut played = model.play(ops);
            if n + 1 < sequences.len() {
                played = played.and_then(|()| model.recover());
            }
            played.map_err(|why| format!("{why}\n{}", model.story()))?;
        }
        Ok(())
    };
    let lived = thread::scope(|scope| scope.spawn(life).join());
    lived.unwrap_or_else(|_| Err("the firmware panics".to_string()))
}

/// Returns one sequence with all that leaves the alarm on, and one for each line that ends it.
fn all_in(cause: Cause, resets: bool) -> Vec<Vec<Op>> {
    let begin = || [Op::Raise(cause, 500)].into_iter().chain(resets.then_some(Op::Reset));
    let ends = |class| matches!(class, Class::Unlocks | Class::Homes | Class::EndsProgram);
    let rows = |rows: &'static [(&str, Class)], ends_it: bool| {
        (0..rows.len()).filter(move |row| ends(rows[*row].1) == ends_it)
    };
    let line = |row| Op::Line(row, false);
    let stays = begin()
        .chain(rows(LINES, false).map(line))
        .chain(rows(ASIDE, false).map(Op::Aside))
        .chain(BYTES.iter().copied().map(Op::Byte))
        .chain(rows(LINES, false).map(line));
    let ending = rows(LINES, true).map(line).chain(rows(ASIDE, true).map(Op::Aside));
    let ending = ending.map(|op| begin().chain([op]).collect());
    [stays.collect()].into_iter().chain(ending).collect()
}

#[test]
fn every_command_in_every_alarm() {
    let cases: Vec<_> = CAUSES.iter().flat_map(|cause| [(*cause, false), (*cause, true)]).collect();
    seeds::try_all(cases.len() as u64, |seed| {
        let (cause, resets) = cases[seed as usize % cases.len()];
        play(&all_in(cause, resets)).map_err(|why| format!("{cause:?}, {resets}: {why}"))
    });
}

#[test]
fn nothing_ends_a_panic() {
    let [stays, ending @ ..] = &all_in(PANIC, false)[..] else { unreachable!() };
    let ending = ending.iter().flatten().filter(|op| !matches!(op, Op::Raise(..))).cloned();
    play(&[stays.iter().cloned().chain(ending).collect()]).unwrap();
}

/// Random commands in one alarm after the other, also while the machine still slows down.
fn conversation() -> impl Strategy<Value = Vec<Op>> {
    let op = prop_oneof![
        8 => (select(CAUSES), prop_oneof![0..60_u64, 0..600_u64])
            .prop_map(|(cause, ms)| Op::Raise(cause, ms)),
        2 => Just(Op::Reset),
        12 => (0..LINES.len(), prop::bool::weighted(0.3)).prop_map(|(row, behind)| Op::Line(row, behind)),
        6 => (0..ASIDE.len()).prop_map(Op::Aside),
        3 => select(BYTES).prop_map(Op::Byte),
        2 => any::<bool>().prop_map(Op::Door),
    ];
    prop::collection::vec(op, 1..30)
}

#[test]
fn an_alarm_ends_by_what_ends_it() {
    seeds::try_all(60, |seed| seeds::smallest(seed, &conversation(), |ops| play(&[ops])));
}

/// Returns what is heard behind the alarm of a homing that fails, while the sender asks all the time, at first after `ms`.
fn heard_behind_a_failed_homing(ms: u64) -> String {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(100);
    machine.send(b"$I\n$130=5\n");
    machine.run_ms(200 + ms);
    machine.send(b"$HX\n");
    machine.received();
    let mut heard = String::new();
    while !heard.contains("error:") && heard.len() < 20_000 {
        machine.send(b"?");
        machine.run_ms(8);
        heard += &String::from_utf8(machine.received()).unwrap();
    }
    machine.send(b"?");
    machine.run_ms(50);
    heard += &String::from_utf8(machine.received()).unwrap();
    heard.split_once("ALARM:9\r\n").expect("an alarm").1.to_string()
}

#[test]
fn no_report_behind_the_alarm_of_a_failed_homing_says_idle() {
    for ms in 0..8 {
        let behind = apart(move || heard_behind_a_failed_homing(ms));
        assert!(behind.contains("error:9\r\n") && behind.contains("<Alarm|"), "{behind}");
        assert!(!behind.contains("<Idle|"), "{ms}: {behind}");
    }
}
