//! Whether motion goes on, and whether what is queued is being dropped.
//!
//! The order of the states makes each question one comparison of a byte. The door is open in those with an odd discriminant,
//! but for `Resuming`.

use super::Event;

/// A part of what the machine is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Hold {
    /// Motion goes on.
    #[default]
    Off,
    /// Motion is held, and goes on when the machine has come to rest.
    Resuming,
    /// Motion is held, or slows down.
    Held,
    /// Motion is held as long as the door is open.
    Door,
    /// Motion is held; the reader is to drop the lines that have come.
    Flush,
    /// The state `Flush` with the door open.
    FlushDoor,
    /// Motion is held; the planner is to drop what is queued.
    Drop,
    /// The state `Drop` with the door open.
    DropDoor,
    /// The state `Drop`, after which the program ends.
    Kill,
    /// The state `Kill` with the door open.
    KillDoor,
}

impl Hold {
    /// All of them, by their discriminants.
    pub const ALL: [Hold; Hold::KillDoor as usize + 1] = {
        use Hold::*;
        [Off, Resuming, Held, Door, Flush, FlushDoor, Drop, DropDoor, Kill, KillDoor]
    };

    /// The state that an event leads to.
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

    /// Whether motion is to come to rest, and nothing begins.
    pub const fn holds(self) -> bool {
        !matches!(self, Hold::Off)
    }

    /// Whether lines are to be dropped, or the queue is.
    pub const fn flushes(self) -> bool {
        self as u8 >= Hold::Flush as u8
    }

    /// Whether the queue is to be dropped.
    pub const fn drops(self) -> bool {
        self as u8 >= Hold::Drop as u8
    }

    /// Whether the program ends with that.
    pub const fn kills(self) -> bool {
        self as u8 >= Hold::Kill as u8
    }

    /// Whether the door is open.
    pub const fn has_open_door(self) -> bool {
        self as u8 > Hold::Resuming as u8 && self as u8 & 1 != 0
    }
}

/// The state after each event of [`Event::OF_HOLD`], for each state.
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
