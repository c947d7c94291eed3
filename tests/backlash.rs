//! Backlash compensation: random jobs, with holds, flushes and stops at once, on machines whose axes have play.

use kerf::boards::MOTORS;
use kerf::boards::inputs::{PROBE, X_MIN};
use kerf::config::StepRatio;
use kerf::dda::STEP;
use kerf::hal::imp::Machine;
use kerf::motion::exec::Step;
use kerf::motion::factors::Factors;
use kerf::units::Length;
use proptest::prelude::*;

use crate::cases::cases;
use crate::jobs::{Job, Player, Schedule, any_job};
use crate::rig::{Config, Rig, at};

/// Most turns of exec that a stop takes.
const PATIENCE: usize = 20_000;

/// The steps by which motors are off their positions.
fn off(rig: &Rig) -> [i64; MOTORS] {
    let positions = rig.snapshot.positions();
    core::array::from_fn(|m| rig.pins.position[m] - i64::from(positions[m]))
}

/// An axis that its motor pushes by either side of a gap. It has been pushed forwards at last.
#[derive(Clone, Copy)]
struct Axis {
    place: i64,
    gap: i64,
}

impl Axis {
    fn follow(&mut self, motor: i64) {
        self.place = self.place.clamp(motor, motor + self.gap);
    }
}

/// A job, and what happens to it.
#[derive(Clone, Debug)]
struct Trial {
    job: Job,
    backlash: [u16; MOTORS],
    /// After this many turns of exec each.
    events: Vec<(u16, Event)>,
}

#[derive(Clone, Copy, Debug)]
enum Event {
    /// A hold, after which motion goes on.
    Hold,
    /// A hold, in which the queue is dropped.
    Flush,
    /// A stop at once, after so many segments and ticks.
    Cut(usize, usize),
    /// Another feed.
    Feed(u8),
}

fn any_trial(most: u16) -> impl Strategy<Value = Trial> {
    let event = prop_oneof![
        3 => Just(Event::Hold),
        1 => Just(Event::Flush),
        1 => (0usize..6, 0usize..900).prop_map(|(segments, ticks)| Event::Cut(segments, ticks)),
        1 => (2u8..20).prop_map(Event::Feed),
    ];
    let after = prop_oneof![2 => 0u16..30, 1 => 0u16..600];
    let events = prop::collection::vec((after, event), 0..12);
    let width = || prop_oneof![1 => Just(0), 3 => 0..most];
    let backlash = (width(), width(), width(), width()).prop_map(<[u16; MOTORS]>::from);
    (any_job(), backlash, events).prop_map(|(mut job, backlash, events)| {
        job.config.backlash = backlash;
        // Without a limit there is nothing to keep.
        job.config.accel.iter_mut().filter(|accel| **accel == 0.0).for_each(|accel| *accel = 500.0);
        Trial { job, backlash, events }
    })
}

struct Tracker {
    rig: Rig,
    axes: [Axis; MOTORS],
    seen: usize,
    events: Schedule<Event>,
}

impl Tracker {
    fn new(trial: &Trial) -> Self {
        let mut rig = Rig::new(trial.job.config.clone());
        rig.keep = false;
        rig.pins.keep_trail = true;
        // Every motor's direction is known, and its axis touches it.
        rig.line(at([1.0; 4]), 20.0, 1);
        rig.finish();
        let position = rig.pins.position;
        let gap = trial.backlash.map(i64::from);
        let axes = core::array::from_fn(|m| Axis { place: position[m], gap: gap[m] });
        Self { rig, axes, seen: 0, events: Schedule::new(trial.events.clone()) }
    }

    fn follow(&mut self) {
        let trail = &self.rig.pins.trail;
        for (motors, _) in &trail[self.seen..] {
            for (axis, motor) in self.axes.iter_mut().zip(motors) {
                axis.follow(*motor);
            }
        }
        self.seen = trail.len();
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Feed(tenths) => {
                self.rig.want(Factors { feed: f32::from(tenths) * 0.1, traverse: 1.0 });
            }
            Event::Cut(segments, ticks) => {
                self.rig.stop_short(segments, ticks);
                self.check();
                // Where the axes are in their gaps is not known then: they are taken to be where positions say.
                let target = self.rig.snapshot.target;
                for (axis, place) in self.axes.iter_mut().zip(target) {
                    axis.place = place.into();
                }
                self.seen = self.rig.pins.trail.len();
            }
            Event::Hold | Event::Flush => {
                self.rig.hold(true);
                let mut turns = 0;
                while self.rig.turn() != Step::Held {
                    turns += 1;
                    assert!(turns < PATIENCE, "it freezes at {:?}", self.rig.snapshot);
                }
                self.follow();
                // The end may be in the middle between two steps.
                self.check_rest(1);
                if matches!(event, Event::Flush) {
                    self.rig.drop_all();
                    self.check_rest(0);
                }
                self.rig.hold(false);
            }
        }
    }

    /// At a standstill a motor is off by its width or not at all, `but` for so many steps.
    fn check_rest(&self, but: i64) {
        for (m, off) in off(&self.rig).into_iter().enumerate() {
            let gap = self.axes[m].gap;
            let is_near = |at: i64| (off - at).abs() <= but;
            assert!(is_near(0) || is_near(-gap), "motor {m}: {off} of {gap}");
        }
    }

    /// Goes far enough in either direction, and checks that the axes are where their position says.
    fn check_axes(&mut self) {
        for way in [20_000, -20_000] {
            let to = self.rig.position.map(|place| Length(place.0 + way));
            self.rig.line(to, 50.0, 1);
            self.rig.finish();
            self.follow();
            self.check_rest(0);
            for (axis, there) in self.axes.iter().zip(self.rig.snapshot.target) {
                assert_eq!(axis.place, i64::from(there));
            }
        }
    }

    fn check(&self) {
        for (m, off) in off(&self.rig).into_iter().enumerate() {
            assert!((-self.axes[m].gap..=0).contains(&off), "motor {m} is off by {off}");
        }
    }
}

impl Player for Tracker {
    fn rig(&mut self) -> &mut Rig {
        &mut self.rig
    }

    fn turn(&mut self) -> Step {
        if let Some(event) = self.events.due() {
            self.happen(event);
        }
        let step = self.rig.turn();
        self.rig.replan();
        self.follow();
        step
    }

    fn is_due(&self) -> bool {
        self.events.has_more()
    }
}

proptest! {
    #![proptest_config(cases(2_000))]

    /// Positions are exact at each standstill, and so are the axes. A motor is off its position by its backlash in one
    /// direction, and not at all in the other.
    #[test]
    fn axes_are_where_positions_say(trial in any_trial(60)) {
        let mut player = Tracker::new(&trial);
        player.play(&trial.job);
        player.follow();
        let target = player.rig.snapshot.target.map(i64::from);
        prop_assert_eq!(target, player.rig.target());
        player.check_axes();
    }

    /// Without backlash each segment is as if nothing had been said of it.
    #[test]
    fn no_backlash_changes_nothing(job in any_job()) {
        use kerf::motion::backlash::Slack;
        use kerf::motion::block::{Block, QueuedAction};
        let told = |tells: bool| {
            let mut rig = Rig::new(job.config.clone());
            if tells {
                let none = [Slack { width: 0, pace: 9 }; MOTORS];
                rig.aside(Block::action(QueuedAction::Backlash(none), 0));
                rig.turn();
            }
            for (n, step) in job.moves.iter().enumerate() {
                if rig.free() == 0 {
                    rig.finish();
                }
                let mut to = rig.position;
                for (to, way) in to.iter_mut().zip(step.way) {
                    to.0 += way;
                }
                rig.line(to, step.velocity, n as u32 + 1);
            }
            rig.finish();
            rig.emitted.iter().map(|emitted| emitted.segment).collect::<Vec<_>>()
        };
        prop_assert_eq!(told(false), told(true));
    }
}

/// A machine with 1,600 steps a mm and backlash of 0.05 mm on two axes.
fn fine(accel: f32, jerk: f32, backlash: u16) -> Config {
    let mut config = Config::new(100.0, accel, jerk);
    config.ratio = [StepRatio { num: 4, den: 25 }; MOTORS];
    config.backlash = [backlash, backlash, 0, 0];
    config
}

/// Returns where a motor is after each segment, mm, and when, s.
fn way(rig: &Rig, m: usize) -> Vec<(f64, f64)> {
    let (mut at, mut now) = (0.0, 0.0);
    let mut way = vec![(0.0, 0.0)];
    for emitted in &rig.emitted {
        let segment = &emitted.segment;
        let far = f64::from(segment.increment[m]) * f64::from(segment.ticks) / f64::from(STEP);
        at += if segment.backwards & 1 << m != 0 { -far } else { far } / 1_600.0;
        now += f64::from(segment.ticks) * f64::from(segment.period) / 16e6;
        way.push((now, at));
    }
    way
}

/// Returns the greatest acceleration of a motor over windows of 10 ms, mm/s^2.
fn acceleration(rig: &Rig, m: usize) -> f64 {
    const WINDOW: f64 = 0.01;
    let way = way(rig, m);
    let mut next = 0;
    let mut place = |time: f64| {
        while next + 2 < way.len() && way[next + 1].0 < time {
            next += 1;
        }
        let ((t0, x0), (t1, x1)) = (way[next], way[next + 1]);
        x0 + (x1 - x0) * ((time - t0) / (t1 - t0)).min(1.0)
    };
    let last = way.last().expect("a start").0;
    let places: Vec<f64> = (0..(last / 1e-3) as usize).map(|ms| place(ms as f64 * 1e-3)).collect();
    let changes = places.windows(21).map(|w| (w[20] - 2.0 * w[10] + w[0]) / (WINDOW * WINDOW));
    changes.map(f64::abs).fold(0.0, f64::max)
}

/// Returns the ends of lines of a raster, and of circles.
fn raster() -> Vec<[f64; 2]> {
    (0..24).map(|n| [if n % 4 < 2 { 10.0 } else { 0.0 }, f64::from(n / 2) * 0.5]).collect()
}

fn circle(radius: f64, chord: f64) -> Vec<[f64; 2]> {
    let count = (std::f64::consts::TAU * radius / chord) as usize;
    let at = |n: usize| {
        let angle = n as f64 / count as f64 * std::f64::consts::TAU;
        [radius * (1.0 - angle.cos()), radius * angle.sin()]
    };
    (1..=2 * count).map(at).collect()
}

fn run(config: &Config, places: &[[f64; 2]], velocity: f32) -> Rig {
    let mut rig = Rig::new(config.clone());
    for (n, place) in places.iter().enumerate() {
        while rig.free() == 0 {
            rig.turn();
        }
        rig.line(at(*place), velocity, n as u32 + 1);
    }
    rig.finish();
    rig
}

/// The acceleration of an axis stays within its limit during take-ups; the time it takes is shown by `--nocapture`.
#[test]
fn take_ups_keep_the_acceleration() {
    for (accel, jerk) in [(500.0, 18_519.0), (200.0, 4_630.0), (1_000.0, 1e9)] {
        for (name, places, velocity) in [
            ("raster", raster(), 80.0),
            ("circle 25", circle(25.0, 0.5), 25.0),
            ("circle 25", circle(25.0, 0.5), 90.0),
            ("circle 2", circle(2.0, 0.1), 25.0),
            (
                "zigzag",
                (0..60).map(|n| [f64::from(n % 2) * 0.3, f64::from(n) * 0.1]).collect(),
                50.0,
            ),
        ] {
            for backlash in [0, 8, 80, 320] {
                let rig = run(&fine(accel, jerk, backlash), &places, velocity);
                let most = acceleration(&rig, 0).max(acceleration(&rig, 1)) / f64::from(accel);
                println!(
                    "A {accel} {name} F {velocity} b {:.3}: acceleration {most:.3}, {:.3} s",
                    f64::from(backlash) / 1_600.0,
                    rig.seconds()
                );
                // Corners within 16 ms of each other add up, with and without backlash.
                let bound = if name == "zigzag" || backlash == 0 { 1.4 } else { 1.03 };
                assert!(most < bound, "{name} {accel} {backlash}: {most}");
            }
        }
    }
}

/// Where an axis with a gap is, at each pulse of its motor.
fn axis(rig: &Rig, m: usize, gap: i64) -> Vec<(i64, u64)> {
    let mut axis = Axis { place: 0, gap };
    let step = |(motors, now): &([i64; MOTORS], u64)| {
        axis.follow(motors[m]);
        (axis.place, *now)
    };
    rig.pins.trail.iter().map(step).collect()
}

/// Forth and back 100 times: the axis reaches both ends each time.
#[test]
fn both_ends_are_reached_each_time() {
    let config = fine(500.0, 18_519.0, 80);
    let mut rig = Rig::new(config.clone());
    rig.pins.keep_trail = true;
    let mut place = Axis { place: 0, gap: 80 };
    for turn in 0..200u32 {
        let to = if turn % 2 == 0 { 5.0 } else { 0.0 };
        rig.line(at([to]), 50.0, turn + 1);
        if turn % 3 == 0 {
            // A standstill at every third end; the others are passed.
            rig.finish();
            rig.pins.trail.iter().for_each(|(motors, _)| place.follow(motors[0]));
            rig.pins.trail.clear();
            assert_eq!(place.place, rig.target()[0], "{turn}");
            assert_eq!(i64::from(rig.snapshot.target[0]), rig.target()[0]);
        }
    }
}

/// On a circle an axis is slow where it reverses: it is off its place by less than half its backlash.
#[test]
fn circles_are_round_but_for_the_take_up() {
    for (radius, velocity) in [(25.0, 25.0), (25.0, 100.0), (2.0, 25.0)] {
        let places = circle(radius, 0.05_f64.max(radius / 100.0));
        let config = fine(500.0, 18_519.0, 80);
        let mut rig = Rig::new(config);
        rig.pins.keep_trail = true;
        let (mut n, mut done) = (0, false);
        while !done {
            if n < places.len() && rig.free() > 0 {
                rig.line(at(places[n]), velocity, n as u32 + 1);
                n += 1;
            } else {
                done = rig.turn() == Step::Idle && n == places.len();
            }
        }
        let (x, y) = (axis(&rig, 0, 80), axis(&rig, 1, 80));
        let off = |((x, _), (y, _)): (&(i64, u64), &(i64, u64))| {
            let (x, y) = (*x as f64 / 1_600.0 - radius, *y as f64 / 1_600.0);
            (x.hypot(y) - radius).abs()
        };
        let worst = x.iter().zip(&y).map(off).fold(0.0, f64::max);
        println!("R {radius} F {velocity}: off by {worst:.4} mm at most");
        // Half the backlash.
        assert!(worst < 0.025, "{worst} mm");
        assert_eq!(rig.snapshot.target.map(i64::from), rig.target());
    }
}

/// A million reversals, in lines that are longer and shorter than a take-up.
#[test]
fn a_million_reversals_do_not_drift() {
    let count = if std::env::var_os("KERF_LONG").is_some() { 1_000_000 } else { 20_000 };
    let mut config = Config::new(300.0, 5_000.0, 1e6);
    config.backlash = [5, 0, 0, 0];
    let mut rig = Rig::new(config);
    rig.keep = false;
    for turn in 0..count {
        while rig.free() == 0 {
            rig.turn();
        }
        let to = if turn % 2 == 0 { 0.05 * f64::from(turn % 7 + 1) } else { 0.0 };
        rig.line(at([to]), 100.0, turn % 1_000 + 1);
    }
    rig.finish();
    assert_eq!(rig.snapshot.target, [0; MOTORS]);
    assert_eq!(rig.pins.position, [-5, 0, 0, 0]);
}

/// Steps of a mm with the default setup of motors, and the backlash of the machine.
const STEPS: i64 = 1_280;
const GAP: i64 = 64;

/// A machine whose X and Z have gaps, with a switch on X and a probe on Z.
struct Rigged {
    machine: Machine,
    x: Axis,
    z: Axis,
    heard: String,
}

impl Rigged {
    fn new() -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        let axis = Axis { place: 0, gap: GAP };
        let mut rigged = Self { machine, x: axis, z: axis, heard: String::new() };
        rigged.say("{xbl:0.05,zbl:0.05,xlv:20,xsv:200,xjh:2000}");
        // The motors touch their axes forwards.
        rigged.say("g91 g1 f100 x0.1 z0.1");
        rigged.rest();
        rigged
    }

    fn run(&mut self, ms: u64) {
        for _ in 0..ms {
            self.machine.run_ms(1);
            let [x, _, z, ..] = self.machine.emitted().position;
            self.x.follow(x);
            self.z.follow(z);
            self.machine.set_input(X_MIN, self.x.place <= -500);
            self.machine.set_input(PROBE, self.z.place <= -1_000);
        }
        self.heard += &String::from_utf8(self.machine.received()).expect("ASCII");
    }

    fn say(&mut self, line: &str) {
        self.machine.send(format!("{line}\n").as_bytes());
        self.run(100);
    }

    /// Runs until nothing moves any more.
    fn rest(&mut self) {
        let mut still = 0;
        while still < 5 {
            let before = self.machine.emitted().position;
            self.run(100);
            still = if self.machine.emitted().position == before { still + 1 } else { 0 };
        }
    }

    /// Returns the position that is reported for an axis, in steps.
    fn told(&mut self, axis: &str) -> f64 {
        self.heard.clear();
        self.say(&format!("{{mpo{axis}:n}}"));
        let at = self.heard.find(&format!("\"mpo{axis}\":")).expect(&self.heard) + 7;
        let number: String =
            self.heard[at..].chars().take_while(|c| !matches!(c, '}' | ',')).collect();
        number.parse::<f64>().expect(&number) * STEPS as f64
    }
}

/// Whatever an axis has done before, a probe finds the same place, and the axis is where its position says.
#[test]
fn probes_find_the_same_place_from_everywhere() {
    let mut rigged = Rigged::new();
    for way in ["z-0.3", "z0.2", "z0.01", "z-0.01", "z-0.2 x1", "z0.4 x-1"] {
        rigged.say(&format!("g91 g0 {way}"));
        rigged.rest();
        rigged.heard.clear();
        rigged.say("g90 g38.2 z-3 f24");
        rigged.rest();
        // The axis is at the contact, from below.
        assert!((-1_004..=-997).contains(&rigged.z.place), "{way}: {}", rigged.z.place);
        let told = rigged.told("z");
        assert!((told - rigged.z.place as f64).abs() < 3.0, "{way}: {told} {}", rigged.z.place);
        rigged.say("g90 g0 z0");
        rigged.rest();
        assert_eq!(rigged.z.place, 0, "{way}");
    }
}

/// Homing finds the switch, and X is then where its position says, in both directions.
#[test]
fn homing_ends_at_the_place_from_everywhere() {
    let mut rigged = Rigged::new();
    for way in ["x0.2", "x-0.2", "x0.01", "x1"] {
        rigged.say(&format!("g91 g0 {way}"));
        rigged.rest();
        rigged.heard.clear();
        rigged.say("g28.2 x0");
        rigged.rest();
        assert!(!rigged.heard.contains("\"er\""), "{}", rigged.heard);
        // It opens a step beyond -500; 1 mm from there it is at 0.
        let zero = rigged.x.place;
        assert!((-500 + STEPS - zero).abs() <= 3, "{way}: {zero}");
        for (to, place) in [("x1", STEPS), ("x-0.5", -STEPS / 2), ("x0", 0), ("x2", 2 * STEPS)] {
            rigged.say(&format!("g90 g0 {to}"));
            rigged.rest();
            assert_eq!(rigged.x.place, zero + place, "{way} {to}");
        }
    }
}
