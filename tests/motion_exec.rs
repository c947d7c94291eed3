//! Blocks through look-ahead, exec, prep and the step generator, on the host: every block ends on its
//! step, whatever came before, and the speeds are the planned ones.

use kerf::boards::MOTORS;
use kerf::hal::ring::{Consumer, Producer, Ring};
use kerf::motion::block::{Block, Kind};
use kerf::motion::dda::{Dda, Pins, SEGMENTS, Segment};
use kerf::motion::exec::{Exec, Step};
use kerf::motion::prep::PERIOD_MIN;
use kerf::motion::queue::{BLOCKS, BlockQueue, BlockSource};
use proptest::prelude::*;

#[derive(Default)]
struct Recorder {
    position: [i64; MOTORS],
    backwards: u8,
    period: u64,
    stopped: bool,
    now: u64,
    /// Cycle of each step of each motor.
    edges: [Vec<u64>; MOTORS],
}

impl Pins for Recorder {
    fn rise(&mut self, motors: u8) {
        for m in 0..MOTORS {
            if motors & (1 << m) != 0 {
                self.position[m] += if self.backwards & (1 << m) != 0 { -1 } else { 1 };
                self.edges[m].push(self.now);
            }
        }
    }
    fn fall(&mut self, _: u8) {}
    fn direction(&mut self, backwards: u8) {
        self.backwards = backwards;
    }
    fn period(&mut self, cycles: u16) {
        self.period = u64::from(cycles);
    }
    fn slot_free(&mut self) {}
    fn stop(&mut self) {
        self.stopped = true;
    }
}

struct Rig {
    queue: BlockQueue,
    source: BlockSource,
    exec: Exec,
    fill: Producer<Segment, SEGMENTS>,
    drain: Consumer<Segment, SEGMENTS>,
    dda: Dda,
    pins: Recorder,
    /// Segments so far.
    segments: u64,
}

impl Rig {
    fn new() -> Self {
        let blocks: &'static Ring<Block, BLOCKS> = Box::leak(Box::new(Ring::new()));
        let (queue, source) = blocks.split().expect("first");
        let segments: &'static Ring<Segment, SEGMENTS> = Box::leak(Box::new(Ring::new()));
        let (fill, drain) = segments.split().expect("first");
        Rig {
            queue: BlockQueue::new(queue),
            source,
            exec: Exec::new(),
            fill,
            drain,
            dda: Dda::new(),
            pins: Recorder { stopped: true, ..Recorder::default() },
            segments: 0,
        }
    }

    /// Runs exec once and the steppers as long as segments are queued.
    fn turn(&mut self) -> Step {
        let step = self.exec.step(&mut self.source, self.pins.stopped);
        if let Step::Segment(segment) = step {
            assert!(segment.period >= PERIOD_MIN.min(segment.period), "never zero");
            assert!(segment.ticks > 0 && segment.period > 0);
            self.segments += 1;
            self.fill.push(segment).expect("room");
            self.pins.stopped = false;
        }
        while !self.drain.is_empty() {
            self.tick();
        }
        if matches!(step, Step::Idle | Step::Standstill) {
            while !self.pins.stopped {
                self.tick();
            }
        }
        step
    }

    fn tick(&mut self) {
        self.dda.tick(&mut self.pins, &mut self.drain);
        self.pins.now += self.pins.period;
    }

    /// Runs until nothing is left to do.
    fn finish(&mut self) {
        while self.turn() != Step::Idle || !self.pins.stopped {}
        self.turn();
    }
}

fn line(steps: [i32; MOTORS], length: f32, cruise: f32, entry_max: f32, jerk: f32) -> Block {
    Block { steps, length, cruise, entry_max, jerk, kind: Kind::Line, ..Block::default() }
}

#[test]
fn cruises_at_the_commanded_rate() {
    for rate in [1.0f64, 37.0, 1000.0, 7777.0, 20_000.0, 39_000.0] {
        let mut rig = Rig::new();
        let steps = (rate * 4.0) as i32 + 4;
        let length = steps as f32 / 100.0;
        let block = line([steps, steps / 3, 0, steps], length, rate as f32 / 100.0, 0.0, 1e9);
        assert!(rig.queue.push(block));
        rig.finish();
        assert_eq!(rig.pins.position, [steps, steps / 3, 0, steps].map(i64::from));
        let edges = &rig.pins.edges[0];
        let middle = &edges[edges.len() / 4..edges.len() * 3 / 4];
        let cycles = (middle[middle.len() - 1] - middle[0]) as f64;
        let mean = (middle.len() - 1) as f64 * 16e6 / cycles;
        assert!((mean / rate - 1.0).abs() < 1e-3, "{rate} steps/s came out as {mean}");
        // The dominant motor and the one that makes as many steps keep time together.
        assert_eq!(rig.pins.edges[0], rig.pins.edges[3]);
        if rate >= 1000.0 {
            let gaps: Vec<u64> = middle.windows(2).map(|w| w[1] - w[0]).collect();
            let (low, high) = (gaps.iter().min().unwrap(), gaps.iter().max().unwrap());
            let slack = 2 + (16e6 / rate / f64::from(PERIOD_MIN)) as u64 * 2;
            assert!(high - low <= slack, "{rate}: intervals {low} to {high}");
        }
    }
}

#[test]
fn one_step_in_ten_seconds_takes_ten_seconds() {
    let mut rig = Rig::new();
    assert!(rig.queue.push(line([3, 0, 0, 0], 3.0, 0.1, 0.0, 1e9)));
    rig.finish();
    let gaps: Vec<f64> =
        rig.pins.edges[0].windows(2).map(|w| (w[1] - w[0]) as f64 / 16e6).collect();
    assert_eq!(gaps.len(), 2);
    for gap in gaps {
        assert!((gap - 10.0).abs() < 0.01, "{gap} s");
    }
}

#[test]
fn a_dwell_lasts_as_long_as_asked() {
    let mut rig = Rig::new();
    let dwell = Block { steps: [1234, 0, 0, 0], kind: Kind::Dwell, ..Block::default() };
    assert!(rig.queue.push(dwell));
    rig.finish();
    let ms = rig.pins.now as f64 / 16e3;
    assert!((ms - 1234.0).abs() < 5.0, "{ms} ms");
}

#[test]
fn blocks_without_a_step_keep_their_time() {
    let mut rig = Rig::new();
    for n in 0..800 {
        let step = i32::from(n % 80 == 79);
        while rig.queue.free() == 0 {
            rig.turn();
        }
        assert!(rig.queue.push(line([step, 0, 0, 0], 0.001, 0.2, 0.2, 1e9)));
    }
    rig.finish();
    assert_eq!(rig.pins.position[0], 10);
    let seconds = rig.pins.now as f64 / 16e6;
    assert!((seconds - 4.0).abs() < 0.4, "0.8 mm at 0.2 mm/s took {seconds} s");
}

fn any_block() -> impl Strategy<Value = Block> {
    (
        prop::array::uniform4(prop_oneof![
            3 => -3000..3000i32,
            1 => -3..3i32,
            1 => Just(0),
            1 => -200_000..200_000i32,
        ]),
        1.0f32..2000.0,
        0.0f32..1.0,
        1e2f32..1e8,
        0.0f32..1e4,
    )
        .prop_map(|(steps, scale, entry, jerk, accel)| {
            let most = steps.iter().map(|s| s.unsigned_abs()).max().unwrap_or(0);
            let length = (most as f32 / scale).max(0.001);
            let cruise = (30_000.0 / scale).min(length / 0.0005).min(100.0);
            Block { accel, ..line(steps, length, cruise, entry * cruise, jerk) }
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn every_block_ends_on_its_step(blocks in prop::collection::vec(any_block(), 1..60)) {
        let mut rig = Rig::new();
        let mut target = [0i64; MOTORS];
        let mut total = [0u64; MOTORS];
        for block in &blocks {
            for m in 0..MOTORS {
                target[m] += i64::from(block.steps[m]);
                total[m] += u64::from(block.steps[m].unsigned_abs());
            }
            while rig.queue.free() == 0 {
                rig.turn();
            }
            prop_assert!(rig.queue.push(*block));
        }
        rig.finish();
        prop_assert_eq!(rig.pins.position, target);
        // Not a step too many on the way either.
        let emitted: Vec<u64> = rig.pins.edges.iter().map(|e| e.len() as u64).collect();
        prop_assert_eq!(emitted, total.to_vec());
        for edges in &rig.pins.edges {
            for gap in edges.windows(2) {
                prop_assert!(gap[1] - gap[0] >= u64::from(PERIOD_MIN));
            }
        }
    }
}
