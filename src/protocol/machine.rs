//! What dialects ask of the machine.

use super::dialect::Memory;
use super::value::Value;
use crate::card::{Entry, Op};
use crate::config::bed::{Bed, Point};
use crate::config::{Setting, Settings};
use crate::gcode::overrides::Change;
use crate::gcode::tables::TableRow;
use crate::heat::Standing;
use crate::heat::tune::Tune;
use crate::machine::{Alarm, Cycle, Doing};
use crate::motion::snapshot::Program;
use crate::status::Status;
use crate::units::Length;

/// What storing a setting has brought about besides.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Warning {
    /// Nothing besides.
    #[default]
    None,
    /// The velocity limits of an axis were lowered to what its motors can follow.
    Velocity,
    /// A jerk limit of an axis is not in force beside its acceleration limit.
    Jerk,
    /// An axis searches for its homing switch at its traverse velocity, which is below its search velocity.
    Search,
}

/// How far a hold has come.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Hold {
    /// There is none, or none that anybody is to see.
    #[default]
    None,
    /// The machine slows down, or goes on again.
    Slows,
    /// The machine stands still.
    Rests,
}

/// How long a line may be that is carried out after a start.
pub const STARTUP_MAX: usize = 40;

/// What is done to the program that is kept.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Store<'a> {
    /// A new one begins; the old one is gone.
    Begin,
    /// A line of it.
    Line(&'a [u8]),
    /// The program is complete.
    End,
    /// A line that is carried out after a start: which of the two, and its text.
    Startup(u8, &'a [u8]),
}

/// What becomes of a printer's extruder, which is the A axis.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Extruder {
    /// The extruder's words are relative to where it is, whatever the others are relative to; or no longer.
    Relative(bool),
    /// The extruder moves this many thousandths of what its words say.
    Flow(u16),
    /// M900 K, 0.1 ms: how far it is ahead in the lines that follow.
    Advance(u16),
    /// The next line does not move it; its words count as if it did.
    LeaveOut,
    /// The extruder moves by itself, and the origin of its words moves along with it.
    Move {
        /// How far.
        by: Length,
        /// mm/min.
        feed: i32,
    },
}

/// What becomes of the temperature below which filament is not moved, until the next start.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Cold {
    /// The temperature is only asked for.
    Asked,
    /// Filament may be moved at any temperature, or no longer.
    Allowed(bool),
    /// The temperature is set to this, degrees.
    Least(i16),
}

/// What G29 and M420 ask for, at rest.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Level {
    /// Moves follow the plane of the bed from now on, if it is known, or do not.
    Follow(bool),
    /// A traverse to there, X Y Z of machine coordinates.
    Go(Point),
    /// There, at the speed at which Z leaves its homing switch, until the probe touches; an alarm if it does not.
    Probe(Point),
}

/// The machine behind the dialects. Nothing here waits.
pub trait Machine {
    /// The settings in force.
    fn settings(&self) -> &Settings;
    /// The value of a setting that is in EEPROM alone: up to 2 ms.
    fn cold(&mut self, setting: Setting) -> i32;
    /// The value of any setting.
    fn setting(&mut self, setting: Setting) -> i32 {
        if setting.is_cold() { self.cold(setting) } else { self.settings().get(setting) }
    }
    /// Stores a value that [`Settings::check`] returned and lets it take effect, or refuses it. [`Status::Again`] as of
    /// [`Self::set_row`].
    fn set(&mut self, setting: Setting, value: i32) -> Result<Warning, Status>;
    /// Sets a value of the interpreter's tables. [`Status::Again`]: nothing is done, and it is to be tried again when
    /// the tables are ready.
    fn set_row(&mut self, row: TableRow, axis: u8, value: Length) -> Result<(), Status>;
    /// Sets the tool length on one axis, as G43.1 does.
    fn set_tool_length(&mut self, axis: u8, length: Length) -> Result<(), Status>;
    /// A value now, in the unit that [`Value`] states.
    fn value(&mut self, value: Value) -> i32;
    /// All steps of a report or group tell of one moment: that of the first step, from the `first` one on, that tells of motion.
    fn moment(&mut self, first: bool);
    /// What the dialects keep of their reports.
    fn memory(&mut self) -> &mut Memory;
    /// What the machine is doing.
    fn doing(&mut self) -> Doing;
    /// What it is about as a whole, held or not.
    fn cycle(&mut self) -> Cycle;
    /// How far a hold has come.
    fn hold(&mut self) -> Hold;
    /// While the machine rests, what the program has come to.
    fn rest(&mut self) -> Program;
    /// Restores the defaults of all settings and of what dialects remember, or refuses to: 10 ms on AVR.
    fn restore(&mut self) -> Status;
    /// Begins an alarm, if there is none as bad.
    fn alarm(&mut self, alarm: Alarm);
    /// Ends the alarm, if there is one, or refuses to. [`Status::Again`]: not yet.
    fn clear(&mut self) -> Status;
    /// Drops what is queued, or refuses to.
    fn flush(&mut self) -> Status;
    /// Starts a built-in job, or ends the one that runs: 0.
    fn start_job(&mut self, number: u8) -> Status;
    /// Homes those of these axes, as bits, that have a switch for it, or refuses to.
    fn home(&mut self, axes: u8) -> Status;
    /// From now on lines of G-code are checked only, or carried out again; or refuses to.
    fn check(&mut self, on: bool) -> Status;
    /// Holds motion as after a feedhold, at rest too, until somebody lets it go on.
    fn hold_back(&mut self);
    /// Resets the machine when what is being put has been put: drops what has come, and greets.
    fn start_over(&mut self);
    /// Begins to move an axis to a place in machine coordinates, or refuses to.
    fn jog(&mut self, axis: u8, place: Length) -> Status;
    /// Does something to the program that is kept. [`Status::Again`]: it is not done yet, and is to be asked for again.
    fn store(&mut self, what: Store<'_>) -> Result<(), Status>;
    /// A byte of the program that is kept.
    fn program(&mut self, at: u16) -> Option<u8>;
    /// A byte of a line that is carried out after a start; `None` behind the line's end.
    fn startup(&mut self, line: u8, at: u8) -> Option<u8>;
    /// Starts the machine anew when the response has left, in its boot loader if `boot`, for which it has to be at
    /// rest. [`Status::Again`] while settings are on their way to memory.
    fn restart(&mut self, boot: bool) -> Status;
    /// Changes the overrides at once.
    fn change_override(&mut self, change: Change);
    /// Powers a motor, or takes its power; all of them for `None`.
    fn energize(&mut self, motor: Option<u8>, on: bool) -> Status;

    /// How a heater stands: 0 the hot end, 1 the bed. `None` in an image without [`Capability::Printer`](crate::capability::Capability).
    fn heater(&mut self, heater: u8) -> Option<Standing>;
    /// Whether a line waits for a temperature (M109, M190, M116).
    fn waits_for_heat(&mut self) -> bool;
    /// Ends that wait (M108): the lines behind it are carried out.
    fn skip_wait(&mut self);
    /// Heaters that a fault has locked may be switched on again (M999). The alarm is [cleared](Self::clear) by itself.
    fn unlock_heaters(&mut self);

    /// Changes how the extruder moves, or moves it. [`Status::Again`]: nothing is done, and it is to be tried again when the planner is free.
    fn extruder(&mut self, what: Extruder) -> Status {
        let _ = what;
        Status::NotBuiltIn
    }

    /// Begins to tune a heater, 0 the hot end, 1 the bed, at so many eighths of a degree, in so many cycles; it has what is found then if it `uses` it.
    /// [`Status::Again`] as of [`Self::extruder`].
    fn tune(&mut self, heater: u8, to: u16, cycles: u8, uses: bool) -> Status {
        let _ = (heater, to, cycles, uses);
        Status::NotBuiltIn
    }

    /// The autotune that is under way, or was last.
    fn tuned(&mut self) -> Tune {
        Tune::IDLE
    }

    /// How cold filament may be moved: how hot it must be, degrees, and whether it may be colder all the same.
    fn extrude_cold(&mut self, change: Cold) -> (i16, bool) {
        let _ = change;
        (0, true)
    }

    /// Asks something of the SD card.
    fn card(&mut self, what: Op<'_>) -> Status {
        let _ = what;
        Status::NotBuiltIn
    }

    /// The next byte of the file that is chosen on the SD card, and how many it has.
    fn card_progress(&mut self) -> Option<(u32, u32)> {
        None
    }

    /// Whether lines of that file are taken.
    fn card_prints(&mut self) -> bool {
        false
    }

    /// The file of that number on the SD card. `Err`: it cannot be read.
    fn card_entry(&mut self, number: u8) -> Result<Option<Entry>, Status> {
        let _ = number;
        Err(Status::NotBuiltIn)
    }

    /// The points of the bed, in an image with [`Capability::BedPlane`](crate::capability::Capability).
    fn bed(&mut self) -> Option<&mut Bed> {
        None
    }

    /// Begins with something. [`Status::Again`] as of [`Self::extruder`].
    fn level(&mut self, what: Level) -> Status {
        let _ = what;
        Status::NotBuiltIn
    }

    /// The origin of these axes, as bits, is no more where G92 has put it: it is where homing has.
    fn clear_shift(&mut self, axes: u8) {
        let _ = axes;
    }

    /// What is held, or stopped by a program, goes on.
    fn go_on(&mut self) {}

    /// Whether lengths are in inches.
    #[inline(never)]
    #[small]
    fn inches(&mut self) -> bool {
        self.value(Value::Units) == 0
    }
}
