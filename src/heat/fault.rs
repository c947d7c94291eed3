//! Heater faults that its temperature alone shows.
//!
//! | phase | condition | next phase | fault |
//! |---|---|---|---|
//! | off | no target | a target: heats, holds or cools, by the temperature | 20 degrees above the lowest temperature since, and above 70: [`HeatRunaway`](Status::HeatRunaway), a transistor that stays on |
//! | heats | more than [`NEAR`] below the target | near: holds | a rise of less than [`RISE`] in [`Rule::rise_s`]: [`HeatTooSlow`](Status::HeatTooSlow) |
//! | holds | near the target, or has been | another target | more than [`FAR`] from the target for [`AWAY_S`]: [`HeatRunaway`](Status::HeatRunaway) |
//! | cools | more than [`NEAR`] above the target | near: holds | 20 degrees above the lowest temperature since: [`HeatRunaway`](Status::HeatRunaway) |
//! | any | | | more than [`BEYOND`] above the maximum: [`TooHot`](Status::TooHot) |
//!
//! A broken sensor is found earlier ([`Broken`](super::sensor::Broken)). Stepped five times a second. Temperatures are
//! in 1/64 degree. Cost: 150 cycles.

use super::control::STEPS;
use super::sensor::UNIT;
use crate::status::Status;

/// Within this distance of the target the target counts as reached.
pub const NEAR: i16 = 3 * UNIT;
/// Beyond this distance from the target, for [`AWAY_S`], the heater counts as run away.
pub const FAR: i16 = 10 * UNIT;
/// How long a heater may be more than [`FAR`] from its target, seconds.
pub const AWAY_S: u16 = 30;
/// The least rise of a heater's temperature within [`Rule::rise_s`].
pub const RISE: i16 = 2 * UNIT;
/// How far above its maximum a heater may get.
pub const BEYOND: i16 = 15 * UNIT;
/// The most by which the temperature of a heater may rise while it is off, from stored heat and other heaters.
const BY_ITSELF: i16 = 20 * UNIT;
/// Up to this temperature a heater that is off has no fault, however cold it was.
const WARM: i16 = 70 * UNIT;

/// The limits of a heater.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// How long [`RISE`] may take, seconds.
    pub rise_s: u16,
    /// Maximum temperature, 1/64 degree.
    pub hottest: i16,
}

/// The phase of a heater: see the table of this module.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Phase {
    /// No target.
    #[default]
    Off,
    /// On the way up to the target.
    Heats,
    /// At the target.
    Holds,
    /// On the way down to the target.
    Cools,
}

/// The supervision of a heater.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Watch {
    phase: Phase,
    /// In `Heats`: the temperature from which the rise is measured. In `Off` and `Cools`: the lowest temperature since.
    mark: i16,
    /// Steps left until a fault.
    left: u16,
    /// The target of the last step, 0 for off.
    wanted: i16,
}

#[small]
impl Watch {
    /// The state at start-up.
    pub const OFF: Self = Self { phase: Phase::Off, mark: 0, left: 0, wanted: 0 };

    /// The present phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Checks the temperature `now`; `wanted` is the target, 0 for off. The error is the fault.
    #[inline(never)]
    pub fn step(&mut self, now: i16, wanted: i16, rule: &Rule) -> Result<(), Status> {
        if now > rule.hottest.saturating_add(BEYOND) {
            return Err(Status::TooHot);
        }
        let error = wanted.saturating_sub(now);
        if wanted != self.wanted {
            self.wanted = wanted;
            self.begin(now, error, rule);
        }
        match self.phase {
            Phase::Off | Phase::Cools => {
                if self.left == 0 {
                    // The first step after start-up.
                    (self.mark, self.left) = (now, 1);
                }
                self.mark = self.mark.min(now);
                let most = self.mark.saturating_add(BY_ITSELF);
                if now > most && (self.phase == Phase::Cools || now > WARM) {
                    return Err(Status::HeatRunaway);
                }
                if self.phase == Phase::Cools && error >= -NEAR {
                    self.hold();
                }
            }
            Phase::Heats if error <= NEAR => self.hold(),
            Phase::Heats if now.saturating_sub(self.mark) >= RISE => {
                (self.mark, self.left) = (now, steps(rule.rise_s));
            }
            Phase::Heats => self.pass(Status::HeatTooSlow)?,
            Phase::Holds if (-FAR..=FAR).contains(&error) => self.left = steps(AWAY_S),
            Phase::Holds => self.pass(Status::HeatRunaway)?,
        }
        Ok(())
    }

    /// Begins with another target.
    fn begin(&mut self, now: i16, error: i16, rule: &Rule) {
        (self.mark, self.left) = (now, steps(rule.rise_s));
        self.phase = match () {
            () if self.wanted == 0 => Phase::Off,
            () if error > NEAR => Phase::Heats,
            () if error < -NEAR => Phase::Cools,
            () => Phase::Holds,
        };
        if self.phase == Phase::Holds {
            self.hold();
        }
    }

    fn hold(&mut self) {
        (self.phase, self.left) = (Phase::Holds, steps(AWAY_S));
    }

    /// Counts a step without improvement.
    fn pass(&mut self, fault: Status) -> Result<(), Status> {
        match self.left {
            0 => Err(fault),
            left => {
                self.left = left - 1;
                Ok(())
            }
        }
    }
}

/// Converts seconds to steps.
const fn steps(seconds: u16) -> u16 {
    seconds * STEPS as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: Rule = Rule { rise_s: 20, hottest: 275 * UNIT };

    fn degrees(at: f64) -> i16 {
        (at * f64::from(UNIT)) as i16
    }

    /// A heater that has come to a phase.
    fn in_phase(phase: Phase) -> Watch {
        let mut watch = Watch::OFF;
        let way: &[(f64, f64)] = match phase {
            Phase::Off => &[(25.0, 0.0)],
            Phase::Heats => &[(25.0, 200.0), (100.0, 200.0)],
            Phase::Holds => &[(25.0, 200.0), (199.0, 200.0)],
            Phase::Cools => &[(200.0, 200.0), (200.0, 150.0)],
        };
        for (now, wanted) in way {
            watch.step(degrees(*now), degrees(*wanted), &RULE).unwrap();
        }
        assert_eq!(watch.phase(), phase);
        watch
    }

    /// The result of a constant temperature in each phase, and the seconds until a fault at most.
    #[test]
    fn every_phase_knows_its_faults() {
        use Phase::{Cools, Heats, Holds, Off};
        let (slow, away, hot) = (Status::HeatTooSlow, Status::HeatRunaway, Status::TooHot);
        for (phase, wanted, now, fault) in [
            (Off, 0.0, 25.0, None),
            (Off, 0.0, 60.0, None),
            (Off, 0.0, 71.0, Some((away, 0.2))),
            (Off, 0.0, 291.0, Some((hot, 0.2))),
            (Heats, 200.0, 100.0, Some((slow, 20.4))),
            (Heats, 200.0, 101.0, Some((slow, 20.4))),
            (Heats, 200.0, 50.0, Some((slow, 20.4))),
            (Heats, 200.0, 199.0, None),
            (Heats, 200.0, 205.0, None),
            (Heats, 200.0, 291.0, Some((hot, 0.2))),
            (Holds, 200.0, 200.0, None),
            (Holds, 200.0, 190.5, None),
            (Holds, 200.0, 189.0, Some((away, 30.4))),
            (Holds, 200.0, 25.0, Some((away, 30.4))),
            (Holds, 200.0, 211.0, Some((away, 30.4))),
            (Holds, 200.0, 291.0, Some((hot, 0.2))),
            (Cools, 150.0, 200.0, None),
            (Cools, 150.0, 219.0, None),
            (Cools, 150.0, 221.0, Some((away, 0.2))),
            (Cools, 150.0, 150.0, None),
            (Cools, 150.0, 291.0, Some((hot, 0.2))),
        ] {
            let mut watch = in_phase(phase);
            let mut seen = None;
            for step in 1..=600 {
                if let Err(status) = watch.step(degrees(now), degrees(wanted), &RULE) {
                    seen = Some((status, f64::from(step) / f64::from(STEPS)));
                    break;
                }
            }
            let label = std::format!("{phase:?} at {now}, wanted {wanted}: {seen:?}");
            match (fault, seen) {
                (None, None) => {}
                (Some((fault, most)), Some((status, after))) => {
                    assert!(fault == status && after <= most, "{label}");
                }
                _ => panic!("{label}"),
            }
        }
    }

    #[test]
    fn a_heater_that_gets_hotter_slowly_is_well() {
        let mut watch = in_phase(Phase::Heats);
        for step in 0..4_000 {
            let now = 100.0 + f64::from(step) * 0.025;
            watch.step(degrees(now.min(200.0)), degrees(200.0), &RULE).unwrap();
        }
        assert_eq!(watch.phase(), Phase::Holds);
    }

    #[test]
    fn after_a_fault_off_is_off() {
        let mut watch = in_phase(Phase::Holds);
        watch.step(degrees(25.0), 0, &RULE).unwrap();
        assert_eq!(watch.phase(), Phase::Off);
    }
}
