//! Threading: computes the velocity of axes that follow the angle of the spindle.
//!
//! Owned by exec, at the exec level. Exec calls [`Thread::velocity`] for each stretch of a pass, and reports the
//! distance and time that it has handed out. This velocity is an upper limit for the lines of a pass. The governor ends
//! each line at its place as for any line: the proof that every motion ends on its step does not involve threads.
//! Units: mm along the path, s. Time is in counts of the encoder and CPU cycles.
//!
//! **The phase line** is the set position of the axes: 0 at the first pulse of sync after an index, and `lead` more
//! with each turn. It is known exactly at the last pulse. From there it is extrapolated, at the speed of the last
//! pulses, to the end of the queued segments, 4 to 9 ms ahead of the pins. Ticks are exact to the cycle, so that this
//! time, and the position of the axes then, are known. The remaining dead time is one stretch: 2 ms.
//!
//! **The law.** `e` is the distance from the axes to the line, and `u` the speed of the line. The set velocity of the
//! axes is `u + c`, where `c` has the sign of `e` and is the lesser of [`GAIN`]` * e` and `sqrt(2 b e)`, with `b` seven
//! tenths of the acceleration limit. The root gives a ramp that meets the line at its speed. So the axes start before
//! the line reaches them, by half the time of the ramp, and the phase at which they meet it does not depend on the
//! speed. Three tenths of the limit remain to correct the error.
//!
//! **The start.** If the line is too near for the ramp while the axes stand still, or has passed them, it is set back by
//! as many leads as the ramp needs, so that it reaches them some turns later.
//!
//! **Pulses that do not fit.** A spindle has inertia: it gains or loses a fifth of its speed in a turn at most. A pulse
//! after twice the expected time counts as two. A pulse between the times at which one is expected is ignored. Two
//! indices that agree on it correct a wrong count by a few pulses; an index elsewhere is ignored. Each of these is a
//! *doubt*. An index at which the count is right ends all doubt; at the fourth the [spindle is lost](Thread::fault). It is
//! also lost when two pulses in a row are overdue; until then the line goes on at its speed. Before the axes move, a
//! doubt makes the pass wait for an index anew, and for turns that fit ([`Encoder::is_sure`]).
//!
//! With a single pulse a turn nothing checks the count. A doubt counts twice, and a pulse at its time takes one off. Of
//! two pulses that are too close, the first may be the stray one if it was early: the spindle is lost. A missing pulse
//! looks like a spindle at half its speed; it is treated as a missing pulse, once.
//!
//! Cost on AVR: 2,500 cycles a stretch, 1,500 more with a pulse. RAM: 41 bytes.

use kerf_macros::small;

use super::block::Pass;
use super::float::{greater, least, size, some, whole};
use super::retract::Retract;
use super::short::Short;
use crate::encoder::{COUNTS_PER_S, Encoder, Pulses};
use crate::hal::TIMER_HZ;
use crate::math::sqrt;
use crate::status::Status;

/// Correction velocity per distance to the line, 1/s: half of the distance is corrected in a stretch.
const GAIN: f32 = 250.0;

/// The share of the acceleration limit that the ramp takes.
const SHARE: f32 = 0.7;

/// The least time over which the speed is measured, counts: 16 ms.
const WINDOW: u32 = COUNTS_PER_S / 1_000 * 16;

/// The spindle is lost when no pulse has come for this many intervals between pulses, and [`SLACK`].
const OVERDUE: f32 = 2.01;

/// Margin of the time after which the spindle is lost, counts: 0.5 ms, because pulses are not quite even.
const SLACK: f32 = COUNTS_PER_S as f32 * 0.0005;

/// A spindle slows down before it reverses. A pulse counts as forward up to this share of the time to the standstill; a
/// later pulse counts as one in reverse. Taking a forward pulse for one in reverse is an error of one pulse. After the
/// opposite error the reversal would never be detected.
const FORWARD: f32 = 0.85;

/// The longest time between two pulses of a spindle that reverses, counts: 6 s.
const PATIENCE: f32 = COUNTS_PER_S as f32 * 6.0;

/// The longest time that the queued segments last, counts: 16 ms.
const QUEUED: f32 = COUNTS_PER_S as f32 * 0.016;

/// CPU cycles in a count.
const CYCLES: u32 = TIMER_HZ / COUNTS_PER_S;

/// A velocity below this is a standstill, mm/s.
const SLOWEST: f32 = 0.01;

/// How late a pulse may be, as a share of the interval between two; how early where [`EARLY`] does not apply.
const LATE: f32 = 0.6;

/// By how much the error of several pulses at once may be greater, for each of them: that of the speed.
const UNSURE: f32 = 0.08;

/// A pulse that comes by itself is looked at more closely if two of them are farther apart than this, counts: 2.2 ms. Else
/// a stray one comes in the same stretch as another.
const APART: f32 = COUNTS_PER_S as f32 * 0.0022;

/// How early a single pulse may be in a pass, as a share of the interval between two. A spindle that gains a fifth of
/// its speed within a turn has its next index after 0.82 of a turn.
const EARLY: f32 = 0.25;

/// How late a single pulse may be. A spindle that loses a fifth of its speed within each turn has its next
/// index after 1.25 turns.
const LATE_SINGLE: f32 = 0.3;

/// The speed is not measured by a single pulse that is farther than this from its expected time, as a share of the
/// interval between two.
const ODD: f32 = 0.125;

/// With the index alone, one of two pulses is a stray one if they are closer than they may be, and the first of them
/// was early by more than this.
const EARLY_INDEX: f32 = 0.02;

/// The pass ends at this doubt.
const MOST_DOUBT: u8 = 4;

/// The most index pulses that do not fit before a pass begins.
const MOST_REFUSED: u8 = 16;

/// The most pulses that may be missing in a turn without being taken for a missing index, with about 256 pulses a turn.
const FEW: u8 = 8;

/// The stages of a pass, in this order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Debug, Default)]
enum Stage {
    /// No pass.
    #[default]
    Off,
    /// Waits for an index.
    Armed,
    /// Waits for the first pulse of sync after the index.
    Indexed,
    /// The phase line is known, but the axes stand still.
    Known,
    /// The axes follow the phase line.
    Follows,
    /// The axes have been within the limit of the error.
    Met,
    /// G33.1: the spindle has been commanded to reverse.
    Turning,
    /// The spindle is about to reverse, or has: the axes decelerate to a standstill.
    Top,
    /// The spindle has reversed.
    Turned,
    /// The remainder of the line has been dropped; the way back is still to come.
    Waits,
    /// The spindle was lost, and the axes decelerate to a standstill.
    Lost,
    /// The error was above its limit, and the axes decelerate to a standstill.
    Astray,
}

/// A pass in step with the spindle.
#[derive(Debug, Default)]
pub struct Thread {
    stage: Stage,
    per_turn: u16,
    lead: f32,
    /// Distance from the position of the axes at the end of the queued segments to that of the line at the last pulse,
    /// mm.
    ahead: f32,
    /// Time from pulse to pulse, counts. Before an index has come: that of a turn.
    interval: f32,
    /// `at` is when the last pulse came, in counts. The speed is measured over the `measured` pulses since `since`.
    at: u32,
    since: u32,
    measured: u16,
    /// The pulses and the indices as last read, and the pulses that were to be counted at the last index: less those
    /// that were added since, plus those that were ignored. Modulo 256, because they are read every few ms in a pass.
    pulses: u8,
    index: u8,
    expected: u8,
    /// How many pulses were missing at the last index, as counted from an index at which none was missing.
    short: i8,
    /// The time at which the queued segments end, CPU cycles.
    end: u32,
    /// Whether an index has come since the last call of [`Thread::error`].
    indexed: bool,
    /// How many pulses came at another time than expected since the last index at which the count was right. With the
    /// index alone each counts twice, and a pulse at its time takes one off. Before the axes follow: how many index
    /// pulses did not fit.
    doubt: u8,
    kind: Kind,
}

/// How the pass ends.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// G33, a pass of G76: it ends with its lines.
    Pass {
        /// How far the axes may be off, mm; 0 for no limit.
        limit: Short,
        /// How the pass is left before its end.
        retract: Retract,
        /// Whether the last pulse was early, so that it may be a stray one.
        early: bool,
    },
    /// G33.1: the axes move back when the spindle has reversed.
    Tap {
        /// Distance to the end of the line at which the spindle is to reverse, mm.
        turn_at: f32,
        /// Deceleration of the spindle: pulses a count, per count.
        decel: f32,
        /// Duration of the last measurement of the speed, counts.
        window: u16,
    },
}

impl Default for Kind {
    fn default() -> Self {
        Self::NONE
    }
}

impl Kind {
    const NONE: Self = Self::Pass { limit: Short::ZERO, retract: Retract::NONE, early: false };
}

#[small]
impl Thread {
    /// No pass.
    pub const fn new() -> Self {
        Self {
            stage: Stage::Off,
            per_turn: 0,
            lead: 0.0,
            ahead: 0.0,
            interval: 0.0,
            at: 0,
            since: 0,
            measured: 0,
            pulses: 0,
            index: 0,
            expected: 0,
            short: 0,
            end: 0,
            indexed: false,
            doubt: 0,
            kind: Kind::NONE,
        }
    }

    /// Returns why the pass is to end at once, or `None` if it is not.
    pub fn fault(&self) -> Option<Status> {
        match self.stage {
            Stage::Lost => Some(Status::SpindleLost),
            Stage::Astray => Some(Status::SpindleError),
            _ => None,
        }
    }

    /// Begins a pass.
    pub fn begin(pass: &Pass) -> Self {
        let Pass { lead, limit, retract, turn_at } = *pass;
        let kind = match some(turn_at) {
            true => Kind::Tap { turn_at, decel: 0.0, window: WINDOW as u16 },
            false => Kind::Pass { limit, retract, early: false },
        };
        Self { stage: Stage::Armed, lead, kind, ..Self::new() }
    }

    /// Whether this is G33.1 and the axes have begun to follow. From then on they may stand still only while the
    /// spindle does.
    pub fn is_tapping(&self) -> bool {
        matches!(self.kind, Kind::Tap { .. }) && self.stage >= Stage::Follows
    }

    /// Whether to command the spindle to reverse now, with `left` mm of the line left. True only once.
    pub fn is_to_turn(&mut self, left: f32) -> bool {
        let turns = match self.kind {
            Kind::Tap { turn_at, .. } => self.stage == Stage::Follows && left <= turn_at,
            Kind::Pass { .. } => false,
        };
        if turns {
            self.stage = Stage::Turning;
        }
        turns
    }

    /// Whether the axes follow the spindle, or wait for it within the pass: it must not be stopped.
    pub fn has_begun(&self) -> bool {
        self.stage >= Stage::Follows
    }

    /// Waits for an index anew, because a hold has begun before the axes follow.
    pub fn wait_anew(&mut self) {
        self.stage = Stage::Armed;
        (self.per_turn, self.ahead) = (0, 0.0);
    }

    /// Whether the spindle has been commanded to reverse, and the way back has not begun.
    pub fn turns_round(&self) -> bool {
        self.stage >= Stage::Turning && self.stage < Stage::Lost
    }

    /// Whether the axes are to stand still, because the spindle reverses.
    pub fn rests(&self) -> bool {
        matches!(self.stage, Stage::Top | Stage::Turned | Stage::Waits)
    }

    /// Whether the spindle has reversed, and the way back may begin.
    pub fn has_turned(&self) -> bool {
        self.stage == Stage::Turned
    }

    /// Notes that the remainder of the line has been dropped. Returns whether the way back is still to come.
    pub fn drop_rest(&mut self) -> bool {
        let waits = self.stage == Stage::Turned;
        if waits {
            self.stage = Stage::Waits;
        }
        waits
    }

    /// Whether the way back is still to come.
    pub fn waits(&self) -> bool {
        self.stage == Stage::Waits
    }

    /// Notes that pulses count in the opposite direction from here on.
    pub fn mirror(&mut self) {
        self.pulses = self.pulses.wrapping_neg();
    }

    /// Begins the way back, with the phase of the way there.
    pub fn turn_back(&mut self) {
        self.ahead = -self.ahead;
        self.stage = Stage::Follows;
    }

    /// Returns how the pass is left before its end; [`Retract::NONE`] while the axes have not begun to follow.
    pub fn retract(&self) -> Retract {
        match self.kind {
            Kind::Pass { retract, .. } if self.stage >= Stage::Follows => retract,
            _ => Retract::NONE,
        }
    }

    /// Sets the lead along the path from here on, mm a turn: a taper begins or ends. Returns by how much it is greater
    /// than before.
    pub fn set_lead(&mut self, lead: f32) -> f32 {
        let ratio = lead / self.lead;
        self.ahead *= ratio;
        self.lead = lead;
        ratio
    }

    /// Fixes the time at which the queued segments end. The steppers are started at `time`, which is in counts, and
    /// make their first tick `cycles` later. All segments queued since they stood still have been
    /// [reported](Thread::queued).
    pub fn anchor(&mut self, time: u32, cycles: u32) {
        self.end = self.end.wrapping_add(time.wrapping_mul(CYCLES)).wrapping_add(cycles);
    }

    /// Adds `cycles` that have been queued. `standstill`: the steppers stood still before.
    pub fn queued(&mut self, cycles: u32, standstill: bool) {
        let before = if standstill { 0 } else { self.end };
        self.end = before.wrapping_add(cycles);
    }

    /// Adds `distance`, mm, to the position of the axes at the end of the queued segments.
    pub fn handed(&mut self, distance: f32) {
        self.ahead -= distance;
    }

    /// Takes in the pulses that the sensors have counted by the time of `encoder`. Returns whether the spindle has just
    /// reversed.
    #[inline(never)]
    pub fn note(&mut self, pulses: &Pulses, encoder: &Encoder) -> bool {
        if self.stage >= Stage::Lost {
            return false;
        }
        let (time, per_turn, turn) = (encoder.time(), encoder.per_turn(), encoder.turn());
        let tells = encoder.tells();
        let had_turned = self.has_turned();
        let before = |at: u16| time.wrapping_sub(pulses.now.wrapping_sub(at).into());
        if self.per_turn == 0 {
            (self.per_turn, self.index) = (per_turn, pulses.index as u8);
            // The index is due within a turn.
            (self.at, self.interval) = (time, turn as f32);
        }
        let (count, at) = match per_turn {
            1 => (pulses.index, before(pulses.index_at)),
            _ => (pulses.sync, before(pulses.sync_at)),
        };
        let (count, at_index) = (count as u8, pulses.at_index as u8);
        let turns = (pulses.index as u8).wrapping_sub(self.index);
        if turns != 0 {
            self.index = pulses.index as u8;
            self.indexed = true;
            if self.stage == Stage::Armed {
                (self.at, self.interval) = (time, turn as f32);
                if encoder.is_sure() {
                    self.interval /= f32::from(per_turn);
                    (self.expected, self.short, self.doubt) = (at_index, 0, 0);
                    self.pulses = if per_turn == 1 { count.wrapping_sub(1) } else { at_index };
                    self.stage = Stage::Indexed;
                } else {
                    self.doubt += 1;
                    if self.doubt > MOST_REFUSED {
                        self.stage = Stage::Lost;
                    }
                }
            } else if self.stage > Stage::Armed && self.has_check() {
                self.check_turns(turns, at_index);
            }
        }
        let new = count.wrapping_sub(self.pulses);
        match self.stage {
            Stage::Off => return false,
            Stage::Armed => {}
            _ if new == 0 => {}
            Stage::Indexed if !(tells && (new as i8) < 0) => {
                self.ahead = self.pitch() * f32::from(new - 1);
                (self.at, self.since, self.measured) = (at, at, 0);
                self.stage = Stage::Known;
            }
            Stage::Turning | Stage::Top => self.take_turning(new, tells, at),
            Stage::Turned | Stage::Waits => {
                let count = if tells { f32::from(new as i8) } else { f32::from(new) };
                self.ahead -= self.pitch() * count;
                self.keep_pace(count, at);
            }
            _ if tells && (new as i8) < 0 => self.stage = Stage::Lost,
            _ => self.take(new, at),
        }
        self.pulses = count;
        let age = time.wrapping_sub(self.at) as f32;
        // After a hold in which the spindle has stood still, and between pulses that do not fit, the speed is not known.
        let is_known = some(self.interval) && (self.stage != Stage::Armed || encoder.is_sure());
        let overdue = if is_known && !self.turns_unevenly() {
            OVERDUE * self.interval + SLACK
        } else {
            PATIENCE
        };
        if self.stage < Stage::Lost && age > overdue {
            self.stage = Stage::Lost;
        }
        self.has_turned() && !had_turned
    }

    /// Returns how far the axes were ahead of the line at the last pulse, mm; `velocity` is theirs at the end of the
    /// queued segments. `None` unless the axes follow and an index has come since the last call.
    pub fn error(&mut self, velocity: f32) -> Option<f32> {
        let indexed = core::mem::take(&mut self.indexed) && self.follows();
        let late = self.end.wrapping_sub(self.at.wrapping_mul(CYCLES)) as i32;
        indexed.then(|| -(self.ahead + velocity * (late as f32 * (1.0 / TIMER_HZ as f32))))
    }

    fn follows(&self) -> bool {
        matches!(self.stage, Stage::Follows | Stage::Met)
    }

    /// Whether the time between two pulses does not predict the next interval, because the spindle reverses, or has
    /// reversed, and its speed changes too much between pulses.
    #[inline(never)]
    fn turns_unevenly(&self) -> bool {
        match self.kind {
            _ if self.stage >= Stage::Turning => true,
            Kind::Tap { window: 0, .. } => true,
            Kind::Tap { decel, .. } => size(decel) * self.interval * self.interval > 0.25,
            Kind::Pass { .. } => false,
        }
    }

    /// Whether this is not G33.1.
    #[inline(always)]
    fn is_pass(&self) -> bool {
        matches!(self.kind, Kind::Pass { .. })
    }

    /// Whether an index shows whether the count of pulses is right.
    #[inline(always)]
    fn has_check(&self) -> bool {
        self.per_turn > 1 && self.is_pass()
    }

    /// Distance along the path in a pulse, mm.
    #[inline(never)]
    fn pitch(&self) -> f32 {
        self.lead / f32::from(self.per_turn)
    }

    /// Corrects the phase at an index `turns` after the last one, when sync had counted `at_index` pulses. Missing pulses
    /// are corrected if they were missing at the index before, too: the pulse that shows a missing one may be still to
    /// come. An index pulse that is missing or too many has no effect.
    #[inline(never)]
    fn check_turns(&mut self, turns: u8, at_index: u8) {
        let per_turn = self.per_turn as u8;
        self.expected = self.expected.wrapping_add(turns.wrapping_mul(per_turn));
        let off = self.expected.wrapping_sub(at_index);
        let mut short = off as i8;
        // Modulo 256 a turn may be as little as a few missing pulses.
        if (per_turn as i8).unsigned_abs() > FEW || self.per_turn <= u16::from(FEW) {
            for other in [off.wrapping_add(per_turn) as i8, off.wrapping_sub(per_turn) as i8] {
                if other.unsigned_abs() < short.unsigned_abs() {
                    short = other;
                }
            }
        }
        let agreed = match (short < 0, self.short < 0) {
            (true, true) => short.max(self.short),
            (false, false) => short.min(self.short),
            _ => 0,
        };
        // An error of more pulses is not that of some pulses, but of the index.
        let most = FEW.min((self.per_turn / 16) as u8);
        if short == 0 {
            (self.expected, self.doubt) = (at_index, 0);
        } else if agreed.unsigned_abs() > most {
            self.stage = Stage::Lost;
        } else {
            if short.unsigned_abs() > most {
                self.expected = self.expected.wrapping_sub(turns.wrapping_mul(per_turn));
            }
            if !self.doubts() {
                return;
            }
        }
        self.ahead += self.pitch() * f32::from(agreed);
        self.short = short.wrapping_sub(agreed);
        self.expected = self.expected.wrapping_sub(agreed as u8);
    }

    /// Notes a pulse or an index that was not expected. The pass ends if there are too many. As long as the axes stand
    /// still, it waits for an index anew. Returns whether the pass goes on.
    #[inline(never)]
    fn doubts(&mut self) -> bool {
        if self.stage < Stage::Follows {
            // An index is due within a turn.
            self.interval *= f32::from(self.per_turn);
            self.stage = Stage::Armed;
            return false;
        }
        self.doubt += if self.has_check() { 1 } else { 2 };
        if self.doubt >= MOST_DOUBT {
            self.stage = Stage::Lost;
        }
        self.stage != Stage::Lost
    }

    /// Takes in `new` pulses, the last of them at time `at`. Corrects the count if they do not fit.
    #[inline(never)]
    fn take(&mut self, new: u8, at: u32) {
        let after = at.wrapping_sub(self.at) as f32;
        let (rate, decel) = self.pace();
        let passed = (rate - 0.5 * decel * after) * after;
        let count = f32::from(new);
        let off = passed - count;
        let is_single = new == 1 && self.is_pass() && self.interval > APART;
        let unsure = LATE - UNSURE + UNSURE * count;
        let (early, late) = if is_single { (EARLY, LATE_SINGLE) } else { (unsure, unsure) };
        let is_odd = is_single && !(-ODD..=ODD).contains(&off);
        if self.turns_unevenly() || passed >= 100.0 {
            // Nothing is known of the next pulse.
        } else if !(-early..=late).contains(&off) {
            return self.take_misfit(new, at, passed, is_single);
        } else if let Kind::Pass { early, .. } = &mut self.kind {
            *early = is_single && off < if self.per_turn == 1 { -EARLY_INDEX } else { -ODD };
            if self.per_turn == 1 {
                self.doubt = self.doubt.saturating_sub(1);
            } else if is_odd && self.doubt == 0 {
                // Perhaps a stray pulse: the speed is not measured by it.
                if self.doubts() {
                    self.anchor_at(1.0, at);
                }
                return;
            }
        }
        self.ahead += self.pitch() * count;
        self.keep_pace(count, at);
    }

    /// Takes in `new` pulses where `passed` were expected, the last of them at time `at`. Counts as many as fit.
    #[inline(never)]
    fn take_misfit(&mut self, new: u8, at: u32, passed: f32, is_single: bool) {
        let fits = match (passed + if is_single { EARLY } else { 1.0 - LATE }) as u16 as u8 {
            // Between the times at which pulses are expected.
            1 if is_single => 0,
            fits => fits,
        };
        let is_early = passed < f32::from(new);
        let Kind::Pass { early: was_early, .. } = self.kind else {
            return self.count_as(fits, new, at);
        };
        if !self.doubts() {
            return;
        }
        if fits == 0 && self.per_turn == 1 {
            if was_early || !is_early {
                // This pulse is a stray one, or the one before.
                self.stage = Stage::Lost;
            }
        } else if fits == 0 && was_early {
            // More likely the one before is the stray one.
            self.anchor_at(0.0, at);
        }
        self.count_as(fits, new, at);
    }

    /// Counts `new` pulses as `fits`, the last of them at time `at`.
    fn count_as(&mut self, fits: u8, new: u8, at: u32) {
        let count = f32::from(fits);
        self.expected = self.expected.wrapping_add(new.wrapping_sub(fits));
        if fits != 0 && fits < new {
            // Which of them is a stray one is not known: the last one that fits was due at this time.
            self.anchor_at(count, self.at.wrapping_add((count * self.interval) as u32));
        } else if fits != 0 {
            self.ahead += self.pitch() * count;
            self.keep_pace(count, at);
        }
    }

    /// Counts `count` more pulses, the last of them at time `at`. Their rate is measured from here on.
    #[inline(never)]
    fn anchor_at(&mut self, count: f32, at: u32) {
        self.ahead += self.pitch() * count;
        (self.at, self.since, self.measured) = (at, at, 0);
    }

    /// Counts `count` more pulses, the last of them at time `at`, and measures their rate.
    #[inline(never)]
    fn keep_pace(&mut self, count: f32, at: u32) {
        self.at = at;
        self.measured = self.measured.saturating_add(count as u16);
        let window = at.wrapping_sub(self.since);
        if window < WINDOW || self.measured == 0 {
            return;
        }
        let counts = window as f32;
        let interval = counts / f32::from(self.measured);
        if let Kind::Tap { decel, window: before, .. } = &mut self.kind {
            // From the middle of one window to the middle of the other.
            let apart = 0.5 * (counts + f32::from(*before));
            *decel = (1.0 / self.interval - 1.0 / interval) / apart;
            *before = u16::try_from(window).unwrap_or(u16::MAX);
        }
        self.interval = interval;
        (self.since, self.measured) = (at, 0);
    }

    /// Takes in pulses of a spindle that is about to reverse. If pulses tell the direction, the spindle has reversed
    /// when they count down. Otherwise a pulse at about the time of the standstill, or later, counts as one in reverse,
    /// at the mark of the last pulse. The position of the spindle then follows from its deceleration.
    #[inline(never)]
    fn take_turning(&mut self, new: u8, tells: bool, at: u32) {
        let after = at.wrapping_sub(self.at) as f32;
        let (rate, decel) = self.pace();
        let is_forward = match tells {
            true => new as i8 >= 0,
            false => self.stage != Stage::Top && (decel <= 0.0 || after * decel <= FORWARD * rate),
        };
        if is_forward {
            let count = f32::from(new);
            self.ahead += self.pitch() * count;
            return self.keep_pace(count, at);
        }
        let back = decel * after - rate;
        // The first pulse on the way back is at the mark of the last one on the way there.
        let way =
            if tells { f32::from(new as i8) + 1.0 } else { (rate - 0.5 * decel * after) * after };
        self.ahead += self.pitch() * way;
        // If the deceleration is not known, the spindle is assumed to move one pulse in that time.
        self.interval = if back > 0.0 { 1.0 / back } else { after };
        (self.at, self.since, self.measured) = (at, at, 0);
        if let Kind::Tap { decel, window, .. } = &mut self.kind {
            // The speed is now that of this moment, not the mean of a window.
            (*decel, *window) = (-*decel, 0);
        }
        self.stage = Stage::Turned;
    }

    /// Returns the speed at the last pulse, in pulses a count, and by how much it falls in a count.
    #[inline(never)]
    fn pace(&self) -> (f32, f32) {
        let mean = 1.0 / self.interval;
        let Kind::Tap { decel, window, .. } = self.kind else { return (mean, 0.0) };
        // The mean is the speed in the middle of the last window.
        let since = 0.5 * f32::from(window) + self.at.wrapping_sub(self.since) as f32;
        (greater(mean - decel * since, 0.0), decel)
    }

    /// Returns the velocity to be reached in the next stretch, mm/s, from `velocity`; 0 for a standstill. `kept` is
    /// time in cycles of the queued distance that no segment has yet. The error is compared with its limit unless the
    /// axes slow down for the end (`brakes`).
    #[inline(never)]
    pub fn velocity(&mut self, kept: i32, velocity: f32, accel: f32, brakes: bool) -> f32 {
        if self.stage < Stage::Known {
            return 0.0;
        }
        let end = self.end.wrapping_add(kept as u32);
        let late = end.wrapping_sub(self.at.wrapping_mul(CYCLES)) as i32;
        let counts = late as f32 * (1.0 / CYCLES as f32);
        let (rate, decel) = self.pace();
        let mut speed = self.pitch() * COUNTS_PER_S as f32 * (rate - decel * counts);
        let mut gone = (rate - 0.5 * decel * counts) * counts;
        if self.stage == Stage::Turning && speed < SLOWEST {
            self.stage = Stage::Top;
        }
        if self.rests() {
            return 0.0;
        }
        // A spindle that reverses may stop at once. Until its next pulse comes, it is assumed to be not far beyond the
        // place of that pulse.
        let most = rate * QUEUED + 1.7;
        if gone > most && self.turns_unevenly() {
            (gone, speed) = (most, 0.0);
        }
        let mut way = self.ahead + self.pitch() * gone;
        if self.stage == Stage::Known {
            // The axes need the distance of their ramp. They catch up with a line that is up to 4 ms too far.
            let late = way + speed * speed / (2.0 * SHARE * accel) - 0.004 * speed;
            if late > 0.0 {
                let back = self.lead * (whole(late / self.lead) + 1) as f32;
                way -= back;
                self.ahead -= back;
            }
        }
        let size = size(way);
        self.hold_against_limit(size, brakes);
        let change = least(GAIN * size, sqrt(2.0 * SHARE * accel * size));
        let wanted = if way.is_sign_negative() { speed - change } else { speed + change };
        if wanted < SLOWEST {
            return if some(velocity) { SLOWEST } else { 0.0 };
        }
        if self.stage == Stage::Known {
            self.stage = Stage::Follows;
        }
        wanted
    }

    /// Ends the pass if the error of `size` mm is above the limit.
    fn hold_against_limit(&mut self, size: f32, brakes: bool) {
        let Kind::Pass { limit, .. } = self.kind else { return };
        let limit = limit.get();
        if !some(limit) || brakes {
            return;
        }
        match (self.stage, size > limit) {
            (Stage::Follows, false) => self.stage = Stage::Met,
            (Stage::Met, true) => self.stage = Stage::Astray,
            _ => {}
        }
    }
}

#[cfg(test)]
mod faults;

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const ACCEL: f32 = 500.0;
    /// A stretch, counts and s.
    const STRETCH: u32 = COUNTS_PER_S / 500;
    /// How far the queued segments are ahead of the present, counts.
    const AHEAD: u32 = 2_000;

    /// Simulates a spindle at a steady speed, and axes that follow the commanded velocity within their acceleration
    /// limit.
    struct Pass {
        thread: Thread,
        per_turn: u16,
        /// Counts of a turn.
        turn: u32,
        /// Counts, that do not wrap.
        time: u64,
        velocity: f32,
        way: f64,
        /// The number of a sync pulse that does not come, and of one that comes twice.
        missing: Option<u64>,
        extra: Option<u64>,
        /// The time of a sync pulse too many.
        stray: Option<u64>,
        /// The number of an index pulse that does not come, and the time of one too many.
        no_index: Option<u64>,
        stray_index: Option<u64>,
        /// From this index on the spindle turns twice as fast.
        doubles: Option<u64>,
        /// From this time on there are no pulses.
        ends: u64,
        accel: f32,
    }

    impl Pass {
        fn new(per_turn: u16, turn: u32, begin: u64) -> Self {
            let thread = Thread::begin(&super::Pass { lead: 1.0, ..super::Pass::default() });
            let mut pass = Self {
                thread,
                per_turn,
                turn,
                time: begin,
                velocity: 0.0,
                way: 0.0,
                missing: None,
                extra: None,
                stray: None,
                no_index: None,
                stray_index: None,
                doubles: None,
                ends: u64::MAX,
                accel: ACCEL,
            };
            pass.thread.anchor(begin as u32, AHEAD * CYCLES);
            pass
        }

        /// What the sensors have seen by now. At time 0 the spindle was at an index.
        fn pulses(&self) -> Pulses {
            let (turn, n) = (u64::from(self.turn), u64::from(self.per_turn));
            let time = self.time.min(self.ends);
            if let Some(from) = self.doubles.filter(|from| time > *from) {
                return self.doubled(from, time);
            }
            let turns = time / turn;
            // The first pulse of sync is half of a pulse interval after the index.
            let half = turn / n / 2;
            let sync_by = |time: u64| (time + half) * n / turn;
            let has_come = |stray: Option<u64>, time| stray.is_some_and(|at| time >= at);
            let told = |time: u64| {
                let count = sync_by(time);
                let missing = self.missing.is_some_and(|at| count >= at);
                let extra = self.extra.is_some_and(|at| count >= at);
                let more = u64::from(extra) + u64::from(has_come(self.stray, time));
                (count + more - u64::from(missing)) as u16
            };
            let mut sync = sync_by(time);
            if self.missing == Some(sync) {
                // The last pulse that has come is the one before the missing one.
                sync -= 1;
            }
            let mut sync_at = (sync * turn).div_ceil(n).saturating_sub(half);
            if let Some(stray) = self.stray.filter(|at| time >= *at) {
                sync_at = sync_at.max(stray);
            }
            let mut index = turns;
            let lost = self.no_index.is_some_and(|at| turns >= at);
            if self.no_index == Some(turns) {
                index -= 1;
            }
            let mut index_at = index * turn;
            if let Some(stray) = self.stray_index.filter(|at| time >= *at) {
                index_at = index_at.max(stray);
            }
            let more = u64::from(has_come(self.stray_index, time));
            Pulses {
                now: self.time as u16,
                index: (turns + more - u64::from(lost)) as u16,
                index_at: index_at as u16,
                at_index: told(index_at),
                sync: told(time),
                sync_at: sync_at as u16,
            }
        }

        /// What the sensors have seen at `time`, if the spindle turns twice as fast since an index at `from`.
        fn doubled(&self, from: u64, time: u64) -> Pulses {
            let (turn, n) = (u64::from(self.turn) / 2, u64::from(self.per_turn));
            let (turns, since) = (from / turn / 2, time - from);
            let half = turn / n / 2;
            let count = (since + half) * n / turn;
            Pulses {
                now: self.time as u16,
                index: (turns + since / turn) as u16,
                index_at: (from + since / turn * turn) as u16,
                at_index: (turns * n + since / turn * n) as u16,
                sync: (turns * n + count) as u16,
                sync_at: (from + (count * turn).div_ceil(n)).saturating_sub(half) as u16,
            }
        }

        fn note(&mut self, pulses: &Pulses) {
            let encoder = Encoder::at(self.time as u32, self.per_turn, self.turn);
            self.thread.note(pulses, &encoder);
        }

        fn stretch(&mut self) {
            let pulses = self.pulses();
            self.note(&pulses);
            let seconds = STRETCH as f32 / COUNTS_PER_S as f32;
            let wanted = self.thread.velocity(0, self.velocity, self.accel, false);
            let gain = self.accel * seconds;
            let next = wanted.clamp(self.velocity - gain, self.velocity + gain);
            let distance = 0.5 * (self.velocity + next) * seconds;
            self.velocity = next;
            self.thread.handed(distance);
            self.thread.queued(STRETCH * CYCLES, false);
            self.way += f64::from(distance);
            self.time += u64::from(STRETCH);
        }

        /// The position of the axes relative to the line at the end of the queued segments, in turns.
        fn phase(&self) -> f64 {
            let angle = (self.time + u64::from(AHEAD)) as f64 / f64::from(self.turn);
            let phase = self.way - angle;
            phase - phase.round()
        }

        fn run(&mut self, stretches: usize) -> Vec<f64> {
            (0..stretches)
                .map(|_| {
                    self.stretch();
                    self.phase()
                })
                .collect()
        }
    }

    fn spread(phases: &[f64]) -> f64 {
        let first = phases[0];
        let off = phases.iter().map(|phase| (phase - first) - (phase - first).round());
        let (low, high) =
            off.fold((0.0f64, 0.0f64), |(low, high), off| (low.min(off), high.max(off)));
        high - low
    }

    #[test]
    fn the_phase_does_not_depend_on_the_speed_nor_on_when_it_begins() {
        for per_turn in [1u16, 4, 100, 400] {
            let mut all = Vec::new();
            for turn in [200_000u32, 50_000, 25_000, 15_000] {
                for begin in [0, 12_345, (1 << 32) - 100_000] {
                    let mut pass = Pass::new(per_turn, turn, begin);
                    pass.run((3 * turn / STRETCH) as usize);
                    let phases = pass.run((8 * turn / STRETCH) as usize);
                    assert!(spread(&phases) < 0.002, "{per_turn} {turn}: {}", spread(&phases));
                    assert!((pass.velocity - COUNTS_PER_S as f32 / turn as f32).abs() < 0.1);
                    all.push(phases[0]);
                }
            }
            assert!(spread(&all) < 0.002, "{per_turn}: {all:.4?}");
        }
    }

    /// Runs a pass of 300 turns a minute with a fault in its midst. Returns how far the axes are off the line at most,
    /// in turns, and how far in the end.
    fn off(per_turn: u16, fault: impl FnOnce(&mut Pass, u64)) -> (f64, f64) {
        let mut pass = Pass::new(per_turn, 50_000, 0);
        pass.run(300);
        let before = pass.phase();
        // The next index.
        let next = pass.time.div_ceil(50_000);
        fault(&mut pass, next);
        let off = |phase: &f64| (phase - before) - (phase - before).round();
        let all: Vec<f64> = pass.run(900).iter().map(off).collect();
        assert!(pass.thread.fault().is_none(), "{per_turn}");
        let most = all.iter().fold(0.0f64, |most, off| most.max(off.abs()));
        (most, all[all.len() - 1].abs())
    }

    #[test]
    fn an_index_that_is_missing_or_too_many_shifts_nothing() {
        for per_turn in [2u16, 4, 8, 100, 400] {
            let (most, end) = off(per_turn, |pass, next| pass.no_index = Some(next));
            assert!(most < 0.002 && end < 0.002, "{per_turn}: {most}");
            for part in [3, 20, 33, 45] {
                let (most, end) = off(per_turn, |pass, next| {
                    pass.stray_index = Some(next * 50_000 + part * 1_000);
                });
                assert!(most < 0.002 && end < 0.002, "{per_turn}, {part}: {most}");
            }
        }
    }

    #[test]
    fn a_stray_pulse_shifts_little_and_not_for_long() {
        for per_turn in [2u16, 4, 8, 20, 100] {
            let interval = 50_000 / u64::from(per_turn);
            for tenth in 1..10 {
                let (most, end) = off(per_turn, |pass, next| {
                    pass.stray = Some(next * 50_000 + interval * (2 * tenth + 10) / 20);
                });
                let bound = (0.65 / f64::from(per_turn)).max(0.02);
                assert!(most < bound && end < 0.002, "{per_turn}, {tenth}: {most}, {end}");
            }
        }
    }

    /// The spindle gains or loses this share of its speed in each turn.
    #[test]
    fn each_pulse_counts_once_while_the_speed_changes_by_a_fifth_in_a_turn() {
        for share in [0.8f64, 0.9, 1.1, 1.2] {
            for per_turn in [1u16, 2, 4, 8, 20] {
                let mut pass = Pass::new(per_turn, 50_000, 0);
                pass.run(300);
                let (before, mut at) = (pass.thread.ahead, pass.thread.at);
                let mut interval = 50_000.0 / f64::from(per_turn);
                let (first, pulses) = (interval, 4 * per_turn);
                for n in 0..pulses {
                    interval = first / share.powf(f64::from(n) / f64::from(per_turn));
                    at += interval as u32;
                    pass.thread.take(1, at);
                    if (n + 1) % per_turn == 0 && per_turn > 1 {
                        // The index.
                        pass.thread.doubt = 0;
                    }
                }
                let counted = (pass.thread.ahead - before) * f32::from(per_turn);
                let off = counted - f32::from(pulses);
                let fault = pass.thread.fault();
                assert!(off.abs() < 0.01 && fault.is_none(), "{per_turn}, {share}: {counted}");
            }
        }
    }

    /// Pulses of twice the speed are no spindle, which has inertia.
    #[test]
    fn a_thread_whose_pulses_double_ends() {
        for per_turn in [1u16, 2, 4, 8] {
            let mut pass = Pass::new(per_turn, 50_000, 0);
            pass.run(300);
            // At an index.
            let turns = pass.time.div_ceil(50_000);
            while pass.time < turns * 50_000 {
                pass.stretch();
            }
            // From here on there are two turns where there was one.
            pass.doubles = Some(turns * 50_000);
            let (way, mut off) = (pass.way, 0.0f64);
            while pass.thread.fault().is_none() {
                let before = pass.time;
                pass.stretch();
                let gone = (before - turns * 50_000) as f64 / 50_000.0;
                assert!(gone < 3.0, "{per_turn}: it goes on");
                off = off.max((pass.way - way - gone).abs());
            }
            assert!(off < 0.3, "{per_turn}: {off} turns off");
        }
    }

    #[test]
    fn a_spindle_that_stops_before_its_index_is_lost() {
        for per_turn in [1u16, 4, 100] {
            for ends in [50_100, 60_000, 99_000, 100_050] {
                let mut pass = Pass::new(per_turn, 50_000, 50_050);
                pass.ends = ends;
                // Four turns.
                pass.run(4 * 50_000 / STRETCH as usize);
                assert_eq!(pass.thread.fault(), Some(Status::SpindleLost), "{per_turn}, {ends}");
            }
        }
    }

    /// The ramp takes more than the way of a turn.
    #[test]
    fn axes_with_a_long_ramp_meet_the_line_at_its_speed() {
        for (turn, accel) in [(15_000u32, 100.0), (10_000, 60.0), (50_000, 10.0)] {
            let mut pass = Pass::new(4, turn, 12_345);
            pass.accel = accel;
            let speed = COUNTS_PER_S as f32 / turn as f32;
            let mut fastest = 0.0f32;
            for _ in 0..4_000 {
                pass.stretch();
                fastest = fastest.max(pass.velocity);
            }
            assert!(fastest < 1.02 * speed, "{turn}, {accel}: {fastest}, not {speed}");
            // The first pulse of sync is half of a pulse interval after the index.
            let off = pass.phase() + 0.5 / 4.0;
            assert!(off.abs() < 0.002, "{turn}, {accel}: {off}");
        }
    }

    #[test]
    fn a_pulse_that_is_missing_or_too_many_shifts_nothing() {
        for per_turn in [4u16, 8, 100] {
            for (missing, extra) in [(Some(9), None), (None, Some(9)), (Some(8), None)] {
                let mut pass = Pass::new(per_turn, 50_000, 0);
                pass.run(300);
                let before = pass.phase();
                // As if the fault had happened right now.
                let base = pass.time * u64::from(per_turn) / 50_000;
                pass.missing = missing.map(|n| base + n - 7);
                pass.extra = extra.map(|n| base + n - 7);
                pass.run(600);
                let off = pass.phase() - before;
                assert!(
                    (off - off.round()).abs() < 0.002,
                    "{per_turn} {missing:?} {extra:?}: {off}"
                );
                assert!(pass.thread.fault().is_none());
            }
        }
    }

    /// Whether a spindle is lost while it reverses, or its way back does not match its pulses. The spindle has 300
    /// turns a minute. It is commanded to reverse at the fraction `phase` of a pulse interval after a mark, and does so
    /// within a second.
    fn loses_what_turns_round(per_turn: u16, tells: bool, phase: f64) -> bool {
        let per_second = f64::from(COUNTS_PER_S);
        let rate = 5.0 * f64::from(per_turn);
        // The spindle is commanded at this time, s, and slows down by twice its speed in a second.
        let told = (4.0 + phase) / rate;
        // The place of the spindle, in pulses.
        let place = |at: u64| {
            let (seconds, late) = (at as f64 / per_second, at as f64 / per_second - told);
            rate * seconds - if late > 0.0 { rate * late * late } else { 0.0 }
        };
        let interval = (per_second / rate) as f32;
        let mut thread = Thread {
            stage: Stage::Follows,
            per_turn,
            lead: 1.0,
            interval,
            kind: Kind::Tap { turn_at: 0.0, decel: 0.0, window: interval as u16 },
            ..Thread::new()
        };
        thread.anchor(0, AHEAD * CYCLES);
        let (mut time, mut count, mut sync_at, mut last) = (0u64, 0u16, 0u64, 0.0);
        let (mut told_so, mut mirrored) = (false, false);
        let end = ((told + 1.0) * per_second) as u64;
        while time < end {
            if time as f64 > told * per_second && !told_so {
                (thread.stage, told_so) = (Stage::Turning, true);
            }
            for at in time + 1..=time + u64::from(STRETCH) {
                let mark = place(at).floor();
                if mark != last {
                    let one = if tells && mark < last { u16::MAX } else { 1 };
                    (count, sync_at, last) = (count.wrapping_add(one), at, mark);
                }
            }
            time += u64::from(STRETCH);
            let sync = if mirrored { count.wrapping_neg() } else { count };
            let pulses = Pulses { now: time as u16, sync, sync_at: sync_at as u16, ..Pulses::NONE };
            let encoder = Encoder::at(time as u32, per_turn, COUNTS_PER_S / 5).that_tells(tells);
            if thread.note(&pulses, &encoder) && tells {
                thread.mirror();
                mirrored = true;
            }
            thread.velocity(0, 0.0, ACCEL, false);
            thread.queued(STRETCH * CYCLES, false);
            if thread.drop_rest() {
                thread.turn_back();
            }
        }
        let way = -thread.ahead * f32::from(per_turn);
        // Measured from beyond the mark over which it has come back.
        let off = way - (last + 1.0) as f32;
        thread.fault().is_some() || off.abs() > if tells { 0.01 } else { 1.01 }
    }

    #[test]
    fn a_spindle_that_turns_round_is_not_lost_wherever_it_does() {
        for (per_turn, tells) in
            [(4, false), (20, false), (100, false), (4, true), (20, true), (100, true)]
        {
            let lost: Vec<u32> = (0..100)
                .filter(|n| loses_what_turns_round(per_turn, tells, f64::from(*n) * 0.01))
                .collect();
            assert!(
                lost.is_empty(),
                "{per_turn} pulses a turn, {tells}: {lost:?} hundredths behind a mark"
            );
        }
    }

    #[test]
    fn a_spindle_without_pulses_is_lost_behind_the_second() {
        let mut pass = Pass::new(4, 50_000, 0);
        pass.run(400);
        let (pulses, from) = (pass.pulses(), pass.time);
        while pass.thread.fault().is_none() {
            pass.time += u64::from(STRETCH);
            let now = Pulses { now: pass.time as u16, ..pulses };
            pass.note(&now);
        }
        let took = pass.time - from;
        assert!((12_500..2 * 12_500 + 3 * u64::from(STRETCH)).contains(&took), "{took}");
    }
}
