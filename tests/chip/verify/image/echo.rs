//! Echoes bytes at another rate.
//!
//! `rate BITS COUNT` is answered at the old rate; the new one begins when the last bit of that is sent. BITS is a rate
//! that Kerf allows. Each byte is echoed at once, until COUNT bytes have come or the line is silent: for 2 s before the
//! first byte, for 300 ms then. When all is echoed the rate is 115,200 again, and after 50 ms comes
//! `echo RECEIVED FRAMING OVERRUNS`: the number of bytes that came, of those without a stop bit, and how often bytes
//! were lost.
//!
//! A byte is handled in less than 160 cycles, so nothing is lost at 1,000,000 baud in both directions. The host's clock
//! may be faster than this one, at 230,400 baud by 3.7 %. Then bytes wait in a ring: enough for 6,000 bytes in a row. A
//! byte that finds the ring full is not echoed, and is counted as an overrun.

use kerf::baud;

use super::text::answer;
use super::timers::Wait;
use super::{serial, timers};

/// Longest silence before the first byte and after it, and the wait before the result, ms.
const FIRST_MS: u32 = 2_000;
const SILENCE_MS: u32 = 300;
const SETTLE_MS: u32 = 50;

/// Carries out the command. `None` if the rate is none.
#[inline(never)]
pub fn run(bits: u32, count: u32) -> Option<()> {
    let rate = baud::rate(bits as i32)?;
    answer(b"rate", &[baud::divisor(rate).into()]);
    serial::flush();
    serial::set_rate(rate);
    timers::halt();
    let result = echo(count);
    serial::set_rate(baud::DEFAULT);
    let wait = Wait::begin();
    while !wait.is_over(SETTLE_MS) {}
    while serial::take().is_some() {}
    answer(b"echo", &result);
    Some(())
}

/// Bytes that wait to be echoed. Indices wrap at its size.
struct Ring {
    bytes: [u8; 256],
    head: u8,
    tail: u8,
}

impl Ring {
    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.head == self.tail
    }

    /// Returns whether there was room.
    #[inline(always)]
    fn push(&mut self, byte: u8) -> bool {
        let next = self.head.wrapping_add(1);
        let has_room = next != self.tail;
        if has_room {
            self.bytes[usize::from(self.head)] = byte;
            self.head = next;
        }
        has_room
    }

    #[inline(always)]
    fn pop(&mut self) -> u8 {
        let byte = self.bytes[usize::from(self.tail)];
        self.tail = self.tail.wrapping_add(1);
        byte
    }

    /// Sends a byte if one waits and may be sent.
    #[inline(always)]
    fn pass_on(&mut self) {
        if !self.is_empty() && serial::is_ready() {
            serial::put(self.pop());
        }
    }
}

/// Echoes up to `count` bytes, and waits for the last bit. Returns the numbers of the answer.
#[inline(never)]
fn echo(count: u32) -> [u32; 3] {
    let mut ring = Ring { bytes: [0; 256], head: 0, tail: 0 };
    let [mut left, mut framing, mut overruns] = [count, 0, 0];
    let wait = Wait::begin();
    while left > 0 {
        if let Some((byte, errors)) = serial::take() {
            wait.again();
            left -= 1;
            framing += u32::from(errors & serial::FRAMING != 0);
            overruns += u32::from(errors & serial::OVERRUN != 0);
            overruns += u32::from(!ring.push(byte));
        } else if wait.is_over(if left == count { FIRST_MS } else { SILENCE_MS }) {
            break;
        }
        ring.pass_on();
    }
    while !ring.is_empty() {
        ring.pass_on();
    }
    // The flag is still set from the answer if nothing was echoed.
    serial::flush();
    [count - left, framing, overruns]
}
