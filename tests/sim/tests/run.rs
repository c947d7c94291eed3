//! A job from boot to rest, with a stand-in for the firmware.

use kerf_sim::Host;
use kerf_sim::job::{self, Options};
use kerf_sim::report::Report;

use crate::common::machine;

fn report(job: &str) -> Report {
    let mut m = machine("echo.c");
    job::run(&mut m, &job::lines_of(job), &Options::default(), |_| {}).unwrap()
}

fn fails_with(job: &str, what: &str) {
    let report = report(job);
    let text = report.to_string();
    assert!(!report.ok && text.trim_end().ends_with(')'), "{text}");
    assert!(text.contains(what), "{what:?} is not in\n{text}");
}

#[test]
fn a_good_job() {
    let report = report("%\nG21 G90\nG0 X10\n\nG0 X-2\nM30\n%\n");
    assert!(report.ok, "{report}");
    assert_eq!((report.lines, report.acknowledged), (4, 4));
    let x = &report.motors[0];
    assert_eq!((x.steps, x.expected, x.total), (-160, Some(-160), 800 + 960));
    assert_eq!(report.axes[0].position, -2.0);
    // 1760 steps at 20 kHz, and the time between the two moves.
    assert!((0.0875..0.092).contains(&report.seconds_moving), "{report}");
    assert!(report.cpu_load.is_some_and(|l| l > 0.05 && l < 0.9), "{report}");
    assert!(report.free_stack.is_some_and(|n| n > 7000), "{report}");
    assert!(report.to_string().ends_with("result: OK\n"));
}

#[test]
fn a_lost_step_is_noticed() {
    let job = "G0 X1\n{lose:\"LOSE\"}\nG0 X2";
    fails_with(job, "motor 1 is at 80 steps instead of 160");
}

#[test]
fn what_the_oracle_cannot_tell_is_said_and_run() {
    let report = report("G0 X1\nG28 X2\nG0 X3");
    let text = report.to_string();
    assert!(report.ok && report.acknowledged == 3, "{text}");
    assert_eq!(report.unchecked.as_deref(), Some("line 2: the oracle does not know G28"));
    assert!(text.contains("ends not checked"), "{text}");
    assert!(report.axes.is_empty() && report.motors[0].expected.is_none(), "{text}");
}

#[test]
fn a_rejected_line_is_named() {
    fails_with("G0 X1\nREJECT\nG0 X2", "1 of 3 lines rejected, the first is line 2");
}

#[test]
fn a_firmware_that_hangs_is_given_up() {
    fails_with("G0 X1\nHANG\nG0 X2", "no answer and no step for 30 s; waiting for HANG");
}

#[test]
fn a_crash_is_named() {
    fails_with("G0 X1\nCRASH\nG0 X2", "bad instruction in ");
}

#[test]
fn an_answer_too_many_is_noticed() {
    fails_with("G0 X1\nSTRAY", "unasked-for lines (1)");
}

#[test]
fn the_wrong_speed_is_named() {
    let mut m = machine("echo.c");
    m.set_baud(9600);
    let error = Host::new(4).boot(&mut m, 1000).unwrap_err();
    assert!(error.to_string().contains("bytes came at another speed"), "{error}");
}

#[test]
fn a_refused_setting_stops_before_the_job() {
    let mut m = machine("echo.c");
    let options = Options { settings: vec!["{bad:1}".into()], ..Options::default() };
    let error = job::run(&mut m, &job::lines_of("G0 X1"), &options, |_| {}).unwrap_err();
    assert!(error.to_string().contains("refuses {bad:1} with status 100"), "{error}");
}

#[test]
fn the_line_runs_at_its_speed() {
    let mut m = machine("echo.c");
    let mut host = Host::new(4);
    host.boot(&mut m, 1000).unwrap();
    let from = m.cycle();
    // 100 bytes with the line end.
    let line = format!("({})", "x".repeat(97));
    host.ask(&mut m, &line, 1000).unwrap();
    let answer = 22.0 * 10.0 * 136.0;
    let want = 100.0 * 10.0 * 16e6 / 115_200.0 + answer;
    let took = (m.cycle() - from) as f64;
    assert!((took - want).abs() < 5_000.0, "{took} instead of {want}");
}

#[test]
fn steps_are_kept_on_demand() {
    let mut m = machine("echo.c");
    m.recorder_mut().keep_log();
    let mut host = Host::new(4);
    host.boot(&mut m, 1000).unwrap();
    host.ask(&mut m, "G0 X1", 1000).unwrap();
    host.run_for_ms(&mut m, 100).unwrap();
    let log = m.recorder().log();
    assert_eq!(log.len(), 80);
    assert!(log.iter().all(|s| s.motor == 0 && s.positive));
    // The first step comes as soon as its interrupt is enabled, at any time of the timer's period.
    assert!(log[1..].windows(2).all(|w| w[1].cycle - w[0].cycle > 600));
}
