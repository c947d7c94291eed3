//! Alarms on the image: how soon the outputs of spindle and coolant are off.

use kerf::boards::{Board, MEGA2560_GRBL, Pin, RAMPS14_CNC, inputs};
use kerf_sim::mechanics::Build;
use kerf_sim::{Host, Machine};

use crate::common::{MS, booted, say_line, say_now, set};

/// Longest time from the last bit of a line, ms. The line is read between others: 250 moves a second at 32,000 steps
/// a second leave little of the CPU. Measured: 22.7 ms; in a long move 7.2.
const LINE_MS: f64 = 30.0;
/// Longest time from the edge of a switch, ms: a turn of the tasks, and the interrupts meanwhile. Measured: 2.5 ms.
const SWITCH_MS: f64 = 4.0;
/// Longest time from the last bit of `^x`, ms; the watchdog makes the reset. Measured: 28.5 ms.
const RESET_MS: f64 = 35.0;

/// What raises an alarm.
#[derive(Clone, Copy, Debug)]
enum Cause {
    Line(&'static str),
    Switch(usize),
    Reset,
}
use Cause::{Line, Reset, Switch};

/// A machine with the spindle turning and the coolant on, in a long move or in many short ones.
fn running(board: &'static Board, short: bool) -> (Machine, Host) {
    let (mut machine, mut host) = booted(board);
    machine.build(&Build::of(board));
    host.run_for_ms(&mut machine, 50).unwrap();
    for line in [
        "{x:{vm:1500,fr:1500,ac:1000,jm:5000,sn:2},est:1,ej:1}",
        "{p1:{csl:0,csh:12000,cpl:0,cph:1,pof:0},sp:{de:0}}",
        "m3 s6000 f1500",
        "m7",
        "m8",
    ] {
        set(&mut machine, &mut host, line);
    }
    if short {
        (1..400).for_each(|n| host.queue(n, &format!("g1 x{:.1}", n as f64 * 0.1)));
    } else {
        set(&mut machine, &mut host, "g1 x90");
    }
    host.run_for_ms(&mut machine, 300).unwrap();
    assert!(machine.recorder().steps() > 1_000);
    assert!(on(&machine).iter().all(|on| *on), "{:?}", on(&machine));
    assert!((machine.pulses().share - 0.5).abs() < 0.01);
    (machine, host)
}

/// Whether the firmware drives a pin high.
fn is_driven(machine: &Machine, pin: Pin) -> bool {
    machine.peek(pin.port.address() as u16 - 1) & 1 << pin.bit != 0 && machine.is_high(pin)
}

/// Whether the spindle is enabled, has pulses, and the two coolants are on.
fn on(machine: &Machine) -> [bool; 4] {
    let board = machine.board();
    let [enable, _, mist, flood] = board.outputs;
    let [enable, mist, flood] = [enable, mist, flood].map(|pin| is_driven(machine, pin.unwrap()));
    let pulses = board.pwm.unwrap().pin();
    let is_output = machine.peek(pulses.port.address() as u16 - 1) & 1 << pulses.bit != 0;
    [enable, is_output && machine.pulses().share > 0.0, mist, flood]
}

/// Raises the alarm, and returns the cycle at which the machine had received all of it.
fn raise(machine: &mut Machine, host: &mut Host, cause: Cause) -> u64 {
    match cause {
        Switch(input) => {
            machine.tamper(|mechanics, now| mechanics.work(input, true, now));
            machine.cycle()
        }
        Line(text) => say_line(machine, host, text),
        Reset => say_now(machine, 0x18),
    }
}

/// Returns how long it takes until all is off, cycles.
fn off_after(machine: &mut Machine, host: &mut Host, cause: Cause) -> u64 {
    let from = raise(machine, host, cause);
    let end = from + 100 * MS;
    while on(machine).contains(&true) {
        assert!(machine.cycle() < end, "{cause:?}: {:?}", on(machine));
        machine.step(end).unwrap();
    }
    let after = machine.cycle().saturating_sub(from);
    // All stays off.
    for _ in 0..100 {
        host.run_for_ms(machine, 1).unwrap();
        assert!(!on(machine).contains(&true), "{cause:?}: {:?}", on(machine));
    }
    after
}

#[test]
fn every_alarm_switches_the_outputs_off() {
    for board in [&MEGA2560_GRBL, &RAMPS14_CNC] {
        for (cause, within) in [
            (Line("{alarm:n}"), LINE_MS),
            (Line("{shutd:n}"), LINE_MS),
            (Line("{panic:n}"), LINE_MS),
            (Switch(inputs::X_MIN), SWITCH_MS),
            (Switch(inputs::STOP), SWITCH_MS),
            (Reset, RESET_MS),
        ] {
            let mut worst = [0; 2];
            let moments = if board.name == MEGA2560_GRBL.name { 6 } else { 2 };
            for n in 0..moments {
                let short = n % 2 == 1;
                let (mut machine, mut host) = running(board, short);
                let moment = machine.cycle() + n * 91_939;
                host.run_until(&mut machine, moment).unwrap();
                let after = off_after(&mut machine, &mut host, cause);
                let worst = &mut worst[usize::from(short)];
                *worst = after.max(*worst);
            }
            let [long, short] = worst.map(|cycles| cycles as f64 / MS as f64);
            let ms = long.max(short);
            println!("{} {cause:?}: {long:.3} and {short:.3} ms", board.name);
            assert!(ms <= within, "{cause:?}: {ms} ms");
        }
    }
}
