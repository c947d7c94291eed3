//! Random conversations in grbl's dialect with the whole firmware on the host, in mocked time: lines, real-time bytes
//! anywhere in them, resets, and TinyG's dialect on the second port. `tests/support/grbl_session.rs` judges them;
//! `tests/sim/tests/grbl.rs` plays shorter conversations of this kind with the image.
//!
//! A conversation that fails is shrunk, and its seed is printed: `KERF_SEED=4711 KERF_CASES=1 cargo test -p kerf
//! --test host grbl_random::` plays it again.

use std::thread;

use kerf::hal::imp::Machine;

use crate::grbl_ops::{self, Op};
use crate::grbl_session::Session;
use crate::seeds;

/// See [`Session`].
const REPORT_MS: u64 = 20;

/// Plays a conversation, with a machine in a thread of its own.
fn play(ops: &[Op]) -> Result<(), String> {
    let life = || {
        let mut session =
            Session::new(Machine::boot(115_200).expect("one machine for each thread"), REPORT_MS);
        let played = session.begin().and_then(|()| session.play(ops));
        played.map_err(|why| format!("{why}\n{}", session.story()))
    };
    let lived = thread::scope(|scope| scope.spawn(life).join());
    lived.map_err(|_| "the firmware panics".to_string())?
}

#[test]
fn any_conversation_keeps_to_the_dialect() {
    seeds::try_all(300, |seed| {
        seeds::smallest(seed, &grbl_ops::conversation(40, 1_000), |ops| play(&ops))
    });
}

/// Questions are no part of lines, and take no room from them.
#[test]
fn questions_in_a_long_hold_take_no_room() {
    let mut session = Session::new(Machine::boot(115_200).expect("one machine"), REPORT_MS);
    let played = session.begin().and_then(|()| session.hold_long());
    played.unwrap_or_else(|why| panic!("{why}\n{}", session.story()));
}
