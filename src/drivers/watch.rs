//! What a driver says about itself, and what follows from it. Pure: no pin, no UART.
//!
//! Each driver has a [`Watch`]. Its owner takes the steps of a [`ROUND`] one after the other: it repeats all settings,
//! and asks for three registers. The driver counts the datagrams that it has taken (IFCNT), so Kerf knows whether its
//! settings have arrived. A driver without motor power, or with a broken line, answers nothing. Cost: 100 cycles each.
//!
//! Registers: TMC2209 data sheet, 5.1 (IFCNT, GSTAT), 5.5.3 (DRV_STATUS).

use super::REGISTERS;

/// A register that is read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Asked {
    /// GSTAT: the driver has reset; it has switched itself off; its charge pump is too low.
    Global = 0x01,
    /// IFCNT: the datagrams that the driver has taken, modulo 256.
    Taken = 0x02,
    /// DRV_STATUS: temperature, shorts, open wires.
    Driver = 0x6F,
}

/// A step of a round.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// The register with this number is written.
    Write(u8),
    /// A register is read.
    Ask(Asked),
}

/// The steps of a round. A reset is looked for first. The first count shows where the driver's counter stands, the second
/// what has arrived.
pub const ROUND: [Step; 4 + REGISTERS] = {
    let mut round = [Step::Ask(Asked::Taken); 4 + REGISTERS];
    round[0] = Step::Ask(Asked::Global);
    let mut register = 0;
    while register < REGISTERS {
        round[2 + register] = Step::Write(register as u8);
        register += 1;
    }
    round[3 + REGISTERS] = Step::Ask(Asked::Driver);
    round
};

/// Bits of GSTAT. Writing a one clears a bit.
const RESET: u32 = 1;
const OFF: u32 = 1 << 1;
const LOW_PUMP: u32 = 1 << 2;
/// What [`Watch::global`] has the owner write to GSTAT.
pub const CLEARS: u32 = RESET | OFF | LOW_PUMP;
/// Bits of DRV_STATUS: overheat warning, overheated, four shorts, two open wires, standstill.
const WARM: u32 = 1;
const OVERHEATED: u32 = 1 << 1;
const SHORTS: u32 = 0xF << 2;
const OPEN: u32 = 3 << 6;
const STANDS: u32 = 1 << 31;

/// Requests in a row without an answer after which a driver counts as silent.
const MISSES: u8 = 3;
/// Counts in a row that show lost datagrams, after which the settings count as not taken. A single one is noise, and
/// the next round repeats the settings.
const LOSSES: u8 = 3;
/// Readings in a row of an open wire. One may be wrong at high speed.
const OPENS: u8 = 3;

/// The state of a driver, as senders read it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum State {
    /// It has taken its settings, and reports nothing.
    Fine = 0,
    /// It does not answer.
    Silent = 1,
    /// It answers, and has not taken its settings, or not yet.
    Unset = 2,
    /// It has switched its motor off, because it is too hot.
    Overheated = 3,
    /// It has switched its motor off, because a coil is shorted.
    Shorted = 4,
    /// It cannot switch its motor on: its charge pump is too low, as with too low a motor supply.
    NoCharge = 5,
    /// It is hot, and still works.
    Warm = 6,
    /// A wire of its motor seems to be open.
    Open = 7,
}

impl State {
    /// Whether its motor may not be moved.
    pub const fn refuses(self) -> bool {
        !matches!(self, State::Fine | State::Warm | State::Open)
    }
}

/// News, which are told once, as bits.
pub mod news {
    /// The driver has reset, after it had taken its settings: its motor may stand elsewhere.
    pub const RESET: u8 = 1;
    /// The driver has switched its motor off.
    pub const OFF: u8 = 2;
    /// It is hot.
    pub const WARM: u8 = 4;
    /// A wire seems to be open.
    pub const OPEN: u8 = 8;
}

/// What is known of a driver.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Watch {
    /// Its counter when it was read last; `None` before.
    counted: Option<u8>,
    /// Datagrams that have been sent since.
    sent: u8,
    misses: u8,
    losses: u8,
    opens: u8,
    /// Whether its settings have arrived.
    is_set: bool,
    /// Whether they had, before the last reset that was told.
    was_set: bool,
    lacks_charge: bool,
    /// DRV_STATUS.
    status: u32,
    /// Warnings that have been told since the start.
    told: u8,
    /// See [`news`].
    news: u8,
}

impl Watch {
    /// A driver that has not been asked yet.
    pub const NEW: Self = Self {
        counted: None,
        sent: 0,
        misses: 0,
        losses: 0,
        opens: 0,
        is_set: false,
        was_set: false,
        lacks_charge: false,
        status: 0,
        told: 0,
        news: 0,
    };

    /// A driver that has taken its settings.
    pub const WELL: Self = Self { is_set: true, ..Self::NEW };

    /// Returns its state.
    pub fn state(&self) -> State {
        match self.status {
            _ if self.misses >= MISSES => State::Silent,
            _ if !self.is_set => State::Unset,
            status if status & OVERHEATED != 0 => State::Overheated,
            status if status & SHORTS != 0 => State::Shorted,
            _ if self.lacks_charge => State::NoCharge,
            status if status & WARM != 0 => State::Warm,
            _ if self.opens >= OPENS => State::Open,
            _ => State::Fine,
        }
    }

    /// Returns its last DRV_STATUS.
    pub fn status(&self) -> u32 {
        self.status
    }

    /// Takes the worst of the news since the last call, one bit of [`news`]; 0 without any. The others stay.
    pub fn take_news(&mut self) -> u8 {
        let worst = self.news & self.news.wrapping_neg();
        self.news &= !worst;
        worst
    }

    /// Notes that a datagram has been sent which the driver has to count.
    pub fn wrote(&mut self) {
        self.sent = self.sent.wrapping_add(1);
    }

    /// Takes an answer; `None` if there was no valid one. Returns whether the driver has to be given its settings at
    /// once, and GSTAT to be [cleared](CLEARS).
    pub fn answer(&mut self, asked: Asked, value: Option<u32>) -> bool {
        let Some(value) = value else {
            self.misses = self.misses.saturating_add(1);
            if self.misses >= MISSES {
                (self.is_set, self.counted) = (false, None);
            }
            return false;
        };
        self.misses = 0;
        match asked {
            Asked::Taken => self.count(value as u8),
            Asked::Driver => self.look_at(value),
            Asked::Global => return self.global(value),
        }
        false
    }

    /// Compares the driver's counter with what has been sent.
    fn count(&mut self, taken: u8) {
        let (before, sent) = (self.counted.replace(taken), core::mem::take(&mut self.sent));
        let Some(before) = before else { return };
        if before.wrapping_add(sent) != taken {
            self.losses = self.losses.saturating_add(1);
            self.is_set &= self.losses < LOSSES;
        } else if usize::from(sent) >= REGISTERS {
            (self.losses, self.is_set, self.was_set) = (0, true, true);
        }
    }

    fn global(&mut self, value: u32) -> bool {
        self.lacks_charge = value & LOW_PUMP != 0;
        if value & RESET != 0 {
            if core::mem::take(&mut self.was_set) {
                self.news |= news::RESET;
            }
            (self.is_set, self.counted) = (false, None);
        } else if value & OFF != 0 && self.is_set {
            self.news |= news::OFF;
        }
        value & (RESET | OFF) != 0
    }

    fn look_at(&mut self, status: u32) {
        self.status = status;
        let is_open = status & OPEN != 0 && status & STANDS == 0;
        // At standstill nothing is measured.
        if status & STANDS == 0 {
            self.opens = if is_open { self.opens.saturating_add(1) } else { 0 };
        }
        self.warn(status & WARM != 0, news::WARM);
        self.warn(self.opens >= OPENS, news::OPEN);
    }

    /// Makes news of a warning, unless it has been told since the start.
    fn warn(&mut self, is_so: bool, bit: u8) {
        if is_so && self.told & bit == 0 {
            self.told |= bit;
            self.news |= bit;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A driver as it is, with its counter.
    struct Driver {
        watch: Watch,
        counter: u8,
        global: u32,
    }

    impl Driver {
        fn new() -> Self {
            Self { watch: Watch::NEW, counter: 0, global: RESET }
        }

        /// A round; the driver gets `taken` of its datagrams, and answers if it `answers`.
        fn round(&mut self, taken: usize, answers: bool) -> State {
            for step in ROUND {
                match step {
                    Step::Write(n) => {
                        self.watch.wrote();
                        self.counter = self.counter.wrapping_add(u8::from(usize::from(n) < taken));
                    }
                    Step::Ask(asked) => {
                        let value = match asked {
                            Asked::Taken => self.counter.into(),
                            Asked::Global => self.global,
                            Asked::Driver => STANDS,
                        };
                        if self.watch.answer(asked, answers.then_some(value)) {
                            self.global = 0;
                        }
                    }
                }
            }
            self.watch.state()
        }
    }

    #[test]
    fn settings_count_as_taken_when_all_have_been_counted() {
        let mut driver = Driver::new();
        assert_eq!(driver.watch.state(), State::Unset);
        assert_eq!(driver.round(6, true), State::Fine);
        assert_eq!(driver.watch.take_news(), 0, "the reset was before");
        for lost in 0..2 {
            assert_eq!(driver.round(5, true), State::Fine, "noise, {lost}");
        }
        assert_eq!(driver.round(0, true), State::Unset);
        assert_eq!(driver.round(6, true), State::Fine);
        // The counter runs over.
        for _ in 0..100 {
            assert_eq!(driver.round(6, true), State::Fine);
        }
    }

    #[test]
    fn one_that_does_not_answer_is_silent_until_it_has_taken_its_settings() {
        let mut driver = Driver::new();
        assert_eq!(driver.round(0, false), State::Silent);
        assert_eq!(driver.round(5, true), State::Unset);
        assert_eq!(driver.round(6, true), State::Fine);
        assert_eq!(driver.round(6, false), State::Silent);
        assert_eq!(driver.round(6, true), State::Fine, "it was only the line");
        assert_eq!(driver.watch.take_news(), 0);
    }

    #[test]
    fn a_reset_is_news_if_the_driver_was_set() {
        let mut driver = Driver::new();
        driver.round(6, true);
        // The supply fails, and is there again.
        assert_eq!((driver.round(0, false), driver.watch.take_news()), (State::Silent, 0));
        (driver.global, driver.counter) = (RESET, 0);
        assert_eq!(driver.round(5, true), State::Unset);
        assert_eq!(driver.watch.take_news(), news::RESET);
        assert_eq!((driver.round(6, true), driver.watch.take_news()), (State::Fine, 0));
        driver.global = OFF;
        driver.round(6, true);
        assert_eq!(driver.watch.take_news(), news::OFF);
    }

    #[test]
    fn warnings_are_told_once() {
        let mut driver = Driver::new();
        driver.round(6, true);
        let watch = &mut driver.watch;
        let mut after = |status| {
            watch.answer(Asked::Driver, Some(status));
            (watch.state(), watch.take_news())
        };
        assert_eq!(after(STANDS | OPEN), (State::Fine, 0), "not measured");
        assert_eq!(after(OPEN), (State::Fine, 0));
        assert_eq!(after(0), (State::Fine, 0));
        assert_eq!([after(OPEN), after(OPEN)], [(State::Fine, 0); 2]);
        assert_eq!(after(OPEN), (State::Open, news::OPEN));
        assert_eq!(after(STANDS), (State::Open, 0));
        assert_eq!(after(0), (State::Fine, 0));
        assert_eq!(after(WARM), (State::Warm, news::WARM));
        assert_eq!(after(0), (State::Fine, 0));
        assert_eq!(after(WARM), (State::Warm, 0));
        assert_eq!(after(WARM | OVERHEATED), (State::Overheated, 0));
        assert_eq!(after(1 << 5), (State::Shorted, 0));
        assert!(State::Shorted.refuses() && !State::Warm.refuses());
    }
}
