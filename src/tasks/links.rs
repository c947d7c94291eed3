//! Every link between tasks: its contents, producer, consumer, and behaviour when full.
//!
//! | link | carries | depth | RAM | from | to | when full |
//! |---|---|---|---|---|---|---|
//! | `uart` receive ring | bytes | 255; 63 | 259 B, 67 B | RX interrupt | reader | what is damaged or lost is refused with status 13 |
//! | [`Port::lines`] | lines | 9 lines; 412 B, 96 B | 448 B, 132 B | reader | parser | bytes stay in the receive ring |
//! | [`commands`] | canonical commands | 1 | 98 B | parser | planner | the parser takes control lines only |
//! | block ring | blocks | 61 | 2,079 B with the speed constraints | planner | exec | the planner waits; `commands` stays taken |
//! | segment ring | segments | 7 | 131 B | exec | step interrupt | exec waits for its next run |
//! | `uart` transmit ring | bytes | 127 each port | 131 B each | parser, reporter | TX interrupt | parser: the port waits, response half sent; reporter: waits |
//! | [`Links::storage`] | which settings to look at, a row of the tables; what printing hosts have set until the next start | a range, 1; all, 1 | 46 B, 50 B | parser | storage | the range grows; a line that changes another row waits |
//! | [`Links::rate`] | a new rate of the line | 1 | 6 B | parser | parser | overwritten: the newest counts |
//! | [`Port::seen`] | the state of the machine when the report under way first read motion | 1 | 53 B each port | the task that reports on the port | that task | overwritten |
//! | [`Links::restart`] | a reset that is due | 1 | 1 B | parser | parser | overwritten |
//! | [`Links::changes`] | changes that the planner handles before the next line | a bit each | 1 B | parser, planner | planner | bits merge |
//! | [`Links::notices`], [`Links::probe`] | what is to be told: an exception, the end of a jog or of a flush, a probing | 1 each | 4 B, 26 B | all | reporter | overwritten: the newest counts, but in an alarm its reason |
//! | [`Links::job`] | the built-in job, and how far it has come | 1 | 4 B | parser | parser, reporter, planner in a flush | a second one is refused |
//! | [`Links::cleared_by`] | the port that has ended an alarm last | 1 | 1 B | parser | parser | overwritten |
//! | [`Links::feeder`] | which port's lines are carried out | 1 | 1 B | parser | all | never: it changes at a standstill |
//!
//! What the machine is doing is no link: that is in [`machine`](crate::machine). [`Links::signs`] belong to the
//! control task and the reader.
//!
//! Back-pressure runs from the pins to the sender: when segments are full, blocks become full, then `commands` stays
//! taken, then data lines wait in the pool, and their responses wait with them. A sender that counts responses has no
//! more lines in flight than those.
//!
//! All links except the interrupt rings belong to thread-mode tasks of one executor, which take turns. They are plain
//! `RefCell`s, never borrowed across an `.await`.

mod commands;

use core::cell::{Cell, RefCell};

pub use commands::{CommandReceiver, CommandSender};

use super::heat::Heaters;
use super::ports::Port;
use super::storage::Storage;
use super::wake::{ReporterWake, Wake};
use crate::boards::outputs;
use crate::config::Settings;
use crate::gcode::command::Commands;
use crate::gcode::interpreter::Interpreter;
use crate::hal::byte::SharedByte;
use crate::hal::serial::{PORTS, USB};
use crate::hal::{Interrupt, Thread};
use crate::jobs::Job;
use crate::machine::{Notices, Probe, Signs};
use crate::motion::queue;
use crate::protocol::{Memory, Remembers};

/// The links. There is one for the machine, made at start-up.
// In this order: AVR reaches a field within 63 bytes of the first in one instruction.
#[repr(C)]
pub struct Links {
    /// The proof that all links belong to thread mode.
    pub thread: Thread,
    /// The number of the port that feeds the machine.
    pub feeder: Cell<u8>,
    /// The planner works on `commands`.
    commands_taken: Cell<bool>,
    /// What the last line does that the planner has been given.
    pub last: Cell<Last>,
    /// A line has come, or the planner is ready: wakes the parser.
    pub parser_wake: Wake,
    /// `commands` has been filled.
    planner_wake: Wake,
    /// Something that reports show may have changed.
    pub reporter_wake: ReporterWake,
    /// A line has left a pool. The reader waits for this when a pool is full.
    pub pool_space: Wake,
    /// Lines wait for more: a chain, or lines to be blended. The power task then wakes the planner.
    pub moves_wait: Cell<bool>,
    /// Changes that the planner handles before the next line.
    pub changes: Changes,
    /// The built-in job that runs.
    pub job: Cell<Job>,
    /// A new rate of USB, in bits a second. The parser sets it when its response has left.
    pub rate: Cell<Option<u32>>,
    /// The machine is to be reset; `true` starts its boot loader. The parser does so when its response has left.
    pub restart: Cell<Option<bool>>,
    /// The settings and tables to save, and the log of saved ones.
    pub storage: &'static Storage,
    /// A tilde has come: resume.
    pub cycle_start: Wake,
    /// Blocks that came and went, for queue reports.
    pub queue_count: QueueCount,
    /// The number of the port that has asked last for the end of an alarm.
    pub cleared_by: Cell<u8>,
    /// Notices for the reporter. Any task writes, the reporter takes.
    pub notices: Notices,
    /// The result of probing.
    pub probe: Probe,
    /// Real-time characters that have not had all their effect yet. They belong to the control task and the reader,
    /// with `tasks::hold`.
    pub signs: Signs,
    /// The state of the heaters, and what the planner waits for.
    pub heat: Heaters,
    /// The SD card, and the file that is printed from it.
    #[cfg(feature = "sd")]
    pub card: &'static RefCell<crate::card::Card>,
    /// The memory of dialects between reports.
    pub report: RefCell<Memory>,
    /// The serial ports.
    pub ports: [Port; PORTS],
    /// The commands for the planner; valid while `commands_taken`.
    commands: RefCell<Commands>,
    /// The G-code model. The parser advances it; reports read it.
    pub model: RefCell<Interpreter<&'static Storage>>,
    /// Settings in force.
    pub settings: RefCell<Settings>,
}

/// What is created before the links, so that the stack holds only one of them at a time.
pub struct Earlier {
    /// What is to be saved.
    pub storage: &'static Storage,
    /// The card.
    #[cfg(feature = "sd")]
    pub card: &'static RefCell<crate::card::Card>,
}

impl Links {
    /// Creates the links. The planner carries out `SETTINGS` and `ORIGIN` before the first line.
    pub fn new(thread: Thread, ports: [Port; PORTS], earlier: Earlier) -> Self {
        let storage = earlier.storage;
        Self {
            thread,
            ports,
            feeder: Cell::new(USB),
            pool_space: Wake::default(),
            parser_wake: Wake::default(),
            commands: RefCell::new(Commands::default()),
            commands_taken: Cell::new(false),
            planner_wake: Wake::default(),
            moves_wait: Cell::new(false),
            last: Cell::new(Last::Other),
            cycle_start: Wake::default(),
            notices: Notices::default(),
            reporter_wake: ReporterWake::default(),
            queue_count: QueueCount::default(),
            changes: Changes::new(Changes::SETTINGS | Changes::ORIGIN),
            rate: Cell::new(None),
            restart: Cell::new(None),
            cleared_by: Cell::new(USB),
            heat: Heaters::new(),
            #[cfg(feature = "sd")]
            card: earlier.card,
            probe: Probe::default(),
            signs: Signs::default(),
            job: Cell::default(),
            storage,
            report: RefCell::new(Memory::new()),
            // `recall` sets the defaults later, in place. Here they would need as much space again on the stack.
            settings: RefCell::new(Settings::blank()),
            model: RefCell::new(Interpreter::with(storage)),
        }
    }
}

/// What a line does, as far as the answers to later lines depend on it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Last {
    /// The line neither moves the machine nor pauses.
    Other,
    /// The line moves the machine.
    Moves,
    /// The line pauses (G4).
    Pauses,
}

impl Last {
    /// Returns what a line with these commands does.
    pub fn of(commands: &Commands) -> Self {
        match commands.dwell_ms {
            Some(_) => Self::Pauses,
            None if commands.moves() => Self::Moves,
            None => Self::Other,
        }
    }
}

/// Changes other than by lines. The code that changes something sets its bit; the planner takes the bits before the
/// next line.
pub struct Changes(Cell<u8>);

impl Changes {
    /// The relation of steps to positions has changed: positions in steps must be computed again.
    pub const STEPS: u8 = 1;
    /// A setting has changed.
    pub const SETTINGS: u8 = 2;

    /// The origin, the coordinate system or the tool may have changed.
    pub const ORIGIN: u8 = 16;

    /// Coolant outputs that have been toggled other than by a line, as bits of [`outputs`]. Toggling one twice is no
    /// change.
    pub const COOLANT: u8 = outputs::MIST | outputs::FLOOD;
    const _APART: () = assert!(Self::COOLANT & (Self::STEPS | Self::SETTINGS | Self::ORIGIN) == 0);

    /// A set in which these bits are noted.
    pub const fn new(bits: u8) -> Self {
        Self(Cell::new(bits))
    }

    /// Notes that these bits have changed.
    pub fn note(&self, bits: u8) {
        self.0.set(self.0.get() | bits);
    }

    /// Notes that these outputs have been switched.
    pub fn flip(&self, outputs: u8) {
        self.0.set(self.0.get() ^ outputs & Self::COOLANT);
    }

    /// Returns the outputs that have been switched since the last call.
    #[inline(always)]
    pub fn take_flipped(&self) -> u8 {
        let bits = self.0.get();
        self.0.set(bits & !Self::COOLANT);
        bits & Self::COOLANT
    }

    /// Whether nothing has changed.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.0.get() == 0
    }

    /// Whether this bit has changed.
    #[inline(always)]
    pub fn has(&self, bit: u8) -> bool {
        self.0.get() & bit != 0
    }

    /// Whether this bit has changed since it was taken last.
    #[inline(always)]
    pub fn take(&self, bit: u8) -> bool {
        let bits = self.0.get();
        self.0.set(bits & !bit);
        bits & bit != 0
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
    /// Counts a block that has been queued.
    pub fn add(&self) {
        self.added.set(self.added.get().wrapping_add(1));
    }

    /// Returns how many blocks have been added since the last call.
    pub fn take_added(&self) -> i32 {
        let added = self.added.get();
        added.wrapping_sub(self.told_added.replace(added)).into()
    }

    /// Returns how many blocks have been removed since the last call.
    pub fn take_removed(&self) -> i32 {
        let removed = self.added.get().wrapping_sub(queue::used_here() as u16);
        removed.wrapping_sub(self.told_removed.replace(removed)).into()
    }
}

machine_static! {
    fn waits() -> SharedByte = SharedByte::new(1);
}

/// Notes whether exec waits for a block.
pub fn wait_for_block(_: Interrupt, yes: bool) {
    waits().set(yes.into());
}

/// Pends exec if it waits for a block, now that one has been queued. Otherwise exec sees the block when a segment has
/// been used up.
pub fn feed() {
    if waits().get() != 0 {
        crate::hal::exec::pend();
    }
}
