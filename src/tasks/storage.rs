//! The storage task: puts away what has changed of the settings and tables, in the background.
//!
//! [`Storage`] is what it shares with the others: which settings to look at; the row of the tables that is on its way
//! ([`Edit`]); and where the log is, for the interpreter finds all other rows there. The task writes the
//! EEPROM, a byte each 3.4 ms, and waits for it by the millisecond. Whatever changes while it is written is written
//! again. One look costs up to 3 ms of thread mode on AVR. If power fails meanwhile, the items that it has not come to
//! are what they were. When the EEPROM is full: status 34, once, and a row is what it was.
//!
//! There is room for one row. A line that changes another meanwhile is refused with [`Status::Again`]; the parser keeps it
//! and is woken when the row has been put away, 0.3 s later at most unless the log is nearly full.

use core::cell::Cell;

use embassy_time::Timer;

use super::links::Links;
use super::wake::Wake;
use crate::gcode::tables::{Edit, Row, Tables};
use crate::hal::imp::eeprom::Eeprom;
use crate::status::Status;
use crate::store::kept::{ITEMS, Item};
use crate::store::log::Put;
use crate::store::{Log, Memory, tables};
use crate::units::{Length, PerAxis};

/// What the storage task shares with those for whom it keeps things.
pub struct Storage {
    log: Cell<Log>,
    /// The settings that may have changed: from one number to before another.
    from: Cell<u8>,
    to: Cell<u8>,
    /// The row that is on its way.
    edit: Cell<Option<Edit>>,
    /// A line waits until it has arrived.
    awaited: Cell<bool>,
    wake: Wake,
}

/// What the task turns to.
#[derive(Clone, Copy)]
enum Work {
    /// The row.
    Edit,
    /// A setting.
    Item(u8),
}

impl Storage {
    /// Nothing to do, and this log.
    pub fn new(log: Log) -> Self {
        Self {
            log: Cell::new(log),
            from: Cell::new(ITEMS),
            to: Cell::new(0),
            edit: Cell::new(None),
            awaited: Cell::new(false),
            wake: Wake::default(),
        }
    }

    /// The log as it is now.
    pub fn log(&self) -> Log {
        self.log.get()
    }

    /// These settings may have changed.
    pub fn note(&self, from: u8, count: u8) {
        self.from.set(self.from.get().min(from));
        self.to.set(self.to.get().max(from + count));
        self.wake.signal();
    }

    /// Whether a line waits for a row to be put away; then the parser is woken.
    pub fn is_awaited(&self) -> bool {
        self.awaited.get()
    }

    /// What comes next.
    fn take(&self) -> Option<Work> {
        if self.edit.get().is_some() {
            return Some(Work::Edit);
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

impl Tables for &Storage {
    #[inline(never)]
    fn row(&self, row: Row) -> PerAxis<Length> {
        match self.edit.get() {
            Some(edit) if edit.row == row => edit.values,
            _ => tables::row(&self.log.get(), &Eeprom::take(), row),
        }
    }

    fn takes(&self, row: Row) -> bool {
        // The same row has only to be written once more.
        let takes = self.edit.get().is_none_or(|edit| edit.row == row);
        self.awaited.set(!takes);
        takes
    }

    fn apply(&mut self, edit: &Edit) {
        self.edit.set(Some(*edit));
        self.wake.signal();
    }
}

/// The task.
pub async fn run(links: &'static Links) -> ! {
    let mut memory = Eeprom::take();
    loop {
        links.storage.wake.wait().await;
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
                    while memory.is_busy() {
                        Timer::after_ticks(1).await;
                    }
                }
            }
            done(links, work);
            // Others have their turn.
            embassy_futures::yield_now().await;
        }
    }
}

/// The next record to write, after `moved` others that made room for it; `None` when there is none left.
#[inline(never)]
fn next(links: &Links, memory: &Eeprom, work: Work, moved: u16) -> Option<Put> {
    let mut log = links.storage.log.get();
    let (key, value) = match work {
        Work::Edit => changed(&log, memory, &links.storage.edit.get()?)?,
        Work::Item(number) => {
            let item = Item::from_number(number)?;
            let (value, default) = item.value(&links.settings.borrow());
            let key = item.key();
            if log.newest(memory, key).unwrap_or(default) == value {
                return None;
            }
            (key, value)
        }
    };
    let put = log.put(memory, key, value, moved);
    links.storage.log.set(log);
    if matches!(put, Put::Full) {
        links.exception.set(Some(Status::PersistenceError));
        links.reporter_wake.signal();
    }
    Some(put)
}

/// The key of a value of a row that the log does not have as it is to be, and that value.
#[inline(never)]
fn changed(log: &Log, memory: &Eeprom, edit: &Edit) -> Option<(u16, i32)> {
    let kept = tables::row(log, memory, edit.row);
    let (axis, value) = (0..)
        .zip(&edit.values)
        .zip(&kept)
        .find(|((_, new), old)| new != old)
        .map(|(new, _)| new)?;
    Some((tables::key(edit.row, axis), value.0))
}

/// A row has arrived: there is room for another.
fn done(links: &Links, work: Work) {
    if matches!(work, Work::Edit) {
        links.storage.edit.set(None);
        links.storage.awaited.set(false);
        links.parser_wake.signal();
    }
}
