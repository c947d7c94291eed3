//! Spindle and coolant: decides the state of their outputs. Touches no pin.
//!
//! [`Spindle`] holds the settings `p1`, `sp` and `co`, and the spindle override. [`Spindle::share`] computes the duty
//! cycle of the PWM output: the part of its period during which the output is high. It depends on the [`Spindle`], on
//! the outputs that a program has switched on ([`outputs`]) and on S. This one function serves every cause, so a change
//! of S, of the override or of a setting always gives a consistent output. The function limits S to the range of the
//! direction. S itself keeps the programmed value.
//!
//! [`divide`] computes a timer's prescaler and count from a frequency. Exec and thread mode share the [`Spindle`]
//! (`tasks::spindle`). Units: turns per minute, thousandths of a period, ms. Cost of a share: 2,500 cycles.

use crate::boards::outputs::{self, COUNTERCLOCKWISE, SPINDLE};
use crate::config::{Owner, Setting};

/// Row numbers in the settings table of `p1`. Rows 1 to 4 are the range of clockwise, rows 5 to 8 that of
/// counterclockwise.
const FREQUENCY: u8 = 0;
const OFF: u8 = 9;
/// Row numbers in the settings table of `sp`.
const PAUSES: u8 = 0;
const SPIN_UP: u8 = 1;
const ENABLE_HIGH: u8 = 2;
const CLOCKWISE_HIGH: u8 = 3;

/// A whole period, in thousandths.
pub const WHOLE: u16 = 1_000;

/// The lowest and the highest speed of a direction, and the duty cycle at each, in thousandths.
#[derive(Clone, Copy, Debug, Default)]
struct Range {
    low: f32,
    high: f32,
    low_share: u16,
    high_share: u16,
}

/// The settings of spindle and coolant, and the spindle override.
#[derive(Clone, Copy, Debug)]
pub struct Spindle {
    ranges: [Range; 2],
    /// The duty cycle while the spindle does not turn, in thousandths.
    off: u16,
    /// The spindle override: the factor of S, in thousandths.
    factor: u16,
    /// How long moves wait after the spindle has been started or reversed, ms.
    spin_up: u16,
    /// The outputs that are switched off in a feedhold, as bits, and the bit [`STOPPED`].
    pauses: u8,
    /// Outputs that are on when they are low, as bits.
    low: u8,
}

/// A bit of [`Spindle::pauses`]: the sender has stopped the spindle during the present hold. No output has this bit.
const STOPPED: u8 = 0x80;

/// The effect of a changed setting.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Changed {
    /// The outputs stay as they are.
    Nothing,
    /// The outputs have to be computed and set again.
    Outputs,
    /// The PWM frequency changes to this value, thousandths of a Hz.
    Frequency(u32),
}

#[small]
impl Spindle {
    /// Returns a spindle without settings: everything is 0, except that the override is 100 %.
    pub const fn new() -> Self {
        let range = Range { low: 0.0, high: 0.0, low_share: 0, high_share: 0 };
        Self { ranges: [range; 2], off: 0, factor: 1_000, spin_up: 0, pauses: 0, low: 0 }
    }

    /// Takes over the value of a setting, in the scale in which the settings keep it.
    pub fn set(&mut self, setting: Setting, value: i32) -> Changed {
        match setting.owner() {
            Owner::Pwm => return self.set_pwm(setting.index(), value),
            Owner::Spindle => match setting.index() {
                PAUSES => choose(&mut self.pauses, SPINDLE | COUNTERCLOCKWISE, value != 0),
                SPIN_UP => self.spin_up = value as u16,
                ENABLE_HIGH => choose(&mut self.low, SPINDLE, value == 0),
                CLOCKWISE_HIGH => choose(&mut self.low, COUNTERCLOCKWISE, value != 0),
                _ => {}
            },
            Owner::Coolant => {
                choose(&mut self.pauses, outputs::MIST | outputs::FLOOD, value != 0);
            }
            _ => return Changed::Nothing,
        }
        Changed::Outputs
    }

    fn set_pwm(&mut self, row: u8, value: i32) -> Changed {
        match row {
            FREQUENCY => return Changed::Frequency(value.unsigned_abs()),
            OFF => self.off = value as u16,
            _ => {
                let [clockwise, counterclockwise] = &mut self.ranges;
                let range = if row < 5 { clockwise } else { counterclockwise };
                match (row - 1) & 3 {
                    0 => range.low = value as f32 * 1e-3,
                    1 => range.high = value as f32 * 1e-3,
                    2 => range.low_share = value as u16,
                    _ => range.high_share = value as u16,
                }
            }
        }
        Changed::Outputs
    }

    /// Limits `speed`, so that the spindle turns at `most` at the fastest after the override is applied.
    pub fn limited(&self, speed: f32, most: f32) -> f32 {
        let most = most * 1e3 / f32::from(self.factor);
        if speed < most { speed } else { most }
    }

    /// Sets the override in thousandths. Returns whether it has changed.
    pub fn set_factor(&mut self, thousandths: u16) -> bool {
        core::mem::replace(&mut self.factor, thousandths) != thousandths
    }

    /// Returns the duty cycle of the PWM output, in thousandths. `on` are the outputs that a program has switched on,
    /// and `speed` is S.
    pub fn share(&self, on: u8, speed: f32) -> f32 {
        let [clockwise, counterclockwise] = &self.ranges;
        let range = if on & COUNTERCLOCKWISE == 0 { clockwise } else { counterclockwise };
        let speed =
            if self.factor == 1_000 { speed } else { speed * f32::from(self.factor) * 1e-3 };
        if on & SPINDLE == 0 || speed <= 0.0 {
            return self.off.into();
        }
        let (low, high) = (f32::from(range.low_share), f32::from(range.high_share));
        if speed >= range.high {
            high
        } else if speed <= range.low {
            low
        } else {
            low + (speed - range.low) * (high - low) / (range.high - range.low)
        }
    }

    /// Returns the outputs in `on` that stay on during a feedhold.
    pub fn held(&self, on: u8) -> u8 {
        let stopped = if self.pauses & STOPPED != 0 { SPINDLE | COUNTERCLOCKWISE } else { 0 };
        on & !(self.pauses | stopped)
    }

    /// Toggles whether the sender has stopped the spindle during the feedhold.
    pub fn pause(&mut self) {
        self.pauses ^= STOPPED;
    }

    /// Ends a stop by the sender, because the feedhold is over.
    pub fn go_on(&mut self) {
        self.pauses &= !STOPPED;
    }

    /// Returns the outputs that are on when they are low, as bits.
    pub fn low(&self) -> u8 {
        self.low
    }

    /// Returns how long moves wait after the outputs have changed from `before` to `on`, ms. 0 unless the spindle has
    /// been started or reversed.
    pub fn spin_up(&self, before: u8, on: u8) -> u16 {
        let turns = SPINDLE | COUNTERCLOCKWISE;
        if on & SPINDLE != 0 && (before ^ on) & turns != 0 { self.spin_up } else { 0 }
    }
}

#[small]
impl Default for Spindle {
    fn default() -> Self {
        Self::new()
    }
}

#[small]
fn choose(bits: &mut u8, which: u8, on: bool) {
    *bits = if on { *bits | which } else { *bits & !which };
}

/// Computes the prescaler and the top count of a 16-bit timer that counts up and down, for a PWM frequency. Prescaler 1
/// stands for no division. A frequency that is too low for the timer gives the lowest possible one.
#[small]
pub fn divide(clock_hz: u32, millihertz: u32) -> (u8, u16) {
    let mut counts = clock_hz as f32 * 500.0 / millihertz as f32;
    let mut prescaler = 1;
    while counts > 65_535.0 && prescaler < 5 {
        counts *= if prescaler < 3 { 0.125 } else { 0.25 };
        prescaler += 1;
    }
    let top = if counts > 65_535.0 { 65_535.0 } else { counts + 0.5 };
    (prescaler, top as u32 as u16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Name;

    /// A hobby ESC.
    const ESC: [(&str, i32); 9] = [
        ("p1csl", 1_000_000),
        ("p1csh", 2_000_000),
        ("p1cpl", 125),
        ("p1cph", 200),
        ("p1wsl", 1_000_000),
        ("p1wsh", 2_000_000),
        ("p1wpl", 125),
        ("p1wph", 200),
        ("p1pof", 100),
    ];

    fn spindle(settings: &[(&str, i32)]) -> Spindle {
        with_defaults(&[&ESC, settings].concat())
    }

    fn with_defaults(settings: &[(&str, i32)]) -> Spindle {
        let mut spindle = Spindle::new();
        for setting in (Setting::WARM..Setting::COLD).filter_map(Setting::from_number) {
            spindle.set(setting, setting.default_value());
        }
        for (name, value) in settings {
            let name = Name::new().with(name.as_bytes()).unwrap();
            spindle.set(Setting::find(&name).unwrap(), *value);
        }
        spindle
    }

    const CCW: u8 = SPINDLE | COUNTERCLOCKWISE;

    #[test]
    fn speed_becomes_a_share() {
        let spindle =
            spindle(&[("p1csl", 0), ("p1csh", 12_000_000), ("p1cpl", 0), ("p1cph", 1_000)]);
        for (on, speed, share) in [
            (SPINDLE, 6_000.0, 500.0),
            (SPINDLE, 0.012, 0.001),
            (SPINDLE, 12_000.0, 1_000.0),
            (SPINDLE, 20_000.0, 1_000.0),
            (SPINDLE, 0.0, 100.0),
            (0, 6_000.0, 100.0),
            (COUNTERCLOCKWISE, 6_000.0, 100.0),
            (CCW, 500.0, 125.0),
            (CCW, 1_500.0, 162.5),
            (CCW, 6_000.0, 200.0),
        ] {
            assert!((spindle.share(on, speed) - share).abs() < 1e-4, "{on} {speed}");
        }
    }

    #[test]
    fn by_default_off_is_off_and_the_range_is_a_spindle_s() {
        let spindle = with_defaults(&[]);
        for (on, speed, share) in [
            (0, 6_000.0, 0.0),
            (SPINDLE, 0.0, 0.0),
            (SPINDLE, 6_000.0, 250.0),
            (CCW, 12_000.0, 500.0),
            (SPINDLE, 24_000.0, 1_000.0),
            (SPINDLE, 30_000.0, 1_000.0),
        ] {
            assert!((spindle.share(on, speed) - share).abs() < 1e-4, "{on} {speed}");
        }
    }

    #[test]
    fn an_override_stays_within_the_range() {
        let mut spindle = spindle(&[]);
        let at = |spindle: &Spindle| spindle.share(SPINDLE, 1_500.0);
        assert_eq!(at(&spindle), 162.5);
        for (factor, share) in [(1_200, 185.0), (2_000, 200.0), (50, 125.0), (1_000, 162.5)] {
            spindle.set_factor(factor);
            assert!((at(&spindle) - share).abs() < 1e-3, "{factor}");
            assert_eq!(spindle.share(SPINDLE, 0.0), 100.0);
        }
    }

    #[test]
    fn a_range_without_width_divides_by_nothing() {
        for (low, high) in [(0, 0), (1_000_000, 1_000_000), (2_000_000, 1_000_000)] {
            let spindle = spindle(&[("p1csl", low), ("p1csh", high)]);
            for speed in [0.1, 1_000.0, 1_500.0, 1e9] {
                let share = spindle.share(SPINDLE, speed);
                assert!(share == 125.0 || share == 200.0, "{low} {high} {speed}: {share}");
            }
        }
    }

    #[test]
    fn a_start_and_a_reversal_take_time() {
        let spindle = spindle(&[("spde", 1_500)]);
        for (before, on, ms) in [
            (0, SPINDLE, 1_500),
            (SPINDLE, CCW, 1_500),
            (CCW, SPINDLE, 1_500),
            (SPINDLE, SPINDLE | outputs::MIST, 0),
            (SPINDLE, 0, 0),
            (CCW, 0, 0),
            (0, outputs::FLOOD, 0),
        ] {
            assert_eq!(spindle.spin_up(before, on), ms, "{before} {on}");
        }
    }

    #[test]
    fn holds_and_levels_are_as_set() {
        let all = 0b1111;
        let usual = spindle(&[]);
        assert_eq!((usual.held(all), usual.low()), (all, 0));
        let other = spindle(&[("spph", 1), ("coph", 1), ("spep", 0), ("spdp", 1)]);
        assert_eq!((other.held(all), other.low()), (0, CCW));
    }

    #[test]
    fn any_frequency_is_met_as_closely_as_counts_go() {
        let ratios = [0.0, 1.0, 8.0, 64.0, 256.0, 1024.0];
        for millihertz in [122, 1_000, 50_000, 100_000, 1_907_000, 25_000_000, i32::MAX as u32] {
            let (prescaler, top) = divide(16_000_000, millihertz);
            let counts = 8e9 / ratios[usize::from(prescaler)] / f64::from(millihertz);
            assert!((f64::from(top) - counts).abs() <= 0.502, "{millihertz} {prescaler} {top}");
            // The prescaler is no greater than it has to be.
            assert!(prescaler == 1 || top > 8_190, "{millihertz} {prescaler} {top}");
            assert!(top > 2);
        }
        assert_eq!(divide(16_000_000, 100_000), (2, 10_000));
        assert_eq!(divide(16_000_000, 0), (5, 65_535));
    }
}
