//! What the machine carries out.

use super::Event;

/// A part of what the machine is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Cycle {
    /// Lines, if there are any.
    #[default]
    Lines,
    /// The machine has come to a program stop, and waits for cycle start.
    Stopped,
    /// G38.2 to G38.5.
    Probe,
    /// G28.2, G28.4, `{home:1}`.
    Homing,
    /// `{jogx:..}`.
    Jog,
    /// `{chk:1}`: lines are checked, and nothing of them is carried out. Only a reset and `{chk:0}` end it.
    Check,
}

impl Cycle {
    /// All of them, by their discriminants.
    pub const ALL: [Cycle; Cycle::Check as usize + 1] =
        [Cycle::Lines, Cycle::Stopped, Cycle::Probe, Cycle::Homing, Cycle::Jog, Cycle::Check];

    /// The state that an event leads to. None begins while the hold `drops` what is queued, or in an alarm. One that is
    /// flushed lasts until that has been dropped: who sees to it has to know what has been interrupted.
    pub const fn after(self, event: Event, drops: bool, alarmed: bool) -> Cycle {
        match event {
            Event::Stopped | Event::Probe | Event::Homing | Event::Jog | Event::Check
                if drops || alarmed =>
            {
                self
            }
            Event::Stopped => Cycle::Stopped,
            Event::Probe => Cycle::Probe,
            Event::Homing => Cycle::Homing,
            Event::Jog => Cycle::Jog,
            Event::Check => Cycle::Check,
            Event::Done if drops => self,
            // What has been sent to be checked is not to move anything because some of it was dropped.
            Event::Dropped if matches!(self, Cycle::Check) => self,
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
            4 => Cycle::Jog,
            _ => Cycle::Check,
        }
    }
}
