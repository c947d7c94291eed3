//! The storage task: saves changed settings and tables in the background.
//!
//! [`Storage`] is shared with other tasks. It holds which settings may have changed, the row of the tables that is
//! being saved ([`Edit`]), the setting in EEPROM alone that is being saved, and the log, which contains all other rows
//! and such settings. The task writes the EEPROM, a byte every 3.4 ms, and waits for it by the millisecond. A value
//! that changes while it is written is written again. One check costs up to 3 ms of thread mode on AVR. If power fails
//! meanwhile, items that have not been written keep their old values, unless a change of all of them had begun: see
//! [`Change`]. When the EEPROM is full, status 34 is reported once, and a row keeps its old values.
//!
//! There is room for one row and one such setting. A line that changes another one meanwhile is refused with
//! [`Status::Again`]. The parser keeps the line and is woken when the row has been saved: 0.3 s later at most, unless
//! the log is nearly full.

use core::cell::Cell;

use super::lent::{LENT, Lent};
use super::links::Links;
use super::ports::COURTESY;
use super::wake::Wake;
use crate::capability::Capability;
use crate::config::{Setting, Settings};
use crate::gcode::tables::{Edit, SYSTEMS, TableRow, Tables};
use crate::hal::Thread;
use crate::hal::after_ms;
use crate::hal::eeprom::Eeprom;
use crate::machine;
use crate::protocol::{STARTUP_MAX, Store};
use crate::status::Status;
use crate::store::kept::{self, Change, ITEMS, Item};
use crate::store::log::Put;
use crate::store::program::{self, Program, Stored};
use crate::store::{Log, Memory, record, tables};
use crate::units::{AXES, Length, PerAxis};

/// How many keys have no record if every setting and every value of all 21 rows on six axes has been set: then a line
/// is refused with status 34. The settings of drivers add 15 such keys, those of shaping 5, backlash 4. The program's
/// area could give up the room.
const LEFT_OUT: u16 = 17
    + if Capability::Drivers.is_built_in() { 15 } else { 0 }
    + if Capability::Shaping.is_built_in() { 5 } else { 0 }
    + if Capability::Backlash.is_built_in() { 4 } else { 0 };
const _: () = assert!(
    kept::KEYS < Eeprom::LOG / record::SIZE + LEFT_OUT,
    "the log of the EEPROM has too few records for what is kept: make `AREA` of src/store/program.rs smaller by 11 bytes for each"
);

const _: () = assert!(program::STARTUP_MAX as usize == STARTUP_MAX);

/// The state that the storage task shares with other tasks.
pub struct Storage {
    thread: Thread,
    log: Cell<Log>,
    /// The settings that may have changed: from this number to before `to`. If many change at once, `to` is
    /// [`TO_MACHINE`], [`TO_ALL`] or [`TO_OFFSETS`].
    from: Cell<u8>,
    to: Cell<u8>,
    /// The row that is being saved.
    edit: Cell<Option<Edit>>,
    /// The setting in EEPROM alone that is being saved: its number and its value.
    cold: Cell<Option<(u8, i32)>>,
    /// Settings in EEPROM alone are to have their defaults from this number on. From [`OFFSETS`] on, the rows of the
    /// coordinate systems come first.
    forgotten: Cell<u8>,
    /// The program that is being stored, as far as it has come.
    program: Cell<Option<Program>>,
    /// What is not to be saved.
    lent: Lent,
    /// A line waits until a row or a setting has been saved.
    awaited: Cell<bool>,
    wake: Wake,
}

/// The value of `to` while the settings of a machine's profile change: behind them is [`END`].
pub const TO_MACHINE: u8 = END + 1;
/// The value of `to` while all settings change.
pub const TO_ALL: u8 = END + 2;
/// The value of `to` while all settings and the coordinate systems change.
pub const TO_OFFSETS: u8 = END + 3;
/// In place of a setting's number: the first coordinate system.
const OFFSETS: u8 = Setting::WARM - SYSTEMS;
/// In place of a setting's number: the end of a change.
const END: u8 = ITEMS;

/// The next item to save.
#[derive(Clone, Copy)]
enum Work {
    /// The row of the tables.
    Edit,
    /// The setting in EEPROM alone.
    Cold,
    /// A setting.
    Item(u8),
}

#[small]
impl Storage {
    /// Returns a storage with this log and nothing to write.
    pub fn new(thread: Thread, log: Log) -> Self {
        Self {
            thread,
            log: Cell::new(log),
            from: Cell::new(ITEMS),
            to: Cell::new(0),
            edit: Cell::new(None),
            cold: Cell::new(None),
            forgotten: Cell::new(Setting::COLD),
            program: Cell::new(None),
            lent: Lent::new(),
            awaited: Cell::new(false),
            wake: Wake::default(),
        }
    }

    /// Returns the log as it is now.
    pub fn log(&self) -> Log {
        self.log.get()
    }

    /// Notes that these settings may have changed. While the machine lends they are not to be saved.
    pub fn note(&self, from: u8, count: u8) {
        if self.lent.notes(from, count) {
            return;
        }
        self.grow(from, count);
        self.wake.signal();
    }

    /// Notes that these settings may have changed, without waking the task.
    fn grow(&self, from: u8, count: u8) {
        self.from.set(self.from.get().min(from));
        self.to.set(self.to.get().max(from + count));
    }

    /// Notes at start-up that any setting may have changed. The task looks before it waits.
    pub fn note_at_start(&self) {
        self.grow(0, ITEMS);
    }

    /// Notes that many settings change at once: [`TO_MACHINE`], [`TO_ALL`] or [`TO_OFFSETS`].
    pub fn note_change(&self, to: u8) {
        self.note(0, to);
    }

    /// Goes on with a change that was cut short. At start-up, before settings in EEPROM alone are read.
    pub fn resume(&self, change: Change) {
        if change == Change::NONE {
            return;
        }
        let offsets = change.is_of_offsets();
        if change.is_of_all() {
            // The task has not begun, so nothing has to be woken.
            self.set_forgotten(offsets);
        }
        self.grow(
            0,
            match change.is_of_all() {
                false => TO_MACHINE,
                true if offsets => TO_OFFSETS,
                true => TO_ALL,
            },
        );
    }

    /// Whether many settings change, and the record that says so is to be written next.
    fn begins(&self) -> bool {
        self.from.get() == 0 && self.to.get() > ITEMS
    }

    /// Returns the change that is being saved.
    fn change(&self, settings: &Settings) -> Change {
        match self.to.get() {
            ..=ITEMS => Change::NONE,
            to => Change::to(settings, to >= TO_ALL, to == TO_OFFSETS),
        }
    }

    /// Whether settings and rows that change from now on are lent.
    #[cfg(feature = "dialect-reprap")]
    pub fn lend(&self, on: bool) {
        self.lent.lend(on);
    }

    /// Makes all settings in RAM those to be saved.
    pub fn own(&self) {
        self.lent.clear();
    }

    /// Orders all that is lent to be saved, or returns [`Status::Again`] while there is no room for the row.
    #[cfg(feature = "dialect-reprap")]
    pub fn keep(&self) -> Status {
        if let Some(values) = self.lent.row() {
            if self.edit.get().is_some() {
                return Status::Again;
            }
            self.edit.set(Some(Edit { row: LENT, values }));
            self.lent.put_row(None);
            self.wake.signal();
        }
        if self.lent.clear() {
            self.note(0, ITEMS);
        }
        Status::Ok
    }

    /// Returns a setting that is lent, which is not from now on.
    #[cfg(feature = "dialect-reprap")]
    pub fn take_lent(&self) -> Option<Setting> {
        self.lent.take()
    }

    /// Forgets the values of the row that is lent.
    #[cfg(feature = "dialect-reprap")]
    pub fn drop_row(&self) {
        self.lent.put_row(None);
    }

    /// Whether a row has other values in RAM than in EEPROM. Neither this nor [`Self::newer`] is inlined, because the
    /// deepest stack goes through their callers.
    #[inline(never)]
    fn is_newer(&self, row: TableRow) -> bool {
        self.newer(row).is_some()
    }

    /// Returns the values that a row has in RAM: because it is lent, or because it is being saved.
    #[inline(never)]
    fn newer(&self, row: TableRow) -> Option<PerAxis<Length>> {
        if let Some(values) = self.lent.row().filter(|_| row == LENT) {
            return Some(values);
        }
        let edit = self.edit.get().filter(|edit| edit.row == row).map(|edit| edit.values);
        edit.or(self.is_forgotten(row).then_some([Length::ZERO; AXES]))
    }

    /// Whether the values of a row are still to be stored as 0.
    fn is_forgotten(&self, row: TableRow) -> bool {
        row.number() < SYSTEMS && OFFSETS + row.number() >= self.forgotten.get()
    }

    /// Whether a line waits for a row to be saved. The parser is woken then.
    pub fn is_awaited(&self) -> bool {
        self.awaited.get()
    }

    /// Whether EEPROM holds all that it is to hold.
    pub fn is_done(&self) -> bool {
        // The end of the range is cleared when all of the range has been saved.
        let waits = self.edit.get().is_some() || self.cold.get().is_some();
        !waits && self.to.get() == 0 && self.forgotten.get() >= Setting::COLD
    }

    /// Returns a value of a row. Cost: that of [`Tables::row`].
    #[inline(never)]
    pub fn value(&self, row: TableRow, axis: u8) -> Length {
        match self.newer(row) {
            Some(values) => values.get(usize::from(axis)).copied().unwrap_or_default(),
            None => tables::value(&self.log.get(), &Eeprom::of(self.thread), row, axis),
        }
    }

    /// Returns a setting that is in EEPROM alone.
    #[inline(never)]
    pub fn cold(&self, setting: Setting) -> i32 {
        match self.cold.get() {
            Some((number, value)) if number == setting.number() => value,
            _ if setting.number() >= self.forgotten.get() => setting.default_value(),
            _ => kept::value(&self.log.get(), &Eeprom::of(self.thread), setting),
        }
    }

    /// Takes a new value of a setting in EEPROM alone, if there is room. Otherwise returns [`Status::Again`].
    pub fn set_cold(&self, setting: Setting, value: i32) -> Result<(), Status> {
        let takes = match self.cold.get() {
            Some((number, _)) => number == setting.number(),
            None => setting.number() < self.forgotten.get(),
        };
        self.awaited.set(!takes);
        if !takes {
            return Err(Status::Again);
        }
        self.cold.set(Some((setting.number(), value)));
        self.wake.signal();
        Ok(())
    }

    /// Gives all settings in EEPROM alone their defaults from now on, and with `offsets` the coordinate systems.
    pub fn forget(&self, offsets: bool) {
        self.set_forgotten(offsets);
        self.wake.signal();
    }

    fn set_forgotten(&self, offsets: bool) {
        self.cold.set(None);
        self.forgotten.set(if offsets { OFFSETS } else { Setting::WARM });
    }

    /// Returns the next setting in EEPROM alone that is to be saved.
    fn take_cold(&self) -> Option<Work> {
        let number = self.forgotten.get();
        if number < Setting::WARM {
            let row = TableRow::system(number - OFFSETS);
            self.edit.set(Some(Edit { row, values: [Length::ZERO; AXES] }));
            self.forgotten.set(number + 1);
            return Some(Work::Edit);
        }
        if self.cold.get().is_none() && number < Setting::COLD {
            let default = Setting::from_number(number).map_or(0, Setting::default_value);
            self.cold.set(Some((number, default)));
            self.forgotten.set(number + 1);
        }
        self.cold.get().map(|_| Work::Cold)
    }

    /// Does something to the program, writing one byte at most. Returns [`Status::Again`] until it is done.
    #[inline(never)]
    pub fn store(&self, what: Store<'_>) -> Result<(), Status> {
        let mut memory = Eeprom::of(self.thread);
        let new = self.program.get().ok_or(Status::NotAccepted);
        let stored = match what {
            _ if self.log.get().is_wide() => Stored::Full,
            Store::Begin => program::begin(&mut memory),
            Store::Line(line) => program::line(&mut memory, new?, line),
            Store::End => program::end(&mut memory, new?),
            Store::Startup(n, line) => program::put_startup(&mut memory, n, line),
        };
        match stored {
            Stored::Again => return Err(Status::Again),
            Stored::Full => return Err(Status::PersistenceError),
            Stored::Done if what == Store::End => self.program.set(None),
            Stored::Done => {}
            Stored::Part(new) => self.program.set(Some(new)),
        }
        Ok(())
    }

    /// Returns what is to be saved next.
    fn take(&self) -> Option<Work> {
        if self.edit.get().is_some() {
            return Some(Work::Edit);
        }
        // The record of a change comes before all settings.
        if !self.begins()
            && let Some(work) = self.take_cold()
        {
            return Some(work);
        }
        let number = self.from.get();
        if number >= self.to.get() {
            self.from.set(ITEMS);
            self.to.set(0);
            return None;
        }
        self.from.set(number + 1);
        Some(Work::Item(number))
    }
}

#[small]
impl Tables for &Storage {
    #[inline(never)]
    fn row(&self, row: TableRow) -> PerAxis<Length> {
        match self.is_newer(row) {
            true => self.newer(row).unwrap_or_default(),
            false => tables::row(&self.log.get(), &Eeprom::of(self.thread), row),
        }
    }

    #[inline(never)]
    fn is_stored(&self, row: TableRow) -> bool {
        let comes = self.edit.get().is_some_and(|edit| edit.row == row);
        comes || tables::is_stored(&self.log.get(), &Eeprom::of(self.thread), row)
    }

    fn takes(&self, row: TableRow) -> bool {
        // A row that is being saved only has to be written once more.
        let takes = !self.is_forgotten(row) && self.edit.get().is_none_or(|edit| edit.row == row);
        self.awaited.set(!takes);
        takes
    }

    fn apply(&mut self, edit: &Edit) {
        // A line that is only checked changes no table.
        if machine::is_checking() {
            return;
        }
        if edit.row == LENT && self.lent.put(edit.values) {
            return;
        }
        self.edit.set(Some(*edit));
        self.wake.signal();
    }
}

/// The first wait for a byte that is being written, ms: a byte takes 3.4 ms.
const BYTE_MS: u64 = 3;

/// The task.
pub async fn run(links: &'static Links) -> ! {
    let mut memory = Eeprom::of(links.thread);
    loop {
        while let Some(work) = links.storage.take() {
            let mut moved = 0;
            while let Some(put) = next(links, &memory, work, moved) {
                let mut write = match put {
                    Put::Room(write) => {
                        moved += 1;
                        write
                    }
                    Put::Last(write) => {
                        moved = 0;
                        write
                    }
                    Put::Full => break,
                };
                while write.step(&mut memory) {
                    let mut pause = BYTE_MS;
                    while write.waits(&memory) {
                        after_ms(pause).await;
                        pause = 1;
                    }
                }
            }
            done(links, work);
            // Other tasks have their turn.
            embassy_futures::yield_now().await;
            if !links.storage.is_awaited() {
                links.give_way(COURTESY, || true).await;
            }
        }
        links.storage.wake.wait().await;
    }
}

/// Returns the next record to write, after `moved` others that made room for it; `None` when there is none left.
#[inline(never)]
#[small]
fn next(links: &Links, memory: &Eeprom, work: Work, moved: u16) -> Option<Put> {
    let mut log = links.storage.log.get();
    let (key, value) = match work {
        Work::Edit => changed(&log, memory, &links.storage.edit.get()?)?,
        Work::Cold => {
            let (number, value) = links.storage.cold.get()?;
            let setting = Setting::from_number(number)?;
            differs(&log, memory, kept::key(setting), value, setting.default_value())?
        }
        // Many settings have changed anew: the record of that change is first.
        Work::Item(_) if links.storage.begins() => return None,
        Work::Item(number) if links.storage.lent.has(number) => return None,
        Work::Item(number) => item(links, &log, memory, number)?,
    };
    let put = log.put(memory, key, value, moved);
    links.storage.log.set(log);
    if matches!(put, Put::Full) {
        links.except(Status::PersistenceError);
    }
    Some(put)
}

/// Returns the key and the value of a setting if the log has another value. Before the first setting of a change comes
/// the record of that, and behind the last one the record of its end.
#[inline(never)]
#[small]
fn item(links: &Links, log: &Log, memory: &Eeprom, number: u8) -> Option<(u16, i32)> {
    let settings = &links.settings.borrow();
    let change = match number {
        0 => links.storage.change(settings),
        _ => Change::NONE,
    };
    if change != Change::NONE || number == END {
        let change = differs(log, memory, record::CHANGE, change.value(), Change::NONE.value());
        if change.is_some() || number == END {
            return change;
        }
    }
    let item = Item::from_number(number)?;
    let (value, default) = item.value(settings);
    differs(log, memory, item.key(), value, default)
}

/// Returns a key and its value, if the log has another value.
#[small]
fn differs(log: &Log, memory: &Eeprom, key: u16, value: i32, default: i32) -> Option<(u16, i32)> {
    (log.newest(memory, key).unwrap_or(default) != value).then_some((key, value))
}

/// Returns the key and the value of the first value of a row for which the log has another one.
#[inline(never)]
#[small]
fn changed(log: &Log, memory: &Eeprom, edit: &Edit) -> Option<(u16, i32)> {
    let kept = tables::row(log, memory, edit.row);
    let mut values = (0..).zip(&edit.values);
    let differs = values.clone().zip(&kept).find(|((_, new), old)| new != old);
    let (axis, value) = match differs {
        Some((new, _)) => new,
        // A position that is 0 also gets a record, so that it counts as stored.
        None if edit.row.is_stored() && !tables::is_stored(log, memory, edit.row) => {
            values.next()?
        }
        None => return None,
    };
    Some((tables::key(edit.row, axis), value.0))
}

/// Notes that a row or a setting has been saved: there is room for another.
#[small]
fn done(links: &Links, work: Work) {
    match work {
        Work::Edit => links.storage.edit.set(None),
        Work::Cold => links.storage.cold.set(None),
        Work::Item(_) => return,
    }
    links.storage.awaited.set(false);
    links.parser_wake.signal();
}
