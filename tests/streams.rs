//! Random streams on both ports of the whole firmware on the host, in mocked time. The model of a port's stream is in
//! `tests/support/stream`; `tests/sim/tests/streams.rs` plays shorter ones with the image.
//!
//! Each conversation has a machine of its own, whose count of milliseconds wraps during it. One that fails is shrunk,
//! and its seed is printed: `KERF_SEED=4711 KERF_CASES=1 cargo test -p kerf --test host streams::` plays it again. A
//! long run on all cores: `KERF_CASES=100000 cargo test --release -p kerf --test host streams::`.

use std::thread;

use kerf::hal::imp::{self, Machine};

use crate::seeds;
use crate::stream::dialogue::Dialogue;
use crate::stream::ops::{Op, Scale, Setup, conversation};

/// A conversation takes up to a minute of the machine's time.
const SCALE: Scale = Scale { ops: 40, lines: 12, wait: 1_500, wrap: 20_000 };

/// Time within which questions must be answered, ms; one ms of it is the resolution of the test.
const PROMPT_MS: f64 = 21.0;

/// Plays a conversation from power-up to its end.
fn live(setup: &Setup, ops: &[Op]) -> Result<(), String> {
    let start = (1 << 32) - u64::from(setup.wrap);
    let machine = Machine::boot_at(115_200, start).expect("one machine for each thread");
    let mut dialogue = Dialogue::new(machine, PROMPT_MS);
    let played = dialogue.begin().and_then(|()| dialogue.play(setup, ops));
    played.map_err(|why| format!("{why}\n{}", dialogue.story()))
}

/// Plays a conversation, with a machine in a thread of its own.
fn play((setup, ops): (Setup, Vec<Op>)) -> Result<(), String> {
    // Half of the machines blend.
    let blends = ops.len() % 2 == 1;
    let lived = thread::scope(|scope| {
        let live = || {
            imp::set_blends(blends);
            live(&setup, &ops)
        };
        scope.spawn(live).join()
    });
    lived.map_err(|_| "the firmware panics".to_string())?
}

#[test]
fn any_stream_is_answered_and_carried_out() {
    seeds::try_all(6_000, |seed| seeds::smallest(seed, &conversation(SCALE), play));
}
