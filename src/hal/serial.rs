//! The rings of a serial line, and the marks in them.
//!
//! A byte that comes when the receive ring is full is lost, and so is a byte that comes damaged. A mark stands in the
//! place of the loss: it replaces the newest byte of a full ring, or the damaged byte. Three bits of the mark tell the
//! reader what was lost. Lost line ends are also counted (`imp::uart::lost_ends`), so that each lost line gets an
//! answer.

use super::ring::{ConsumerView, Producer, Window};
use crate::boards::{ACTIVE, Serial, Usart};

/// The number of ports. [`USB`] is the number of the port that every board has, [`AUX`] that of the second one.
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

/// Returns how many bytes may come before one is lost, when none wait in the receive ring of a port.
pub const fn capacity(port: u8) -> u8 {
    let size = if PORTS > 1 && port == AUX { AUX_RING } else { RX_RING };
    (size - 2) as u8
}

/// Bytes below this are marks. No line of text contains one: a byte with such a value that comes from outside is
/// replaced by [`STRAY`].
pub const MARKS: u8 = 8;
/// A byte that no line may contain and that is no mark.
pub const STRAY: u8 = 8;
/// A bit of a mark: the mark replaced the end of a whole line.
pub const BEHIND_END: u8 = 1;
/// A bit of a mark: the byte lost last was the end of a line.
pub const CLEAN: u8 = 2;
/// A bit of a mark: the byte lost last was a carriage return, which a line feed may follow.
pub const RETURNED: u8 = 4;

/// Not a loss marker (a loss marker has this bit only together with [`CLEAN`]): records where `%` or `^d` stood in
/// the stream.
pub const CUT: u8 = RETURNED;
/// Not a loss marker either: records where `~` stood in the stream.
pub const GO: u8 = RETURNED | BEHIND_END;

/// Where a program has closed the first port in the midst of a line, which is forgotten. This byte never comes into the
/// ring from outside: it is replaced by [`STRAY`] on chips that notice the closing.
pub const CLOSE: u8 = 0x1B;

/// Replaces a line that has been taken out of its turn. This byte never comes into the ring from outside, because
/// outside it is `^x`, the reset.
pub const TAKEN: u8 = 0x18;
/// Follows [`TAKEN`] in place of the carriage return of that line, after which a line feed may come.
pub const TAKEN_RETURN: u8 = b'!';

/// Bytes after which the reader is woken, besides at the end of each line. A power of two.
pub const fn batch(ring: usize) -> u8 {
    (ring / 8) as u8
}

/// Stops the other side of a line; [`XON`] releases it. If flow control is by characters (`ex` 1), the receive
/// interrupt takes both out of the stream and obeys them, so that they never wait behind data.
pub const XOFF: u8 = 0x13;
/// See [`XOFF`].
pub const XON: u8 = 0x11;
/// Added to XOFF or XON for each millisecond that the character may wait for the end of the line that is being sent.
pub const WAIT_MS: u8 = 0x20;
/// A byte below this ends a line. XOFF and XON that wait may follow it.
pub const LINE_END: u8 = b' ';

/// Returns for how many ms at most XOFF and XON wait for the end of a line, on a port with this divisor
/// (`baud::divisor`). The other side sends up to 50 bytes meanwhile, or 12 where the receive ring is short.
pub const fn wait_ms(port: u8, divisor: u8) -> u8 {
    let (ms, most) = (divisor / 3, if port == USB { 4 } else { 1 });
    if ms > most { most } else { ms }
}

/// Returns how many bytes the receive ring may hold before the sender is stopped. Most senders send 100 more bytes
/// before they obey XOFF, and XOFF itself waits for the end of a line.
pub const fn high_water(flow: Flow, ring: usize) -> usize {
    match flow {
        Flow::Characters if ring < RX_RING => ring / 8,
        Flow::Characters => ring / 4,
        _ => ring / 2,
    }
}
/// When the receive ring of the second port holds this many bytes, thread mode is late, and exec stops the sender.
pub const LATE: usize = AUX_RING / 4;

/// The sender is released when the receive ring holds fewer bytes than this.
pub const fn low_water(ring: usize) -> usize {
    if ring < RX_RING { ring / 16 } else { ring / 8 }
}

/// With more bytes than this in the receive ring of the first port the reader gets its turn, because it may have to
/// stop the sender.
const MANY: u8 = high_water(Flow::Characters, RX_RING) as u8;

/// Whether the reader has to have its turn before the next waiting line is carried out: the bytes in the receive ring
/// of the first port begin or end like a control line, or there are many. Cost: 60 cycles.
pub fn calls_reader(ring: &Window<'_>) -> bool {
    let len = ring.len();
    let newest = ring.get(len.wrapping_sub(1));
    let last = if newest < b' ' { ring.get(len.wrapping_sub(2)) } else { newest };
    len > MANY || matches!(ring.get(0), b'{' | b'$' | b'?') || matches!(last, b'}' | b'?')
}

/// How the two sides of a line stop each other.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Flow {
    /// No flow control.
    None,
    /// By XOFF and XON.
    Characters,
    /// By RTS and CTS.
    Pins,
}

impl Flow {
    /// Returns the flow control of a port for the setting `ex`.
    pub const fn of(port: u8, ex: u8) -> Flow {
        let has_pins = matches!(hardware(port), Some(Serial { handshake: Some(_), .. }));
        match ex {
            // Other devices on a bus would obey XOFF, too.
            1 if !is_shared(port) => Flow::Characters,
            2 if has_pins => Flow::Pins,
            _ => Flow::None,
        }
    }
}

/// Returns the board's description of a port; `None` if the board does not have that port.
pub const fn hardware(port: u8) -> Option<Serial> {
    let port = port as usize;
    if port < ACTIVE.serial.len() { Some(ACTIVE.serial[port]) } else { None }
}

/// The reading end of a receive ring: a view, because the rings differ in size.
pub type Received = ConsumerView<u8>;
/// The filling end of a transmit ring. Call `imp::uart::kick` after filling it.
pub type Outgoing = Producer<u8, TX_RING>;

/// The ends of a port's rings that tasks own.
pub type Ends = (Received, Outgoing);

/// The ends of all ports.
pub struct AllEnds {
    /// The ends of USB.
    pub usb: Ends,
    /// The ends of the second port, if the board has one.
    pub aux: Option<Ends>,
}

/// Whether other devices share the line of a port, so that the port must not speak unasked.
pub const fn is_shared(port: u8) -> bool {
    matches!(hardware(port), Some(Serial { driver_enable: Some(_), .. }))
}

/// Whether the first port is the chip's own USB. The computer then keeps bytes that the receive ring has no room for.
pub const NATIVE: bool = matches!(ACTIVE.serial[USB as usize].usart, Usart::Usb);

/// Returns the mark that replaces `newest`, the newest byte of a full ring. A mark stays as it is. The receive
/// interrupt of the AVR does what `mark` and [`lose`] do in assembly.
pub fn mark(newest: u8) -> u8 {
    match newest {
        b'\r' => BEHIND_END | CLEAN | RETURNED,
        b'\n' => BEHIND_END | CLEAN,
        ..MARKS => newest,
        _ => 0,
    }
}

/// Returns the mark after `byte` was lost as well, and whether that was one more line end.
pub fn lose(mark: u8, byte: u8) -> (u8, bool) {
    let begun = mark & BEHIND_END;
    match byte {
        b'\r' => (begun | CLEAN | RETURNED, true),
        b'\n' => (begun | CLEAN, mark & RETURNED == 0),
        _ => (begun, false),
    }
}

/// Returns the slot of the last [`CUT`] that waits in a receive ring, `None` if there is none. A `CUT` that found the
/// ring full has become a loss marker, the newest byte.
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
