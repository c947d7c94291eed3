//! Contact: the motor positions at the moment at which a switch that ends a move changes.
//!
//! ```text
//! sampling interrupt   mark     records the generator's state: there may be a contact
//!                      note     confirms the contact; from now on exec comes to rest, as in a feedhold
//! exec                 catch_up, pushed   replay what the generator does from there, segment by segment
//! planner              take     when exec has dropped its blocks; or clear
//! ```
//!
//! So a probe's result is the position of the contact, not of the standstill, and it is exact to the step. In each
//! stage one of the three owns the record ([`Baton`]), and only the owner passes it on to the next stage. A second
//! contact is ignored until the planner has taken the first. RAM: 27 bytes.

use avr_embassy::ring::Producer;
use avr_embassy::{Baton, Interrupt, Thread};

use super::step_replay::StepReplay;
use super::{Dda, SEGMENTS, Segment};
use crate::boards::MOTORS;

/// No contact. The sampling interrupt owns the record.
const NONE: u8 = 0;
/// There has been a contact; exec has not seen it yet.
const NOTED: u8 = 1;
/// Exec follows the generator. The planner owns the record when exec has dropped its blocks.
const FOLLOWED: u8 = 2;

struct Contact {
    /// The slot of the segment that ran at the contact.
    tail: u8,
    replay: StepReplay,
}

machine_static! {
    fn contact() -> Baton<Contact> = Baton::new(Contact { tail: 0, replay: StepReplay::new() });
}

/// Records the state of the generator, `dda`, in the segment of slot `tail`, in case there is a contact now. Sampling
/// interrupt only, which holds exec off until it calls [`note`] or ends.
#[small]
pub fn mark(dda: &Dda, tail: u8) {
    contact().pass(NONE, NONE, |contact| {
        contact.replay.begin(dda);
        contact.tail = tail;
    });
}

/// Records the state as [`mark`] does, where the generator is ahead of the pins by `ahead` steps of each motor.
pub fn mark_behind(dda: &Dda, tail: u8, ahead: &[i32; MOTORS]) {
    contact().pass(NONE, NONE, |contact| {
        contact.replay.begin(dda);
        contact.replay.add(ahead);
        contact.tail = tail;
    });
}

/// Records that the contact closed where the generator was marked. Sampling interrupt only.
#[small]
pub fn note() {
    if contact().stage() == NONE {
        contact().set_stage(NOTED);
    }
}

/// Whether there has been a contact that the planner has not taken yet. Any level.
#[inline(always)]
#[small]
pub fn is_noted() -> bool {
    contact().stage() != NONE
}

/// Replays the segments that have been pushed since the contact's segment. At most one of them was pushed after the
/// contact. Call it before another is pushed.
#[inline(never)]
#[small]
pub fn catch_up(_: Interrupt, segments: &Producer<Segment, SEGMENTS>) {
    contact().pass(NOTED, FOLLOWED, |contact| {
        segments.behind(contact.tail).for_each(|segment| contact.replay.run(segment));
    });
}

/// Replays a segment that is about to be pushed, before the push: after it the generator may take the segment at
/// once.
#[inline(never)]
#[small]
pub fn pushed(_: Interrupt, segment: &Segment) {
    contact().pass(FOLLOWED, FOLLOWED, |contact| contact.replay.run(segment));
}

/// Returns where the motors were at the contact, given that they have stopped at `at`, and forgets the contact. `None`
/// if exec has not caught up. Call it when exec has dropped its blocks because of the contact.
#[small]
pub fn take(_: Thread, at: &[i32; MOTORS]) -> Option<[i32; MOTORS]> {
    contact().pass(FOLLOWED, NONE, |contact| contact.replay.before(at))
}

/// Forgets the contact. Call it when exec has dropped its blocks or no switch is armed.
#[inline(always)]
pub fn clear(_: Thread) {
    contact().set_stage(NONE);
}
