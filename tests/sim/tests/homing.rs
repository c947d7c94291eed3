//! Homing on the image, with carriages and with switches that bounce and stick.

use kerf::boards::{Board, MEGA2560_GRBL, RAMPS14_CNC, inputs};
use kerf_sim::job::{read_setup, read_travels};
use kerf_sim::mechanics::{Bounce, Build, Wiring};
use kerf_sim::{Host, Machine};

use crate::common::{booted, set};

/// A machine whose carriages stand near their homing switches. The switches bounce for about a millisecond.
fn standing(board: &'static Board, wiring: Wiring, starts: [f64; 3]) -> (Machine, Host) {
    let (mut machine, mut host) = booted(board);
    let mut build = Build::of(board).wired(wiring);
    for (axis, start) in build.axes.iter_mut().zip(starts) {
        axis.start = start;
    }
    machine.build(&build);
    machine.tamper(|mechanics, _| {
        for input in [inputs::X_MIN, inputs::Y_MIN, inputs::Z_MAX] {
            mechanics.bounce(input, Some(Bounce { times: 4, cycles: 16_000 }));
        }
    });
    let kind = if wiring == Wiring::NormallyClosed { "{st:1}" } else { "{st:0}" };
    // Homing is fast, to save time in the simulator.
    let quick = "{x:{jh:2000,zb:0.5},y:{jh:2000,zb:0.5},z:{jh:2000,zb:0.5}}";
    for line in [kind, quick, "{sv:0}"] {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, 50).unwrap();
    (machine, host)
}

/// Homes, and returns the exception that was reported, if any.
fn home(machine: &mut Machine, host: &mut Host, line: &str) -> Option<String> {
    host.take_reports();
    set(machine, host, line);
    // This line is executed when the homing has ended.
    let done = host.ask(machine, "g4 p0", 30_000).unwrap();
    assert_eq!(done.status, 0);
    host.run_for_ms(machine, 100).unwrap();
    let told = host.take_reports().into_iter().map(|report| report.to_string());
    told.chain(host.strays().iter().cloned()).find(|line| line.contains("\"er\""))
}

/// Returns the positions of the carriages, in steps from the lower hard ends.
fn places(machine: &Machine) -> [i64; 3] {
    let mechanics = machine.mechanics().unwrap();
    [0, 1, 2].map(|axis| (mechanics.position(axis) * 1_280.0).round() as i64)
}

#[test]
fn every_axis_ends_on_its_step_from_wherever_it_comes() {
    // Off the switches by their hysteresis of 0.2 mm, the step at which they open, and the zero back-off.
    let (lower, upper) = ((2.2 + 0.5) * 1_280.0, (98.0 - 0.2 - 0.5) * 1_280.0);
    for board in [&MEGA2560_GRBL, &RAMPS14_CNC] {
        for wiring in [Wiring::NormallyOpen, Wiring::NormallyClosed] {
            let (mut machine, mut host) = standing(board, wiring, [5.0, 1.0, 96.3]);
            assert_eq!(home(&mut machine, &mut host, "{home:1}"), None);
            let first = places(&machine);
            println!("{} {wiring:?} {first:?}, {lower} {upper}", board.name);
            for (place, wanted) in first.iter().zip([lower, lower, upper]) {
                assert!((*place as f64 - wanted).abs() <= 2.0, "{place} for {wanted}");
            }
            let at = host.ask(&mut machine, "{mpo:n}", 1_000).unwrap();
            assert!(at.raw.contains("\"x\":0.000,\"y\":0.000,\"z\":0.000"), "{}", at.raw);
            set(&mut machine, &mut host, "g1 f800 x1.7 y0.9 z-0.9");
            assert_eq!(home(&mut machine, &mut host, "g28.2 x0 y0 z0"), None);
            assert_eq!(places(&machine), first, "on {}", board.name);
            assert_eq!([0, 1, 2].map(|axis| machine.mechanics().unwrap().lost(axis)), [0; 3]);
        }
    }
}

#[test]
fn a_switch_that_sticks_is_told() {
    let (mut machine, mut host) =
        standing(&MEGA2560_GRBL, Wiring::NormallyOpen, [5.0, 100.0, 50.0]);
    machine.tamper(|mechanics, _| mechanics.stick(inputs::X_MIN, Some(true)));
    host.run_for_ms(&mut machine, 50).unwrap();
    let told = home(&mut machine, &mut host, "g28.2 x0").unwrap();
    assert!(told.contains("247") && told.contains("\"ax\":\"x\""), "{told}");
    machine.tamper(|mechanics, _| mechanics.stick(inputs::X_MIN, None));
    host.run_for_ms(&mut machine, 50).unwrap();
    assert_eq!(host.ask(&mut machine, "g28.2 x0", 1_000).unwrap().status, 0);
}

/// The step, from the lower hard end, at which X ends: one step off its switch, plus the zero back-off.
const ENDS: i64 = 2_816 + 1 + 640;

/// A machine whose X homes at these speeds, mm/min.
fn quick(search: f64, latch: f64) -> (Machine, Host) {
    let (mut machine, mut host) =
        standing(&MEGA2560_GRBL, Wiring::NormallyOpen, [14.0, 100.0, 50.0]);
    machine.tamper(|mechanics, _| mechanics.bounce(inputs::X_MIN, None));
    let speeds = format!("{{x:{{vm:4000,ac:3000,jh:50000,sv:{search},lv:{latch},lb:3}}}}");
    set(&mut machine, &mut host, &speeds);
    (machine, host)
}

#[test]
fn whatever_the_speed_it_ends_within_a_step() {
    for (search, latch) in [(300.0, 20.0), (1_000.0, 100.0), (2_500.0, 471.0), (3_500.0, 1_500.0)] {
        let (mut machine, mut host) = quick(search, latch);
        for n in 0..3 {
            let told = home(&mut machine, &mut host, "g28.2 x0");
            // From 74,000 steps a second on the jerk-limited ramp of one search in twelve is late, and no step is lost.
            let is_late =
                search > 3_000.0 && told.as_ref().is_some_and(|it| it.contains("\"st\":37"));
            assert!(told.is_none() || is_late, "{search}, {latch} mm/min: {told:?}");
            let off = places(&machine)[0] - ENDS;
            // Measured: 0 at all speeds.
            assert!(off.abs() <= 1, "{off} steps at {search}, {latch} mm/min");
            assert_eq!(machine.mechanics().unwrap().lost(0), 0);
            // The next homing begins at another phase of a step's interval.
            set(&mut machine, &mut host, &format!("g1 f3000 x{}", 4.0 + 0.317 * f64::from(n)));
        }
    }
}

#[test]
fn a_hold_in_any_stage_of_homing_changes_nothing_of_its_end() {
    for ms in [300, 700, 900, 950, 1_000, 1_050, 1_100, 1_150] {
        let (mut machine, mut host) = quick(1_500.0, 150.0);
        set(&mut machine, &mut host, "g28.2 x0");
        host.run_for_ms(&mut machine, ms).unwrap();
        machine.send_now(b'!');
        host.run_for_ms(&mut machine, 300).unwrap();
        let steps = machine.recorder().steps();
        host.run_for_ms(&mut machine, 300).unwrap();
        assert_eq!(machine.recorder().steps(), steps, "held after {ms} ms");
        machine.send_now(b'~');
        assert_eq!(host.ask(&mut machine, "g4 p0", 30_000).unwrap().status, 0);
        host.run_for_ms(&mut machine, 50).unwrap();
        let off = places(&machine)[0] - ENDS;
        assert!(off.abs() <= 1, "{off} steps, held after {ms} ms");
    }
}

/// The machine that `serve` puts around a board has the motors, directions and travel of the settings.
#[test]
fn a_machine_that_fits_its_settings_homes() {
    // The router has a second motor on Y, which faces the first one.
    for profile in ["{mch:1}", "{mch:2}", "{mch:3}"] {
        let (mut machine, mut host) = booted(&MEGA2560_GRBL);
        for line in [profile, "{2po:1}", "{sv:0}"] {
            set(&mut machine, &mut host, line);
        }
        let setup = read_setup(&mut machine, &mut host).unwrap();
        let travels = read_travels(&mut machine, &mut host).unwrap();
        let mut build = Build::fitted(&MEGA2560_GRBL, &setup, travels);
        assert!((build.axes[0].travel - travels[0] * 4.0 / 3.0).abs() < 1e-9);
        let switches = [0, 1, 2].map(|n| {
            let axis = ["x", "y", "z"][n];
            let told = host.ask(&mut machine, &format!("{{{axis}sx:n}}"), 1_000).unwrap();
            matches!(told.body[format!("{axis}sx")].as_i64(), Some(1 | 3))
        });
        // Near the switches, to save time in the simulator.
        for (axis, upper) in build.axes.iter_mut().zip(switches) {
            axis.start = if upper { axis.travel - 12.0 } else { 12.0 };
        }
        machine.build(&build);
        assert_eq!(home(&mut machine, &mut host, "g28.2 x0 y0 z0"), None, "{profile}");
        let homed = host.ask(&mut machine, "{home:n}", 1_000).unwrap();
        assert_eq!(homed.body["home"], 1, "{profile}");
        for (n, upper) in switches.into_iter().enumerate() {
            let (at, travel) = (machine.mechanics().unwrap().position(n), build.axes[n].travel);
            let off = if upper { travel - at } else { at };
            assert!((2.0..12.0).contains(&off), "{profile}: axis {n} is {off} mm from its end");
        }
    }
}
