//! USB: a serial port of the class CDC ACM, by `embassy-usb` on `embassy-rp`'s driver.
//!
//! Its tasks run on the [prompt executor](avr_embassy::interrupt::prompt), above thread mode and exec, so that a `!`
//! acts when its packet comes. After a packet that the receive ring has no room for, no other one is taken: the
//! computer is told to wait (NAK) until all of that packet has been queued.
//!
//! While no program has the port open, or while the bus sleeps, output is dropped, so that no task waits for it. Only
//! the first [`KEPT`] bytes after start-up, with the greeting, are kept for the first program that opens the port.
//! Tasks are told when another program opens it ([`take_opened`]).

use core::sync::atomic::{AtomicBool, Ordering};

use avr_embassy::interrupt::prompt;
use embassy_futures::select::select;
use embassy_rp::bind_interrupts;
use embassy_rp::interrupt::{self, InterruptExt, Priority};
use embassy_rp::peripherals::USB;
use embassy_rp::usb::{self, InterruptHandler};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_usb::class::cdc_acm::{CdcAcmClass, ControlChanged, Receiver, Sender, State};
use embassy_usb::{Builder, Config, Handler, UsbDevice};
use heapless::Deque;
use static_cell::StaticCell;

use super::{flags, last_words, uart};
use crate::boards::ACTIVE;
use crate::hal::event::Event;

/// The longest packet of a full-speed bus.
pub(super) const PACKET: usize = 64;
/// Output is cut into pieces that are shorter than a packet, so that none needs an empty packet after it.
const PIECE: usize = PACKET - 1;
/// Bytes kept for the first program that opens the port.
const KEPT: usize = 256 + last_words::LINE;
/// A test pair of vendor and product number, of pid.codes; no boards are sold with it.
const VENDOR: u16 = 0x1209;
/// See [`VENDOR`].
const PRODUCT: u16 = 0x0001;

type Driver = usb::Driver<'static, USB>;

bind_interrupts!(struct Handlers {
    USBCTRL_IRQ => InterruptHandler<USB>;
});

/// All received bytes have been queued: the next packet may come.
pub(super) static ROOM: Signal<CriticalSectionRawMutex, ()> = Signal::new();
/// There may be something to send, or a program may have opened the port.
static NEWS: Signal<CriticalSectionRawMutex, ()> = Signal::new();
/// A piece is being sent. Output written meanwhile is sent after it.
static SENDS: AtomicBool = AtomicBool::new(false);
/// The bus sleeps, or its cable is out.
static ASLEEP: AtomicBool = AtomicBool::new(false);

/// A program, not the first, has opened the port, and this has not been taken yet.
static OPENED: AtomicBool = AtomicBool::new(false);
/// The program has closed the port, and this has not been taken yet.
static CLOSED: AtomicBool = AtomicBool::new(false);

/// Notices when the bus sleeps.
struct Sleep;

impl Handler for Sleep {
    fn suspended(&mut self, suspended: bool) {
        ASLEEP.store(suspended, Ordering::Relaxed);
        NEWS.signal(());
    }

    fn reset(&mut self) {
        self.suspended(false);
    }
}

/// Starts the tasks of USB; the computer notices the device. Start-up.
pub(super) fn start() {
    static DESCRIPTORS: StaticCell<[u8; 256]> = StaticCell::new();
    static BOS: StaticCell<[u8; 32]> = StaticCell::new();
    static CONTROL: StaticCell<[u8; 64]> = StaticCell::new();
    static STATE: StaticCell<State<'static>> = StaticCell::new();
    static SLEEP: StaticCell<Sleep> = StaticCell::new();
    let mut config = Config::new(VENDOR, PRODUCT);
    config.manufacturer = Some("Kerf");
    config.product = Some(ACTIVE.name);
    // SAFETY: start-up comes here once, and nobody else uses the unit.
    let unit = unsafe { USB::steal() };
    let mut builder = Builder::new(
        Driver::new(unit, Handlers),
        config,
        DESCRIPTORS.init([0; 256]),
        BOS.init([0; 32]),
        &mut [],
        CONTROL.init([0; 64]),
    );
    builder.handler(SLEEP.init(Sleep));
    let class = CdcAcmClass::new(&mut builder, STATE.init(State::new()), PACKET as u16);
    let (sender, receiver, control) = class.split_with_control();
    let device = builder.build();
    interrupt::SWI_IRQ_2.set_priority(Priority::P2);
    interrupt::USBCTRL_IRQ.set_priority(Priority::P2);
    prompt::start(|spawner| {
        // These tasks have not been spawned before.
        if let (Ok(serve), Ok(hear), Ok(tell)) =
            (serve(device), hear(receiver), tell(sender, control))
        {
            spawner.spawn(serve);
            spawner.spawn(hear);
            spawner.spawn(tell);
        }
    });
}

/// Whether a program, not the first, has opened the port since the last call. Thread mode.
pub(super) fn take_opened() -> bool {
    // If another opening comes in between, this greeting serves both.
    take(&OPENED)
}

/// Whether the program has closed the port since the last call, and none has opened it since. Thread mode.
pub(super) fn take_closed() -> bool {
    take(&CLOSED)
}

/// Clears a flag. Returns whether it was set.
fn take(flag: &AtomicBool) -> bool {
    let is_set = flag.load(Ordering::Relaxed);
    if is_set {
        flag.store(false, Ordering::Relaxed);
    }
    is_set
}

/// Notes that there may be something to send. While lines wait, their answers are gathered into full packets, for at
/// most a millisecond: see [`flush`]. Any level.
pub(super) fn kick() {
    if uart::is_due() {
        flush();
    }
}

/// Has all waiting output sent. Any level.
pub(super) fn flush() {
    if !SENDS.load(Ordering::Relaxed) {
        NEWS.signal(());
    }
}

#[embassy_executor::task]
async fn serve(mut device: UsbDevice<'static, Driver>) {
    device.run().await;
}

#[embassy_executor::task]
async fn hear(mut receiver: Receiver<'static, Driver>) {
    let mut packet = [0; PACKET];
    loop {
        receiver.wait_connection().await;
        while let Ok(count) = receiver.read_packet(&mut packet).await {
            ROOM.reset();
            if !uart::bring(packet.get(..count).unwrap_or_default()) {
                ROOM.wait().await;
            }
        }
    }
}

#[embassy_executor::task]
async fn tell(mut sender: Sender<'static, Driver>, control: ControlChanged<'static>) {
    let mut first = First { bytes: Deque::new(), keeps: true };
    if let Some(line) = last_words::take() {
        first.keep(line.as_bytes());
    }
    let (mut packet, mut door) = ([0; PIECE], Door::default());
    loop {
        match door.turn(control.dtr()) {
            Some(Turn::OpensAgain) => {
                CLOSED.store(false, Ordering::Relaxed);
                OPENED.store(true, Ordering::Relaxed);
                flags::set(Event::Realtime);
            }
            Some(Turn::Closes) => {
                CLOSED.store(true, Ordering::Relaxed);
                flags::set(Event::Received);
            }
            None => {}
        }
        let hears = hears(&control);
        let kept = if hears { first.take(&mut packet) } else { 0 };
        let count = if kept > 0 { kept } else { uart::take(&mut packet) };
        let piece = packet.get(..count).unwrap_or_default();
        if piece.is_empty() {
            select(NEWS.wait(), control.control_changed()).await;
        } else if hears {
            // If the port has been closed, the piece is dropped.
            SENDS.store(true, Ordering::Relaxed);
            select(sender.write_packet(piece), silence(&control)).await;
            SENDS.store(false, Ordering::Relaxed);
        } else {
            first.keep(piece);
        }
    }
}

/// Whether a program has the port open.
fn hears(control: &ControlChanged<'_>) -> bool {
    control.dtr() && !ASLEEP.load(Ordering::Relaxed)
}

/// Waits until no program has the port open.
async fn silence(control: &ControlChanged<'_>) {
    while hears(control) {
        select(NEWS.wait(), control.control_changed()).await;
    }
}

/// Whether a program has the port open, by the line (DTR) that says so, and whether one had it open before.
#[derive(Default)]
struct Door {
    is_open: bool,
    was_open: bool,
}

/// What a change of DTR means.
enum Turn {
    /// A program, not the first, has opened the port.
    OpensAgain,
    /// The program has closed the port.
    Closes,
}

impl Door {
    /// Takes the level of DTR. Returns what it means, if it has changed.
    fn turn(&mut self, dtr: bool) -> Option<Turn> {
        if dtr == self.is_open {
            return None;
        }
        self.is_open = dtr;
        if !dtr {
            return Some(Turn::Closes);
        }
        let again = core::mem::replace(&mut self.was_open, true);
        again.then_some(Turn::OpensAgain)
    }
}

/// Output from before a program has opened the port.
struct First {
    bytes: Deque<u8, KEPT>,
    keeps: bool,
}

impl First {
    /// Keeps a piece. When there is no room for it, drops it and everything that comes later, and the half line
    /// before it.
    fn keep(&mut self, piece: &[u8]) {
        self.keeps &= self.bytes.len() + piece.len() <= KEPT;
        if self.keeps {
            piece.iter().for_each(|byte| {
                let _ = self.bytes.push_back(*byte);
            });
            return;
        }
        while self.bytes.back().is_some_and(|byte| *byte != b'\n') {
            self.bytes.pop_back();
        }
    }

    /// Takes the next piece. Returns its length.
    fn take(&mut self, piece: &mut [u8]) -> usize {
        self.keeps = false;
        let bytes = piece.iter_mut();
        bytes.map_while(|byte| self.bytes.pop_front().map(|first| *byte = first)).count()
    }
}
