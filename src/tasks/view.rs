//! The machine as the protocol sees it: access to the links, with one borrow at a time.
//!
//! A new view is made for each step of a response or report, and never kept across an `.await`. Positions and speed
//! come from exec's snapshot while something runs, and from the G-code model otherwise. All steps of one report or
//! group share the [`Seen`] state of the first of them that read motion ([`Port::seen`]).

#[cfg(feature = "bed-plane")]
mod bed;
#[cfg(feature = "sd")]
mod card;
mod cycles;
#[cfg(feature = "dialect-reprap")]
mod extruder;
mod settings;
mod values;

use kerf_macros::small;

use core::cell::{OnceCell, RefMut};

use super::alarm;
use super::common::{snapshot, with};
use super::drivers;
use super::heat;
use super::hold;
use super::homing;
use super::links::{Changes, Links};
use super::origin;
use super::overrides;
use super::ports::{Port, RESET};
use super::power;
use super::setup::counted;
use super::spindle;
use super::switches;
use crate::boards::{MOTORS, inputs, outputs};
use crate::capability::Capability;
#[cfg(feature = "sd")]
use crate::card::{Entry, NAME_MAX, Op};
#[cfg(feature = "bed-plane")]
use crate::config::bed::Bed;
#[cfg(feature = "dialect-reprap")]
use crate::config::shape::Resonances;
use crate::config::{Setting, Settings};
use crate::gcode::command::Motion;
use crate::gcode::overrides::Change;
use crate::gcode::setup::Setup as _;
use crate::gcode::tables::TableRow;
use crate::hal::eeprom::Eeprom;
use crate::hal::event::Event;
use crate::hal::{Thread, flags, inputs as pins, stepper};
use crate::heat::Standing;
#[cfg(feature = "dialect-reprap")]
use crate::heat::tune::Tune;
use crate::jobs::LINE_MAX;
use crate::machine::{self, Alarm, Cycle, Doing};
use crate::motion::queue;
use crate::motion::snapshot::{Moment, Program};
#[cfg(feature = "bed-plane")]
use crate::protocol::Level;
#[cfg(feature = "dialect-reprap")]
use crate::protocol::{Cold, Extruder};
use crate::protocol::{Hold, Machine, Memory, Remembers, Store, Value, Warning, thousandths};
use crate::status::Status;
use crate::store::kept::ITEMS;
use crate::store::program::{self, Startup};
use crate::units::Length;

/// Whether something moves.
#[small]
pub fn moves(doing: Doing, hold: Hold) -> bool {
    match doing {
        Doing::Holds | Doing::Door => hold != Hold::Rests,
        Doing::Runs | Doing::Probes | Doing::Homes | Doing::Jogs => true,
        Doing::Rests | Doing::Alarm(_) => false,
    }
}

/// The least `qr` that is reported. Delayed responses show that the queue is full. If CNCjs reads five or less, it
/// withholds the last response, and loses it if it is paused meanwhile.
const QUEUE_FREE_MIN: usize = 6;

/// A view of the machine.
pub struct View<'a> {
    links: &'a Links,
    port: &'a Port,
    settings: RefMut<'a, Settings>,
    report: RefMut<'a, Memory>,
    seen: OnceCell<Seen>,
    /// Values are those of the moment at which the report or group first told of motion.
    shares: bool,
}

/// The state of the machine at one moment.
#[derive(Clone, Copy)]
pub struct Seen {
    motion: Moment,
    /// A line was being carried out.
    carries_out: bool,
    /// The outputs that were on.
    outputs: u8,
}

impl Seen {
    /// Returns the present state of the machine. Thread mode.
    fn now(links: &Links, settings: &Settings) -> Self {
        // In this order, because exec may begin a queued block in between.
        let (taken, queued) = (!links.command_sender().is_free(), has_moves(links));
        let mut motion = snapshot(links.thread).moment();
        let runs = queued || motion.running;
        if !runs {
            motion.origin = origin::read(settings, &links.model.borrow());
        }
        Self { motion, carries_out: taken || runs, outputs: spindle::on() }
    }
}

/// Whether moves wait for more, or blocks in the queue.
fn has_moves(links: &Links) -> bool {
    links.moves_wait.get() || queue::used() > 0
}

/// Whether a line waits to be carried out, or a block of it.
fn is_queued(links: &Links) -> bool {
    !links.command_sender().is_free() || has_moves(links)
}

#[small]
impl<'a> View<'a> {
    /// Returns a view for the sender on this port.
    pub fn of(links: &'a Links, port: &'a Port) -> Self {
        Self {
            links,
            port,
            settings: links.settings.borrow_mut(),
            report: links.report.borrow_mut(),
            seen: OnceCell::new(),
            shares: false,
        }
    }

    /// Returns the state of the machine. Cost: 6,000 cycles for the first value of motion in a report or group, 700 for
    /// further ones.
    fn seen(&self) -> &Seen {
        self.seen.get_or_init(|| {
            let shared = if self.shares { self.port.seen.get() } else { None };
            shared.unwrap_or_else(|| {
                let seen = Seen::now(self.links, &self.settings);
                if self.shares {
                    self.port.seen.set(Some(seen));
                }
                seen
            })
        })
    }

    fn motion(&self) -> &Moment {
        &self.seen().motion
    }

    /// Whether anything is queued or runs, or a hold or check mode is on.
    pub fn is_busy(&self) -> bool {
        machine::is_held() || machine::is_checking() || self.has_work()
    }

    /// Whether nothing moves because a dwell is under way, or because a line waits for something else than motion.
    pub fn dwells(&self) -> bool {
        with(self.links.thread, |state| match state.motion.running {
            false => queue::used() == 0,
            true => state.motion.length.to_bits() == 0,
        })
    }

    /// Whether the machine stood still when a report began, and no line has been taken since: another port may feed it.
    fn stands(&self) -> bool {
        let has_begun = || self.seen.get().is_some() && self.works_now();
        !self.is_busy() && !has_begun()
    }

    /// Whether anything is queued or runs.
    pub fn has_work(&self) -> bool {
        self.carries_out() || !self.links.job.get().is_none()
    }

    /// Whether a line is being carried out.
    pub fn carries_out(&self) -> bool {
        if self.shares || self.seen.get().is_some() {
            return self.seen().carries_out;
        }
        self.works_now()
    }

    /// Whether a line is being carried out at the moment. Takes no positions, which would cost 6,000 cycles.
    #[inline(never)]
    fn works_now(&self) -> bool {
        is_queued(self.links) || with(self.links.thread, |state| state.motion.running)
    }

    /// Whether a built-in job has been carried out to its end.
    pub fn has_done_job(&self) -> bool {
        self.links.job.get().is_over() && !self.carries_out()
    }

    /// Whether a hold is on that senders are to see.
    fn is_held(&self) -> bool {
        machine::shows_hold(|| self.has_work())
    }

    /// Returns the machine position of an axis.
    fn position(&self, axis: usize) -> Length {
        let programmed = self.links.model.borrow().position().get(axis).copied();
        let programmed = programmed.unwrap_or(Length::ZERO);
        // Until the planner has computed steps again, they are those of the settings before the change.
        if self.stands() || self.links.changes.has(Changes::STEPS) {
            return programmed;
        }
        // The position of an axis without a motor is that of the last line.
        let at = counted(&self.settings, &self.motion().position, axis, None);
        #[cfg(feature = "bed-plane")]
        let at = at.map(|at| bed::lowered(self, axis, at));
        at.unwrap_or(programmed)
    }

    /// Returns `home`: 2 while homing, 1 when all axes that have a homing switch are homed, else 0.
    fn home_state(&self) -> i32 {
        if machine::cycle() == Cycle::Homing {
            return 2;
        }
        let axes = homing::axes(&self.settings);
        let model = self.links.model.borrow();
        let homed = (0..homing::AXES).all(|axis| axes & 1 << axis == 0 || model.is_homed(axis));
        (axes != 0 && homed).into()
    }

    /// Whether the machine is idle, so that an action other than a line may begin. If not, the error is the reason. An
    /// alarm does not count if the action `ends_alarm`.
    fn may_begin(&self, ends_alarm: bool) -> Result<(), Status> {
        let alarm = machine::alarm();
        if alarm != Alarm::None && !ends_alarm {
            return Err(alarm.status());
        }
        if self.is_busy() || self.has_others() {
            return Err(Status::NotAccepted);
        }
        if Capability::Drivers.is_built_in() { self.settings.drives() } else { Ok(()) }
    }

    /// Does what [`Links::may_feed`] does, for callers that have a view already: there is one at a time.
    pub fn may_feed(&mut self) -> bool {
        let links = self.links;
        if self.port.number == links.feeder.get() {
            return true;
        }
        let waits = links.feeder().lines.borrow().has_data();
        let free = !waits && !crate::card::is_in_use() && !self.is_busy();
        if free {
            links.feeder.set(self.port.number);
            // Nothing has been reported to the new feeder yet.
            self.report.refresh();
        }
        free
    }

    /// Whether lines of G-code wait that are carried out first. Where lines are answered in their order, lines of the
    /// port itself come later and do not count.
    fn has_others(&self) -> bool {
        let in_order = self.port.speech.get().is_in_order() || self.port.is_plain();
        self.links.ports.iter().any(|port| {
            !(in_order && port.number == self.port.number) && port.lines.borrow().has_data()
        })
    }

    /// Whether settings and offsets may change. They may not in check mode, in which a file may set them.
    fn may_set(&self) -> Result<(), Status> {
        if machine::is_checking() { Err(Status::NotAccepted) } else { Ok(()) }
    }

    /// Hands the planner an action other than a line. The port that requested it becomes the feeder.
    #[inline(never)]
    fn begin(&mut self, motion: Motion, cycle: machine::Event) -> Status {
        let links = self.links;
        if links.feeder.replace(self.port.number) != self.port.number {
            // Nothing has been reported to the new feeder yet.
            self.report.refresh();
        }
        let mut commands = links.command_sender().slot();
        commands.clear();
        commands.motion = motion;
        machine::carry_out(self.links.thread, cycle);
        links.command_sender().send();
        Status::Ok
    }

    /// Orders a setting to be saved, and if it has changed `others` also those that may have changed.
    fn note(&self, setting: Setting, others: bool) {
        let storage = self.links.storage;
        storage.note(setting.number(), 1);
        if others {
            storage.note(0, ITEMS);
        }
    }

    #[inline(never)]
    fn offset(&self, axis: usize) -> Length {
        let model = self.links.model.borrow();
        origin::offset(axis, &self.motion().origin, &self.settings, &model)
    }

    /// Whether this output is on, or was at the moment of the report.
    #[inline(never)]
    fn is_on(&self, output: u8) -> i32 {
        (self.seen().outputs & output != 0).into()
    }

    /// Has the planner tell exec of the origin before the next line.
    fn note_origin(&self) {
        self.links.changes.note(Changes::ORIGIN);
    }

    /// Returns 1 if a switch is worked, 0 if not, -1 if there is no switch or it is off.
    fn input(&self, input: u8) -> i32 {
        let off = usize::from(input) < inputs::ENDS && switches::mode(&self.settings, input) == 0;
        if off || (switches::WIRED & !pins::left_out()) >> input & 1 == 0 {
            return -1;
        }
        (pins::worked(self.links.thread.level()) >> input & 1).into()
    }

    fn standing(&self, heater: u8) -> Standing {
        heat::standing(self.links, heater).unwrap_or_default()
    }

    /// Returns S, in thousandths of a turn a minute: that of the spindle while it turns, else that of the last S word.
    #[inline(never)]
    fn programmed_speed(&self) -> i32 {
        let now = self.motion().speed;
        let is_off = now.to_bits() == 0 && self.is_on(outputs::SPINDLE) == 0;
        thousandths(if is_off { self.links.model.borrow().spindle_speed() } else { now })
    }
}

#[small]
impl Machine for View<'_> {
    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn cold(&mut self, setting: Setting) -> i32 {
        self.links.storage.cold(setting)
    }

    fn set(&mut self, setting: Setting, value: i32) -> Result<Warning, Status> {
        settings::set(self, setting, value)
    }

    fn set_row(&mut self, row: TableRow, axis: u8, value: Length) -> Result<(), Status> {
        self.may_set()?;
        self.note_origin();
        self.links.model.borrow_mut().set(row, axis, value)
    }

    fn set_tool_length(&mut self, axis: u8, length: Length) -> Result<(), Status> {
        self.may_set()?;
        self.note_origin();
        self.links.model.borrow_mut().set_tool_length(axis, length)
    }

    fn change_override(&mut self, change: Change) {
        overrides::change(self.links.thread, change);
    }

    fn value(&mut self, value: Value) -> i32 {
        values::value(self, value)
    }

    fn programmed(&mut self, value: Value) -> i32 {
        values::modal(self, value)
    }

    fn moment(&mut self, first: bool) {
        if first {
            self.port.seen.set(None);
        }
        self.shares = true;
        self.seen = OnceCell::new();
    }

    fn memory(&mut self) -> &mut Memory {
        &mut self.report
    }

    fn doing(&mut self) -> Doing {
        // A jog of G-code ends when nothing of it is left now, whatever moment a report is about.
        if machine::cycle() == Cycle::Jog && !self.works_now() {
            machine::carry_out(self.links.thread, machine::Event::Done);
        }
        machine::doing(|| self.has_work())
    }

    fn cycle(&mut self) -> Cycle {
        machine::cycle()
    }

    fn hold(&mut self) -> Hold {
        match self.is_held() {
            false => Hold::None,
            true if machine::is_locked() => Hold::Rests,
            true if self.motion().held && !machine::is_resuming() => Hold::Rests,
            true => Hold::Slows,
        }
    }

    fn rest(&mut self) -> Program {
        self.motion().program
    }

    fn restore(&mut self, offsets: bool) -> Status {
        settings::restore(self, offsets)
    }

    fn alarm(&mut self, alarm: Alarm, reason: Status) {
        // An alarm that another port has ended since the line arrived does not begin again.
        let port = self.port;
        if !port.has_stopped.get() || self.links.cleared_by.get() == port.number {
            let by = if port.speech.get().is_in_order() { port.number } else { alarm::NO_PORT };
            alarm::raise_by(self.links, alarm, reason, by);
        }
    }

    fn clear(&mut self) -> Status {
        self.links.cleared_by.set(self.port.number);
        // An alarm that has begun while the line waits for rest is not the one that the line is to end.
        let meant = self.port.clears.get();
        if meant.is_on() && meant.is_exceeded_by(machine::alarm()) {
            self.port.clears.set(Alarm::None);
            return machine::alarm().status();
        }
        let status = alarm::clear(self.links, &self.settings);
        self.port.clears.set(if status == Status::Again { machine::alarm() } else { Alarm::None });
        status
    }

    fn flush(&mut self) -> Status {
        if !machine::is_held() && (self.has_work() || self.links.has_data()) {
            return Status::NotAccepted;
        }
        hold::flush_here(self.links.thread);
        Status::Ok
    }

    fn start_job(&mut self, number: u8) -> Status {
        cycles::start_job(self, number)
    }

    fn home(&mut self, axes: u8, ends_alarm: bool) -> Status {
        cycles::home(self, axes, ends_alarm)
    }

    fn check(&mut self, on: bool) -> Status {
        cycles::check(self, on)
    }

    fn heater(&mut self, heater: u8) -> Option<Standing> {
        heat::standing(self.links, heater)
    }

    fn waits_for_heat(&mut self) -> bool {
        self.links.heat.waits()
    }

    fn skip_wait(&mut self) {
        self.links.heat.end_wait();
    }

    fn unlock_heaters(&mut self) {
        heat::unlock(&mut self.settings);
    }

    fn hold_back(&mut self) {
        // An earlier tilde does not end this hold.
        self.links.signs.clear();
        self.links.signs.door.set(false);
        machine::take(self.links.thread, machine::Event::Hold);
    }

    fn start_over(&mut self) {
        // A `^x` that has come while the line is answered is enough.
        if !self.port.is_resetting() {
            self.port.ask(RESET);
            flags::set(Event::Realtime);
        }
    }

    #[cfg(feature = "dialect-reprap")]
    fn extruder(&mut self, what: Extruder) -> Status {
        extruder::extruder(self, what)
    }

    #[cfg(feature = "dialect-reprap")]
    fn shape(&mut self, to: Resonances) -> Status {
        extruder::shape(self, to)
    }

    #[cfg(feature = "dialect-reprap")]
    fn tune(&mut self, heater: u8, to: u16, cycles: u8, uses: bool) -> Status {
        extruder::tune(self, heater, to, cycles, uses)
    }

    #[cfg(feature = "dialect-reprap")]
    fn tuned(&mut self) -> Tune {
        heat::tune(&self.links.heat)
    }

    #[cfg(feature = "dialect-reprap")]
    fn extrude_cold(&mut self, change: Cold) -> (i16, bool) {
        heat::extrude_cold(&self.links.heat, &mut self.settings, change)
    }

    #[cfg(feature = "sd")]
    fn card(&mut self, what: Op<'_>) -> Status {
        card::card(self, what)
    }

    #[cfg(feature = "sd")]
    fn card_progress(&mut self) -> Option<(u32, u32)> {
        self.links.card.borrow().progress()
    }

    #[cfg(feature = "sd")]
    fn card_name(&mut self) -> [u8; NAME_MAX] {
        self.links.card.borrow().name()
    }

    #[cfg(feature = "sd")]
    fn card_prints(&mut self) -> bool {
        crate::card::prints()
    }

    #[cfg(feature = "sd")]
    fn card_entry(&mut self, number: u8) -> Result<Option<Entry>, Status> {
        let mut card = self.links.card.borrow_mut();
        if crate::card::is_in_use() { Err(Status::NotAccepted) } else { card.entry(number) }
    }

    #[cfg(feature = "bed-plane")]
    fn bed(&mut self) -> Option<&mut Bed> {
        self.settings.bed.first_mut()
    }

    #[cfg(feature = "bed-plane")]
    fn level(&mut self, what: Level) -> Status {
        bed::level(self, what)
    }

    #[cfg(feature = "dialect-reprap")]
    fn clear_shift(&mut self, axes: u8) {
        self.links.model.borrow_mut().clear_shift(axes);
        self.note_origin();
    }

    #[cfg(feature = "dialect-reprap")]
    fn lend(&mut self, on: bool) {
        self.links.storage.lend(on);
    }

    #[cfg(feature = "dialect-reprap")]
    fn keep(&mut self) -> Status {
        self.links.storage.keep()
    }

    #[cfg(feature = "dialect-reprap")]
    fn recall(&mut self) -> Status {
        extruder::recall(self)
    }

    #[cfg(feature = "dialect-reprap")]
    fn go_on(&mut self) {
        self.links.signs.resume.set(true);
        hold::go_on(self.links);
    }

    fn jog(&mut self, axis: u8, place: Length) -> Status {
        cycles::jog(self, axis, place)
    }

    fn store(&mut self, what: Store<'_>) -> Result<(), Status> {
        if self.is_busy() {
            return Err(Status::NotAccepted);
        }
        if matches!(what, Store::Line(line) if line.len() > LINE_MAX) {
            return Err(Status::InputTooLong);
        }
        self.links.storage.store(what)
    }

    fn program(&mut self, at: u16) -> Option<u8> {
        let memory = Eeprom::of(self.links.thread);
        program::find(&memory)?.byte(&memory, at)
    }

    fn startup(&mut self, line: u8, at: u8) -> Option<u8> {
        let memory = Eeprom::of(self.links.thread);
        let line = Startup::find(&memory, line)?;
        (at < line.len()).then(|| line.byte(&memory, at))
    }

    fn restart(&mut self, boot: bool) -> Status {
        if boot && self.is_busy() {
            return Status::NotAccepted;
        }
        if !self.links.storage.is_done() {
            return Status::Again;
        }
        self.links.restart.set(Some(boot));
        Status::Ok
    }

    fn energize(&mut self, motor: Option<u8>, on: bool) -> Status {
        // Without power a motor that moves would lose its position.
        if !on && (self.has_work() || machine::is_checking()) {
            return Status::NotAccepted;
        }
        let motors = motor.map_or(u8::MAX, |motor| 1 << motor);
        if on {
            power::energize(self.links.thread, motors)
        } else {
            power::release(self.links.thread, motors)
        }
        Status::Ok
    }
}

/// Returns how many blocks of the planner are free, as reported to senders.
#[small]
pub fn queue_free() -> usize {
    queue::free().max(QUEUE_FREE_MIN)
}

/// Applies the settings of outputs and inputs.
#[small]
pub fn set_hardware(thread: Thread, settings: &Settings) {
    switches::set_up(thread, settings);
    power::set_modes(thread, settings);
    stepper::set_inverted(thread, motors(|m| settings.motor_reversed(m)));
    stepper::set_step_output(
        thread,
        settings.step_pulse_us(),
        motors(|m| settings.step_inverted(m)),
    );
    drivers::tell(thread, settings);
}

/// Returns the motors for which `is` is true, as bits.
#[small]
fn motors(is: impl Fn(usize) -> bool) -> u8 {
    let mut bits = 0;
    for motor in 0..MOTORS {
        bits |= u8::from(is(motor)) << motor;
    }
    bits
}
