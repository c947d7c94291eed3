//! The step interrupt in assembly makes exactly the pulses of `Dda::tick`, tick for tick.
//!
//! The chip dwells, so that exec queues segments without steps. In the ring each of them is replaced by a random
//! segment before the interrupt takes it. A twin on the host, `Dda::tick`, gets the segments of each run of the
//! timer.

use kerf::boards::{Board, MEGA2560_GRBL, MOTORS, RAMPS14_CNC};
use kerf::dda::{Dda, Pins, SEGMENTS, STEP, Segment};
use kerf::hal::ring::{Consumer, Producer, Ring};
use kerf_sim::mechanics::Random;
use kerf_sim::{Machine, Step};

use crate::common::booted;

/// Cycles from the start of the timer to the first tick.
const FIRST_TICK: u64 = 400;
/// Latest time of a pulse behind its tick, cycles: `settle`, and whatever else holds the interrupt up.
const LATEST: u64 = 320;

/// The address of the chip's ring. It has the indices of the slots filled and read last, then a byte that says which
/// ends have been taken, then slots of 16 bytes.
struct ChipRing(u16);

impl ChipRing {
    fn of(machine: &Machine) -> Self {
        let at = machine.image().variable("kerf::hal::imp::stepper::SEGMENT_RING");
        let ring = Self(at.expect("the ring of segments"));
        assert_eq!(machine.peek(ring.byte(2)), 3, "both ends have been taken, here");
        ring
    }

    /// Returns the address of a byte before the slots.
    fn byte(&self, which: u16) -> u16 {
        self.0 + which
    }

    fn head(&self, machine: &Machine) -> u8 {
        machine.peek(self.byte(0))
    }

    fn slot(&self, index: u8) -> u16 {
        self.0 + 3 + u16::from(index) * 16
    }

    /// Returns how long the segment in a slot lasts, cycles.
    fn length(&self, machine: &Machine, index: u8) -> u64 {
        let word = |at| u64::from(machine.peek_word(self.slot(index) + at));
        word(8) * word(10)
    }

    fn put(&self, machine: &mut Machine, index: u8, segment: &Segment) {
        let words = segment.increment.into_iter().chain([segment.ticks, segment.period]);
        let tail = [segment.backwards, segment.settle, segment.mode, segment.moving];
        let bytes = words.flat_map(u16::to_le_bytes).chain(tail);
        for (at, byte) in (self.slot(index)..).zip(bytes) {
            machine.poke(at, byte);
        }
    }
}

/// Makes a random segment. Some last about as long as `length`; others are so short that the ring runs dry.
fn segment(random: &mut Random, length: u64) -> Segment {
    let mut segment = Segment::default();
    let wide = random.below(2) == 0;
    let may_move = if wide { 0b1111 } else { 0b11 };
    segment.moving = random.below(16) as u8 & may_move;
    let lockstep = random.below(4) == 0;
    for (m, increment) in segment.increment.iter_mut().enumerate() {
        if segment.moving & 1 << m != 0 {
            *increment = match random.below(if lockstep { 1 } else { 6 }) {
                0 => STEP,
                1 => STEP / 2,
                2 => 1 + random.below(64) as u16,
                _ => random.below(u64::from(STEP) + 1) as u16,
            };
        }
    }
    segment.backwards = random.below(16) as u8;
    segment.period = 460 + random.below(2_000) as u16;
    segment.settle = if segment.period > 700 { random.below(200) as u8 } else { 0 };
    let ticks = match random.below(8) {
        0 => 1 + random.below(3),
        _ => length / u64::from(segment.period) + random.below(3),
    };
    segment.ticks = ticks.clamp(1, 0xFFFF) as u16;
    let full = (0..MOTORS).filter(|m| segment.increment[*m] == STEP).map(|m| 1 << m).sum();
    segment.seal(full, if full == 0 { 0 } else { STEP });
    segment
}

/// The pulses of one tick.
#[derive(Debug, PartialEq)]
struct Pulses {
    /// The cycle of the tick, or of its first pulse.
    at: u64,
    /// The motors that step, as bits.
    motors: u8,
    /// The motors that run backwards, as bits.
    backwards: u8,
}

/// The pins of the twin.
#[derive(Default)]
struct Out {
    motors: u8,
    backwards: u8,
    rising_backwards: u8,
    period: u64,
    stopped: bool,
}

impl Pins for Out {
    fn rise(&mut self, motors: u8) {
        (self.motors, self.rising_backwards) = (motors, self.backwards);
    }

    fn fall(&mut self, _motors: u8) {}

    fn direction(&mut self, backwards: u8) {
        self.backwards = backwards;
    }

    fn period(&mut self, cycles: u16) {
        self.period = cycles.into();
    }

    fn slot_free(&mut self) {}

    fn stop(&mut self) {
        self.stopped = true;
    }
}

/// `Dda::tick` with the chip's segments.
struct Twin {
    dda: Dda,
    pins: Out,
    producer: Producer<Segment, SEGMENTS>,
    consumer: Consumer<Segment, SEGMENTS>,
}

impl Twin {
    fn new() -> Self {
        let ring: &'static Ring<Segment, SEGMENTS> = Box::leak(Box::new(Ring::new()));
        let (producer, consumer) = ring.split().unwrap();
        Self { dda: Dda::new(), pins: Out::default(), producer, consumer }
    }

    /// Runs the twin from cycle to cycle, with the segments that fit into that time.
    fn run(
        &mut self,
        (from, to): (u64, u64),
        segments: &mut impl Iterator<Item = Segment>,
    ) -> Vec<Pulses> {
        let (mut at, mut left, mut all) = (from + FIRST_TICK, 0, Vec::new());
        self.pins.stopped = false;
        while !self.pins.stopped {
            // The run ends within the tick that finds no segment.
            if left == 0 && at + LATEST < to {
                let next = segments.next().expect("the chip had no more segments");
                left = next.ticks;
                assert!(self.producer.push(next).is_ok());
            }
            self.dda.tick(&mut self.pins, &mut self.consumer);
            let Out { motors, rising_backwards, .. } = self.pins;
            if motors != 0 {
                all.push(Pulses { at, motors, backwards: rising_backwards & motors });
            }
            left = left.saturating_sub(1);
            at += if self.pins.stopped { 0 } else { self.pins.period };
        }
        assert!(to >= at && to < at + LATEST, "the chip stops at {to}, the twin at {at}");
        all
    }
}

/// Groups the pulses of the chip by tick.
fn by_tick(log: &[Step]) -> Vec<Pulses> {
    let mut all: Vec<Pulses> = Vec::new();
    for step in log {
        let bit = 1 << step.motor;
        let backwards = if step.positive { 0 } else { bit };
        match all.last_mut() {
            // Pins of one tick rise within some cycles.
            Some(last) if step.cycle - last.at < 100 && last.motors & bit == 0 => {
                last.motors |= bit;
                last.backwards |= backwards;
            }
            _ => all.push(Pulses { at: step.cycle, motors: bit, backwards }),
        }
    }
    all
}

/// Dwells with random segments in place of those without steps, and compares. Returns the number of ticks with
/// pulses, and of runs.
fn compare(board: &'static Board, seed: u64) -> (usize, usize) {
    let mut random = Random::new(seed);
    let (mut machine, mut host) = booted(board);
    let ring = ChipRing::of(&machine);
    machine.recorder_mut().clear();
    machine.recorder_mut().keep_log();
    let (mut seen, mut segments) = (ring.head(&machine), Vec::new());
    for n in 0..4 {
        host.send(&mut machine, n, "g4 p0.4");
        let until = machine.cycle() + machine.cycles(600);
        while machine.cycle() < until {
            machine.run_until(machine.cycle() + 40).unwrap();
            while seen != ring.head(&machine) {
                seen = (seen + 1) % SEGMENTS as u8;
                let next = segment(&mut random, ring.length(&machine, seen));
                ring.put(&mut machine, seen, &next);
                segments.push(next);
            }
        }
    }
    let (log, runs) = (machine.recorder().log(), machine.recorder().timer_runs());
    let (mut twin, mut segments) = (Twin::new(), segments.into_iter());
    let mut ticks = 0;
    for run in runs {
        let expected = twin.run(*run, &mut segments);
        let during: Vec<_> =
            log.iter().filter(|s| (run.0..=run.1).contains(&s.cycle)).copied().collect();
        let made = by_tick(&during);
        for (tick, pulses) in expected.iter().zip(&made) {
            let late = pulses.at.checked_sub(tick.at);
            let same = (tick.motors, tick.backwards) == (pulses.motors, pulses.backwards);
            assert!(
                same && late.is_some_and(|late| late < LATEST),
                "seed {seed}: {tick:?} became {pulses:?}"
            );
        }
        assert_eq!(expected.len(), made.len(), "seed {seed}");
        ticks += made.len();
    }
    assert_eq!(segments.count(), 0, "seed {seed}: segments are left");
    (ticks, runs.len())
}

#[test]
fn the_interrupt_does_what_the_generator_does() {
    let (mut ticks, mut runs) = (0, 0);
    for (seed, board) in (0..).zip([&MEGA2560_GRBL, &RAMPS14_CNC, &MEGA2560_GRBL, &RAMPS14_CNC]) {
        let (more_ticks, more_runs) = compare(board, seed);
        (ticks, runs) = (ticks + more_ticks, runs + more_runs);
    }
    println!("{ticks} ticks with pulses in {runs} runs of the timer");
    assert!(ticks > 40_000 && runs >= 16, "{ticks} ticks with pulses in {runs} runs");
}
