//! Heater faults that its temperature alone shows.
//!
//! | phase | condition | next phase | fault |
//! |---|---|---|---|
//! | off | no target | a target: heats, holds or cools, by the temperature | |
//! | heats | more than [`NEAR`] below the target | near: holds | below 96 degrees (bed: 48) no rise of [`RISE`] in [`Rule::rise_s`] at full power: [`HeatTooSlow`](Status::HeatTooSlow) |
//! | holds | near the target, or has been | another target | more than [`FAR`] below the target for [`AWAY_S`] without a rise of [`RISE`]: [`HeatRunaway`](Status::HeatRunaway) |
//! | cools | more than [`NEAR`] above the target | near: holds | |
//! | any | | | more than [`BEYOND`] above the maximum: [`TooHot`](Status::TooHot) |
//! | any | has power | | more heat than the temperature shows: [`HeatTooSlow`](Status::HeatTooSlow) if it heats, else [`HeatRunaway`](Status::HeatRunaway) |
//! | any | has a target | | a sensor that is asked does not answer: as above |
//! | any | has no power | | 20 degrees hotter than its power explains, and with a target or above 70: [`HeatRunaway`](Status::HeatRunaway) |
//!
//! No change of target delays a fault. The time that `heats` or `holds` has left goes on if the new target, too, is more
//! than [`FAR`] above the temperature. The last three rows know no target: they compare the heater's power with its
//! temperature, in three accounts.
//!
//! **Heat that does not show** (`owed`). Power adds to it, and what the heater may lose to the air is taken off: an
//! eighth of full power, and more the hotter the heater is. All power is taken off from [`HELD`] on, and while the
//! heater holds. A fall of the temperature under power adds to it, too: 20 degrees at full power are the limit. A rise
//! of [`RISE`] settles it. At full power and 20 degrees a hot end comes to the limit a tenth later than
//! [`Rule::rise_s`], a bed a quarter, in one piece or in many. The account outlives a fault, so a heater that is
//! switched on again at once has the fault again at once.
//!
//! **Heat that may be too much** (`excess`). A frozen sensor and a heater at its limit look alike: full power, and no
//! change. So the sensor is asked. Power beyond the harmless power adds to the account, and power below it is taken
//! off. A rise of [`RISE`] settles it. At [`Watch::most`] the heater gets no power until the temperature has fallen by
//! [`ANSWER`]. It falls if the sensor works. No fall in four thirds of [`Rule::rise_s`] is the fault. Harmless is at
//! first a quarter of full power. An answer says more: the mean power before it holds the present temperature, so
//! somewhat more power would hold [`Rule::hottest`] (`known`). With less fan than then a quarter is taken off. So a
//! heater is asked a few times, and no more.
//!
//! **Heat from nowhere** (`warm`). This temperature follows the reading down, and up as fast as the power explains at
//! most. A reading above it comes from stored heat, from another heater, or through a transistor that stays on. Up to
//! 70 degrees it follows the reading, a third of a degree a second, because a bed in a closed printer warms its hot
//! end.
//!
//! A broken sensor is found earlier ([`Broken`](super::sensor::Broken)). Stepped five times a second. Temperatures are
//! in 1/64 degree. Cost: 1,500 cycles; 2,600 while a heater with power gets colder. A reset forgets everything.

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
/// The most by which the temperature of a heater may rise without power, from stored heat and other heaters.
const BY_ITSELF: i16 = 20 * UNIT;
/// Up to this temperature a heater that is off has no fault, however cold it was.
const WARM: i16 = 70 * UNIT;
/// A fall by this at full power is a fault.
const COLDER: i16 = 20 * UNIT;
/// How far `mark` and `warm` follow a fall in a step: 10 degrees a second, which no heater exceeds. So a disturbed
/// reading changes them little.
const FALL: i16 = 2 * UNIT;

/// Full power for a step, in the unit of `owed`: a fourth of that of power.
const FULL: i16 = 63;
/// The loss that a heater may have at 0 degrees.
const LOSS: i16 = FULL / 8;
/// From this loss on, which is that at 96 degrees in a hot end and 48 in a bed, a heater may need full power.
const HELD: i16 = FULL / 2;
/// The limit of `owed`, for each step of [`Rule::rise_s`].
const LIMIT: i16 = FULL - LOSS;
/// `warm` rises by this times the power in a step, over [`Rule::rise_s`]: at full power 16 degrees a second for a hot
/// end and 3.5 for a bed. No heater is faster.
const GAIN: i16 = UNIT;
/// `warm` follows the reading up by this in a step, a third of a degree a second: a bed in a closed printer warms its
/// hot end.
const BY_AIR: i16 = UNIT / 16;
/// Power that makes no heater too hot.
const HARMLESS: i16 = FULL / 4;
/// The least and the greatest rise, in degrees, for which [`Watch::most`] allows power. The least one lets a slow sensor
/// follow its heater.
const UNSEEN: (i16, i16) = (32, 150);
/// Temperature of the air that [`Watch::learn`] assumes, degrees.
const AIR: i16 = 22;
/// The fall that is the answer of a sensor.
const ANSWER: i16 = UNIT;
/// The time left while nothing is wrong.
const FRESH: u16 = u16::MAX;

/// The limits of a heater.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// How long [`RISE`] may take, seconds.
    pub rise_s: u16,
    /// Maximum temperature, 1/64 degree.
    pub hottest: i16,
    /// The temperature that a heater can hold with full power, degrees. A constant, because a port could raise a setting
    /// to hide a fault.
    pub reach: i16,
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
    /// The lowest temperature since the last rise of [`RISE`].
    mark: i16,
    /// The temperature that the power explains.
    warm: i16,
    /// Heat that the temperature does not show.
    owed: i16,
    /// The smoothed reading, with a time constant of a second and a half.
    even: i16,
    /// Power beyond the harmless one. Below 0 after an answer: what the heater lost.
    excess: i16,
    /// Smoothed power in 1/256 of its unit, until the sensor is asked.
    mean: i16,
    /// Harmless power beyond [`HARMLESS`], and the fan's speed when it was measured.
    known: i16,
    fan: u8,
    /// Steps that are left until a sensor that is asked must have answered; 0 while no sensor is asked.
    asks: u16,
    /// Steps left until a fault; 0 at start-up and after that fault.
    left: u16,
    /// The target of the last step, 0 for off.
    wanted: i16,
}

#[small]
impl Watch {
    /// The state at start-up.
    pub const OFF: Self = Self {
        phase: Phase::Off,
        mark: 0,
        warm: 0,
        owed: 0,
        even: 0,
        excess: 0,
        mean: 0,
        known: 0,
        fan: 0,
        asks: 0,
        left: 0,
        wanted: 0,
    };

    /// The present phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Whether the sensor is being asked. The heater must have no power then.
    pub fn asks(&self) -> bool {
        self.asks != 0
    }

    /// Checks the temperature `now`; `wanted` is the target, 0 for off, and `power` the power since the last step, 255
    /// for full power; `fan` is the speed of a fan that cools the heater. The error is the fault.
    #[inline(never)]
    pub fn step(
        &mut self,
        now: i16,
        wanted: i16,
        power: u8,
        fan: u8,
        rule: &Rule,
    ) -> Result<(), Status> {
        if now > rule.hottest.saturating_add(BEYOND) {
            return Err(Status::TooHot);
        }
        if self.left == 0 {
            (self.mark, self.warm, self.even, self.left) = (now, now, now, FRESH);
        }
        self.even += now.saturating_sub(self.even) / 8;
        let error = wanted.saturating_sub(now);
        self.enter(wanted, error);
        let power = i16::from(power / 4);
        self.explain(now, power, rule)?;
        self.weigh(power, fan, rule);
        if self.asks != 0 {
            self.listen(fan, rule)?;
        } else {
            self.settle(self.even, power, rule)?;
            self.doubt(power, rule);
        }
        match self.phase {
            Phase::Heats if power == FULL && self.loss(rule) < HELD => {
                self.pass(rule.rise_s, Status::HeatTooSlow, rule)
            }
            Phase::Heats => Ok(()),
            Phase::Holds if error > FAR => self.pass(AWAY_S, Status::HeatRunaway, rule),
            _ => {
                self.left = FRESH;
                Ok(())
            }
        }
    }

    /// Enters the phase of this step.
    fn enter(&mut self, wanted: i16, error: i16) {
        let is_new = wanted != self.wanted;
        let stays = self.phase == Phase::Holds && !is_new;
        self.wanted = wanted;
        if is_new && error <= FAR {
            self.left = FRESH;
        }
        self.phase = match () {
            () if wanted == 0 => Phase::Off,
            () if stays => Phase::Holds,
            () if error > NEAR => Phase::Heats,
            () if error < -NEAR => Phase::Cools,
            () => Phase::Holds,
        };
    }

    /// Checks that the power explains the temperature.
    fn explain(&mut self, now: i16, power: i16, rule: &Rule) -> Result<(), Status> {
        let above = now.saturating_sub(self.warm);
        let by_air = if now <= WARM { BY_AIR } else { 0 };
        self.warm += above.clamp(-FALL, (power * GAIN / rule.rise_s as i16).max(by_air));
        let matters = self.wanted != 0 || now > WARM;
        if power == 0 && above > BY_ITSELF && matters { Err(Status::HeatRunaway) } else { Ok(()) }
    }

    /// Checks that the temperature shows the power.
    fn settle(&mut self, now: i16, power: i16, rule: &Rule) -> Result<(), Status> {
        let fall = self.mark.saturating_sub(now);
        if fall <= -RISE {
            (self.mark, self.owed, self.excess) = (now, 0, self.excess.min(0));
            self.left = FRESH;
            return Ok(());
        }
        let fall = fall.clamp(0, FALL);
        self.mark -= fall;
        let loss = match self.loss(rule) {
            loss if loss >= HELD || self.phase == Phase::Holds => FULL,
            loss => loss,
        };
        let limit = limit(rule);
        let lost = if fall > 0 && power > 0 {
            let share = i32::from(fall) * i32::from(power);
            (share * i32::from(limit) / (i32::from(COLDER) * i32::from(FULL))) as i16
        } else {
            0
        };
        self.owed = self.owed.saturating_add(power - loss + lost).max(0);
        match self.phase {
            _ if power == 0 || self.owed < limit => Ok(()),
            _ => Err(self.fault()),
        }
    }

    /// Returns the fault of a heater whose temperature does not show its power.
    fn fault(&self) -> Status {
        match self.phase {
            Phase::Heats => Status::HeatTooSlow,
            _ => Status::HeatRunaway,
        }
    }

    /// Returns the loss that the heater may have.
    fn loss(&self, rule: &Rule) -> i16 {
        LOSS + self.even.max(0) / rule.reach
    }

    /// Adds the power of a step to `excess` and `mean`.
    fn weigh(&mut self, power: i16, fan: u8, rule: &Rule) {
        let mut harmless = HARMLESS + self.known;
        if fan < self.fan {
            harmless -= harmless / 4;
        }
        let excess = self.excess.saturating_add(power - harmless);
        self.excess = excess.max(self.excess.min(0));
        if self.asks == 0 {
            self.mean += ((power << 8) - self.mean) / (2 * rule.rise_s as i16);
        }
    }

    /// Returns the excess from which on the sensor is asked: that which makes a heater of 8 degrees a second (bed: 1.8)
    /// as hot as it may be. At most 27,000, of a bed.
    fn most(&self, rule: &Rule) -> i16 {
        let room = (rule.hottest.saturating_add(BEYOND) - self.even.max(0)) / UNIT;
        room.clamp(UNSEEN.0, UNSEEN.1) * 2 * rule.rise_s as i16
    }

    /// Begins to ask the sensor if the excess is too large.
    fn doubt(&mut self, power: i16, rule: &Rule) {
        if power > 0 && self.excess > self.most(rule) {
            self.mean = self.mean.min(power << 8);
            self.mark = self.even;
            self.asks = listens(rule);
        }
    }

    /// Waits for the answer of the sensor.
    fn listen(&mut self, fan: u8, rule: &Rule) -> Result<(), Status> {
        self.asks -= 1;
        self.mark = self.mark.max(self.even);
        if self.mark.saturating_sub(self.even) >= ANSWER {
            self.learn(fan, rule);
            return Ok(());
        }
        if self.asks != 0 || self.wanted == 0 {
            return Ok(());
        }
        self.excess = self.most(rule);
        Err(self.fault())
    }

    /// Takes the answer: the mean power holds the present temperature. Three quarters of an increase are believed, because
    /// the mean of a heater that has just come to its target is too high.
    fn learn(&mut self, fan: u8, rule: &Rule) {
        let now = (self.even / UNIT - AIR).max(8);
        let most = self.mean / 256 * (rule.hottest / UNIT - AIR).max(8) / now;
        let more = (most.min(FULL) - HARMLESS).max(0) - self.known;
        self.known += if more > 0 { more - more / 4 } else { more };
        self.fan = fan;
        let lasted = (listens(rule) - self.asks).min(500) as i16;
        self.excess = -lasted * (HARMLESS + self.known);
        (self.mark, self.asks) = (self.even, 0);
    }

    /// Counts a step without improvement, of which `most` seconds are allowed.
    fn pass(&mut self, most: u16, fault: Status, rule: &Rule) -> Result<(), Status> {
        self.left = self.left.min(steps(most)).saturating_sub(1);
        if self.left == 0 {
            self.owed = self.owed.max(limit(rule));
            return Err(fault);
        }
        Ok(())
    }
}

/// Returns the limit of `owed`: at most 25,200, of a bed.
#[small]
fn limit(rule: &Rule) -> i16 {
    steps(rule.rise_s) as i16 * LIMIT
}

/// Returns for how many steps a sensor has time to answer.
#[small]
fn listens(rule: &Rule) -> u16 {
    steps(rule.rise_s) / 3 * 4
}

/// Converts seconds to steps.
const fn steps(seconds: u16) -> u16 {
    seconds * STEPS as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: Rule = Rule { rise_s: 20, hottest: 275 * UNIT, reach: 256 };

    fn degrees(at: f64) -> i16 {
        (at * f64::from(UNIT)) as i16
    }

    /// The power of a control without integral.
    fn driven(now: f64, wanted: f64) -> u8 {
        if wanted == 0.0 { 0 } else { (128.0 + (wanted - now) * 10.0) as u8 }
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
            watch.step(degrees(*now), degrees(*wanted), driven(*now, *wanted), 0, &RULE).unwrap();
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
            (Heats, 200.0, 100.0, Some((slow, 60.0))),
            (Heats, 200.0, 150.0, Some((slow, 60.0))),
            (Heats, 200.0, 50.0, Some((slow, 25.4))),
            (Heats, 200.0, 199.0, None),
            (Heats, 200.0, 205.0, None),
            (Heats, 200.0, 291.0, Some((hot, 0.2))),
            (Holds, 200.0, 200.0, None),
            (Holds, 200.0, 190.5, None),
            (Holds, 200.0, 189.0, Some((away, 40.0))),
            (Holds, 200.0, 25.0, Some((away, 30.4))),
            // Such sensors answer; this one is frozen.
            (Holds, 200.0, 198.6, Some((away, 73.0))),
            (Holds, 200.0, 211.0, None),
            (Holds, 200.0, 291.0, Some((hot, 0.2))),
            (Cools, 150.0, 200.0, None),
            (Cools, 150.0, 219.0, None),
            (Cools, 150.0, 221.0, Some((away, 0.2))),
            (Cools, 185.0, 185.0, None),
            // A fall like that of a sensor that drops out, and half the power.
            (Cools, 150.0, 150.0, Some((away, 5.0))),
            (Cools, 150.0, 291.0, Some((hot, 0.2))),
        ] {
            let mut watch = in_phase(phase);
            let mut seen = None;
            for step in 1..=600 {
                let power = driven(now, wanted);
                // A sensor that works falls when it is asked.
                let now = if watch.asks() && fault.is_none() { now - 3.0 } else { now };
                if let Err(status) = watch.step(degrees(now), degrees(wanted), power, 0, &RULE) {
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
            watch.step(degrees(now.min(200.0)), degrees(200.0), 200, 0, &RULE).unwrap();
        }
        assert_eq!(watch.phase(), Phase::Holds);
    }

    /// A bed heats first, and the hot end above it gets warm without power.
    #[test]
    fn what_the_bed_warms_may_be_heated() {
        for warm in [45.0, 55.0, 69.0] {
            let mut watch = in_phase(Phase::Off);
            for step in 0..3_000 {
                let now = 25.0 + (warm - 25.0) * f64::from(step) / 3_000.0;
                watch.step(degrees(now), 0, 0, 0, &RULE).unwrap();
            }
            watch.step(degrees(warm), degrees(200.0), 0, 0, &RULE).unwrap();
        }
    }

    #[test]
    fn after_a_fault_off_is_off() {
        let mut watch = in_phase(Phase::Holds);
        watch.step(degrees(25.0), 0, 0, 0, &RULE).unwrap();
        assert_eq!(watch.phase(), Phase::Off);
    }

    /// Returns the seconds until the fault of a sensor that reads 28 degrees, and the seconds of power, while targets
    /// follow each other.
    fn constant(watch: &mut Watch, targets: &[(f64, u32)]) -> Option<(f64, f64, Status)> {
        let (mut step, mut on, mut power) = (0, 0.0, 0);
        for (wanted, steps) in targets.iter().cycle() {
            for _ in 0..*steps {
                step += 1;
                on += f64::from(power) / 255.0 / f64::from(STEPS);
                if let Err(status) = watch.step(degrees(28.0), degrees(*wanted), power, 0, &RULE) {
                    return Some((f64::from(step) / f64::from(STEPS), on, status));
                }
                power = driven(28.0, *wanted);
                if step == 5_000 {
                    return None;
                }
            }
        }
        None
    }

    /// Targets, each for some steps; and seconds until a fault, and seconds of power until then.
    type Case<'a> = (&'a [(f64, u32)], Option<(f64, f64)>);

    #[test]
    fn a_change_of_target_gives_no_more_time() {
        let slow = Status::HeatTooSlow;
        let cases: [Case; 8] = [
            (&[(200.0, 1)], Some((20.2, 20.0))),
            (&[(200.0, 95), (205.0, 95)], Some((20.2, 20.0))),
            (&[(200.0, 1), (201.0, 1)], Some((20.2, 20.0))),
            (&[(200.0, 75), (0.0, 5)], Some((25.0, 24.0))),
            (&[(200.0, 75), (20.0, 5)], Some((25.0, 24.0))),
            (&[(200.0, 75), (28.0, 5)], Some((25.0, 24.2))),
            (&[(200.0, 5), (0.0, 5)], Some((65.0, 33.0))),
            (&[(200.0, 5), (0.0, 20)], None),
        ];
        for (targets, wanted) in cases {
            let found = constant(&mut { Watch::OFF }, targets);
            let (most, on) = wanted.unzip();
            let is_well = match found {
                Some((after, given, status)) => {
                    most.is_some_and(|most| after <= most)
                        && on.is_some_and(|on| given <= on)
                        && status == slow
                }
                None => wanted.is_none(),
            };
            assert!(is_well, "{targets:?}: {found:?}");
        }
    }

    #[test]
    fn a_heater_that_is_switched_on_again_after_a_fault_has_it_again() {
        let mut watch = in_phase(Phase::Off);
        assert!(constant(&mut watch, &[(200.0, 1)]).is_some());
        let again = constant(&mut watch, &[(0.0, 10), (200.0, 100)]);
        assert!(again.is_some_and(|(after, ..)| after < 3.5), "{again:?}");
        // Two minutes later it has its time again.
        (0..600).for_each(|_| watch.step(degrees(28.0), 0, 0, 0, &RULE).unwrap());
        let again = constant(&mut watch, &[(200.0, 1)]);
        assert!(again.is_some_and(|(after, ..)| after > 19.0), "{again:?}");
    }

    /// A transistor stays on; the targets give a twentieth of the power.
    #[test]
    fn a_rise_without_power_is_a_fault_between_changes_of_target() {
        let mut watch = in_phase(Phase::Off);
        for step in 0..1_000 {
            let now = 25.0 + 0.4 * f64::from(step);
            let (wanted, power) = if step % 20 == 0 { (200.0, 255) } else { (0.0, 0) };
            let seen = watch.step(degrees(now), degrees(wanted), power, 0, &RULE);
            if seen == Err(Status::HeatRunaway) {
                assert!(now < 72.0, "at {now}");
                return;
            }
            seen.unwrap();
        }
        panic!("no fault");
    }

    #[test]
    fn a_disturbed_reading_is_no_fault() {
        let mut watch = in_phase(Phase::Holds);
        for step in 1..20_000 {
            let now = 200.0 + if step % 50 == 0 { -40.0 } else { 0.0 };
            watch.step(degrees(now), degrees(200.0), 128, 0, &RULE).unwrap();
        }
    }

    #[test]
    fn any_reading_and_power_leave_it_without_overflow() {
        let mut watch = Watch::OFF;
        let mut random = 1u32;
        for _ in 0..200_000 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let rise_s = if random & 1 << 20 == 0 { 20 } else { 90 };
            let rule = Rule { rise_s, hottest: i16::MAX, reach: 128 };
            let wanted = if random >> 30 == 0 { 0 } else { (random >> 3) as i16 };
            let _ = watch.step((random >> 8) as i16, wanted, (random >> 24) as u8, 0, &rule);
        }
    }
}
