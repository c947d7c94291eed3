//! What both sides of the serial line agree on: the rings, and the marks of lost bytes.
//!
//! Bytes that come when the receive ring is full are lost, and so is one that comes damaged. A mark
//! stands in their place: it replaces the newest byte of a full ring (or the damaged one), and says in
//! three bits what the reader must know. Line ends that were lost are counted besides (`imp::uart::lost_ends`),
//! so that each lost line is answered.

use super::ring::{ConsumerView, Producer, Window};
use crate::boards::{ACTIVE, Serial, Usart};

/// How many ports there are, and the numbers of the one that every board has and of the other.
pub const PORTS: usize = ACTIVE.serial.len();
/// See [`PORTS`].
pub const USB: u8 = 0;
/// See [`PORTS`].
pub const AUX: u8 = 1;

/// Size of the receive ring of USB, a power of two.
pub const RX_RING: usize = 256;
/// Size of the receive ring of the second port, a power of two.
pub const AUX_RING: usize = 64;
/// Size of each transmit ring, a power of two.
pub const TX_RING: usize = 128;

/// Bytes below this are marks. None of them is in a line of text: in place of one that comes from outside there is a [`STRAY`].
pub const MARKS: u8 = 8;
/// A byte that no line may hold, and no mark.
pub const STRAY: u8 = 8;
/// A bit of a mark: the mark replaced the end of a whole line.
pub const BEHIND_END: u8 = 1;
/// A bit of a mark: the byte lost last was the end of a line.
pub const CLEAN: u8 = 2;
/// A bit of a mark: the byte lost last was a carriage return, which a line feed may follow.
pub const RETURNED: u8 = 4;

/// No mark of a loss (none has this bit without [`CLEAN`]): here a `%` or `^d` stood in the stream.
pub const CUT: u8 = RETURNED;
/// No mark of a loss either: here a `~` stood in the stream.
pub const GO: u8 = RETURNED | BEHIND_END;

/// Stands where a line was that has been taken out of its turn. No such byte comes into the ring from outside: it resets.
pub const TAKEN: u8 = 0x18;
/// Stands behind [`TAKEN`] for the carriage return of that line, which a line feed may follow.
pub const TAKEN_RETURN: u8 = b'!';

/// The reader is woken at the end of a line, and when this many bytes have come since: a power of two.
pub const fn batch(ring: usize) -> u8 {
    (ring / 8) as u8
}

/// What stops the other side of a line, and lets it go on. Where they mean that (`ex` 1) the receive interrupt takes them
/// out of the stream and obeys: they never wait behind data.
pub const XOFF: u8 = 0x13;
/// See [`XOFF`].
pub const XON: u8 = 0x11;
/// Added to one of the two for each millisecond that it may wait for the end of the line that is being sent.
pub const WAIT_MS: u8 = 0x20;
/// A byte below this ends a line: XOFF and XON may follow it.
pub const LINE_END: u8 = b' ';

/// How many ms XOFF and XON wait for the end of a line on a port with this divisor (`baud::divisor`), at most. The sender
/// says up to 50 bytes meanwhile, or 12 where the ring is short.
pub const fn wait_ms(port: u8, divisor: u8) -> u8 {
    let (ms, most) = (divisor / 3, if port == USB { 4 } else { 1 });
    if ms > most { most } else { ms }
}

/// The sender is stopped when the receive ring holds more. Most say 100 bytes more before they heed XOFF, and that waits
/// for the end of a line.
pub const fn high_water(flow: Flow, ring: usize) -> usize {
    match flow {
        Flow::Characters if ring < RX_RING => ring / 8,
        Flow::Characters => ring / 4,
        _ => ring / 2,
    }
}
/// Thread mode is late when the ring of the second port holds this many bytes: exec stops the sender.
pub const LATE: usize = AUX_RING / 4;

/// The sender may go on when the ring holds less than this many bytes.
pub const fn low_water(ring: usize) -> usize {
    if ring < RX_RING { ring / 16 } else { ring / 8 }
}

/// With so many bytes in the receive ring of the first port the reader has its turn: it may have to stop the sender.
const MANY: u8 = high_water(Flow::Characters, RX_RING) as u8;

/// Whether the reader is to have its turn before a line that waits is carried out: what is in the receive ring of the first port
/// begins or ends like a control line, or is much. Cost: 60 cycles.
pub fn calls_reader(ring: &Window<'_>) -> bool {
    let len = ring.len();
    let newest = ring.get(len.wrapping_sub(1));
    let last = if newest < b' ' { ring.get(len.wrapping_sub(2)) } else { newest };
    len > MANY || matches!(ring.get(0), b'{' | b'$' | b'?') || matches!(last, b'}' | b'?')
}

/// How the two sides of a line stop each other.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Flow {
    /// Not at all.
    None,
    /// By XOFF and XON.
    Characters,
    /// By RTS and CTS.
    Pins,
}

impl Flow {
    /// The flow control of a port by the setting `ex`.
    pub const fn of(port: u8, ex: u8) -> Flow {
        let has_pins = matches!(hardware(port), Some(Serial { handshake: Some(_), .. }));
        match ex {
            // A bus belongs to others too, who would heed it.
            1 if !is_shared(port) => Flow::Characters,
            2 if has_pins => Flow::Pins,
            _ => Flow::None,
        }
    }
}

/// What the board says of a port.
pub const fn hardware(port: u8) -> Option<Serial> {
    let port = port as usize;
    if port < ACTIVE.serial.len() { Some(ACTIVE.serial[port]) } else { None }
}

/// Bytes received: a view, for rings differ in size.
pub type Received = ConsumerView<u8>;
/// Bytes to send. Call `imp::uart::kick` after filling it.
pub type Outgoing = Producer<u8, TX_RING>;

/// The ends of a port's rings that tasks have.
pub type Ends = (Received, Outgoing);

/// The ends of all ports.
pub struct AllEnds {
    /// The ends of USB.
    pub usb: Ends,
    /// The ends of the second port, if the board has one.
    pub aux: Option<Ends>,
}

/// Whether others share the line of a port, so that it must not speak unasked.
pub const fn is_shared(port: u8) -> bool {
    matches!(hardware(port), Some(Serial { driver_enable: Some(_), .. }))
}

/// The first port is USB of the chip's own: what it has no room for waits in the computer.
pub const NATIVE: bool = matches!(ACTIVE.serial[USB as usize].usart, Usart::Usb);

/// The mark that replaces `newest`, if it is none yet. The receive interrupt of the AVR has the twins of
/// these two in assembly.
pub fn mark(newest: u8) -> u8 {
    match newest {
        b'\r' => BEHIND_END | CLEAN | RETURNED,
        b'\n' => BEHIND_END | CLEAN,
        ..MARKS => newest,
        _ => 0,
    }
}

/// The mark after `byte` was lost too, and whether that was one more line end.
pub fn lose(mark: u8, byte: u8) -> (u8, bool) {
    let begun = mark & BEHIND_END;
    match byte {
        b'\r' => (begun | CLEAN | RETURNED, true),
        b'\n' => (begun | CLEAN, mark & RETURNED == 0),
        _ => (begun, false),
    }
}

/// The slot of the last [`CUT`] that waits in a receive ring. One that found the ring full has become the mark of a loss, the
/// newest byte.
#[inline(never)]
#[small]
pub fn last_mark(ring: &Window<'_>) -> Option<u8> {
    let mut at = ring.len();
    while at > 0 {
        at -= 1;
        let byte = ring.get(at);
        if byte == CUT || (at + 1 == ring.len() && byte < MARKS && byte != GO) {
            return Some(ring.slot(at));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mark and the count of ends after all of `lost` came to a full ring that ended in `newest`.
    fn after(newest: u8, lost: &[u8]) -> (u8, usize) {
        lost.iter().fold((mark(newest), 0), |(mark, ends), byte| {
            let (mark, is_end) = lose(super::mark(mark), *byte);
            (mark, ends + usize::from(is_end))
        })
    }

    #[test]
    fn a_mark_tells_where_it_stands_and_how_the_loss_ended() {
        assert_eq!(after(b'x', b"y"), (0, 0));
        assert_eq!(after(b'x', b"y\n"), (CLEAN, 1));
        assert_eq!(after(b'\n', b"y\nz"), (BEHIND_END, 1));
        assert_eq!(after(b'\n', b"a\nb\n"), (BEHIND_END | CLEAN, 2));
    }

    #[test]
    fn a_line_feed_behind_a_return_is_no_end_of_its_own() {
        assert_eq!(after(b'\r', b"\n"), (BEHIND_END | CLEAN, 0));
        assert_eq!(after(b'x', b"\r\ny\r"), (CLEAN | RETURNED, 2));
        assert_eq!(after(b'x', b"\r\r"), (CLEAN | RETURNED, 2));
    }
}
