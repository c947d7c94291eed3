//! From ticks of the step generator to words of the state machine: plain Rust, without any register.
//!
//! A word is the levels of all step and direction pins, and how long they stand. The feeder runs [`Dda::tick`](crate::dda::Dda::tick) ahead of time;
//! what the ticks do to pins, [`Writer`] writes down. Two words are a pulse; a tick without a pulse lengthens the word before.
//!
//! Time is in cycles of the system clock. No word is shorter than [`LEAST`]: what asks for less is as long, and what follows comes as
//! much later.

use crate::boards::MOTORS;
use crate::dda::{Pins, SEGMENTS};

/// Bits of a word: steps, then directions.
pub const PINS: u32 = 2 * MOTORS as u32;
/// Set in the word whose end is to be told.
pub const MARK: u32 = 1 << PINS;
/// Where the delay begins.
const DELAY: u32 = PINS + 1;
/// Cycles of a word whose delay is 0; a marked one takes one more.
pub const LEAST: i32 = 6;
/// Cycles of the longest word.
const LONGEST: i32 = (1 << (32 - DELAY)) - 1 + LEAST;

/// Words that one tick writes at most.
pub const OF_A_TICK: usize = 8;
/// Words that the end of motion takes.
pub const OF_THE_END: usize = 4;

/// After so many cycles of a pulse that is longer directions change: 2 us.
const TURNED: i32 = 2 * CYCLES_PER_US as i32;

/// Cycles of a microsecond, and of a count of [`TIMER_HZ`](crate::hal::TIMER_HZ).
pub const CYCLES_PER_US: u32 = 128;
/// See [`CYCLES_PER_US`].
pub const CYCLES_PER_COUNT: u32 = 2;

/// Where words are put.
pub trait Put {
    /// Takes one more word. There is room for it.
    fn put(&mut self, word: u32);
    /// Changes the word that was put last.
    fn change_last(&mut self, change: impl FnOnce(&mut u32));
}

/// What stands at the pins, and since when.
pub struct Writer {
    /// The pins of the word that is not put yet.
    open: u32,
    /// For how long they have stood by the tick that is written; below 0 while a pulse lasts.
    age: i32,
    /// From a tick to the next.
    period: i32,
    /// How long a pulse lasts.
    pulse: i32,
}

impl Writer {
    /// All pins low.
    pub const fn new() -> Self {
        Self { open: 0, age: 0, period: 0, pulse: 2 * CYCLES_PER_US as i32 }
    }

    /// From now on pulses last so many microseconds.
    pub fn set_pulse(&mut self, us: u8) {
        self.pulse = i32::from(us.max(1)) * CYCLES_PER_US as i32;
    }

    /// The first tick comes after so many cycles.
    pub fn begin(&mut self, cycles: u32) {
        self.age = cycles as i32;
    }

    /// The tick that has been written is over. How long it was.
    pub fn pass(&mut self) -> i32 {
        self.age = self.age.saturating_add(self.period);
        self.period
    }

    /// Puts the word that is in the making. What follows begins behind it.
    pub fn close(&mut self, to: &mut impl Put) {
        while self.age > LONGEST {
            to.put(word(self.open, LONGEST));
            self.age -= LONGEST;
        }
        if self.age > 0 {
            to.put(word(self.open, self.age));
            self.age = 0;
        }
    }

    /// The last word: its end is told.
    pub fn end(&mut self, to: &mut impl Put) {
        // The low time behind the last pulse.
        to.put(word(self.open, self.pulse) | MARK);
        self.age = 0;
    }

    /// What the pins were after the last word that was put, as if all had been carried out.
    pub fn pins(&self) -> u32 {
        self.open
    }
}

/// A word of so many cycles.
fn word(pins: u32, cycles: i32) -> u32 {
    pins | ((cycles.clamp(LEAST, LONGEST) - LEAST) as u32) << DELAY
}

/// The pins of a word.
pub const fn pins_of(word: u32) -> u32 {
    word & (MARK - 1)
}

/// The ticks' way to the words.
pub struct Out<'a, P: Put> {
    /// What stands at the pins.
    pub writer: &'a mut Writer,
    /// Where words go.
    pub to: &'a mut P,
    /// A slot of the ring of segments has become free.
    pub freed: bool,
    /// There was no segment.
    pub stopped: bool,
}

impl<P: Put> Pins for Out<'_, P> {
    fn rise(&mut self, motors: u8) {
        if motors != 0 {
            self.writer.close(self.to);
            let pulse = self.writer.pulse;
            self.to.put(word(self.writer.open | u32::from(motors), pulse));
            self.writer.age = -pulse;
        }
    }

    fn fall(&mut self, _motors: u8) {}

    fn direction(&mut self, backwards: u8) {
        let turned = u32::from(backwards) << MOTORS;
        let Writer { open, age, pulse, .. } = self.writer;
        let high = *open & !turned_bits();
        if *age < 0 {
            // While the last pulse of the old direction lasts.
            if *pulse > TURNED {
                let rest = *pulse - TURNED;
                let mut steps = 0;
                self.to.change_last(|last| {
                    steps = pins_of(*last) & !turned_bits();
                    *last = word(pins_of(*last), TURNED);
                });
                self.to.put(word(steps | turned, rest));
            }
            *open = high | turned;
        } else {
            self.writer.close(self.to);
            self.writer.open = high | turned;
        }
    }

    fn period(&mut self, counts: u16) {
        self.writer.period = i32::from(counts) * CYCLES_PER_COUNT as i32;
    }

    fn slot_free(&mut self) {
        self.freed = true;
    }

    fn stop(&mut self) {
        self.stopped = true;
    }
}

/// The bits of directions.
const fn turned_bits() -> u32 {
    ((1 << MOTORS) - 1) << MOTORS
}

/// Counts the steps of words that follow one another, from the pins before them.
pub struct Count {
    before: u32,
    /// Steps of each motor, backwards ones negative.
    pub steps: [i32; MOTORS],
}

impl Count {
    /// Behind a word with these pins.
    pub const fn behind(pins: u32) -> Self {
        Self { before: pins, steps: [0; MOTORS] }
    }

    /// One more word is carried out.
    pub fn add(&mut self, word: u32) {
        let pins = pins_of(word);
        let rises = pins & !self.before;
        self.before = pins;
        for (m, steps) in self.steps.iter_mut().enumerate() {
            if rises >> m & 1 != 0 {
                *steps += if pins >> (MOTORS + m) & 1 != 0 { -1 } else { 1 };
            }
        }
    }
}

// `Dda::load` takes a segment a tick at most.
const _: () = assert!(SEGMENTS > 1);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dda::{Dda, STEP, Segment};
    use avr_embassy::ring::Ring;
    use proptest::prelude::*;
    use std::boxed::Box;
    use std::vec::Vec;

    #[derive(Default)]
    struct Kept(Vec<u32>);

    impl Put for Kept {
        fn put(&mut self, word: u32) {
            self.0.push(word);
        }
        fn change_last(&mut self, change: impl FnOnce(&mut u32)) {
            change(self.0.last_mut().unwrap());
        }
    }

    /// Pins by ticks: when each motor's pin rises, with its direction then; and when directions change.
    #[derive(Default)]
    struct Plan {
        now: u64,
        period: u64,
        backwards: u8,
        rises: Vec<(u64, u8, u8)>,
        stopped: bool,
    }

    impl Pins for Plan {
        fn rise(&mut self, motors: u8) {
            if motors != 0 {
                self.rises.push((self.now, motors, self.backwards));
            }
        }
        fn fall(&mut self, _motors: u8) {}
        fn direction(&mut self, backwards: u8) {
            self.backwards = backwards;
        }
        fn period(&mut self, counts: u16) {
            self.period = u64::from(counts) * u64::from(CYCLES_PER_COUNT);
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

    /// The words of segments, `chunk` ticks at a time.
    fn written(segments: &[Segment], chunk: usize, pulse_us: u8) -> (Vec<u32>, usize) {
        let ring: &'static Ring<Segment, 8> = Box::leak(Box::default());
        let (mut producer, mut consumer) = ring.split().unwrap();
        segments.iter().for_each(|segment| producer.push(*segment).unwrap());
        let (mut dda, mut writer, mut kept) = (Dda::new(), Writer::new(), Kept::default());
        writer.set_pulse(pulse_us);
        writer.begin(FIRST);
        let mut most = 0;
        for n in 1.. {
            let before = kept.0.len();
            let mut out = Out { writer: &mut writer, to: &mut kept, freed: false, stopped: false };
            dda.tick(&mut out, &mut consumer);
            let stopped = out.stopped;
            most = most.max(kept.0.len() - before);
            if stopped {
                writer.end(&mut kept);
                return (kept.0, most);
            }
            writer.pass();
            if n % chunk == 0 {
                writer.close(&mut kept);
            }
        }
        unreachable!()
    }

    /// When steps rise, by the words.
    fn rises(words: &[u32]) -> Vec<(u64, u8, u8)> {
        let (mut now, mut before, mut all) = (0, 0, Vec::new());
        for word in words {
            let pins = pins_of(*word);
            let up = (pins & !before) as u8 & 15;
            if up != 0 {
                all.push((now, up, (pins >> MOTORS) as u8));
            }
            before = pins;
            now += u64::from(*word >> DELAY) + LEAST as u64;
        }
        all
    }

    proptest! {
        /// Whatever runs, and wherever chunks end: each pulse is at its cycle, in its direction.
        #[test]
        fn words_do_what_ticks_do(
            segments in prop::collection::vec(
                ([0u16..=STEP, 0u16..=STEP, 0u16..=STEP, 0u16..=STEP], 1u16..60, 300u16..5_000, 0u8..16), 1..7),
            chunk in 1usize..40,
            pulse_us in 1u8..4,
        ) {
            let segments: Vec<_> =
                segments.into_iter().map(|(i, t, p, b)| segment(i, t, p, b)).collect();
            let ring: &'static Ring<Segment, 8> = Box::leak(Box::default());
            let (mut producer, mut consumer) = ring.split().unwrap();
            segments.iter().for_each(|segment| producer.push(*segment).unwrap());
            let (mut dda, mut plan) = (Dda::new(), Plan { now: FIRST.into(), ..Plan::default() });
            while !plan.stopped {
                dda.tick(&mut plan, &mut consumer);
                plan.now += plan.period;
            }
            let (words, most) = written(&segments, chunk, pulse_us);
            prop_assert!(most <= OF_A_TICK);
            prop_assert_eq!(rises(&words), plan.rises.clone());
            let mut count = Count::behind(0);
            words.iter().for_each(|word| count.add(*word));
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

    #[test]
    fn long_pulses_turn_after_two_microseconds() {
        let there = segment([STEP, 0, 0, 0], 2, 4_000, 0);
        let back = segment([STEP, 0, 0, 0], 2, 4_000, 1);
        let (words, _) = written(&[there, back], 1_000, 10);
        let high: Vec<_> = words.iter().filter(|word| pins_of(**word) & 1 != 0).collect();
        // Three pulses of one word, and the second of two words.
        assert_eq!(high.len(), 5);
        assert_eq!(high[1] >> DELAY, TURNED as u32 - LEAST as u32);
        assert_eq!((pins_of(*high[1]), pins_of(*high[2])), (1, 1 | 1 << MOTORS));
        let all: u32 = high[1..3].iter().map(|word| (**word >> DELAY) + LEAST as u32).sum();
        assert_eq!(all, 10 * CYCLES_PER_US);
    }

    #[test]
    fn longer_than_a_word_is_several() {
        let (mut writer, mut kept) = (Writer::new(), Kept::default());
        writer.begin(2 * LONGEST as u32 + 100);
        writer.close(&mut kept);
        assert_eq!(kept.0.len(), 3);
    }
}
