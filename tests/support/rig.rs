//! Planner, exec and step generator without a board: moves go in, steps come out.

use kerf::boards::MOTORS;
use kerf::config::StepRatio;
use kerf::gcode::command::Feed;
use kerf::hal::ring::{Consumer, Producer, Ring};
use kerf::motion::block::Block;
use kerf::motion::dda::{Dda, Pins, SEGMENTS, Segment};
use kerf::motion::dynamics::{Dynamics, Machine};
use kerf::motion::exec::{Exec, Snapshot, Step};
use kerf::motion::line::{Builder, Built, Line, Motors};
use kerf::motion::queue::{BlockQueue, BlockSource, BlockStore};
use kerf::units::{AXES, Length, PerAxis};

/// Limits and motors, the same for all axes unless changed; mm, s.
#[derive(Clone, Debug)]
pub struct Config {
    pub velocity: PerAxis<f32>,
    pub accel: PerAxis<f32>,
    pub jerk: PerAxis<f32>,
    pub deviation: f32,
    pub junction: f32,
    pub ratio: [StepRatio; MOTORS],
}

impl Config {
    pub fn new(velocity: f32, accel: f32, jerk: f32) -> Self {
        Config {
            velocity: [velocity; AXES],
            accel: [accel; AXES],
            jerk: [jerk; AXES],
            deviation: 0.01,
            junction: 500.0,
            // 80 steps a mm.
            ratio: [StepRatio { num: 1, den: 125 }; MOTORS],
        }
    }
}

impl Machine for Config {
    fn velocity_max(&self, axis: usize) -> f32 {
        self.velocity[axis] * 60.0
    }
    fn feedrate_max(&self, axis: usize) -> f32 {
        self.velocity[axis] * 60.0
    }
    fn jerk_max(&self, axis: usize) -> f32 {
        self.jerk[axis] * 216_000.0
    }
    fn accel_max(&self, axis: usize) -> f32 {
        self.accel[axis] * 3_600.0
    }
    fn junction_deviation(&self, _: usize) -> f32 {
        self.deviation
    }
    fn junction_acceleration(&self) -> f32 {
        self.junction * 3_600.0
    }
}

impl Motors for Config {
    fn motor_axis(&self, motor: usize) -> u8 {
        motor as u8
    }
    fn ratio(&self, motor: usize) -> StepRatio {
        self.ratio[motor]
    }
}

/// What the pins do.
#[derive(Default)]
pub struct Recorder {
    pub position: [i64; MOTORS],
    /// Cycle of each step of each motor, if wanted.
    pub edges: [Vec<u64>; MOTORS],
    pub keep_edges: bool,
    pub now: u64,
    pub stopped: bool,
    backwards: u8,
    period: u64,
}

impl Pins for Recorder {
    fn rise(&mut self, motors: u8) {
        for m in 0..MOTORS {
            if motors & (1 << m) != 0 {
                self.position[m] += if self.backwards & (1 << m) != 0 { -1 } else { 1 };
                if self.keep_edges {
                    self.edges[m].push(self.now);
                }
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

/// A segment as it went out, with what exec said of it.
#[derive(Clone, Copy, Debug)]
pub struct Emitted {
    pub segment: Segment,
    /// Velocity at its end, mm/s.
    pub velocity: f32,
    /// The block it belongs to: the line number given with the move.
    pub line: u32,
    /// mm to the end of that block.
    pub left: f32,
}

pub struct Rig {
    pub config: Config,
    dynamics: Dynamics,
    builder: Builder,
    queue: BlockQueue,
    pub source: BlockSource,
    exec: Exec,
    pub snapshot: Snapshot,
    fill: Producer<Segment, SEGMENTS>,
    drain: Consumer<Segment, SEGMENTS>,
    dda: Dda,
    pub pins: Recorder,
    pub position: PerAxis<Length>,
    pub emitted: Vec<Emitted>,
    pub keep: bool,
    pub segments: u64,
}

impl Rig {
    pub fn new(config: Config) -> Self {
        let blocks: &'static BlockStore = Box::leak(Box::new(BlockStore::new()));
        let (queue, source) = blocks.split().expect("first");
        let segments: &'static Ring<Segment, SEGMENTS> = Box::leak(Box::new(Ring::new()));
        let (fill, drain) = segments.split().expect("first");
        Rig {
            dynamics: Dynamics::new(&config),
            config,
            builder: Builder::default(),
            queue,
            source,
            exec: Exec::new(),
            snapshot: Snapshot::new(),
            fill,
            drain,
            dda: Dda::new(),
            pins: Recorder { stopped: true, ..Recorder::default() },
            position: [Length::ZERO; AXES],
            emitted: Vec::new(),
            keep: true,
            segments: 0,
        }
    }

    pub fn free(&self) -> usize {
        self.queue.free()
    }

    /// Queues a move; there must be room. mm/s.
    pub fn line(&mut self, to: PerAxis<Length>, velocity: f32, number: u32) {
        let feed = Some(Feed::PerMinute(velocity * 60.0));
        let line = Line { from: &self.position, to: &to, feed };
        match self.builder.line(&line, &self.dynamics, &self.config) {
            Built::Nothing => {}
            Built::Parts(_) => panic!("too long for a test"),
            Built::Line(block, entry) => assert!(self.queue.push_line(block, entry, number)),
        }
        self.position = to;
    }

    /// The next move begins at rest.
    pub fn stop(&mut self) {
        self.builder.stopped();
    }

    pub fn push(&mut self, block: Block) {
        self.builder.stopped();
        assert!(self.queue.push(block));
    }

    /// Runs exec once and the steppers as long as segments are queued.
    pub fn turn(&mut self) -> Step {
        let step = self.exec.step(&mut self.source, self.pins.stopped, &mut self.snapshot);
        if let Step::Segment(segment) = step {
            assert!(segment.ticks > 0 && segment.period > 0, "{segment:?}");
            assert!(segment.increment.iter().all(|i| *i <= 0x8000), "{segment:?}");
            self.segments += 1;
            if self.keep {
                let Snapshot { velocity, line, left, .. } = self.snapshot;
                self.emitted.push(Emitted { segment, velocity, line, left });
            }
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
    pub fn finish(&mut self) {
        let mut idle = 0;
        while self.turn() != Step::Idle || !self.pins.stopped {
            idle += 1;
            assert!(idle < 200_000, "does not come to an end");
        }
        self.turn();
    }

    /// Where the motors should be.
    pub fn target(&self) -> [i64; MOTORS] {
        core::array::from_fn(|m| self.config.ratio[m].steps(self.position[m]).into())
    }

    /// Seconds so far.
    pub fn seconds(&self) -> f64 {
        self.pins.now as f64 / 16e6
    }
}

/// A position in mm.
pub fn at<const N: usize>(mm: [f64; N]) -> PerAxis<Length> {
    let mut position = [Length::ZERO; AXES];
    for (position, mm) in position.iter_mut().zip(mm) {
        *position = Length((mm * 1e4).round() as i32);
    }
    position
}
