//! Ticks as entries for the state machine. An entry is a rest, a pulse and the pins for it, in two words of 32 bits.
//!
//! ```text
//! bit 0     0                         bit 0     1
//! bits 1..  cycles that pins rest     bit 1     tell that it has been reached
//! word 2    all pins in the pulse     word 2    all pins between pulses from now on: directions
//! ```
//!
//! Ticks without a step have no entry; they lengthen the rest before the next entry. Directions change after the last
//! pulse with the old directions, one tick before the first pulse with the new ones. Between the end of that pulse and
//! the change is [`HOLD`], in entries of its own: drivers read the direction some time after the edge of a step.
//!
//! The pins of an entry are pins of the chip, or outputs of a shift register, to which the state machine sends them bit
//! by bit ([`Program`]).
//!
//! Time is counted in cycles of the system clock. An entry lasts at least [`Writer::least`]. An entry that ought to be
//! shorter is extended to that, and the rests of the entries after it make up for the delay.

use crate::boards::{MOTORS, MotorPins, Pin, Registers};
use crate::dda::{Dda, Pins, SEGMENTS, STEP};

/// An entry: what the state machine takes at a time.
pub type Entry = [u32; 2];

/// Bit of the first word: the entry changes the levels of the pins between pulses.
pub const CHANGES: u32 = 1;
/// Bit of the first word, together with [`CHANGES`]: the state machine raises its interrupt at this entry.
pub const MARK: u32 = 2;
/// Position of the rest in the first word.
const REST: u32 = 1;

/// The cycles that a program takes.
#[derive(Clone, Copy)]
pub struct Program {
    /// The shortest pulse.
    pulse: i32,
    /// An entry besides its rest and its pulse.
    around: i32,
    /// An entry that changes pins.
    change: i32,
    /// From the end of a pulse to the change of pins by the next entry. 0 stands for some cycles.
    lead: i32,
}

impl Program {
    /// The program that sets pins of the chip.
    pub const DIRECT: Program = Program { pulse: 3, around: 7, change: 8, lead: 0 };
    /// The program that shifts eight bits out. Each bit takes 8 cycles; the latch follows 4 cycles behind the last edge of
    /// the clock, and is high for as long.
    pub const SHIFTED: Program = Program { pulse: 67, around: 74, change: 74, lead: 74 };

    /// Returns the number of entries that change nothing and last for `cycles`.
    const fn changes(self, cycles: i32) -> usize {
        (cycles as u32).div_ceil(self.change as u32) as usize
    }
}

/// Least cycles from the end of a pulse to a change of directions: a microsecond.
const HOLD: i32 = CYCLES_PER_US as i32;

/// The most entries that hold directions for as long.
const HOLDS: usize = Program::DIRECT.changes(HOLD);

/// Entries that a segment makes besides those of its ticks.
pub const OF_A_SEGMENT: usize = HOLDS + 1;
/// Entries that the end of a chunk, or of a motion, takes.
pub const OF_THE_END: usize = 2;

/// Cycles in a microsecond. [`CYCLES_PER_COUNT`] is the number in a count of [`TIMER_HZ`](crate::hal::TIMER_HZ).
pub const CYCLES_PER_US: u32 = 128;
/// See [`CYCLES_PER_US`].
pub const CYCLES_PER_COUNT: u32 = 2;

/// The shortest pulse, cycles, which the setting 0 us selects.
const SHORTEST: i32 = CYCLES_PER_US as i32 / 2;

/// Pairs of motors: the phases of a pair are added at once.
const PAIRS: usize = MOTORS.div_ceil(2);
/// The carry bits of both phases of a pair.
const CARRIES: u32 = (STEP as u32) << 16 | STEP as u32;

/// The pins of the motors, and the program that sets them.
pub struct Wiring {
    program: Program,
    /// Step pins of each set of motors.
    steps: [u32; 1 << MOTORS],
    /// The direction pin of each motor.
    dirs: [u32; MOTORS],
}

impl Wiring {
    /// Makes the wiring of these motors. Bits are numbers of pins, or the outputs of the shift register in the order in
    /// which they are sent: the last one first.
    pub const fn new(motors: &[MotorPins], registers: Option<Registers>) -> Self {
        let program = if registers.is_some() { Program::SHIFTED } else { Program::DIRECT };
        let mut wiring = Self { program, steps: [0; 1 << MOTORS], dirs: [0; MOTORS] };
        let mut m = 0;
        while m < MOTORS {
            wiring.dirs[m] = bit_of(motors[m].dir, registers);
            let mut set = 0;
            while set < 1 << MOTORS {
                if set >> m & 1 != 0 {
                    wiring.steps[set] |= bit_of(motors[m].step, registers);
                }
                set += 1;
            }
            m += 1;
        }
        wiring
    }

    /// Returns the step pins of the motors in `motors`.
    pub fn stepping(&self, motors: u8) -> u32 {
        self.steps[usize::from(motors) % (1 << MOTORS)]
    }

    /// Returns the direction pins of the motors in `backwards`.
    pub fn turned(&self, backwards: u8) -> u32 {
        let dirs = self.dirs.iter().enumerate();
        dirs.fold(0, |pins, (m, dir)| if backwards >> m & 1 != 0 { pins | dir } else { pins })
    }
}

/// Returns the bit of a pin in an entry.
const fn bit_of(pin: Pin, registers: Option<Registers>) -> u32 {
    match registers {
        Some(Registers { steps, .. }) => 1 << (steps.outputs - 1 - pin.bit),
        None => 1 << pin.bit,
    }
}

/// A list of entries, in memory of fixed size.
pub struct List<'a> {
    room: &'a mut [Entry],
    used: usize,
}

impl<'a> List<'a> {
    /// Makes an empty list.
    pub fn new(room: &'a mut [Entry]) -> Self {
        Self { room, used: 0 }
    }

    /// Returns the number of entries in it.
    pub fn len(&self) -> usize {
        self.used
    }

    /// Returns how many more entries it has room for.
    pub fn left(&self) -> usize {
        self.room.len() - self.used
    }

    /// Returns the places of the next `entries` entries, which count as used from now on.
    fn take(&mut self, entries: usize) -> &mut [Entry] {
        let from = self.used;
        self.used = self.room.len().min(from + entries);
        self.room.get_mut(from..self.used).unwrap_or_default()
    }

    /// Gives back the last `entries` places, which were not needed.
    fn give_back(&mut self, entries: usize) {
        self.used = self.used.saturating_sub(entries);
    }

    fn put(&mut self, entry: Entry) {
        if let Some(place) = self.room.get_mut(self.used) {
            *place = entry;
            self.used += 1;
        }
    }
}

/// The levels that the entries have set at the pins, and since when.
pub struct Writer {
    wiring: &'static Wiring,
    /// The pins between pulses.
    low: u32,
    /// The pins that are inverted.
    inverted: u32,
    /// Cycles from the last pulse to the tick that is being written, less what entries have taken since. Negative if
    /// they took more.
    age: i32,
    /// Cycles from a tick to the next.
    period: i32,
    /// Cycles of a pulse.
    pulse: i32,
}

impl Writer {
    /// All pins low.
    pub const fn new(wiring: &'static Wiring) -> Self {
        Self { wiring, low: 0, inverted: 0, age: 0, period: 0, pulse: 2 * CYCLES_PER_US as i32 }
    }

    /// Sets how long pulses last from now on, in microseconds; 0 means half of one.
    pub fn set_pulse(&mut self, us: u8) {
        let pulse = i32::from(us) * CYCLES_PER_US as i32;
        self.pulse = pulse.max(SHORTEST).max(self.wiring.program.pulse);
    }

    /// Sets the pins that are inverted from now on. The feeder, while nothing is sent.
    pub fn set_inverted(&mut self, pins: u32) {
        self.low ^= core::mem::replace(&mut self.inverted, pins) ^ pins;
    }

    /// Returns the number that the program counts down in a pulse.
    pub fn pulse_count(&self) -> u32 {
        (self.pulse - self.wiring.program.pulse) as u32
    }

    /// Begins a motion: the first tick comes after `cycles`.
    pub fn begin(&mut self, cycles: u32, to: &mut List) {
        self.age = cycles as i32;
        to.put([CHANGES, self.low]);
    }

    /// Forgets the time that has passed.
    pub fn rest(&mut self) {
        self.age = 0;
    }

    /// Returns the cycles of the shortest entry with a pulse.
    fn least(&self) -> i32 {
        self.pulse + self.wiring.program.around
    }

    /// Returns the cycles from a tick to the next.
    pub fn period(&self) -> i32 {
        self.period
    }

    /// Returns the levels of the pins between pulses, when all entries have been carried out.
    pub fn low(&self) -> u32 {
        self.low
    }

    /// Runs `ticks` ticks of those that the generator's segment has left. The list must have room for as many
    /// entries. Cost: 25 cycles a tick, 15 more with a step; in lockstep 15.
    pub fn run(&mut self, dda: &mut Dda, ticks: u16, to: &mut List) {
        if dda.increment.iter().all(|increment| *increment & !STEP == 0) {
            self.run_even(dda, ticks, to);
        } else {
            self.run_mixed(dda, ticks, to);
        }
        dda.ticks -= ticks;
    }

    /// Runs ticks on which each motor always steps, or never: phases do not change.
    fn run_even(&mut self, dda: &Dda, ticks: u16, to: &mut List) {
        let full = dda.increment.iter().enumerate();
        let full = full.fold(0, |set, (m, increment)| set | usize::from(*increment != 0) << m);
        if full == 0 {
            self.age = self.age.saturating_add(i32::from(ticks).saturating_mul(self.period));
            return;
        }
        let pins = self.wiring.steps[full] ^ self.low;
        let (period, least) = (self.period, self.least());
        let mut rest = self.age - least;
        for place in to.take(ticks.into()) {
            rest += period;
            *place = [head(rest), pins];
            rest = rest.min(0) - least;
        }
        self.age = rest + least;
    }

    // A function of its own, so that the compiler keeps the loop's variables in registers.
    #[inline(never)]
    fn run_mixed(&mut self, dda: &mut Dda, ticks: u16, to: &mut List) {
        let (mut phases, steps) = (pairs(&dda.phase), pairs(&dda.increment));
        let (period, least, sets) = (self.period, self.least(), &self.wiring.steps);
        let (mut rest, mut left, mut used) = (self.age - least, u32::from(ticks), 0);
        let places = to.take(ticks.into());
        for place in &mut *places {
            let mut due = 0;
            while due == 0 && left > 0 {
                left -= 1;
                rest += period;
                due = advance(&mut phases, &steps);
            }
            if due == 0 {
                break;
            }
            let set = (due | due >> (16 - PAIRS)) as usize & ((1 << MOTORS) - 1);
            *place = [head(rest), sets[set] ^ self.low];
            rest = rest.min(0) - least;
            used += 1;
        }
        let over = places.len() - used;
        to.give_back(over);
        self.age = rest + least;
        for (m, phase) in dda.phase.iter_mut().enumerate() {
            *phase = (phases[m % PAIRS] >> (m / PAIRS * 16)) as u16;
        }
    }

    /// Puts entries that last until a change can follow [`HOLD`] behind the last pulse: one without a pulse, or, if that
    /// would last longer, some that change nothing.
    fn hold(&mut self, to: &mut List) {
        let program = self.wiring.program;
        let wanted = HOLD - program.lead;
        let rest = wanted - self.least();
        if rest >= 0 {
            to.put([head(rest), self.low]);
            self.age -= wanted;
        } else {
            let changes = program.changes(wanted);
            (0..changes).for_each(|_| to.put([CHANGES, self.low]));
            self.age -= changes as i32 * program.change;
        }
    }

    /// Puts an entry without a pulse for the time that has passed. The next entry begins behind it.
    pub fn close(&mut self, to: &mut List) {
        if self.age > 0 {
            let rest = self.age - self.least();
            to.put([head(rest), self.low]);
            self.age = rest.min(0);
        }
    }

    /// Ends the motion, with a marked entry.
    pub fn end(&mut self, to: &mut List) {
        self.close(to);
        to.put([CHANGES | MARK, self.low]);
        self.age = 0;
    }
}

/// Returns the first word of an entry whose pulse rises after `rest`. If that time is over, the rest is the shortest.
#[inline(always)]
fn head(rest: i32) -> u32 {
    (rest.max(0) as u32) << REST
}

/// Runs one tick. Returns the motors that step, as bits: bit i for the first motor of pair i, bit 16 + i for the
/// second.
#[inline(always)]
fn advance(phases: &mut [u32; PAIRS], steps: &[u32; PAIRS]) -> u32 {
    let mut due = 0;
    for (i, (phase, step)) in phases.iter_mut().zip(steps).enumerate() {
        let sum = *phase + *step;
        let carries = sum & CARRIES;
        *phase = sum ^ carries;
        due |= carries >> (15 - i);
    }
    due
}

/// Returns the values of motors as pairs: motor i in the lower half, motor i + [`PAIRS`] in the upper half.
fn pairs(values: &[u16; MOTORS]) -> [u32; PAIRS] {
    let mut pairs = [0; PAIRS];
    for (m, value) in values.iter().enumerate() {
        pairs[m % PAIRS] |= u32::from(*value) << (m / PAIRS * 16);
    }
    pairs
}

/// Turns the outputs of the generator into entries.
pub struct Out<'a, 'b> {
    /// Keeps the state of the pins.
    pub writer: &'a mut Writer,
    /// Where entries go.
    pub to: &'a mut List<'b>,
}

impl Pins for Out<'_, '_> {
    fn rise(&mut self, _motors: u8) {}

    fn fall(&mut self, _motors: u8) {}

    fn direction(&mut self, backwards: u8) {
        self.writer.hold(self.to);
        self.writer.low = self.writer.wiring.turned(backwards) ^ self.writer.inverted;
        self.writer.age -= self.writer.wiring.program.change;
        self.to.put([CHANGES, self.writer.low]);
    }

    fn period(&mut self, counts: u16) {
        self.writer.period = i32::from(counts) * CYCLES_PER_COUNT as i32;
    }

    fn slot_free(&mut self) {}

    fn stop(&mut self) {}
}

/// Counts the steps of entries.
#[derive(Default)]
pub struct Count {
    /// Steps of each motor, backwards ones negative.
    pub steps: [i32; MOTORS],
}

impl Count {
    /// Adds an entry that is carried out, with the pins that are inverted.
    pub fn add(&mut self, wiring: &Wiring, inverted: u32, [head, pins]: Entry) {
        let pins = pins ^ inverted;
        if head & CHANGES != 0 {
            return;
        }
        for (m, steps) in self.steps.iter_mut().enumerate() {
            if pins & wiring.steps[1 << m] != 0 {
                *steps += if pins & wiring.dirs[m] != 0 { -1 } else { 1 };
            }
        }
    }
}

// `Dda::load` takes at most one segment a tick.
const _: () = assert!(SEGMENTS > 1);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boards::{Port, ShiftRegister, gp, pin};
    use crate::dda::Segment;
    use avr_embassy::ring::Ring;
    use proptest::prelude::*;
    use std::boxed::Box;
    use std::vec::Vec;

    /// The pins are in no particular order.
    static WIRING: Wiring = Wiring::new(
        &[
            MotorPins { step: gp(11), dir: gp(10), enable: None },
            MotorPins { step: gp(6), dir: gp(5), enable: None },
            MotorPins { step: gp(19), dir: gp(28), enable: None },
            MotorPins { step: gp(14), dir: gp(13), enable: None },
        ],
        None,
    );

    const CHAIN: ShiftRegister =
        ShiftRegister { data: gp(14), clock: gp(15), latch: gp(16), outputs: 8 };

    /// Steps at the outputs 0, 2, 4 and 6 of a register, directions at those behind them.
    static BEHIND: Wiring = {
        let mut motors = [MotorPins { step: gp(0), dir: gp(0), enable: None }; 4];
        let mut m = 0;
        while m < 4 {
            motors[m].step = pin(Port::Steps, 2 * m as u8);
            motors[m].dir = pin(Port::Steps, 2 * m as u8 + 1);
            m += 1;
        }
        Wiring::new(&motors, Some(Registers { steps: CHAIN, outputs: CHAIN }))
    };

    #[test]
    fn the_last_output_is_sent_first() {
        assert_eq!((BEHIND.steps[1], BEHIND.dirs[3]), (0x80, 0x01));
    }

    /// Steps: when, of which motors, and which go backwards.
    type Rises = Vec<(i64, u8, u8)>;

    /// The steps that the ticks make without entries.
    #[derive(Default)]
    struct Plan {
        now: i64,
        period: i64,
        backwards: u8,
        rises: Rises,
        stopped: bool,
    }

    impl Pins for Plan {
        fn rise(&mut self, motors: u8) {
            if motors != 0 {
                let backwards = self.backwards & motors;
                self.rises.push((self.now, motors, backwards));
            }
        }
        fn fall(&mut self, _motors: u8) {}
        fn direction(&mut self, backwards: u8) {
            self.backwards = backwards;
        }
        fn period(&mut self, counts: u16) {
            self.period = i64::from(counts) * i64::from(CYCLES_PER_COUNT);
        }
        fn slot_free(&mut self) {}
        fn stop(&mut self) {
            self.stopped = true;
        }
    }

    fn segment(increment: [u16; MOTORS], ticks: u16, period: u16, backwards: u8) -> Segment {
        let mut segment =
            Segment { increment, ticks, period, backwards, moving: 15, ..Segment::default() };
        segment.seal(0, STEP);
        segment
    }

    const FIRST: u32 = 800;

    /// Returns the entries of segments, written `chunk` ticks at a time, and what the program counts in a pulse.
    fn written(
        (wiring, inverted): (&'static Wiring, u32),
        segments: &[Segment],
        chunk: u16,
        pulse_us: u8,
    ) -> (Vec<Entry>, i64) {
        let ring: &'static Ring<Segment, 8> = Box::leak(Box::default());
        let (mut producer, mut consumer) = ring.split().unwrap();
        segments.iter().for_each(|segment| producer.push(*segment).unwrap());
        let (mut dda, mut writer) = (Dda::new(), Writer::new(wiring));
        let mut room = std::vec![[0; 2]; 4_000];
        let mut list = List::new(&mut room);
        writer.set_inverted(inverted);
        writer.set_pulse(pulse_us);
        writer.begin(FIRST, &mut list);
        loop {
            if dda.ticks == 0
                && !dda.load(&mut Out { writer: &mut writer, to: &mut list }, &mut consumer)
            {
                break;
            }
            let ticks = dda.ticks.min(chunk);
            let before = list.len();
            writer.run(&mut dda, ticks, &mut list);
            assert!(list.len() - before <= ticks.into());
            if list.len() == before {
                writer.close(&mut list);
            }
        }
        writer.end(&mut list);
        let used = list.len();
        room.truncate(used);
        (room, writer.pulse_count().into())
    }

    /// Returns when steps rise, by the timing of the program. Directions stand for a microsecond behind a pulse.
    fn rises((wiring, inverted): (&Wiring, u32), entries: &[Entry], pulse: i64) -> Rises {
        let (mut now, mut low, mut fell, mut all) = (0, 0, i64::MIN / 2, Vec::new());
        let Program { pulse: least, around, change, lead } = wiring.program;
        // The latch of a register stays high for four cycles before the next entry.
        let behind = if lead == 0 { 0 } else { 4 };
        for [head, pins] in entries {
            let pins = pins ^ inverted;
            if head & CHANGES != 0 {
                let changed = now + i64::from(change - behind);
                assert!(pins == low || changed - fell >= HOLD.into(), "{}", changed - fell);
                low = pins;
                now += i64::from(change);
                continue;
            }
            now += i64::from(around - behind) + i64::from(head >> REST);
            let high = |m: &usize| pins & wiring.steps[1 << m] != 0;
            let motors = (0..MOTORS).filter(high).fold(0, |set, m| set | 1 << m);
            let turned = |m: &usize| pins & wiring.dirs[*m] != 0;
            let backwards = (0..MOTORS).filter(turned).fold(0, |set, m| set | 1 << m);
            // Directions were set before the pulse.
            assert_eq!(pins & !wiring.steps[15], low);
            now += pulse + i64::from(least);
            if motors != 0 {
                all.push((now - pulse - i64::from(least), motors, backwards & motors));
                fell = now;
            }
            now += i64::from(behind);
        }
        all
    }

    /// Returns the steps with times counted from the first one.
    fn from_the_first(rises: &Rises) -> Rises {
        let first = rises.first().map_or(0, |rise| rise.0);
        rises.iter().map(|(at, motors, backwards)| (at - first, *motors, *backwards)).collect()
    }

    proptest! {
        /// Whatever the segments, and wherever chunks end, each pulse comes at its cycle, in its direction.
        #[test]
        fn entries_do_what_ticks_do(
            segments in prop::collection::vec(
                (
                    prop::array::uniform4(prop_oneof![Just(0), Just(STEP), 0u16..=STEP]),
                    1u16..60, 150u16..5_000, 0u8..16,
                ),
                1..7,
            ),
            chunk in 1u16..40,
            // Behind a register, with these outputs inverted; or pins of the chip.
            behind in prop::option::of(0u32..256),
        ) {
            let wired = behind.map_or((&WIRING, 0), |inverted| (&BEHIND, inverted));
            // The register takes longer, so that ticks of the shortest period would come late behind a turn.
            let least = if wired.0.program.lead == 0 { 0 } else { 40 };
            let segments: Vec<_> =
                segments.into_iter().map(|(i, t, p, b)| segment(i, t, p - 40 + least, b)).collect();
            let ring: &'static Ring<Segment, 8> = Box::leak(Box::default());
            let (mut producer, mut consumer) = ring.split().unwrap();
            segments.iter().for_each(|segment| producer.push(*segment).unwrap());
            let (mut dda, mut plan) = (Dda::new(), Plan::default());
            while !plan.stopped {
                dda.tick(&mut plan, &mut consumer);
                plan.now += plan.period;
            }
            let (entries, pulse) = written(wired, &segments, chunk, 0);
            let found = rises(wired, &entries, pulse);
            prop_assert_eq!(from_the_first(&found), from_the_first(&plan.rises));
            let mut count = Count::default();
            entries.iter().for_each(|entry| count.add(wired.0, wired.1, *entry));
            let mut expected = [0; MOTORS];
            for (_, motors, backwards) in plan.rises {
                for (m, steps) in expected.iter_mut().enumerate() {
                    let step = i32::from(motors >> m & 1);
                    *steps += if backwards >> m & 1 != 0 { -step } else { step };
                }
            }
            prop_assert_eq!(count.steps, expected);
        }
    }

    /// A step each microsecond, with pulses of half of one.
    #[test]
    fn a_million_steps_a_second() {
        let (entries, pulse) = written((&WIRING, 0), &[segment([STEP; 4], 1_000, 64, 0)], 500, 0);
        let rises = rises((&WIRING, 0), &entries, pulse);
        assert_eq!(rises.len(), 1_000);
        assert!(rises.windows(2).all(|pair| pair[1].0 - pair[0].0 == 128));
        assert_eq!(pulse + 3, 64);
    }

    /// Behind a register the shortest pulse is 0.52 us, and a step takes 142 cycles.
    #[test]
    fn nine_hundred_thousand_steps_a_second_behind_a_register() {
        let (entries, pulse) = written((&BEHIND, 0), &[segment([STEP; 4], 1_000, 71, 0)], 500, 0);
        let rises = rises((&BEHIND, 0), &entries, pulse);
        assert_eq!(rises.len(), 1_000);
        assert!(rises.windows(2).all(|pair| pair[1].0 - pair[0].0 == 142));
        assert_eq!(pulse, 0);
    }

    /// A pulse that is due too soon after another comes late, and the pulses after it come in time again.
    #[test]
    fn late_pulses_are_made_up_for() {
        let close = segment([STEP, 0, 0, 0], 4, 64, 0);
        let wide = segment([STEP, 0, 0, 0], 4, 1_000, 0);
        let (entries, pulse) = written((&WIRING, 0), &[wide, close, wide], 100, 2);
        let rises = from_the_first(&rises((&WIRING, 0), &entries, pulse));
        assert_eq!(rises.len(), 12);
        assert_eq!(rises[7].0 - rises[3].0, 4 * (256 + 7), "as fast as pulses can");
        assert_eq!(rises[11].0 - rises[3].0, 4 * 128 + 4 * 2_000);
    }
}
