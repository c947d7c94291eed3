//! Random jobs, and the result of running them.

use kerf::motion::block::{Body, Line};
use kerf::motion::exec::{SEGMENT_S, Step};
use kerf::motion::factors::Factors;
use kerf::motion::governor::{Governor, Stretch};
use kerf::units::{Length, PerAxis};
use proptest::prelude::*;

use crate::rig::{Config, Rig};

/// A random job.
#[derive(Clone, Debug)]
pub struct Job {
    pub config: Config,
    pub moves: Vec<Move>,
}

#[derive(Clone, Copy, Debug)]
pub struct Move {
    /// Distance along each axis, units of 0.1 um.
    pub way: [i32; 4],
    pub velocity: f32,
    /// Whether the move begins at rest.
    pub stop: bool,
    /// How often exec runs after the move has been queued.
    pub turns: u8,
}

/// What happens at random times: each event comes so many turns after the one before.
pub struct Schedule<T> {
    next: Option<(u16, T)>,
    rest: std::vec::IntoIter<(u16, T)>,
}

impl<T> Schedule<T> {
    pub fn new(events: Vec<(u16, T)>) -> Self {
        let mut rest = events.into_iter();
        Self { next: rest.next(), rest }
    }

    /// Counts a turn. Returns the event that comes before it, if one does.
    pub fn due(&mut self) -> Option<T> {
        match &mut self.next {
            Some((0, _)) => {}
            Some((left, _)) => {
                *left -= 1;
                return None;
            }
            None => return None,
        }
        let next = self.rest.next();
        std::mem::replace(&mut self.next, next).map(|(_, event)| event)
    }

    /// Whether an event is still to come.
    pub fn has_more(&self) -> bool {
        self.next.is_some()
    }
}

/// What runs a job, and does something meanwhile.
pub trait Player {
    fn rig(&mut self) -> &mut Rig;
    /// Runs exec once.
    fn turn(&mut self) -> Step;
    /// Whether something is still to be done.
    fn is_due(&self) -> bool;

    /// Runs a job to its end.
    fn play(&mut self, job: &Job) {
        for (n, step) in job.moves.iter().enumerate() {
            while self.rig().free() == 0 {
                self.turn();
            }
            let mut to = self.rig().position;
            for (to, way) in to.iter_mut().zip(step.way) {
                to.0 += way;
            }
            if step.stop {
                self.rig().stop();
            }
            self.rig().line(to, step.velocity, n as u32 + 1);
            for _ in 0..step.turns {
                if self.turn() == Step::Idle {
                    break;
                }
            }
        }
        while self.is_due() {
            self.turn();
        }
        self.rig().finish();
    }
}

pub fn decades(low: f32, high: f32) -> impl Strategy<Value = f32> {
    (0u16..=10_000).prop_map(move |n| low * (high / low).powf(f32::from(n) * 1e-4))
}

pub fn any_config() -> impl Strategy<Value = Config> {
    let accel = prop_oneof![Just(0.0), decades(20.0, 5_000.0)];
    let jerk = prop_oneof![Just(0.0), Just(1e9), decades(1e3, 1e6)];
    let axis = (decades(5.0, 300.0), accel.clone(), jerk.clone());
    let other =
        prop_oneof![3 => Just(None), 1 => (decades(5.0, 300.0), accel, jerk).prop_map(Some)];
    (axis, other, 1usize..4).prop_map(|((v, a, j), other, axis)| {
        let mut config = Config::new(v, a, j);
        if let Some((v, a, j)) = other {
            (config.velocity[axis], config.accel[axis], config.jerk[axis]) = (v, a, j);
        }
        config
    })
}

pub fn any_move(size: f32) -> impl Strategy<Value = Move> {
    let way = prop_oneof![
        2 => (-1.0f32..1.0, -1.0f32..1.0).prop_map(|(x, y)| [x, y, 0.0, 0.0]),
        1 => (-1.0f32..1.0, 0usize..4).prop_map(|(x, m)| {
            let mut way = [0.0; 4];
            way[m] = x;
            way
        }),
        1 => prop::array::uniform4(-1.0f32..1.0),
    ];
    let turns = prop_oneof![4 => Just(0u8), 2 => 0u8..6, 1 => Just(255)];
    let stop = prop::bool::weighted(0.05);
    (way, decades(0.01, 1.0), decades(1.0, 300.0), stop, turns).prop_map(
        move |(way, part, velocity, stop, turns)| Move {
            way: way.map(|w| (w * part * size * 1e4) as i32),
            velocity,
            stop,
            turns,
        },
    )
}

/// Moves with sharp corners, and curves of short moves.
pub fn any_moves() -> impl Strategy<Value = Vec<Move>> {
    let rough = prop_oneof![Just(0.05f32), Just(1.0), Just(30.0)]
        .prop_flat_map(|size| prop::collection::vec(any_move(size), 1..40));
    let curve =
        (decades(0.02, 1.0), 0.0f32..0.3, 0.0f32..6.3, decades(5.0, 200.0), 0u8..4, 20usize..200)
            .prop_map(|(length, bend, start, velocity, turns, count)| {
                let step = |n: usize| {
                    let angle = start + bend * n as f32;
                    let way = [angle.cos() * length, angle.sin() * length, 0.0, 0.0];
                    Move { way: way.map(|w| (w * 1e4) as i32), velocity, stop: false, turns }
                };
                (0..count).map(step).collect()
            });
    prop_oneof![2 => rough, 1 => curve]
}

pub fn any_job() -> impl Strategy<Value = Job> {
    (any_config(), any_moves()).prop_map(|(config, moves)| Job { config, moves })
}

/// Runs a job and returns its rig.
pub fn run(job: &Job) -> Rig {
    let mut rig = Rig::new(job.config.clone());
    for (n, step) in job.moves.iter().enumerate() {
        let mut to: PerAxis<Length> = rig.position;
        for (to, way) in to.iter_mut().zip(step.way) {
            to.0 += way;
        }
        let mut patience = 0;
        while rig.free() == 0 {
            rig.turn();
            patience += 1;
            assert!(patience < 10_000_000, "stuck");
        }
        if step.stop {
            rig.stop();
        }
        rig.line(to, step.velocity, n as u32 + 1);
        for _ in 0..step.turns {
            if rig.turn() == Step::Idle {
                break;
            }
        }
    }
    rig.finish();
    rig
}

/// A stretch of motion that the governor has planned, with the data of its block.
#[derive(Clone, Copy, Debug)]
pub struct Planned {
    /// The number of its block, from 1.
    pub line: u32,
    pub length: f64,
    /// Cruise velocity under the override in force.
    pub cruise: f64,
    /// Cruise velocity under the highest possible override.
    pub top: f64,
    /// The velocity that the corner at its start allows.
    pub corner: f64,
    pub accel: f64,
    pub stretch: Stretch,
    pub before: f64,
    pub after: f64,
    /// Time at the end of the stretch, and the distance along the path by then, both from the beginning of the job.
    pub clock: f64,
    pub place: f64,
}

/// Runs a job through queue and governor alone.
pub fn plan(job: &Job) -> Vec<Planned> {
    plan_held(job, |_, _| false)
}

/// Runs a job with feedholds through queue and governor alone. Before each stretch `held` says whether there is a
/// feedhold; it gets the number of stretches so far and whether the machine stands still. At rest it is asked again
/// until it says no.
pub fn plan_held(job: &Job, held: impl FnMut(usize, bool) -> bool) -> Vec<Planned> {
    plan_changed(job, held, |_, _| {})
}

/// As [`plan_held`]. In addition `change` is called before each stretch, with the number of stretches so far.
pub fn plan_changed(
    job: &Job,
    held: impl FnMut(usize, bool) -> bool,
    change: impl FnMut(usize, &mut Rig),
) -> Vec<Planned> {
    plan_with(job, held, change, |_| Pressed::default())
}

/// How the governor is asked.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pressed {
    /// Stretches are twice as long, because CPU time is short.
    pub coarse: bool,
    /// Stretches end where samples of this many stretches do, and blocks may end within.
    pub sampled: u8,
}

/// Runs a job through queue and governor alone. `pressed` says before each stretch how little CPU time is left.
pub fn plan_pressed(job: &Job, pressed: impl FnMut(usize) -> Pressed) -> Vec<Planned> {
    plan_with(job, |_, _| false, |_, _| {}, pressed)
}

fn plan_with(
    job: &Job,
    mut held: impl FnMut(usize, bool) -> bool,
    mut change: impl FnMut(usize, &mut Rig),
    mut pressed: impl FnMut(usize) -> Pressed,
) -> Vec<Planned> {
    let mut rig = Rig::new(job.config.clone());
    let mut governor = Governor::new();
    let mut running: Option<(Line, u32, f32)> = None;
    let mut version = 0;
    // What is left of the sample, s.
    let mut room = 0.0;
    let mut planned: Vec<Planned> = Vec::new();
    let mut step = |rig: &mut Rig| -> bool {
        let Some(block) = rig.source.oldest() else {
            assert!(running.is_none());
            // The velocity that may change to zero at once.
            let jump = |p: &Planned| p.accel as f32;
            let most = 1e-3 + planned.last().map_or(0.0, jump) * SEGMENT_S;
            let velocity = governor.velocity();
            assert!(velocity <= most, "the queue ends at {velocity}");
            governor.stop();
            return false;
        };
        let Body::Line(line) = block.body else { panic!("lines only") };
        let (_, number, left) = *running.get_or_insert_with(|| {
            rig.source.enter();
            version = rig.source.version().wrapping_sub(1);
            governor.begin(line.accel.get());
            (line, block.line(), line.extent.length())
        });
        change(planned.len(), rig);
        if rig.source.version() != version {
            version = rig.source.version();
            if rig.source.take_changed() {
                governor.change_feed();
            }
        }
        let cruise = rig.source.cruise();
        let headroom = rig.source.headroom();
        let before = governor.velocity().into();
        let mut hold = held(planned.len(), governor.is_at_rest());
        while hold && governor.is_at_rest() {
            hold = held(planned.len(), true);
        }
        let Pressed { coarse, sampled } = pressed(planned.len());
        match (coarse, sampled) {
            (_, 1..) => {
                let full = f32::from(sampled) * SEGMENT_S;
                if room < 1e-3 * SEGMENT_S {
                    room = full;
                }
                room = room.min(full);
                governor.take_exactly(room);
            }
            (true, _) if !hold => governor.take_long(2.0 * SEGMENT_S),
            _ => governor.take(SEGMENT_S),
        }
        let stretch = match (hold, sampled) {
            (true, _) => governor.halt(left, headroom),
            (_, 0) => governor.stretch(left, cruise, headroom),
            _ => governor.part(left, cruise, headroom),
        };
        if sampled > 0 {
            assert!(stretch.seconds <= room * 1.000_01, "{stretch:?} of {room}");
            room -= stretch.seconds;
        }
        let (clock, place) = planned.last().map_or((0.0, 0.0), |p| (p.clock, p.place));
        let clock = clock + f64::from(stretch.seconds);
        let place = place + f64::from(stretch.distance);
        planned.push(Planned {
            clock,
            place,
            line: number,
            length: line.extent.length().into(),
            cruise: cruise.into(),
            top: line.velocity(&Factors { feed: 2.0, traverse: 1.0 }).into(),
            corner: line.entry.get().into(),
            accel: line.accel.get().into(),
            stretch,
            before,
            after: governor.velocity().into(),
        });
        assert!(planned.len() < 1_000_000, "does not come to an end: {:?}", planned.last());
        if stretch.ends {
            running = None;
            rig.source.release();
        } else {
            running = Some((line, number, left - stretch.distance));
        }
        true
    };
    for (n, next) in job.moves.iter().enumerate() {
        let mut to: PerAxis<Length> = rig.position;
        for (to, way) in to.iter_mut().zip(next.way) {
            to.0 += way;
        }
        while rig.free() == 0 {
            step(&mut rig);
        }
        if next.stop {
            rig.stop();
        }
        rig.line(to, next.velocity, n as u32 + 1);
        for _ in 0..next.turns {
            if !step(&mut rig) {
                break;
            }
        }
    }
    while step(&mut rig) {}
    planned
}
