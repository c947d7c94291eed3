//! The serial ports: they move bytes between their lines and two rings each.
//!
//! The first port is [USB](super::usb). The other one is a UART without its FIFOs, so that a byte acts when it comes,
//! not when others have come after it: the handler itself removes real-time characters. A byte has to be taken before
//! the next one has come, within 87 us at 115,200 baud.
//!
//! USB brings up to 64 bytes at once. Real-time characters among them act when they come, even if there is no room
//! for the bytes before them. Those bytes wait ([`Line::behind`]), and the computer waits with the next packet.
//!
//! `embassy-rp`'s buffered driver has rings of its own, from which a task takes the bytes: a `!` would wait for the
//! turn of a task, up to 10 ms of a busy CPU. So Kerf has its own handlers. Thread mode and exec share the state of a
//! port with them with interrupts off.
//!
//! Where bytes are lost, because a ring was full or the hardware overran, a mark tells the reader: see
//! [`serial`](crate::hal::serial).

use core::cell::UnsafeCell;

use embassy_rp::interrupt;
use embassy_rp::interrupt::{InterruptExt, Priority};
use embassy_rp::pac;
use embassy_rp::pac::uart::Uart as Registers;
use heapless::Deque;

use super::gpio::{self, Unit};
use super::usb::{self, PACKET};
use super::{drivers, eeprom, flags, mask, time};
use crate::baud;
use crate::boards::{ACTIVE, Usart};
use crate::hal::event::Event;
use crate::hal::ring::{Consumer, Producer, Ring};
use crate::hal::serial::{
    self, AUX, AUX_RING, AllEnds, CLOSE, CUT, Ends, Flow, GO, LATE, LINE_END, MARKS, PORTS,
    RX_RING, STRAY, TX_RING, USB, XOFF, XON, batch, hardware, last_mark, lose, mark, wait_ms,
};
use crate::hal::{Boot, Interrupt, Level, Thread};
use crate::realtime::{self, Asked};

/// The filling end of a receive ring.
enum Filling {
    Usb(Producer<u8, RX_RING>),
    Aux(Producer<u8, AUX_RING>),
}

/// Runs the same code for either kind of end.
macro_rules! either {
    ($end:expr, $ring:ident => $act:expr) => {
        match $end {
            Filling::Usb($ring) => $act,
            Filling::Aux($ring) => $act,
        }
    };
}

impl Filling {
    fn is_full(&self) -> bool {
        self.free() == 0
    }

    fn free(&self) -> usize {
        either!(self, ring => ring.free())
    }

    fn push(&mut self, byte: u8) {
        let _ = either!(self, ring => ring.push(byte));
    }

    /// Queues bytes, as many as there is room for.
    fn push_run(&mut self, mut bytes: &[u8]) {
        loop {
            let count = either!(self, ring => ring.fill(|vacant| {
                let count = vacant.len().min(bytes.len());
                match (vacant.get_mut(..count), bytes.get(..count)) {
                    (Some(vacant), Some(now)) => vacant.write_copy_of_slice(now),
                    _ => &mut [],
                }
            }));
            bytes = bytes.get(usize::from(count)..).unwrap_or_default();
            // Once more if the vacant slots lie at both ends of the ring.
            if count == 0 || bytes.is_empty() {
                return;
            }
        }
    }

    fn newest(&self) -> u8 {
        either!(self, ring => ring.pushed(0).copied().unwrap_or(0))
    }

    fn batch(&self) -> u8 {
        match self {
            Filling::Usb(_) => batch(RX_RING),
            Filling::Aux(_) => batch(AUX_RING),
        }
    }

    /// Marks the loss of bytes. Returns how many lines have ended in them.
    fn lose(&mut self, bytes: &[u8]) -> u16 {
        let mut ends = 0;
        if bytes.is_empty() {
            return ends;
        }
        let mut newest = if self.is_full() { mark(self.newest()) } else { 0 };
        for byte in bytes {
            let (mark, is_end) = lose(newest, *byte);
            newest = mark;
            ends += u16::from(is_end);
        }
        self.mark(newest);
        ends
    }

    /// Puts a mark where there is room, else replaces the newest byte by it.
    fn mark(&mut self, mark: u8) {
        // SAFETY: the reader has a view of the ring.
        if !either!(self, ring => unsafe { ring.replace_newest(mark) }) {
            self.push(mark);
        }
    }
}

/// Bytes that may wait for room in the ring: a packet; one more, which the chip has taken when the program closes the
/// port; and [`CLOSE`].
const WAITING: usize = 2 * PACKET + 1;

/// The bytes that wait for room in the ring. The next packet is read only when none waits, or when the port closes, so
/// they never lie across the end of the array.
struct Behind {
    bytes: [u8; WAITING],
    /// The first byte that waits, and the end of the last.
    from: usize,
    to: usize,
}

impl Behind {
    const fn new() -> Self {
        Self { bytes: [0; WAITING], from: 0, to: 0 }
    }

    fn waiting(&self) -> &[u8] {
        self.bytes.get(self.from..self.to).unwrap_or_default()
    }

    fn is_empty(&self) -> bool {
        self.from == self.to
    }

    /// Adds bytes. All bytes of one packet have room.
    fn add(&mut self, bytes: &[u8]) {
        if self.is_empty() {
            (self.from, self.to) = (0, 0);
        }
        let to = self.to + bytes.len();
        if let Some(vacant) = self.bytes.get_mut(self.to..to) {
            vacant.copy_from_slice(bytes);
            self.to = to;
        }
    }

    /// Drops the first bytes.
    fn drop_first(&mut self, count: usize) {
        self.from = (self.from + count).min(self.to);
    }

    /// Whether a whole packet has room.
    fn has_room(&self) -> bool {
        self.waiting().len() <= PACKET
    }

    /// Drops the newest bytes of a half line, at most [`AT_ONCE`]. Returns whether there may be more.
    fn drop_newest(&mut self) -> bool {
        for _ in 0..AT_ONCE {
            match self.waiting().last() {
                None | Some(b'\n' | b'\r' | &CLOSE) => return false,
                Some(_) => self.to -= 1,
            }
        }
        true
    }
}

/// Bytes of a packet that are queued at once with interrupts off, in 3 us. A limit switch waits for them.
const AT_ONCE: usize = 8;
/// Like [`AT_ONCE`], for bytes that are looked at one by one: 150 cycles each.
const ONE_BY_ONE: usize = 2;
/// Like [`AT_ONCE`], for bytes to send: 30 cycles each.
const SENT_AT_ONCE: usize = 8;
/// How many sums of override requests are kept: more than a packet of 64 bytes can fill.
const ASKED: usize = 8;
/// Percent beyond which one more character might not fit.
const FAR: u8 = 110;

/// The state that the handler of a port shares with the other levels.
struct Line {
    rx: Option<Filling>,
    tx: Option<Consumer<u8, TX_RING>>,
    /// A byte to send before all others.
    ahead: Option<u8>,
    /// For how many ms `ahead` waits for the end of a line. `open` says whether a line is open.
    wait_ms: u8,
    open: bool,
    /// The other side has sent XOFF.
    held: bool,
    /// Whether XOFF and XON from the other side are obeyed.
    heeds_xoff: bool,
    /// Whether XOFF has stopped the sender.
    stopped: bool,
    lost_ends: u16,
    /// Bytes queued, modulo 256.
    queued: u8,
    realtime: u8,
    /// Override requests that have not been taken. A new sum is begun each time that a number might not fit, because
    /// a packet may bring many at once.
    asked: Deque<Asked, ASKED>,
    /// The byte queued last.
    last: u8,
    rate: u32,
    /// The millisecond in which the last byte came.
    heard_at: u32,
    /// Whether `!`, `~`, `%` and bytes above 0x7F are text.
    plain: bool,
    /// Of USB: bytes that the receive ring had no room for.
    behind: Behind,
}

impl Line {
    const fn new() -> Self {
        Self {
            rx: None,
            tx: None,
            ahead: None,
            wait_ms: 0,
            open: false,
            held: false,
            heeds_xoff: false,
            stopped: false,
            lost_ends: 0,
            queued: 0,
            realtime: 0,
            asked: Deque::new(),
            last: 0,
            rate: baud::DEFAULT,
            heard_at: 0,
            plain: false,
            behind: Behind::new(),
        }
    }
}

struct Shared(UnsafeCell<Line>);

// SAFETY: it is touched with interrupts off only: see `with`.
unsafe impl Sync for Shared {}

static LINES: [Shared; PORTS] = [const { Shared(UnsafeCell::new(Line::new())) }; PORTS];

static USB_RX: Ring<u8, RX_RING> = Ring::new();
static USB_TX: Ring<u8, TX_RING> = Ring::new();
static AUX_RX: Ring<u8, AUX_RING> = Ring::new();
static AUX_TX: Ring<u8, TX_RING> = Ring::new();

/// Runs `act` on the state of a port, with interrupts off. Any level.
fn with<R>(port: u8, act: impl FnOnce(&mut Line) -> R) -> R {
    let line = &LINES[usize::from(port) % PORTS];
    // SAFETY: interrupts are off.
    mask(|| act(unsafe { &mut *line.0.get() }))
}

/// Returns the registers of a port; `None` for USB, which has none of this kind.
fn registers(port: u8) -> Option<Registers> {
    match hardware(port)?.usart {
        Usart::Uart0 => Some(pac::UART0),
        Usart::Uart1 => Some(pac::UART1),
        _ => None,
    }
}

/// Starts the lines, 8N1: the first at `rate` bits a second, the second at the board's rate. `None` after the first
/// time.
pub fn start(thread: Thread, boot: &Boot, rate: u32) -> Option<AllEnds> {
    let usb = split(USB, &USB_RX, &USB_TX, Filling::Usb)?;
    begin(thread, boot, USB, rate);
    let aux = match hardware(AUX) {
        Some(board) => {
            let ends = split(AUX, &AUX_RX, &AUX_TX, Filling::Aux)?;
            begin(thread, boot, AUX, board.rate);
            Some(ends)
        }
        None => None,
    };
    Some(AllEnds { usb, aux })
}

fn split<const N: usize>(
    port: u8,
    rx: &'static Ring<u8, N>,
    tx: &'static Ring<u8, TX_RING>,
    filling: impl FnOnce(Producer<u8, N>) -> Filling,
) -> Option<Ends> {
    let (rx_in, rx_out) = rx.split()?;
    let (tx_in, tx_out) = tx.split()?;
    with(port, |line| (line.rx, line.tx) = (Some(filling(rx_in)), Some(tx_out)));
    Some((rx_out.into_view(), tx_in))
}

fn begin(thread: Thread, boot: &Boot, port: u8, rate: u32) {
    let Some(uart) = registers(port) else { return usb::start(boot) };
    if let Some([rx, tx]) = hardware(port).and_then(|serial| serial.line()) {
        gpio::connect_pulled(rx, Unit::Uart);
        gpio::connect(tx, Unit::Uart);
    }
    set_rate(thread, port, rate);
    uart.uartcr().write(|w| {
        w.set_uarten(true);
        w.set_txe(true);
        w.set_rxe(true);
    });
    uart.uartimsc().write(|w| {
        w.set_rxim(true);
        w.set_txim(true);
        w.set_oeim(true);
    });
    let interrupt = if uart == pac::UART0 { interrupt::UART0_IRQ } else { interrupt::UART1_IRQ };
    interrupt.set_priority(Priority::P1);
    // SAFETY: everything that the handlers touch has been set up.
    unsafe { interrupt.enable() };
}

/// Changes the rate to `rate` bits a second. A byte that is on the line at that moment, in either direction, is spoilt.
pub fn set_rate(_: Thread, port: u8, rate: u32) {
    // The divisor in 64ths, rounded.
    let divisor = (ACTIVE.clock_hz * 8 / rate.max(1)).div_ceil(2);
    let Some(uart) = registers(port) else { return };
    with(port, |line| {
        line.rate = rate;
        uart.uartibrd().write(|w| w.set_baud_divint((divisor >> 6) as u16));
        uart.uartfbrd().write(|w| w.set_baud_divfrac(divisor as u8 & 63));
        // The divisor takes effect with this write. Eight bits, no FIFO.
        uart.uartlcr_h().write(|w| w.set_wlen(0b11));
    });
}

#[interrupt]
fn UART0_IRQ() {
    handle(Usart::Uart0);
}

#[interrupt]
fn UART1_IRQ() {
    handle(Usart::Uart1);
}

/// Does the work of both handlers: takes the bytes that have come, and sends the next ones.
fn handle(usart: Usart) {
    let is_here = |port: &u8| hardware(*port).is_some_and(|serial| serial.usart == usart);
    let Some(port) = (0..PORTS as u8).find(is_here) else { return };
    let Some(uart) = registers(port) else { return };
    uart.uarticr().write(|w| {
        w.set_txic(true);
        w.set_oeic(true);
    });
    while !uart.uartfr().read().rxfe() {
        let data = uart.uartdr().read();
        let whole = !(data.fe() || data.pe() || data.be());
        with(port, |line| {
            line.arrive(data.data(), whole);
            if data.oe() {
                line.lose(0);
            }
        });
    }
    if with(port, |line| line.send(uart)) {
        flags::set(Event::Transmitted);
    }
}

/// Whether a byte is text wherever it comes: it never acts, and is no mark.
fn is_text(byte: u8) -> bool {
    matches!(byte, b'\n' | b' '..=b'}') && realtime::bit(byte) == 0
}

/// Returns a byte of text as it is queued: one that would be a mark is replaced.
fn text(byte: u8) -> u8 {
    if byte < MARKS || byte == CLOSE { STRAY } else { byte }
}

/// What a received byte is.
enum Came {
    /// It has acted, and is not part of a line.
    Nothing,
    /// It has acted; this mark stands in its place.
    Mark(u8),
    /// It is part of a line.
    Text,
}

impl Line {
    /// Sends as long as the transmitter takes bytes. Returns whether it took any.
    fn send(&mut self, uart: Registers) -> bool {
        let mut sent = false;
        while !uart.uartfr().read().txff() {
            let Some(byte) = self.next() else { break };
            uart.uartdr().write(|w| w.set_data(byte));
            sent = true;
        }
        sent
    }

    /// Takes the byte to send next; `None` if nothing may be sent.
    fn next(&mut self) -> Option<u8> {
        let may_pass = self.wait_ms == 0 || !self.open;
        if let Some(ahead) = self.ahead.take_if(|_| may_pass) {
            return Some(ahead);
        }
        if self.held {
            return None;
        }
        let byte = self.tx.as_mut()?.pop()?;
        self.open = byte >= LINE_END;
        Some(byte)
    }

    /// Marks the loss of a byte.
    fn lose(&mut self, byte: u8) {
        let Some(ring) = self.rx.as_mut() else { return };
        self.lost_ends = self.lost_ends.wrapping_add(ring.lose(&[byte]));
        flags::set(Event::Received);
    }

    /// Queues the bytes that wait, or marks the loss of those that have no room.
    fn queue_waiting(&mut self) {
        let Some(ring) = self.rx.as_mut() else { return };
        let waiting = self.behind.waiting();
        let (now, lost) = waiting.split_at(ring.free().min(waiting.len()));
        ring.push_run(now);
        self.lost_ends = self.lost_ends.wrapping_add(ring.lose(lost));
        self.queued = self.queued.wrapping_add(waiting.len() as u8);
        self.last = ring.newest();
        self.behind.drop_first(WAITING);
        flags::set(Event::Received);
    }

    /// Queues the mark of a real-time character. If there is no room, the mark becomes that of a loss; a resume is then
    /// not marked.
    fn place(&mut self, character: u8) {
        let Some(ring) = self.rx.as_mut() else { return };
        match ring.is_full() {
            false => ring.push(character),
            true if character == GO => self.realtime |= realtime::UNPLACED,
            true => self.lose(character),
        }
        self.queued = self.queued.wrapping_add(1);
        flags::set(Event::Received);
    }

    fn arrive(&mut self, byte: u8, whole: bool) {
        match self.act(byte, whole) {
            Came::Nothing => {}
            Came::Mark(mark) => self.place(mark),
            Came::Text => self.queue(byte, whole),
        }
    }

    /// Handles a byte that has come. A byte that acts does so here.
    fn act(&mut self, byte: u8, whole: bool) -> Came {
        self.heard_at = time::millis();
        if self.heeds_xoff && (byte == XOFF || byte == XON) {
            self.held = byte == XOFF;
            if byte == XON {
                self.realtime |= realtime::LET_GO;
                flags::set(Event::Realtime);
            }
            return Came::Nothing;
        }
        let special = realtime::bit(byte);
        if special != 0 && !(self.plain && byte >= b' ') {
            self.realtime = realtime::with(self.realtime, special);
            flags::set(Event::Realtime);
            return match special {
                realtime::RESUME => Came::Mark(GO),
                _ if special & realtime::PLACED != 0 => Came::Mark(CUT),
                _ => Came::Nothing,
            };
        }
        if self.last <= realtime::ASCII && whole && !self.plain && self.ask(byte) {
            flags::set(Event::Realtime);
            return Came::Nothing;
        }
        Came::Text
    }

    /// Adds the override request of a character. Returns whether it is one.
    fn ask(&mut self, byte: u8) -> bool {
        let last = self.asked.back().copied().unwrap_or(Asked::NOTHING);
        let is_far = last.percent.iter().any(|percent| percent.unsigned_abs() > FAR);
        let begins = self.asked.is_empty() || is_far && !self.asked.is_full();
        let before = if begins { Asked::NOTHING } else { last };
        let Some(asked) = before.with(byte) else { return false };
        if begins {
            // There is room: `begins` is true only if so.
            let _ = self.asked.push_back(asked);
        } else if let Some(last) = self.asked.back_mut() {
            *last = asked;
        }
        true
    }

    /// Handles a byte that has come by USB. If there is no room, text waits. A mark is queued after all waiting bytes
    /// have been queued or lost; a resume is then not marked.
    fn bring(&mut self, byte: u8) {
        let waits = !self.behind.is_empty() || self.rx.as_ref().is_none_or(Filling::is_full);
        match self.act(byte, true) {
            Came::Nothing => {}
            Came::Mark(GO) if waits => self.realtime |= realtime::UNPLACED,
            Came::Mark(mark) => {
                self.queue_waiting();
                self.place(mark);
            }
            Came::Text if waits => {
                self.last = byte;
                // There is room for a packet: the next one is read only after the last one has been queued.
                self.behind.add(&[text(byte)]);
            }
            Came::Text => self.queue(byte, true),
        }
    }

    /// Queues text that has come by USB, in which no byte acts.
    fn bring_text(&mut self, text: &[u8]) {
        let (Some(last), Some(ring)) = (text.last(), self.rx.as_mut()) else { return };
        (self.heard_at, self.last) = (time::millis(), *last);
        let room = if self.behind.is_empty() { ring.free().min(text.len()) } else { 0 };
        let (now, later) = text.split_at(room);
        ring.push_run(now);
        self.queued = self.queued.wrapping_add(room as u8);
        // There is room for a packet: the next one is read only after the last one has been queued.
        self.behind.add(later);
        flags::set(Event::Received);
    }

    /// Queues some of the bytes that wait, as far as there is room. Returns whether others wait; `None` if none was
    /// queued.
    fn go_on(&mut self) -> Option<bool> {
        let ring = self.rx.as_mut()?;
        let waiting = self.behind.waiting();
        let count = ring.free().min(AT_ONCE).min(waiting.len());
        if count == 0 {
            return None;
        }
        ring.push_run(waiting.get(..count).unwrap_or_default());
        self.behind.drop_first(count);
        self.queued = self.queued.wrapping_add(count as u8);
        flags::set(Event::Received);
        Some(!self.behind.is_empty())
    }

    /// Ends the half line of a program that has closed USB: [`CLOSE`] follows what has been queued of it, and what waits
    /// of it is dropped by [`Behind::drop_newest`] before.
    fn close(&mut self) {
        let ended = |byte: &u8| matches!(byte, 0 | b'\n' | b'\r');
        let is_half = !ended(&core::mem::replace(&mut self.last, b'\n'));
        let Some(ring) = self.rx.as_mut() else { return };
        match self.behind.is_empty() {
            true if is_half && ring.is_full() => self.behind.add(&[CLOSE]),
            true if is_half => ring.push(CLOSE),
            // Whole lines wait.
            _ => {}
        }
        flags::set(Event::Received);
    }

    /// Takes the next bytes to send that are contiguous in the ring. Returns how many; 0 also if a byte is to be sent
    /// ahead of them.
    fn take_run(&mut self, to: &mut [u8]) -> usize {
        if self.held || self.ahead.is_some() {
            return 0;
        }
        let Some(ring) = self.tx.as_mut() else { return 0 };
        let run = ring.waiting();
        let count = run.len().min(to.len());
        to.iter_mut().zip(run).for_each(|(to, byte)| *to = *byte);
        ring.release_many(count as u8);
        if let Some(last) = count.checked_sub(1).and_then(|last| to.get(last)) {
            self.open = *last >= LINE_END;
        }
        count
    }

    fn queue(&mut self, byte: u8, whole: bool) {
        let byte = text(byte);
        let full = self.rx.as_ref().is_none_or(Filling::is_full);
        if full || !whole {
            self.lose(byte);
        } else if let Some(ring) = self.rx.as_mut() {
            ring.push(byte);
        }
        let Some(ring) = self.rx.as_ref() else { return };
        self.last = ring.newest();
        self.queued = self.queued.wrapping_add(1);
        if full || byte < b' ' || self.queued.is_multiple_of(ring.batch()) {
            flags::set(Event::Received);
        }
    }
}

/// Starts sending what the ring holds. Exec calls it only on a port that is no bus.
pub fn kick(_: Level, port: u8) {
    let Some(uart) = registers(port) else { return usb::kick() };
    if with(port, |line| line.send(uart)) {
        flags::set(Event::Transmitted);
    }
}

/// Stops the sender or lets it go on, by the flow control that the two sides have agreed on. If `waits`, XOFF or XON
/// may wait for the end of a line.
pub fn stop_sender(thread: Thread, port: u8, flow: Flow, stop: bool, waits: bool) {
    // USB needs no flow control here: it holds the computer back by itself.
    if flow == Flow::Characters && registers(port).is_some() {
        with(port, |line| {
            line.ahead = Some(if stop { XOFF } else { XON });
            line.stopped = stop;
            line.wait_ms =
                if waits { wait_ms(port, (2_000_000 / line.rate.max(1)) as u8) } else { 0 };
        });
        kick(thread.level(), port);
    }
}

/// Whether XOFF has stopped the sender, sent by thread mode or by [`stop_late`].
pub fn is_stopped(_: Thread, port: u8) -> bool {
    with(port, |line| line.stopped)
}

/// Stops the sender of the second port by XOFF if its receive ring fills while thread mode has no turn.
pub fn stop_late(exec: Interrupt) {
    if PORTS < 2 || AUX_RX.used() < LATE {
        return;
    }
    let stops = with(AUX, |line| {
        let waits = line.wait_ms > 0 && line.ahead == Some(XOFF);
        let stops = line.heeds_xoff && (!line.stopped || waits);
        if stops {
            (line.stopped, line.ahead, line.wait_ms) = (true, Some(XOFF), 0);
        }
        stops
    });
    if stops {
        kick(exec.level(), AUX);
    }
}

/// Sets whether `!`, `~`, `%` and bytes above 0x7F are plain text from now on.
pub fn set_plain(_: Thread, port: u8, plain: bool) {
    with(port, |line| line.plain = plain);
}

/// Handles a packet that has come by USB. Returns whether another one may come; if not, [`usb::ROOM`] says when.
pub(super) fn bring(packet: &[u8]) -> bool {
    let mut left = packet;
    while !left.is_empty() {
        let text = left.iter().take(AT_ONCE).take_while(|byte| is_text(**byte)).count();
        let others = left.iter().take(ONE_BY_ONE).take_while(|byte| !is_text(**byte)).count();
        let (now, later) = left.split_at(text.max(others));
        with(USB, |line| match text {
            0 => now.iter().for_each(|byte| line.bring(*byte)),
            _ => line.bring_text(now),
        });
        left = later;
    }
    with(USB, |line| line.behind.is_empty())
}

/// Whether a packet has room that came before the program closed USB.
pub(super) fn takes_last() -> bool {
    with(USB, |line| line.behind.has_room())
}

/// Drops the half line of a program that has closed USB, wherever its bytes are. The lines before it are carried out.
/// Interrupts are off for some bytes at a time.
#[cold]
#[inline(never)]
pub(super) fn close() {
    while with(USB, |line| line.behind.drop_newest()) {}
    with(USB, Line::close);
}

/// Queues bytes that have come by USB when there was no room. Called in each turn of the main loop.
pub fn go_on(_: Thread) {
    for _ in 0..PACKET / AT_ONCE {
        match with(USB, Line::go_on) {
            Some(true) => {}
            Some(false) => return usb::ROOM.signal(()),
            None => return,
        }
    }
}

/// Whether the first port is the chip's own USB.
pub fn sees_opening() -> bool {
    registers(USB).is_none()
}

/// Whether a program, not the first, has opened USB since the last call.
pub fn take_opened(thread: Thread) -> bool {
    usb::take_opened(thread)
}

/// How often USB has been restarted since the start, because it hung; 255 for more.
pub fn restarts(_: Thread) -> u8 {
    usb::restarts()
}

/// In how many milliseconds USB has seen errors of its bus since the start, modulo 2^16.
pub fn bus_errors(_: Thread) -> u16 {
    usb::bus_errors()
}

/// Takes the bytes to send by USB next. Returns how many.
pub(super) fn take(packet: &mut [u8]) -> usize {
    let mut count = 0;
    while let Some(to) = packet.get_mut(count..).filter(|to| !to.is_empty()) {
        let most = to.len().min(SENT_AT_ONCE);
        let to = to.get_mut(..most).unwrap_or_default();
        let taken = with(USB, |line| match line.take_run(to) {
            0 => to.iter_mut().map_while(|byte| line.next().map(|next| *byte = next)).count(),
            taken => taken,
        });
        if taken == 0 {
            break;
        }
        count += taken;
    }
    if count > 0 {
        flags::set(Event::Transmitted);
    }
    count
}

/// Whether the bytes for USB should be sent now: they fill a packet, or are a whole answer while no other line waits
/// for its answer.
pub(super) fn is_due() -> bool {
    let used = USB_TX.used();
    used >= PACKET - 1 || used > 0 && USB_RX.used() == 0
}

/// Sets how the other side may stop this port's transmitter from now on.
pub fn set_flow(thread: Thread, port: u8, flow: Flow) {
    with(port, |line| {
        line.heeds_xoff = flow == Flow::Characters;
        line.held &= line.heeds_xoff;
    });
    kick(thread.level(), port);
}

/// Sends XOFF or XON that has waited long enough; also gives [`eeprom`] and [`drivers`] their turns. Called each
/// millisecond.
pub fn look(thread: Thread) {
    for port in 0..PORTS as u8 {
        with(port, |line| line.wait_ms = line.wait_ms.saturating_sub(1));
        if port == USB && registers(port).is_none() {
            usb::flush();
            usb::look(thread);
        }
        kick(thread.level(), port);
    }
    eeprom::look(thread);
    drivers::look(thread, time::millis());
}

/// Returns the millisecond in which the last byte came, on any port.
pub(super) fn heard_at() -> u32 {
    let now = time::millis();
    let ages = (0..PORTS as u8).map(|port| now.wrapping_sub(with(port, |line| line.heard_at)));
    now.wrapping_sub(ages.min().unwrap_or(0))
}

/// Returns how many line ends have been lost since start-up, modulo 2^16.
pub fn lost_ends(_: Thread, port: u8) -> u16 {
    with(port, |line| line.lost_ends)
}

/// Returns how many bytes may come before one is lost, at most 254: one less than the receive ring has room for.
pub fn room(_: Thread, port: u8) -> u8 {
    let used = if port == AUX { AUX_RX.used() } else { USB_RX.used() };
    serial::capacity(port).saturating_sub(used as u8)
}

/// Whether half of the second port's receive ring is full.
pub fn presses(_: Thread) -> bool {
    PORTS > 1 && AUX_RX.used() >= AUX_RING / 2
}

/// Whether the reader has to have its turn before the next waiting line is carried out: see [`serial::calls_reader`].
/// On the second port any waiting byte is a reason.
pub fn calls_reader(_: Thread) -> bool {
    // SAFETY: the reader does not run meanwhile.
    let ring = unsafe { USB_RX.window() };
    PORTS > 1 && AUX_RX.used() > 0 || serial::calls_reader(&ring)
}

/// Returns the slot of the receive ring that holds the newest byte; `None` if that byte has been read.
pub fn newest(_: Thread, port: u8) -> Option<u8> {
    match port {
        AUX => AUX_RX.newest(),
        _ => USB_RX.newest(),
    }
}

/// Returns the slot of the mark that stands for the last `%` or `^d`; `None` if no such mark waits.
pub fn last_cut(_: Thread, port: u8) -> Option<u8> {
    // SAFETY: the reader does not run meanwhile.
    let ring = unsafe { if port == AUX { AUX_RX.window() } else { USB_RX.window() } };
    last_mark(&ring)
}

/// Whether a `!` has come, on any port, that has not been taken yet. Any level.
pub fn asks_hold() -> bool {
    (0..PORTS as u8).any(|port| with(port, |line| line.realtime & realtime::HOLD != 0))
}

/// Takes override requests that characters have made since the last call; if there are more, an event announces them.
pub fn take_asked(_: Thread, port: u8) -> Asked {
    let (asked, more) = with(port, |line| (line.asked.pop_front(), !line.asked.is_empty()));
    if more {
        flags::set(Event::Realtime);
    }
    asked.unwrap_or(Asked::NOTHING)
}

/// Takes the real-time characters since the last call, as bits (see [`realtime`]).
pub fn take_realtime(_: Thread, port: u8) -> u8 {
    with(port, |line| core::mem::take(&mut line.realtime))
}

/// Ends lines that have been sent in part by a line feed. The remaining contents of the rings are never sent.
/// Interrupts are off, and stay so.
pub(super) fn end_lines() {
    for port in 0..PORTS as u8 {
        let Some(uart) = registers(port) else { continue };
        if with(port, |line| line.open) {
            while uart.uartfr().read().txff() {}
            uart.uartdr().write(|w| w.set_data(b'\n'));
        }
        while uart.uartfr().read().busy() {}
    }
}
