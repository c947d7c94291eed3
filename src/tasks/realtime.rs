//! Bytes that act at once where they stand: `?`, and those above 0x7F. They act on a port whose dialect has more such
//! bytes than the receive interrupt knows.
//!
//! Called by the reader before it takes a turn's bytes, at the latest 4 ms after they have come
//! ([`set_eager`](crate::hal::event::set_eager)). Looks through the whole receive ring, also when the line pool is
//! full. A byte that acts leaves the ring, and so does any other byte above 0x7F, so that questions take no room from
//! lines that wait. Thread mode. Cost: 15 cycles for each byte that waits.
//!
//! On a port whose dialect is undecided ([`Port::is_undecided`]) a `?` at the beginning of a line decides it, and
//! acts. In a line that begins with a brace, and behind it, nothing acts until the line has decided.

use kerf_macros::small;

use super::hold;
use super::lines::acts;
use super::links::Links;
use super::overrides;
use super::ports::{Port, REPORT};
use super::spindle;
use crate::boards::outputs;
use crate::hal::event::Event;
use crate::hal::flags;
use crate::hal::ring::Window;
use crate::hal::serial::{CUT, GO, MARKS};
use crate::protocol::Speech;
use crate::realtime::Asked;

/// Safety door: holds motion until a tilde.
const DOOR: u8 = 0x84;
/// Stops the spindle in a hold, or lets it turn again.
const SPINDLE_STOP: u8 = 0x9E;
/// Switches flood; [`MIST`] switches mist.
const FLOOD: u8 = 0xA0;
const MIST: u8 = 0xA1;
const ASKS: u8 = b'?';

/// Removes bytes that act from a ring, and carries them out. Returns how many bytes are to be released. No blanks are
/// left in their place, because the sender does not count these bytes.
#[inline(never)]
#[small]
pub fn pick(links: &Links, port: &Port, ring: &mut Window<'_>) -> u8 {
    let mut undecided = port.is_undecided();
    if undecided && port.lines.borrow().is_in_braces() {
        return 0;
    }
    let mut within = port.lines.borrow().is_within_line();
    let waiting = ring.len();
    // If there is a cut, the slots of the bytes must not change.
    let mut closes = port.cut.get().is_none();
    let mut n = 0;
    while n < ring.len() {
        let byte = ring.get(n);
        // The slot of a mark counts until the control task has acted on its character.
        closes &= byte >= MARKS || byte == GO || (byte == CUT && !flags::has(Event::Realtime));
        if undecided && !within {
            if byte == b'{' {
                // A line that may select a dialect in which these bytes are text.
                break;
            }
            if byte == ASKS {
                decide(links, port);
                undecided = false;
            }
        }
        // What is taken out of a line does not begin one.
        within = match byte {
            ..b' ' => false,
            b' ' | 0x80.. => within,
            _ => true,
        };
        if acts(byte) && port.speech.get().is_in_order() && ring.replace(n, byte, b' ') {
            act(links, port, byte);
            if closes {
                let before = ring.len();
                ring.take_out(n, 1);
                if ring.len() < before {
                    continue;
                }
            }
        }
        n += 1;
    }
    waiting - ring.len()
}

/// Decides the dialect of a port: a sender that sends a `?` alone uses a dialect that has it.
fn decide(links: &Links, port: &Port) {
    let settings = links.settings.borrow();
    if let Some(speech) = Speech::of_question(&settings) {
        links.decide(port, speech, &settings);
    }
}

#[inline(never)]
#[small]
fn act(links: &Links, port: &Port, byte: u8) {
    match byte {
        ASKS => {
            port.ask(REPORT);
            links.parser_wake.signal();
        }
        DOOR => hold::knock(links),
        SPINDLE_STOP => spindle::pause(links),
        FLOOD => spindle::flip(links, outputs::FLOOD),
        MIST => spindle::flip(links, outputs::MIST),
        _ => {
            if let Some(asked) = Asked::NOTHING.with(byte) {
                overrides::apply(links, port, asked);
                overrides::tell(links);
            }
        }
    }
}
