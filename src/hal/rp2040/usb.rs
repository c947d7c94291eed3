//! USB: a serial port of the class CDC ACM, by `embassy-usb` on `embassy-rp`'s driver.
//!
//! Its tasks run on the [prompt executor](avr_embassy::interrupt::prompt), above thread mode and exec, so that a `!`
//! acts when its packet comes. After a packet that the receive ring has no room for, no other one is taken: the
//! computer is told to wait (NAK) until all of that packet has been queued.
//!
//! While no program has the port open, or while the bus sleeps, output is dropped, so that no task waits for it. Only
//! the first [`KEPT`] bytes after start-up, with the greeting, are kept for the first program that opens the port.
//! Tasks are told when another program opens it ([`take_opened`]). When its program closes the port, which a reset of
//! the bus does too, the half line that it has sent is dropped; whole lines are carried out.
//!
//! The chip's controller may hang, and the stack may wait for ever: [`watch`] restarts them. A computer may also
//! restart the chip: see [`restart`].

mod restart;
mod watch;

use core::sync::atomic::{AtomicBool, Ordering};
use core::task::Poll;

use avr_embassy::interrupt::prompt;
use embassy_futures::poll_once;
use embassy_futures::select::{Either, select};
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
use crate::hal::{Boot, Thread};

/// The longest packet of a full-speed bus.
pub(super) const PACKET: usize = 64;
/// Output is cut into pieces that are shorter than a packet, so that none needs an empty packet after it.
const PIECE: usize = PACKET - 1;
/// Bytes kept for the first program that opens the port.
const KEPT: usize = 256 + last_words::LINE;
/// The pair of vendor and product number that pid.codes has for tests. It tells no product from another: whoever sells
/// boards needs another pair.
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
/// The bus sleeps, its cable is out, or its controller is being restarted.
static ASLEEP: AtomicBool = AtomicBool::new(false);

/// A program, not the first, has opened the port, and this has not been taken yet.
static OPENED: AtomicBool = AtomicBool::new(false);
/// The program has closed the port: what it has sent is to be ended.
static SHUTS: Signal<CriticalSectionRawMutex, ()> = Signal::new();

pub use restart::set_rests;
pub(super) use watch::{bus_errors, restarts};

/// Notices when the bus sleeps.
struct Sleep;

impl Handler for Sleep {
    fn suspended(&mut self, suspended: bool) {
        set_asleep(suspended);
    }

    fn reset(&mut self) {
        self.suspended(false);
    }
}

fn set_asleep(asleep: bool) {
    ASLEEP.store(asleep, Ordering::Relaxed);
    NEWS.signal(());
}

/// Starts the tasks of USB; the computer notices the device.
pub(super) fn start(boot: &Boot) {
    static DESCRIPTORS: StaticCell<[u8; 256]> = StaticCell::new();
    static BOS: StaticCell<[u8; 64]> = StaticCell::new();
    static MICROSOFT: StaticCell<[u8; 64]> = StaticCell::new();
    static CONTROL: StaticCell<[u8; 64]> = StaticCell::new();
    static STATE: StaticCell<State<'static>> = StaticCell::new();
    static SLEEP: StaticCell<Sleep> = StaticCell::new();
    static RESTARTS: StaticCell<restart::Requests> = StaticCell::new();
    let mut config = Config::new(VENDOR, PRODUCT);
    config.manufacturer = Some("Kerf");
    config.product = Some(ACTIVE.name);
    // SAFETY: start-up comes here once, and nobody else uses the unit.
    let unit = unsafe { USB::steal() };
    let mut builder = Builder::new(
        Driver::new(unit, Handlers),
        config,
        DESCRIPTORS.init([0; 256]),
        BOS.init([0; 64]),
        MICROSOFT.init([0; 64]),
        CONTROL.init([0; 64]),
    );
    builder.handler(SLEEP.init(Sleep));
    let class = CdcAcmClass::new(&mut builder, STATE.init(State::new()), PACKET as u16);
    let (sender, receiver, control) = class.split_with_control();
    let requests = restart::Requests::new(boot, &mut builder);
    builder.handler(RESTARTS.init(requests));
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

/// Whether a program, not the first, has opened the port since the last call.
pub(super) fn take_opened(_: Thread) -> bool {
    // If another opening comes in between, this greeting serves both.
    take(&OPENED)
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

/// Looks after the controller and after requests of the computer. Called each millisecond.
pub(super) fn look(thread: Thread) {
    watch::look(thread);
    restart::look(thread);
}

#[embassy_executor::task]
async fn serve(mut device: UsbDevice<'static, Driver>) {
    loop {
        let Either::Second(trouble) = select(device.run(), watch::TROUBLE.wait()).await;
        device.disable().await;
        watch::cure(trouble);
    }
}

#[embassy_executor::task]
async fn hear(mut receiver: Receiver<'static, Driver>) {
    let mut packet = [0; PACKET];
    while let Either::Second(()) = select(receiver.wait_connection(), SHUTS.wait()).await {
        shut(&mut receiver, &mut packet);
    }
    loop {
        match select(receiver.read_packet(&mut packet), SHUTS.wait()).await {
            Either::First(Ok(count)) => {
                ROOM.reset();
                if uart::bring(packet.get(..count).unwrap_or_default()) {
                    continue;
                }
                while let Either::Second(()) = select(ROOM.wait(), SHUTS.wait()).await {
                    shut(&mut receiver, &mut packet);
                }
            }
            // The driver reports no errors.
            Either::First(Err(_)) => receiver.wait_connection().await,
            Either::Second(()) => shut(&mut receiver, &mut packet),
        }
    }
}

/// Ends what a program has sent that has closed the port, with the packet that the chip has taken meanwhile. Otherwise
/// the rest of a line would be taken for the next program's.
#[cold]
#[inline(never)]
fn shut(receiver: &mut Receiver<'static, Driver>, packet: &mut [u8; PACKET]) {
    if let Poll::Ready(Ok(count)) = poll_once(receiver.read_packet(packet))
        && uart::takes_last()
    {
        uart::bring(packet.get(..count).unwrap_or_default());
    }
    uart::close();
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
                OPENED.store(true, Ordering::Relaxed);
                flags::set(Event::Realtime);
            }
            Some(Turn::Closes) => SHUTS.signal(()),
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
