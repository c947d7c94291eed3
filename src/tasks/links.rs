//! Every link between tasks: what goes through it, who fills it, who empties it, what happens when it
//! is full.
//!
//! | link | carries | depth | RAM | from | to | when full |
//! |---|---|---|---|---|---|---|
//! | `uart` receive ring | bytes | 255; 63 | 259 B, 67 B | RX interrupt | reader | what is damaged or lost is refused with status 13 |
//! | [`Port::lines`] | lines | 9 lines; 448 B, 96 B | 483 B, 131 B | reader | parser | bytes stay in the receive ring |
//! | [`Links::commands`] | canonical commands | 1 | 98 B | parser | planner | the parser takes control lines only |
//! | block ring | blocks | 64 | 1,912 B | planner | exec | the planner waits; `commands` stays taken |
//! | segment ring | segments | 7 | 131 B | exec | step interrupt | exec waits for its next run |
//! | `uart` transmit ring | bytes | 127 each port | 131 B each | parser, reporter | TX interrupt | parser: the port waits, response half sent; reporter: waits |
//! | [`Links::storage`] | which settings to look at, a row of the tables | a range, 1 | 46 B | parser | storage | the range grows; a line that changes another row waits |
//! | [`Links::rate`] | a new rate of the line | 1 | 6 B | parser | parser | overwritten: the newest counts |
//! | [`Links::moment`] | how motion stood when the report under way began | 1 | 32 B | whoever tells it | the same | overwritten |
//! | [`Links::restart`] | a reset that is due | 1 | 1 B | parser | parser | overwritten |
//!
//! So back-pressure runs from the pins to the sender: segments full, blocks full, `commands` taken, data
//! lines wait in the pool, and their responses wait with them. The sender has at most its lines in
//! flight there.
//!
//! All but the interrupt rings belong to thread-mode tasks of one executor, which take turns: plain
//! `RefCell`s, never borrowed across an `.await`.

use core::cell::{Cell, RefCell, UnsafeCell};

use super::hold::Flush;
use super::jog::Bar;
use super::ports::Port;
use super::storage::Storage;
use super::wake::{News, Wake};
use crate::config::Settings;
use crate::gcode::command::Commands;
use crate::gcode::interpreter::Interpreter;
use crate::hal::byte::SharedByte;
use crate::hal::serial::PORTS;
use crate::jobs::Job;
use crate::motion::queue;
use crate::motion::snapshot::{Moment, Snapshot};
use crate::protocol::StatusReport;
use crate::status::Status;
use crate::units::{FIRST_ROTARY, Length, PerAxis};

/// The links. One for the machine, made at start-up.
pub struct Links {
    /// The serial ports.
    pub ports: [Port; PORTS],
    /// The number of the port that feeds the machine.
    pub feeder: Cell<u8>,
    /// The reader waits for it when a pool is full.
    pub pool_space: Wake,
    /// There is a line, or the planner is ready: the parser looks again.
    pub parser_wake: Wake,
    /// What the planner is to do; valid while `commands_taken`.
    pub commands: RefCell<Commands>,
    /// The planner works on `commands`.
    pub commands_taken: Cell<bool>,
    /// `commands` was filled.
    pub planner_wake: Wake,
    /// A tilde: what has stopped goes on.
    pub cycle_start: Wake,
    /// The machine has come to a program stop and waits for cycle start.
    pub stopped: Cell<bool>,
    /// An exception to report to whoever feeds the machine.
    pub exception: Cell<Option<Status>>,
    /// Something that reports show may have changed.
    pub reporter_wake: News,
    /// Blocks that came and went, for queue reports.
    pub queue_count: QueueCount,
    /// A setting has changed what steps mean: the planner counts them anew.
    pub resync: Cell<bool>,
    /// A new rate of USB, in bits a second: the parser sets it when its response has left.
    pub rate: Cell<Option<u32>>,
    /// The limits that were hit first, as bits of the ends, for the report.
    pub limits_hit: Cell<u8>,
    /// The door is open: nothing goes on.
    pub door_open: Cell<bool>,
    /// The cycle of the machine that runs.
    pub cycle: Cell<Cycle>,
    /// What probing has found.
    pub probe: Probe,
    /// Whether a jog may begin.
    pub jogs: Cell<Bar>,
    /// A jog has ended, which is to be told.
    pub jogged: Cell<bool>,
    /// What status reports hold.
    pub report: RefCell<StatusReport>,
    /// The machine is to start anew, in its boot loader if so: the parser sees to it when its response has left.
    pub restart: Cell<Option<bool>>,
    /// How far a queue flush has come.
    pub flush: Cell<Flush>,
    /// A tilde has come, and no exclamation mark since: where it stands, what is held goes on.
    pub resume: Cell<bool>,
    /// A percent sign has come in the hold.
    pub percent: Cell<bool>,
    /// When a percent sign came that was none, ms: an exclamation mark right after it makes it one. 0 is never.
    pub percent_at: Cell<u32>,
    /// The job has been killed: when its queue has been flushed, the program ends.
    pub killed: Cell<bool>,
    /// The queue has been flushed, which is to be told.
    pub flushed: Cell<bool>,
    /// The built-in job that runs.
    pub job: Cell<Job>,
    /// When the report that is on its way was begun.
    pub moment: Cell<Moment>,
    /// What has to be put away, and where the rest is.
    pub storage: &'static Storage,
    /// A setting has changed since the planner looked.
    pub settings_changed: Cell<bool>,
    /// Settings in force.
    pub settings: RefCell<Settings>,
    /// The G-code model. The parser advances it; reports read it.
    pub model: RefCell<Interpreter<&'static Storage>>,
}

/// What the machine does beside carrying out moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cycle {
    /// Nothing.
    #[default]
    Off,
    /// G38.2 to G38.5.
    Probe,
    /// G28.2, G28.4.
    Homing,
    /// `{jogx:..}`.
    Jog,
}

/// What has become of a probing. The discriminants are TinyG's numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ProbeState {
    /// No contact.
    #[default]
    Failed,
    /// There was one.
    Touched,
    /// It is under way.
    Waiting,
}

/// The last probing.
#[derive(Default)]
pub struct Probe {
    state: Cell<ProbeState>,
    at: Cell<[Length; FIRST_ROTARY]>,
    news: Cell<bool>,
}

impl Probe {
    /// What has become of it.
    pub fn state(&self) -> ProbeState {
        self.state.get()
    }

    /// Where the contact was, or where it ended, machine coordinates; of the axes that may probe.
    pub fn at(&self, axis: u8) -> Option<Length> {
        self.at.get().get(usize::from(axis)).copied()
    }

    /// It begins.
    pub fn begin(&self) {
        self.state.set(ProbeState::Waiting);
    }

    /// It has come to an end, which is to be told.
    pub fn tell(&self, state: ProbeState, at: &PerAxis<Length>) {
        self.state.set(state);
        let [x, y, z, ..] = *at;
        self.at.set([x, y, z]);
        self.news.set(true);
    }

    /// Whether there is a result that nobody has begun to tell.
    pub fn is_news(&self) -> bool {
        self.news.get()
    }

    /// The same, and begins to.
    pub fn take_news(&self) -> bool {
        self.news.take()
    }
}

/// Counts blocks through the queue, modulo 2^16.
#[derive(Default)]
pub struct QueueCount {
    added: Cell<u16>,
    told_added: Cell<u16>,
    told_removed: Cell<u16>,
}

impl QueueCount {
    /// A block has been queued.
    pub fn add(&self) {
        self.added.set(self.added.get().wrapping_add(1));
    }

    /// Blocks added since the last call.
    pub fn take_added(&self) -> i32 {
        let added = self.added.get();
        added.wrapping_sub(self.told_added.replace(added)).into()
    }

    /// Blocks removed since the last call.
    pub fn take_removed(&self) -> i32 {
        let removed = self.added.get().wrapping_sub(queue::used() as u16);
        removed.wrapping_sub(self.told_removed.replace(removed)).into()
    }
}

/// What exec tells the others: written at level 2, read under the ceiling.
pub struct Published(UnsafeCell<Snapshot>);

// SAFETY: exec writes it, and thread mode reads it while exec is locked out.
unsafe impl Sync for Published {}

machine_static! {
    fn published() -> Published = Published(UnsafeCell::new(Snapshot::new()));
}

/// Changes how motion stands. Exec only, and not from within `change`.
pub fn update<R>(change: impl FnOnce(&mut Snapshot) -> R) -> R {
    // SAFETY: the only writer; readers keep it from running.
    change(unsafe { &mut *published().0.get() })
}

/// How motion stands. Thread mode only.
pub fn snapshot() -> Snapshot {
    // SAFETY: the writer does not run under the lock.
    crate::hal::imp::exec::lock(|_| unsafe { *published().0.get() })
}

machine_static! {
    fn waits() -> SharedByte = SharedByte::new(1);
}

/// Exec waits for a block, or no more. Exec only.
pub fn wait_for_block(yes: bool) {
    waits().set(yes.into());
}

/// A block has been queued: exec is pended if it waits for one. Else it looks when a segment has been used up.
pub fn feed() {
    if waits().get() != 0 {
        crate::hal::imp::exec::pend();
    }
}
