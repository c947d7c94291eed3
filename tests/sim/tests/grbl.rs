//! Random conversations in grbl's dialect with the image on the simulated chip: shorter ones of the kind in
//! `tests/grbl_random.rs`. `tests/support/grbl_session.rs` judges them.
//!
//! One machine plays them all in sequence: `KERF_SEED=47 KERF_CASES=1 cargo test -p kerf-sim-tests grbl::` plays a
//! single one.

use kerf::boards::MEGA2560_GRBL;
use proptest::strategy::ValueTree;

use crate::common::firmware;
use crate::grbl_session::Session;
use crate::{grbl_ops, seeds};

/// See [`Session`]. The longest of 2,800 took 38 ms, at 64,000 steps a second in a ramp; 14 took more than 20.
const REPORT_MS: u64 = 40;

#[test]
fn any_conversation_keeps_to_the_dialect() {
    let mut session = Session::new(firmware(&MEGA2560_GRBL), REPORT_MS);
    let mut played = session.begin();
    for seed in seeds::seeds(60) {
        let (tree, _) = seeds::case(seed, &grbl_ops::conversation(20, 300));
        played = played.and_then(|()| session.play(&tree.current()));
        if let Err(why) = &played {
            panic!("seed {seed}: {why}\n{}", session.story());
        }
    }
    session.check_prompt();
}
