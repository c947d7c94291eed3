//! Overrides: factors that make the machine faster or slower than programmed. Each can be on or off.
//!
//! [`Overrides`] is the state, and a [`Change`] changes it. M48 to M51 apply at their place in the stream of moves.
//! Requests and real-time characters apply at once (`tasks::overrides`). Factors are thousandths.

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

    /// Returns the factor that the override gets when `factor` is asked for. `None` if `factor` is out of range. A
    /// factor of 0 becomes 1 thousandth for feeds and traverses, so that a program that asks for 0 still comes to its
    /// end.
    pub fn checked(self, factor: u32) -> Option<u16> {
        let least = if self == Self::Spindle { LEAST } else { 0 };
        let factor = u16::try_from(factor).ok()?;
        (least..=self.most()).contains(&factor).then_some(factor.max(1))
    }
}

/// The least factor of the spindle override, and the least factor that real-time characters set.
pub const LEAST: u16 = 50;
/// The override of 100 %, in thousandths.
pub const FULL: u16 = 1_000;

/// All overrides, as bits.
const ALL: u8 = 7;
/// Another bit of [`Overrides::on`]: feed rates are as programmed, without regard to the feed override.
#[cfg(feature = "drivers")]
const FIXED: u8 = 8;

/// A change of overrides.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Change {
    /// The overrides that change, as bits.
    which: u8,
    /// Whether the overrides are on from now on.
    on: bool,
    /// The new factor of the overrides. 0 keeps the factor of each.
    factor: u16,
}

#[small]
impl Change {
    /// The change by M48, and by the end of a program.
    pub const ALL_ON: Self = Self { which: ALL, on: true, factor: 0 };
    /// The change by M49.
    pub const ALL_OFF: Self = Self { which: ALL, on: false, factor: 0 };

    /// Returns a change that switches an override on or off and keeps its factor.
    pub const fn switch(which: Override, on: bool) -> Self {
        Self::new(which, on, 0)
    }

    /// Returns a change that switches an override on or off and sets a [checked](Override::checked) factor.
    pub const fn new(which: Override, on: bool, factor: u16) -> Self {
        Self { which: 1 << which as u8, on, factor }
    }

    /// Returns a change that switches an override on and sets a [checked](Override::checked) factor.
    pub const fn to(which: Override, factor: u16) -> Self {
        Self::new(which, true, factor)
    }
}

/// The state of all overrides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overrides {
    factors: [u16; 3],
    /// The overrides that are on, as bits.
    on: u8,
}

#[small]
impl Overrides {
    /// The state at power-up: all overrides are on, with a factor of 100 %.
    pub const NONE: Self = Self { factors: [FULL; 3], on: ALL };

    /// Applies a change.
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

    /// Returns the factor that has been set, whether the override is on or off.
    pub fn factor(&self, which: Override) -> u16 {
        self.factors.get(which as usize).copied().unwrap_or(FULL)
    }

    /// Whether an override is on.
    pub fn is_on(&self, which: Override) -> bool {
        self.on & 1 << which as u8 != 0
    }

    /// Returns the factor by which rates are multiplied: the factor that has been set, or 100 % if the override is off.
    pub fn in_force(&self, which: Override) -> u16 {
        #[cfg(feature = "drivers")]
        if which == Override::Feed && self.on & FIXED != 0 {
            return FULL;
        }
        if self.is_on(which) { self.factor(which) } else { FULL }
    }

    /// Suspends the feed override, so that feed rates are as programmed, or ends this. Changes in the meantime are
    /// kept.
    #[cfg(feature = "drivers")]
    pub fn fix_feed(&mut self, fixed: bool) {
        if fixed {
            self.on |= FIXED;
        } else {
            self.on &= !FIXED;
        }
    }

    /// Whether all rates are as programmed.
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
