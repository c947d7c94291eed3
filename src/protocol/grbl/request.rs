//! Answers a line.
//!
//! A list is written before the `ok`, one part per step. A setting is answered when it is in memory, homing when the
//! machine is homed, a probing when it is over. Until then the step returns [`Next::Wait`]; this polling costs 2,000
//! cycles each millisecond.

#[cfg(feature = "sd")]
use super::card;
use super::command::{self, ALL, Command};
use super::report::{LOWERED, Report, SLEEPS};
use super::status::{BAD_JOG, BUSY, LOCKED, TOO_LONG, UNSUPPORTED, error_number};
#[cfg(feature = "language")]
use super::write::close;
use super::write::{fixed, int, line_end, message, text};
use super::{lists, settings};
use crate::capability::Capability;
use crate::gcode::modal::MotionMode;
use crate::gcode::tables::{SYSTEMS, TableRow};
use crate::machine::alarm::is_program_end;
use crate::machine::{Alarm, Cycle, Doing};
use crate::protocol::{Answers, Machine, Next, Out, STARTUP_MAX, Span, Store, Value, by_name};
use crate::status::Status;
use crate::units::{AXES, Length};
use crate::{plain, text};

/// A line that is being answered.
pub struct Request {
    command: Command,
    /// The progress of the command. Its meaning depends on the command.
    at: u8,
    /// The status with which G-code has run.
    status: Status,
    /// The G-code that has not run yet.
    block: Option<Span>,
    begun: bool,
    /// The status report that comes before the rest of the answer.
    report: Option<Report>,
    /// How much has been written of what the G-code tells.
    #[cfg(feature = "language")]
    said: u8,
}

/// The position after the last part of a list.
const END: u8 = u8::MAX;
/// G-code that has run has been dropped before it was answered.
const DROPPED: u8 = 2;
/// The line could not be kept.
const REFUSED: u8 = 1;
/// How much of what G-code tells is written in a step.
#[cfg(feature = "language")]
const SAID: u8 = 40;
/// A setting, or all settings, are being written to memory.
const STORES: u8 = 1;

/// The progress of a command.
pub(super) enum Step {
    /// Continue with this part at once.
    At(u8),
    /// Continue with this part later.
    Later(u8),
    /// Answer `ok`.
    Done,
    /// Answer with the error of this number.
    Error(u8),
}

impl Request {
    /// Starts to answer a line.
    #[inline(never)]
    pub(super) fn begin(line: &[u8]) -> Self {
        let command = command::of(line);
        let is_gcode = command == Command::Gcode;
        let block = is_gcode.then_some(Span { start: 0, end: line.len() as u8 });
        Self { block, ..Self::of(command) }
    }

    /// Starts to answer a line that could not be kept.
    pub(super) fn refused(status: Status) -> Self {
        Self { at: REFUSED, status, ..Self::of(Command::Gcode) }
    }

    /// Starts to answer a single `?`.
    pub(super) fn question() -> Self {
        Self { report: Some(Report::default()), ..Self::of(Command::Question) }
    }

    #[inline(always)]
    fn of(command: Command) -> Self {
        Self {
            command,
            at: 0,
            status: Status::Ok,
            block: None,
            begun: false,
            report: None,
            #[cfg(feature = "language")]
            said: 0,
        }
    }
}

#[small]
impl Answers for Request {
    fn gcode(&self) -> Option<Span> {
        self.block
    }

    fn ran(&mut self, status: Status, _comment: bool) {
        self.status = status;
        self.block = None;
    }

    #[inline(never)]
    fn step(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Next {
        if let Some(report) = &mut self.report {
            if !report.step(machine, out) {
                self.report = None;
            }
            return match (&self.report, self.command) {
                (None, Command::Question) => Next::Done(Status::Ok),
                _ => Next::More,
            };
        }
        if let Some(Span { start, end }) = self.block {
            return Next::Gcode { start, end };
        }
        #[cfg(feature = "language")]
        if self.command == Command::Gcode && self.tell(machine, out) {
            return Next::More;
        }
        match self.part(line, machine, out) {
            Step::At(at) => {
                (self.at, self.begun) = (at, true);
                Next::More
            }
            Step::Later(at) => {
                self.at = at;
                Next::Wait
            }
            Step::Done => {
                out.put_plain(plain!("ok\r\n"));
                Next::Done(Status::Ok)
            }
            Step::Error(number) => {
                if self.command == Command::Gcode {
                    hold_back(machine);
                }
                text(out, text!("error:"));
                int(out, number.into());
                line_end(out);
                Next::Done(self.status)
            }
        }
    }

    fn has_begun(&self) -> bool {
        self.begun
    }

    fn dropped(&mut self) {
        match self.command {
            // Nothing to do in the middle of a report, or before the block has run: the code that runs the block
            // refuses it.
            _ if self.report.is_some() || self.block.is_some() => {}
            Command::Gcode if self.at == 0 => self.at = DROPPED,
            Command::StoreStartup(_) if self.at != 0 => self.status = Status::Alarmed,
            Command::Gcode | Command::Nothing => {}
            _ if self.at == 0 && !self.begun => *self = Self::refused(Status::Alarmed),
            _ => {}
        }
    }

    fn interject(&mut self) -> bool {
        let ended = match self.command {
            Command::Settings | Command::Startup => true,
            #[cfg(feature = "sd")]
            Command::Files(_) => true,
            // The axes of a row are parts of one output line.
            Command::Offsets => self.at & 7 == 0,
            _ => !self.begun,
        };
        let free = ended && self.report.is_none();
        if free {
            self.report = Some(Report::default());
        }
        free
    }

    fn is_list(&self) -> bool {
        matches!(self.command, Command::Settings | Command::Offsets)
    }
}

#[cfg(feature = "language")]
impl Request {
    /// Writes a part of what the G-code tells. Returns false if there is none.
    fn tell(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        if self.status != Status::Ok || machine.said(0).is_none() {
            return false;
        }
        if self.said == 0 {
            text(out, text!("[MSG:"));
            self.begun = true;
        }
        for _ in 0..SAID {
            match machine.said(self.said) {
                Some(byte) => out.put(if matches!(byte, b' '..=b'~') { byte } else { b'?' }),
                None => {
                    close(out);
                    machine.hush();
                    break;
                }
            }
            self.said += 1;
        }
        true
    }
}

#[small]
impl Request {
    #[inline(never)]
    fn part(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
        let at = self.at;
        match self.command {
            Command::Nothing | Command::Question => Step::Done,
            Command::Unknown => Step::Error(UNSUPPORTED),
            Command::BadJog => Step::Error(BAD_JOG),
            Command::Gcode => self.gcode_done(line, machine, out),
            #[cfg(feature = "sd")]
            Command::Files(what) => {
                let name = command::trim(command::behind_equals(line));
                card::part(what, at, name, machine, out)
            }
            Command::Modes => match at {
                END => Step::Done,
                _ => Step::At(lists::modes(at, machine, out).unwrap_or(END)),
            },
            Command::Help => {
                if at == 0 {
                    text(out, text!("[HLP:$$ $# $G $I $N $x=val $Nx=line "));
                    return Step::At(END);
                }
                text(out, text!("$J=line $SLP $C $X $H ~ ! ? ctrl-x]\r\n"));
                self.command = Command::Nothing;
                Step::At(0)
            }
            Command::Hint => {
                message(out, text!("$ for help, {} for TinyG"));
                Step::Done
            }
            Command::Named(from) if by_name::find(command::name(line, from)).is_none() => {
                Step::Error(UNSUPPORTED)
            }
            // The commands from here on need the machine at rest or in an alarm.
            _ if at == 0 && self.command != Command::Unlock && !may_change(machine) => {
                let waits = match machine.doing() {
                    // The machine still slows down, or a reset has queued the end of the program.
                    Doing::Alarm(_) => true,
                    // Senders assume that the machine is at rest after the answer to a line without motion, because
                    // grbl answers it then. The command therefore waits for rest.
                    doing => doing == Doing::Runs && machine.value(Value::MovesLast) == 0,
                };
                if waits { Step::Later(0) } else { Step::Error(BUSY) }
            }
            Command::Settings => list_setting(at, machine, out),
            Command::Offsets => match at {
                END => Step::Done,
                _ => Step::At(lists::offsets(at, machine, out).unwrap_or(END)),
            },
            Command::Build => match at {
                END => Step::Done,
                _ => Step::At(lists::build(at, machine, out).unwrap_or(END)),
            },
            Command::Startup => match at {
                END => Step::Done,
                _ => Step::At(lists::startup(at, machine, out).unwrap_or(END)),
            },
            Command::StoreStartup(n) => self.store_startup(n, line, machine),
            Command::Set(number, from) => {
                let to = command::value(line, from);
                set(at, machine, out, |machine| settings::set(number, to, machine))
            }
            Command::Named(from) => named(at, line, from, machine, out),
            Command::Home(axis) => home(at, axis, machine),
            Command::Unlock => unlock(machine, out),
            Command::Check => check(at, machine, out),
            Command::Sleep => sleep(machine, out),
            Command::Restore(letter) => restore(at, letter, machine, out),
        }
    }

    /// `$N0=`. The line is run first, and stored if it is not refused.
    fn store_startup(&mut self, n: u8, line: &[u8], machine: &mut impl Machine) -> Step {
        const RUNS: u8 = 1;
        let text = command::behind_equals(line);
        let start = line.len() - text.len();
        if self.at == 0 {
            if machine.doing() != Doing::Rests {
                return Step::Error(BUSY);
            }
            if text.len() > STARTUP_MAX {
                return Step::Error(TOO_LONG);
            }
            self.block = Some(Span { start: start as u8, end: line.len() as u8 });
            return Step::Later(RUNS);
        }
        let number = error_number(self.status);
        if number != 0 {
            return Step::Error(number);
        }
        if machine.value(Value::Working) != 0 {
            return Step::Later(RUNS);
        }
        match machine.store(Store::Startup(n, text)) {
            Ok(()) => Step::Done,
            Err(Status::Again) => Step::Later(RUNS),
            Err(status) => Step::Error(error_number(status)),
        }
    }

    /// Ends the answer to a line of G-code. A probing is waited for, so that its `[PRB:]` comes before `ok`. The end
    /// of a program is waited for too, and the end of a pause, by which senders wait for the machine. A target beyond the travel raises an alarm, except in a jog and in check mode.
    fn gcode_done(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
        let is_beyond = self.status == Status::SoftLimit && command::jog(line).is_none();
        if is_beyond && machine.value(Value::Check) == 0 {
            machine.alarm(Alarm::Alarm, Status::SoftLimit);
            text(out, text!("ALARM:2\r\n"));
            message(out, text!("Reset to continue"));
            return Step::Error(LOCKED);
        }
        let number = error_number(self.status);
        if number != 0 {
            return Step::Error(number);
        }
        if crate::card::writes() {
            // The line has been written to a file.
            return Step::Done;
        }
        if self.at == DROPPED && command::jog(line).is_none() {
            // What the line waits for does not come any more.
            return Step::Error(refusal(machine).unwrap_or(LOCKED));
        }
        if is_program_end(line) && machine.value(Value::Check) == 0 {
            if machine.value(Value::Working) != 0 {
                return Step::Later(0);
            }
            message(out, text!("Pgm End"));
            return Step::Done;
        }
        if machine.value(Value::PausesLast) != 0 && machine.value(Value::Working) != 0 {
            return Step::Later(0);
        }
        if threads(machine) {
            return begins(machine);
        }
        // A probing mode in force from an earlier line counts only if this line moves.
        let probes =
            self.at == 0 && command::moves(line) && is_probing(machine.value(Value::MotionMode));
        let mut is = |value| machine.value(value) != 0;
        if probes && (is(Value::Working) || is(Value::ProbeUntold)) {
            return Step::Later(0);
        }
        Step::Done
    }
}

/// Holds the machine after a refused line, if the settings ask for it, so that the lines after it wait for the
/// sender.
#[inline(never)]
#[small]
fn hold_back(machine: &mut impl Machine) {
    let carries_out =
        !matches!(machine.doing(), Doing::Alarm(_)) && machine.value(Value::Check) == 0;
    if carries_out && machine.settings().holds_behind_errors() {
        machine.hold_back();
    }
}

/// Whether a motion mode is a probing.
fn is_probing(mode: i32) -> bool {
    let first = MotionMode::ProbeTowards as i32;
    let others = MotionMode::ProbeTowardsQuietly as i32..=MotionMode::ProbeAwayQuietly as i32;
    mode == first || others.contains(&mode)
}

/// Whether a motion mode is a thread.
fn is_threading(mode: i32) -> bool {
    (MotionMode::Thread as i32..=MotionMode::RigidTap as i32).contains(&mode)
}

/// Whether the motion mode is a thread.
fn threads(machine: &mut impl Machine) -> bool {
    Capability::Lathe.is_built_in() && is_threading(machine.value(Value::MotionMode))
}

/// Returns the number of the error with which the pass of a thread has been refused; `None` if there is no such pass.
#[inline(never)]
#[small]
fn refusal(machine: &mut impl Machine) -> Option<u8> {
    if threads(machine) { refusal_of(machine.value(Value::Pass)) } else { None }
}

/// As [`refusal`], for the value of [`Value::Pass`], which tells a refusal once.
fn refusal_of(pass: i32) -> Option<u8> {
    let refusals = [Status::NoIndex, Status::NoSync, Status::WrongWay, Status::VelocityExceeded];
    refusals.into_iter().find(|status| *status as i32 == pass).map(error_number)
}

/// Waits until the pass of a thread has begun. Only then the line is answered, because until then it can be refused.
#[inline(never)]
#[small]
fn begins(machine: &mut impl Machine) -> Step {
    let pass = machine.value(Value::Pass);
    if pass == Status::Ok as i32 {
        return Step::Done;
    }
    if let Some(number) = refusal_of(pass) {
        return Step::Error(number);
    }
    let waits = machine.value(Value::Working) != 0 && machine.value(Value::Check) == 0;
    if waits { Step::Later(0) } else { Step::Done }
}

/// Whether settings may be read and changed: at rest (also in check mode), also in an alarm.
#[small]
fn may_change(machine: &mut impl Machine) -> bool {
    let stopped = machine.cycle() == Cycle::Stopped;
    !stopped
        && match machine.doing() {
            Doing::Rests => true,
            Doing::Alarm(_) => machine.value(Value::Working) == 0,
            _ => false,
        }
}

/// Writes a row of `$$`.
#[inline(never)]
#[small]
fn list_setting(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    let axes = settings::axes(machine);
    let Some(number) = settings::number(at, axes) else { return Step::Done };
    if let Some(value) = settings::value(number, machine) {
        out.put(b'$');
        int(out, number.into());
        out.put(b'=');
        fixed(out, value);
        line_end(out);
    }
    Step::At(at + 1)
}

/// `$name` reads a setting, `$name=v` sets it.
#[inline(never)]
#[small]
fn named(at: u8, line: &[u8], from: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    let found = by_name::find(command::name(line, from));
    let Some(setting) = found else { return Step::Error(UNSUPPORTED) };
    if from != 0 {
        let to = command::value(line, from);
        return set(at, machine, out, |machine| settings::set_named(setting, to, machine));
    }
    by_name::write(setting, machine, out);
    line_end(out);
    Step::Done
}

/// `$x=v` or `$name=v`, stored by `set`. Answered when the value is in memory.
#[inline(never)]
#[small]
fn set<M: Machine>(
    at: u8,
    machine: &mut M,
    out: &mut impl Out,
    set: impl FnOnce(&mut M) -> Result<(), Status>,
) -> Step {
    if at == STORES {
        if machine.value(Value::Kept) == 0 {
            return Step::Later(STORES);
        }
        if machine.memory().grbl.note(LOWERED, false) {
            message(out, text!("Max rate lowered to what the motors can do"));
        }
        return Step::Done;
    }
    match set(machine) {
        Ok(()) => Step::Later(STORES),
        Err(Status::Again) => Step::Later(0),
        // grbl's errors 33 and 12 speak of a target and a rate, so they do not fit a bad value.
        Err(Status::OutOfRange | Status::AboveMaximum) => Step::Error(UNSUPPORTED),
        Err(status) => Step::Error(error_number(status)),
    }
}

/// `$H`: homes, which ends an alarm, and waits until homing is over. If it is refused the alarm stays.
#[inline(never)]
#[small]
fn home(at: u8, axis: u8, machine: &mut impl Machine) -> Step {
    const HOMES: u8 = 1;
    const FAILED: u8 = 2;
    const TOLD: u8 = 12;
    if at == HOMES {
        if matches!(machine.doing(), Doing::Homes | Doing::Holds | Doing::Door) {
            return Step::Later(HOMES);
        }
        let done = match axis {
            ALL => machine.value(Value::Home),
            axis => machine.value(Value::Homed(axis)),
        };
        if done == 1 {
            return Step::Done;
        }
        // After a failed homing the position is unknown.
        machine.alarm(Alarm::Alarm, Status::HomingFailed);
        return Step::Later(FAILED);
    }
    if at >= FAILED {
        // Gives the reporter time to send the cause first.
        return if at < TOLD { Step::Later(at + 1) } else { Step::Error(LOCKED) };
    }
    let axes = if axis == ALL { ALL } else { 1 << axis };
    match machine.home(axes, true) {
        Status::Ok => {
            machine.memory().grbl.note(SLEEPS, false);
            Step::Later(HOMES)
        }
        Status::Again => Step::Later(0),
        status => Step::Error(error_number(status)),
    }
}

/// `$X`: ends an alarm.
#[inline(never)]
#[small]
fn unlock(machine: &mut impl Machine, out: &mut impl Out) -> Step {
    if !matches!(machine.doing(), Doing::Alarm(_)) {
        return Step::Done;
    }
    match machine.clear() {
        Status::Ok => {
            machine.memory().grbl.note(SLEEPS, false);
            message(out, text!("Caution: Unlocked"));
            Step::Done
        }
        Status::Again => Step::Later(0),
        status => Step::Error(error_number(status)),
    }
}

/// `$C`: toggles check mode. Leaving it resets the machine.
#[inline(never)]
#[small]
fn check(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    const LEAVES: u8 = 1;
    if at == LEAVES {
        machine.start_over();
        return Step::Done;
    }
    if matches!(machine.doing(), Doing::Alarm(_)) {
        return Step::Error(BUSY);
    }
    let on = machine.value(Value::Check) == 0;
    match machine.check(on) {
        Status::Ok => {
            message(out, if on { text!("Enabled") } else { text!("Disabled") });
            if on { Step::Done } else { Step::At(LEAVES) }
        }
        status => Step::Error(error_number(status)),
    }
}

/// `$SLP`: turns the motors off. Nothing moves until a reset or `$X`.
#[inline(never)]
#[small]
fn sleep(machine: &mut impl Machine, out: &mut impl Out) -> Step {
    if machine.value(Value::Check) != 0 {
        return Step::Error(BUSY);
    }
    machine.alarm(Alarm::Alarm, Status::Alarmed);
    if machine.energize(None, false) != Status::Ok {
        return Step::Later(0);
    }
    machine.memory().grbl.note(SLEEPS, true);
    message(out, text!("Sleeping"));
    Step::Done
}

/// `$RST=`: restores settings, offsets, or both. Answered when they are in memory. Settings come first, because they
/// alone can be refused: then nothing has changed.
#[inline(never)]
#[small]
fn restore(at: u8, letter: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    const SETTINGS: u8 = 2;
    const TOLD: u8 = 3;
    /// The first value of the coordinate systems to be cleared. Each value is a part.
    const ROWS: u8 = 8;
    match at {
        0 => Step::Later(if letter == b'#' { ROWS } else { SETTINGS }),
        STORES if machine.value(Value::Kept) == 0 => Step::Later(STORES),
        STORES => {
            message(out, text!("Restoring defaults"));
            Step::At(TOLD)
        }
        SETTINGS => match machine.restore(letter == b'*') {
            Status::Ok => Step::Later(if letter == b'*' { ROWS } else { STORES }),
            status => Step::Error(error_number(status)),
        },
        TOLD => Step::Done,
        at => {
            let (row, axis) = ((at - ROWS) / AXES as u8, (at - ROWS) % AXES as u8);
            if row >= SYSTEMS {
                return Step::Later(STORES);
            }
            match machine.set_row(TableRow::system(row), axis, Length::ZERO) {
                Ok(()) => Step::Later(at + 1),
                Err(Status::Again) => Step::Later(at),
                Err(status) => Step::Error(error_number(status)),
            }
        }
    }
}
