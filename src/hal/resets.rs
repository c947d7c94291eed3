//! Why the machine has started.
//!
//! The chip sets flags for the cause of a reset (MCUSR), but common boot loaders clear them before the firmware can
//! read them. Therefore the firmware leaves a mark in memory that resets do not clear. The mark says that the firmware
//! runs, or why it is about to reset itself.
//!
//! | flags of the chip | mark | cause |
//! |---|---|---|
//! | power-on | any | 0 |
//! | brown-out | any | 2 |
//! | watchdog, external or nothing | asked for | 4 |
//! | watchdog | another | 3 |
//! | external or nothing | starved | 3 |
//! | external | another | 1 |
//! | nothing, the loader has cleared them | running | 1: the button, the port, a brown-out, or a hang with interrupts off |
//! | nothing | none | 0 |

/// Why the machine has started. The numbers are those of `{rst:n}`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Cause {
    /// The supply came on.
    PowerOn = 0,
    /// The button, or the port being opened.
    External = 1,
    /// The supply was too low for a moment.
    BrownOut = 2,
    /// The firmware has stopped responding.
    Watchdog = 3,
    /// `^x`, `{reset:1}`, or `{boot:1}` without a boot loader.
    Asked = 4,
}

impl Cause {
    fn from_number(number: u8) -> Cause {
        match number {
            0 => Cause::PowerOn,
            2 => Cause::BrownOut,
            3 => Cause::Watchdog,
            4 => Cause::Asked,
            _ => Cause::External,
        }
    }

    /// Whether the reset was unwanted.
    pub fn is_fault(self) -> bool {
        matches!(self, Cause::BrownOut | Cause::Watchdog)
    }
}

/// The mark that survives a reset in memory.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Mark(pub u16);

impl Mark {
    const RUNNING: u16 = 0x4BA0;
    /// The firmware is about to reset because a sender asked for it.
    pub const ASKED: Mark = Mark(0x4B5A);
    /// The firmware is about to reset because a task, exec or the step interrupt hangs.
    pub const STARVED: Mark = Mark(0x4BC3);

    /// No mark: the next start is that of a new image.
    pub const NONE: Mark = Mark(0);

    /// Whether this firmware has left the mark.
    pub fn is_ours(self) -> bool {
        self == Self::ASKED || self == Self::STARVED || self.cause().is_some()
    }

    /// Returns the mark of a running firmware that was started by `cause`.
    pub fn running(cause: Cause) -> Mark {
        Mark(Self::RUNNING | cause as u16)
    }

    /// Returns why the firmware was started, if the mark is that of a running firmware; else `None`.
    pub fn cause(self) -> Option<Cause> {
        let number = self.0 ^ Self::RUNNING;
        (number <= Cause::Asked as u16).then(|| Cause::from_number(number as u8))
    }
}

/// Bits of MCUSR (ATmega2560 data sheet, 12.5.1).
const POWER_ON: u8 = 1;
const EXTERNAL: u8 = 1 << 1;
const BROWN_OUT: u8 = 1 << 2;
const WATCHDOG: u8 = 1 << 3;

/// Returns why the machine has started, from the flags of the `chip` and the mark that was left.
#[small]
pub fn cause(chip: u8, mark: Mark) -> Cause {
    if chip & POWER_ON != 0 {
        Cause::PowerOn
    } else if chip & BROWN_OUT != 0 {
        Cause::BrownOut
    } else if mark == Mark::ASKED {
        Cause::Asked
    } else if chip & WATCHDOG != 0 || mark == Mark::STARVED {
        Cause::Watchdog
    } else if chip & EXTERNAL != 0 || mark.cause().is_some() {
        Cause::External
    } else {
        Cause::PowerOn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_holds() {
        let running = Mark::running(Cause::Watchdog);
        let none = Mark(0x1234);
        for (chip, mark, expected) in [
            (POWER_ON | EXTERNAL | BROWN_OUT, Mark::ASKED, Cause::PowerOn),
            (BROWN_OUT, running, Cause::BrownOut),
            (WATCHDOG, Mark::ASKED, Cause::Asked),
            (0, Mark::ASKED, Cause::Asked),
            (WATCHDOG, running, Cause::Watchdog),
            (WATCHDOG, none, Cause::Watchdog),
            (0, Mark::STARVED, Cause::Watchdog),
            (EXTERNAL, running, Cause::External),
            (EXTERNAL, none, Cause::External),
            (0, running, Cause::External),
            (0, none, Cause::PowerOn),
        ] {
            assert_eq!(cause(chip, mark), expected, "{chip} {mark:?}");
        }
    }

    #[test]
    fn a_mark_tells_the_cause() {
        for number in 0..5 {
            let cause = Cause::from_number(number);
            assert_eq!(cause as u8, number);
            assert_eq!(Mark::running(cause).cause(), Some(cause));
            assert!(Mark::running(cause).is_ours());
        }
        for mark in [Mark::ASKED, Mark::STARVED, Mark(0), Mark(0xFFFF), Mark(Mark::RUNNING | 5)] {
            assert_eq!(mark.cause(), None);
            assert_eq!(mark.is_ours(), mark == Mark::ASKED || mark == Mark::STARVED);
        }
    }
}
