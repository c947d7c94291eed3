//! Random streams on both ports of the whole firmware on the host, in mocked time: the model of a port's stream is in
//! `tests/support/stream`; `tests/sim/tests/streams.rs` has the same with the image, and shorter ones.
//!
//! Each is with a machine of its own, whose count of milliseconds wraps within it. One that fails is made as small as
//! it can be, and its seed is told: `KERF_SEED=4711 KERF_CASES=1 cargo test -p kerf --test host streams::` has it again. A
//! long run on all cores: `KERF_CASES=100000 cargo test --release -p kerf --test host streams::`.

use std::thread;

use kerf::hal::imp::Machine;

use crate::seeds;
use crate::stream::dialogue::Dialogue;
use crate::stream::ops::{Op, Scale, Setup, conversation};

/// Up to a minute of the machine's time.
const SCALE: Scale = Scale { ops: 40, lines: 12, wait: 1_500, wrap: 20_000 };

/// Within which questions are answered, ms; a ms of it is that of the test.
const PROMPT_MS: f64 = 21.0;

/// A conversation from power-up to its end.
fn live(setup: &Setup, ops: &[Op]) -> Result<(), String> {
    let start = (1 << 32) - u64::from(setup.wrap);
    let machine = Machine::boot_at(115_200, start).expect("one machine for each thread");
    let mut dialogue = Dialogue::new(machine, PROMPT_MS);
    let played = dialogue.begin().and_then(|()| dialogue.play(setup, ops));
    played.map_err(|why| format!("{why}\n{}", dialogue.story()))
}

/// Has a conversation, with a machine in a thread of its own.
fn play((setup, ops): (Setup, Vec<Op>)) -> Result<(), String> {
    let lived = thread::scope(|scope| scope.spawn(|| live(&setup, &ops)).join());
    lived.map_err(|_| "the firmware panics".to_string())?
}

#[test]
fn any_stream_is_answered_and_carried_out() {
    seeds::try_all(6_000, |seed| seeds::smallest(seed, &conversation(SCALE), play));
}
