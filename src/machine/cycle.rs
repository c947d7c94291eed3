//! What the machine carries out.

use super::Event;

/// A part of what the machine is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Cycle {
    /// Lines, if there are any.
    #[default]
    Lines,
    /// It has come to a program stop, and waits for cycle start.
    Stopped,
    /// G38.2 to G38.5.
    Probe,
    /// G28.2, G28.4, `{home:1}`.
    Homing,
    /// `{jogx:..}`.
    Jog,
}

impl Cycle {
    /// All of them, by their discriminants.
    pub const ALL: [Cycle; Cycle::Jog as usize + 1] =
        [Cycle::Lines, Cycle::Stopped, Cycle::Probe, Cycle::Homing, Cycle::Jog];

    /// The state that an event leads to. None begins while the hold `drops` what is queued, or in an alarm. One that is
    /// flushed lasts until that has been dropped: who sees to it has to know what has been interrupted.
    pub const fn after(self, event: Event, drops: bool, alarmed: bool) -> Cycle {
        match event {
            Event::Stopped | Event::Probe | Event::Homing | Event::Jog if drops || alarmed => self,
            Event::Stopped => Cycle::Stopped,
            Event::Probe => Cycle::Probe,
            Event::Homing => Cycle::Homing,
            Event::Jog => Cycle::Jog,
            Event::Done if drops => self,
            Event::Done | Event::Dropped => Cycle::Lines,
            _ => self,
        }
    }

    /// The one of a discriminant.
    pub(super) const fn from_bits(bits: u8) -> Cycle {
        match bits {
            0 => Cycle::Lines,
            1 => Cycle::Stopped,
            2 => Cycle::Probe,
            3 => Cycle::Homing,
            _ => Cycle::Jog,
        }
    }
}
