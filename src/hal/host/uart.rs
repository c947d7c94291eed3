//! The serial line on the host: bytes arrive and leave one after the other at the baud rate.

use core::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::vec::Vec;

use super::{NEVER, flags, now};
use crate::boards::ACTIVE;
use crate::hal::event::Event;
use crate::hal::ring::{Ceiling, Consumer, Producer, Ring};
use crate::hal::serial::{BATCH, CUT, GO, MARKS, Outgoing, RING, Received, lose, mark};
use crate::realtime;

#[derive(Default)]
struct Line {
    rx_in: Option<Producer<u8, RING>>,
    tx_out: Option<Consumer<u8, RING>>,
    /// Bytes the sender has yet to put on the line.
    arriving: VecDeque<u8>,
    /// What the firmware has sent.
    sent: Vec<u8>,
    /// The byte that is leaving.
    leaving: Option<u8>,
    /// A byte to send before all others, and whether these are held back.
    ahead: Option<u8>,
    held: bool,
    lost_ends: u16,
    /// Bytes queued, modulo 256.
    queued: u8,
    realtime: u8,
}

struct Uart {
    line: RefCell<Line>,
    /// A byte's time at this end of the line and at the sender's.
    byte_cycles: Cell<u64>,
    sender_cycles: Cell<u64>,
    next_rx: Cell<u64>,
    next_tx: Cell<u64>,
}

machine_static! {
    fn rx() -> Ring<u8, RING> = Ring::new();
    fn tx() -> Ring<u8, RING> = Ring::new();
    fn uart() -> Uart = Uart {
        line: RefCell::new(Line::default()),
        byte_cycles: Cell::new(1),
        sender_cycles: Cell::new(1),
        next_rx: Cell::new(NEVER),
        next_tx: Cell::new(NEVER),
    };
}

/// Starts the line at `rate` bits a second, the sender's end too; `None` after the first time.
pub fn start(rate: u32) -> Option<(Received, Outgoing)> {
    let (rx_in, rx_out) = rx().split()?;
    let (tx_in, tx_out) = tx().split()?;
    let mut line = uart().line.borrow_mut();
    line.rx_in = Some(rx_in);
    line.tx_out = Some(tx_out);
    set_rate(rate);
    set_sender_rate(rate);
    Some((rx_out, tx_in))
}

/// Goes on at `rate` bits a second.
pub fn set_rate(rate: u32) {
    uart().byte_cycles.set(byte_cycles(rate));
}

/// The sender goes on at `rate` bits a second.
pub(super) fn set_sender_rate(rate: u32) {
    uart().sender_cycles.set(byte_cycles(rate));
}

fn byte_cycles(rate: u32) -> u64 {
    u64::from(ACTIVE.clock_hz) * 10 / u64::from(rate)
}

/// Whether the two ends differ too much to understand each other: by more than 4.5 %.
fn garbles() -> bool {
    let (own, sender) = (uart().byte_cycles.get(), uart().sender_cycles.get());
    own.abs_diff(sender) * 1_000 > sender * 45
}

/// Sends what the ring holds.
pub fn kick() {
    if uart().next_tx.get() == NEVER {
        load_tx(&mut uart().line.borrow_mut());
    }
}

/// Sends a byte, not 0, before what the ring holds, even while the line is held.
pub fn send_ahead(byte: u8) {
    uart().line.borrow_mut().ahead = Some(byte);
    kick();
}

/// Holds what the ring holds back, or lets it go.
pub fn hold(held: bool) {
    uart().line.borrow_mut().held = held;
    kick();
}

/// Line ends lost since start-up, modulo 2^16.
pub fn lost_ends() -> u16 {
    uart().line.borrow().lost_ends
}

/// Bytes that may come before any is lost, at most 254: one less than the receive ring has room for.
pub fn room() -> u8 {
    (RING - 2).saturating_sub(rx().used()) as u8
}

/// The real-time characters since the last call, as bits (see [`realtime`]).
pub fn take_realtime() -> u8 {
    core::mem::take(&mut uart().line.borrow_mut().realtime)
}

/// The sender puts bytes on the line.
pub(super) fn send(bytes: &[u8]) {
    uart().line.borrow_mut().arriving.extend(bytes);
    if uart().next_rx.get() == NEVER {
        uart().next_rx.set(now() + uart().sender_cycles.get());
    }
}

/// Takes what the firmware has sent.
pub(super) fn received() -> Vec<u8> {
    core::mem::take(&mut uart().line.borrow_mut().sent)
}

/// When the next byte is through, in either direction.
pub(super) fn next_event() -> u64 {
    uart().next_rx.get().min(uart().next_tx.get())
}

/// The bytes that are through by now.
pub(super) fn advance() {
    let u = uart();
    let mut line = u.line.borrow_mut();
    if u.next_rx.get() <= now() {
        if let Some(byte) = line.arriving.pop_front() {
            arrive(&mut line, byte);
        }
        let more = !line.arriving.is_empty();
        u.next_rx.set(if more { now() + u.sender_cycles.get() } else { NEVER });
    }
    if u.next_tx.get() <= now() {
        if let Some(byte) = line.leaving.take() {
            line.sent.push(if garbles() { !byte } else { byte });
        }
        flags::set(Event::Transmitted);
        load_tx(&mut line);
    }
}

fn load_tx(line: &mut Line) {
    line.leaving = match line.ahead.take() {
        None if line.held => None,
        None => line.tx_out.as_mut().and_then(Consumer::pop),
        ahead => ahead,
    };
    let busy = line.leaving.is_some();
    uart().next_tx.set(if busy { now() + uart().byte_cycles.get() } else { NEVER });
}

fn arrive(line: &mut Line, byte: u8) {
    let special = realtime::bit(byte);
    if special != 0 {
        line.realtime = realtime::with(line.realtime, special);
        flags::set(Event::Realtime);
        if special & realtime::PLACED != 0 {
            place(line, if special == realtime::RESUME { GO } else { CUT });
        }
        return;
    }
    let Some(ring) = line.rx_in.as_mut() else { return };
    let full = ring.free() == 0;
    if (byte < MARKS || garbles()) && !full {
        line.lost_ends = line.lost_ends.wrapping_add(queue_mark(ring, 0, byte));
    } else if full {
        let newest = mark(ring.pushed(0).copied().unwrap_or(0));
        line.lost_ends = line.lost_ends.wrapping_add(queue_mark(ring, newest, byte));
    } else {
        let _ = ring.push(byte);
    }
    line.queued = line.queued.wrapping_add(1);
    if full || byte < b' ' || line.queued.is_multiple_of(BATCH) {
        flags::set(Event::Received);
    }
}

/// Queues the mark of a real-time character: that of a loss if there is no room.
fn place(line: &mut Line, character: u8) {
    let Some(ring) = line.rx_in.as_mut() else { return };
    if ring.push(character).is_err() {
        let newest = mark(ring.pushed(0).copied().unwrap_or(0));
        line.lost_ends = line.lost_ends.wrapping_add(queue_mark(ring, newest, character));
    }
    line.queued = line.queued.wrapping_add(1);
    flags::set(Event::Received);
}

/// Puts a mark where there is room, else over the newest byte. Returns the line ends that it counts.
fn queue_mark(ring: &mut Producer<u8, RING>, begun: u8, byte: u8) -> u16 {
    let (mark, is_end) = lose(begun, byte);
    if ring.push(mark).is_err() {
        // The reader is not running: everything here is one thread.
        ring.amend(&Ceiling(()), 0, |newest| *newest = mark);
    }
    is_end.into()
}
