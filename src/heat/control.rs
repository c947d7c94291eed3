//! Temperature control: PID with anti-windup, or on-off control with a hysteresis.
//!
//! Stepped five times a second. Temperatures are in 1/64 degree. Full power is 255. Farther than [`RANGE`] from the
//! target the power is full or 0. Within this range it is
//!
//! `power = p * error + sum of i * error * time - d * change in a second + f * fan`
//!
//! The integral changes only while the power is within its bounds, or towards them. With `p` 0 the heater is switched
//! on half the hysteresis below the target, and off half the hysteresis above it. Cost of a step: 2,500 cycles.

use super::sensor::UNIT;

/// Steps in a second.
pub const STEPS: i32 = 5;
/// Full power.
pub const FULL: u8 = 255;
/// PID control is used within this distance of the target, 1/64 degree.
const RANGE: i16 = 12 * UNIT;
/// The unit of factors: hundredths.
const HUNDREDTHS: i32 = 100;

/// The factors of a heater.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Factors {
    /// Proportional: hundredths of power per degree.
    pub p: u16,
    /// Integral: hundredths of power per degree and second.
    pub i: u16,
    /// Derivative: hundredths of power per degree a second.
    pub d: u16,
    /// Feed-forward: additional power while the fan runs at full speed.
    pub fan: u8,
    /// Width of the hysteresis if `p` is 0, 1/64 degree.
    pub hysteresis: u16,
}

/// The state of the control.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Control {
    /// The integral, in hundredths of power by 1/64 degree by a step.
    sum: i32,
    /// Smoothed rise of the temperature a step, in sixteenths of 1/64 degree.
    slope: i16,
    /// The temperature in the last step, 1/64 degree.
    last: i16,
    /// The power of the last step.
    power: u8,
}

/// The integral that gives full power.
const SUM_MAX: i32 = FULL as i32 * HUNDREDTHS * UNIT as i32 * STEPS;

#[small]
impl Control {
    /// The state at start-up.
    pub const OFF: Self = Self { sum: 0, slope: 0, last: 0, power: 0 };

    /// The present power, 255 for full power.
    pub fn power(&self) -> u8 {
        self.power
    }

    /// Switches off. The slope of the temperature is still measured.
    pub fn stop(&mut self, now: i16) {
        self.measure(now);
        (self.sum, self.power) = (0, 0);
    }

    /// Gives no power in the next step. The integral stays.
    pub fn rest(&mut self, now: i16) {
        self.measure(now);
        self.power = 0;
    }

    /// Sets the power of the next step.
    pub fn drive(&mut self, now: i16, power: u8) {
        self.measure(now);
        (self.sum, self.power) = (0, power);
    }

    /// Returns the power of the next step, to get from `now` to `wanted`, 1/64 degree; `fan` is the fan's speed, 255
    /// for full.
    #[inline(never)]
    pub fn step(&mut self, now: i16, wanted: i16, fan: u8, factors: &Factors) -> u8 {
        self.measure(now);
        let error = wanted.saturating_sub(now);
        self.power = match () {
            () if factors.p == 0 => self.switch(error, factors),
            () if error > RANGE => FULL,
            () if error < -RANGE => {
                self.sum = 0;
                0
            }
            () => self.regulate(error, fan, factors),
        };
        self.power
    }

    #[inline(never)]
    #[small]
    fn measure(&mut self, now: i16) {
        let change = i32::from(now) - i32::from(self.last);
        let change = change.clamp(-200, 200) as i16;
        self.last = now;
        // A low-pass filter with a time constant of a second and a half.
        self.slope += (change * 16 - self.slope) / 8;
    }

    fn switch(&self, error: i16, factors: &Factors) -> u8 {
        let half = (factors.hysteresis / 2).min(RANGE as u16) as i16;
        match () {
            () if error > half => FULL,
            () if error < -half => 0,
            () => self.power,
        }
    }

    fn regulate(&mut self, error: i16, fan: u8, factors: &Factors) -> u8 {
        let (p, i, d) = (i32::from(factors.p), i32::from(factors.i), i32::from(factors.d));
        let error = i32::from(error);
        // In hundredths by 1/64 degree.
        let wanted = p * error - d * i32::from(self.slope) * STEPS / 16;
        let wanted = wanted / (HUNDREDTHS * UNIT as i32);
        let ahead = i32::from(factors.fan) * i32::from(fan) / i32::from(FULL);
        let sum = (self.sum + i * error).clamp(0, SUM_MAX);
        let power = wanted + ahead + sum / (HUNDREDTHS * UNIT as i32 * STEPS);
        let grows = sum > self.sum;
        if (power < i32::from(FULL) || !grows) && (power > 0 || grows) {
            self.sum = sum;
        }
        power.clamp(0, FULL.into()) as u8
    }
}

/// Returns the power of a pin until the next sample: `power` if the chip makes PWM of it, else full or none
/// ([`spread`]).
#[small]
pub fn level(pulsed: bool, owed: &mut u8, power: u8) -> u8 {
    match pulsed {
        true => power,
        false if spread(owed, power) => FULL,
        false => 0,
    }
}

/// Pulse-density modulation: returns whether the pin is on until the next sample, so that its share of time on is
/// `power`.
#[small]
pub fn spread(owed: &mut u8, power: u8) -> bool {
    if power == FULL {
        return true;
    }
    let (sum, on) = owed.overflowing_add(power);
    *owed = sum;
    on
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACTORS: Factors = Factors { p: 2_000, i: 100, d: 8_000, fan: 40, hysteresis: 128 };

    #[test]
    fn power_is_within_its_bounds_whatever_comes() {
        let wild =
            Factors { p: u16::MAX, i: u16::MAX, d: u16::MAX, fan: 255, hysteresis: u16::MAX };
        for factors in [FACTORS, wild, Factors { p: 0, ..wild }, Factors { d: 0, ..wild }] {
            let mut control = Control::OFF;
            let mut now = 0i16;
            for n in 0..20_000u32 {
                now = now.wrapping_add((n.wrapping_mul(2_654_435_761) >> 17) as i16);
                let wanted = if n % 50 < 25 { 200 * UNIT } else { now.saturating_add(UNIT) };
                control.step(now, wanted, n as u8, &factors);
                assert!((0..=SUM_MAX).contains(&control.sum));
            }
        }
    }

    #[test]
    fn far_away_it_is_all_or_nothing_and_the_sum_waits() {
        let mut control = Control::OFF;
        for _ in 0..100 {
            assert_eq!(control.step(20 * UNIT, 200 * UNIT, 0, &FACTORS), FULL);
        }
        assert_eq!(control.sum, 0);
        assert_eq!(control.step(250 * UNIT, 200 * UNIT, 0, &FACTORS), 0);
    }

    #[test]
    fn a_switch_keeps_to_its_hysteresis() {
        let factors = Factors { p: 0, ..FACTORS };
        let mut control = Control::OFF;
        let mut at = |degrees: f64| control.step((degrees * 64.0) as i16, 60 * UNIT, 0, &factors);
        for (degrees, power) in
            [(20.0, 255), (59.5, 255), (60.5, 255), (61.1, 0), (60.5, 0), (59.1, 0), (58.9, 255)]
        {
            assert_eq!(at(degrees), power, "{degrees}");
        }
    }

    #[test]
    fn power_is_spread_evenly() {
        for power in [0u8, 1, 64, 128, 200, 254, 255] {
            let mut owed = 0;
            let on = (0..2_560).filter(|_| spread(&mut owed, power)).count();
            let expected = if power == FULL { 2_560 } else { usize::from(power) * 10 };
            assert_eq!(on, expected);
        }
    }
}
