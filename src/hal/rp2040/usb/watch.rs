//! The watch over USB: it finds a controller or a stack that hangs, and restarts it, so that a `!` gets through again.
//!
//! # What hangs
//!
//! - **The controller** (erratum RP2040-E15): while it waits for the computer's ACK of a packet, noise on the bus that
//!   looks like another packet stops it for good. It answers nothing any more, nor counts frames. A reset of the bus
//!   does not help; a reset of the whole unit does. Programs see an open port that is dead.
//! - **The stack**: `embassy-rp` 0.10 waits for the end of a control transfer. If the computer gives the transfer up, by
//!   a reset of the bus or by another request, it waits for ever and takes neither.
//!
//! # How it is found
//!
//! [`look`] runs in thread mode each millisecond. A bus is silent or busy: a computer sends a frame each
//! millisecond; if it does not for 3 ms, the bus sleeps, which the controller tells. So what follows is a hang:
//!
//! - No frame has come for [`SILENT_MS`], though frames came before, the bus is not asleep, and no reset of the bus is
//!   under way (both lines low).
//! - The same after both lines were low or a resume was signalled for [`SIGNAL_MS`], asleep or not: the computer wakes
//!   the bus, and the controller has not noticed.
//! - Frames come, [`BEYOND_DOUBT`] in a row, though the bus is said to be asleep: its resume has been lost.
//! - A reset of the bus or a request has waited for [`UNTAKEN_MS`]. The tasks of USB take them within microseconds.
//!
//! A computer that sleeps, a charger, and a cable that is out cause nothing: no frames are expected there. After a
//! restart frames are not expected before one has come or the bus has been reset, so a restart never follows a restart
//! unless a computer is at work.
//!
//! # What is done
//!
//! [`cure`] runs in the task that serves the device. It resets the unit, sets it up as the driver does, and keeps the
//! pull-up off for [`OFF_MS`]: the computer sees the device go and come. The port then closes, as if the cable had been
//! out: the job that runs goes on, positions stay, lines that came whole are carried out, half a line is dropped. A stack
//! that hangs is only begun anew.
//!
//! Restarts are counted (`{usbr:n}`), and so are the milliseconds with errors of the bus (`{usbe:n}`), as a measure of
//! the noise. Cost: 50 cycles each millisecond; nothing waits. RAM: 24 bytes.

use core::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, Ordering};

use embassy_rp::pac::usb::regs::SieStatus;
use embassy_rp::pac::{RESETS, USB, USB_DPRAM};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

use super::{ASLEEP, set_asleep};
use crate::hal::Thread;
use crate::hal::imp::time;

/// Without a frame for this time the controller hangs. A bus without frames is asleep after 3 ms.
const SILENT_MS: u32 = 50;
/// A resume or a reset of the bus takes at least 10 ms; noise on a bus that sleeps is shorter than this.
const SIGNAL_MS: u8 = 5;
/// A request or a reset of the bus that has waited for this time is never taken.
const UNTAKEN_MS: u8 = 20;
/// So many frames in a row do not come to a bus that is asleep. One may have come before it fell asleep.
const BEYOND_DOUBT: u8 = 3;
/// How long the pull-up stays off at a restart. A hub notices 2.5 us.
const OFF_MS: u32 = 20;
/// Polls of the end of a reset before it is taken for granted.
const PATIENCE: usize = 1_000;

/// Levels of the bus, as `SIE_STATUS` has them: both lines are low.
const SE0: u8 = 0;
/// See [`SE0`]: the computer signals a resume.
const RESUME: u8 = 2;

/// What hangs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Trouble {
    /// The controller is deaf to the bus.
    Deaf,
    /// The stack does not take what the controller has for it.
    Stuck,
}

/// What the watch expects.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Stage {
    /// Nothing: no frame has come since the start.
    Quiet,
    /// Frames, unless the bus is asleep.
    Frames,
    /// Frames, because the computer has woken the bus.
    Woken,
    /// The controller is to be restarted.
    Hangs,
    /// The pull-up is off.
    Off,
}

/// Something hangs. The task that serves the device waits for it.
pub(super) static TROUBLE: Signal<CriticalSectionRawMutex, Trouble> = Signal::new();

/// A [`Stage`]. [`cure`] writes it only while it is [`Stage::Hangs`], thread mode otherwise.
static STAGE: AtomicU8 = AtomicU8::new(Stage::Quiet as u8);
/// The millisecond of the last sign of life.
static SINCE: AtomicU32 = AtomicU32::new(0);
/// The number of the last frame. Only thread mode uses it, like what follows.
static FRAME: AtomicU16 = AtomicU16::new(0);
/// For how many looks the computer has been signalling, up to [`SIGNAL_MS`].
static SIGNALS: AtomicU8 = AtomicU8::new(0);
/// For how many looks something has not been taken.
static UNTAKEN: AtomicU8 = AtomicU8::new(0);
/// How many frames have come in a row while the bus was said to be asleep.
static STRAYS: AtomicU8 = AtomicU8::new(0);
static RESTARTS: AtomicU8 = AtomicU8::new(0);
static ERRORS: AtomicU16 = AtomicU16::new(0);

/// How often USB has been restarted; 255 for more.
pub(in super::super) fn restarts() -> u8 {
    RESTARTS.load(Ordering::Relaxed)
}

/// In how many milliseconds the bus had errors, modulo 2^16.
pub(in super::super) fn bus_errors() -> u16 {
    ERRORS.load(Ordering::Relaxed)
}

fn stage() -> u8 {
    STAGE.load(Ordering::Relaxed)
}

fn enter(stage: Stage) {
    STAGE.store(stage as u8, Ordering::Relaxed);
    SINCE.store(time::millis(), Ordering::Relaxed);
}

/// Looks whether the controller and the stack are alive. Called each millisecond.
pub(super) fn look(_: Thread) {
    let (frame, status) = (USB.sof_rd().read().count(), USB.sie_status().read());
    let is_new = frame != FRAME.load(Ordering::Relaxed) && stage() <= Stage::Woken as u8;
    let is_stray = is_new && ASLEEP.load(Ordering::Relaxed);
    if is_new {
        FRAME.store(frame, Ordering::Relaxed);
        enter(Stage::Frames);
        SIGNALS.store(0, Ordering::Relaxed);
        let waits = status.bus_reset() || status.setup_rec();
        if !(is_stray || waits || has_errors(status)) {
            UNTAKEN.store(0, Ordering::Relaxed);
            STRAYS.store(0, Ordering::Relaxed);
            return;
        }
    }
    let strays = if is_stray { STRAYS.load(Ordering::Relaxed).saturating_add(1) } else { 0 };
    STRAYS.store(strays, Ordering::Relaxed);
    look_closely(status);
}

fn has_errors(status: SieStatus) -> bool {
    status.crc_error()
        || status.bit_stuff_error()
        || status.rx_overflow()
        || status.rx_timeout()
        || status.data_seq_error()
}

#[cold]
#[inline(never)]
fn look_closely(status: SieStatus) {
    count_errors(status);
    let is_silent = || time::millis().wrapping_sub(SINCE.load(Ordering::Relaxed)) >= SILENT_MS;
    let trouble = if stage() == Stage::Off as u8 {
        look_whether_to_attach();
        None
    } else if stage() == Stage::Hangs as u8 {
        None
    } else if is_untaken(status) || is_awake() {
        Some(Trouble::Stuck)
    } else {
        see_to_signals(status);
        (expects_frames() && is_silent()).then_some(Trouble::Deaf)
    };
    if let Some(trouble) = trouble {
        RESTARTS.store(restarts().saturating_add(1), Ordering::Relaxed);
        enter(Stage::Hangs);
        TROUBLE.signal(trouble);
    }
}

/// Counts and clears errors.
fn count_errors(status: SieStatus) {
    if has_errors(status) {
        ERRORS.store(bus_errors().wrapping_add(1), Ordering::Relaxed);
        USB.sie_status().write(|w| {
            w.set_crc_error(true);
            w.set_bit_stuff_error(true);
            w.set_rx_overflow(true);
            w.set_rx_timeout(true);
            w.set_data_seq_error(true);
        });
    }
}

/// Whether a request or a reset of the bus has not been taken for too long.
fn is_untaken(status: SieStatus) -> bool {
    let waits = status.bus_reset() || status.setup_rec();
    let looks = if waits { UNTAKEN.load(Ordering::Relaxed).saturating_add(1) } else { 0 };
    UNTAKEN.store(looks, Ordering::Relaxed);
    looks >= UNTAKEN_MS
}

/// Whether a bus that is said to be asleep is not.
fn is_awake() -> bool {
    STRAYS.load(Ordering::Relaxed) >= BEYOND_DOUBT
}

/// Notes that the computer resets or wakes the bus: frames have to follow.
fn see_to_signals(status: SieStatus) {
    let level = status.line_state();
    if level != SE0 && level != RESUME {
        SIGNALS.store(0, Ordering::Relaxed);
        return;
    }
    let looks = SIGNALS.load(Ordering::Relaxed).saturating_add(1).min(SIGNAL_MS);
    SIGNALS.store(looks, Ordering::Relaxed);
    if looks == SIGNAL_MS {
        enter(Stage::Woken);
    }
}

/// Whether frames have to come. While the bus is asleep the time begins anew.
fn expects_frames() -> bool {
    if stage() == Stage::Frames as u8 && ASLEEP.load(Ordering::Relaxed) {
        enter(Stage::Frames);
    }
    stage() == Stage::Frames as u8 || stage() == Stage::Woken as u8
}

/// Attaches the device again when it has been off long enough.
fn look_whether_to_attach() {
    if time::millis().wrapping_sub(SINCE.load(Ordering::Relaxed)) >= OFF_MS {
        FRAME.store(USB.sof_rd().read().count(), Ordering::Relaxed);
        USB.sie_ctrl().modify(|w| w.set_pullup_en(true));
        enter(Stage::Quiet);
    }
}

/// Restarts what hangs. The stack has been ended before. The task that serves the device.
#[cold]
#[inline(never)]
pub(super) fn cure(trouble: Trouble) {
    // What the stack waited for will not come.
    USB_DPRAM.ep_in_buffer_control(0).write(|_| {});
    USB_DPRAM.ep_out_buffer_control(0).write(|_| {});
    UNTAKEN.store(0, Ordering::Relaxed);
    STRAYS.store(0, Ordering::Relaxed);
    match trouble {
        Trouble::Stuck => {
            set_asleep(false);
            enter(Stage::Quiet);
        }
        Trouble::Deaf => {
            set_asleep(true);
            restart();
            enter(Stage::Off);
        }
    }
}

/// Resets the controller, and sets it up as the driver does at the start, without the pull-up.
fn restart() {
    RESETS.reset().modify(|w| w.set_usbctrl(true));
    RESETS.reset().modify(|w| w.set_usbctrl(false));
    // It takes some cycles.
    let _ = (0..PATIENCE).any(|_| RESETS.reset_done().read().usbctrl());
    for endpoint in 0..15 {
        USB_DPRAM.ep_in_control(endpoint).modify(|w| w.set_enable(false));
        USB_DPRAM.ep_out_control(endpoint).modify(|w| w.set_enable(false));
    }
    USB.usb_muxing().write(|w| {
        w.set_to_phy(true);
        w.set_softcon(true);
    });
    USB.usb_pwr().write(|w| {
        w.set_vbus_detect(true);
        w.set_vbus_detect_override_en(true);
    });
    USB.main_ctrl().write(|w| w.set_controller_en(true));
    USB.inte().write(|w| {
        w.set_bus_reset(true);
        w.set_buff_status(true);
        w.set_dev_resume_from_host(true);
        w.set_dev_suspend(true);
        w.set_setup_req(true);
    });
    USB.int_ep_ctrl().write(|w| w.set_int_ep_active(0xFFFE));
    USB.sie_ctrl().write(|w| w.set_ep0_int_1buf(true));
}
