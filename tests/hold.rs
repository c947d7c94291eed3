//! Random jobs with feedholds at random times: they come to rest within the limits, go on, and end exactly. When the
//! queue is dropped the motors stay where they are.

use kerf::boards::MOTORS;
use kerf::dda::SEGMENTS;
use kerf::motion::block::{Block, Outputs, QueuedAction};
use kerf::motion::exec::Step;
use proptest::prelude::*;

use crate::cases::cases;
use crate::jobs::{Job, Player, Schedule, any_job, plan_held};
use crate::keeps::check_limits;
use crate::rig::{Config, Rig, at};

/// Most turns of exec that a stop takes under any limits: 300 mm/s at 20 mm/s^2, in stretches of 2 ms, with any
/// number of blocks.
const PATIENCE: usize = 20_000;

/// The holds: turns of exec since the last one, and whether the queue is dropped.
type Holds = Vec<(u16, bool)>;

fn any_holds(drops: bool) -> impl Strategy<Value = Holds> {
    let drop = if drops { prop::bool::weighted(0.3).boxed() } else { Just(false).boxed() };
    let after = prop_oneof![2 => 0u16..30, 1 => 0u16..1_000];
    prop::collection::vec((after, drop), 1..20)
}

/// Runs a job with holds.
struct Holder {
    rig: Rig,
    holds: Schedule<bool>,
}

impl Holder {
    fn new(job: &Job, holds: &Holds) -> Self {
        Self { rig: Rig::new(job.config.clone()), holds: Schedule::new(holds.clone()) }
    }

    fn hold(&mut self, drop: bool) {
        let before = self.rig.pins.position;
        let fast = self.rig.snapshot.velocity;
        self.rig.hold(true);
        let mut turns = 0;
        while self.rig.turn() != Step::Held {
            turns += 1;
            assert!(turns < PATIENCE, "it freezes at {:?}", self.rig.snapshot);
        }
        assert!(self.rig.pins.stopped && self.rig.snapshot.held);
        assert!(fast > 0.0 || turns > 0 || self.rig.pins.position == before);
        assert_eq!(self.rig.turn(), Step::Held, "it stays");
        if drop {
            self.rig.drop_all();
            let there = self.rig.snapshot.target.map(i64::from);
            assert_eq!(self.rig.pins.position, there, "where the pulses have put it");
            assert!(self.rig.source.is_empty());
        }
        self.rig.hold(false);
        assert!(!self.rig.snapshot.held);
    }
}

impl Player for Holder {
    fn rig(&mut self) -> &mut Rig {
        &mut self.rig
    }

    fn turn(&mut self) -> Step {
        if let Some(drop) = self.holds.due() {
            self.hold(drop);
        }
        self.rig.turn()
    }

    fn is_due(&self) -> bool {
        self.holds.has_more()
    }
}

fn run(job: &Job, holds: &Holds) -> Rig {
    let mut holder = Holder::new(job, holds);
    holder.play(job);
    holder.rig
}

/// Runs a job that is stopped by force: after some turns of exec, with some segments queued, some ticks later.
fn run_stopped(job: &Job, stops: &[(u16, usize, usize)]) {
    let mut rig = Rig::new(job.config.clone());
    rig.keep = false;
    let mut stops = stops.iter();
    let mut next = stops.next();
    for (n, step) in job.moves.iter().enumerate() {
        if rig.free() == 0 {
            rig.finish();
        }
        let mut to = rig.position;
        for (to, way) in to.iter_mut().zip(step.way) {
            to.0 += way;
        }
        rig.line(to, step.velocity, n as u32 + 1);
        let Some((turns, segments, ticks)) = next else { continue };
        (0..*turns).for_each(|_| _ = rig.turn());
        rig.stop_short(*segments, *ticks);
        let there = rig.snapshot.target.map(i64::from);
        assert_eq!(rig.pins.position, there, "{turns} turns, {segments} segments, {ticks} ticks");
        assert!(rig.source.is_empty() && rig.snapshot.velocity == 0.0);
        next = stops.next();
    }
    rig.finish();
    assert_eq!(rig.pins.position, rig.target());
}

proptest! {
    #![proptest_config(cases(1_500))]

    #[test]
    fn wherever_it_is_stopped_the_position_is_known_to_the_step(
        job in any_job(),
        stops in prop::collection::vec((0u16..40, 0..SEGMENTS, 0usize..1_000), 1..20),
    ) {
        run_stopped(&job, &stops);
    }

    #[test]
    fn any_job_with_holds_ends_on_its_steps(job in any_job(), holds in any_holds(false)) {
        let rig = run(&job, &holds);
        prop_assert_eq!(rig.pins.position, rig.target());
    }

    #[test]
    fn what_is_dropped_leaves_the_motors_where_they_are(job in any_job(), holds in any_holds(true)) {
        let rig = run(&job, &holds);
        prop_assert_eq!(rig.pins.position, rig.target());
    }

    #[test]
    fn any_job_with_holds_keeps_its_limits(job in any_job(), holds in any_holds(false)) {
        let mut holds = Schedule::new(holds);
        let mut holding = false;
        let planned = plan_held(&job, |_, at_rest| {
            if holding && at_rest {
                holding = false;
            } else if holds.due().is_some() {
                holding = true;
            }
            holding
        });
        check_limits(&planned);
    }
}

/// A rig that has run for some segments of a long move.
fn on_its_way(jerk: f32, segments: usize) -> Rig {
    let mut rig = Rig::new(Config::new(100.0, 1_000.0, jerk));
    rig.line(at([200.0, 70.0]), 80.0, 1);
    for _ in 0..segments {
        while rig.turn() == Step::Again {}
    }
    rig
}

fn until_held(rig: &mut Rig) {
    rig.hold(true);
    while rig.turn() != Step::Held {}
}

#[test]
fn a_dwell_pauses() {
    let mut rig = Rig::new(Config::new(100.0, 1_000.0, 0.0));
    rig.push(Block::action(QueuedAction::Dwell(500), 1));
    (0..100).for_each(|_| _ = rig.turn());
    until_held(&mut rig);
    let before = rig.seconds();
    (0..100).for_each(|_| assert_eq!(rig.turn(), Step::Held));
    assert_eq!(rig.seconds(), before);
    rig.hold(false);
    rig.finish();
    assert!((rig.seconds() - 0.5).abs() < 0.005, "{} s", rig.seconds());
}

#[test]
fn nothing_begins_in_a_hold() {
    for action in [
        QueuedAction::Dwell(100),
        QueuedAction::Outputs(Outputs { on: 1, speed: 0.0 }),
        QueuedAction::ProgramStop,
    ] {
        let mut rig = Rig::new(Config::new(100.0, 1_000.0, 0.0));
        rig.line(at([1.0]), 50.0, 1);
        rig.push(Block::action(action, 2));
        // So late that the plan itself comes to rest.
        while rig.source.len() > 1 {
            rig.turn();
        }
        until_held(&mut rig);
        assert_eq!(rig.source.len(), 1, "{action:?}");
        assert_eq!((rig.snapshot.outputs, rig.snapshot.target[0]), (0, 80));
        rig.hold(false);
        rig.finish();
        assert!(rig.source.is_empty());
    }
}

#[test]
fn what_was_said_of_positions_before_the_first_move_holds() {
    for moved in [false, true] {
        let mut rig = Rig::new(Config::new(100.0, 1_000.0, 0.0));
        rig.hold(true);
        if moved {
            rig.line(at([1.0]), 50.0, 1);
        }
        rig.push(Block::action(QueuedAction::SetPosition([7; MOTORS]), 2));
        until_held(&mut rig);
        rig.pins.position = [if moved { 0 } else { 7 }; MOTORS];
        rig.drop_all();
        assert_eq!(rig.snapshot.target.map(i64::from), rig.pins.position);
    }
}

#[test]
fn it_stops_in_the_middle_and_goes_on_to_the_end() {
    for jerk in [0.0, 20_000.0] {
        for segments in [1, 3, 40, 200, 600] {
            let mut rig = on_its_way(jerk, segments);
            until_held(&mut rig);
            let there = rig.pins.position;
            assert!(there[0] >= 0 && there[0] < 16_000, "{there:?}");
            // The motors are on the line.
            assert!((there[1] * 20 - there[0] * 7).abs() <= 40, "{there:?}");
            rig.hold(false);
            rig.finish();
            assert_eq!(rig.pins.position, [16_000, 5_600, 0, 0]);
        }
    }
}
