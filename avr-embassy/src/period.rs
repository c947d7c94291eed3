//! How an 8-bit timer makes milliseconds out of a clock.

/// A millisecond in counts of the timer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Period {
    /// The code of the prescaler.
    pub select: u8,
    /// Whole counts, 2 to 255.
    pub counts: u8,
    /// What is left beside the whole counts, in parts of a count.
    pub parts: u8,
    /// How many parts a count has: at most 128, so that the sum of two numbers of parts fits a byte.
    pub of: u8,
}

impl Period {
    /// Finds the period of a millisecond: with the finest prescaler that leaves no parts, or, if all leave parts,
    /// with the finest one. `None` if a millisecond does not fit the timer, or takes smaller parts. A prescaler is
    /// its code and the cycles of a count.
    pub const fn new(clock_hz: u32, prescalers: &[(u8, u32)]) -> Option<Period> {
        let (mut uneven, mut n) = (None, 0);
        while n < prescalers.len() {
            let (select, cycles) = prescalers[n];
            if let Some(period) = Self::by(clock_hz, select, cycles) {
                if period.parts == 0 {
                    return Some(period);
                }
                if uneven.is_none() {
                    uneven = Some(period);
                }
            }
            n += 1;
        }
        uneven
    }

    const fn by(clock_hz: u32, select: u8, cycles: u32) -> Option<Period> {
        let count_hz = cycles * 1_000;
        let (counts, left) = (clock_hz / count_hz, clock_hz % count_hz);
        // Finds the greatest common divisor, to reduce the fraction to lowest terms.
        let (mut divisor, mut rest) = (count_hz, left);
        while rest != 0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        let (parts, of) = (left / divisor, count_hz / divisor);
        if counts < 2 || counts > 255 || of > 128 {
            return None;
        }
        Some(Period { select, counts: counts as u8, parts: parts as u8, of: of as u8 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRESCALERS: [(u8, u32); 4] = [(2, 8), (3, 64), (4, 256), (5, 1024)];

    fn period(clock_hz: u32) -> Option<(u8, u8, u8, u8)> {
        let found = Period::new(clock_hz, &PRESCALERS)?;
        Some((found.select, found.counts, found.parts, found.of))
    }

    #[test]
    fn an_even_clock_has_no_parts() {
        assert_eq!(period(16_000_000), Some((3, 250, 0, 1)));
        assert_eq!(period(8_000_000), Some((3, 125, 0, 1)));
        assert_eq!(period(1_000_000), Some((2, 125, 0, 1)));
        // Finer prescalers would leave parts.
        assert_eq!(period(18_432_000), Some((4, 72, 0, 1)));
    }

    #[test]
    fn an_uneven_one_has_few() {
        assert_eq!(period(20_000_000), Some((4, 78, 1, 8)));
        assert_eq!(period(14_745_600), Some((3, 230, 2, 5)));
        assert_eq!(period(12_000_000), Some((3, 187, 1, 2)));
    }

    #[test]
    fn a_clock_that_cannot_be_made_exact_is_refused() {
        for clock_hz in [16_000_001, 10_000, 400_000_000] {
            assert_eq!(period(clock_hz), None, "{clock_hz}");
        }
    }
}
