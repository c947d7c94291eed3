//! The moment at which a switch is reached that ends a move, and where the motors were then.
//!
//! ```text
//! sampling interrupt   mark     the generator as it is: there may be a contact
//!                  note     there is; from now on exec comes to rest, as in a feedhold
//! exec             catch_up, pushed     what the generator does from there, segment by segment
//! planner          take     when exec has dropped its blocks; or clear
//! ```
//!
//! So a probe's result is where the contact was, not where the machine stopped, and exact to the step. Each stage
//! belongs to one of the three ([`Baton`]), and only they lead to the next; a second contact before the planner has had the first is
//! none.
//! RAM: 27 bytes.

use avr_embassy::Baton;

use super::step_replay::StepReplay;
use super::{Dda, SEGMENTS, Segment};
use crate::boards::MOTORS;
use avr_embassy::ring::Producer;

/// There is none. The sampling interrupt has the value.
const NONE: u8 = 0;
/// There has been one; exec has not seen it yet.
const NOTED: u8 = 1;
/// Exec follows the generator. When it has dropped its blocks the planner has the value.
const FOLLOWED: u8 = 2;

struct Contact {
    /// The slot of the segment that ran.
    tail: u8,
    replay: StepReplay,
}

machine_static! {
    fn contact() -> Baton<Contact> = Baton::new(Contact { tail: 0, replay: StepReplay::new() });
}

/// If there is a contact it is now, while the generator is `dda` in the segment of slot `tail`. Sampling interrupt only, which
/// holds exec off until it calls [`note`] or ends.
#[small]
pub fn mark(dda: &Dda, tail: u8) {
    contact().pass(NONE, NONE, |contact| {
        contact.replay.begin(dda);
        contact.tail = tail;
    });
}

/// Marks as [`mark`] does where the generator is ahead of the pins, by `ahead` steps of each motor.
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

/// Whether there has been one. Any level.
#[inline(always)]
#[small]
pub fn is_noted() -> bool {
    contact().stage() != NONE
}

/// Follows the generator through what has been pushed since, at most one segment of which came after the contact.
/// Exec only, before it pushes another.
#[inline(never)]
#[small]
pub fn catch_up(segments: &Producer<Segment, SEGMENTS>) {
    contact().pass(NOTED, FOLLOWED, |contact| {
        segments.behind(contact.tail).for_each(|segment| contact.replay.run(segment));
    });
}

/// Counts a segment that is about to be pushed. Exec only, before the push: after the push the generator may take it at once.
#[inline(never)]
#[small]
pub fn pushed(segment: &Segment) {
    contact().pass(FOLLOWED, FOLLOWED, |contact| contact.replay.run(segment));
}

/// Where the motors were at the contact, that have come to rest `at`, and forgets it. Thread mode, when exec has dropped
/// its blocks because of it: it has caught up before.
#[small]
pub fn take(at: &[i32; MOTORS]) -> Option<[i32; MOTORS]> {
    contact().pass(FOLLOWED, NONE, |contact| contact.replay.before(at))
}

/// Forgets it. Thread mode, when exec has dropped its blocks or no switch is armed.
#[inline(always)]
pub fn clear() {
    contact().set_stage(NONE);
}
