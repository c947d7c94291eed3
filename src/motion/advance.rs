//! Pressure advance: the extruder is ahead of its line by K times the velocity that is planned for it, so that what leaves the nozzle follows
//! the velocity along the path.
//!
//! Owned by [`Prep`](super::prep::Prep), at the exec level. Lines that both push filament and travel have it; retractions, moves of the extruder
//! alone and travels do not. Behind such a line the motor gives its lead back in the segments of the lines that follow, and at
//! a standstill in segments of its own. The lead is counted in whole phase units apart from the line, so that nothing of it is left at rest.
//!
//! Exec says for each stretch how fast the machine is at its end ([`Advance::aim`]); each segment takes the motor towards that
//! ([`Advance::travel`]), within the velocity and the acceleration of the axis. Where a lead jumps, as at the end of a line that pushes, the
//! motor so comes later than the model says.
//!
//! Units: phase units, s. Cost on AVR: 1,000 cycles a line, 2,500 a segment; with K 0 and no lead left 10.

use kerf_macros::small;

use super::divide::quotient;
use super::float::{below, greater, least, less, ratio, scaled, size, some, whole};
use super::short::Short;
use crate::capability::Capability;
use crate::dda::STEP;
use crate::hal::TIMER_HZ;
use crate::hal::arithmetic::product;
use crate::math::sqrt;

/// How many extruders there are.
pub const EXTRUDERS: usize = Capability::Printer.is_built_in() as usize;

/// What a unit of K is, s.
const UNIT_S: f32 = 1e-4;
/// No lead is longer: 30,000 steps.
const MOST: f32 = 1e9;
/// A lead that may stay while others move: 1/32 step.
const LITTLE: u32 = 1 << 10;

/// What rounding takes off both ends of a line, or adds, at most: 3/16 step.
const ROUNDING: f32 = 3.0 * STEP as f32 / 16.0;
/// So far a mean counts at most: 32 steps.
const ENOUGH: f32 = 32.0 * STEP as f32;

/// What the extruder's lead is to be like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lead {
    /// The motor of the extruder.
    pub motor: u8,
    /// K, 0.1 ms; 0 for no lead.
    pub time: u16,
    /// How fast the lead may change its velocity, steps/s^2, not 0.
    pub accel: Short,
    /// How fast the motor may be with it, steps/s, not 0.
    pub velocity: Short,
}

impl Lead {
    /// None.
    pub const NONE: Self = Self { motor: 0, time: 0, accel: Short::ZERO, velocity: Short::ZERO };
}

/// An extruder with its lead.
#[derive(Clone, Copy, Debug)]
pub struct Advance {
    /// There is a K, or a lead.
    pub(super) on: bool,
    /// The block that runs has a lead, or takes one back.
    pub(super) leads: bool,
    pub(super) motor: u8,
    /// The motor goes backwards in the last segment with a lead.
    pub(super) backwards: bool,
    /// K, s.
    time: f32,
    accel: f32,
    /// Its velocity limit, phase units in 256 CPU cycles.
    rate: u16,
    /// How far the motor has gone in lines that push alike, and how far they were, mm.
    pushed: (f32, f32),
    /// The lead in the block that runs, for each mm/s.
    factor: f32,
    /// How fast the lead changes.
    speed: f32,
    /// How far the motor is ahead of its line, in what has been prepared.
    made: i32,
    /// How far it is to be at the end of the stretch.
    goal: i32,
}

#[small]
impl Advance {
    /// No lead.
    pub const NONE: Self = Self {
        on: false,
        leads: false,
        motor: 0,
        backwards: false,
        time: 0.0,
        accel: 0.0,
        rate: 0,
        pushed: (0.0, 0.0),
        factor: 0.0,
        speed: 0.0,
        made: 0,
        goal: 0,
    };

    /// From the next block on.
    #[inline(never)]
    pub fn set(&mut self, lead: &Lead) {
        const PER_256: f32 = STEP as f32 * 256.0 / TIMER_HZ as f32;
        self.time = f32::from(lead.time) * UNIT_S;
        // What is left of a lead is taken back as it was made.
        if lead.time != 0 {
            self.motor = lead.motor;
            self.accel = lead.accel.get() * f32::from(STEP);
            self.rate = whole(least(lead.velocity.get() * PER_256, 65_535.0)) as u16;
        }
        self.on = lead.time != 0 || self.made != 0;
    }

    /// A block begins in which the motor goes `way` phase units forwards, 0 if it has no lead, of `length` mm. Whether there is a lead to be
    /// made or taken back.
    #[inline(never)]
    pub fn begin(&mut self, way: u32, length: f32) -> bool {
        self.factor = if way == 0 { 0.0 } else { self.time * self.ratio(way as f32, length) };
        some(self.factor) || !self.is_over()
    }

    /// Phase units for each mm. Ends of lines are known to 1/16 step, which is much of a short line: so it is the mean of those before that
    /// differ by no more than that.
    fn ratio(&mut self, way: f32, length: f32) -> f32 {
        let (ways, lengths) = self.pushed;
        let off = size(way * lengths - ways * length);
        let is_alike = below(off, ROUNDING * lengths);
        let mut pushed = if is_alike { (ways + way, lengths + length) } else { (way, length) };
        let mean = ratio(pushed.0, pushed.1);
        if below(ENOUGH, pushed.0) {
            pushed = (scaled(pushed.0, -1), scaled(pushed.1, -1));
        }
        self.pushed = pushed;
        mean
    }

    /// Whether no lead is left, but for so little that it may stay until the machine rests.
    fn is_over(&self) -> bool {
        self.made.unsigned_abs() < LITTLE && !some(self.speed)
    }

    /// The block needs no lead, and the motor is where its line is, but for so little that it may stay until the machine rests.
    pub fn is_done(&self) -> bool {
        !some(self.factor) && self.goal == 0 && self.is_over()
    }

    /// Begins segments with a lead, if the one before had none; the motor's direction is that of its line then.
    #[inline(always)]
    pub fn take_up(&mut self, backwards: bool) {
        if !self.leads {
            (self.leads, self.backwards) = (true, backwards);
        }
    }

    /// How far the motor is ahead.
    pub fn made(&self) -> i32 {
        self.made
    }

    /// The line ends, or nothing of it moves: there is no lead from here on.
    pub fn end(&mut self) {
        (self.factor, self.goal) = (0.0, 0);
    }

    /// The motor rests where it is, which is where its line is from now on.
    pub fn cut(&mut self) {
        self.end();
        (self.made, self.speed, self.leads) = (0, 0.0, false);
        self.on = some(self.time);
    }

    /// The machine is that fast, mm/s, at the end of the slice of which a stretch of so many `seconds` is handed out and `pending` are left.
    #[inline(never)]
    pub fn aim(&mut self, velocity: f32, seconds: f32, pending: f32) {
        let end = whole(least(self.factor * velocity, MOST) + 0.5) as i32;
        let way = end - self.goal;
        self.goal = if some(pending) && way != 0 {
            self.goal + rounded(way as f32 * ratio(seconds, seconds + pending))
        } else {
            end
        };
    }

    /// How far the lead goes in each of so many ticks, towards what it is to be, signed; no more than a step.
    #[inline(never)]
    pub fn travel(&mut self, ticks: u16, period: u16) -> i32 {
        let want = self.goal - self.made;
        if want == 0 && !some(self.speed) {
            return 0;
        }
        if ticks == 1 && want.unsigned_abs() < LITTLE {
            // Exactly: a tick is no shorter than what is so little takes.
            self.speed = 0.0;
            return want;
        }
        let time = seconds(ticks, period);
        let back = want < 0;
        let far = want.unsigned_abs() as f32;
        // Towards where it is to go.
        let speed = if back { -self.speed } else { self.speed };
        let gain = self.accel * time;
        let (slow, fast) = (speed - gain, speed + gain);
        let next = if less(fast * time, far) {
            // From there it loses a gain at most in each segment behind this one.
            let stops = sqrt(gain * gain + 2.0 * self.accel * far) - gain;
            greater(if less(stops, fast) { stops } else { fast }, slow)
        } else {
            greater(ratio(far, time), slow)
        };
        self.speed = if back { -next } else { next };
        per_tick(rounded(self.speed * time), ticks)
    }

    /// The machine rests: the lead is to be none. Whether so little is left of it that a tick takes it back.
    pub fn rest(&mut self) -> bool {
        self.goal = 0;
        let little = self.made.unsigned_abs() < LITTLE;
        if little {
            self.speed = 0.0;
        }
        little
    }

    /// The most that the motor may go in a tick, phase units.
    pub fn most(&self, period: u16) -> i32 {
        let most = product(self.rate, period) >> 8;
        most.clamp(1, STEP.into()) as i32
    }

    /// The motor has gone so much farther in each of so many ticks than its line, of `wanted`.
    #[inline(never)]
    pub fn note(&mut self, more: i32, wanted: i32, (ticks, period): (u16, u16)) {
        let far = more * i32::from(ticks);
        self.made += far;
        if more != wanted {
            self.speed = ratio(far as f32, seconds(ticks, period));
        }
        self.on = self.made != 0 || some(self.time);
    }
}

/// How long so many ticks take.
fn seconds(ticks: u16, period: u16) -> f32 {
    product(ticks, period) as f32 * (1.0 / TIMER_HZ as f32)
}

/// A number of either sign, rounded.
#[inline(never)]
#[small]
fn rounded(x: f32) -> i32 {
    let size = whole(size(x) + 0.5) as i32;
    if x.is_sign_negative() { -size } else { size }
}

/// A way in equal parts, rounded; each no more than a step.
#[inline(never)]
#[small]
fn per_tick(way: i32, ticks: u16) -> i32 {
    let size = way.unsigned_abs().min(product(ticks, STEP));
    let part = i32::from(quotient(size + u32::from(ticks / 2), ticks));
    if way < 0 { -part } else { part }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: u16 = 500;
    const TICKS: u16 = 64;

    fn advance() -> Advance {
        let mut advance = Advance::NONE;
        advance.set(&Lead {
            motor: 3,
            time: 500,
            accel: Short::new(89_000.0),
            velocity: Short::new(4_400.0),
        });
        advance
    }

    /// Goes on for so many segments: the lead after each, steps.
    fn run(advance: &mut Advance, segments: usize) -> std::vec::Vec<f64> {
        (0..segments)
            .map(|_| {
                let more = advance.travel(TICKS, PERIOD);
                advance.note(more, more, (TICKS, PERIOD));
                f64::from(advance.made()) / f64::from(STEP)
            })
            .collect()
    }

    #[test]
    fn a_lead_that_grows_steadily_is_followed() {
        let mut advance = advance();
        // 0.0333 mm of filament for each mm at 93 steps/mm: 60 mm/s are 186 steps/s, of which K makes 9.3 steps.
        assert!(advance.begin((3.1 * f32::from(STEP)) as u32, 1.0));
        for n in 1..=30u16 {
            let velocity = 2.0 * f32::from(n);
            advance.aim(velocity, 0.002, 0.0);
            let lead = run(&mut advance, 1)[0];
            let exact = 0.05 * 3.1 * f64::from(velocity);
            assert!((lead - exact).abs() < 0.02, "{velocity} mm/s: {lead} of {exact}");
        }
        advance.end();
        let leads = run(&mut advance, 40);
        // It changes its velocity by 89,000 steps/s^2 at most: 0.36 of a step in a segment more than in the one before.
        let mut before = (9.3, 0.0);
        for lead in leads {
            let way = lead - before.0;
            assert!((way - before.1).abs() < 0.36 + 0.02, "{lead}: {way} behind {}", before.1);
            before = (lead, way);
        }
        assert!(advance.is_done() && advance.rest());
        let rest = advance.travel(1, 16_000);
        advance.note(rest, rest, (1, 16_000));
        assert_eq!(advance.made(), 0);
    }

    #[test]
    fn a_slice_is_shared_by_its_stretches() {
        let mut advance = advance();
        advance.begin((3.1 * f32::from(STEP)) as u32, 1.0);
        advance.aim(10.0, 0.0005, 0.0015);
        let quarter = advance.goal;
        advance.aim(10.0, 0.0015, 0.0);
        assert!((advance.goal - 4 * quarter).abs() <= 4, "{quarter} of {}", advance.goal);
    }

    #[test]
    fn parts_are_rounded_and_within_a_step() {
        assert_eq!([63, 32, 31, -32, -31].map(|way| per_tick(way, 64)), [1, 1, 0, -1, 0]);
        assert_eq!(per_tick(i32::MAX, 2_000), STEP.into());
        assert_eq!(per_tick(-i32::MAX, 1), -i32::from(STEP));
    }
}
