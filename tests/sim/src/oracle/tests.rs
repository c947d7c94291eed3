use super::*;

fn motor(axis: usize, angle: &str, travel: &str, microsteps: u32) -> MotorSetup {
    let decimal = |text| Decimal::parse(text).unwrap();
    let (step_angle, travel) = (decimal(angle), decimal(travel));
    MotorSetup {
        axis,
        besides: 0,
        step_angle,
        travel,
        microsteps,
        inverted: false,
        active_low: false,
    }
}

/// 80 steps/mm on X and Y, 2560/3 on Z, 100/9 steps/degree on A.
fn setup() -> Setup {
    let motors = vec![
        motor(0, "1.8", "40", 16),
        motor(1, "1.8", "40", 16),
        motor(2, "1.8", "1.875", 8),
        motor(3, "1.8", "360", 20),
    ];
    Setup { motors, modes: [AxisMode::Standard; AXES] }
}

fn outcome(job: &str) -> Outcome {
    let lines = job.lines().enumerate().map(|(i, l)| (i + 1, l));
    run(lines, &setup()).unwrap()
}

fn ends_at(job: &str, x: i64, y: i64) {
    let position = outcome(job).position;
    assert_eq!((position[0], position[1]), (x, y), "{job}");
}

#[test]
fn absolute_and_incremental() {
    ends_at("G0 X1 Y2\nG91\nG1 X.5 Y-.5 F100\nX.25\nG90\nY0", 17_500, 0);
}

#[test]
fn what_rounding_leaves_is_carried_over() {
    let increments = |word: &str, n: usize| format!("G91 G0\n{}", format!("{word}\n").repeat(n));
    // 30 times 0.0333333 are 0.999999, which is nearest to 1.0000.
    ends_at(&increments("X0.0333333 Y-0.0333333", 30), 10_000, -10_000);
    // 10,000 times a millionth of an inch, and of half an inch.
    ends_at(&format!("G20 {}", increments("X0.000001", 10_000)), 2_540, 0);
    ends_at(&format!("G7 {}", increments("X0.000002", 10_000)), 100, 0);
    // An absolute word leaves a rest, too.
    ends_at("G0 X0.00004\nG91 X0.00004", 1, 0);
    ends_at("G0 X0.00004\nG92 X0\nG91 X0.00004", 0, 0);
}

#[test]
fn all_nine_systems_and_the_table_of_tools() {
    ends_at("G10 L2 P9 X10\nG59.3 G0 X1", 110_000, 0);
    ends_at("G59.1 G10 L20 P0 X1\nG0 X5", 40_000, 0);
    ends_at("G10 L1 P2 Z5\nG10 L10 P1 Z2\nG0 X5", 50_000, 0);
    ends_at("G0 X5\nG92 X2\nG10 L20 P1 X2\nG0 X0", 30_000, 0);
}

#[test]
fn a_tap_ends_where_it_begins() {
    ends_at("G0 X5 Y1\nG33.1 Y-9 K1\nG0 X6", 60_000, 10_000);
}

#[test]
fn inches_are_exact_and_apply_to_their_own_line() {
    ends_at("G20 X1 Y-0.5\nG21 Y0.0001", 254_000, 1);
}

#[test]
fn rotary_axes_know_no_inches() {
    assert_eq!(outcome("G20 G0 A90").position[3], 900_000);
    assert_eq!(outcome("G20 G0 A90").steps[3], 1000);
}

#[test]
fn steps_round_halves_away_from_zero() {
    // 0.00625 mm is half a step; words are in units of 0.0001 mm.
    assert_eq!(outcome("G0 X0.0063").steps[0], 1);
    assert_eq!(outcome("G0 X0.0062").steps[0], 0);
    assert_eq!(outcome("G0 X-0.0063").steps[0], -1);
    assert_eq!(outcome("G0 Z3").steps[2], 2560);
    assert_eq!(outcome("G0 Z0.001").steps[2], 1);
}

#[test]
fn arcs_end_where_they_say() {
    ends_at("G0 X10\nG2 X0 Y10 I-10 F500\nG3 X0 Y10 I0 J-5", 0, 100_000);
}

#[test]
fn offsets_add_up() {
    ends_at("G10 L2 P2 X10 Y20\nG55 G0 X1 Y1\nG53 X5", 50_000, 210_000);
    ends_at("G0 X5\nG92 X0\nG0 X1", 60_000, 0);
    ends_at("G0 X5\nG92 X0\nG92.1\nG0 X1", 10_000, 0);
    ends_at("G0 X5\nG92 X0\nG92.2\nG0 X1\nG92.3\nG0 X1", 60_000, 0);
    ends_at("G0 X5\nG10 L20 P1 X1\nG0 X0", 40_000, 0);
}

#[test]
fn program_end_puts_modes_back() {
    ends_at("G0 X5\nG92 X0\nG91\nM30\nG0 X1", 10_000, 0);
    ends_at("G20\nM2\nG0 X1", 254_000, 0);
    ends_at("G0 X1\nM30\nX2", 10_000, 0);
}

#[test]
fn set_position_makes_no_steps() {
    let end = outcome("G0 X1\nG28.3 X100\nG0 X101");
    assert_eq!((end.position[0], end.steps[0]), (1_010_000, 160));
}

#[test]
fn a_line_does_one_thing() {
    ends_at("G0 X1\nG4 P0.5 X9", 10_000, 0);
    assert_eq!(outcome("G4 P1.5\nG4 P0.5").longest_dwell_ms, 1500);
}

#[test]
fn modes_of_axes() {
    let mut setup = setup();
    setup.modes[0] = AxisMode::Disabled;
    setup.modes[1] = AxisMode::Inhibited;
    let end = run([(1, "G0 X1 Y1 Z1.5")], &setup).unwrap();
    assert_eq!(end.position[..3], [0, 10_000, 15_000]);
    assert_eq!(end.steps[..3], [0, 0, 1280]);
}

#[test]
fn a_radius_is_unclear_only_when_used() {
    let mut setup = setup();
    setup.modes[3] = AxisMode::Radius;
    assert!(run([(1, "G0 X1")], &setup).is_ok());
    let unclear = run([(1, "G0 A1")], &setup).unwrap_err();
    assert_eq!(unclear.to_string(), "line 1: the oracle does not know A in radius mode");
}

#[test]
fn what_it_does_not_know_it_says() {
    let unclear = run([(1, "G0 X1"), (2, "G38.2 Z-5 F10")], &setup()).unwrap_err();
    assert_eq!(unclear.to_string(), "line 2: the oracle does not know G38.2");
}
