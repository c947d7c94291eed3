//! Random conversations with the whole firmware on the host, in mocked time: lines and real-time characters on both
//! ports, switches that change, resets. What is judged is in `tests/support/session.rs`; `tests/sim/tests/realtime.rs` has the
//! same conversations with the image, and shorter ones.
//!
//! Each is with a machine of its own. One that fails is made as small as it can be, and its seed is told:
//! `KERF_SEED=4711 KERF_CASES=1 cargo test -p kerf --test host realtime::` has it again. A long run on all cores:
//! `KERF_CASES=100000 cargo test --release -p kerf --test host realtime::`.

use std::thread;

use kerf::hal::imp::{Machine, eeprom, was_reset};

use crate::ops::{self, Op, Scale};
use crate::seeds;
use crate::session::Session;

/// Up to a minute of the machine's time.
const SCALE: Scale = Scale { ops: 40, way: 3_000, radius: 1.5, wait: 1_500 };
/// What is left of a conversation after a reset, and of the machine the EEPROM.
type Rest<'a> = (&'a [Op], Vec<u8>);

/// A conversation from power-up to its end, or to a reset.
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

/// Has a conversation, with a machine in a thread of its own each time it starts.
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

/// The second move is planned while the first is in the very last of its slow-down.
#[test]
fn a_move_that_comes_at_the_last_moment_gets_going() {
    play(&[Op::Line(0, "g90 g0 x-3.202 y1.395".to_string())]).expect("an end");
}
