//! The encoder of the spindle: computes the speed from its pulses, and checks that the pulses are consistent.
//!
//! The spindle has two sensors. The *index* gives one pulse a turn, *sync* gives `spn` pulses a turn. With `spn` 1 only
//! the index is read. The hardware counts the pulses and takes their time ([`Pulses`], `hal::encoder`).
//! [`Encoder::sample`] evaluates the counts. The power task (`tasks::power`) calls it every 20 ms, under the ceiling
//! lock. There is no queue that could overflow: any number of pulses may arrive between two samples, and only the
//! newest of each sensor counts.
//!
//! **Misfits.** Between two index pulses exactly `spn` sync pulses have to arrive. A missing or an extra pulse, of sync
//! or of the index, is a *misfit*. With the index alone, a pulse less than 0.75 of the previous turn after the last one
//! is a misfit; a missing pulse cannot be told from a slower spindle. Misfits are counted (`spx`), and the first one is
//! reported (exception 40). After a misfit, and with the index alone after a turn of less than 0.75 or more than 4/3 of
//! the one before, index pulses are counted anew. A pass begins when enough of them fit ([`Encoder::is_sure`]).
//!
//! **Direction.** With a second sync sensor (setting `spdi`), the count of sync pulses goes down while the spindle
//! turns backwards. After a reversal outside of G33.1 the speed is measured anew. A threading pass gets pulses that
//! count up, whichever way the spindle turns ([`Encoder::of_pass`]).
//!
//! **Stop.** The spindle counts as standing still if no pulse has come for half a second, or for twice the time between
//! the last two pulses if that is longer. Its speed is then 0, and the last turn is forgotten.
//!
//! Units: counts of 4 us ([`COUNTS_PER_S`]), in 32 bits that wrap after 4.7 hours. Differences are right across the
//! wrap. Cost of a sample: 300 cycles without a pulse, 1,000 with one. The speed is that of the last turn. It is as
//! exact as the times of its two pulses, each of which may be taken late by the duration of a step interrupt, 17 us.

use kerf_macros::small;

use crate::status::Status;

/// Counts of time in a second: the unit of all times here.
pub const COUNTS_PER_S: u32 = 250_000;

/// Without a pulse for half a second the spindle stands still.
const STILL: u32 = COUNTS_PER_S / 2;

/// Tolerance for pulses that are not quite evenly spaced: half a millisecond.
const SLACK: u32 = COUNTS_PER_S / 2_000;

/// The time that is assumed for a turn until one has been measured: three seconds.
const SLOWEST: u32 = 3 * COUNTS_PER_S;

/// The pulses that the sensors have given. Times and counts are modulo 2^16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulses {
    /// The time now.
    pub now: u16,
    /// Count of index pulses.
    pub index: u16,
    /// The time of the last index pulse.
    pub index_at: u16,
    /// The count of sync pulses at the last index pulse.
    pub at_index: u16,
    /// Count of sync pulses. If the sensors tell the direction, it goes down while the spindle turns backwards.
    pub sync: u16,
    /// The time of the last sync pulse.
    pub sync_at: u16,
}

impl Pulses {
    /// No pulses yet, at time 0.
    pub const NONE: Self = Self { now: 0, index: 0, index_at: 0, at_index: 0, sync: 0, sync_at: 0 };
}

/// The speed and the direction of the spindle, computed from its pulses.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    /// Pulses of sync in a turn; 0 for no encoder.
    per_turn: u16,
    /// The time of the last sample.
    time: u32,
    /// The counts of index and sync pulses at the last sample.
    index: u16,
    sync: u16,
    /// The count of sync pulses at the last index.
    at_index: u16,
    /// The time of the last index pulse.
    index_at: u32,
    /// The time of the last sync pulse.
    sync_at: u32,
    /// How long the last turn took; 0 if it is not known.
    turn: u32,
    /// Index pulses in a row that fit, up to [`SURE`], in the bits of [`COUNT`]. The other bits are the flags below.
    seen: u8,
    /// The number of misfits, up to 255.
    misfits: u8,
    /// Whether the first misfit has been reported.
    told: bool,
    /// How far the axes are ahead of the spindle in a pass, um, at the last index.
    error: i16,
    /// The state of the pass in step with the spindle ([`thread`](crate::motion::thread)): [`Status::Again`] while none
    /// has begun, [`Status::Ok`] while one goes on, otherwise the reason why it did not begin or has ended. The planner
    /// and exec write it.
    pub pass: Status,
}

/// Flag of [`Encoder::seen`]: there is a new [`Encoder::error`], which has not been reported.
const NEWS: u8 = 0x80;

/// Flag of [`Encoder::seen`]: the spindle reverses, so that the number of sync pulses before the next index is not
/// checked.
const ROUND: u8 = 0x40;

/// Flag of [`Encoder::seen`]: the spindle turns backwards.
const BACK: u8 = 0x20;

/// Flag of [`Encoder::seen`]: sync pulses count down during the pass, and [`Encoder::of_pass`] negates them.
const MIRRORS: u8 = 0x10;

/// Flag of [`Encoder::seen`]: sync pulses tell the direction.
const TELLS: u8 = 0x08;

/// The bits of [`Encoder::seen`] that count index pulses.
const COUNT: u8 = 0x07;

/// After this many index pulses in a row that fit, the time of a turn is a prediction for the next turn.
const SURE: u8 = 4;

#[small]
impl Encoder {
    /// Returns the state without an encoder.
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

    /// Returns the state of a spindle at a steady speed, whose turns fit.
    #[cfg(test)]
    pub fn at(time: u32, per_turn: u16, turn: u32) -> Self {
        Self { per_turn, time, turn, seen: SURE, ..Self::new() }
    }

    /// Returns this state, with sync pulses that tell the direction if `tells`.
    #[cfg(test)]
    pub fn that_tells(self, tells: bool) -> Self {
        Self { seen: if tells { self.seen | TELLS } else { self.seen }, ..self }
    }

    /// Pulses of sync in a turn; 0 for no encoder.
    pub fn per_turn(&self) -> u16 {
        self.per_turn
    }

    /// Sets up an encoder with `per_turn` sync pulses in a turn, 0 for no encoder. `tells` says whether its pulses tell
    /// the direction. Everything that was known is forgotten.
    pub fn set_up(&mut self, per_turn: u16, tells: bool, pulses: &Pulses) {
        let seen = if tells { TELLS } else { 0 };
        *self = Self { per_turn, seen, index: pulses.index, sync: pulses.sync, ..Self::new() };
        self.time = pulses.now.into();
    }

    /// The time of the last sample.
    pub fn time(&self) -> u32 {
        self.time
    }

    /// Returns the 32-bit time at which the 16-bit clock of the pulses reads `now`, at or after the last sample.
    pub fn time_at(&self, now: u16) -> u32 {
        self.time.wrapping_add(now.wrapping_sub(self.time as u16).into())
    }

    /// How long the last turn took; 0 if it is not known.
    pub fn turn(&self) -> u32 {
        self.turn
    }

    /// Returns the number of index pulses in a row, up to a few, and whether sync pulses arrive as well. With the index
    /// alone no sync pulses are needed.
    pub fn seen(&self) -> (u8, bool) {
        let synced =
            self.per_turn == 1 || self.time.wrapping_sub(self.sync_at) < STILL.max(self.turn);
        let seen = self.seen & COUNT;
        (seen, seen > 0 && synced)
    }

    /// Whether the last turns fit, so that the next index pulse is one in its place: two turns with the right number of
    /// sync pulses, or three of about the same time with the index alone.
    pub fn is_sure(&self) -> bool {
        let turns = if self.per_turn == 1 { SURE - 1 } else { SURE - 2 };
        self.seen & COUNT > turns
    }

    /// Notes that the spindle is about to reverse, or does so (G33.1).
    pub fn note_turning(&mut self) {
        self.seen |= ROUND;
    }

    /// Whether sync pulses tell the direction.
    pub fn tells(&self) -> bool {
        self.seen & TELLS != 0
    }

    /// Whether the spindle turns backwards. Always false if the pulses do not tell the direction.
    pub fn turns_back(&self) -> bool {
        self.seen & BACK != 0
    }

    /// Begins a pass. `backwards` is the commanded direction of the spindle, `None` if it is not known. Returns false
    /// if the pulses tell the opposite direction.
    pub fn begin(&mut self, backwards: Option<bool>) -> bool {
        let turns_back = self.turns_back();
        self.seen = self.seen & !MIRRORS | if turns_back { MIRRORS } else { 0 };
        !self.tells() || backwards.is_none_or(|backwards| backwards == turns_back)
    }

    /// Begins the way back of G33.1, on which the sync pulses count the other way.
    pub fn turn_pass(&mut self) {
        if self.tells() {
            self.seen ^= MIRRORS;
        }
    }

    /// Returns the pulses for the pass. They count up in the direction in which the pass has begun.
    pub fn of_pass(&self, pulses: Pulses) -> Pulses {
        if self.seen & MIRRORS == 0 {
            return pulses;
        }
        let (sync, at_index) = (pulses.sync.wrapping_neg(), pulses.at_index.wrapping_neg());
        Pulses { sync, at_index, ..pulses }
    }

    /// Returns the number of misfits so far, at most 255.
    pub fn misfits(&self) -> u8 {
        self.misfits
    }

    /// Whether the first misfit has come and has not been reported. Marks it as reported.
    pub fn take_misfit(&mut self) -> bool {
        let is_new = self.misfits != 0 && !self.told;
        self.told |= is_new;
        is_new
    }

    /// Records how far the axes of a pass are ahead of the spindle at an index, mm.
    pub fn note_error(&mut self, mm: f32) {
        self.error = (mm * 1e3) as i16;
        self.seen |= NEWS;
    }

    /// Returns how far the axes were ahead of the spindle at the last index of the pass, um. 0 if no pass is under way.
    pub fn error(&self) -> i16 {
        if self.pass == Status::Ok { self.error } else { 0 }
    }

    /// Whether the error of a pass has been recorded at another index since the last call.
    pub fn take_news(&mut self) -> bool {
        let is_new = self.seen & NEWS != 0;
        self.seen &= !NEWS;
        is_new
    }

    /// Evaluates the pulses since the last sample. Returns whether there was a misfit.
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

    /// Takes the direction from the change in the count of sync pulses. After an unexpected reversal the speed is
    /// measured anew.
    fn take_direction(&mut self, change: i16) {
        let turns_back = if change < 0 { BACK } else { 0 };
        if self.seen & BACK != turns_back {
            self.seen ^= BACK;
            if self.seen & ROUND == 0 {
                (self.seen, self.turn) = (self.seen & !COUNT, 0);
            }
        }
    }

    /// Returns the 32-bit time of `at`, a 16-bit time before the last sample.
    fn time_of(&self, pulses: &Pulses, at: u16) -> u32 {
        self.time.wrapping_sub(pulses.now.wrapping_sub(at).into())
    }

    /// Evaluates one or more new index pulses. Returns whether they are a misfit.
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
        let is_first = before == 0 || turns_round;
        let fits = match self.per_turn {
            _ if is_first => true,
            1 => turn == 0 || took >= turn / 4 * 3 && took / 4 <= turn / 3,
            n => synced == n.wrapping_mul(turns),
        };
        let seen = u8::try_from(turns).map_or(SURE, |turns| before.saturating_add(turns));
        let seen = if fits { seen.min(SURE) } else { 1 };
        self.seen = self.seen & !(COUNT | ROUND) | seen;
        if is_first {
            return false;
        }
        self.turn = took;
        let may_be_slower = self.per_turn == 1 && (before < SURE || took > turn);
        !(fits || may_be_slower)
    }

    /// Whether the spindle stands still.
    pub fn is_still(&self) -> bool {
        if self.per_turn == 0 || self.seen & COUNT == 0 {
            return true;
        }
        let (age, two) = self.age();
        age > STILL.max(two)
    }

    /// Returns the time since the last pulse, and twice the time between two pulses.
    fn age(&self) -> (u32, u32) {
        // The length of a turn is not known before the second index.
        let turn = if self.turn == 0 { SLOWEST } else { self.turn };
        let indexed = self.time.wrapping_sub(self.index_at);
        let synced = self.time.wrapping_sub(self.sync_at);
        let age = if self.per_turn == 1 { indexed } else { indexed.min(synced) };
        (age, 2 * turn / u32::from(self.per_turn))
    }

    /// Returns the speed that scales feeds per turn, thousandths of a turn a minute. It is 0 as soon as no pulse has
    /// come for longer than two pulses take.
    pub fn feeds(&self) -> u32 {
        if self.turn == 0 {
            return 0;
        }
        let (age, two) = self.age();
        if age > two + two / 64 + SLACK { 0 } else { self.speed() }
    }

    /// Returns the speed of the last turn, thousandths of a turn a minute. 0 if the spindle stands still. Cost: 900
    /// cycles.
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

    /// A spindle that is sampled every 20 ms. Times are in counts.
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

        /// Makes a turn with `pulses` sync pulses.
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
        // An index pulse is missing.
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
        // Half a turn forwards, then back over the mark of the index.
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
        // During a start from standstill turns become shorter, but not by as much as a misfit.
        let mut spindle = Spindle::new(1, 0);
        for turn in 1..20u32 {
            let taken = f64::from(turn).sqrt() - f64::from(turn - 1).sqrt();
            spindle.turn(0, (taken * 250_000.0) as u64);
        }
        assert_eq!(spindle.misfits, 0);
    }
}
