//! Random jobs with overrides that change at random times: they end exactly, within the limits of the machine, and
//! what is queued follows at once.

use kerf::gcode::overrides::{Change, Override};
use kerf::motion::block::{Block, QueuedAction};
use kerf::motion::exec::Step;
use kerf::motion::factors::Factors;
use proptest::prelude::*;

use crate::cases::cases;
use crate::jobs::{Job, Planned, Schedule, any_job, plan_changed};
use crate::keeps::{check_changes, check_corners};
use crate::rig::{Config, Rig, at};

/// An event; each comes some turns after the event before it.
#[derive(Clone, Copy, Debug)]
enum Op {
    Feed(f32),
    Replan,
    Hold,
}

fn any_deeds() -> impl Strategy<Value = Vec<(u16, Op)>> {
    let factor = prop_oneof![Just(1.0f32), Just(2.0), Just(0.3), 0.3f32..2.0];
    let op = prop_oneof![
        3 => factor.prop_map(Op::Feed),
        3 => Just(Op::Replan),
        1 => Just(Op::Hold),
    ];
    let after = prop_oneof![2 => 0u16..20, 1 => 0u16..500];
    prop::collection::vec((after, op), 1..30)
}

fn feed(factor: f32) -> Factors {
    Factors { feed: factor, ..Factors::ONE }
}

fn run(job: &Job, ops: &[(u16, Op)]) -> Rig {
    let mut rig = Rig::new(job.config.clone());
    let mut script = Schedule::new(ops.to_vec());
    let mut turn = |rig: &mut Rig| {
        match script.due() {
            Some(Op::Feed(factor)) => rig.want(feed(factor)),
            Some(Op::Replan) => rig.replan(),
            Some(Op::Hold) => {
                rig.hold(true);
                while rig.turn() != Step::Held {}
                rig.hold(false);
            }
            None => {}
        }
        rig.turn()
    };
    for (n, step) in job.moves.iter().enumerate() {
        while rig.free() == 0 {
            turn(&mut rig);
        }
        let mut to = rig.position;
        for (to, way) in to.iter_mut().zip(step.way) {
            to.0 += way;
        }
        if step.stop {
            rig.stop();
        }
        rig.line(to, step.velocity, n as u32 + 1);
        for _ in 0..step.turns {
            if turn(&mut rig) == Step::Idle {
                break;
            }
        }
    }
    while turn(&mut rig) != Step::Idle {}
    rig.finish();
    rig
}

/// Checks the limits of the machine, whatever the feed.
fn check_machine(planned: &[Planned]) {
    for (n, p) in planned.iter().enumerate() {
        assert!(p.after <= p.top.max(p.before) * 1.0011, "{n}: {p:?}");
    }
    check_corners(planned, 2e-3);
    check_changes(planned, 2e-3, 1.1, true);
}

proptest! {
    #![proptest_config(cases(1_000))]

    #[test]
    fn any_job_ends_on_its_steps(job in any_job(), ops in any_deeds()) {
        let rig = run(&job, &ops);
        prop_assert_eq!(rig.pins.position, rig.target());
    }

    #[test]
    fn any_job_keeps_the_limits_of_the_machine(job in any_job(), ops in any_deeds()) {
        let script = core::cell::RefCell::new(Schedule::new(ops));
        let holding = core::cell::Cell::new(false);
        let held = |_, at_rest| {
            if at_rest {
                holding.set(false);
            }
            holding.get()
        };
        let change = |_, rig: &mut Rig| match script.borrow_mut().due() {
            Some(Op::Feed(factor)) => rig.want(feed(factor)),
            Some(Op::Replan) => rig.replan(),
            Some(Op::Hold) => holding.set(true),
            None => {}
        };
        check_machine(&plan_changed(&job, held, change));
    }

    /// Keys that are computed anew are as good as the keys of blocks that were queued with the factors in force.
    #[test]
    fn once_planned_anew_feeds_are_kept(job in any_job(), factor in 0.3f32..2.0) {
        let mut planned = plan_changed(&job, |_, _| false, |n, rig| {
            if n == 0 {
                rig.want(feed(factor));
            }
            rig.replan();
        });
        // The blocks before the first stretch were planned for other factors.
        planned.retain(|p| p.line > 1);
        for (n, p) in planned.iter().enumerate() {
            prop_assert!(p.after <= p.cruise * 1.0011 + 1e-6, "{n}: {p:?}");
        }
    }
}

/// Runs until the velocity is steady, and returns it.
fn steady(rig: &mut Rig) -> f32 {
    let mut before = -1.0;
    while rig.snapshot.velocity != before {
        before = rig.snapshot.velocity;
        (0..3).for_each(|_| assert_eq!(rig.turn(), Step::Segment));
    }
    before
}

#[test]
fn a_long_move_follows_at_the_next_stretch_or_the_one_behind() {
    for jerk in [0.0, 20_000.0] {
        let mut rig = Rig::new(Config::new(100.0, 1_000.0, jerk));
        rig.line(at([300.0, 100.0]), 40.0, 1);
        assert!((steady(&mut rig) - 40.0).abs() < 1e-3);
        for factor in [0.5, 2.0, 1.1, 0.05, 0.5, 0.001, 1.0] {
            let velocity = 40.0 * factor;
            let before = rig.snapshot.velocity;
            rig.want(feed(factor));
            rig.replan();
            rig.turn();
            assert!(rig.snapshot.velocity != before, "{factor}");
            assert!((steady(&mut rig) - velocity).abs() < 0.01 * velocity, "{factor}");
        }
        rig.finish();
        assert_eq!(rig.pins.position, rig.target());
    }
}

#[test]
fn a_traverse_has_its_own_factor_and_no_feed_exceeds_the_axes() {
    let mut rig = Rig::new(Config::new(50.0, 1_000.0, 0.0));
    rig.want(Factors { feed: 2.0, traverse: 0.25 });
    rig.replan();
    rig.line(at([100.0]), 40.0, 1);
    assert!((steady(&mut rig) - 50.0).abs() < 0.5);
    rig.finish();
    rig.traverse(at([0.0]), 2);
    assert!((steady(&mut rig) - 12.5).abs() < 1e-3);
}

#[test]
fn what_stands_in_the_stream_acts_in_its_place_and_stops_nothing() {
    let mut rig = Rig::new(Config::new(100.0, 1_000.0, 0.0));
    rig.line(at([10.0]), 40.0, 1);
    rig.aside(Block::action(QueuedAction::Override(Change::to(Override::Feed, 500)), 2));
    rig.line(at([20.0]), 40.0, 2);
    let mut step = rig.turn();
    while !matches!(step, Step::Override) {
        assert!(step == Step::Segment || step == Step::Again, "{step:?}");
        step = rig.turn();
    }
    assert_eq!(rig.change, Some(Change::to(Override::Feed, 500)));
    assert!((rig.snapshot.velocity - 40.0).abs() < 1e-3);
    rig.want(feed(0.5));
    assert!((steady(&mut rig) - 20.0).abs() < 1e-3);
    rig.finish();
    assert_eq!(rig.pins.position[0], 1_600);
}
