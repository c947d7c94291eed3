//! Boards with an RP2040 that people own, beside `pico` and `skr-pico`: their pins, and what only they have. The tests run
//! like those of `pico.rs`.

use kerf::boards::{Board, PICOBOB, PICOHAL, gp};
use kerf_sim::emulated::{Emulated, Near};
use kerf_sim::{AUX, Host};

use crate::pico::{run_on, set, started, value};

/// A part of `examples/square.gcode` in all four axes.
const JOB: &str = "g91\ng1 f900 x3 y-2 z1.5 a-4\ng2 x2 i1\ng1 x-1 y3 a9\nm30\n";

/// Returns the pins of steps and directions, motor 1 first.
fn motors(board: &Board) -> Vec<(u8, u8)> {
    board.motors.iter().map(|motor| (motor.step.bit, motor.dir.bit)).collect()
}

/// Runs [`JOB`], which must end on its steps, at the pins that `motors` names.
fn runs_its_job(board: &'static Board, wired: &[(u8, u8)]) -> Emulated {
    assert_eq!(motors(board), wired);
    let mut machine = Emulated::load(&crate::common::image(board), board).unwrap();
    print!("{}", run_on(&mut machine, board.name, JOB, &["{a:{am:1}}"]));
    machine
}

/// Waits until nothing moves, and returns the exception that was reported, if any.
fn ended(board: &mut Emulated, host: &mut Host) -> Option<String> {
    let is_at_rest = |board: &mut Emulated, host: &mut Host| {
        host.run_for_ms(board, 100).unwrap();
        // Ready, in an alarm, or at the end of a motion or a program.
        (1.0..=4.0).contains(&value(board, host, "stat"))
    };
    assert!((0..600).any(|_| is_at_rest(board, host)), "it still moves");
    let told = host.take_reports().into_iter().map(|report| report.to_string());
    told.chain(host.strays().iter().cloned()).find(|line| line.contains("\"er\""))
}

/// A switch at a pin, closed while a motor is at or below a step.
fn near(gpio: u8, motor: usize, step: i64) -> Near {
    Near { gpio, motor, step, above: false, back: 100, opens: false }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_picobob_runs_five_motors_and_homes_by_shared_switches() {
    let five = [(17, 9), (18, 10), (19, 11), (20, 12), (21, 13)];
    runs_its_job(&PICOBOB, &five);
    let (mut board, mut host) = started(&PICOBOB);
    // The fifth motor on Y, too; X and Z share the input GP2.
    board.wire(&[near(2, 0, -3_000), near(2, 2, -2_000)]);
    for line in ["{5ma:1,5tr:1.25,sv:0}", "{xsn:3,xsx:0,zsn:3,zsx:0}", "{x:{jh:2000},z:{jh:2000}}"]
    {
        set(&mut board, &mut host, line);
    }
    set(&mut board, &mut host, "g28.2 x0 z0");
    assert_eq!(ended(&mut board, &mut host), None);
    let homed = board.positions().to_vec();
    // Where the switch opens, and a millimetre.
    assert_eq!(homed, [-2_900 + 1_280, 0, -1_900 + 1_280, 0, 0]);
    set(&mut board, &mut host, "m3 s12000");
    set(&mut board, &mut host, "m8");
    set(&mut board, &mut host, "g91 g1 f800 x1 y-2");
    assert_eq!(ended(&mut board, &mut host), None);
    assert!(board.is_high(gp(16)) && (board.share(gp(14)) - 0.5).abs() < 0.01);
    let moved: Vec<_> = board.positions().iter().zip(homed).map(|(now, was)| now - was).collect();
    assert_eq!(moved, [1_280, -2_560, 0, 0, -2_560]);
    let directions = [9, 10, 11, 12, 13].map(|pin| board.is_high(gp(pin)));
    assert_eq!(directions, [false, true, false, false, true]);
    // Away from homing the shared switch is a limit, for both axes.
    set(&mut board, &mut host, "g91 g0 x-9");
    host.run_for_ms(&mut board, 2_000).unwrap();
    assert_eq!(value(&mut board, &mut host, "stat"), 2.0, "an alarm");
    assert!(!board.is_high(gp(16)) && board.share(gp(14)) == 0.0, "outputs are off");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_picohal_has_its_second_port_on_other_pins() {
    let mut board = runs_its_job(&PICOHAL, &[(16, 20), (17, 21), (18, 22), (19, 23)]);
    let serial = [0, 1, 12, 13].map(|pin| board.is_serial(gp(pin)));
    assert_eq!(serial, [false, false, true, true]);
    board.send_to(AUX, b"{xvm:n}\n");
    board.run_for_ms(100).unwrap();
    let said = String::from_utf8(board.receive_from(AUX)).unwrap();
    assert!(said.contains("\"xvm\""), "{said}");
    let (mut board, mut host) = started(&PICOHAL);
    assert!(board.is_high(gp(24)), "the drivers are off before the first move");
    set(&mut board, &mut host, "m4 s6000");
    set(&mut board, &mut host, "g91 g1 f600 x1");
    host.run_for_ms(&mut board, 500).unwrap();
    assert_eq!([7, 26, 24].map(|pin| board.is_high(gp(pin))), [true, true, false]);
    assert!((board.share(gp(25)) - 0.25).abs() < 0.01);
    // The emergency stop, at Hold.
    set(&mut board, &mut host, "{est:1}");
    board.drive(gp(6), false);
    host.run_for_ms(&mut board, 100).unwrap();
    assert!(!board.is_high(gp(7)) && board.share(gp(25)) == 0.0, "the spindle is off");
    let stands = board.positions().to_vec();
    host.run_for_ms(&mut board, 2_500).unwrap();
    assert!(board.is_high(gp(24)) && board.positions() == stands, "no motor has power");
}
