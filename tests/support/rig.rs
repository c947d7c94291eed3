//! Planner, exec and step generator without a board: moves go in, steps come out.

use avr_embassy::host::Runtime;
use kerf::boards::MOTORS;
use kerf::config::StepRatio;
use kerf::config::shape::{Resonances, SHAPED};
use kerf::dda::{Dda, PHASE_MARGIN, Pins, SEGMENTS, STEP, Segment};
use kerf::gcode::command::Feed;
use kerf::gcode::overrides::Change;
use kerf::hal::ring::{Consumer, Producer, Ring};
use kerf::kinematics::{self, DIFFERENCE, SUM};
use kerf::motion::advance;
use kerf::motion::backlash::{KEPT, KEPT_VELOCITY, Slack, pace};
use kerf::motion::blend::Blend;
use kerf::motion::block::{Block, QueuedAction};
use kerf::motion::dynamics::{Dynamics, MachineLimits};
use kerf::motion::exec::{Exec, Step, take_heat, take_override};
use kerf::motion::factors::Factors;
use kerf::motion::line::{Builder, Built, Line, Motors};
use kerf::motion::queue::{BlockQueue, BlockSource, BlockStore};
use kerf::motion::smooth::SAMPLE_S;
use kerf::motion::snapshot::Snapshot;
use kerf::units::{AXES, Length, PerAxis};

/// Limits and motors, the same for all axes unless they are changed; mm, s.
#[derive(Clone, Debug)]
pub struct Config {
    pub velocity: PerAxis<f32>,
    pub accel: PerAxis<f32>,
    pub jerk: PerAxis<f32>,
    pub deviation: f32,
    pub junction: f32,
    pub ratio: [StepRatio; MOTORS],
    /// The axes that each motor drives.
    pub drives: [u8; MOTORS],
    /// The backlash of each motor, steps.
    pub backlash: [u16; MOTORS],
    /// The resonances of the axes.
    pub resonances: Resonances,
}

/// Each motor drives an axis of its own.
pub const STRAIGHT: [u8; MOTORS] = [0, 1, 2, 3];
/// The first two motors drive X and Y together.
pub const CORE_XY: [u8; MOTORS] = [SUM, DIFFERENCE, 2, 3];

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
            drives: STRAIGHT,
            backlash: [0; MOTORS],
            resonances: Resonances::NONE,
        }
    }

    /// Returns the share of a limit that the path of an axis has.
    fn share(&self, axis: usize, kept: f32) -> f32 {
        if self.backlash.get(axis).is_some_and(|width| *width != 0) { kept } else { 1.0 }
    }

    /// Returns the backlash of a motor as exec is told of it.
    pub fn slack(&self, motor: usize) -> Slack {
        let velocity = MachineLimits::velocity_max(self, motor) / 60.0;
        let accel = MachineLimits::accel_max(self, motor) / 3_600.0;
        let way = pace(velocity, accel) * SAMPLE_S * 16.0 * 1e4;
        let pace = self.ratio[motor].steps(Length(way as i32)).clamp(1, 255) as u8;
        Slack { width: self.backlash[motor], pace }
    }

    /// Returns the position of a motor, in steps, when the axes are at `place`.
    pub fn steps(&self, motor: usize, place: &PerAxis<Length>) -> i32 {
        let place = kinematics::place(self.drives[motor], place);
        self.ratio[motor].steps(place.unwrap_or_default())
    }
}

impl MachineLimits for Config {
    fn velocity_max(&self, axis: usize) -> f32 {
        self.velocity[axis] * 60.0 * self.share(axis, KEPT_VELOCITY)
    }
    fn feedrate_max(&self, axis: usize) -> f32 {
        self.velocity[axis] * 60.0 * self.share(axis, KEPT_VELOCITY)
    }
    fn jerk_max(&self, axis: usize) -> f32 {
        self.jerk[axis] * 216_000.0 * self.share(axis, KEPT)
    }
    fn accel_max(&self, axis: usize) -> f32 {
        self.accel[axis] * 3_600.0 * self.share(axis, KEPT)
    }
    fn has_backlash(&self) -> bool {
        self.backlash.iter().any(|width| *width != 0)
    }
    fn resonances(&self) -> [Resonances; SHAPED] {
        [self.resonances; SHAPED]
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
        self.drives[motor]
    }
    fn ratio(&self, motor: usize) -> StepRatio {
        self.ratio[motor]
    }
}

/// Records what the pins do.
#[derive(Default)]
pub struct Recorder {
    pub position: [i64; MOTORS],
    /// Cycle of each step of each motor, if `keep_edges`.
    pub edges: [Vec<u64>; MOTORS],
    pub keep_edges: bool,
    /// Positions of the motors after each tick with a step, each with the cycle from which on it holds, if
    /// `keep_trail`.
    pub trail: Vec<([i64; MOTORS], u64)>,
    pub keep_trail: bool,
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
        if self.keep_trail && motors != 0 {
            self.trail.push((self.position, self.now));
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

/// A segment as it was sent out, with exec's data about it.
#[derive(Clone, Copy, Debug)]
pub struct Emitted {
    pub segment: Segment,
    /// Velocity at its end, mm/s.
    pub velocity: f32,
    /// The block that it belongs to: the line number given with the move.
    pub line: u32,
    /// How far the motors are ahead of the governor's place at the end of the segment, in steps of the motor that
    /// moves most.
    pub ahead: f64,
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
    /// The change of overrides that the last block with a request asks for.
    pub change: Option<Change>,
    pub segments: u64,
    /// A motor that may be ahead of its line. It is not checked.
    pub leads: Option<usize>,
    blends: bool,
    /// How far the segments have moved each motor, phase units.
    travel: [i64; MOTORS],
}

impl Rig {
    pub fn new(config: Config) -> Self {
        let blocks: &'static BlockStore = Box::leak(Box::new(BlockStore::new()));
        let runtime = Runtime::new();
        let stage = std::array::from_fn(|_| Box::leak(Box::new(Blend::new())));
        let queue = blocks.queue(runtime.thread(), stage).expect("first");
        let source = blocks.source(runtime.interrupt()).expect("first");
        let segments: &'static Ring<Segment, SEGMENTS> = Box::leak(Box::new(Ring::new()));
        let (fill, drain) = segments.split().expect("first");
        let dynamics = Dynamics::new(&config);
        let smooth = QueuedAction::Smooth(dynamics.spans);
        let mut rig = Rig {
            dynamics,
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
            change: None,
            segments: 0,
            leads: None,
            blends: false,
            travel: [0; MOTORS],
        };
        rig.push(Block::action(smooth, 0));
        rig.turn();
        if rig.config.has_backlash() {
            let slacks = core::array::from_fn(|m| rig.config.slack(m));
            rig.aside(Block::action(QueuedAction::Backlash(slacks), 0));
            rig.turn();
        }
        rig
    }

    /// Blends lines from here on, within this deviation, mm.
    pub fn blend(&mut self, deviation: f32) {
        self.blends = true;
        kerf::hal::imp::set_blends(true);
        let stage = self.queue.stage().expect("the host blends");
        stage.set(self.dynamics.spans, &self.dynamics);
        stage.set_deviation(deviation);
    }

    /// Queues the lines that wait to be blended.
    pub fn flush(&mut self, stops: bool) {
        self.queue.flush(stops);
    }

    pub fn free(&self) -> usize {
        self.queue.free()
    }

    /// Queues a move at a velocity in mm/s; there must be room.
    pub fn line(&mut self, to: PerAxis<Length>, velocity: f32, number: u32) {
        self.go(to, Some(Feed::PerMinute(velocity * 60.0)), number);
    }

    /// Queues a traverse.
    pub fn traverse(&mut self, to: PerAxis<Length>, number: u32) {
        self.go(to, None, number);
    }

    fn go(&mut self, to: PerAxis<Length>, feed: Option<Feed>, number: u32) {
        let blends = self.blends;
        let line =
            Line { from: &self.position, to: &to, feed, curve: None, may_merge: false, blends };
        let block = self.queue.next_line().expect("room");
        let built = self.builder.line(&line, &self.dynamics, &self.config, block);
        match built {
            Built::Nothing => {}
            Built::Parts(_) => panic!("too long for a test"),
            Built::Merge => unreachable!("it may not"),
            Built::Line(_) | Built::Blended(_) => {
                if let Some(motor) = self.leads {
                    let axis = usize::from(self.config.drives[motor]);
                    let travel = to[axis].0 - self.position[axis].0;
                    advance::refine(block, motor, self.config.ratio[motor], travel);
                }
            }
        }
        match built {
            Built::Line(entry) => {
                assert!(self.queue.push_unblended(entry, self.builder.unit(), number));
            }
            Built::Blended(begins) => self.queue.blend(self.builder.unit(), number, begins),
            _ => {}
        }
        self.position = to;
    }

    /// Makes the next move begin at rest.
    pub fn stop(&mut self) {
        self.builder.stopped();
    }

    pub fn push(&mut self, block: Block) {
        self.builder.stopped();
        assert!(self.queue.push(block));
    }

    /// Queues a block at which the machine does not stop.
    pub fn aside(&mut self, block: Block) {
        assert!(self.queue.push_aside(block));
    }

    /// Asks for other overrides.
    pub fn want(&mut self, factors: Factors) {
        self.source.want(factors);
    }

    /// Passes a change of overrides to the planner.
    pub fn replan(&mut self) {
        if let Some(wanted) = self.queue.wanted() {
            self.queue.replan(wanted);
        }
    }

    /// Begins a feedhold, or ends one.
    pub fn hold(&mut self, hold: bool) {
        self.exec.set_hold(hold, &mut self.snapshot);
    }

    /// Drops all that is queued, during a hold. The next moves begin where the motors are.
    pub fn drop_all(&mut self) {
        assert!(self.snapshot.held);
        self.forget_all();
    }

    /// Drops all that is queued, wherever the motors are, after their ticks have been stopped.
    pub fn forget_all(&mut self) {
        let mut held = self.exec.drop_all(&mut self.source, &mut self.snapshot);
        let queued = || self.drain.pop().or_else(|| held.take());
        self.dda.settle(queued, &mut self.snapshot.target);
        self.pins.stopped = true;
        let steps = self.snapshot.target;
        self.travel = steps.map(|steps| i64::from(steps) * i64::from(STEP));
        self.builder.place(&steps);
        self.queue.restart();
        for (m, steps) in steps.into_iter().enumerate() {
            if let Some(length) = self.config.ratio[m].length(steps) {
                self.position[m] = length;
            }
        }
    }

    /// Runs exec once and the steppers as long as segments are queued.
    pub fn turn(&mut self) -> Step {
        let blocks = self.source.len();
        let mut segment = Segment::default();
        let step =
            self.exec.step(&mut self.source, self.pins.stopped, &mut self.snapshot, &mut segment);
        if step == Step::Segment {
            assert!(segment.ticks > 0 && segment.period > 0, "{segment:?}");
            assert!(segment.increment.iter().all(|i| *i <= 0x8000), "{segment:?}");
            self.segments += 1;
            self.add(&segment);
            if self.keep {
                let Snapshot { velocity, line, .. } = self.snapshot;
                let ahead = self.ahead();
                self.emitted.push(Emitted { segment, velocity, line, ahead });
            }
            self.fill.push(segment).expect("room");
            self.pins.stopped = false;
        }
        match step {
            Step::Override => self.change = Some(take_override(&mut self.source)),
            Step::Heat => drop(take_heat(&mut self.source)),
            _ => {}
        }
        if self.source.len() < blocks {
            self.check_block();
        }
        while !self.drain.is_empty() {
            self.tick();
        }
        if matches!(step, Step::Idle | Step::Standstill | Step::Held) {
            while !self.pins.stopped {
                self.tick();
            }
        }
        step
    }

    /// Queues `segments` segments, runs `ticks` ticks, and then stops the ticks.
    pub fn stop_short(&mut self, segments: usize, ticks: usize) {
        for _ in 0..segments {
            let mut segment = Segment::default();
            let standstill = self.pins.stopped && self.drain.is_empty();
            let out = &mut self.snapshot;
            if self.exec.step(&mut self.source, standstill, out, &mut segment) == Step::Segment {
                self.fill.push(segment).expect("room");
                self.pins.stopped = false;
            }
        }
        for _ in 0..ticks {
            if !self.pins.stopped {
                self.tick();
            }
        }
        self.forget_all();
    }

    fn add(&mut self, segment: &Segment) {
        for (m, travel) in self.travel.iter_mut().enumerate() {
            let way = i64::from(segment.increment[m]) * i64::from(segment.ticks);
            *travel += if segment.backwards & (1 << m) != 0 { -way } else { way };
        }
    }

    /// Computes [`Emitted::ahead`].
    fn ahead(&self) -> f64 {
        let of = |m: &usize| self.snapshot.steps[*m].unsigned_abs();
        let most = (0..MOTORS).max_by_key(of).expect("motors");
        let steps = f64::from(self.snapshot.steps[most]);
        let left = f64::from(self.snapshot.left / self.snapshot.length.max(1e-9)) * steps;
        let planned = f64::from(self.snapshot.target[most]) - left;
        let ahead = self.travel[most] as f64 / f64::from(STEP) - planned;
        if steps < 0.0 { -ahead } else { ahead }
    }

    /// Checks, at the end of a block, that the motors are at its end too, or at that of the sample. They may be off by
    /// half a tick, which may be a step, and by the half step of rounding.
    fn check_block(&self) {
        for (m, (travel, target)) in self.travel.iter().zip(self.snapshot.target).enumerate() {
            if self.leads == Some(m) || self.config.backlash[m] != 0 {
                continue;
            }
            let short = travel - i64::from(target) * i64::from(STEP);
            let more = if self.dynamics.spans.is_some() { STEP / 2 } else { 0 };
            let most = i64::from(STEP + more) + 3 * i64::from(PHASE_MARGIN);
            assert!(short.abs() <= most, "{short} units off at {:?}", self.snapshot);
        }
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
            assert!(idle < 1_000_000, "does not come to an end");
        }
        self.turn();
    }

    /// Returns where the motors should be.
    pub fn target(&self) -> [i64; MOTORS] {
        core::array::from_fn(|m| self.config.steps(m, &self.position).into())
    }

    /// Returns the seconds so far.
    pub fn seconds(&self) -> f64 {
        self.pins.now as f64 / 16e6
    }
}

/// Makes a position from mm.
pub fn at<const N: usize>(mm: [f64; N]) -> PerAxis<Length> {
    let mut position = [Length::ZERO; AXES];
    for (position, mm) in position.iter_mut().zip(mm) {
        *position = Length((mm * 1e4).round() as i32);
    }
    position
}
