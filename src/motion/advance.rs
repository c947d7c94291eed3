//! Pressure advance: the extruder is ahead of its line by K times its planned velocity, so that the flow from the
//! nozzle follows the velocity along the path. This distance is the *lead*.
//!
//! Owned by [`Prep`](super::prep::Prep), at the exec level. Lines that both push filament and travel have a lead;
//! retractions, moves of the extruder alone, and travels have none. After a line with a lead, the motor takes the lead
//! back in the segments of the lines that follow, and at a standstill in segments of its own. The lead is counted in
//! whole phase units, separately from the line, so that it is exactly 0 at a standstill.
//!
//! For each stretch, exec passes the velocity at the end of the stretch ([`Advance::aim`]). Each segment moves the
//! motor towards the lead for this velocity ([`Advance::travel`]), within the velocity and acceleration limits of the
//! axis. Where the lead jumps, as at the end of a line that pushes, the motor is therefore later than the model
//! demands.
//!
//! Units: phase units, s. Cost on AVR: 1,100 cycles a line, 3,000 a segment; with K 0 and no lead left 10.

use kerf_macros::small;

use super::block::{Line, PARTS_LOG2};
use super::divide::quotient;
use super::float::{below, greater, least, less, lesser, ratio, scaled, size, some, whole};
use super::short::Short;
use super::smooth::SAMPLE_S;
use crate::boards::MOTORS;
use crate::capability::Capability;
use crate::config::StepRatio;
use crate::dda::{STEP, STEP_LOG2};
use crate::hal::arithmetic::product;
use crate::hal::{TICKS, TIMER_HZ};
use crate::math::sqrt;
use crate::units::Length;

/// How many extruders there are.
pub const EXTRUDERS: usize = Capability::Printer.is_built_in() as usize;

/// The unit of K, s.
const UNIT_S: f32 = 1e-4;
/// The least duration of a stretch in computations, s.
const SHORTEST: f32 = 1e-4;
/// The longest lead, phase units: 30,000 steps.
const MOST: f32 = 1e9;
/// A lead so small that it may stay while other motors move, phase units: 1/32 step.
const LITTLE: u32 = 1 << 10;

/// The highest velocity of the motor with its lead, phase units in 256 CPU cycles: a step in each tick of a segment whose
/// ticks are as long as those of a usual line may be. At a higher velocity the motor would brake at once where such a
/// segment begins.
const RATE_MAX: f32 = STEP as f32 * 256.0 / (2 * TICKS[MOTORS - 1].coarse) as f32;

/// The most that the lead may ask for in a tick, phase units. This is more than a step, which is all that the motor can
/// make, so that [`Advance::note`] sees a lead that had to stay behind.
const MOST_PER_TICK: u16 = u16::MAX - 1;

/// [`refine`] stores a distance to 1/32 of the unit in which it is counted. This is the exponent of 32.
const MORE_LOG2: u8 = 5;
/// The error of two distances that are rounded to 1/512 step, phase units.
const ROUNDING: f32 = STEP as f32 / 256.0;
/// The most filament that a mean covers, as a power of two in slacks: 0.1 mm.
const ENOUGH_LOG2: i8 = 6;

/// The parameters of the extruder's lead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lead {
    /// The motor of the extruder.
    pub motor: u8,
    /// K, 0.1 ms; 0 for no lead.
    pub time: u16,
    /// Acceleration limit of the lead, steps/s^2, not 0.
    pub accel: Short,
    /// Velocity limit of the motor with its lead, steps/s, not 0.
    pub velocity: Short,
    /// The largest difference of extruder distances between lines with one extrusion rate, phase units: see
    /// [`Lead::slack`].
    pub slack: Short,
}

impl Lead {
    /// No lead.
    pub const NONE: Self =
        Self { motor: 0, time: 0, accel: Short::ZERO, velocity: Short::ZERO, slack: Short::ZERO };

    /// Returns the slack of a motor with `steps` steps/mm: 0.0012 mm of filament, since files may have three decimals,
    /// plus the rounding to parts of a step.
    pub fn slack(steps: f32) -> Short {
        Short::new(steps * (12.0 * STEP as f32 / Length::PER_MM as f32) + ROUNDING)
    }
}

/// Stores in a line that pushes filament the exact distance of its extruder: to 1/512 step, or to 1/32 step where
/// distances are in whole steps. The ends of lines are known to 1/16 step only, which may be a tenth of a short line
/// and would make the lead wrong by as much. `travel` is that of the extruder's axis, in units of [`Length`].
///
/// Called by the planner while there is a K. Cost: 1,400.
#[inline(never)]
#[small]
pub fn refine(line: &mut Line, motor: usize, ratio: StepRatio, travel: i32) {
    let Some(&way) = line.way.get(motor) else { return };
    if travel <= 0 {
        return;
    }
    let parts = if line.extent.has_whole_steps() { MORE_LOG2 } else { MORE_LOG2 + PARTS_LOG2 };
    let far = ratio.steps(Length(travel << parts));
    line.extent.refine(far.wrapping_sub(in_parts(way)) as i8);
}

/// An extruder with its lead.
#[derive(Clone, Copy, Debug)]
pub struct Advance {
    /// Whether there is a K, or a lead.
    pub(super) on: bool,
    /// Whether the running block has a lead, or takes back an earlier one.
    pub(super) leads: bool,
    pub(super) motor: u8,
    /// Whether the motor goes backwards in the last segment with a lead.
    pub(super) backwards: bool,
    /// K, s.
    time: f32,
    /// Acceleration limit of the lead, steps/s^2.
    accel: Short,
    /// The largest difference of extruder distances between lines with one extrusion rate, phase units.
    slack: Short,
    /// The motor's velocity limit, phase units in 256 CPU cycles.
    rate: u16,
    /// The motor's distance in lines with one extrusion rate, phase units, and the length of these lines, mm.
    pushed: (f32, f32),
    /// The lead in the running block for each mm/s of its velocity, phase units.
    factor: f32,
    /// Whether the block pushes at another rate than the one before: the lead jumps.
    jumps: bool,
    /// How fast the lead changes, phase units/s.
    speed: f32,
    /// How far the motor is ahead of its line in the segments that have been prepared, phase units.
    made: i32,
    /// How far the motor is to be ahead of its line at the end of the stretch, phase units.
    goal: i32,
    /// How fast `goal` changes, phase units/s; 0 if it jumps.
    pace: f32,
    /// Where distances are sampled: the lead for the velocity at the end of the last sample, before the means, phase
    /// units.
    raw: i32,
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
        accel: Short::ZERO,
        slack: Short::ZERO,
        rate: 0,
        pushed: (0.0, 0.0),
        factor: 0.0,
        jumps: false,
        speed: 0.0,
        made: 0,
        goal: 0,
        pace: 0.0,
        raw: 0,
    };

    /// Sets the parameters, from the next block on.
    #[inline(never)]
    pub fn set(&mut self, lead: &Lead) {
        const PER_256: f32 = STEP as f32 * 256.0 / TIMER_HZ as f32;
        self.time = f32::from(lead.time) * UNIT_S;
        // With a K of 0 the other parameters stay: they limit how the remaining lead is taken back.
        if lead.time != 0 {
            self.motor = lead.motor;
            self.accel = lead.accel;
            self.slack = lead.slack;
            self.rate = whole(least(lead.velocity.get() * PER_256, RATE_MAX)) as u16;
        }
        self.on = lead.time != 0 || self.made != 0;
    }

    /// Begins a block of `length` mm in which the motor goes `way` phase units forwards ([`pushed`]); 0 if it has no
    /// lead. Returns whether there is a lead to be made or taken back.
    #[inline(never)]
    pub fn begin(&mut self, way: u32, length: f32) -> bool {
        if way == 0 {
            self.end();
        } else {
            self.factor = self.time * self.ratio(way as f32, length);
        }
        some(self.factor) || !self.is_over()
    }

    /// Begins a block as [`Advance::begin`] does, where distances are sampled: the goal stays, because it comes from the
    /// means.
    #[inline(never)]
    pub fn begin_sampled(&mut self, way: u32, length: f32) {
        self.factor = if way == 0 { 0.0 } else { self.time * self.ratio(way as f32, length) };
    }

    /// Returns by how much the lead for this velocity, mm/s, is above that of the last sample.
    pub fn step_to(&mut self, velocity: f32) -> i32 {
        let end = whole(least(self.factor * velocity, MOST) + 0.5) as i32;
        end - core::mem::replace(&mut self.raw, end)
    }

    /// Moves the goal by `more` in a sample. Returns whether there is a lead to be made or taken back.
    pub fn aim_by(&mut self, more: i32) -> bool {
        self.goal += more;
        self.pace = more as f32 * (1.0 / SAMPLE_S);
        self.goal != 0 || self.made != 0 || some(self.speed)
    }

    /// Returns phase units of the motor for each mm of the path. Files round the ends of lines: with four decimals by
    /// 2 % of a short line's filament. So this is the mean over the lines before that differ by no more than
    /// [`Lead::slack`].
    fn ratio(&mut self, way: f32, length: f32) -> f32 {
        let (mut ways, mut lengths) = self.pushed;
        let slack = self.slack.get();
        self.jumps = !below(size(way * lengths - ways * length), slack * lengths);
        if self.jumps {
            (ways, lengths) = (0.0, 0.0);
        }
        (ways, lengths) = (ways + way, lengths + length);
        let mean = ratio(ways, lengths);
        if below(scaled(slack, ENOUGH_LOG2), ways) {
            (ways, lengths) = (scaled(ways, -1), scaled(lengths, -1));
        }
        self.pushed = (ways, lengths);
        mean
    }

    /// Whether no lead is left, except for a remainder so small that it may stay until the machine stands still.
    fn is_over(&self) -> bool {
        self.made.unsigned_abs() < LITTLE && !some(self.speed)
    }

    /// Whether the block needs no lead and none is left, except for a remainder so small that it may stay until the
    /// machine stands still.
    pub fn is_done(&self) -> bool {
        !some(self.factor) && self.goal == 0 && self.is_over()
    }

    /// Begins segments with a lead, if the segment before had none. The motor then has the direction of its line.
    #[inline(always)]
    pub fn take_up(&mut self, backwards: bool) {
        if !self.leads {
            (self.leads, self.backwards) = (true, backwards);
        }
    }

    /// How far the motor is ahead of its line, phase units.
    pub fn made(&self) -> i32 {
        self.made
    }

    /// Ends the lead, because the line ends or nothing of it moves: the goal is 0 from here on.
    pub fn end(&mut self) {
        (self.factor, self.goal, self.pace) = (0.0, 0, 0.0);
    }

    /// Sets the lead to 0 at the present position of the motor, which stands still.
    pub fn cut(&mut self) {
        self.end();
        (self.made, self.raw, self.speed, self.leads) = (0, 0, 0.0, false);
        self.on = some(self.time);
    }

    /// Sets the goal for the end of a stretch of `seconds`, at which the machine is at `velocity`, mm/s.
    #[inline(never)]
    pub fn aim(&mut self, velocity: f32, seconds: f32) {
        let end = whole(least(self.factor * velocity, MOST) + 0.5) as i32;
        let way = end - self.goal;
        let pace = ratio(way as f32, greater(seconds, SHORTEST));
        self.goal += rounded(pace * seconds);
        self.pace = if core::mem::take(&mut self.jumps) { 0.0 } else { pace };
    }

    /// Returns how far the lead goes in each of `ticks`, towards its goal, signed; no more than [`MOST_PER_TICK`].
    #[inline(never)]
    pub fn travel(&mut self, ticks: u16, period: u16) -> i32 {
        let want = self.goal - self.made;
        if want == 0 && !some(self.speed) {
            return 0;
        }
        if ticks == 1 && want.unsigned_abs() < LITTLE {
            // The goal is reached exactly: a single tick is long enough for so small a distance.
            self.speed = 0.0;
            return want;
        }
        let time = seconds(ticks, period);
        // How late the lead is, and how fast it catches up, both relative to a goal that moves at `pace`. So the lead
        // reaches a goal that moves steadily.
        let late = want as f32 - self.pace * time;
        let far = size(late);
        let speed = turned(self.speed - self.pace, late);
        let accel = scaled(self.accel.get(), STEP_LOG2 as i8);
        let gain = accel * time;
        let (slow, fast) = (speed - gain, speed + gain);
        let next = if less(gain * time, far) {
            // The speed from which the lead can stop at its goal by losing at most `gain` in each later segment.
            sqrt(gain * gain + 2.0 * accel * far) - gain
        } else {
            // The goal is reached at a speed of `gain` at most, because the lead stops there.
            ratio(far, time)
        };
        self.speed = self.pace + turned(greater(lesser(next, fast), slow), late);
        per_tick(rounded(self.speed * time), ticks)
    }

    /// Sets the goal to 0, because the machine stands still. Returns whether the remaining lead is so small that a
    /// single tick takes it back.
    pub fn rest(&mut self) -> bool {
        (self.goal, self.pace) = (0, 0.0);
        let little = self.made.unsigned_abs() < LITTLE;
        if little {
            self.speed = 0.0;
        }
        little
    }

    /// Returns the most that the motor may go in a tick, phase units.
    pub fn most(&self, period: u16) -> i32 {
        let most = product(self.rate, period) >> 8;
        most.clamp(1, STEP.into()) as i32
    }

    /// Counts a segment in which the motor moves `more` phase units farther than its line in each tick; `wanted` was
    /// requested.
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

/// Returns the distance of the extruder in a line, as stored by [`refine`], phase units; 0 if it moves backwards or
/// stands.
#[inline(always)]
pub(super) fn pushed(way: i16, line: &Line) -> u32 {
    const LOG2: u8 = STEP_LOG2 - MORE_LOG2;
    let far = in_parts(way) + i32::from(line.extent.more());
    if way <= 0 || far <= 0 {
        return 0;
    }
    (far as u32) << if line.extent.has_whole_steps() { LOG2 } else { LOG2 - PARTS_LOG2 }
}

/// Divides what [`refine`] has stored between the two parts of a line, the first of which has this share of it.
pub(super) fn cut_push(line: &Line, head: &mut Line, tail: &mut Line, share: f32, motor: usize) {
    let way = |line: &Line| line.way.get(motor).copied().map_or(0, in_parts);
    let all = way(line) + i32::from(line.extent.more());
    let first = (all as f32 * share) as i32;
    let (in_head, in_tail) = (way(head), way(tail));
    head.extent.refine(first.wrapping_sub(in_head) as i8);
    tail.extent.refine((all - first).wrapping_sub(in_tail) as i8);
}

/// Returns a distance in the parts of a step of [`refine`].
fn in_parts(way: i16) -> i32 {
    i32::from(way) << MORE_LOG2
}

/// Returns how long `ticks` take, s.
fn seconds(ticks: u16, period: u16) -> f32 {
    product(ticks, period) as f32 * (1.0 / TIMER_HZ as f32)
}

/// Returns `x`, or its negative if `sign` is negative.
fn turned(x: f32, sign: f32) -> f32 {
    f32::from_bits(x.to_bits() ^ (sign.to_bits() & (1 << 31)))
}

/// A number of either sign, rounded.
#[inline(never)]
#[small]
fn rounded(x: f32) -> i32 {
    let size = whole(size(x) + 0.5) as i32;
    if x.is_sign_negative() { -size } else { size }
}

/// Returns a distance divided by `ticks`, rounded, and no more than [`MOST_PER_TICK`].
#[inline(never)]
#[small]
fn per_tick(way: i32, ticks: u16) -> i32 {
    let size = way.unsigned_abs().min(product(ticks, MOST_PER_TICK));
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
            slack: Lead::slack(93.0),
        });
        advance
    }

    /// Runs so many segments, and returns the lead after each, steps.
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
            advance.aim(velocity, 0.002);
            let lead = run(&mut advance, 1)[0];
            let exact = 0.05 * 3.1 * f64::from(velocity);
            assert!((lead - exact).abs() < 0.02, "{velocity} mm/s: {lead} of {exact}");
        }
        advance.end();
        let leads = run(&mut advance, 40);
        // The lead changes its velocity by 89,000 steps/s^2 at most: 0.36 step from one segment to the next.
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
    fn a_lead_that_is_late_catches_up_with_a_goal_that_moves() {
        let mut advance = advance();
        advance.begin((3.1 * f32::from(STEP)) as u32, 1.0);
        // From rest 2,000 mm/s^2 at once, 310 steps/s of lead.
        let late = (1..=12u16).map(|n| {
            let velocity = 4.0 * f32::from(n);
            advance.aim(velocity, 0.002);
            0.05 * 3.1 * f64::from(velocity) - run(&mut advance, 1)[0]
        });
        let late: std::vec::Vec<_> = late.collect();
        assert!(late.iter().all(|late| late.abs() < 0.5), "{late:?}");
        assert!(late.iter().skip(8).all(|late| late.abs() < 0.02), "{late:?}");
    }

    #[test]
    fn a_line_says_how_far_its_extruder_goes() {
        let ratio = StepRatio { num: 93, den: 10_000 };
        for (travel, way, length) in
            [(67, 10i16, 0.2), (66, 10, 0.2), (66, 9, 0.2), (5_000, 46, -50.0)]
        {
            let mut line = Line::default();
            line.way[3] = way;
            line.extent = super::super::block::Extent::new(f32::abs(length), length < 0.0);
            refine(&mut line, 3, ratio, travel);
            let far = f64::from(pushed(way, &line)) / f64::from(STEP);
            let off = far - f64::from(travel) * 0.0093;
            assert!(off.abs() < if length < 0.0 { 0.016 } else { 0.001 }, "{travel}: {far}");
            assert!((line.extent.length() / f32::abs(length) - 1.0).abs() < 2e-5);
            assert_eq!(line.extent.has_whole_steps(), length < 0.0);
            assert_eq!(pushed(-way, &line), 0);
        }
    }

    #[test]
    fn a_lead_that_few_ticks_held_back_goes_on_from_its_speed() {
        let mut advance = advance();
        (advance.made, advance.goal) = (1_000 * i32::from(STEP), 0);
        advance.speed = -4_400.0 * f32::from(STEP);
        // Five ticks of 0.4 ms, in each of which the motor makes a step: 2,500 steps/s.
        let more = advance.travel(5, 6_400);
        advance.note(-i32::from(STEP), more, (5, 6_400));
        let before = advance.made;
        let more = advance.travel(TICKS, PERIOD);
        advance.note(more, more, (TICKS, PERIOD));
        let way = f64::from(before - advance.made) / f64::from(STEP);
        // 2 ms at 2,500 steps/s, and 89,000 steps/s^2 for 2 ms.
        assert!((way - 5.36).abs() < 0.03, "{way}");
    }

    #[test]
    fn a_lead_stops_at_its_goal_within_its_acceleration() {
        for steps in 1..200 {
            let mut advance = advance();
            advance.made = steps * i32::from(STEP) / 3;
            let leads = run(&mut advance, 60);
            let mut before = (f64::from(steps) / 3.0, 0.0);
            for lead in leads {
                let way = lead - before.0;
                assert!((way - before.1).abs() < 0.36 + 0.01, "{steps}: {way} behind {}", before.1);
                before = (lead, way);
            }
        }
    }

    #[test]
    fn parts_are_rounded_and_within_their_limit() {
        assert_eq!([63, 32, 31, -32, -31].map(|way| per_tick(way, 64)), [1, 1, 0, -1, 0]);
        assert_eq!(per_tick(i32::MAX, 2_000), MOST_PER_TICK.into());
        assert_eq!(per_tick(-i32::MAX, 1), -i32::from(MOST_PER_TICK));
    }
}
