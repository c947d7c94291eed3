//! Random conversations with the whole firmware on the host, in mocked time: lines and real-time characters on both
//! ports, switches that change, resets. `tests/support/session.rs` judges them; `tests/sim/tests/realtime.rs` plays
//! shorter conversations of this kind with the image.
//!
//! Each conversation has a machine of its own. One that fails is shrunk, and its seed is printed: `KERF_SEED=4711
//! KERF_CASES=1 cargo test -p kerf --test host realtime::` plays it again. A long run on all cores:
//! `KERF_CASES=100000 cargo test --release -p kerf --test host realtime::`.

use std::thread;

use kerf::hal::imp::{Machine, eeprom, was_reset};

use crate::ops::{self, Op, Scale};
use crate::seeds;
use crate::session::Session;

/// A conversation takes up to a minute of the machine's time.
const SCALE: Scale = Scale { ops: 40, way: 3_000, radius: 1.5, wait: 1_500 };
/// What remains after a reset: the rest of the conversation, and the EEPROM contents of the machine.
type Rest<'a> = (&'a [Op], Vec<u8>);

/// Plays a conversation from power-up to its end, or to a reset.
fn live<'a>(ops: &'a [Op], stored: Option<&[u8]>) -> Result<Option<Rest<'a>>, String> {
    stored.into_iter().for_each(eeprom::put);
    let mut session = Session::new(Machine::boot(115_200).expect("one machine for each thread"));
    let played = match stored {
        None => session.begin(),
        Some(_) => session.greet(),
    };
    let played = played.and_then(|()| session.play(ops)).and_then(|rest| {
        if rest.is_none() {
            session.finish()?;
            return Ok(None);
        }
        session.run(20)?;
        was_reset().then_some(rest).ok_or_else(|| "no reset".to_string())
    });
    let rest = played.map_err(|why| format!("{why}\n{}", session.story()))?;
    Ok(rest.map(|rest| (rest, eeprom::contents())))
}

/// Plays a conversation, with a machine in a thread of its own for each start.
fn play(ops: &[Op]) -> Result<(), String> {
    let mut rest = Some((ops, None));
    while let Some((ops, stored)) = rest {
        let life = |stored: Option<Vec<u8>>| live(ops, stored.as_deref());
        let lived = thread::scope(|scope| scope.spawn(|| life(stored)).join());
        let lived = lived.map_err(|_| "the firmware panics".to_string())?;
        rest = lived?.map(|(rest, stored)| (rest, Some(stored)));
    }
    Ok(())
}

#[test]
fn any_conversation_ends_where_it_is_to() {
    seeds::try_all(300, |seed| seeds::smallest(seed, &ops::conversation(SCALE), |ops| play(&ops)));
}

/// The second move is planned while the first is at the very end of its deceleration.
#[test]
fn a_move_that_comes_at_the_last_moment_gets_going() {
    play(&[Op::Line(0, "g90 g0 x-3.202 y1.395".to_string())]).expect("an end");
}
