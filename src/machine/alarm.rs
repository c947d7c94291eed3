//! Alarms: what brings the machine to a stop that lasts until somebody ends it.
//!
//! | cause | `stat` | motion | outputs | position | G-code | ended by |
//! |---|---|---|---|---|---|---|
//! | `{alarm:n}`, a failed G38.2 or G38.4 | 2 | comes to rest within its limits | off | kept | 203 | `{clear:n}`, `{clr:n}`, `$clear`; M2, M30 alone on a line |
//! | a reset by the watchdog or a brown-out | 2 | none | off | not known | 203 | the same |
//! | a limit is hit | 2 | no step more | off | no axis homed | 204 | the same |
//! | `{shutd:n}`, the emergency stop | 11 (g2core 12) | no step more | off | no axis homed | 205 | clear, when the stop is let go |
//! | `{panic:n}` | 13 | no step more | off | no axis homed | 206 | `^x` |
//!
//! Whatever it is, what is queued is dropped, and lines that have come before it are refused, also when it has been ended. Motors keep their power: without it a
//! vertical axis falls. Steps that are made are counted, whenever they stop; but motors that stop at once
//! may have gone on for some more, so that axes have to be homed again.
//!
//! Each is told by one exception report when it begins. What comes later counts only if it is worse.

use super::Event;
use crate::status::Status;

/// A part of what the machine is doing: how bad it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Alarm {
    /// There is no alarm.
    #[default]
    None,
    /// Somebody asked for it.
    Alarm,
    /// A limit has been hit.
    Limit,
    /// Somebody asked for it, or has hit the emergency stop.
    Shutdown,
    /// Somebody asked for it.
    Panic,
}

impl Alarm {
    /// All of them, by their discriminants.
    pub const ALL: [Alarm; Alarm::Panic as usize + 1] =
        [Alarm::None, Alarm::Alarm, Alarm::Limit, Alarm::Shutdown, Alarm::Panic];

    /// The state that an event leads to. An alarm does not end while the hold `flushes`, nor a panic at all.
    pub const fn after(self, event: Event, flushes: bool) -> Alarm {
        match (event.alarm(), event) {
            (Some(alarm), _) if self.is_exceeded_by(alarm) => alarm,
            (None, Event::Cleared) if !flushes && !matches!(self, Alarm::Panic) => Alarm::None,
            _ => self,
        }
    }

    /// Whether the other one is worse, so that it counts.
    pub const fn is_exceeded_by(self, other: Alarm) -> bool {
        (self as u8) < other as u8
    }

    /// Whether there is one.
    pub const fn is_on(self) -> bool {
        !matches!(self, Alarm::None)
    }

    /// The one that is so bad.
    pub fn from_bits(bits: u8) -> Alarm {
        match bits {
            0 => Alarm::None,
            1 => Alarm::Alarm,
            2 => Alarm::Limit,
            3 => Alarm::Shutdown,
            _ => Alarm::Panic,
        }
    }

    /// Whether motors stop at once, and may lose their position.
    pub fn is_sudden(self) -> bool {
        self >= Alarm::Limit
    }

    /// Whether the end of a program ends it.
    pub fn ends_with_program(self) -> bool {
        matches!(self, Alarm::Alarm | Alarm::Limit)
    }

    /// What it is told as, and G-code is refused with.
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
    match block.trim_ascii() {
        [m, b'2'] | [m, b'0', b'2'] | [m, b'3', b'0'] => m.eq_ignore_ascii_case(&b'm'),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_program_stands_alone() {
        for block in ["m2", "M2 ", " M30\r", "m02"] {
            assert!(is_program_end(block.as_bytes()), "{block}");
        }
        for block in ["", "m", "m20", "m2 x1", "g2", "m3", "m300", "n1 m2"] {
            assert!(!is_program_end(block.as_bytes()), "{block}");
        }
    }

    #[test]
    fn the_worse_it_is_the_more_it_takes() {
        let all = [0, 1, 2, 3, 4].map(Alarm::from_bits);
        assert!(all.is_sorted() && all.is_sorted_by_key(|alarm| alarm.status() as u8));
    }
}
