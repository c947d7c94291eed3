//! The serial ports on the host. Bytes arrive and leave one after the other, at the baud rate.

use core::cell::RefCell;
use std::boxed::Box;
use std::collections::VecDeque;
use std::vec::Vec;

use super::{NEVER, flags, now};
use crate::baud;
use crate::boards::ACTIVE;
use crate::hal::event::Event;
use crate::hal::ring::{Consumer, Producer, Ring};
use crate::hal::serial::{
    self, AUX, AUX_RING, AllEnds, CLOSE, CUT, Ends, Flow, GO, LATE, LINE_END, MARKS, PORTS,
    RX_RING, STRAY, TX_RING, USB, XOFF, XON, batch, hardware, high_water, last_mark, lose, mark,
    wait_ms,
};
use crate::hal::{Boot, Interrupt, Level, Thread};
use crate::realtime::{self, Asked};

/// The filling end of a receive ring, whatever its size.
trait Fill {
    fn is_full(&self) -> bool;
    fn is_high(&self) -> bool;
    fn push(&mut self, byte: u8);
    fn newest(&self) -> u8;
    /// Puts a mark where there is room, else replaces the newest byte by it.
    fn mark(&mut self, mark: u8);
    fn batch(&self) -> u8;
}

impl<const N: usize> Fill for Producer<u8, N> {
    fn is_full(&self) -> bool {
        self.free() == 0
    }

    fn is_high(&self) -> bool {
        self.used() > high_water(Flow::Pins, N)
    }

    fn push(&mut self, byte: u8) {
        let _ = Producer::push(self, byte);
    }

    fn newest(&self) -> u8 {
        self.pushed(0).copied().unwrap_or(0)
    }

    fn mark(&mut self, mark: u8) {
        // SAFETY: the reader has a view of the ring.
        if !unsafe { self.replace_newest(mark) } {
            Fill::push(self, mark);
        }
    }

    fn batch(&self) -> u8 {
        batch(N)
    }
}

/// A port and its sender.
struct Line {
    rx_in: Option<Box<dyn Fill>>,
    tx_out: Option<Consumer<u8, TX_RING>>,
    /// Bytes that the sender has yet to put on the line, and whether they arrive undamaged.
    arriving: VecDeque<(u8, bool)>,
    /// What the firmware has sent.
    sent: Vec<u8>,
    /// The byte that is leaving.
    leaving: Option<u8>,
    /// A byte to send before all others. `held` says whether XOFF holds those others back.
    ahead: Option<u8>,
    /// For how many ms `ahead` waits for the end of a line. `open` says whether a line is open.
    wait_ms: u8,
    open: bool,
    held: bool,
    /// Whether XOFF has stopped the sender.
    stopped: bool,
    /// Whether XOFF and XON from the other side count.
    heeds_xoff: bool,
    /// Whether printable real-time characters are plain text.
    plain: bool,
    /// Whether the pin CTS counts. `cts` says whether it holds bytes back.
    heeds_cts: bool,
    cts: bool,
    /// Whether RTS stops the sender.
    rts: bool,
    /// A program has opened the port.
    opened: bool,
    lost_ends: u16,
    /// Bytes queued, modulo 256.
    queued: u8,
    realtime: u8,
    asked: Asked,
    /// The byte queued last.
    last: u8,
    /// Cycles of a byte at the firmware's rate; `sender_cycles` are those at the sender's rate.
    byte_cycles: u64,
    rate: u32,
    sender_cycles: u64,
    next_rx: u64,
    next_tx: u64,
}

impl Line {
    fn new() -> Self {
        Self {
            rx_in: None,
            tx_out: None,
            arriving: VecDeque::new(),
            sent: Vec::new(),
            leaving: None,
            ahead: None,
            wait_ms: 0,
            open: false,
            held: false,
            stopped: false,
            heeds_xoff: false,
            plain: false,
            heeds_cts: false,
            cts: false,
            rts: false,
            opened: false,
            lost_ends: 0,
            queued: 0,
            realtime: 0,
            asked: Asked::NOTHING,
            last: 0,
            byte_cycles: 1,
            rate: 1,
            sender_cycles: 1,
            next_rx: NEVER,
            next_tx: NEVER,
        }
    }
}

machine_static! {
    fn usb_rx() -> Ring<u8, RX_RING> = Ring::new();
    fn usb_tx() -> Ring<u8, TX_RING> = Ring::new();
    fn aux_rx() -> Ring<u8, AUX_RING> = Ring::new();
    fn aux_tx() -> Ring<u8, TX_RING> = Ring::new();
    fn lines() -> [RefCell<Line>; PORTS] = core::array::from_fn(|_| RefCell::new(Line::new()));
}

fn with<R>(port: u8, act: impl FnOnce(&mut Line) -> R) -> R {
    act(&mut lines()[usize::from(port)].borrow_mut())
}

/// Starts the lines and the senders' ends of the lines: USB at `rate` bits a second, the second port at the board's
/// rate. `None` after the first time.
pub fn start(_: Thread, _: &Boot, rate: u32) -> Option<AllEnds> {
    let usb = split(USB, usb_rx(), usb_tx(), rate)?;
    let aux = match hardware(AUX) {
        Some(board) => Some(split(AUX, aux_rx(), aux_tx(), board.rate)?),
        None => None,
    };
    Some(AllEnds { usb, aux })
}

fn split<const N: usize>(
    port: u8,
    rx: &'static Ring<u8, N>,
    tx: &'static Ring<u8, TX_RING>,
    rate: u32,
) -> Option<Ends> {
    let (rx_in, rx_out) = rx.split()?;
    let (tx_in, tx_out) = tx.split()?;
    with(port, |line| {
        line.rx_in = Some(Box::new(rx_in));
        line.tx_out = Some(tx_out);
    });
    with(port, |line| line.set_rate(rate));
    set_sender_rate(port, rate);
    Some((rx_out.into_view(), tx_in))
}

/// Changes the firmware's rate to `rate` bits a second.
pub fn set_rate(_: Thread, port: u8, rate: u32) {
    with(port, |line| line.set_rate(rate));
}

/// Changes the sender's rate to `rate` bits a second.
pub(super) fn set_sender_rate(port: u8, rate: u32) {
    with(port, |line| line.sender_cycles = byte_cycles(rate));
}

fn byte_cycles(rate: u32) -> u64 {
    u64::from(ACTIVE.clock_hz) * 10 / u64::from(rate)
}

/// Starts sending what the ring holds.
pub fn kick(_: Level, port: u8) {
    with(port, Line::kick);
}

/// Stops the sender or lets it go on, by the flow control that the two sides have agreed on. If `waits`, XOFF or XON
/// may wait for the end of a line.
pub fn stop_sender(_: Thread, port: u8, flow: Flow, stop: bool, waits: bool) {
    with(port, |line| match flow {
        Flow::None => {}
        Flow::Characters => {
            line.ahead = Some(if stop { XOFF } else { XON });
            line.stopped = stop;
            line.wait_ms = if waits { wait_ms(port, baud::divisor(line.rate) as u8) } else { 0 };
            line.kick();
        }
        Flow::Pins => {
            line.rts = stop;
            line.let_arrive();
        }
    });
}

/// Whether XOFF has stopped the sender, sent by thread mode or by [`stop_late`].
pub fn is_stopped(_: Thread, port: u8) -> bool {
    with(port, |line| line.stopped)
}

/// Stops the sender of the second port by XOFF if its receive ring fills while thread mode has no turn.
pub fn stop_late(_: Interrupt) {
    if aux_rx().used() < LATE {
        return;
    }
    with(AUX, |line| {
        let waits = line.wait_ms > 0 && line.ahead == Some(XOFF);
        if line.heeds_xoff && (!line.stopped || waits) {
            (line.stopped, line.ahead, line.wait_ms) = (true, Some(XOFF), 0);
            line.kick();
        }
    });
}

/// Sets whether `!`, `~`, `%` and bytes above 0x7F are plain text from now on.
pub fn set_plain(_: Thread, port: u8, plain: bool) {
    with(port, |line| line.plain = plain);
}

/// Sets how the other side may stop this port's transmitter from now on.
pub fn set_flow(_: Thread, port: u8, flow: Flow) {
    with(port, |line| {
        line.heeds_xoff = flow == Flow::Characters;
        line.held &= line.heeds_xoff;
        line.heeds_cts = flow == Flow::Pins;
        line.rts &= line.heeds_cts;
        line.let_arrive();
        line.kick();
    });
}

/// Sends XOFF or XON that has waited long enough, and what CTS has held back. Each millisecond.
pub fn look(thread: Thread) {
    for port in 0..PORTS as u8 {
        with(port, |line| line.wait_ms = line.wait_ms.saturating_sub(1));
        kick(thread.level(), port);
    }
}

/// Does nothing: bytes that find no room in the ring are lost.
pub fn go_on(_: Thread) {}

/// Always true, so that tests can open the port: [`Machine::open_usb`](super::Machine::open_usb).
pub fn sees_opening() -> bool {
    true
}

/// Whether a program has opened the first port since the last call.
pub fn take_opened(_: Thread) -> bool {
    with(USB, |line| core::mem::take(&mut line.opened))
}

/// Always 0: this USB never hangs.
pub fn restarts(_: Thread) -> u8 {
    0
}

/// Always 0: see [`restarts`].
pub fn bus_errors(_: Thread) -> u16 {
    0
}

/// Makes a program open the first port.
pub(super) fn open_usb() {
    with(USB, |line| line.opened = true);
    flags::set(Event::Realtime);
}

/// Makes the program close the first port.
pub(super) fn close_usb() {
    with(USB, |line| {
        let ended = matches!(line.last, 0 | b'\n' | b'\r');
        if let (false, Some(ring)) = (ended, line.rx_in.as_mut()) {
            ring.push(CLOSE);
            line.last = b'\n';
        }
    });
    flags::set(Event::Received);
}

/// Returns how many line ends have been lost since start-up, modulo 2^16.
pub fn lost_ends(_: Thread, port: u8) -> u16 {
    with(port, |line| line.lost_ends)
}

/// Returns how many bytes may come before one is lost, at most 254: one less than the receive ring has room for.
pub fn room(_: Thread, port: u8) -> u8 {
    let used = if port == AUX { aux_rx().used() } else { usb_rx().used() };
    serial::capacity(port).saturating_sub(used as u8)
}

/// Whether half of the second port's receive ring is full. The other half lasts 3 ms, so a task with much to do then
/// gives way to the reader.
pub fn presses(_: Thread) -> bool {
    aux_rx().used() >= AUX_RING / 2
}

/// Whether the reader has to have its turn before the next waiting line is carried out: see [`serial::calls_reader`].
/// On the second port any waiting byte is a reason.
pub fn calls_reader(_: Thread) -> bool {
    // SAFETY: the reader does not run meanwhile.
    let ring = unsafe { usb_rx().window() };
    aux_rx().used() > 0 || serial::calls_reader(&ring)
}

/// Returns the slot of the receive ring that holds the newest byte; `None` if that byte has been read.
pub fn newest(_: Thread, port: u8) -> Option<u8> {
    match port {
        AUX => aux_rx().newest(),
        _ => usb_rx().newest(),
    }
}

/// Returns the slot of the mark that stands for the last `%` or `^d`; `None` if no such mark waits.
pub fn last_cut(_: Thread, port: u8) -> Option<u8> {
    // SAFETY: the reader does not run meanwhile.
    let ring = unsafe { if port == AUX { aux_rx().window() } else { usb_rx().window() } };
    last_mark(&ring)
}

/// Whether a `!` has come, on any port, that has not been taken yet.
pub fn asks_hold() -> bool {
    (0..PORTS as u8).any(|port| with(port, |line| line.realtime & realtime::HOLD != 0))
}

/// Takes the real-time characters since the last call, as bits (see [`realtime`]).
pub fn take_realtime(_: Thread, port: u8) -> u8 {
    with(port, |line| core::mem::take(&mut line.realtime))
}

/// Takes the override requests that characters have made since the last call.
pub fn take_asked(_: Thread, port: u8) -> Asked {
    with(port, |line| core::mem::take(&mut line.asked))
}

/// Makes the sender put bytes on the line.
pub(super) fn send(port: u8, bytes: &[u8]) {
    with(port, |line| {
        line.arriving.extend(bytes.iter().map(|byte| (*byte, true)));
        line.let_arrive();
    });
}

/// Makes the sender put a byte on the line that arrives damaged.
pub(super) fn send_damaged(port: u8) {
    with(port, |line| {
        line.arriving.push_back((b'x', false));
        line.let_arrive();
    });
}

/// Makes the sender stop the machine by its RTS, which is our CTS, or allow it to continue.
pub(super) fn set_cts(port: u8, stop: bool) {
    with(port, |line| line.cts = stop);
}

/// Whether the machine stops the sender by RTS.
pub(super) fn rts(port: u8) -> bool {
    with(port, |line| line.rts)
}

/// Takes what the firmware has sent.
pub(super) fn received(port: u8) -> Vec<u8> {
    with(port, |line| core::mem::take(&mut line.sent))
}

/// Returns when the next byte has passed the line, in either direction.
pub(super) fn next_event() -> u64 {
    let due = |line: &RefCell<Line>| line.borrow().next_rx.min(line.borrow().next_tx);
    lines().iter().map(due).min().unwrap_or(NEVER)
}

/// Handles the bytes that have passed the line by now.
pub(super) fn advance() {
    for line in lines() {
        line.borrow_mut().advance();
    }
}

impl Line {
    /// Changes the firmware's rate to `rate` bits a second.
    fn set_rate(&mut self, rate: u32) {
        (self.byte_cycles, self.rate) = (byte_cycles(rate), rate);
    }

    /// Whether the rates of the two ends differ too much to understand each other: by more than 4.5 %.
    fn garbles(&self) -> bool {
        self.byte_cycles.abs_diff(self.sender_cycles) * 1_000 > self.sender_cycles * 45
    }

    fn kick(&mut self) {
        if self.next_tx == NEVER {
            self.load_tx();
        }
    }

    fn let_arrive(&mut self) {
        if self.next_rx == NEVER && !self.rts && !self.arriving.is_empty() {
            self.next_rx = now() + self.sender_cycles;
        }
    }

    fn advance(&mut self) {
        if self.next_rx <= now() {
            if let Some((byte, whole)) = self.arriving.pop_front() {
                self.arrive(byte, whole);
            }
            self.next_rx = NEVER;
            self.let_arrive();
        }
        if self.next_tx <= now() {
            if let Some(byte) = self.leaving.take() {
                let heard = if self.garbles() { !byte } else { byte };
                self.sent.push(heard);
            }
            flags::set(Event::Transmitted);
            self.load_tx();
        }
    }

    fn load_tx(&mut self) {
        let held = self.held || (self.heeds_cts && self.cts);
        let may_pass = self.wait_ms == 0 || !self.open;
        self.leaving = match self.ahead.take_if(|_| may_pass) {
            None if held => None,
            None => self.tx_out.as_mut().and_then(Consumer::pop).inspect(|byte| {
                self.open = *byte >= LINE_END;
            }),
            ahead => ahead,
        };
        self.next_tx = if self.leaving.is_some() { now() + self.byte_cycles } else { NEVER };
    }

    /// Queues the mark of a real-time character. If there is no room, the mark becomes that of a loss; a resume goes
    /// without a place.
    fn place(&mut self, character: u8) {
        let Some(ring) = self.rx_in.as_mut() else { return };
        match ring.is_full() {
            false => ring.push(character),
            true if character == GO => self.realtime |= realtime::UNPLACED,
            true => self.lost_ends = self.lost_ends.wrapping_add(lost(ring.as_mut(), character)),
        }
        self.queued = self.queued.wrapping_add(1);
        flags::set(Event::Received);
    }

    fn arrive(&mut self, byte: u8, whole: bool) {
        if self.heeds_xoff && (byte == XOFF || byte == XON) {
            self.held = byte == XOFF;
            if byte == XON {
                self.realtime |= realtime::LET_GO;
                flags::set(Event::Realtime);
            }
            return;
        }
        let special = realtime::bit(byte);
        if special != 0 && !(self.plain && byte >= b' ') {
            self.realtime = realtime::with(self.realtime, special);
            flags::set(Event::Realtime);
            if special & realtime::PLACED != 0 {
                self.place(if special == realtime::RESUME { GO } else { CUT });
            }
            return;
        }
        let garbles = self.garbles() || !whole;
        if !self.plain
            && self.last <= realtime::ASCII
            && !garbles
            && let Some(asked) = self.asked.with(byte)
        {
            self.asked = asked;
            flags::set(Event::Realtime);
            return;
        }
        let Some(ring) = self.rx_in.as_mut() else { return };
        let full = ring.is_full();
        let byte = if byte < MARKS || byte == CLOSE { STRAY } else { byte };
        if full || garbles {
            self.lost_ends = self.lost_ends.wrapping_add(lost(ring.as_mut(), byte));
        } else {
            ring.push(byte);
        }
        self.last = ring.newest();
        self.queued = self.queued.wrapping_add(1);
        let batch = self.queued.is_multiple_of(ring.batch());
        // The reader may come too late to stop the sender, so RTS is set here.
        self.rts |= batch && self.heeds_cts && ring.is_high();
        if full || byte < b' ' || batch {
            flags::set(Event::Received);
        }
    }
}

/// Marks the loss of a byte. Returns the number of line ends that this loss adds, 0 or 1.
fn lost(ring: &mut dyn Fill, byte: u8) -> u16 {
    let begun = if ring.is_full() { mark(ring.newest()) } else { 0 };
    let (mark, is_end) = lose(begun, byte);
    ring.mark(mark);
    is_end.into()
}
