//! Setting and showing values.

use super::*;
use crate::capability::Capability;
use crate::units::Length;
use proptest::prelude::*;
use std::string::String;

fn setting(name: &str) -> Setting {
    Name::new().with(name.as_bytes()).and_then(|name| Setting::find(&name)).unwrap()
}

fn set(settings: &mut Settings, name: &str, value: &str, inches: bool) -> Result<(), Status> {
    let (setting, number) = (setting(name), Number::parse(value.as_bytes()).unwrap());
    let value = settings.check(setting, number, inches)?;
    settings.store(setting, value);
    Ok(())
}

fn shown(settings: &Settings, name: &str, inches: bool) -> String {
    let mut buffer = Digits::default();
    let text = settings
        .show(setting(name), settings.get(setting(name)), inches)
        .render(&mut buffer)
        .to_vec();
    String::from_utf8(text).unwrap()
}

#[test]
fn defaults_show_as_documented() {
    let settings = Settings::new();
    for (name, value) in [
        ("fb", "440.20"),
        ("fv", "0.970"),
        ("hp", "1"),
        ("ja", "720000"),
        ("ct", "0.0100"),
        ("mt", "2.00"),
        ("1tr", "1.2500"),
        ("4tr", "360.0000"),
        ("1sa", "1.800"),
        ("xvm", "800"),
        ("ajm", "2000"),
        ("ara", "0.199"),
        ("ztn", "-75.000"),
        ("atn", "-1.000"),
        ("cjd", "0.0100"),
        ("xac", "200.0"),
        ("gpa", "2"),
        ("mch", "0"),
    ] {
        assert_eq!(shown(&settings, name, false), value, "{name}");
    }
}

#[test]
fn inches_convert_lengths_only() {
    let mut settings = Settings::new();
    set(&mut settings, "xvm", "100", true).unwrap();
    assert_eq!(shown(&settings, "xvm", false), "2540");
    assert_eq!(shown(&settings, "xvm", true), "100");
    set(&mut settings, "avm", "100", true).unwrap();
    assert_eq!(shown(&settings, "avm", true), "100");
    set(&mut settings, "ara", "1", true).unwrap();
    assert_eq!(shown(&settings, "ara", false), "25.400");
    set(&mut settings, "xac", "20", true).unwrap();
    assert_eq!(shown(&settings, "xac", false), "508.0");
    assert_eq!(shown(&settings, "xac", true), "20.0");
    set(&mut settings, "cac", "20", true).unwrap();
    assert_eq!(shown(&settings, "cac", true), "20.0");
    set(&mut settings, "1tr", "0.05", true).unwrap();
    assert_eq!(shown(&settings, "1tr", false), "1.2700");
    set(&mut settings, "4tr", "90", true).unwrap();
    assert_eq!(shown(&settings, "4tr", true), "90.0000");
}

#[test]
fn refusals_have_their_codes() {
    let mut settings = Settings::new();
    for (name, value, status) in [
        ("gun", "2", Status::OutOfRange),
        ("gun", "-1", Status::OutOfRange),
        ("gun", "0.5", Status::BadNumber),
        ("1mi", "0", Status::OutOfRange),
        ("xam", "3", Status::AboveMaximum),
        ("xvm", "0", Status::BelowMinimum),
        ("xvm", "1e9", Status::AboveMaximum),
        ("xvm", "-1e99", Status::BelowMinimum),
        ("xac", "-1", Status::BelowMinimum),
        ("1sa", "0", Status::BelowMinimum),
        ("1tr", "-1", Status::BelowMinimum),
        ("fb", "1", Status::ReadOnly),
        ("id", "1", Status::ReadOnly),
        ("baud", "0", Status::OutOfRange),
        ("baud", "7", Status::OutOfRange),
        ("baud", "921600", Status::OutOfRange),
        ("baud", "1000001", Status::OutOfRange),
        ("baud", "-1", Status::OutOfRange),
        ("baud", "9600.5", Status::BadNumber),
        ("si", "200.5", Status::BadNumber),
        ("spw", "0", Status::OutOfRange),
        ("spw", "11", Status::OutOfRange),
        ("dsu", "101", Status::OutOfRange),
        ("1sp", "2", Status::OutOfRange),
    ] {
        assert_eq!(set(&mut settings, name, value, false), Err(status), "{name} {value}");
    }
    assert_eq!(shown(&settings, "xvm", false), "800");
    assert_eq!(set(&mut settings, "aam", "3", false), Ok(()));
}

#[test]
fn some_values_are_pulled_to_their_limits() {
    let mut settings = Settings::new();
    for (name, value, result) in [
        ("si", "10", "100"),
        ("si", "-10", "100"),
        ("si", "1e20", "65535"),
        ("mt", "0", "0.10"),
        ("mt", "5000000", "4294967.00"),
        ("xjm", "50000000", "50"),
        ("xjm", "1000000", "1000000"),
    ] {
        set(&mut settings, name, value, false).unwrap();
        assert_eq!(shown(&settings, name, false), result, "{name}");
    }
}

#[test]
fn a_rate_is_shown_as_it_was_set() {
    let mut settings = Settings::new();
    assert_eq!(shown(&settings, "baud", false), "5");
    for value in ["6", "1", "500000", "115200", "1000000"] {
        set(&mut settings, "baud", value, false).unwrap();
        assert_eq!(shown(&settings, "baud", true), value);
    }
}

#[test]
fn getters_have_their_units() {
    let mut settings = Settings::new();
    assert!((settings.velocity_max(3) - 7_200.0).abs() < 0.1);
    assert!((settings.feedrate_max(5) - 7_200.0).abs() < 0.001);
    assert_eq!(settings.jerk_max(0), 1e9);
    assert_eq!(settings.jerk_homing(4), 0.0);
    assert_eq!(settings.accel_max(0), 720_000.0);
    set(&mut settings, "xac", "500", false).unwrap();
    assert_eq!(settings.accel_max(0), 1_800_000.0);
    assert_eq!(settings.junction_deviation(0), 0.01);
    assert_eq!(settings.junction_acceleration(), 720_000.0);
    assert_eq!(settings.chordal_tolerance(), 0.01);
    assert_eq!(settings.travel_min(2), Length(-750_000));
    assert_eq!((settings.axis_mode(0), settings.axis_mode(3), settings.axis_mode(5)), (1, 1, 0));
    assert_eq!((settings.switch_min(0), settings.switch_max(2), settings.switch_max(5)), (1, 1, 0));
    assert_eq!(settings.status_interval_ms(), 500);
    assert_eq!((settings.json_verbosity(), settings.motor_axis(3)), (3, 3));
    assert_eq!(settings.step_ratio(0), StepRatio { num: 16, den: 125 });
    set(&mut settings, "1mi", "16", false).unwrap();
    assert_eq!(settings.step_ratio(0), StepRatio { num: 32, den: 125 });
    assert_eq!(settings.step_ratio(4), StepRatio::NONE);
    assert_eq!((settings.step_pulse_us(), settings.direction_setup_us()), (2, 1));
    set(&mut settings, "2sp", "1", false).unwrap();
    assert_eq!((settings.step_inverted(0), settings.step_inverted(1)), (false, true));
}

#[test]
fn ram_is_accounted_for() {
    let heating = if heating::PRINTERS == 0 { 0 } else { 12 };
    // The status and the padding behind it.
    let drives = drive::DRIVERS * 6;
    let bed = bed::BEDS * 48;
    let shaping = if Capability::Shaping.is_built_in() { 8 } else { 0 };
    let backlash = if Capability::Backlash.is_built_in() { 16 } else { 0 };
    assert_eq!(size_of::<Settings>(), 436 + heating + drives + bed + backlash + shaping);
    assert!(size_of::<SettingRow>() * 52 + (28 + 7 * 4 + 17 * 6) * 4 < 2048);
}

proptest! {
    #[test]
    fn what_is_shown_can_be_set(number in 0..Setting::NUMBERS, value: i32, inches: bool) {
        let setting = Setting::from_number(number).filter(|setting| !setting.is_cold());
        let Some(setting) = setting else { return Ok(()) };
        let mut settings = Settings::new();
        let (row, mut buffer) = (setting.row(), Digits::default());
        // Renders with the decimals shown, so that reading the text back loses nothing.
        let text = Fixed { value, decimals: row.shown }.render(&mut buffer).to_vec();
        let number = Number::parse(&text).unwrap();
        let Ok(value) = settings.check(setting, number, inches) else { return Ok(()) };
        settings.store(setting, value);
        prop_assert_eq!(settings.get(setting), value);
        let shown = settings.show(setting, settings.get(setting), inches).render(&mut buffer).to_vec();
        let clamped = row.is(CLAMP) || row.is(JERK);
        prop_assert!(shown == text || clamped, "{:?} {:?}", text, shown);
    }
}
