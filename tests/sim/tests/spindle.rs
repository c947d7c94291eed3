//! The spindle's outputs on the chip: the width of its pulses, its levels, and the effect of a reset.

use kerf::boards::{Board, MEGA2560_GRBL, Pin, RAMPS14_CNC};
use kerf_sim::mechanics::Build;
use kerf_sim::{Host, LINES_IN_FLIGHT, Machine};

use crate::common::{booted, firmware, set};

/// Returns the top of the spindle's timer, at which it changes its direction of counting.
fn top(machine: &Machine) -> f64 {
    machine.peek_word(machine.board().pwm.unwrap().address() as u16 + 6).into()
}

/// Returns the level to which the firmware drives a pin; `None` if the pin is no output.
fn drives(machine: &Machine, pin: Pin) -> Option<bool> {
    let direction = machine.peek(pin.port.address() as u16 - 1);
    (direction & 1 << pin.bit != 0).then(|| machine.is_high(pin))
}

#[test]
fn pulses_are_as_wide_as_s_says_within_a_count() {
    for board in [&MEGA2560_GRBL, &RAMPS14_CNC] {
        let (mut machine, mut host) = booted(board);
        assert!((machine.pulses().hertz - 1_000.0).abs() < 0.01, "{:?}", machine.pulses());
        assert_eq!(machine.pulses().share, 0.0, "{:?}", machine.pulses());
        set(&mut machine, &mut host, "{p1:{csl:0,csh:12000,cpl:0,cph:1,pof:0}}");
        for hertz in [0.2, 1.0, 50.0, 1_000.0, 25_000.0, 400_000.0] {
            set(&mut machine, &mut host, &format!("{{p1frq:{hertz}}}"));
            let is = machine.pulses().hertz;
            assert!((is / hertz - 1.0).abs() <= 0.51 / top(&machine), "{is} instead of {hertz} Hz");
            for speed in [1.0, 3_000.0, 4_321.5, 11_999.0, 12_000.0] {
                set(&mut machine, &mut host, &format!("m3 s{speed}"));
                host.run_for_ms(&mut machine, 20).unwrap();
                let counts = machine.pulses().share * top(&machine);
                let wanted = speed / 12_000.0 * top(&machine);
                assert!(
                    (counts - wanted).abs() < 0.6,
                    "{hertz} Hz s{speed}: {counts}, not {wanted}"
                );
            }
        }
        set(&mut machine, &mut host, "m5");
        host.run_for_ms(&mut machine, 20).unwrap();
        assert_eq!(machine.pulses().share, 0.0);
    }
}

#[test]
fn direction_stands_before_the_spindle_is_on() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    let [Some(enable), Some(direction), ..] = MEGA2560_GRBL.outputs else { unreachable!() };
    machine.send(b"m4 s12000\n");
    let end = machine.cycle() + machine.cycles(1_000);
    while !machine.is_high(enable) {
        assert!(machine.cycle() < end, "it does not start");
        machine.step(end).unwrap();
    }
    assert!(machine.is_high(direction) && machine.pulses().share > 0.1);
    host.run_for_ms(&mut machine, 100).unwrap();
    // With the spindle off, the direction does not change.
    set(&mut machine, &mut host, "m5");
    host.run_for_ms(&mut machine, 20).unwrap();
    assert!(!machine.is_high(enable) && machine.is_high(direction));
}

/// Returns whether the enable pin is driven low and whether high, from reset until the machine is ready.
fn levels_at_start(board: &'static Board, eeprom: &[u8; 4096]) -> (bool, bool) {
    let mut machine = firmware(board);
    machine.set_eeprom(eeprom);
    let enable = board.outputs[0].unwrap();
    let end = machine.cycles(400);
    let mut seen = (false, false);
    while machine.cycle() < end {
        machine.step(end).unwrap();
        match drives(&machine, enable) {
            Some(true) => seen.1 = true,
            Some(false) => seen.0 = true,
            None => {}
        }
    }
    seen
}

#[test]
fn an_enable_that_is_active_low_is_never_low_at_start() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    let enable = MEGA2560_GRBL.outputs[0].unwrap();
    assert_eq!(drives(&machine, enable), Some(false));
    set(&mut machine, &mut host, "{spep:0}");
    assert_eq!(drives(&machine, enable), Some(true));
    set(&mut machine, &mut host, "m3 s1000");
    host.run_for_ms(&mut machine, 500).unwrap();
    assert_eq!(drives(&machine, enable), Some(false));
    assert_eq!(levels_at_start(&MEGA2560_GRBL, machine.eeprom()), (false, true));
    assert_eq!(levels_at_start(&MEGA2560_GRBL, &[0xFF; 4096]), (true, false));
}

#[test]
fn a_reset_stops_the_spindle() {
    let (mut machine, mut host) = (firmware(&RAMPS14_CNC), Host::new(LINES_IN_FLIGHT));
    host.boot(&mut machine, 1_000).unwrap();
    // While the dialect is open a `^x` at rest only greets.
    set(&mut machine, &mut host, "{fb:n}");
    set(&mut machine, &mut host, "m3 s2000");
    set(&mut machine, &mut host, "m8");
    host.run_for_ms(&mut machine, 100).unwrap();
    assert!(machine.is_high(RAMPS14_CNC.outputs[0].unwrap()));
    machine.send_now(0x18);
    machine.run_for_ms(500).unwrap();
    assert_eq!(machine.resets(), 1);
    for pin in RAMPS14_CNC.hazards {
        assert_eq!(drives(&machine, *pin), Some(false), "{pin:?}");
    }
    assert_eq!(machine.pulses().share, 0.0);
}

/// Runs for `ms` milliseconds with a spindle that follows the pulses.
fn run_spindle(machine: &mut Machine, ms: u64) {
    for _ in 0..ms {
        machine.run_for_ms(1).unwrap();
        let share = machine.pulses().share;
        machine.tamper(|mechanics, now| mechanics.drive_spindle(share, now));
    }
}

/// The spindle's speed.
fn rpm(machine: &Machine) -> f64 {
    machine.mechanics().unwrap().spindle_rpm(machine.cycle())
}

#[test]
fn a_spindle_is_up_to_speed_when_the_cut_begins() {
    let mut machine = firmware(&MEGA2560_GRBL);
    let mut build = Build::of(&MEGA2560_GRBL);
    build.spindle.pwm = MEGA2560_GRBL.pwm.map(|pwm| pwm.pin());
    machine.build(&build);
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut machine, 1_000).unwrap();
    set(&mut machine, &mut host, "{p1:{csl:0,csh:12000,cpl:0,cph:1,wsl:0,wsh:12000}}");
    set(&mut machine, &mut host, "{p1:{wpl:0,wph:1,pof:0},sp:{ph:1,de:2.5}}");
    for (line, speed) in [("m3 s1000\n", 1_000.0), ("m4 s6000\n", -6_000.0)] {
        // Motion under way ends first.
        run_spindle(&mut machine, 2_000);
        machine.send(line.as_bytes());
        machine.send(format!("g91 g1 f600 x{}\n", speed / 1_000.0).as_bytes());
        let steps = machine.recorder().steps();
        let mut waited = 0;
        while machine.recorder().steps() == steps {
            run_spindle(&mut machine, 1);
            waited += 1;
            assert!(waited < 4_000, "no step");
        }
        assert!((2_500..2_650).contains(&waited), "{waited} ms");
        // From the other direction the speed has 14,000 to go, of which a hundredth is left after 2.5 s.
        assert!((rpm(&machine) - speed).abs() < 100.0, "{}", rpm(&machine));
    }
    // A hold stops the spindle. After it the spindle starts before motion goes on.
    machine.send_now(b'!');
    run_spindle(&mut machine, 3_500);
    let steps = machine.recorder().steps();
    assert!(rpm(&machine).abs() < 20.0, "{}", rpm(&machine));
    machine.send_now(b'~');
    run_spindle(&mut machine, 2_400);
    assert_eq!(machine.recorder().steps(), steps);
    assert!((rpm(&machine) + 6_000.0).abs() < 60.0, "{}", rpm(&machine));
    run_spindle(&mut machine, 500);
    assert!(machine.recorder().steps() > steps);
}
