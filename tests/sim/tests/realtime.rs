//! Random conversations with the image on the simulated chip: lines and real-time characters on both ports, switches
//! that change, resets. They are shorter ones of the kind in `tests/realtime.rs`; `tests/support/session.rs` judges
//! them.
//!
//! Each of two machines plays half of a share in sequence. The seed of one that fails is printed: `KERF_SEED=47
//! KERF_CASES=1 cargo test -p kerf-sim-tests realtime::` plays it alone. With the first seed of its machine and
//! enough cases it is played after all that came before it.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread;
use std::time::Instant;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::Machine;
use proptest::strategy::ValueTree;

use crate::common::firmware;
use crate::common::share::share_of_seeds;
use crate::ops::{self, Op, Scale};
use crate::seeds;
use crate::session::Session;

/// A conversation takes about two seconds of the machine's time.
const SCALE: Scale = Scale { ops: 24, way: 1_500, radius: 1.0, wait: 300 };
/// Machines that run at the same time.
const MACHINES: u64 = 2;

fn play(session: &mut Session<Machine>, ops: &[Op]) -> Result<(), String> {
    let mut ops = ops;
    while let Some(rest) = session.play(ops)? {
        session.greet()?;
        ops = rest;
    }
    session.finish()
}

/// Plays the ops; a crash of the simulated chip is an error as well.
fn try_to_play(session: &mut Session<Machine>, ops: &[Op]) -> Result<(), String> {
    let played = catch_unwind(AssertUnwindSafe(|| play(session, ops)));
    let played = played.unwrap_or_else(|_| Err("the chip crashes".to_string()));
    played.map_err(|why| format!("{why}\n{}", session.story()))
}

/// A machine that is ready.
fn begun() -> Session<Machine> {
    let mut session = Session::new(firmware(&MEGA2560_GRBL));
    session.begin().unwrap_or_else(|why| panic!("{why}\n{}", session.story()));
    session
}

/// Plays the conversations of some seeds with one machine.
fn play_all(seeds: Range<u64>) {
    let (first, began) = (seeds.start, Instant::now());
    let mut session = begun();
    for seed in seeds {
        let (tree, _) = seeds::case(seed, &ops::conversation(SCALE));
        if let Err(why) = try_to_play(&mut session, &tree.current()) {
            let alone = alone(seed).err().unwrap_or_default();
            panic!("seed {seed}, on a machine that began with {first}: {why}\nAlone: {alone}");
        }
    }
    let seconds = began.elapsed().as_secs_f32();
    seeds::tell(&format!("conversations from seed {first} on: {seconds:.0} s"));
}

/// Plays the conversation of a seed with a machine of its own. One that fails is shrunk.
fn alone(seed: u64) -> Result<(), String> {
    let play = |ops: Vec<Op>| try_to_play(&mut begun(), &ops);
    seeds::smallest(seed, &ops::conversation(SCALE), play)
}

#[test]
fn any_conversation_ends_where_it_is_to() {
    let seeds = share_of_seeds(500, 150);
    let share = (seeds.end - seeds.start).div_ceil(MACHINES) as usize;
    thread::scope(|scope| {
        for first in seeds.clone().step_by(share.max(1)) {
            let share = first..(first + share as u64).min(seeds.end);
            scope.spawn(|| play_all(share));
        }
    });
}

/// An arc so fast that exec runs without a break as long as there are blocks: when it ends it is due again at once.
#[test]
fn exec_that_has_no_pause_does_not_pile_up() {
    let line = |line: &str| Op::Line(0, line.to_string());
    let ops = [
        line("g91 g1 f3000 x0.2 m3 s300"),
        Op::Characters(0, b"\x91\x91!"),
        line("g91 g2 f3000 x0 i1 j0.3 p3"),
    ];
    try_to_play(&mut begun(), &ops).unwrap_or_else(|why| panic!("{why}"));
}

/// The reader is woken together with a task that then works for long before the reader runs. The reader may then reach
/// the place of the kill before the control task has noticed the kill.
#[test]
fn a_kill_in_a_comment_is_one_whatever_is_under_way() {
    const COMMENT: &str = "(of which so much has come when something else is under way for a while";
    let mut machine = firmware(&MEGA2560_GRBL);
    machine.run_for_ms(100).unwrap();
    for n in 0..200 {
        let later = machine.cycle() + n * 997 % 16_000;
        machine.run_until(later).unwrap();
        let comment = &COMMENT[..1 + n as usize % (COMMENT.len() - 1)];
        let job =
            format!("{{posx:n,posy:n}}\ng91 g2 f3000 x0 i1 p2\ng91 g0 x0.1 y0.2\n{comment}\x04)\n");
        machine.send(job.as_bytes());
        // The machine comes to rest within 120 ms.
        machine.run_for_ms(150).unwrap();
        machine.receive();
        machine.send(b"{stat:n}\n");
        machine.run_for_ms(10).unwrap();
        let heard = String::from_utf8(machine.receive()).unwrap();
        assert!(heard.contains("{\"stat\":4}"), "{n}: {heard}");
    }
}
