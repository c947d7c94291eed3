//! Alarms: conditions that stop the machine until the operator ends the alarm.
//!
//! | cause | `stat` | motion | outputs | position | G-code | ended by |
//! |---|---|---|---|---|---|---|
//! | `{alarm:n}`, a failed G38.2 or G38.4 | 2 | comes to rest within its limits | off | kept | 203 | `{clear:n}`, `{clr:n}`, `$clear`; M2, M30 alone on a line |
//! | a reset by the watchdog or a brown-out | 2 | none | off | not known | 203 | as in the first row |
//! | a limit is hit | 2 | stops without another step | off | no axis homed | 204 | as in the first row |
//! | `{shutd:n}`, the emergency stop | 11 (g2core 12) | stops without another step | off | no axis homed | 205 | clear, when the emergency stop is released |
//! | `{panic:n}` | 13 | stops without another step | off | no axis homed | 206 | `^x` |
//!
//! Every alarm drops the queue. Lines that arrived before the alarm are refused, even after it has been ended. Motors
//! keep their power, because a vertical axis falls without it. Every step that is made is counted, even if motion stops
//! suddenly. But a motor that stops suddenly may slip by some steps that are not counted, so axes have to be homed
//! again.
//!
//! On a port of grbl's dialect M2 and M30 end no alarm, and a reset ends none but a panic. `$X` ends those that `clear`
//! ends, and so does `$H` if the homing begins. A line that is refused ends no alarm, whatever the dialect.
//!
//! An alarm is reported by one exception report when it begins. A later cause counts only if it is worse.

use super::Event;
use crate::status::Status;

/// The part of the machine's state that says which alarm is on. A greater discriminant is a worse alarm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Alarm {
    /// No alarm is on.
    #[default]
    None,
    /// An alarm was requested, probing has failed, or the machine had an unwanted reset.
    Alarm,
    /// A limit has been hit.
    Limit,
    /// A shutdown was requested, or the emergency stop has been hit.
    Shutdown,
    /// A panic was requested.
    Panic,
}

impl Alarm {
    /// All alarms, in the order of their discriminants.
    pub const ALL: [Alarm; Alarm::Panic as usize + 1] =
        [Alarm::None, Alarm::Alarm, Alarm::Limit, Alarm::Shutdown, Alarm::Panic];

    /// Returns the alarm that an event leads to. An alarm does not end while the hold `flushes`. A panic never ends.
    pub const fn after(self, event: Event, flushes: bool) -> Alarm {
        match (event.alarm(), event) {
            (Some(alarm), _) if self.is_exceeded_by(alarm) => alarm,
            (None, Event::Cleared) if !flushes && !matches!(self, Alarm::Panic) => Alarm::None,
            _ => self,
        }
    }

    /// Whether the other alarm is worse and therefore replaces this one.
    pub const fn is_exceeded_by(self, other: Alarm) -> bool {
        (self as u8) < other as u8
    }

    /// Whether an alarm is on.
    pub const fn is_on(self) -> bool {
        !matches!(self, Alarm::None)
    }

    /// Returns the alarm with this discriminant.
    pub fn from_bits(bits: u8) -> Alarm {
        match bits {
            0 => Alarm::None,
            1 => Alarm::Alarm,
            2 => Alarm::Limit,
            3 => Alarm::Shutdown,
            _ => Alarm::Panic,
        }
    }

    /// Whether the alarm stops the motors suddenly, so that they may lose their position.
    pub fn is_sudden(self) -> bool {
        self >= Alarm::Limit
    }

    /// Whether the end of a program (M2, M30) ends the alarm.
    pub fn ends_with_program(self) -> bool {
        matches!(self, Alarm::Alarm | Alarm::Limit)
    }

    /// Returns the status of the exception report, with which G-code is also refused.
    pub fn status(self) -> Status {
        match self {
            Alarm::None => Status::Ok,
            Alarm::Alarm => Status::Alarmed,
            Alarm::Limit => Status::LimitHit,
            Alarm::Shutdown => Status::ShutDown,
            Alarm::Panic => Status::Panicked,
        }
    }
}

/// Whether a block is M2 or M30 and nothing else.
pub fn is_program_end(block: &[u8]) -> bool {
    // A percent sign before it may have been meant as a flush.
    let block = match block.trim_ascii() {
        [b'%', block @ ..] => block,
        block => block,
    };
    match block {
        [m, b'2'] | [m, b'0', b'2'] | [m, b'3', b'0'] => m.eq_ignore_ascii_case(&b'm'),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_program_stands_alone() {
        for block in ["m2", "M2 ", " M30\r", "m02", "%m2"] {
            assert!(is_program_end(block.as_bytes()), "{block}");
        }
        for block in ["", "m", "m20", "m2 x1", "g2", "m3", "m300", "n1 m2", "%prog", "%"] {
            assert!(!is_program_end(block.as_bytes()), "{block}");
        }
    }

    #[test]
    fn the_worse_it_is_the_more_it_takes() {
        let all = [0, 1, 2, 3, 4].map(Alarm::from_bits);
        assert!(all.is_sorted() && all.is_sorted_by_key(|alarm| alarm.status() as u8));
    }
}
