//! The restart by a request of the computer: the interface that Raspberry Pi's `picotool` looks for (class 0xFF,
//! subclass 0, protocol 1), so that `picotool reboot -f -u` works without the button BOOTSEL. It looks at Raspberry Pi's
//! USB ids only, unless `--vid` and `--pid` name another.
//!
//! The interface has no endpoints; its two requests say what is to be started: the boot loader in ROM (1), or the
//! firmware (2). They are refused by a stall while the machine does not rest ([`set_rests`]): something moves or is
//! queued, a heater or the spindle is on, a hold is on, or settings are being stored. Otherwise the request is
//! answered, and thread mode restarts the chip [`ANSWER_MS`] later, if the machine still rests.
//!
//! The serial port stays what it was: its two interfaces are one function, which a descriptor (IAD) says, and this one
//! is another. On Windows, Microsoft's descriptors select WinUSB for this one; no driver has to be installed.

use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use embassy_usb::control::{OutResponse, Recipient, Request, RequestType};
use embassy_usb::msos::{CompatibleIdFeatureDescriptor, windows_version};
use embassy_usb::types::InterfaceNumber;
use embassy_usb::{Builder, Handler};

use super::Driver;
use crate::hal::imp::{stepper, watchdog};
use crate::hal::{Boot, Thread};

/// Class, subclass and protocol of the interface.
const INTERFACE: [u8; 3] = [0xFF, 0x00, 0x01];
/// The request for the boot loader. Its value tells which of the loader's interfaces to leave out: it has both here.
const BOOT_LOADER: u8 = 1;
/// The request for the firmware.
const FIRMWARE: u8 = 2;
/// The request by which Windows reads Microsoft's descriptors; any number.
const MICROSOFT: u8 = 0x20;
/// How long the answer to a request may take to leave, ms.
const ANSWER_MS: u8 = 20;

/// The machine rests.
static RESTS: AtomicBool = AtomicBool::new(false);
/// The request that has been accepted; 0 is none.
static ASKED: AtomicU8 = AtomicU8::new(0);
/// Milliseconds until the restart. Only thread mode uses it.
static LEFT: AtomicU8 = AtomicU8::new(ANSWER_MS);

/// Tells whether the machine rests.
pub fn set_rests(_: Thread, rests: bool) {
    RESTS.store(rests, Ordering::Relaxed);
}

fn rests() -> bool {
    RESTS.load(Ordering::Relaxed) && !stepper::running()
}

/// Answers the requests.
pub(super) struct Requests(InterfaceNumber);

impl Requests {
    /// Adds the interface.
    pub(super) fn new(_: &Boot, builder: &mut Builder<'static, Driver>) -> Self {
        let [class, subclass, protocol] = INTERFACE;
        builder.msos_descriptor(windows_version::WIN8_1, MICROSOFT);
        let mut function = builder.function(class, subclass, protocol);
        function.msos_feature(CompatibleIdFeatureDescriptor::new("WINUSB", ""));
        let mut interface = function.interface();
        let number = interface.interface_number();
        interface.alt_setting(class, subclass, protocol, None);
        Self(number)
    }
}

impl Handler for Requests {
    fn control_out(&mut self, request: Request, _: &[u8]) -> Option<OutResponse> {
        let is_own = request.recipient == Recipient::Interface
            && request.request_type != RequestType::Standard
            && request.index == u16::from(u8::from(self.0));
        if !is_own {
            return None;
        }
        let is_known = matches!(request.request, BOOT_LOADER | FIRMWARE);
        if !is_known || !rests() {
            return Some(OutResponse::Rejected);
        }
        ASKED.store(request.request, Ordering::Relaxed);
        Some(OutResponse::Accepted)
    }
}

/// Restarts the chip if a request has been answered. Called each millisecond.
pub(super) fn look(thread: Thread) {
    if ASKED.load(Ordering::Relaxed) != 0 {
        count_down(thread);
    }
}

#[cold]
#[inline(never)]
fn count_down(thread: Thread) {
    let left = LEFT.load(Ordering::Relaxed);
    if left > 0 {
        LEFT.store(left - 1, Ordering::Relaxed);
        return;
    }
    let asked = ASKED.load(Ordering::Relaxed);
    ASKED.store(0, Ordering::Relaxed);
    LEFT.store(ANSWER_MS, Ordering::Relaxed);
    match asked {
        // A line may have come meanwhile.
        _ if !rests() => {}
        BOOT_LOADER => watchdog::boot(thread),
        _ => watchdog::reset(thread),
    }
}
