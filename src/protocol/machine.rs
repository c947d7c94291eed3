//! What dialects ask of the machine.

use super::dialect::Memory;
use super::value::Value;
use crate::card::{Entry, NAME_MAX, Op};
use crate::config::bed::{Bed, Point};
use crate::config::shape::Resonances;
use crate::config::{Setting, Settings};
use crate::gcode::overrides::Change;
use crate::gcode::tables::TableRow;
use crate::heat::Standing;
use crate::heat::tune::Tune;
use crate::machine::{Alarm, Cycle, Doing};
use crate::motion::snapshot::Program;
use crate::status::Status;
use crate::units::Length;

/// A side effect of storing a setting, which the sender is told.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Warning {
    /// No side effect.
    #[default]
    None,
    /// The velocity limits of an axis were lowered to what its motors can follow.
    Velocity,
    /// A jerk limit of an axis has no effect because of its acceleration limit.
    Jerk,
    /// An axis searches for its homing switch at its traverse velocity, which is below its search velocity.
    Search,
}

/// The state of a hold.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Hold {
    /// No hold, or a hold that is not shown to senders.
    #[default]
    None,
    /// The machine slows down for the hold, or starts again after it.
    Slows,
    /// The machine stands still.
    Rests,
}

/// The longest line, in bytes, that can be run at each start.
pub const STARTUP_MAX: usize = 40;

/// An operation on the stored program.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Store<'a> {
    /// Starts a new program. The old one is lost.
    Begin,
    /// Appends a line to the program.
    Line(&'a [u8]),
    /// Completes the program.
    End,
    /// Stores a line that runs at each start: its index (0 or 1) and its text.
    Startup(u8, &'a [u8]),
}

/// An operation on a printer's extruder, which is the A axis.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Extruder {
    /// Whether the extruder's words are relative, regardless of the mode of the other axes.
    Relative(bool),
    /// Sets the flow: the extruder moves this many thousandths of what its words say.
    Flow(u16),
    /// Sets the pressure advance, M900 K: how far the extruder is ahead in the lines that follow, in 0.1 ms.
    Advance(u16),
    /// Makes the next line leave the extruder where it is. Its words count as if it had moved.
    LeaveOut,
    /// Moves the extruder alone. The origin of its words moves along.
    Move {
        /// The distance.
        by: Length,
        /// The feed rate, mm/min.
        feed: i32,
    },
}

/// A change of the temperature below which filament is not moved. The change lasts until the next start.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Cold {
    /// No change: the temperature is only asked for.
    Asked,
    /// Whether filament may be moved at any temperature.
    Allowed(bool),
    /// Sets the temperature, in degrees.
    Least(i16),
}

/// An operation that G29 and M420 ask for while the machine is at rest.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Level {
    /// Whether moves follow the plane of the bed from now on. They only follow a plane that is known.
    Follow(bool),
    /// Traverses to a point, X Y Z in machine coordinates.
    Go(Point),
    /// Moves to a point until the probe touches, at the speed at which Z leaves its homing switch. No contact is an
    /// alarm.
    Probe(Point),
}

/// The machine behind the dialects. Nothing here waits.
pub trait Machine {
    /// The settings in force.
    fn settings(&self) -> &Settings;
    /// Returns the value of a setting that is kept in EEPROM alone. Takes up to 2 ms.
    fn cold(&mut self, setting: Setting) -> i32;
    /// Returns the value of any setting.
    fn setting(&mut self, setting: Setting) -> i32 {
        if setting.is_cold() { self.cold(setting) } else { self.settings().get(setting) }
    }
    /// Stores a value that [`Settings::check`] returned and lets it take effect, or refuses the value.
    /// [`Status::Again`] means what it means for [`Self::set_row`].
    fn set(&mut self, setting: Setting, value: i32) -> Result<Warning, Status>;
    /// Sets a value of the interpreter's tables. [`Status::Again`]: nothing is changed; try again when the tables are
    /// ready.
    fn set_row(&mut self, row: TableRow, axis: u8, value: Length) -> Result<(), Status>;
    /// Whether settings and rows that are set from now on last until the next start only, unless [`Self::keep`] stores
    /// them. What is set otherwise is stored at once.
    fn lend(&mut self, on: bool) {
        let _ = on;
    }
    /// Orders to be stored what has been lent. [`Status::Again`]: nothing is ordered; try again later.
    fn keep(&mut self) -> Status {
        Status::Ok
    }
    /// Takes back one setting that has been lent, so that it has its stored value again. [`Status::Again`]: there are
    /// more, or the machine does not rest.
    fn recall(&mut self) -> Status {
        Status::Ok
    }
    /// Sets the tool length on one axis, as G43.1 does.
    fn set_tool_length(&mut self, axis: u8, length: Length) -> Result<(), Status>;
    /// Returns the current value, in the unit that [`Value`] states.
    fn value(&mut self, value: Value) -> i32;
    /// Returns a value of the G-code model, as the last line that was read has left it. S is in whole turns per minute,
    /// or m/min with G96.
    fn programmed(&mut self, value: Value) -> i32;
    /// Makes all steps of one report or group describe the same moment: that of the first step that reads motion.
    /// `first`: whether this step begins the report or group.
    fn moment(&mut self, first: bool);
    /// Returns what the dialects remember of their reports.
    fn memory(&mut self) -> &mut Memory;
    /// Returns what the machine is doing.
    fn doing(&mut self) -> Doing;
    /// Returns the cycle that the machine is in, held or not.
    fn cycle(&mut self) -> Cycle;
    /// Returns the state of the hold.
    fn hold(&mut self) -> Hold;
    /// Returns the state of the program. Has a meaning only while the machine rests.
    fn rest(&mut self) -> Program;
    /// Restores the defaults of all settings and of what dialects remember, or refuses to. With `offsets`, those of all
    /// coordinate systems are to be stored as 0 with the settings, or not at all. Takes 10 ms on AVR.
    fn restore(&mut self, offsets: bool) -> Status;
    /// Raises an alarm, unless one at least as severe is on. It is reported with `reason`, but for a dialect in order not
    /// on the port itself.
    fn alarm(&mut self, alarm: Alarm, reason: Status);
    /// Ends the alarm, if one is on, or refuses to. [`Status::Again`]: not yet possible.
    fn clear(&mut self) -> Status;
    /// Drops what is queued, or refuses to.
    fn flush(&mut self) -> Status;
    /// Starts a built-in job. Number 0 ends the running one.
    fn start_job(&mut self, number: u8) -> Status;
    /// Homes the given axes (as bits) that have a homing switch, or refuses to. With `ends_alarm` it is not refused in
    /// an alarm, which ends if the homing begins. [`Status::Again`]: the machine still slows down.
    fn home(&mut self, axes: u8, ends_alarm: bool) -> Status;
    /// Turns check mode on or off, or refuses to. In check mode lines of G-code are checked but not run.
    fn check(&mut self, on: bool) -> Status;
    /// Holds motion as a feedhold does, also at rest, until a sender resumes it.
    fn hold_back(&mut self);
    /// Resets the machine once the pending output has been written: drops what has been received, and sends the
    /// greeting.
    fn start_over(&mut self);
    /// Starts to move an axis to a position in machine coordinates, or refuses to.
    fn jog(&mut self, axis: u8, place: Length) -> Status;
    /// Performs an operation on the stored program. [`Status::Again`]: it is not complete; call again.
    fn store(&mut self, what: Store<'_>) -> Result<(), Status>;
    /// Returns a byte of the stored program; `None` past its end, or without a program.
    fn program(&mut self, at: u16) -> Option<u8>;
    /// Returns a byte of a line that runs at each start; `None` past the end of the line.
    fn startup(&mut self, line: u8, at: u8) -> Option<u8>;
    /// Restarts the machine once the response has left. With `boot` it restarts into the boot loader, for which the
    /// machine has to be at rest. [`Status::Again`] while settings are still being written to memory.
    fn restart(&mut self, boot: bool) -> Status;
    /// Changes the overrides immediately.
    fn change_override(&mut self, change: Change);
    /// Turns the power of a motor on or off; of all motors for `None`.
    fn energize(&mut self, motor: Option<u8>, on: bool) -> Status;

    /// Returns the state of a heater: 0 the hot end, 1 the bed. `None` in an image without
    /// [`Capability::Printer`](crate::capability::Capability).
    fn heater(&mut self, heater: u8) -> Option<Standing>;
    /// Whether a line waits for a temperature (M109, M190, M116).
    fn waits_for_heat(&mut self) -> bool;
    /// Ends the wait for a temperature (M108), so that the lines after it are run.
    fn skip_wait(&mut self);
    /// Unlocks the heaters that a fault has locked (M999). Does not end the alarm: see [`Self::clear`].
    fn unlock_heaters(&mut self);

    /// Changes how the extruder moves, or moves it. [`Status::Again`]: nothing is changed; try again when the planner
    /// is free.
    fn extruder(&mut self, what: Extruder) -> Status {
        let _ = what;
        Status::NotBuiltIn
    }

    /// Sets the resonances of the axes until the next start. [`Status::Again`] means what it means for
    /// [`Self::extruder`].
    fn shape(&mut self, to: Resonances) -> Status {
        let _ = to;
        Status::NotBuiltIn
    }

    /// Starts to tune a heater (0 the hot end, 1 the bed) at `to` eighths of a degree, in `cycles` cycles. `uses`:
    /// whether the heater takes over the result. [`Status::Again`] means what it means for [`Self::extruder`].
    fn tune(&mut self, heater: u8, to: u16, cycles: u8, uses: bool) -> Status {
        let _ = (heater, to, cycles, uses);
        Status::NotBuiltIn
    }

    /// Returns the autotune that is running, or the last one.
    fn tuned(&mut self) -> Tune {
        Tune::IDLE
    }

    /// Changes the limit for moving cold filament. Returns the temperature that filament must have, in degrees, and
    /// whether it may be moved colder than that.
    fn extrude_cold(&mut self, change: Cold) -> (i16, bool) {
        let _ = change;
        (0, true)
    }

    /// Performs an operation on the SD card.
    fn card(&mut self, what: Op<'_>) -> Status {
        let _ = what;
        Status::NotBuiltIn
    }

    /// Returns the position in the selected file of the SD card, and the length of the file, in bytes. `None` without
    /// a file.
    fn card_progress(&mut self) -> Option<(u32, u32)> {
        None
    }

    /// Returns the name of the selected file, or of the one that is being written, padded with zeros; zeros without one.
    fn card_name(&mut self) -> [u8; NAME_MAX] {
        [0; NAME_MAX]
    }

    /// Whether lines of the selected file are being run.
    fn card_prints(&mut self) -> bool {
        false
    }

    /// Returns the file with that number on the SD card; `None` if there is none. `Err`: the card cannot be read.
    fn card_entry(&mut self, number: u8) -> Result<Option<Entry>, Status> {
        let _ = number;
        Err(Status::NotBuiltIn)
    }

    /// Returns the points of the bed; `None` in an image without
    /// [`Capability::BedPlane`](crate::capability::Capability).
    fn bed(&mut self) -> Option<&mut Bed> {
        None
    }

    /// Starts an operation on the bed. [`Status::Again`] means what it means for [`Self::extruder`].
    fn level(&mut self, what: Level) -> Status {
        let _ = what;
        Status::NotBuiltIn
    }

    /// Drops the G92 shift of the given axes (as bits): their origin is again the one that homing has set.
    fn clear_shift(&mut self, axes: u8) {
        let _ = axes;
    }

    /// Resumes what is held, or stopped by a program.
    fn go_on(&mut self) {}

    /// Whether lengths are in inches.
    #[inline(never)]
    #[small]
    fn inches(&mut self) -> bool {
        self.value(Value::Units) == 0
    }
}
