//! Probing on the image: the reported position compared with the step at which the contact closed, at 10,000 steps a
//! second.
//!
//! An edge counts after two samples 10 us apart. The reported position is that of the step generator at the first
//! sample, 20 us after the edge, a fifth of a step. Where a step reaches a plate that is less than the time to the
//! next step, and the report is exact. Where the contact closes between two steps the report may be off by one.

use kerf::boards::{Board, MEGA2560_GRBL, RAMPS14_CNC, inputs};
use kerf_sim::mechanics::{Bounce, Build};
use kerf_sim::{Host, Machine};
use serde_json::Value;

use crate::common::{booted, set};

/// Steps in a mm. A step is ten times the resolution of a reported position, so that nothing is rounded.
const STEPS: f64 = 100.0;
/// Feed for 10,000 steps a second, mm/min.
const FEED: f64 = 6_000.0;
/// Cycles between two steps at that rate.
const STEP: u64 = 1_600;
/// Position of Z at the beginning.
const START: f64 = 50.0;
const Z: usize = 2;

/// A machine with a probe, whose plate and contact the test moves.
struct Bench {
    machine: Machine,
    host: Host,
    /// Positions of the motors when the log of steps begins.
    begun: [i64; 3],
}

impl Bench {
    fn new(board: &'static Board) -> Self {
        let (mut machine, mut host) = booted(board);
        let mut build = Build::of(board);
        build.axes.iter_mut().take(3).for_each(|axis| axis.steps_per_mm = STEPS);
        machine.build(&build);
        let motor = "{sa:1.8,tr:16,mi:8}";
        let axis = "{vm:9000,fr:9000,ac:2000,jm:1e5,jh:1e5}";
        for n in ["1", "3", "x", "z"] {
            let settings = if n < "9" { motor } else { axis };
            set(&mut machine, &mut host, &format!("{{{n}:{settings}}}"));
        }
        set(&mut machine, &mut host, "{sv:0}");
        host.run_for_ms(&mut machine, 50).unwrap();
        Bench { machine, host, begun: [0; 3] }
    }

    fn positions(&self) -> [i64; 3] {
        [0, 1, 2].map(|m| self.machine.recorder().motors()[m].position)
    }

    /// Goes back to the beginning with the contact open, and begins to probe.
    fn begin(&mut self, probing: &str) {
        self.machine.tamper(|mechanics, now| {
            mechanics.place_plate(None, now);
            mechanics.work(inputs::PROBE, false, now);
        });
        set(&mut self.machine, &mut self.host, "g0 x0 z0");
        self.host.run_for_ms(&mut self.machine, 1_000).unwrap();
        assert_eq!(self.positions(), [0; 3]);
        self.machine.recorder_mut().keep_log();
        self.begun = self.positions();
        set(&mut self.machine, &mut self.host, probing);
    }

    /// Closes the contact now. Returns the cycle.
    fn close(&mut self) -> u64 {
        self.machine.tamper(|mechanics, now| mechanics.work(inputs::PROBE, true, now));
        self.machine.cycle()
    }

    /// Returns the positions of the motors at a cycle. A step counts from the beginning of its pulse.
    fn at(&self, cycle: u64) -> [i64; 3] {
        let mut at = self.begun;
        for step in self.machine.recorder().log().iter().filter(|step| step.cycle <= cycle) {
            at[usize::from(step.motor)] += if step.positive { 1 } else { -1 };
        }
        at
    }

    /// Returns the cycle at which Z came to this step.
    fn reached(&self, steps: i64) -> u64 {
        let z = self.machine.recorder().steps_of(Z as u8);
        z[steps.unsigned_abs() as usize - 1]
    }

    /// Returns the reported positions, in steps.
    fn told(&mut self) -> [i64; 3] {
        self.host.run_for_ms(&mut self.machine, 300).unwrap();
        let told = self.host.strays().iter().rev().find(|line| line.contains("\"prb\"")).unwrap();
        let told: Value = serde_json::from_str(told).unwrap();
        let prb = &told["r"]["prb"];
        assert_eq!(prb["e"], 1, "{told}");
        ["x", "y", "z"].map(|axis| {
            let steps = prb[axis].as_f64().unwrap() * STEPS;
            assert!((steps - steps.round()).abs() < 1e-6, "{told}");
            steps.round() as i64
        })
    }

    /// Returns the largest error of an axis, in steps, if the contact closed at this cycle.
    fn error(&mut self, closed: u64) -> u64 {
        let (told, is) = (self.told(), self.at(closed));
        println!("  {told:?} {is:?}");
        told.iter().zip(is).map(|(told, is)| told.abs_diff(is)).max().unwrap_or(0)
    }

    /// Returns the step rate of Z at a cycle, steps a second.
    fn rate(&self, cycle: u64) -> f64 {
        let z = self.machine.recorder().steps_of(Z as u8);
        let next = z.partition_point(|step| *step <= cycle);
        16e6 / (z[next - 1] - z[next - 2]) as f64
    }
}

#[test]
fn a_plate_is_found_to_the_step_at_10_khz() {
    for board in [&MEGA2560_GRBL, &RAMPS14_CNC] {
        let mut bench = Bench::new(board);
        let mut worst = 0;
        for n in 0..6 {
            bench.begin(&format!("g38.2 z-40 f{FEED}"));
            let steps = -(700 + 131 * n);
            bench.machine.tamper(|mechanics, now| {
                mechanics.place_plate(Some(START + steps as f64 / STEPS), now);
            });
            bench.host.run_for_ms(&mut bench.machine, 600).unwrap();
            let closed = bench.reached(steps);
            let rate = bench.rate(closed);
            assert!((rate - 1e4).abs() < 10.0, "{rate}");
            worst = worst.max(bench.error(closed));
        }
        assert_eq!(worst, 0, "steps on {}", board.name);
    }
}

#[test]
fn a_contact_at_any_phase_of_a_step_is_found_to_the_step() {
    let mut bench = Bench::new(&MEGA2560_GRBL);
    let (mut worst, mut off) = (0, 0);
    for n in 0..16 {
        bench.begin(&format!("g38.2 z-40 f{FEED}"));
        let wait = bench.machine.cycle() + 200 * 16_000;
        bench.host.run_until(&mut bench.machine, wait).unwrap();
        // The contact closes two step intervals after a step, and a sixteenth of an interval later each time.
        let from = *bench.machine.recorder().steps_of(Z as u8).last().unwrap();
        let to = from + 2 * STEP + n * STEP / 16;
        bench.machine.run_until(to).unwrap();
        let closed = bench.close();
        assert!((bench.rate(closed) - 1e4).abs() < 10.0);
        let error = bench.error(closed);
        worst = worst.max(error);
        off += usize::from(error > 0);
    }
    println!("{worst} steps, {off} of 16 off");
    // Measured: 1, at 3 of the 16 phases.
    assert!(worst <= 1 && off <= 4, "{worst} steps, {off} of 16 off");
}

#[test]
fn a_contact_while_it_speeds_up_is_found_to_the_step() {
    let mut bench = Bench::new(&MEGA2560_GRBL);
    let mut worst = 0;
    for n in 0..6 {
        bench.begin(&format!("g38.2 z-40 f{FEED}"));
        while bench.positions() == [0; 3] {
            bench.host.run_for_ms(&mut bench.machine, 1).unwrap();
        }
        let wait = bench.machine.cycle() + (5 + 6 * n) * 16_000 + 977 * n;
        bench.host.run_until(&mut bench.machine, wait).unwrap();
        let closed = bench.close();
        let rate = bench.rate(closed);
        assert!((300.0..9_000.0).contains(&rate), "{rate}");
        worst = worst.max(bench.error(closed));
    }
    println!("speeding up: {worst} steps");
    assert!(worst <= 1, "{worst} steps");
}

#[test]
fn a_contact_that_bounces_is_found_while_it_bounces() {
    let mut bench = Bench::new(&MEGA2560_GRBL);
    let (mut worst, mut near) = (0, 0);
    for (n, times) in (0..).zip([2, 4, 8, 16, 4, 8].repeat(4)) {
        bench.begin(&format!("g38.2 z-40 f{FEED}"));
        bench.machine.tamper(|mechanics, _| {
            mechanics.bounce(inputs::PROBE, Some(Bounce { times, cycles: 48_000 }));
        });
        let wait = bench.machine.cycle() + 200 * 16_000 + 4_099 * n;
        bench.host.run_until(&mut bench.machine, wait).unwrap();
        let closed = bench.close();
        let mut settled = 0;
        bench.machine.tamper(|mechanics, _| settled = mechanics.settles(inputs::PROBE));
        let error = bench.error(closed);
        // Samples that find the contact open are followed by others. At the latest it is found when it stays closed,
        // within 300 us.
        let latest = bench.at(settled + 300 * 16)[Z].abs_diff(bench.at(closed)[Z]);
        assert!(error <= latest + 1, "{error} steps, {latest} at the latest");
        worst = worst.max(error);
        near += usize::from(error <= 2);
    }
    println!("bouncing: {worst} steps, {near} of 24 within 2");
    // Measured: 19 of 24, whatever the image. A contact is missed if it closes for so short a time that it looks like
    // noise.
    assert!(near >= 14, "{near} of 24 within 2 steps");
}

#[test]
fn two_axes_are_found_to_the_step() {
    let mut bench = Bench::new(&MEGA2560_GRBL);
    let mut worst = 0;
    for n in 0..8 {
        // Z at 10,000 steps a second, X at 7,000.
        let feed = 6_000.0 * (1.0f64 + 0.49).sqrt();
        bench.begin(&format!("g38.2 x21 z-30 f{feed:.1}"));
        let wait = bench.machine.cycle() + 200 * 16_000 + 1_733 * n;
        bench.host.run_until(&mut bench.machine, wait).unwrap();
        let closed = bench.close();
        let rate = bench.rate(closed);
        assert!((rate - 1e4).abs() < 100.0, "{rate}");
        worst = worst.max(bench.error(closed));
    }
    println!("two axes: {worst} steps");
    assert!(worst <= 1, "{worst} steps");
}

#[test]
fn it_ends_at_the_contact_unless_told_otherwise() {
    for board in [&MEGA2560_GRBL, &RAMPS14_CNC] {
        let mut bench = Bench::new(board);
        for (backs_off, steps) in [(1, -700), (0, -931), (1, -1_331)] {
            set(&mut bench.machine, &mut bench.host, &format!("{{pbo:{backs_off}}}"));
            bench.begin(&format!("g38.2 z-40 f{FEED}"));
            bench.machine.tamper(|mechanics, now| {
                mechanics.place_plate(Some(START + steps as f64 / STEPS), now);
            });
            bench.host.run_for_ms(&mut bench.machine, 1_200).unwrap();
            assert_eq!(bench.told()[Z], steps);
            let rests = bench.positions()[Z];
            println!("{} pbo {backs_off}: contact {steps}, rest {rests}", board.name);
            assert_eq!(rests == steps, backs_off == 1);
            assert!(rests <= steps, "on the side it came from");
        }
    }
}
