//! Random conversations with the whole firmware on the host, in mocked time: lines and real-time characters on both
//! ports, switches that change, resets. What is judged is in `tests/support/talk.rs`; `tests/sim/tests/realtime.rs` has the
//! same conversations with the image, and shorter ones.
//!
//! Each is with a machine of its own. One that fails is made as small as it can be, and its seed is told:
//! `KERF_SEED=4711 KERF_CASES=1 cargo test -p kerf --test realtime` has it again. A long run on all cores:
//! `KERF_CASES=100000 cargo test --release -p kerf --test realtime`.

#[path = "support/deeds.rs"]
mod deeds;
#[path = "support/host.rs"]
mod host;
#[path = "support/seeds.rs"]
mod seeds;
#[path = "support/sender.rs"]
mod sender;
#[path = "support/side.rs"]
mod side;
#[path = "support/talk.rs"]
mod talk;
#[path = "support/whereabouts.rs"]
mod whereabouts;

use std::thread;

use deeds::{Deed, Scale};
use kerf::hal::imp::{Machine, eeprom, was_reset};
use talk::Talk;

/// Up to a minute of the machine's time.
const SCALE: Scale = Scale { deeds: 40, way: 3_000, radius: 1.5, wait: 1_500 };
/// What is left of a conversation after a reset, and of the machine the EEPROM.
type Rest<'a> = (&'a [Deed], Vec<u8>);

/// A conversation from power-up to its end, or to a reset.
fn live<'a>(deeds: &'a [Deed], stored: Option<&[u8]>) -> Result<Option<Rest<'a>>, String> {
    stored.into_iter().for_each(eeprom::put);
    let mut talk = Talk::new(Machine::boot(115_200).expect("one machine for each thread"));
    let played = match stored {
        None => talk.begin(),
        Some(_) => talk.greet(),
    };
    let played = played.and_then(|()| talk.play(deeds)).and_then(|rest| {
        if rest.is_none() {
            talk.finish()?;
            return Ok(None);
        }
        talk.run(20)?;
        was_reset().then_some(rest).ok_or_else(|| "no reset".to_string())
    });
    let rest = played.map_err(|why| format!("{why}\n{}", talk.story()))?;
    Ok(rest.map(|rest| (rest, eeprom::contents())))
}

/// Has a conversation, with a machine in a thread of its own each time it starts.
fn play(deeds: &[Deed]) -> Result<(), String> {
    let mut rest = Some((deeds, None));
    while let Some((deeds, stored)) = rest {
        let life = |stored: Option<Vec<u8>>| live(deeds, stored.as_deref());
        let lived = thread::scope(|scope| scope.spawn(|| life(stored)).join());
        let lived = lived.map_err(|_| "the firmware panics".to_string())?;
        rest = lived?.map(|(rest, stored)| (rest, Some(stored)));
    }
    Ok(())
}

#[test]
fn any_conversation_ends_where_it_is_to() {
    seeds::try_all(300, |seed| {
        seeds::smallest(seed, &deeds::conversation(SCALE), |deeds| play(&deeds))
    });
}

/// The second move is planned while the first is in the very last of its slow-down.
#[test]
fn a_move_that_comes_at_the_last_moment_gets_going() {
    play(&[Deed::Line(0, "g90 g0 x-3.202 y1.395".to_string())]).expect("an end");
}
