//! The encoder of the spindle: from pulses to turns a minute, and whether they fit one another.
//!
//! Two sensors: the *index* gives a pulse a turn, *sync* so many (`spn`). With `spn` 1 the index alone is read. The hardware counts pulses
//! and takes their time ([`Pulses`], `hal::encoder`); [`Encoder::sample`] makes of that what is known of the spindle. It is asked each 20 ms by
//! the power task (`tasks::power`), under the ceiling lock. Nothing waits, and nothing can be full: between two samples any number of pulses may
//! have come, of which the newest counts.
//!
//! **Fit.** At each index so many pulses of sync must have come as a turn has: one that is missing, or one more, is a *misfit*, and so
//! is one of an index. With the index alone a pulse in less than 0.6 of the turn before is one; one that is
//! missing looks like a slower spindle. Misfits are counted (`spx`), and the first is told (exception 40).
//!
//! **Direction.** A second sensor of sync, if there is one and `spdi` says so, has pulses count down when the spindle turns backwards. One that turns round
//! outside of G33.1 is measured anew. A pass is told pulses that count up, whichever way it goes ([`Encoder::of_pass`]).
//!
//! **Stop.** No pulse for half a second, or for twice as long as between the last two if that is more, is a spindle that
//! stands still: its speed is 0, and nothing is known of it any more.
//!
//! Units: counts of 4 us ([`COUNTS_PER_S`]), in 32 bits that wrap after 4.7 hours; differences are right across the wrap. Cost of a sample:
//! 300 cycles without a pulse, 1,000 with one. The speed is that of the last turn: as exact as the time of two pulses, each of which may be taken late by
//! what a step interrupt lasts, 17 us.

use kerf_macros::small;

use crate::status::Status;

/// Counts of time in a second.
pub const COUNTS_PER_S: u32 = 250_000;

/// Half a second.
const STILL: u32 = COUNTS_PER_S / 2;

/// Pulses do not come quite evenly: half a millisecond.
const SLACK: u32 = COUNTS_PER_S / 2_000;

/// A turn that takes longer is none: three seconds.
const SLOWEST: u32 = 3 * COUNTS_PER_S;

/// What the sensors have seen. Times and counts modulo 2^16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulses {
    /// The time now.
    pub now: u16,
    /// Pulses of the index, and the time of the last one.
    pub index: u16,
    /// See `index`.
    pub index_at: u16,
    /// Pulses of sync when that came.
    pub at_index: u16,
    /// Pulses of sync, less those of the way back if the direction is told; and the time of the last one.
    pub sync: u16,
    /// See `sync`.
    pub sync_at: u16,
}

impl Pulses {
    /// None so far.
    pub const NONE: Self = Self { now: 0, index: 0, index_at: 0, at_index: 0, sync: 0, sync_at: 0 };
}

/// What is known of the spindle.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    /// Pulses of sync in a turn; 0 for no encoder.
    per_turn: u16,
    /// The time of the last sample.
    time: u32,
    /// The pulses by then.
    index: u16,
    sync: u16,
    /// Those of sync at the last index.
    at_index: u16,
    /// When the last index came.
    index_at: u32,
    /// When the last pulse of sync came.
    sync_at: u32,
    /// How long the last turn took; 0 if it is not known.
    turn: u32,
    /// Index pulses in a row, up to [`SURE`], and the bits below.
    seen: u8,
    /// Misfits, up to 255.
    misfits: u8,
    /// The first has been told.
    told: bool,
    /// How far the axes are ahead of the spindle in a pass, um, at the last index.
    error: i16,
    /// How the pass stands in step with the spindle ([`thread`](crate::motion::thread)): [`Status::Again`] for none that has begun,
    /// [`Status::Ok`] while it goes on, else why it did not begin, or has ended. The planner and exec write it.
    pub pass: Status,
}

/// Of [`Encoder::seen`]: nobody has been told of [`Encoder::error`] yet.
const NEWS: u8 = 0x80;

/// Of [`Encoder::seen`]: it turns round, so that the pulses of sync before the next index do not tell.
const ROUND: u8 = 0x40;

/// Of [`Encoder::seen`]: it turns backwards.
const BACK: u8 = 0x20;

/// Of [`Encoder::seen`]: pulses of the pass count down.
const MIRRORS: u8 = 0x10;

/// Of [`Encoder::seen`]: pulses tell the direction.
const TELLS: u8 = 0x08;

/// Of [`Encoder::seen`]: the index pulses.
const COUNT: u8 = 0x07;

/// After so many index pulses in a row the time of a turn tells of its neighbours.
const SURE: u8 = 4;

#[small]
impl Encoder {
    /// None is set up.
    pub const fn new() -> Self {
        Self {
            per_turn: 0,
            time: 0,
            index: 0,
            sync: 0,
            at_index: 0,
            index_at: 0,
            sync_at: 0,
            turn: 0,
            seen: 0,
            misfits: 0,
            told: false,
            error: 0,
            pass: Status::Again,
        }
    }

    /// One that knows a spindle at a steady speed.
    #[cfg(test)]
    pub fn at(time: u32, per_turn: u16, turn: u32) -> Self {
        Self { per_turn, time, turn, ..Self::new() }
    }

    /// It, with pulses that tell the direction.
    #[cfg(test)]
    pub fn that_tells(self, tells: bool) -> Self {
        Self { seen: if tells { self.seen | TELLS } else { self.seen }, ..self }
    }

    /// Pulses of sync in a turn; 0 for no encoder.
    pub fn per_turn(&self) -> u16 {
        self.per_turn
    }

    /// An encoder with so many pulses of sync in a turn is set up, 0 for none, whose pulses may tell the direction. What was known is forgotten.
    pub fn set_up(&mut self, per_turn: u16, tells: bool, pulses: &Pulses) {
        let seen = if tells { TELLS } else { 0 };
        *self = Self { per_turn, seen, index: pulses.index, sync: pulses.sync, ..Self::new() };
        self.time = pulses.now.into();
    }

    /// The time of the last sample.
    pub fn time(&self) -> u32 {
        self.time
    }

    /// The time when the clock of the pulses said `now`, since the last sample.
    pub fn time_at(&self, now: u16) -> u32 {
        self.time.wrapping_add(now.wrapping_sub(self.time as u16).into())
    }

    /// How long the last turn took; 0 if it is not known.
    pub fn turn(&self) -> u32 {
        self.turn
    }

    /// Index pulses in a row, up to a few; and whether sync has given any, which the index alone does not need.
    pub fn seen(&self) -> (u8, bool) {
        let synced =
            self.per_turn == 1 || self.time.wrapping_sub(self.sync_at) < STILL.max(self.turn);
        let seen = self.seen & COUNT;
        (seen, seen > 0 && synced)
    }

    /// The spindle is about to turn round, or does (G33.1). Exec.
    pub fn note_turning(&mut self) {
        self.seen |= ROUND;
    }

    /// Whether pulses tell the direction.
    pub fn tells(&self) -> bool {
        self.seen & TELLS != 0
    }

    /// Whether it turns backwards, as far as that is told.
    pub fn turns_back(&self) -> bool {
        self.seen & BACK != 0
    }

    /// A pass begins, of a spindle that is told to turn backwards or not; `None` if nobody knows. False if it turns the other way.
    pub fn begin(&mut self, backwards: Option<bool>) -> bool {
        let turns_back = self.turns_back();
        self.seen = self.seen & !MIRRORS | if turns_back { MIRRORS } else { 0 };
        !self.tells() || backwards.is_none_or(|backwards| backwards == turns_back)
    }

    /// The way back of G33.1 begins: pulses of the pass count the other way. Exec.
    pub fn turn_pass(&mut self) {
        if self.tells() {
            self.seen ^= MIRRORS;
        }
    }

    /// The pulses as the pass sees them: they count up on the way that it has begun with.
    pub fn of_pass(&self, pulses: Pulses) -> Pulses {
        if self.seen & MIRRORS == 0 {
            return pulses;
        }
        let (sync, at_index) = (pulses.sync.wrapping_neg(), pulses.at_index.wrapping_neg());
        Pulses { sync, at_index, ..pulses }
    }

    /// Misfits so far, 255 for more.
    pub fn misfits(&self) -> u8 {
        self.misfits
    }

    /// Whether there has been a misfit that nobody has been told of: the first alone.
    pub fn take_misfit(&mut self) -> bool {
        let is_new = self.misfits != 0 && !self.told;
        self.told |= is_new;
        is_new
    }

    /// In a pass the axes were so far ahead of the spindle at an index, mm. Exec.
    pub fn note_error(&mut self, mm: f32) {
        self.error = (mm * 1e3) as i16;
        self.seen |= NEWS;
    }

    /// How far the axes are ahead of the spindle, um, at the last index of the pass; 0 without one.
    pub fn error(&self) -> i16 {
        if self.pass == Status::Ok { self.error } else { 0 }
    }

    /// Whether there has been another index in a pass since this was asked last.
    pub fn take_news(&mut self) -> bool {
        let is_new = self.seen & NEWS != 0;
        self.seen &= !NEWS;
        is_new
    }

    /// Takes up what the sensors have seen since the last sample. Whether pulses did not fit.
    #[inline(never)]
    pub fn sample(&mut self, pulses: &Pulses) -> bool {
        self.time = self.time_at(pulses.now);
        if pulses.sync != self.sync {
            if self.tells() {
                self.take_direction(pulses.sync.wrapping_sub(self.sync) as i16);
            }
            self.sync = pulses.sync;
            self.sync_at = self.time_of(pulses, pulses.sync_at);
        }
        let misfit = pulses.index != self.index && self.take_index(pulses);
        if misfit {
            self.misfits = self.misfits.saturating_add(1);
        }
        if self.is_still() {
            (self.seen, self.turn) = (self.seen & !COUNT, 0);
        }
        misfit
    }

    /// So many pulses have come, or were taken back.
    fn take_direction(&mut self, change: i16) {
        let turns_back = if change < 0 { BACK } else { 0 };
        if self.seen & BACK != turns_back {
            self.seen ^= BACK;
            if self.seen & ROUND == 0 {
                (self.seen, self.turn) = (self.seen & !COUNT, 0);
            }
        }
    }

    /// A time before the last sample.
    fn time_of(&self, pulses: &Pulses, at: u16) -> u32 {
        self.time.wrapping_sub(pulses.now.wrapping_sub(at).into())
    }

    /// An index has come, or several. Whether it does not fit.
    #[inline(never)]
    fn take_index(&mut self, pulses: &Pulses) -> bool {
        let turns = pulses.index.wrapping_sub(self.index);
        let at = self.time_of(pulses, pulses.index_at);
        let took = at.wrapping_sub(self.index_at) / u32::from(turns);
        let synced = pulses.at_index.wrapping_sub(self.at_index);
        let synced = if self.turns_back() { synced.wrapping_neg() } else { synced };
        self.index = pulses.index;
        self.at_index = pulses.at_index;
        self.index_at = at;
        let (before, turn) = (self.seen & COUNT, self.turn);
        let turns_round = self.seen & ROUND != 0;
        let seen = u8::try_from(turns).map_or(SURE, |turns| before.saturating_add(turns));
        self.seen = self.seen & !(COUNT | ROUND) | seen.min(SURE);
        if before == 0 || turns_round {
            return false;
        }
        self.turn = took;
        match self.per_turn {
            1 => before == SURE && took < turn / 8 * 5 - turn / 40,
            n => synced != n.wrapping_mul(turns),
        }
    }

    /// Whether the spindle stands still.
    pub fn is_still(&self) -> bool {
        if self.per_turn == 0 || self.seen & COUNT == 0 {
            return true;
        }
        let (age, two) = self.age();
        age > STILL.max(two)
    }

    /// How long ago the last pulse was, and how long two take.
    fn age(&self) -> (u32, u32) {
        // The second index tells how long a turn is.
        let turn = if self.turn == 0 { SLOWEST } else { self.turn };
        let indexed = self.time.wrapping_sub(self.index_at);
        let synced = self.time.wrapping_sub(self.sync_at);
        let age = if self.per_turn == 1 { indexed } else { indexed.min(synced) };
        (age, 2 * turn / u32::from(self.per_turn))
    }

    /// How fast feeds may take it to turn, thousandths of a turn a minute: 0 as soon as no pulse has come for longer than two of them take.
    pub fn feeds(&self) -> u32 {
        if self.turn == 0 {
            return 0;
        }
        let (age, two) = self.age();
        if age > two + two / 64 + SLACK { 0 } else { self.speed() }
    }

    /// How fast it turns, thousandths of a turn a minute; 0 if it stands still. Cost: 900.
    pub fn speed(&self) -> u32 {
        if self.turn == 0 {
            return 0;
        }
        (COUNTS_PER_S as f32 * 60_000.0 / self.turn as f32 + 0.5) as u32
    }
}

impl Default for Encoder {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spindle that is looked at each 20 ms. Times in counts.
    struct Spindle {
        encoder: Encoder,
        pulses: Pulses,
        now: u64,
        looked: u64,
        misfits: u32,
    }

    const LOOK: u64 = 5_000;

    impl Spindle {
        fn new(per_turn: u16, now: u64) -> Self {
            let (mut encoder, pulses) =
                (Encoder::new(), Pulses { now: now as u16, ..Pulses::NONE });
            encoder.set_up(per_turn, false, &pulses);
            Self { encoder, pulses, now, looked: now, misfits: 0 }
        }

        fn pass(&mut self, counts: u64) {
            let end = self.now + counts;
            while self.looked + LOOK <= end {
                self.looked += LOOK;
                self.pulses.now = self.looked as u16;
                self.misfits += u32::from(self.encoder.sample(&self.pulses));
            }
            self.now = end;
        }

        fn index(&mut self) {
            self.pulses.index = self.pulses.index.wrapping_add(1);
            (self.pulses.index_at, self.pulses.at_index) = (self.now as u16, self.pulses.sync);
        }

        fn sync(&mut self) {
            self.pulses.sync = self.pulses.sync.wrapping_add(1);
            self.pulses.sync_at = self.now as u16;
        }

        /// A turn with so many pulses of sync.
        fn turn(&mut self, pulses: u16, counts: u64) {
            self.index();
            for _ in 0..pulses {
                self.pass(counts / u64::from(pulses) / 2);
                self.sync();
                self.pass(counts / u64::from(pulses) / 2);
            }
            if pulses == 0 {
                self.pass(counts);
            }
        }
    }

    #[test]
    fn the_speed_is_that_of_the_last_turn_across_wraps() {
        for begin in [0, 65_000, u64::from(u32::MAX) - 700_000] {
            for counts in [5_000u64, 15_000, 250_000, 700_000] {
                for per_turn in [1u16, 4, 100] {
                    let mut spindle = Spindle::new(per_turn, begin);
                    let pulses = if per_turn == 1 { 0 } else { per_turn };
                    let counts = counts / 200 * 200;
                    (0..6).for_each(|_| spindle.turn(pulses, counts));
                    let speed = 15e9 / counts as f64;
                    let told = f64::from(spindle.encoder.speed());
                    assert!(
                        (told / speed - 1.0).abs() < 1e-4,
                        "{per_turn}, {counts}: {told} {speed}"
                    );
                    assert_eq!(spindle.misfits, 0, "{per_turn}, {counts}");
                }
            }
        }
    }

    #[test]
    fn a_spindle_that_stops_is_told_within_half_a_second() {
        let mut spindle = Spindle::new(4, 0);
        (0..5).for_each(|_| spindle.turn(4, 50_000));
        spindle.pass(u64::from(STILL) - 10_000);
        assert!(!spindle.encoder.is_still() && spindle.encoder.speed() > 0);
        spindle.pass(20_000);
        assert!(spindle.encoder.is_still());
        assert_eq!(spindle.encoder.speed(), 0);
        assert_eq!(spindle.misfits, 0);
    }

    #[test]
    fn feeds_end_when_two_pulses_are_missing() {
        for (per_turn, turn) in [(4u16, 50_000u64), (100, 50_000), (8, 250_000)] {
            let mut spindle = Spindle::new(per_turn, 0);
            (0..5).for_each(|_| spindle.turn(per_turn, turn));
            assert!(spindle.encoder.feeds() > 0);
            let two = 2 * turn / u64::from(per_turn);
            spindle.pass(two + two / 32 + 2 * LOOK);
            assert_eq!(spindle.encoder.feeds(), 0, "{per_turn}");
        }
    }

    #[test]
    fn pulses_that_do_not_fit_are_found_at_the_next_index() {
        let mut spindle = Spindle::new(8, 0);
        (0..5).for_each(|_| spindle.turn(8, 40_000));
        for pulses in [7, 9] {
            let before = spindle.misfits;
            spindle.turn(pulses, 40_000);
            spindle.turn(8, 40_000);
            spindle.turn(8, 40_000);
            assert_eq!(spindle.misfits, before + 1);
        }
        assert_eq!(spindle.encoder.misfits(), 2);
        // An index is missing.
        (0..8).for_each(|_| {
            spindle.pass(2_500);
            spindle.sync();
            spindle.pass(2_500);
        });
        spindle.turn(8, 40_000);
        spindle.turn(8, 40_000);
        assert_eq!(spindle.encoder.misfits(), 3);
    }

    #[test]
    fn pulses_fit_where_the_spindle_turns_round() {
        let mut spindle = Spindle::new(8, 0);
        (0..5).for_each(|_| spindle.turn(8, 40_000));
        spindle.index();
        // Half a turn there, and back over the mark of the index.
        (0..7).for_each(|_| {
            spindle.encoder.note_turning();
            spindle.pass(2_500);
            spindle.sync();
            spindle.pass(2_500);
        });
        (0..3).for_each(|_| spindle.turn(8, 40_000));
        assert_eq!(spindle.misfits, 0);
        spindle.turn(7, 40_000);
        (0..2).for_each(|_| spindle.turn(8, 40_000));
        assert_eq!(spindle.misfits, 1);
    }

    #[test]
    fn a_second_sensor_tells_the_direction() {
        let mut spindle = Spindle::new(8, 0);
        spindle.encoder.set_up(8, true, &Pulses::NONE);
        (0..5).for_each(|_| spindle.turn(8, 40_000));
        assert!(!spindle.encoder.turns_back() && spindle.encoder.speed() > 0);
        assert!(spindle.encoder.begin(Some(false)) && spindle.encoder.begin(None));
        assert!(!spindle.encoder.begin(Some(true)));
        // Backwards: the speed is measured anew, and no pulse counts as missing.
        for turn in 0..5 {
            spindle.index();
            for _ in 0..8 {
                spindle.pass(2_500);
                spindle.pulses.sync = spindle.pulses.sync.wrapping_sub(1);
                spindle.pulses.sync_at = spindle.now as u16;
                spindle.pass(2_500);
            }
            assert!(spindle.encoder.turns_back(), "{turn}");
        }
        assert!(spindle.encoder.begin(Some(true)) && spindle.encoder.speed() > 0);
        let seen = spindle.encoder.of_pass(spindle.pulses);
        assert_eq!(seen.sync, spindle.pulses.sync.wrapping_neg());
        assert_eq!(spindle.misfits, 0);
    }

    #[test]
    fn a_pulse_more_of_the_index_alone_is_found() {
        let mut spindle = Spindle::new(1, 0);
        (0..6).for_each(|_| spindle.turn(0, 50_000));
        assert_eq!(spindle.misfits, 0);
        spindle.index();
        spindle.pass(20_000);
        spindle.index();
        spindle.pass(30_000);
        spindle.index();
        spindle.pass(LOOK);
        assert_eq!(spindle.misfits, 1);
        // From rest turns become shorter, but not so much.
        let mut spindle = Spindle::new(1, 0);
        for turn in 1..20u32 {
            let taken = f64::from(turn).sqrt() - f64::from(turn - 1).sqrt();
            spindle.turn(0, (taken * 250_000.0) as u64);
        }
        assert_eq!(spindle.misfits, 0);
    }
}
