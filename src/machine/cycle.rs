//! The part of the machine's state that says what the machine carries out.

use super::Event;

/// What the machine carries out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Cycle {
    /// The machine carries lines out, or is idle.
    #[default]
    Lines,
    /// The machine has come to a program stop and waits for cycle start.
    Stopped,
    /// G38.2 to G38.5.
    Probe,
    /// G28.2, G28.4, `{home:1}`.
    Homing,
    /// `{jogx:..}`.
    Jog,
    /// `{chk:1}`: lines are checked and not carried out. Only a reset and `{chk:0}` end this.
    Check,
}

impl Cycle {
    /// All cycles, in the order of their discriminants.
    pub const ALL: [Cycle; Cycle::Check as usize + 1] =
        [Cycle::Lines, Cycle::Stopped, Cycle::Probe, Cycle::Homing, Cycle::Jog, Cycle::Check];

    /// Returns the cycle that an event leads to. No cycle begins while the hold `drops` the queue, or in an alarm. A
    /// cycle that is flushed lasts until the queue has been dropped, because the planner needs to know what has been
    /// interrupted.
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
            // Lines that were sent to be checked must not move anything after some of them have been dropped.
            Event::Dropped if matches!(self, Cycle::Check) => self,
            Event::Done | Event::Dropped => Cycle::Lines,
            _ => self,
        }
    }

    /// Returns the cycle with this discriminant.
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
