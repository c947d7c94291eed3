//! Heaters and the fan, controlled within the turns of the power task.
//!
//! Owns the converter, the pins of heaters and fan, and [`Heaters`]. Reads the targets that exec has set ([`Orders`] in
//! `tasks::common`). A turn comes every 20 ms. It takes the reading of one heater and begins that of the other, so that
//! each heater has a reading every 40 ms, and a step of its control every 200 ms. Heater pins change in these turns
//! only. Their power is set by PWM of the chip ([`PULSED`]), or spread over the turns. The power task feeds the
//! watchdog in the same turn: if the watchdog is not fed, the chip resets within half a second, with the heaters off.
//!
//! An autotune ([`tune`](crate::heat::tune)) is a wait: later lines wait for its end. M108, a flush or an alarm end it,
//! too. Moving filament while the hot end is more than 10 degrees below its minimum raises an alarm.
//!
//! A fault ([`heater`](crate::heat::heater), [`fault`](crate::heat::fault)) switches all heaters off in its turn,
//! [locks](lock) them, and raises an alarm. Any alarm switches them off. While a wait is on ([`Heaters::begin_wait`]),
//! the planner is woken when the wait is over.
//!
//! The fan of the heatbreak ([`cooler`]), on boards that have one, is decided at each reading of the hot end, also in
//! an alarm.
//!
//! Thread mode. Cost of a turn: 3,500 cycles; 8,000 in every fifth turn. A late turn switches the heaters late. Under
//! the hardest motion a turn may be half a second late, because thread mode has little of the CPU.

use core::cell::{Cell, RefCell};

use kerf_macros::small;

use super::alarm;
use super::common;
use super::links::Links;
use super::setup::moved_by;
use super::storage::Storage;
use crate::boards::{COOLS, PULSED};
use crate::capability::Capability;
use crate::config::groups::hot_end;
use crate::config::{Owner, Setting, Settings};
use crate::gcode::heating::{Heat, Part, Wait};
use crate::gcode::printing::EXTRUDER;
use crate::hal::event::Event;
use crate::hal::{Thread, flags, heaters};
use crate::heat::control::{FULL, level};
use crate::heat::cooler;
use crate::heat::heater::{Heater, Seen, in_units};
use crate::heat::sensor::UNIT;
use crate::heat::tune::{Found, Stage, Tune};
use crate::heat::{HEATERS, Orders, PRINTERS, Standing};
use crate::machine::{self, Alarm};
#[cfg(feature = "dialect-reprap")]
use crate::protocol::Cold;
use crate::status::Status;

/// A temperature this near to the target counts as reached, 1/64 degree.
const NEAR: i16 = UNIT + UNIT / 2;
/// For how many steps the temperature must stay reached: 3 s.
const STAYS: u8 = 15;
/// By how much the hot end may be below the minimum for planning a move while filament moves, 1/64 degree. So a
/// temperature that oscillates does not stop queued moves.
const GRACE: i16 = 10 * UNIT;
/// For how many turns a fan that is switched on gets full power to start: 200 ms.
const KICK: u8 = 10;

/// The state of heaters that tasks share. Thread mode.
pub struct Heaters {
    parts: [Parts; PRINTERS],
}

/// The state of a machine with heaters.
struct Parts {
    heaters: RefCell<[Heater; HEATERS]>,
    /// What the planner waits for.
    awaited: Cell<Heat>,
    /// For how many steps the awaited temperature has been reached.
    stays: Cell<u8>,
    /// The heater whose reading has been begun.
    next: Cell<u8>,
    /// For how many turns the fan still gets full power; in `owed`, the accumulator of its
    /// [`spread`](crate::heat::control::spread).
    kick: Cell<u8>,
    owed: Cell<u8>,
    /// Whether the fan of the heatbreak turns, on a board that has one.
    cools: [Cell<bool>; COOLS as usize],
    /// The requested cycles of an autotune, and whether the heater is to take over its factors.
    asked: Cell<(u8, bool)>,
    /// The autotune under way, or the last one.
    tune: RefCell<Tune>,
    /// The number of the heater that is tuned, plus 1; 0 when the autotune and the saving of its factors are done.
    tuned: Cell<u8>,
    /// How many of its factors have been written to the settings.
    kept: Cell<u8>,
    /// Cycle and stage of the autotune in the last report.
    told: Cell<(u8, Stage)>,
}

#[small]
impl Parts {
    const fn new() -> Self {
        Self {
            heaters: RefCell::new([Heater::OFF; HEATERS]),
            awaited: Cell::new(Heat { part: Part::HotEnd, to: None, wait: Wait::Nothing }),
            stays: Cell::new(0),
            next: Cell::new(0),
            kick: Cell::new(0),
            owed: Cell::new(0),
            cools: [const { Cell::new(false) }; COOLS as usize],
            asked: Cell::new((0, false)),
            tune: RefCell::new(Tune::IDLE),
            tuned: Cell::new(0),
            kept: Cell::new(0),
            told: Cell::new((0, Stage::Idle)),
        }
    }

    /// Returns the power of the fan's pin until the next turn.
    fn turn_fan(&self, speed: u8) -> u8 {
        if speed == 0 {
            self.kick.set(KICK);
            return 0;
        }
        let (left, mut owed) = (self.kick.get(), self.owed.get());
        self.kick.set(left.saturating_sub(1));
        let [_, _, pulsed] = PULSED;
        let power = level(pulsed, &mut owed, speed);
        self.owed.set(owed);
        if left > 0 { FULL } else { power }
    }

    /// Switches the fan of the heatbreak by a reading of the hot end.
    fn turn_cooler(&self, thread: Thread, reading: Option<u16>, orders: &Orders) {
        let Some(cools) = self.cools.first() else { return };
        let ([hot_end, _], [to, _]) = (&*self.heaters.borrow(), orders.to);
        let turns = cooler::turns(cools.get(), to, hot_end.feels(reading));
        cools.set(turns);
        heaters::cool(thread, turns);
    }

    /// Whether the awaited temperatures have been reached.
    fn has_come(&self, orders: &Orders) -> bool {
        let awaited = self.awaited.get();
        let heaters = self.heaters.borrow();
        let mut parts = [Part::HotEnd, Part::Bed].into_iter().zip(heaters.iter().zip(orders.to));
        parts.all(|(part, (heater, to))| {
            let counts = awaited.part == part || awaited.part == Part::All;
            let error = heater.error(to);
            !counts || to == 0 || error <= NEAR && (awaited.wait == Wait::Hot || error >= -NEAR)
        })
    }

    /// After a step, ends the planner's wait if the awaited temperature has been reached for long enough.
    fn see_to_wait(&self, orders: &Orders) {
        if matches!(self.awaited.get().wait, Wait::Nothing | Wait::Tuned) {
            return;
        }
        let stays = if self.has_come(orders) { self.stays.get() + 1 } else { 0 };
        self.stays.set(stays);
        if stays >= STAYS {
            self.end_wait();
        }
    }

    /// Ends a wait for a heater that is off, whatever its sensor says.
    fn end_idle_wait(&self, orders: &Orders) {
        let awaited = self.awaited.get();
        let [hot_end, bed] = orders.to;
        let off = match awaited.part {
            Part::HotEnd => hot_end == 0,
            Part::Bed => bed == 0,
            Part::All | Part::Fan => hot_end | bed == 0,
        };
        if off && !matches!(awaited.wait, Wait::Nothing | Wait::Tuned) {
            self.end_wait();
        }
    }

    /// Begins an autotune, which the planner waits for. Its heater has been switched on.
    fn begin_tune(&self, heat: &Heat) {
        let (cycles, _) = self.asked.get();
        *self.tune.borrow_mut() =
            Tune::begin(heat.part == Part::Bed, in_units(heat.to.unwrap_or(0)), cycles);
        self.tuned.set(heat.part as u8 + 1);
        self.kept.set(0);
        self.told.set((0, Stage::Swings));
    }

    fn end_wait(&self) {
        self.awaited.set(Heat::default());
        flags::set(Event::BlockDone);
    }
}

#[small]
impl Heaters {
    /// Returns heaters that are all off.
    pub const fn new() -> Self {
        Self { parts: [const { Parts::new() }; PRINTERS] }
    }

    /// Begins a wait of the planner.
    pub fn begin_wait(&self, heat: Heat) {
        if let Some(parts) = self.parts.first() {
            parts.stays.set(0);
            parts.awaited.set(heat);
            if heat.wait == Wait::Tuned {
                parts.begin_tune(&heat);
            }
        }
    }

    /// Whether the planner still waits.
    pub fn waits(&self) -> bool {
        self.parts.first().is_some_and(|parts| parts.awaited.get().wait != Wait::Nothing)
    }

    /// Ends the wait of the planner: motion goes on (M108, or the lines have been dropped).
    pub fn end_wait(&self) {
        let Some(parts) = self.parts.first() else { return };
        match parts.tuned.get() {
            0 => parts.end_wait(),
            // An autotune ends in the next turn, which switches its heater off first, because a later line may heat
            // again.
            _ => parts.tune.borrow_mut().stop(),
        }
    }
}

#[small]
impl Default for Heaters {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the targets that lines have set.
#[small]
fn orders(thread: Thread) -> Orders {
    common::with(thread, |common| common.heat.first().copied()).unwrap_or(Orders::OFF)
}

/// Sets all targets to off.
#[small]
pub fn forget_orders(thread: Thread) {
    common::with(thread, |common| {
        if let Some(orders) = common.heat.first_mut() {
            *orders = Orders::OFF;
        }
    });
}

/// Switches all heaters and the fan off, at once.
#[inline(never)]
#[small]
pub fn stop(links: &Links) {
    if !Capability::Printer.is_built_in() {
        return;
    }
    forget_orders(links.thread);
    heaters::drive(links.thread, [0; 3]);
    if let Some(parts) = links.heat.parts.first() {
        for heater in parts.heaters.borrow_mut().iter_mut() {
            heater.stop();
        }
    }
}

/// Returns the state of a heater, 0 the hot end, 1 the bed. `None` without the capability.
#[small]
pub fn standing(links: &Links, heater: u8) -> Option<Standing> {
    let parts = links.heat.parts.first()?;
    let heater = usize::from(heater);
    let to = *orders(links.thread).to.get(heater)?;
    Some(parts.heaters.borrow().get(heater)?.standing(to))
}

/// Returns the target speed of the fan, 255 for full speed.
#[small]
pub fn fan(thread: Thread) -> u8 {
    orders(thread).fan
}

/// Takes over a setting, if it belongs to a heater. Returns whether it does.
#[inline(never)]
#[small]
pub fn set(heaters: &Heaters, settings: &mut Settings, setting: Setting, value: i32) -> bool {
    let number = match setting.owner() {
        Owner::HotEnd => 0,
        Owner::Bed => 1,
        _ => return false,
    };
    let Some(parts) = heaters.parts.first() else { return false };
    let mut heaters = parts.heaters.borrow_mut();
    let (Some(heater), Some(heating)) = (heaters.get_mut(number), settings.heating.first_mut())
    else {
        return false;
    };
    heater.set(setting.index(), value);
    if number == 0 && setting.index() == hot_end::PA {
        heating.advance = value as u16;
    }
    if number == 0 {
        heating.warm = !heater.is_cold(0);
    }
    if let Some(hottest) = heating.hottest.get_mut(number) {
        *hottest = heater.hottest();
    }
    true
}

/// Takes over all settings of heaters.
#[inline(never)]
#[small]
pub fn set_all(heaters: &Heaters, settings: &mut Settings, storage: &Storage) {
    if !Capability::Printer.is_built_in() {
        return;
    }
    for setting in (Setting::WARM..Setting::COLD).filter_map(Setting::from_number) {
        if matches!(setting.owner(), Owner::HotEnd | Owner::Bed) {
            set(heaters, settings, setting, storage.cold(setting));
        }
    }
}

/// Takes a turn: see the module's text.
#[inline(never)]
#[small]
pub fn look(links: &Links) {
    if !Capability::Printer.is_built_in() {
        return;
    }
    if machine::is_alarmed() {
        forget_orders(links.thread);
    }
    let Some(parts) = links.heat.parts.first() else { return };
    let orders = orders(links.thread);
    let number = parts.next.replace(parts.next.get() ^ 1);
    let reading = heaters::reading(links.thread);
    heaters::begin(links.thread, parts.next.get());
    if COOLS && number == 0 {
        parts.turn_cooler(links.thread, reading, &orders);
    }
    let seen = look_at(links.thread, parts, number, reading, &orders);
    let fan = parts.turn_fan(orders.fan);
    let [hot_end, bed] = parts.heaters.borrow().each_ref().map(Heater::level);
    heaters::drive(links.thread, [hot_end, bed, fan]);
    parts.end_idle_wait(&orders);
    if parts.tuned.get() != 0 {
        see_to_tune(links, parts, &orders);
    }
    match seen {
        Ok(Seen::Sample) => {}
        Ok(Seen::Step) => {
            if number == 0 && note_cold(links, parts) {
                alarm::raise_for(links, Alarm::Alarm, Status::TooCold);
            }
            parts.see_to_wait(&orders);
        }
        Err(fault) => lock(links, fault),
    }
}

#[inline(never)]
#[small]
fn look_at(
    thread: Thread,
    parts: &Parts,
    number: u8,
    reading: Option<u16>,
    orders: &Orders,
) -> Result<Seen, Status> {
    let mut both = parts.heaters.borrow_mut();
    let [hot_end, bed] = &mut *both;
    let [first, second] = orders.to;
    let mut tune = parts.tune.borrow_mut();
    let tune = Some(&mut *tune).filter(|_| parts.tuned.get() == number + 1);
    let (heater, to) = if number == 0 { (hot_end, first) } else { (bed, second) };
    let reading = heater.reading(reading, || heaters::word(thread, number));
    heater.sample(number, reading, to, orders.fan, tune)
}

/// Ends an autotune whose heater has been switched off by lines. When an autotune has ended, switches its heater off,
/// writes the factors to the settings one at a time if requested, and ends the planner's wait.
#[inline(never)]
#[small]
fn see_to_tune(links: &Links, parts: &Parts, orders: &Orders) {
    let number = parts.tuned.get().saturating_sub(1);
    let mut tune = parts.tune.borrow_mut();
    if orders.to.get(usize::from(number)).is_none_or(|to| *to == 0) {
        tune.stop();
    }
    if tune.is_on() {
        return;
    }
    common::with(links.thread, |common| {
        let order =
            common.heat.first_mut().and_then(|orders| orders.to.get_mut(usize::from(number)));
        if let Some(to) = order {
            *to = 0;
        }
    });
    let Found { p, i, d } = tune.found;
    let (_, uses) = parts.asked.get();
    let row = parts.kept.get();
    let found = [(hot_end::P, p), (hot_end::I, i), (hot_end::D, d)];
    if let Some((row, value)) =
        found.get(usize::from(row)).filter(|_| uses && tune.stage == Stage::Done)
    {
        let owner = if number == 0 { Owner::HotEnd } else { Owner::Bed };
        let Some(setting) = Setting::of(owner, *row) else { return };
        let value = i32::from(*value) * 10;
        if links.storage.set_cold(setting, value).is_ok() {
            drop(tune);
            set(&links.heat, &mut links.settings.borrow_mut(), setting, value);
            parts.kept.set(parts.kept.get() + 1);
        }
        return;
    }
    drop(tune);
    parts.tuned.set(0);
    if parts.awaited.get().wait == Wait::Tuned {
        parts.end_wait();
    }
}

/// Sets the cycles of the next autotune, and whether its heater is to take over the factors.
#[cfg(feature = "dialect-reprap")]
#[small]
pub fn ask_tune(heaters: &Heaters, cycles: u8, uses: bool) {
    if let Some(parts) = heaters.parts.first() {
        parts.asked.set((cycles, uses));
    }
}

/// Returns the autotune under way, or the last one.
#[cfg(feature = "dialect-reprap")]
#[small]
pub fn tune(heaters: &Heaters) -> Tune {
    heaters.parts.first().map_or(Tune::IDLE, |parts| *parts.tune.borrow())
}

/// Whether cycle or stage of the autotune have changed since the last call.
#[cfg(feature = "dialect-reprap")]
#[small]
pub fn takes_news(heaters: &Heaters) -> bool {
    let Some(parts) = heaters.parts.first() else { return false };
    let tune = parts.tune.borrow();
    let now = (tune.cycle, tune.stage);
    parts.told.replace(now) != now
}

/// Updates whether filament may be moved. Returns whether it is being moved although the hot end is more than [`GRACE`]
/// too cold.
#[inline(never)]
#[small]
fn note_cold(links: &Links, parts: &Parts) -> bool {
    let [hot_end, _] = &*parts.heaters.borrow();
    let mut settings = links.settings.borrow_mut();
    let Some(heating) = settings.heating.first_mut() else { return false };
    heating.warm = !hot_end.is_cold(0);
    let refused = hot_end.is_cold(GRACE) && !heating.extrudes();
    refused && !machine::is_alarmed() && moves_filament(links.thread, &settings)
}

/// Whether the block that runs moves the extruder.
#[small]
fn moves_filament(thread: Thread, settings: &Settings) -> bool {
    let motion = common::snapshot(thread);
    let mut motors = motion.steps.iter().enumerate();
    motion.running
        && (motion.left > 0.0 || motion.velocity > 0.0)
        && motors
            .any(|(motor, steps)| *steps != 0 && usize::from(moved_by(settings, motor)) == EXTRUDER)
}

/// Changes the minimum temperature to move filament, or whether it applies, until the next start. Returns the minimum,
/// degrees, and whether colder extrusion is allowed.
#[cfg(feature = "dialect-reprap")]
#[inline(never)]
#[small]
pub fn extrude_cold(heaters: &Heaters, settings: &mut Settings, change: Cold) -> (i16, bool) {
    let (Some(parts), Some(heating)) = (heaters.parts.first(), settings.heating.first_mut()) else {
        return (0, true);
    };
    let [hot_end, _] = &mut *parts.heaters.borrow_mut();
    match change {
        Cold::Asked => {}
        Cold::Allowed(allows) => heating.allows_cold = allows,
        Cold::Least(degrees) => hot_end.set(hot_end::MN, degrees.into()),
    }
    heating.warm = !hot_end.is_cold(0);
    (hot_end.least(), heating.allows_cold)
}

/// Records that a printing host has sent something, so that the A axis is an extruder.
#[cfg(feature = "dialect-reprap")]
#[small]
pub fn has_extruder(settings: &mut Settings) {
    if let Some(heating) = settings.heating.first_mut() {
        heating.extruder = true;
    }
}

/// Handles a fault: switches everything off, and refuses lines that heat until a reset or until the heaters are
/// [unlocked](unlock).
#[inline(never)]
#[small]
fn lock(links: &Links, fault: Status) {
    stop(links);
    let locked = match links.settings.borrow_mut().heating.first_mut() {
        Some(heating) => core::mem::replace(&mut heating.refused, Status::HeatersLocked),
        None => return,
    };
    if locked != Status::Ok {
        return;
    }
    match machine::is_alarmed() {
        true => links.except(fault),
        false => alarm::raise_for(links, Alarm::Alarm, fault),
    }
}

/// Allows lines to heat again.
#[small]
pub fn unlock(settings: &mut Settings) {
    if let Some(heating) = settings.heating.first_mut() {
        heating.refused = Status::Ok;
    }
}
