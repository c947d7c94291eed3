//! Every setting at the limits of its documented range, alone and three at a time, each followed by short moves. The
//! steps that are made are compared with the distances that were sent. Values within the range take effect; values
//! beyond it are refused.
//!
//! Each case has a machine of its own. `KERF_SEED` and `KERF_CASES` choose the cases of three settings, as in
//! `tests/streams.rs`.

use std::thread;

use kerf::config::Owner;
use kerf::hal::imp::Machine;
use proptest::prelude::*;
use proptest::sample::select;

use crate::extremes::{self, Case};
use crate::seeds;

/// Settings that keep the machine from moving, or change how it answers.
const APART: [&str; 6] = ["saf", "est", "jv", "ej", "dia", "js"];

fn name(case: &Case) -> String {
    String::from_utf8(case.setting.name().bytes().to_vec()).expect("ASCII")
}

fn play(cases: Vec<Case>) -> Result<(), String> {
    let lived = thread::scope(|scope| {
        let machine = || Machine::boot(115_200).expect("one machine for each thread");
        scope.spawn(move || extremes::play(machine(), &cases)).join()
    });
    lived.map_err(|_| "the firmware panics".to_string())?
}

#[test]
fn each_setting_at_its_limits_moves_as_it_says() {
    let cases: Vec<_> = extremes::cases();
    assert!(cases.len() > 600, "{} cases", cases.len());
    let failed: Vec<_> = cases
        .into_iter()
        .filter(|case| !APART.contains(&name(case).as_str()))
        .filter_map(|case| {
            play(vec![case]).err().map(|why| format!("{} {}: {why}", name(&case), case.value))
        })
        .collect();
    assert!(failed.is_empty(), "{} fail:\n{}", failed.len(), failed.join("\n"));
}

/// Three settings of motors and axes together have the effect that they are documented to have.
#[test]
fn settings_at_their_limits_together_move_as_they_say() {
    let moves = |case: &Case| matches!(case.setting.owner(), Owner::Motor(_) | Owner::Axis(_));
    let cases: Vec<_> = extremes::cases().into_iter().filter(moves).collect();
    let three = prop::collection::vec(select(cases), 3);
    seeds::try_all(1_000, |seed| seeds::smallest(seed, &three, play));
}
