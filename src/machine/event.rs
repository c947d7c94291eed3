//! What may happen to the machine. Who raises each is in the [module](super)'s table.

use super::Alarm;

/// Something that may change what the machine is doing. Those that concern the [`Hold`](super::Hold) alone come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Event {
    /// Motion is to come to rest.
    Hold,
    /// What is held is to go on.
    Resume,
    /// All that has come is to be dropped, up to where the reader is.
    Flush,
    /// What has come is dropped, from the pools; the queue is to be dropped.
    Cut,
    /// What has come is dropped and the queue is to be dropped, as by `Cut`; and the program is to end.
    Kill,
    /// The queue has been dropped.
    Dropped,
    /// The door has been opened.
    DoorOpened,
    /// The door has been shut, and there is something to go on with.
    DoorShut,
    /// The door has been shut, and there is nothing to go on with.
    DoorShutIdle,
    /// The machine has come to rest in a hold.
    Rested,
    /// A program stop has been reached.
    Stopped,
    /// Probing begins.
    Probe,
    /// Homing begins.
    Homing,
    /// A jog begins.
    Jog,
    /// Lines are only checked from now on.
    Check,
    /// The cycle has come to its end, or a program stop has been left.
    Done,
    /// Somebody asks for an alarm, or probing has failed.
    Alarm,
    /// A limit has been hit.
    Limit,
    /// Somebody asks for it, or has hit the emergency stop.
    Shutdown,
    /// Somebody asks for it.
    Panic,
    /// Somebody ends the alarm, and its cause is gone.
    Cleared,
}

impl Event {
    /// How many of them concern the hold and are raised by thread mode: the first.
    pub(super) const OF_HOLD: usize = Event::DoorShutIdle as usize + 1;

    /// All of them, by their discriminants.
    pub const ALL: [Event; Event::Cleared as usize + 1] = {
        use Event::*;
        [
            Hold,
            Resume,
            Flush,
            Cut,
            Kill,
            Dropped,
            DoorOpened,
            DoorShut,
            DoorShutIdle,
            Rested,
            Stopped,
            Probe,
            Homing,
            Jog,
            Check,
            Done,
            Alarm,
            Limit,
            Shutdown,
            Panic,
            Cleared,
        ]
    };

    /// The alarm that it raises.
    pub(super) const fn alarm(self) -> Option<Alarm> {
        match self {
            Event::Alarm => Some(Alarm::Alarm),
            Event::Limit => Some(Alarm::Limit),
            Event::Shutdown => Some(Alarm::Shutdown),
            Event::Panic => Some(Alarm::Panic),
            _ => None,
        }
    }
}
