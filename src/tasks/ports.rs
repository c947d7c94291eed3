//! The serial ports as tasks see them: the state of each port, and which of them feeds the machine.
//!
//! Each line is answered on its own port, in the mode of the last line there. Control lines of every port are taken at
//! any time. G-code comes from one port at a time, the *feeder*: the first port to send some while the machine is at
//! rest. It stays the feeder until the machine is at rest again. G-code from any other port is refused meanwhile, with
//! status 117: if it waited instead, it would move the machine later, unexpectedly.
//!
//! Unsolicited reports go to the feeder, or to USB while the feeder is on a bus that it shares with others.

use core::cell::{Cell, RefCell};

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::{Mutex, MutexGuard};

use super::lines::{Class, LineId, LinePool};
use super::links::Links;
use super::tx::Tx;
use super::view::{Seen, View};
use crate::card;
use crate::config::Settings;
use crate::hal::Thread;
use crate::hal::event::{is_unheard, set_eager};
use crate::hal::serial::{Flow, USB, is_shared};
use crate::hal::uart;
use crate::machine::{self, Alarm, Cycle};
use crate::protocol::Speech;
use crate::status::Status;
use crate::units::{Length, PerAxis};

/// The greatest length of control lines of USB that may overtake.
const RESERVE: u8 = 40;
/// See [`RESERVE`]; for the second port.
pub const AUX_RESERVE: u8 = 16;
/// Footers tell how many lines of this length, end included, may come. A power of two.
const PROMISED: u8 = 32;
/// See [`PROMISED`]; for the second port.
const AUX_PROMISED: u8 = 16;

/// How many turns a report leaves to control lines before it begins, and how many to others while it is sent.
pub const COURTESY: u8 = 8;

/// A bit of [`Port::asked`]: a status report.
pub const REPORT: u8 = 1;
/// A bit of [`Port::asked`]: the greeting, because the sender has reset the machine.
pub const GREETING: u8 = 2;
/// A bit of [`Port::asked`]: before the greeting, the report that motion was interrupted.
pub const INTERRUPTED: u8 = 4;
/// A bit of [`Port::asked`]: before the greeting, the greeting in the other dialect, because the dialect is undecided.
pub const OTHERS: u8 = 32;

/// A bit of [`Port::asked`], beside [`INTERRUPTED`]: the motion that was interrupted was homing.
pub const HOMING: u8 = 8;
/// A bit of [`Port::asked`]: the machine is to be reset. The control task does so.
pub const RESET: u8 = 16;

/// A bit of [`Port::asked`], beside [`GREETING`]: a program has opened the port, and nothing has been reset.
pub const OPENED: u8 = 64;
/// A bit of [`Port::asked`]: the greeting is being sent. Lines wait until it has been sent.
pub const GREETS: u8 = 128;

/// Whether a sender may be greeted other than at the start of the machine.
#[inline(always)]
pub fn greets_anew() -> bool {
    Speech::HAS_QUESTION || uart::sees_opening()
}

/// What has decided the dialect of a port.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub enum Choice {
    /// The image has one dialect alone.
    #[default]
    None = 0,
    /// The setting has decided.
    Set = 1,
    /// The first line that is in one dialect alone has decided.
    Said = 2,
    /// Nothing has decided, and no line has come: the first line that is in one dialect alone will decide.
    Open = 3,
    /// Nothing has decided, but lines have come, which several dialects have in common.
    Begun = 4,
}

/// The lines in a receive ring that are dropped: those up to a slot.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Cut {
    /// No line is dropped.
    None,
    /// All data lines are dropped: by a kill, a flush, or the beginning of an alarm.
    All(u8),
    /// G-code is refused: it has come in an alarm that has been ended since.
    Gcode(u8),
}

impl Cut {
    /// Returns the slot up to which lines are dropped.
    #[inline(always)]
    pub fn slot(self) -> Option<u8> {
        match self {
            Cut::None => None,
            Cut::All(slot) | Cut::Gcode(slot) => Some(slot),
        }
    }

    /// Whether no line is dropped.
    #[inline(always)]
    pub fn is_none(self) -> bool {
        self == Cut::None
    }
}

/// The state of one port.
// In this order: AVR reaches a field within 63 bytes of the first in one instruction.
#[repr(C)]
pub struct Port {
    /// The number of the port.
    pub number: u8,
    /// The dialect and mode of answers.
    pub speech: Cell<Speech>,
    /// What has decided in which dialect the port is spoken to.
    pub choice: Cell<Choice>,
    /// Requests by single bytes, as bits. The parser answers a [`REPORT`]; control carries out a [`RESET`]; the
    /// reporter handles the others.
    pub asked: Cell<u8>,
    /// The sender has sent an enquiry (ENQ). Control sets this, and the parser answers.
    pub enquiry: Cell<bool>,
    /// What the parser is to report on this port alone: lost bytes, or the reason of an alarm, which comes first.
    pub news: Cell<Option<Status>>,
    /// The lines of the receive ring that are dropped.
    pub cut: Cell<Cut>,
    /// The line that is being answered has begun its alarm when it arrived ([`stop`](super::stop)).
    pub has_stopped: Cell<bool>,
    /// The alarm that a line is to end once the machine has stopped.
    pub clears: Cell<Alarm>,
    /// Received lines.
    pub lines: RefCell<LinePool>,
    /// The line to the sender, for the parser and the reporter. The mutex knows of one task that waits, the reporter.
    pub tx: Mutex<NoopRawMutex, Tx>,
    /// The state of the machine when the report or group under way on this port first read motion.
    pub seen: Cell<Option<Seen>>,
}

/// Returns [`Port::seen`] of a port on which nothing has been told. By a call: the image would otherwise hold a whole
/// new port in RAM once more, to copy this value from it.
#[inline(never)]
fn nothing_seen() -> Option<Seen> {
    None
}

impl Port {
    /// Returns a port that keeps its lines in `bytes`.
    pub fn new(number: u8, bytes: &'static mut [u8], tx: Tx) -> Self {
        Self {
            number,
            lines: RefCell::new(LinePool::new(
                bytes,
                if number == USB { RESERVE } else { AUX_RESERVE },
            )),
            tx: Mutex::new(tx),
            speech: Cell::default(),
            has_stopped: Cell::new(false),
            clears: Cell::new(Alarm::None),
            enquiry: Cell::new(false),
            asked: Cell::new(0),
            choice: Cell::default(),
            seen: Cell::new(nothing_seen()),
            news: Cell::new(None),
            cut: Cell::new(Cut::None),
        }
    }

    /// Records that the sender requests these bits of [`Port::asked`].
    pub fn ask(&self, bits: u8) {
        self.asked.set(self.asked.get() | bits);
    }

    /// Takes a bit of [`Port::asked`]. Returns whether it was set.
    pub fn take_asked(&self, bit: u8) -> bool {
        let asked = self.asked.get();
        self.asked.set(asked & !bit);
        asked & bit != 0
    }

    /// Whether a reset is under way: the sender has reset the machine, or opened the port, and the greeting has not
    /// been begun.
    #[inline(always)]
    pub fn is_resetting(&self) -> bool {
        greets_anew() && self.asked.get() & GREETING != 0
    }

    /// Whether lines wait for the end of the greeting.
    #[inline(always)]
    pub fn awaits_greeting(&self) -> bool {
        greets_anew() && self.asked.get() & (GREETING | GREETS) != 0
    }

    /// Whether the dialect is undecided: the first line that is in one dialect alone will decide.
    pub fn is_undecided(&self) -> bool {
        Speech::IS_CHOSEN && matches!(self.choice.get(), Choice::Open | Choice::Begun)
    }

    /// Whether `?` and bytes above 0x7F are recognised within lines.
    pub fn is_eager(&self) -> bool {
        self.speech.get().is_in_order()
    }

    /// Whether a line that begins with this byte may decide the dialect, or is the first one.
    #[inline(always)]
    pub fn may_decide(&self, first: Option<&u8>) -> bool {
        match self.choice.get() {
            Choice::Open => Speech::IS_CHOSEN,
            Choice::Begun if Speech::IS_CHOSEN => {
                first.is_some_and(|first| Speech::may_be_decided_by(*first))
            }
            _ => false,
        }
    }

    /// Whether a printing host speaks on the port.
    #[inline(always)]
    pub fn is_plain(&self) -> bool {
        Speech::HAS_PLAIN && self.speech.get().is_plain()
    }

    /// Returns the flow control in force. XON and XOFF are used only in dialects whose senders know these characters.
    pub fn flow(&self, settings: &Settings) -> Flow {
        match Flow::of(self.number, settings.flow_control()) {
            Flow::Characters if self.speech.get().is_in_order() || self.is_plain() => Flow::None,
            flow => flow,
        }
    }

    /// Returns how many lines may come, which footers tell. Each may be [`PROMISED`] bytes long with its end; a longer
    /// one counts as several.
    #[inline(never)]
    pub fn promise(&self, thread: Thread, lines: &LinePool) -> u8 {
        let (slots, room) = (lines.free(), lines.room());
        let shift = if self.number == USB { PROMISED } else { AUX_PROMISED }.trailing_zeros();
        if u16::from(slots) << shift <= room {
            return slots;
        }
        let all = room + u16::from(uart::room(thread, self.number));
        slots.min((all >> shift) as u8)
    }

    /// Returns the transmitter for a report. Answers to control lines that wait come first, for [`COURTESY`] turns at
    /// most.
    pub async fn tx_behind_answers(&self) -> MutexGuard<'_, NoopRawMutex, Tx> {
        if is_unheard() {
            yield_now().await;
        }
        for _ in 0..COURTESY {
            if !self.lines.borrow().has_controls() {
                break;
            }
            yield_now().await;
        }
        self.tx.lock().await
    }

    /// Whether there is a message for this port alone, or a byte to answer that is no line.
    #[inline(always)]
    pub fn tells(&self) -> bool {
        self.enquiry.get() || self.news.get().is_some() || self.asks_report()
    }

    /// Whether a byte has requested a status report, and it may be sent: not while the machine homes, unless it is held.
    /// Senders take the first report after `$H` for the position at which homing has ended.
    #[inline(always)]
    pub fn asks_report(&self) -> bool {
        self.asked.get() & REPORT != 0 && (machine::cycle() != Cycle::Homing || machine::is_held())
    }
}

/// A line that is to be taken next.
pub struct Chosen {
    /// Where it came from, and where the answer goes.
    pub port: &'static Port,
    /// The line, in the port's pool.
    pub id: LineId,
    /// What to do with the line.
    pub class: Class,
}

impl Links {
    /// Returns the port with a number.
    #[inline(always)]
    pub fn port(&self, number: u8) -> &Port {
        // USB always exists.
        self.ports.get(usize::from(number)).unwrap_or(&self.ports[usize::from(USB)])
    }

    /// Returns the port whose G-code is taken.
    #[inline(always)]
    pub fn feeder(&self) -> &Port {
        self.port(self.feeder.get())
    }

    /// Tells the model that the machine is at `position`.
    #[inline(never)]
    #[small]
    pub fn set_position(&self, position: &PerAxis<Length>) {
        self.model.borrow_mut().set_position(position);
    }

    /// Returns the port that gets unsolicited reports.
    #[inline(never)]
    pub fn told(&self) -> &Port {
        let feeder = self.feeder.get();
        self.port(if is_shared(feeder) { USB } else { feeder })
    }

    /// Decides in which dialect a port is spoken to, if `line` exists in one dialect alone.
    #[inline(never)]
    #[small]
    pub fn decide_by(&self, port: &Port, line: &[u8]) {
        let settings = self.settings.borrow();
        if let Some(speech) = Speech::decided_by(line, &settings) {
            self.decide(port, speech, &settings);
        } else if port.choice.get() == Choice::Open && !line.trim_ascii().is_empty() {
            port.choice.set(Choice::Begun);
            self.decided(&settings);
        }
    }

    /// Whether `line` ends the dialect that was said first on a port. Only braces do, which are text nowhere but in the
    /// dialect that they select, and only while the machine does nothing: a sender may have followed another one
    /// without a start of the board.
    #[inline(never)]
    #[small]
    pub fn may_change_dialect(&self, port: &Port, line: &[u8]) -> bool {
        let others = Speech::IS_CHOSEN
            && port.choice.get() == Choice::Said
            && (port.is_eager() || port.is_plain());
        let rests = || machine::cycle() == Cycle::Lines && !self.is_busy(port);
        others && line.first() == Some(&b'{') && rests()
    }

    /// Whether anything is under way, or a file of the SD card is in use.
    fn is_busy(&self, port: &Port) -> bool {
        card::is_in_use() || View::of(self, port).is_busy()
    }

    /// Sets the dialect of a port. The port does not wait for a decision any more.
    #[inline(never)]
    #[small]
    pub fn decide(&self, port: &Port, speech: Speech, settings: &Settings) {
        port.speech.set(speech);
        port.choice.set(Choice::Said);
        self.decided(settings);
    }

    /// Handles a program that has opened the first port. While nothing runs, the program is greeted as at the start,
    /// and its first line decides the dialect again. Otherwise nothing is sent, because many senders take a greeting
    /// for a reset.
    #[inline(never)]
    #[small]
    pub fn open_anew(&self) {
        let port = self.port(USB);
        #[cfg(feature = "card-write")]
        self.forsake_file(USB);
        if self.is_busy(port) || self.has_data() || port.is_resetting() {
            return;
        }
        if matches!(port.choice.get(), Choice::Said | Choice::Begun) {
            let settings = self.settings.borrow();
            port.choice.set(Choice::Open);
            port.speech.set(Speech::at_start(&settings, USB));
            self.decided(&settings);
        }
        port.ask(GREETING | OPENED);
        if port.is_undecided() {
            port.ask(OTHERS);
        }
        self.reporter_wake.notify_now();
    }

    /// Applies a change of dialect on any port: which ports are eager ([`Port::is_eager`]), the flow control, and the
    /// initial motion mode.
    #[inline(never)]
    #[small]
    pub fn decided(&self, settings: &Settings) {
        let eager = self.ports.iter().filter(|port| port.is_eager());
        set_eager(self.thread, eager.fold(0, |ports, port| ports | 1 << port.number));
        if Speech::HAS_PLAIN {
            self.ports
                .iter()
                .for_each(|port| uart::set_plain(self.thread, port.number, port.is_plain()));
        }
        self.set_flow(settings);
        let began = |port: &Port| port.choice.get() != Choice::Open;
        if self.ports.iter().any(|port| began(port) && port.speech.get().is_in_order()) {
            self.model.borrow_mut().begin_with_rapids();
        }
    }

    /// Sets the flow control of each port, by the settings and the dialect.
    #[inline(never)]
    #[small]
    pub fn set_flow(&self, settings: &Settings) {
        self.ports
            .iter()
            .for_each(|port| uart::set_flow(self.thread, port.number, port.flow(settings)));
    }

    /// Whether a sender has reset the machine, and waits for the greeting.
    pub fn is_resetting(&self) -> bool {
        self.ports.iter().any(Port::is_resetting)
    }

    /// Returns the number of a port whose sender has reset the machine in motion.
    pub fn interrupter(&self) -> Option<u8> {
        let is_interrupted = |port: &&Port| port.asked.get() & INTERRUPTED != 0;
        let port = if Speech::HAS_QUESTION { self.ports.iter().find(is_interrupted) } else { None };
        port.map(|port| port.number)
    }

    /// Reports an exception to the feeder. It replaces one that waits, except in an alarm, where the one that waits may
    /// be the reason of the alarm.
    #[inline(never)]
    #[small]
    pub fn except(&self, status: Status) {
        if machine::alarm() == Alarm::None || self.notices.exception.get().is_none() {
            self.except_at_once(status);
        }
    }

    /// Reports an exception that is the reason of an alarm. It replaces one that waits.
    #[inline(never)]
    #[small]
    pub fn except_at_once(&self, status: Status) {
        self.notices.exception.set(Some(status));
        self.reporter_wake.signal();
    }

    /// Gives other tasks up to `turns` turns, as long as control lines wait or are being answered and `counts` says
    /// that they come first. Gives them one more turn first if bytes have come that may be such a line. A turn costs
    /// 300 cycles if no task has work.
    pub async fn give_way(&self, turns: u8, counts: impl Fn() -> bool) {
        if is_unheard() {
            yield_now().await;
        }
        for _ in 0..turns {
            if !counts() || !self.ports.iter().any(|port| port.lines.borrow().has_controls()) {
                break;
            }
            yield_now().await;
        }
    }

    /// Whether lines of G-code wait on any port.
    pub fn has_data(&self) -> bool {
        self.ports.iter().any(|port| port.lines.borrow().has_data())
    }

    /// Gives up the file that the last program on a port was writing to the SD card: at once, or behind its lines that
    /// still wait, which must not run.
    #[cfg(feature = "card-write")]
    fn forsake_file(&self, port: u8) {
        if !card::writes() || port != self.feeder.get() {
            return;
        }
        self.card.borrow_mut().forsake();
        if !self.has_data() {
            self.card.borrow_mut().leave();
        }
    }

    /// Whether G-code of this port is taken. If the machine is at rest, the port becomes the feeder.
    pub fn may_feed(&self, port: &Port) -> bool {
        // Only if needed: a view borrows the settings.
        port.number == self.feeder.get() || View::of(self, port).may_feed()
    }
}
