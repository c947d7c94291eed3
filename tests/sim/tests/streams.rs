//! Random streams on both ports of the image on the simulated chip: shorter ones of the kind in `tests/streams.rs`.
//! The model of a port's stream is in `tests/support/stream`.
//!
//! Each of two machines plays half of them in sequence. The seed of one that fails is printed: `KERF_SEED=47
//! KERF_CASES=1 cargo test -p kerf-sim-tests streams::` plays it alone. With the first seed of its machine and enough
//! cases it is played after all that came before it.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread;
use std::time::Instant;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::Machine;
use proptest::strategy::ValueTree;

use crate::common::{age, firmware};
use crate::seeds;
use crate::stream::dialogue::Dialogue;
use crate::stream::ops::{Op, Scale, Setup, conversation};

/// A conversation takes about two seconds of the machine's time.
const SCALE: Scale = Scale { ops: 20, lines: 8, wait: 200, wrap: 0 };
/// Time within which questions must be answered, ms; one ms of it is the resolution of the test.
const PROMPT_MS: f64 = 21.0;
/// Default number of conversations: as many as CI has time for.
const USUAL: u64 = 40;
/// Machines that run at the same time.
const MACHINES: u64 = 2;
/// How long before its wrap the count of milliseconds of a machine begins, ms.
const WRAP_MS: u32 = 20_000;

/// A machine that is ready.
fn begun() -> Dialogue<Machine> {
    let mut machine = firmware(&MEGA2560_GRBL);
    age(&mut machine, WRAP_MS);
    let mut dialogue = Dialogue::new(machine, PROMPT_MS);
    dialogue.begin().unwrap_or_else(|why| panic!("{why}\n{}", dialogue.story()));
    dialogue
}

/// Plays a conversation. An error even if the simulator panics.
fn play(dialogue: &mut Dialogue<Machine>, setup: &Setup, ops: &[Op]) -> Result<(), String> {
    let played = catch_unwind(AssertUnwindSafe(|| dialogue.play(setup, ops)));
    let played = played.unwrap_or_else(|_| Err("the chip crashes".to_string()));
    played.map_err(|why| format!("{why}\n{}", dialogue.story()))
}

/// Plays the conversations of some seeds with one machine.
fn play_all(seeds: Range<u64>) {
    let (first, began) = (seeds.start, Instant::now());
    let mut dialogue = begun();
    for seed in seeds {
        let (tree, _) = seeds::case(seed, &conversation(SCALE));
        let (setup, ops) = tree.current();
        if let Err(why) = play(&mut dialogue, &setup, &ops) {
            let alone = |(setup, ops): (Setup, Vec<Op>)| play(&mut begun(), &setup, &ops);
            let alone = seeds::smallest(seed, &conversation(SCALE), alone).err();
            let alone = alone.unwrap_or_default();
            panic!("seed {seed}, on a machine that began with {first}: {why}\nAlone: {alone}");
        }
    }
    let seconds = began.elapsed().as_secs_f32();
    let slowest = dialogue.slowest;
    seeds::tell(&format!(
        "streams from seed {first} on: {seconds:.0} s, slowest answer {slowest:.0} ms"
    ));
}

#[test]
fn any_stream_is_answered_and_carried_out() {
    let seeds = seeds::seeds(USUAL);
    let share = (seeds.end - seeds.start).div_ceil(MACHINES) as usize;
    thread::scope(|scope| {
        for first in seeds.clone().step_by(share.max(1)) {
            let share = first..(first + share as u64).min(seeds.end);
            scope.spawn(|| play_all(share));
        }
    });
}
