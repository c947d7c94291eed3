//! Overrides: how much faster or slower than programmed the machine is to be, and whether that counts.
//!
//! [`Overrides`] is the state. It is changed by [`Change`]s, whoever asks for one: M48 to M51 in their place in
//! the stream of moves, requests and real-time characters at once (`tasks::overrides`). Factors are
//! thousandths.

/// What can be overridden.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Override {
    /// Feed rates.
    Feed = 0,
    /// Traverse rates.
    Traverse = 1,
    /// The speed of the spindle.
    Spindle = 2,
}

#[small]
impl Override {
    /// The highest factor.
    pub const fn most(self) -> u16 {
        if self as u8 == Self::Traverse as u8 { 1_000 } else { 2_000 }
    }

    /// The factor that it gets if it is to be set to this; `None` if it may not be. Feeds and traverses of 0 are
    /// carried out a thousand times slower, so that a program that asks for it comes to its end.
    pub fn checked(self, factor: u32) -> Option<u16> {
        let least = if self == Self::Spindle { LEAST } else { 0 };
        let factor = u16::try_from(factor).ok()?;
        (least..=self.most()).contains(&factor).then_some(factor.max(1))
    }
}

/// The least factor of the spindle, and the least that real-time characters ask for.
pub const LEAST: u16 = 50;
/// The override of 100 %, in thousandths.
pub const FULL: u16 = 1_000;

/// All of them, as bits.
const ALL: u8 = 7;
/// A bit beside those: feed rates are as programmed whatever overrides are.
#[cfg(feature = "drivers")]
const FIXED: u8 = 8;

/// What becomes of overrides.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Change {
    /// Which, as bits.
    which: u8,
    /// Whether they count from now on.
    on: bool,
    /// The factor that they get, 0 for the one that they have.
    factor: u16,
}

#[small]
impl Change {
    /// M48, and what the end of a program does.
    pub const ALL_ON: Self = Self { which: ALL, on: true, factor: 0 };
    /// M49.
    pub const ALL_OFF: Self = Self { which: ALL, on: false, factor: 0 };

    /// On, or off, with the factor that it has.
    pub const fn switch(which: Override, on: bool) -> Self {
        Self::new(which, on, 0)
    }

    /// On or not, with a [checked](Override::checked) factor.
    pub const fn new(which: Override, on: bool, factor: u16) -> Self {
        Self { which: 1 << which as u8, on, factor }
    }

    /// On, with a [checked](Override::checked) factor.
    pub const fn to(which: Override, factor: u16) -> Self {
        Self::new(which, true, factor)
    }
}

/// The overrides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overrides {
    factors: [u16; 3],
    /// The overrides that count, as bits.
    on: u8,
}

#[small]
impl Overrides {
    /// At power-up: all on, and nothing is overridden.
    pub const NONE: Self = Self { factors: [FULL; 3], on: ALL };

    /// Changes them.
    #[inline(never)]
    pub fn change(&mut self, change: Change) {
        if change.on {
            self.on |= change.which;
        } else {
            self.on &= !change.which;
        }
        let mut bits = change.which;
        for factor in &mut self.factors {
            if bits & 1 != 0 && change.factor != 0 {
                *factor = change.factor;
            }
            bits >>= 1;
        }
    }

    /// The factor that has been set, whether or not it counts.
    pub fn factor(&self, which: Override) -> u16 {
        self.factors.get(which as usize).copied().unwrap_or(FULL)
    }

    /// Whether it counts.
    pub fn is_on(&self, which: Override) -> bool {
        self.on & 1 << which as u8 != 0
    }

    /// What rates are multiplied by: the factor, or nothing if it does not count.
    pub fn in_force(&self, which: Override) -> u16 {
        #[cfg(feature = "drivers")]
        if which == Override::Feed && self.on & FIXED != 0 {
            return FULL;
        }
        if self.is_on(which) { self.factor(which) } else { FULL }
    }

    /// Has feed rates be as programmed, or not any more, whatever changes meanwhile.
    #[cfg(feature = "drivers")]
    pub fn fix_feed(&mut self, fixed: bool) {
        if fixed {
            self.on |= FIXED;
        } else {
            self.on &= !FIXED;
        }
    }

    /// Whether rates are as programmed.
    pub fn is_none(&self) -> bool {
        [Override::Feed, Override::Traverse, Override::Spindle]
            .iter()
            .all(|which| self.in_force(*which) == FULL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(feature = "drivers")]
    fn a_feed_that_is_fixed_stays_so_until_it_is_not() {
        let mut overrides = Overrides::NONE;
        overrides.fix_feed(true);
        for change in [Change::to(Override::Feed, 500), Change::ALL_OFF, Change::ALL_ON] {
            overrides.change(change);
            assert_eq!(overrides.in_force(Override::Feed), FULL);
        }
        overrides.change(Change::to(Override::Traverse, 250));
        assert_eq!(overrides.in_force(Override::Traverse), 250);
        overrides.fix_feed(false);
        assert_eq!(overrides.in_force(Override::Feed), 500);
    }

    #[test]
    fn a_factor_outlives_its_being_off() {
        let mut overrides = Overrides::NONE;
        assert!(overrides.is_none());
        overrides.change(Change::to(Override::Feed, 500));
        overrides.change(Change::ALL_OFF);
        assert!(overrides.is_none() && overrides.factor(Override::Feed) == 500);
        overrides.change(Change::switch(Override::Feed, true));
        assert_eq!(overrides.in_force(Override::Feed), 500);
        overrides.change(Change::to(Override::Spindle, 1_200));
        assert_eq!(overrides.in_force(Override::Spindle), 1_200);
        assert!(!overrides.is_on(Override::Traverse));
        overrides.change(Change::ALL_ON);
        assert!(overrides.is_on(Override::Traverse));
    }

    #[test]
    fn factors_have_limits() {
        for (which, most) in [(Override::Feed, 2_000), (Override::Traverse, 1_000)] {
            assert_eq!(which.checked(most), Some(most as u16));
            assert_eq!((which.checked(most + 1), which.checked(10)), (None, Some(10)));
            assert_eq!((which.checked(0), which.checked(65_536)), (Some(1), None));
        }
        assert_eq!(Override::Spindle.checked(49), None);
        assert_eq!(Override::Spindle.checked(2_000), Some(2_000));
    }
}
