use kerf::boards::{MEGA2560_GRBL, Pin, Port, RAMPS14, inputs, pin};

use super::*;

const MS: u64 = 16_000;

/// The changes of pins: when each came, and the new level.
struct Pins(Vec<(u64, Pin, bool)>);

impl Pins {
    /// Runs a machine to a cycle, event by event.
    fn run(&mut self, mechanics: &mut Mechanics, end: u64) {
        while mechanics.due() <= end {
            let at = mechanics.due();
            let mut changed = Vec::new();
            mechanics.advance(at, &mut changed);
            self.0.extend(changed.into_iter().map(|(pin, high)| (at, pin, high)));
        }
    }

    fn level(&self, pin: Pin) -> Option<bool> {
        self.0.iter().rev().find(|(_, p, _)| *p == pin).map(|(_, _, high)| *high)
    }
}

fn machine(build: &Build, board: &Board) -> (Mechanics, Pins) {
    let (mut mechanics, mut pins) = (Mechanics::new(build, board), Pins(Vec::new()));
    pins.run(&mut mechanics, 0);
    (mechanics, pins)
}

fn steps(mechanics: &mut Mechanics, motor: usize, count: i64) {
    (0..count.abs()).for_each(|_| mechanics.step(motor, count > 0, 1));
}

const X_MIN: Pin = pin(Port::E, 5);
const X_MAX: Pin = pin(Port::E, 4);

#[test]
fn switches_have_places_and_a_hysteresis() {
    let (mut m, mut pins) = machine(&Build::of(&RAMPS14), &RAMPS14);
    assert_eq!(
        (m.position(0), pins.level(X_MIN), pins.level(X_MAX)),
        (100.0, Some(true), Some(true))
    );
    steps(&mut m, 0, -98 * 1280 + 1);
    assert!(!m.is_worked(inputs::X_MIN));
    steps(&mut m, 0, -1);
    pins.run(&mut m, 1);
    assert_eq!((m.position(0), pins.level(X_MIN)), (2.0, Some(false)));
    steps(&mut m, 0, 256);
    assert!(m.is_worked(inputs::X_MIN), "0.2 mm back");
    steps(&mut m, 0, 1);
    assert!(!m.is_worked(inputs::X_MIN));
    pins.run(&mut m, 2);
    assert_eq!(pins.level(X_MIN), Some(true));
}

#[test]
fn hard_ends_cost_steps() {
    let (mut m, _) = machine(&Build::of(&RAMPS14), &RAMPS14);
    steps(&mut m, 0, -101 * 1280);
    assert_eq!((m.position(0), m.lost(0)), (0.0, 1280));
    steps(&mut m, 0, 1280);
    assert_eq!((m.position(0), m.lost(0)), (1.0, 1280));
    steps(&mut m, 3, 100_000);
    assert_eq!(m.lost(3), 0);
}

#[test]
fn normally_closed_is_the_other_way_round() {
    let build = Build::of(&RAMPS14).wired(Wiring::NormallyClosed);
    let (mut m, mut pins) = machine(&build, &RAMPS14);
    assert_eq!(pins.level(X_MAX), Some(false));
    steps(&mut m, 0, 99 * 1280);
    pins.run(&mut m, 1);
    assert_eq!((pins.level(X_MAX), pins.level(X_MIN)), (Some(true), Some(false)));
}

#[test]
fn both_ends_may_share_a_wire() {
    let (mut m, mut pins) = machine(&Build::of(&MEGA2560_GRBL), &MEGA2560_GRBL);
    for end in [-99, 198] {
        steps(&mut m, 0, end * 1280);
        pins.run(&mut m, 2);
        assert_eq!(pins.level(pin(Port::B, 4)), Some(false));
    }
    assert!(m.is_worked(inputs::X_MAX) && !m.is_worked(inputs::X_MIN));
}

#[test]
fn a_plate_closes_the_probe() {
    let build = Build { plate: Some(40.0), ..Build::of(&RAMPS14) };
    let (mut m, mut pins) = machine(&build, &RAMPS14);
    steps(&mut m, 2, -10 * 1280 + 1);
    assert!(!m.is_worked(inputs::PROBE));
    steps(&mut m, 2, -1);
    pins.run(&mut m, 1);
    assert_eq!(pins.level(pin(Port::K, 2)), Some(false));
}

#[test]
fn bounces_are_so_many_in_so_long_and_the_same_each_time() {
    let edges = || {
        let (mut m, mut pins) = machine(&Build::of(&RAMPS14), &RAMPS14);
        m.bounce(inputs::DOOR, Some(Bounce { times: 5, cycles: MS }));
        pins.0.clear();
        m.work(inputs::DOOR, true, 100);
        pins.run(&mut m, 2 * MS);
        pins.0
    };
    let seen = edges();
    assert_eq!(seen.len(), 11);
    assert_eq!(seen[0], (100, pin(Port::K, 4), false));
    assert!(seen.iter().all(|(at, ..)| *at <= 100 + MS));
    assert_eq!(seen.last().map(|(_, _, high)| *high), Some(false));
    assert_eq!(seen, edges());
}

#[test]
fn wires_can_stick_and_be_disturbed() {
    let (mut m, mut pins) = machine(&Build::of(&RAMPS14), &RAMPS14);
    pins.0.clear();
    m.disturb(inputs::X_MIN, 500, 32);
    pins.run(&mut m, MS);
    assert_eq!(pins.0, [(500, X_MIN, false), (532, X_MIN, true)]);
    m.stick(inputs::X_MIN, Some(false));
    m.work(inputs::X_MIN, true, MS);
    pins.run(&mut m, 2 * MS);
    assert_eq!(pins.level(X_MIN), Some(true));
    m.stick(inputs::X_MIN, None);
    pins.run(&mut m, 3 * MS);
    assert_eq!(pins.level(X_MIN), Some(false));
}

#[test]
fn a_spindle_takes_its_time() {
    let (mut m, _) = machine(&Build::of(&RAMPS14), &RAMPS14);
    m.spindle(SpindlePin::Enable, true, 0);
    let near = |is: f64, wanted: f64| assert!((is - wanted).abs() < 1.0, "{is} for {wanted}");
    near(m.spindle_rpm(500 * MS), 12_000.0 * (1.0 - (-1.0f64).exp()));
    near(m.spindle_rpm(10_000 * MS), 12_000.0);
    m.spindle(SpindlePin::Reverse, true, 10_000 * MS);
    near(m.spindle_rpm(20_000 * MS), -12_000.0);
}

#[test]
fn pulses_of_half_width_are_half_the_speed() {
    let pwm = Some(pin(Port::H, 4));
    let mut build = Build::of(&MEGA2560_GRBL);
    build.spindle.pwm = pwm;
    let (mut m, _) = machine(&build, &MEGA2560_GRBL);
    m.spindle(SpindlePin::Enable, true, 0);
    (0..10_000).for_each(|ms| m.spindle(SpindlePin::Pulse, ms % 2 == 0, ms * MS));
    assert!((m.spindle_rpm(10_000 * MS) - 6_000.0).abs() < 20.0);
}

#[test]
fn an_index_comes_once_a_turn_unless_it_is_missed() {
    let index = pin(Port::D, 0);
    let mut build = Build::of(&MEGA2560_GRBL);
    build.spindle.index = Some(index);
    build.spindle.time_constant = 0.01;
    let pulses = |missed: Option<u64>| {
        let (mut m, mut pins) = machine(&build, &MEGA2560_GRBL);
        m.miss_index_every(missed);
        m.spindle(SpindlePin::Enable, true, 0);
        pins.run(&mut m, 1_000 * MS);
        (m.spindle_turns(), pins.0.iter().filter(|(_, p, high)| *p == index && *high).count())
    };
    let (turns, count) = pulses(None);
    assert!((turns - 198.0).abs() < 1.0, "{turns}");
    assert!(count.abs_diff(turns as usize) <= 1, "{count} in {turns} turns");
    let missed = count - pulses(Some(10)).1;
    assert!(missed.abs_diff(count / 10) <= 1, "{missed} of {count}");
}
