//! The serial ports: they move bytes between their lines and two rings each.
//!
//! USB is USART0. The second port, on boards that have one, is USART1 or USART3, as the board says. Its receive ring is
//! shorter; everything else is equal. The interrupts are in `interrupts`.
//!
//! Where bytes are lost, because a ring was full or the hardware overran, a mark tells the reader: see
//! [`serial`](crate::hal::serial).
//!
//! On a bus (RS-485) [`kick`] enables the driver of the bus, and the interrupt at the end of the last byte disables it.
//! With flow control by pins, the transmit interrupt reads CTS before each byte. When CTS has stopped transmission,
//! [`look`] starts it again within a millisecond of its release.

mod interrupts;

use super::gpio;
use crate::baud;
use crate::boards::{Handshake, Pin, Serial, Usart};
use crate::hal::byte::SharedByte;
use crate::hal::ring::Ring;
use crate::hal::serial::{
    self, AUX, AUX_RING, AllEnds, Ends, Flow, LATE, PORTS, RX_RING, TX_RING, USB, WAIT_MS, XOFF,
    XON, hardware, is_shared, last_mark, wait_ms,
};
use crate::hal::{Boot, Interrupt, Level, Thread};
use crate::realtime::{self, Asked};

/// The state that the interrupts of a port share with thread mode.
#[repr(C)]
struct Shared<const N: usize> {
    rx: Ring<u8, N>,
    tx: Ring<u8, TX_RING>,
    flags: Flags,
}

/// The fields of [`Shared`] whose size does not depend on the ring's.
#[repr(C)]
struct Flags {
    /// Counts line ends that were lost, low byte first. The receive interrupt writes it.
    lost_ends: [SharedByte; 2],
    /// Real-time characters, as bits. The receive interrupt sets them, `take_realtime` clears them.
    realtime: SharedByte,
    /// A byte to send before all others, if it is not 0. From [`WAIT_MS`] on the byte waits for the end of the line
    /// that is being sent. While there is such a byte `held` has [`AHEAD`].
    ahead: SharedByte,
    /// Bits: reasons why the bytes in the ring may have to wait ([`STOPPED`], [`HEEDS_CTS`], [`HEEDS_XOFF`],
    /// [`AHEAD`]), and [`PLAIN`]. The receive interrupt changes [`STOPPED`], the transmit interrupt clears [`AHEAD`].
    /// Code that keeps these two bits has to change this byte with interrupts off.
    held: SharedByte,
    /// Not 0: XOFF has stopped the sender. Exec may set it, too; thread mode clears it.
    stopped: SharedByte,
    /// An [`Asked`], byte for byte. The receive interrupt adds to it, `take_asked` clears it.
    asked: [SharedByte; 3],
}

/// The other side has sent XOFF, so that nothing may be sent.
const STOPPED: u8 = 1 << 0;
/// The pin CTS decides whether bytes may be sent.
const HEEDS_CTS: u8 = 1 << 1;
/// XOFF and XON from the other side are obeyed.
const HEEDS_XOFF: u8 = 1 << 2;
/// Printable real-time characters are text.
const PLAIN: u8 = 1 << 3;
/// There may be a byte in `ahead`.
const AHEAD: u8 = 1 << 4;

impl Flags {
    /// Orders `byte` to be sent before all others.
    fn send_ahead(&self, _: Level, byte: u8) {
        self.ahead.set(byte);
        avr_device::interrupt::free(|_| self.held.set(self.held.get() | AHEAD));
    }

    /// Sets the reasons for which the bytes in the ring may have to wait from now on.
    fn hold(&self, _: Thread, why: u8) {
        // `AHEAD` is set in any case, because exec may have a byte sent ahead meanwhile. The transmit interrupt
        // checks whether there is one.
        self.held.set(why | AHEAD);
    }
}

impl<const N: usize> Shared<N> {
    const fn new() -> Self {
        Self {
            rx: Ring::new(),
            tx: Ring::new(),
            flags: Flags {
                lost_ends: [const { SharedByte::new(0) }; 2],
                realtime: SharedByte::new(0),
                ahead: SharedByte::new(0),
                held: SharedByte::new(0),
                stopped: SharedByte::new(0),
                asked: [const { SharedByte::new(0) }; 3],
            },
        }
    }

    /// Returns the ends that tasks own. The other ends belong to the interrupts, which push and pop in assembly.
    fn split(&'static self) -> Option<Ends> {
        let (_, rx) = self.rx.split()?;
        let (tx, _) = self.tx.split()?;
        Some((rx.into_view(), tx))
    }
}

static USB_SHARED: Shared<RX_RING> = Shared::new();
static AUX_SHARED: Shared<AUX_RING> = Shared::new();

// UCSRnA
const TXC: u8 = 1 << 6;
const UDRE: u8 = 1 << 5;
const U2X: u8 = 1 << 1;
// UCSRnB
const RXCIE: u8 = 1 << 7;
const TXCIE: u8 = 1 << 6;
const UDRIE: u8 = 1 << 5;
/// Ready to receive and to send, and nothing to send.
const IDLE: u8 = RXCIE | 1 << 4 | 1 << 3;

/// Returns the register at a distance from a port's first register. Computed from constants of the board, so that it
/// costs nothing except the choice of the port.
#[inline(always)]
fn register(port: u8, offset: usize) -> *mut u8 {
    const fn base(port: u8) -> usize {
        match hardware(port) {
            Some(serial) => serial.usart.address(),
            None => Usart::U0.address(),
        }
    }
    let base = if PORTS > 1 && port == AUX { const { base(AUX) } } else { const { base(USB) } };
    (base + offset) as *mut u8
}

#[inline(always)]
fn flags(port: u8) -> &'static Flags {
    if PORTS > 1 && port == AUX { &AUX_SHARED.flags } else { &USB_SHARED.flags }
}

#[inline(always)]
fn tx(port: u8) -> &'static Ring<u8, TX_RING> {
    if PORTS > 1 && port == AUX { &AUX_SHARED.tx } else { &USB_SHARED.tx }
}

/// Starts the lines, 8N1: USB at `rate` bits a second, the second port at the board's rate. `None` after the first
/// time.
pub fn start(thread: Thread, _: &Boot, rate: u32) -> Option<AllEnds> {
    let usb = USB_SHARED.split()?;
    start_port(thread, USB, rate);
    let aux = match const { hardware(AUX) } {
        None => None,
        Some(aux) => {
            start_port(thread, AUX, aux.rate);
            Some(AUX_SHARED.split()?)
        }
    };
    Some(AllEnds { usb, aux })
}

fn start_port(thread: Thread, port: u8, rate: u32) {
    set_rate(thread, port, rate);
    // SAFETY: start-up.
    unsafe {
        register(port, 0).write_volatile(U2X);
        register(port, 1).write_volatile(IDLE);
    }
}

/// Changes the rate to `rate` bits a second. A byte that is on the line at that moment, in either direction, is spoilt.
pub fn set_rate(_: Thread, port: u8, rate: u32) {
    let [low, high] = baud::divisor(rate).to_le_bytes();
    // SAFETY: only code with a `Thread` writes these two registers; the write of the lower one takes effect.
    unsafe {
        register(port, 5).write_volatile(high);
        register(port, 4).write_volatile(low);
    }
}

/// Ends lines that have been sent in part by a line feed. The remaining contents of the rings are never sent.
///
/// # Safety
/// Thread mode; interrupts are off, and stay so.
pub unsafe fn end_lines() {
    for port in (0..PORTS as u8).filter(|port| !is_shared(*port)) {
        if tx(port).taken_last() == Some(b'\n') {
            continue;
        }
        // SAFETY: the caller's.
        unsafe {
            while register(port, 0).read_volatile() & UDRE == 0 {}
            register(port, 6).write_volatile(b'\n');
        }
    }
}

/// Starts sending what the ring holds. Exec calls it only on a port that is no bus.
pub fn kick(_: Level, port: u8) {
    if is_shared(port) {
        return kick_bus(port);
    }
    // SAFETY: after start-up this register has one of two values, and it is written whole.
    unsafe { register(port, 1).write_volatile(IDLE | UDRIE) };
}

/// Starts sending what the ring holds, on a bus. Both transmit interrupts are off while the driver of the bus is
/// switched on: otherwise the interrupt at the end of an earlier transmission would switch the driver off again.
fn kick_bus(port: u8) {
    let control = register(port, 1);
    // SAFETY: written whole.
    unsafe { control.write_volatile(IDLE) };
    let next = if tx(port).used() > 0 {
        each_driver(port, gpio::high);
        UDRIE
    } else {
        TXCIE
    };
    // SAFETY: as before.
    unsafe { control.write_volatile(IDLE | next) };
}

/// Calls `act` with the pin that enables the driver of a port, as a constant.
#[inline(always)]
fn each_driver(port: u8, act: impl Fn(Pin)) {
    if let Some(Serial { driver_enable: Some(pin), .. }) = const { hardware(USB) }
        && port == USB
    {
        act(pin);
    }
    if let Some(Serial { driver_enable: Some(pin), .. }) = const { hardware(AUX) }
        && port == AUX
    {
        act(pin);
    }
}

/// Stops the sender or lets it go on, by the flow control that the two sides have agreed on. With `Flow::Pins` the
/// receive interrupt also stops the sender. If `waits`, XOFF or XON may wait for the end of the line that is being
/// sent.
pub fn stop_sender(thread: Thread, port: u8, flow: Flow, stop: bool, waits: bool) {
    match flow {
        Flow::None => {}
        Flow::Characters => {
            // SAFETY: only code with a `Thread` writes this register.
            let divisor = unsafe { register(port, 4).read_volatile() };
            let wait = if waits { WAIT_MS * wait_ms(port, divisor) } else { 0 };
            let flags = flags(port);
            // Exec may call `stop_late` between any two of these lines; their order allows that.
            if stop {
                flags.stopped.set(1);
            }
            flags.send_ahead(thread.level(), wait + if stop { XOFF } else { XON });
            flags.stopped.set(stop.into());
            kick(thread.level(), port);
        }
        Flow::Pins => set_rts(port, stop),
    }
}

/// Whether XOFF has stopped the sender, sent by thread mode or by [`stop_late`].
pub fn is_stopped(_: Thread, port: u8) -> bool {
    flags(port).stopped.get() != 0
}

/// Stops the sender of the second port by XOFF if its receive ring fills while thread mode has no turn. Exec never runs
/// within an interrupt of a port. Cost: 12 cycles.
#[inline(always)]
pub fn stop_late(exec: Interrupt) {
    if PORTS > 1 && AUX_SHARED.rx.used() >= LATE {
        stop_now(exec);
    }
}

#[cold]
#[inline(never)]
fn stop_now(exec: Interrupt) {
    let flags = flags(AUX);
    // An XOFF that waits for the end of a line is sent at once.
    let waits = flags.ahead.get() > WAIT_MS + XON;
    if flags.held.get() & HEEDS_XOFF != 0 && (flags.stopped.get() == 0 || waits) {
        flags.stopped.set(1);
        flags.send_ahead(exec.level(), XOFF);
        kick(exec.level(), AUX);
    }
}

fn set_rts(port: u8, stop: bool) {
    if let Some(Serial { handshake: Some(Handshake { rts, .. }), .. }) = const { hardware(USB) }
        && port == USB
    {
        gpio::set(rts, stop);
    }
    if let Some(Serial { handshake: Some(Handshake { rts, .. }), .. }) = const { hardware(AUX) }
        && port == AUX
    {
        gpio::set(rts, stop);
    }
}

/// Sets whether `!`, `~`, `%` and bytes above 0x7F are plain text from now on.
pub fn set_plain(thread: Thread, port: u8, plain: bool) {
    // XOFF is not obeyed on such a port, so the receive interrupt does not write `held`.
    if plain {
        flags(port).hold(thread, PLAIN);
        kick(thread.level(), port);
    }
}

/// Sets how the other side may stop this port's transmitter from now on.
pub fn set_flow(thread: Thread, port: u8, flow: Flow) {
    let heeds = match flow {
        Flow::None => 0,
        Flow::Characters => HEEDS_XOFF,
        Flow::Pins => HEEDS_CTS,
    };
    let held = flags(port).held.get();
    let heeds = if cfg!(feature = "dialect-reprap") { heeds | held & PLAIN } else { heeds };
    if held & !(STOPPED | AHEAD) != heeds {
        // An earlier XOFF is ignored from now on.
        flags(port).hold(thread, heeds);
        set_rts(port, false);
        kick(thread.level(), port);
    }
}

/// Sends bytes that CTS has held back, and XOFF or XON that has waited long enough. Called each millisecond.
#[inline(always)]
pub fn look(thread: Thread) {
    for port in 0..PORTS as u8 {
        if flags(port).ahead.get() >= WAIT_MS {
            wait_less(thread, port);
        }
        let has_pins = matches!(Flow::of(port, 2), Flow::Pins);
        if has_pins && flags(port).held.get() & HEEDS_CTS != 0 {
            kick(thread.level(), port);
        }
    }
}

/// Takes one millisecond off the time that XOFF or XON waits.
#[inline(never)]
fn wait_less(thread: Thread, port: u8) {
    super::mask(|| {
        let ahead = &flags(port).ahead;
        // The transmit interrupt may have sent the byte meanwhile, or exec may have ordered one that does not wait.
        if let Some(less) = ahead.get().checked_sub(WAIT_MS) {
            ahead.set(less);
        }
    });
    kick(thread.level(), port);
}

/// Does nothing: bytes that find no room in the ring are lost.
pub fn go_on(_: Thread) {}

/// Always false: opening the port resets this chip, so there is nothing to notice.
pub fn sees_opening() -> bool {
    false
}

/// Always false: see [`sees_opening`].
pub fn take_opened(_: Thread) -> bool {
    false
}

/// Always 0: this chip has no USB.
pub fn restarts(_: Thread) -> u8 {
    0
}

/// Always 0: see [`restarts`].
pub fn bus_errors(_: Thread) -> u16 {
    0
}

/// Returns how many line ends have been lost since start-up, modulo 2^16.
pub fn lost_ends(_: Thread, port: u8) -> u16 {
    let [low, high] = &flags(port).lost_ends;
    loop {
        let before = high.get();
        let count = u16::from_le_bytes([low.get(), before]);
        if high.get() == before {
            return count;
        }
    }
}

/// Returns how many bytes may come before one is lost, at most 254: one less than the receive ring has room for.
pub fn room(_: Thread, port: u8) -> u8 {
    let is_aux = PORTS > 1 && port == AUX;
    let used = if is_aux { AUX_SHARED.rx.used() } else { USB_SHARED.rx.used() };
    serial::capacity(port).saturating_sub(used as u8)
}

/// Whether half of the second port's receive ring is full. The other half fills in 3 ms, so a task with much to do then
/// yields to the reader.
pub fn presses(_: Thread) -> bool {
    PORTS > 1 && AUX_SHARED.rx.used() >= AUX_RING / 2
}

/// Whether the reader has to have its turn before the next waiting line is carried out: see [`serial::calls_reader`].
/// On the second port any waiting byte is a reason.
pub fn calls_reader(_: Thread) -> bool {
    // SAFETY: the reader does not run meanwhile.
    let ring = unsafe { USB_SHARED.rx.window() };
    PORTS > 1 && AUX_SHARED.rx.used() > 0 || serial::calls_reader(&ring)
}

/// Returns the slot of the receive ring that holds the newest byte; `None` if that byte has been read.
pub fn newest(_: Thread, port: u8) -> Option<u8> {
    if PORTS > 1 && port == AUX { AUX_SHARED.rx.newest() } else { USB_SHARED.rx.newest() }
}

/// Returns the slot of the mark that stands for the last `%` or `^d`; `None` if no such mark waits. Cost: 12 cycles for
/// each byte that waits.
pub fn last_cut(_: Thread, port: u8) -> Option<u8> {
    // SAFETY: the reader does not run meanwhile.
    let ring = unsafe {
        if PORTS > 1 && port == AUX { AUX_SHARED.rx.window() } else { USB_SHARED.rx.window() }
    };
    last_mark(&ring)
}

/// Whether a `!` has come, on any port, that has not been taken yet. Any level.
#[inline(always)]
pub fn asks_hold() -> bool {
    (0..PORTS as u8).any(|port| flags(port).realtime.get() & realtime::HOLD != 0)
}

/// Takes the override requests that characters have made since the last call.
#[inline(never)]
pub fn take_asked(_: Thread, port: u8) -> Asked {
    let [feed, spindle, fixed] = &flags(port).asked;
    if feed.get() | spindle.get() | fixed.get() == 0 {
        return Asked::NOTHING;
    }
    // Taken one after the other. A character that comes in between counts with the bytes that are taken later, so the
    // order is kept.
    let taken = |byte: &SharedByte| {
        avr_device::interrupt::free(|_| {
            let value = byte.get();
            byte.set(0);
            value
        })
    };
    let fixed = taken(fixed);
    Asked { percent: [taken(feed) as i8, taken(spindle) as i8], fixed }
}

/// Takes the real-time characters since the last call, as bits (see [`realtime`](crate::realtime)).
pub fn take_realtime(_: Thread, port: u8) -> u8 {
    let realtime = &flags(port).realtime;
    avr_device::interrupt::free(|_| {
        let bits = realtime.get();
        realtime.set(0);
        bits
    })
}
