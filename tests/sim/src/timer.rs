//! The 8-bit and 16-bit timers.
//!
//! Timers count in normal, CTC and fast PWM modes from a free-running prescaler. A stopped timer keeps its count and
//! continues from it. A flag raised while its interrupt is masked stays raised. A match is blocked for one timer
//! clock after the counter was written. The TEMP register of the 16-bit timers is modelled, so an access torn by an
//! interrupt goes wrong as on the chip. The phase-correct modes count like fast PWM. Not modelled: input capture,
//! waveform pins. An edge of an external clock is counted at once, not at the next cycle of the CPU.
//!
//! Nothing here runs in each cycle. A timer knows the cycle of its next flag, and its count at any time follows from
//! the last known count.

mod layout;

pub use layout::{ATMEGA1284P, ATMEGA2560, Layout};

/// The cycle of an event that never comes.
const NEVER: u64 = u64::MAX;

/// Clock select: rising edges of the pin.
const EXTERNAL: u8 = 7;

// Bits of TIFR and TIMSK; compare channel n is bit `COMPARE + n`.
const OVERFLOW: usize = 0;
pub(crate) const COMPARE: usize = 1;
const CAPTURE: usize = 5;
/// The event at which double-buffered compare values take effect; it has no flag.
const LATCH: usize = 6;
const EVENTS: usize = 7;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Wave {
    Normal,
    Ctc,
    Pwm,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Top {
    Fixed(u32),
    CompareA,
    Capture,
}

/// One timer.
pub struct Timer {
    layout: &'static Layout,
    max: u32,
    control_a: u8,
    control_b: u8,
    wave: Wave,
    top_source: Top,
    /// Cycles per count; 0 when stopped.
    prescale: u64,
    top: u32,
    compare: [u32; 3],
    /// The values written to the compare registers; in PWM modes they wait for the next wrap.
    compare_buffer: [u32; 3],
    capture: u32,
    temp: u8,
    flags: u8,
    mask: u8,
    /// `count` was the count at timer clock `tick` (cycle / prescale).
    count: u32,
    tick: u64,
    /// Whether matches are blocked in the timer clock `tick`.
    blocked: bool,
    next: [u64; EVENTS],
    due: u64,
    last_event: u64,
    missed: u64,
    /// A fault: the rate at which it counts, as a share of the right rate.
    pace: f64,
}

impl Timer {
    /// A timer in its state after reset.
    pub fn new(layout: &'static Layout) -> Self {
        let max = if layout.wide { 0xFFFF } else { 0xFF };
        Timer {
            layout,
            max,
            control_a: 0,
            control_b: 0,
            wave: Wave::Normal,
            top_source: Top::Fixed(max),
            prescale: 0,
            top: max,
            compare: [0; 3],
            compare_buffer: [0; 3],
            capture: 0,
            temp: 0,
            flags: 0,
            mask: 0,
            count: 0,
            tick: 0,
            blocked: false,
            next: [NEVER; EVENTS],
            due: NEVER,
            last_event: 0,
            missed: 0,
            pace: 1.0,
        }
    }

    /// Puts it into its state after reset. A fault stays.
    pub fn reset(&mut self) {
        *self = Timer { pace: self.pace, ..Timer::new(self.layout) };
    }

    /// A fault: from now on it counts at this share of the right rate, rounded to whole cycles a count; 0: it stands
    /// still, 1: it is right.
    pub fn set_pace(&mut self, pace: f64, now: u64) {
        self.sync(now);
        self.pace = pace;
        self.find_prescale(now);
        self.plan();
    }

    /// Cycle of the next flag.
    pub fn due(&self) -> u64 {
        self.due
    }

    /// Cycle of the latest flag.
    pub fn last_event(&self) -> u64 {
        self.last_event
    }

    /// Number of CTC tops that were written when the counter had already passed them. Each costs a whole wrap.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// Whether the timer counts.
    pub fn runs(&self) -> bool {
        self.prescale != 0
    }

    /// Vectors that ask for service, as a bit set.
    pub fn lines(&self) -> u64 {
        let mut active = self.flags & self.mask;
        let mut lines = 0;
        while active != 0 {
            lines |= 1 << self.layout.vectors[active.trailing_zeros() as usize];
            active &= active - 1;
        }
        lines
    }

    /// Takes note that the interrupt is being served: its flag is cleared.
    pub fn acknowledge(&mut self, vector: u8, now: u64) {
        if let Some(bit) = self.layout.vectors.iter().position(|v| *v == vector) {
            self.clear(1 << bit, now);
        }
    }

    /// Raises every flag that is due by `now`.
    pub fn advance(&mut self, now: u64) {
        while self.due <= now {
            let tick = self.due / self.prescale;
            self.last_event = self.due;
            let next = self.next;
            self.rebase(tick);
            for (bit, at) in next.iter().enumerate().take(LATCH) {
                if *at == tick {
                    self.flags |= 1 << bit;
                }
            }
            if next[LATCH] == tick {
                self.compare = self.compare_buffer;
                self.find_top();
            }
            self.plan();
        }
    }

    /// A store to one of the registers of `layout`, taking effect at cycle `now`.
    pub fn write(&mut self, addr: u16, value: u8, now: u64) {
        self.sync(now);
        let l = self.layout;
        if l.wide && l.is_high_byte(addr) {
            self.temp = value;
            return;
        }
        let word = u32::from(value) | if l.wide { u32::from(self.temp) << 8 } else { 0 };
        if addr == l.tifr {
            self.flags &= !value;
        } else if addr == l.timsk {
            self.mask = value & l.implemented();
        } else if addr == l.tcnt {
            self.count = word;
            self.blocked = true;
        } else if addr == l.tccra {
            self.control_a = value;
            self.find_mode();
        } else if addr == l.tccrb {
            self.control_b = value;
            self.find_mode();
            self.find_prescale(now);
        } else if let Some(channel) = l.ocr.iter().position(|r| *r == addr) {
            self.write_compare(channel, word);
        } else if addr == l.icr {
            self.capture = word;
            self.find_top();
        }
        self.plan();
    }

    /// A load from TCNT or TIFR that samples at cycle `now`; `None` for other registers.
    pub fn read(&mut self, addr: u16, now: u64) -> Option<u8> {
        let l = self.layout;
        if addr == l.tifr {
            self.advance(now);
            Some(self.flags)
        } else if addr == l.tcnt {
            let count = self.count_at(self.tick_at(now));
            self.temp = (count >> 8) as u8;
            Some(count as u8)
        } else if l.wide && addr == l.tcnt + 1 {
            Some(self.temp)
        } else {
            None
        }
    }

    /// Clears flags, as a one written to TIFR does.
    pub fn clear(&mut self, bits: u8, now: u64) {
        self.sync(now);
        self.flags &= !bits;
        self.plan();
    }

    /// A rising edge of the external clock. Counts it if the timer is set to count such edges.
    pub fn rising_edge(&mut self) {
        if self.control_b & 7 == EXTERNAL && self.pace != 0.0 {
            self.count = if self.count >= self.max { 0 } else { self.count + 1 };
        }
    }

    fn write_compare(&mut self, channel: usize, word: u32) {
        self.compare_buffer[channel] = word;
        if self.wave != Wave::Pwm {
            self.compare[channel] = word;
            let before = self.top;
            self.find_top();
            let running = self.prescale != 0 && self.wave == Wave::Ctc;
            if running && self.top != before && self.count > self.top {
                self.missed += 1;
            }
        }
    }

    fn find_prescale(&mut self, now: u64) {
        let right = self.layout.prescale[usize::from(self.control_b & 7)];
        let prescale = if self.pace == 1.0 { right } else { paced(right, self.pace) };
        if prescale != self.prescale {
            self.prescale = prescale;
            self.tick = now.checked_div(prescale).unwrap_or(0);
        }
    }

    fn find_mode(&mut self) {
        let low = self.control_a & 3;
        let (wave, top) = if self.layout.wide {
            wide_mode(low | (self.control_b >> 1 & 0xC))
        } else {
            narrow_mode(low | (self.control_b >> 1 & 4))
        };
        (self.wave, self.top_source) = (wave, top);
        if wave != Wave::Pwm {
            self.compare = self.compare_buffer;
        }
        self.find_top();
    }

    fn find_top(&mut self) {
        self.top = match self.top_source {
            Top::Fixed(top) => top,
            Top::CompareA => self.compare[0],
            Top::Capture => self.capture,
        };
    }

    fn tick_at(&self, cycle: u64) -> u64 {
        cycle.checked_div(self.prescale).map_or(0, |tick| tick.max(self.tick))
    }

    /// Returns the count at a timer clock not before `tick`.
    fn count_at(&self, tick: u64) -> u32 {
        let period = u64::from(self.top) + 1;
        let reached = u64::from(self.count) + tick.saturating_sub(self.tick);
        if self.count <= self.top {
            (reached % period) as u32
        } else if reached <= u64::from(self.max) {
            reached as u32
        } else {
            ((reached - u64::from(self.max) - 1) % period) as u32
        }
    }

    fn rebase(&mut self, tick: u64) {
        if tick > self.tick {
            self.count = self.count_at(tick);
            self.tick = tick;
            self.blocked = false;
        }
    }

    fn sync(&mut self, now: u64) {
        self.advance(now);
        if let Some(tick) = now.checked_div(self.prescale) {
            self.rebase(tick);
        }
    }

    /// Returns the timer clock at which the flag of a match with `value` goes up: one after the match.
    fn match_tick(&self, value: u32) -> u64 {
        let (count, top) = (u64::from(self.count), u64::from(self.top));
        let value = u64::from(value);
        let missed_now = value < count || (value == count && self.blocked);
        let wait = if count > top && !missed_now {
            value - count
        } else if value > top {
            return NEVER;
        } else if !missed_now {
            value - count
        } else {
            let last = if count > top { u64::from(self.max) } else { top };
            last + 1 - count + value
        };
        self.tick + wait + 1
    }

    /// Returns the timer clock at which the counter is 0 again.
    fn wrap_tick(&self) -> u64 {
        let last = if self.count > self.top { self.max } else { self.top };
        self.tick + u64::from(last - self.count) + 1
    }

    fn wants(&self, bit: usize) -> bool {
        self.flags >> bit & 1 == 0
    }

    /// Computes when each flag that is down goes up next.
    fn plan(&mut self) {
        self.next = [NEVER; EVENTS];
        self.due = NEVER;
        if self.prescale == 0 {
            return;
        }
        for channel in 0..self.layout.channels() {
            if self.wants(COMPARE + channel) {
                self.next[COMPARE + channel] = self.match_tick(self.compare[channel]);
            }
        }
        let overflows = self.wave != Wave::Ctc || self.count > self.top || self.top == self.max;
        if overflows && self.wants(OVERFLOW) {
            self.next[OVERFLOW] = self.wrap_tick();
        }
        if self.top_source == Top::Capture && self.wants(CAPTURE) {
            self.next[CAPTURE] = self.match_tick(self.top);
        }
        if self.wave == Wave::Pwm && self.compare != self.compare_buffer {
            self.next[LATCH] = self.wrap_tick();
        }
        let first = self.next.into_iter().min().unwrap_or(NEVER);
        self.due = first.saturating_mul(self.prescale);
    }
}

/// Returns the cycles per count of a timer that counts at a share of the right rate; 0 when it stands still.
fn paced(prescale: u64, pace: f64) -> u64 {
    let cycles = (prescale as f64 / pace).round();
    if prescale == 0 || !cycles.is_finite() { 0 } else { (cycles as u64).max(1) }
}

/// Waveform generation modes of timers 0 and 2.
fn narrow_mode(mode: u8) -> (Wave, Top) {
    match mode {
        2 => (Wave::Ctc, Top::CompareA),
        1 | 3 => (Wave::Pwm, Top::Fixed(0xFF)),
        5 | 7 => (Wave::Pwm, Top::CompareA),
        _ => (Wave::Normal, Top::Fixed(0xFF)),
    }
}

/// Waveform generation modes of timers 1, 3, 4 and 5.
fn wide_mode(mode: u8) -> (Wave, Top) {
    match mode {
        1 | 5 => (Wave::Pwm, Top::Fixed(0xFF)),
        2 | 6 => (Wave::Pwm, Top::Fixed(0x1FF)),
        3 | 7 => (Wave::Pwm, Top::Fixed(0x3FF)),
        4 => (Wave::Ctc, Top::CompareA),
        12 => (Wave::Ctc, Top::Capture),
        8 | 10 | 14 => (Wave::Pwm, Top::Capture),
        9 | 11 | 15 => (Wave::Pwm, Top::CompareA),
        _ => (Wave::Normal, Top::Fixed(0xFFFF)),
    }
}

#[cfg(test)]
mod tests;
