//! The part of the machine's state that says whether motion is held, and whether the queue is being dropped.
//!
//! The states are ordered so that each query is one comparison of a byte. The door is open in the states with an odd
//! discriminant, except in `Resuming`.

use super::Event;

/// Whether motion is held, and whether lines and the queue are being dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Hold {
    /// Motion is not held.
    #[default]
    Off,
    /// Motion comes to rest, and then resumes.
    Resuming,
    /// Motion is held, or slows down to be held.
    Held,
    /// Motion is held as long as the door is open.
    Door,
    /// Motion is held. The reader has to drop the lines that have arrived.
    Flush,
    /// The state `Flush` with the door open.
    FlushDoor,
    /// Motion is held. The planner has to drop the queue.
    Drop,
    /// The state `Drop` with the door open.
    DropDoor,
    /// The state `Drop`, after which the program ends.
    Kill,
    /// The state `Kill` with the door open.
    KillDoor,
}

impl Hold {
    /// All states, in the order of their discriminants.
    pub const ALL: [Hold; Hold::KillDoor as usize + 1] = {
        use Hold::*;
        [Off, Resuming, Held, Door, Flush, FlushDoor, Drop, DropDoor, Kill, KillDoor]
    };

    /// Returns the state that an event leads to.
    pub const fn after(self, event: Event) -> Hold {
        use Hold::*;
        match (event, self) {
            (Event::Hold, Off | Resuming) => Held,
            (Event::Resume, Held) => Resuming,
            (Event::Rested, Resuming) => Off,
            (Event::Flush, Off | Resuming | Held) => Flush,
            (Event::Flush, Door) => FlushDoor,
            (Event::Cut, Off | Resuming | Held | Flush) => Drop,
            (Event::Cut, Door | FlushDoor) => DropDoor,
            (Event::Kill, Off | Resuming | Held | Flush | Drop) => Kill,
            (Event::Kill, Door | FlushDoor | DropDoor) => KillDoor,
            (Event::Dropped, Drop | Kill) => Off,
            (Event::Dropped, DropDoor | KillDoor) => Door,
            (Event::DoorOpened, Off | Resuming | Held) => Door,
            (Event::DoorOpened, Flush) => FlushDoor,
            (Event::DoorOpened, Drop) => DropDoor,
            (Event::DoorOpened, Kill) => KillDoor,
            (Event::DoorShut, Door) => Held,
            (Event::DoorShutIdle, Door) => Off,
            (Event::DoorShut | Event::DoorShutIdle, FlushDoor) => Flush,
            (Event::DoorShut | Event::DoorShutIdle, DropDoor) => Drop,
            (Event::DoorShut | Event::DoorShutIdle, KillDoor) => Kill,
            (event, _) if event.alarm().is_some() => self.after(Event::Cut),
            _ => self,
        }
    }

    /// Whether motion has to come to rest, so that no new motion begins.
    pub const fn holds(self) -> bool {
        !matches!(self, Hold::Off)
    }

    /// Whether lines or the queue have to be dropped.
    pub const fn flushes(self) -> bool {
        self as u8 >= Hold::Flush as u8
    }

    /// Whether the queue has to be dropped.
    pub const fn drops(self) -> bool {
        self as u8 >= Hold::Drop as u8
    }

    /// Whether the program ends after the queue has been dropped.
    pub const fn kills(self) -> bool {
        self as u8 >= Hold::Kill as u8
    }

    /// Whether the door is open.
    pub const fn has_open_door(self) -> bool {
        self as u8 > Hold::Resuming as u8 && self as u8 & 1 != 0
    }
}

/// Returns the next state for each state and each of the first [`Event::OF_HOLD`] events.
pub(super) const fn table() -> [u8; Event::OF_HOLD * Hold::ALL.len()] {
    let mut table = [0; Event::OF_HOLD * Hold::ALL.len()];
    let mut at = 0;
    while at < table.len() {
        let (hold, event) = (Hold::ALL[at / Event::OF_HOLD], Event::ALL[at % Event::OF_HOLD]);
        table[at] = hold.after(event) as u8;
        at += 1;
    }
    table
}
