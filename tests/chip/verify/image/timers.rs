//! The six timers, which count in normal mode.

use super::register::Register;

/// A timer.
#[derive(Clone, Copy)]
pub struct Timer {
    control_a: Register,
    control_b: Register,
    /// The low byte. The high byte follows.
    count: Register,
    flags: Register,
    mask: Register,
    is_wide: bool,
    by_64: u8,
}

const GTCCR: Register = Register::at(0x43);
const ASSR: Register = Register::at(0xB6);
/// Holds both prescalers at 0. In GTCCR.
const HOLD: u8 = 1 << 7 | 1 << 1 | 1 << 0;
/// In the flags.
const OVERFLOW: u8 = 1;
/// 1,024 clocks a count, of a wide timer. In the control register B.
const BY_1024: u8 = 0b101;

const fn narrow(number: u16, control: u16, by_64: u8) -> Timer {
    Timer { is_wide: false, count: Register::at(control + 2), by_64, ..wide(number, control) }
}

const fn wide(number: u16, control: u16) -> Timer {
    Timer {
        control_a: Register::at(control),
        control_b: Register::at(control + 1),
        count: Register::at(control + 4),
        flags: Register::at(0x35 + number),
        mask: Register::at(0x6E + number),
        is_wide: true,
        by_64: 0b011,
    }
}

/// Timer 1, for waits.
const ONE: Timer = wide(1, 0x80);

/// Calls `act` with each timer, as a constant, and its number.
#[inline(always)]
pub fn each(mut act: impl FnMut(usize, Timer)) {
    act(0, const { narrow(0, 0x44, 0b011) });
    act(1, ONE);
    act(2, const { narrow(2, 0xB0, 0b100) });
    act(3, const { wide(3, 0x90) });
    act(4, const { wide(4, 0xA0) });
    act(5, const { wide(5, 0x120) });
}

impl Timer {
    /// Sets the count to 0, and clears the flag.
    #[inline(always)]
    fn clear(self) {
        if self.is_wide {
            Register::at(self.count.address() + 1).put(0);
        }
        self.count.put(0);
        self.flags.put(OVERFLOW);
    }

    /// The count. A wide timer latches its high byte when the low byte is read.
    #[inline(always)]
    pub fn count(self) -> u16 {
        let low = self.count.get();
        let high = if self.is_wide { Register::at(self.count.address() + 1).get() } else { 0 };
        u16::from_le_bytes([low, high])
    }

    /// Takes the flag that the count has overflowed.
    #[inline(always)]
    pub fn takes_overflow(self) -> bool {
        let has = self.flags.get() & OVERFLOW != 0;
        if has {
            self.flags.put(OVERFLOW);
        }
        has
    }

    /// Number of bits of the count.
    #[inline(always)]
    pub fn bits(self) -> u8 {
        if self.is_wide { 16 } else { 8 }
    }
}

/// Stops all timers, in normal mode, without interrupts.
pub fn stop() {
    each(|_, timer| {
        timer.control_b.put(0);
        timer.control_a.put(0);
        timer.mask.put(0);
    });
    ASSR.put(0);
}

/// Stops all timers at 0, and holds the prescalers, so that [`go`] starts all at the same moment.
#[inline(never)]
pub fn prepare() {
    halt();
    each(|_, timer| timer.clear());
    GTCCR.put(HOLD);
}

/// Starts all timers, at 64 clocks a count. Cost: 18 cycles.
#[inline(always)]
pub fn go() {
    each(|_, timer| timer.control_b.put(timer.by_64));
    GTCCR.put(0);
}

/// Stops all timers, which keep their counts. Cost: 14 cycles.
#[inline(always)]
pub fn halt() {
    each(|_, timer| timer.control_b.put(0));
}

/// A time that passes, up to 4 s.
pub struct Wait(());

impl Wait {
    /// The time begins now. Timer 1 is in use from now on.
    pub fn begin() -> Self {
        ONE.control_b.put(BY_1024);
        let wait = Self(());
        wait.again();
        wait
    }

    /// The time begins anew.
    #[inline(always)]
    pub fn again(&self) {
        ONE.clear();
    }

    /// Whether so many milliseconds have passed, less a tenth of one.
    #[inline(always)]
    pub fn is_over(&self, ms: u32) -> bool {
        ONE.count() >= (ms * 16_000 / 1_024) as u16
    }
}
