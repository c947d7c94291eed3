//! The storage task: puts away what has changed of the settings and tables, in the background.
//!
//! Reads the settings, the tables and [`Storage`], which says where to look; writes the EEPROM, a byte each 3.4 ms,
//! and waits for it by the millisecond. Whatever changes while it is written is written again. One look
//! costs up to 2 ms of thread mode on AVR. If power fails meanwhile, the items that it has not come to are what they
//! were. When the EEPROM is full: status 34, once.

use core::cell::Cell;

use embassy_time::Timer;

use super::links::Links;
use super::wake::Wake;
use crate::hal::imp::eeprom::Eeprom;
use crate::status::Status;
use crate::store::kept::{ITEMS, Item};
use crate::store::log::{Put, Write};
use crate::store::{Log, Memory};

/// The items that may have changed: from one number to before another.
pub struct Storage {
    from: Cell<u16>,
    to: Cell<u16>,
    wake: Wake,
}

impl Storage {
    /// These may have changed.
    pub fn note(&self, from: u16, count: u16) {
        self.from.set(self.from.get().min(from));
        self.to.set(self.to.get().max(from + count));
        self.wake.signal();
    }

    /// The next one to look at.
    fn take(&self) -> Option<u16> {
        let number = self.from.get();
        if number >= self.to.get() {
            self.from.set(ITEMS);
            self.to.set(0);
            return None;
        }
        self.from.set(number + 1);
        Some(number)
    }
}

impl Default for Storage {
    /// None.
    fn default() -> Self {
        Self { from: Cell::new(ITEMS), to: Cell::new(0), wake: Wake::default() }
    }
}

/// The task.
pub async fn run(links: &'static Links, mut log: Log) -> ! {
    let mut memory = Eeprom::take();
    loop {
        links.storage.wake.wait().await;
        while let Some(number) = links.storage.take() {
            let mut moved = 0;
            while let Some(mut write) = next(links, &mut log, &memory, number, moved) {
                moved += 1;
                while write.step(&mut memory) {
                    while memory.is_busy() {
                        Timer::after_ticks(1).await;
                    }
                }
            }
            // Others have their turn.
            embassy_futures::yield_now().await;
        }
    }
}

/// The next record to write on behalf of an item; `None` when it is put away.
#[inline(never)]
fn next(links: &Links, log: &mut Log, memory: &Eeprom, number: u16, moved: u16) -> Option<Write> {
    let item = Item::from_number(number)?;
    let key = item.key();
    let model = links.model.borrow();
    let (value, default) = item.value(&links.settings.borrow(), model.tables());
    if log.newest(memory, key).unwrap_or(default) == value {
        return None;
    }
    match log.put(memory, key, value, moved) {
        Put::Room(write) | Put::Last(write) => Some(write),
        Put::Full => {
            links.except(Status::PersistenceError);
            None
        }
    }
}
