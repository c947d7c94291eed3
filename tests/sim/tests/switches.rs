//! Switches on the image: how fast a limit switch stops motion, and which signals count as a limit.

use kerf::boards::{Board, MEGA2560_GRBL, MEGA2560_LATHE, RAMPS14_CNC, inputs};
use kerf_sim::mechanics::{Bounce, Build, Sensors, Wiring};
use kerf_sim::{Host, Machine};

use crate::common::share::share;
use crate::common::{booted, set};

/// Cycles in a microsecond.
const US: u64 = 16;
/// Longest time from the edge to the last step, up to 50,000 steps a second (docs/safety.md, A1), us. Of 800 moments 3 took
/// more than 50, among status reports, and the longest 62.
const STOP_US: u64 = 70;
/// Longest time from the edge to the last step, at 85,000 steps a second, where the step interrupt leaves a fifth of
/// the CPU, us.
const STOP_FAST_US: u64 = 125;
/// Longest time in which no tick is served outside the step interrupt, cycles.
const WINDOW: u64 = 42;
/// Cycles in a second, in a segment, which is 2 ms, and between two status reports.
const SECOND: u64 = 1_000_000 * US;
const SEGMENT: u64 = 2_000 * US;
const REPORTS: u64 = 100_000 * US;
/// Number of moments at which an edge comes.
const PHASES: u64 = 16;

/// A machine with switches and these settings, which moves X and Y.
fn running(board: &'static Board, build: &Build, settings: &[&str]) -> (Machine, Host) {
    let (mut machine, mut host) = booted(board);
    machine.build(build);
    host.run_for_ms(&mut machine, 50).unwrap();
    let fast = "{x:{vm:2340,jm:1e5,ac:2000},y:{vm:2340,jm:1e5,ac:2000},sv:0}";
    for line in [fast].iter().chain(settings).chain([&"g0 x60 y40"]) {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, 200).unwrap();
    assert!(machine.recorder().steps() > 1_000);
    machine.meters_mut().clear();
    (machine, host)
}

/// Returns the exceptions that are reported within some milliseconds.
fn exceptions(machine: &mut Machine, host: &mut Host, ms: u64) -> Vec<String> {
    host.take_reports();
    host.run_for_ms(machine, ms).unwrap();
    let told = host.take_reports().into_iter().map(|report| report.to_string());
    told.chain(host.strays().iter().cloned()).filter(|line| line.contains("\"er\"")).collect()
}

/// The cycle of the last step.
fn last_step(machine: &Machine) -> u64 {
    machine.recorder().last_step().expect("steps")
}

fn check_windows(machine: &Machine) {
    let window = machine.meters().window_outside();
    assert!(window.cycles <= WINDOW, "{} cycles at {}", window.cycles, machine.describe(&window));
}

#[test]
fn a_limit_stops_at_once() {
    for board in [&MEGA2560_GRBL, &RAMPS14_CNC] {
        for (input, name) in
            [(inputs::X_MIN, "xmin"), (inputs::Y_MIN, "ymin"), (inputs::Z_MIN, "zmin")]
        {
            for wiring in [Wiring::NormallyOpen, Wiring::NormallyClosed] {
                let build = Build::of(board).wired(wiring);
                let kind = if wiring == Wiring::NormallyClosed { "{st:1}" } else { "{st:0}" };
                let (mut machine, mut host) =
                    running(board, &build, &[kind, "{xsn:2,ysn:2,zsn:3,zsx:0}"]);
                let mut edge = 0;
                machine.tamper(|mechanics, now| {
                    mechanics.work(input, true, now);
                    edge = now;
                });
                let told = exceptions(&mut machine, &mut host, 100);
                assert_eq!(told.len(), 1, "{name} on {}: {told:?}", board.name);
                assert!(told[0].contains("204") && told[0].contains(name), "{}", told[0]);
                let after = last_step(&machine).saturating_sub(edge);
                println!("{name} {wiring:?} {}: {after}", board.name);
                assert!(after <= STOP_US * US, "{name} on {}: {after} cycles", board.name);
                assert_eq!(host.ask(&mut machine, "g0 x0", 1_000).unwrap().status, 204);
                check_windows(&machine);
            }
        }
    }
}

/// Closes the limit switch of X at a rate of steps a second, at moments that are spread over an interval between two steps
/// and over `span` cycles, with status reports or without. Returns the times from the edge to the last step, cycles.
fn times_at(rate: u64, span: u64, reports: &str) -> Vec<u64> {
    let interval = SECOND / rate;
    let apart = span / PHASES / interval * interval + interval / PHASES;
    let velocity = rate as f64 * 60.0 / 1_280.0;
    let setting = format!("{{x:{{vm:{velocity}}},y:{{vm:{velocity}}},xsn:2}}");
    let time = |phase: u64| {
        let (mut machine, mut host) =
            running(&MEGA2560_GRBL, &Build::of(&MEGA2560_GRBL), &[&setting, reports]);
        let from = machine.cycle();
        host.run_until(&mut machine, from + phase * apart).unwrap();
        let edge = machine.cycle();
        machine.tamper(|mechanics, now| mechanics.work(inputs::X_MIN, true, now));
        assert_eq!(exceptions(&mut machine, &mut host, 100).len(), 1);
        last_step(&machine).saturating_sub(edge)
    };
    (0..PHASES).map(time).collect()
}

#[test]
fn a_limit_stops_at_once_wherever_between_two_steps_it_closes() {
    for (rate, most) in [(50_000, STOP_US), (32_000, STOP_US), (85_000, STOP_FAST_US)] {
        let [quiet, busy] = [(SEGMENT, "{sv:0}"), (REPORTS, "{sv:2,si:100}")]
            .map(|(span, reports)| times_at(rate, span, reports));
        let all = || quiet.iter().chain(&busy).copied();
        let (least, longest) = (all().min().unwrap(), all().max().unwrap());
        let us = [least, longest].map(|cycles| cycles as f64 / US as f64);
        println!("{rate} steps/s: the last step {:.1} to {:.1} us after the edge", us[0], us[1]);
        assert!(longest <= most * US, "{rate} steps/s: {longest} cycles");
    }
}

#[test]
fn a_carriage_that_runs_into_its_switch_stops_before_the_hard_end() {
    let mut build = Build::of(&RAMPS14_CNC);
    build.axes[0].start = 150.0;
    let (mut machine, mut host) = running(&RAMPS14_CNC, &build, &["{xsx:2,xvm:4000,yvm:4000}"]);
    machine.tamper(|m, _| m.bounce(inputs::X_MAX, Some(Bounce { times: 20, cycles: 3_000 * US })));
    let told = exceptions(&mut machine, &mut host, 3_000);
    assert!(told.len() == 1 && told[0].contains("xmax"), "{told:?}");
    let mechanics = machine.mechanics().unwrap();
    // At 4,000 mm/min for some samples, while the switch bounces for 3 ms.
    assert!((198.0..198.06).contains(&mechanics.position(0)), "{}", mechanics.position(0));
    assert_eq!(mechanics.lost(0), 0);
    check_windows(&machine);
}

#[test]
fn noise_stops_nothing_and_costs_no_step() {
    let (mut machine, mut host) =
        running(&MEGA2560_GRBL, &Build::of(&MEGA2560_GRBL), &["{xsn:2,ysn:2,zsx:2}"]);
    machine.tamper(|mechanics, now| {
        for n in 0..400u64 {
            let (input, at) = (2 * (n % 3) as usize, now + n * (300 + 7 * (n % 50)) * US);
            mechanics.disturb(input, at, (1 + n % 9) * US);
        }
    });
    assert_eq!(exceptions(&mut machine, &mut host, 2_000), Vec::<String>::new());
    let motors = machine.recorder().motors();
    assert_eq!((motors[0].position, motors[1].position), (60 * 1_280, 40 * 1_280));
    check_windows(&machine);
}

#[test]
fn a_storm_of_noise_leaves_time_for_the_rest() {
    let (mut machine, mut host) = running(&MEGA2560_GRBL, &Build::of(&MEGA2560_GRBL), &["{xsn:2}"]);
    machine.tamper(|mechanics, now| {
        (0..20_000).for_each(|n| mechanics.disturb(inputs::X_MIN, now + n * 50 * US, 2 * US));
    });
    let mut told = exceptions(&mut machine, &mut host, 2_000);
    // The storm may cost a segment its time, which is reported. Nothing else happens.
    told.retain(|exception| !exception.contains("\"st\":37"));
    assert_eq!(told, Vec::<String>::new());
    assert_eq!(machine.recorder().motors()[0].position, 60 * 1_280);
}

/// A variable that is not 0 while exec runs, or must not run.
const CLOSED: &str = "avr_embassy::assembly::CLOSED";
/// The function that the software interrupt calls.
const POLL: &str = "avr_embassy::interrupt::avr::poll";

/// Exec must not run within exec: it would lose segments, or send them twice.
#[test]
fn edges_of_the_spindles_sensors_start_no_samples() {
    let board = &MEGA2560_LATHE;
    let mut build = Build::of(board);
    build.spindle.sensors = Sensors::of(board, 100);
    let (mut machine, mut host) = booted(board);
    machine.build(&build);
    ["{spn:100}", "{spdi:1}"].iter().for_each(|line| set(&mut machine, &mut host, line));
    machine.tamper(|mechanics, now| mechanics.force_spindle(600.0, now));
    host.run_for_ms(&mut machine, 100).unwrap();
    machine.start_profile();
    host.run_for_ms(&mut machine, 500).unwrap();
    let profile = machine.profile();
    let spent = |name: &str| -> u64 {
        profile.iter().filter(|(function, _)| function.contains(name)).map(|(_, n)| n).sum()
    };
    // 500 pulses have come, each with two edges. The index is on a pin of a switch in this build, so its edges start
    // some samples.
    assert!(spent("__vector_11") > 1_000 * 40, "{}", spent("__vector_11"));
    let samples = spent("inputs::sample");
    assert!(samples < 20 * 1_000, "{samples} cycles of samples");
}

#[test]
fn a_look_within_the_tick_does_not_let_exec_interrupt_itself() {
    for phase in share(4, 2) {
        let (mut machine, _) =
            running(&MEGA2560_GRBL, &Build::of(&MEGA2560_GRBL), &["{xsn:2,ysn:2}"]);
        let closed = machine.image().variable(CLOSED).expect("the ceiling");
        let poll = machine.image().function(POLL).expect("what exec runs in");
        machine.run_until(machine.cycle() + phase * 1_117).unwrap();
        machine.tamper(|mechanics, now| {
            (0..20_000).for_each(|n| mechanics.disturb(inputs::X_MIN, now + n * 50 * US, 2 * US));
        });
        // Every 256 ms the tick allows other interrupts.
        let end = machine.cycle() + machine.cycles(800);
        let mut began = None;
        while machine.cycle() < end {
            machine.step(end).unwrap();
            let sp = machine.sp();
            if began.is_some_and(|began| sp > began) {
                began = None;
            }
            if machine.pc() == poll {
                assert_eq!(began.replace(sp), None, "exec interrupts itself");
            }
            assert!(began.is_none() || machine.peek(closed) > 0, "exec is let into itself");
        }
    }
}

#[test]
fn each_event_is_told_once_and_the_state_is_right_after_it() {
    let (mut machine, mut host) = running(&RAMPS14_CNC, &Build::of(&RAMPS14_CNC), &["{xsn:1}"]);
    machine.tamper(|m, _| m.bounce(inputs::X_MIN, Some(Bounce { times: 30, cycles: 5_000 * US })));
    for worked in [true, false, true] {
        machine.tamper(|mechanics, now| mechanics.work(inputs::X_MIN, worked, now));
        host.run_for_ms(&mut machine, 30).unwrap();
        let response = host.ask(&mut machine, "{in1:n}", 1_000).unwrap();
        assert_eq!(response.body["in1"], i64::from(worked));
    }
    machine.tamper(|mechanics, _| mechanics.stick(inputs::X_MIN, Some(false)));
    host.run_for_ms(&mut machine, 30).unwrap();
    assert_eq!(host.ask(&mut machine, "{in1:n}", 1_000).unwrap().body["in1"], 0);
    assert_eq!(exceptions(&mut machine, &mut host, 1_000), Vec::<String>::new());
}

#[test]
fn after_a_limit_the_position_is_known_to_the_step() {
    for (board, jerk) in [(&MEGA2560_GRBL, "{xjm:1e5}"), (&RAMPS14_CNC, "{xjm:5e3}")] {
        let (mut machine, mut host) = running(board, &Build::of(board), &[jerk, "{xsn:2}"]);
        for n in 0..6 {
            machine.tamper(|mechanics, now| mechanics.work(inputs::X_MIN, true, now));
            assert_eq!(exceptions(&mut machine, &mut host, 100).len(), 1);
            set(&mut machine, &mut host, "{clear:n}");
            machine.tamper(|mechanics, now| mechanics.work(inputs::X_MIN, false, now));
            // The axes move off the switch, and to where steps began to be counted.
            set(&mut machine, &mut host, "g0 x0 y0");
            host.run_for_ms(&mut machine, 2_500).unwrap();
            let motors = machine.recorder().motors();
            assert_eq!((motors[0].position, motors[1].position), (0, 0), "{n} on {}", board.name);
            set(&mut machine, &mut host, "g0 x60 y40");
            let cycles = (150_000 + 7_919 * n) * US;
            let end = machine.cycle() + cycles;
            while machine.cycle() < end {
                host.run_for_ms(&mut machine, 1).unwrap();
            }
        }
    }
}

#[test]
fn the_emergency_stop_stops_at_once() {
    let (mut machine, mut host) = running(&MEGA2560_GRBL, &Build::of(&MEGA2560_GRBL), &["{est:1}"]);
    let edge = machine.cycle();
    machine.tamper(|mechanics, now| mechanics.work(inputs::STOP, true, now));
    let told = exceptions(&mut machine, &mut host, 100);
    assert!(told.len() == 1 && told[0].contains("205"), "{told:?}");
    let after = last_step(&machine).saturating_sub(edge);
    println!("emergency stop {after}");
    assert!(after <= STOP_US * US, "{after} cycles");
    assert_eq!(host.ask(&mut machine, "{clear:n}", 1_000).unwrap().status, 205);
    machine.tamper(|mechanics, now| mechanics.work(inputs::STOP, false, now));
    host.run_for_ms(&mut machine, 30).unwrap();
    for line in ["{clear:n}", "g0 x0 y0"] {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, 2_500).unwrap();
    let motors = machine.recorder().motors();
    assert_eq!((motors[0].position, motors[1].position), (0, 0));
}
