//! The moment at which a switch is reached that ends a move, and where the motors were then.
//!
//! ```text
//! look interrupt   mark     the generator as it is: there may be a contact
//!                  note     there is; from now on exec comes to rest, as in a feedhold
//! exec             catch_up, pushed     what the generator does from there, segment by segment
//! planner          steps    when exec has dropped its blocks; clear, when it has read them
//! ```
//!
//! So a probe's result is where the contact was, not where the machine stopped, and exact to the step. Each stage
//! belongs to one of the three, and only they lead to the next; a second contact before `clear` is none.
//! RAM: 27 bytes.

use core::cell::UnsafeCell;

use super::dda::{Dda, SEGMENTS, Segment};
use super::follow::Follow;
use crate::boards::MOTORS;
use crate::hal::byte::SharedByte;
use crate::hal::ring::Producer;

/// There is none.
const NONE: u8 = 0;
/// There has been one; exec has not seen it yet.
const NOTED: u8 = 1;
/// Exec follows the generator.
const FOLLOWED: u8 = 2;

struct Contact {
    stage: SharedByte,
    /// The slot of the segment that ran.
    tail: SharedByte,
    follow: UnsafeCell<Follow>,
}

// SAFETY: `follow` belongs to the look interrupt in stage NONE, to exec in the other two while it has anything to
// run, and to the planner when exec has dropped its blocks.
unsafe impl Sync for Contact {}

machine_static! {
    fn contact() -> Contact = Contact {
        stage: SharedByte::new(NONE),
        tail: SharedByte::new(0),
        follow: UnsafeCell::new(Follow::new()),
    };
}

/// If there is a contact it is now, while the generator is `dda` in the segment of slot `tail`. Look interrupt only, which
/// holds exec off until it calls [`note`] or ends.
#[small]
pub fn mark(dda: &Dda, tail: u8) {
    if contact().stage.get() == NONE {
        // SAFETY: in this stage it is the look's.
        unsafe { &mut *contact().follow.get() }.begin(dda);
        contact().tail.set(tail);
    }
}

/// It was a contact, where the generator was marked. Look interrupt only.
#[small]
pub fn note() {
    if contact().stage.get() == NONE {
        contact().stage.set(NOTED);
    }
}

/// Whether there has been one. Any level.
#[inline(always)]
#[small]
pub fn is_noted() -> bool {
    contact().stage.get() != NONE
}

/// Follows the generator through what has been pushed since, at most one segment of which came after the contact.
/// Exec only, before it pushes another.
#[inline(never)]
#[small]
pub fn catch_up(segments: &Producer<Segment, SEGMENTS>) {
    if contact().stage.get() == NOTED {
        // SAFETY: exec's, from now on.
        let follow = unsafe { &mut *contact().follow.get() };
        segments.behind(contact().tail.get()).for_each(|segment| follow.run(segment));
        contact().stage.set(FOLLOWED);
    }
}

/// Another segment is pushed. Exec only, before it does: behind that the generator may take it at once.
#[inline(never)]
#[small]
pub fn pushed(segment: &Segment) {
    if contact().stage.get() == FOLLOWED {
        // SAFETY: exec's in this stage.
        unsafe { &mut *contact().follow.get() }.run(segment);
    }
}

/// Where the motors were at the contact, that have come to rest `at`. Thread mode, when exec has dropped its
/// blocks.
#[small]
pub fn steps(at: &[i32; MOTORS]) -> Option<[i32; MOTORS]> {
    // SAFETY: exec has nothing to push.
    is_noted().then(|| unsafe { &*contact().follow.get() }.before(at))
}

/// Forgets it. Thread mode, when exec has dropped its blocks or no switch is armed.
#[small]
pub fn clear() {
    contact().stage.set(NONE);
}
