//! The events that change the machine's state. A table in the [parent module](super) says who raises each event.

use super::Alarm;

/// An event that may change what the machine is doing. The events that concern the [`Hold`](super::Hold) come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Event {
    /// Motion has to come to rest.
    Hold,
    /// Held motion has to go on.
    Resume,
    /// Everything that has arrived has to be dropped. The reader drops the lines first.
    Flush,
    /// The lines that have arrived are dropped from the line pools. The queue has to be dropped too.
    Cut,
    /// Like `Cut`, and the program has to end afterwards.
    Kill,
    /// The queue has been dropped.
    Dropped,
    /// The door has been opened.
    DoorOpened,
    /// The door has been shut, and there is held motion to go on with.
    DoorShut,
    /// The door has been shut, and there is no held motion.
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
    /// The cycle has come to its end, or the machine has left a program stop.
    Done,
    /// An alarm has been requested, or probing has failed.
    Alarm,
    /// A limit has been hit.
    Limit,
    /// A shutdown has been requested, or the emergency stop has been hit.
    Shutdown,
    /// A panic has been requested.
    Panic,
    /// The end of the alarm has been requested, and its cause is gone.
    Cleared,
}

impl Event {
    /// The number of events that concern the hold and are raised by thread mode. They are the first ones.
    pub(super) const OF_HOLD: usize = Event::DoorShutIdle as usize + 1;

    /// All events, in the order of their discriminants.
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

    /// Returns the alarm that the event raises. `None` if it raises none.
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
