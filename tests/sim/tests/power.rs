//! Motors have power before they step, each by its own enable pin where the board has one.

use kerf::boards::{Board, MEGA2560_GRBL, Pin, RAMPS14_CNC};
use kerf_sim::Machine;

use crate::common::{booted, set};

/// Whether an enable pin, which is active low, is on.
fn is_on(machine: &Machine, pin: Pin) -> bool {
    machine.peek(pin.port.address() as u16) & 1 << pin.bit == 0
}

/// Runs until the first step, instruction by instruction. Returns how many cycles before it `enable` came on.
fn lead(board: &'static Board, line: &str, enable: Pin) -> u64 {
    let (mut machine, mut host) = booted(board);
    set(&mut machine, &mut host, "{1pm:3,2pm:3,3pm:3,4pm:3,aam:1}");
    assert!(!is_on(&machine, enable));
    machine.send(format!("{line}\n").as_bytes());
    let (end, mut on) = (machine.cycle() + machine.cycles(1_000), None);
    while machine.recorder().steps() == 0 {
        assert!(machine.cycle() < end, "no step");
        machine.step(end).unwrap();
        on = on.or(is_on(&machine, enable).then(|| machine.cycle()));
    }
    machine.cycle() - on.expect("it steps without power")
}

#[test]
fn power_comes_before_the_first_step() {
    // At least 25 us.
    assert!(lead(&MEGA2560_GRBL, "g0 x1", MEGA2560_GRBL.enable_all.unwrap()) > 400);
    for (motor, line) in ["g0 x1", "g0 y1", "g0 z1", "g0 a1"].iter().enumerate() {
        assert!(
            lead(&RAMPS14_CNC, line, RAMPS14_CNC.motors[motor].enable.unwrap()) > 400,
            "{line}"
        );
    }
}

#[test]
fn a_motor_that_stands_still_stays_off() {
    let (mut machine, mut host) = booted(&RAMPS14_CNC);
    set(&mut machine, &mut host, "{1pm:3,2pm:3,3pm:2,4pm:0,mt:0.2,aam:1}");
    set(&mut machine, &mut host, "g1 f500 y1 a1");
    machine.run_for_ms(60).unwrap();
    let on = |machine: &Machine| {
        [0, 1, 2, 3].map(|m| is_on(machine, RAMPS14_CNC.motors[m].enable.unwrap()))
    };
    assert_eq!(on(&machine), [false, true, true, false]);
    machine.run_for_ms(2_000).unwrap();
    assert_eq!(on(&machine), [false; 4]);
    assert_eq!(machine.recorder().motors()[1].position, 1280);
}
