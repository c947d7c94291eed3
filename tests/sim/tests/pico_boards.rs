//! Boards with an RP2040 that people own, beside `pico` and `skr-pico`: their pins, and what only they have. The tests run
//! like those of `pico.rs`.

use kerf::boards::inputs::{STOP, X_MIN};
use kerf::boards::{Board, PICOBOB, PICOCNC, PICOHAL, Pin, Port, gp, pin};
use kerf_sim::emulated::even::{FAST, evenness};
use kerf_sim::emulated::{Emulated, Near};
use kerf_sim::{AUX, Host, Runs, USB};

use crate::common::image;
use crate::pico::{STOP_US, run_on, set, started, value};

/// A part of `examples/square.gcode` in all four axes.
const JOB: &str = "g91\ng1 f900 x3 y-2 z1.5 a-4\ng2 x2 i1\ng1 x-1 y3 a9\nm30\n";

/// Returns the pins of steps and directions, motor 1 first.
fn motors(board: &Board) -> Vec<(u8, u8)> {
    board.motors.iter().map(|motor| (motor.step.bit, motor.dir.bit)).collect()
}

/// Runs [`JOB`], which must end on its steps, at the pins that `motors` names.
fn runs_its_job(board: &'static Board, wired: &[(u8, u8)]) -> Emulated {
    assert_eq!(motors(board), wired);
    let mut machine = Emulated::load(&image(board), board).unwrap();
    print!("{}", run_on(&mut machine, board.name, JOB, &["{a:{am:1}}", "{2po:1}"]));
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

/// An output of the register of outputs of a PicoCNC: the enables of X, Y, Z and A, the spindle's direction and enable,
/// mist, flood.
const fn output(number: u8) -> Pin {
    pin(Port::Outputs, number)
}

const SPINDLE: Pin = output(5);
const FLOOD: Pin = output(7);
/// The pin of the spindle's speed. A transistor inverts it: always low is full speed.
const SPEED: Pin = gp(27);

/// The levels of the register of outputs, with drivers on as 0 and off as 1.
fn outputs(board: &Emulated) -> u16 {
    (0..16).fold(0, |bits, n| bits | u16::from(board.is_high(output(n))) << n)
}

/// Drivers off, everything else low.
const SAFE: u16 = 0b1111;

/// A 74HCT595 takes pulses of 24 ns, and data and clock 24 ns before the next edge, at 4.5 V and 125 degrees (data sheet of
/// Nexperia, dynamic characteristics). A cycle is 7.8 ns.
const REGISTER_CYCLES: u64 = 4;

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_picocnc_runs_its_job_behind_registers() {
    let mut board = runs_its_job(&PICOCNC, &[(0, 4), (1, 5), (2, 6), (3, 7)]);
    let times = [Port::Steps, Port::Outputs].map(|port| board.register_time(port));
    println!("{times:?} cycles");
    assert_eq!(times, [Some(REGISTER_CYCLES); 2]);
    // Everything at the register is high at power-up, until the image has begun.
    board.cut_power();
    board.run_for_us(1).unwrap();
    assert_eq!(outputs(&board), u16::MAX);
    board.run_for_us(100).unwrap();
    assert_eq!(outputs(&board), SAFE);
    board.run_for_ms(300).unwrap();
    assert_eq!(outputs(&board), SAFE);
    assert_eq!(board.share(SPEED), 1.0, "no speed");
}

/// One output changes at a time, and no other moves meanwhile.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn outputs_of_a_picocnc_change_one_by_one() {
    let (mut board, mut host) = started(&PICOCNC);
    let mut changes = |line: &str, ms| {
        set(&mut board, &mut host, line);
        let edges = board.record_for_ms(ms).unwrap().edges;
        host.run_for_ms(&mut board, 1).unwrap();
        edges.into_iter().map(|(output, rises, _)| (output, rises)).collect::<Vec<_>>()
    };
    assert_eq!(changes("m4 s12000", 50), [(4, true), (5, true)], "the direction first");
    assert_eq!(changes("m8", 50), [(7, true)]);
    assert_eq!(changes("m7", 50), [(6, true)]);
    assert_eq!(changes("{1pm:3,2pm:3,3pm:3,4pm:3}", 50), []);
    assert_eq!(changes("g91 g1 f600 x1 y1", 50), [(0, false), (1, false)]);
    assert_eq!(changes("{mt:0.5}", 1_500), [(0, true), (1, true)]);
    assert_eq!(changes("m9", 50), [(6, false), (7, false)]);
    assert_eq!(changes("m3 s6000", 50), [(4, false)]);
    assert_eq!(changes("m5", 50), [(5, false)]);
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_picocnc_is_as_fast_as_its_register() {
    let (mut board, mut host) = started(&PICOCNC);
    FAST.iter().for_each(|line| set(&mut board, &mut host, line));
    set(&mut board, &mut host, "g0 x100 y100 z100 a100");
    host.run_for_ms(&mut board, 105).unwrap();
    let asleep = board.asleep();
    let recorded = board.record_for_ms(4).unwrap();
    let busy = 1.0 - (board.asleep() - asleep) / (4.0 * 128e3);
    let motors: Vec<_> = recorded.times.iter().map(|times| evenness(times)).collect();
    println!("{motors:?}, {:?} cycles, {:.0} % busy", recorded.shortest, 100.0 * busy);
    assert_eq!(motors.len(), 4);
    assert!(motors.iter().all(|motor| motor.0 > 900e3 && motor.1 == 0), "even to the cycle");
    assert!(recorded.shortest >= Some(64.0));
    host.run_for_ms(&mut board, 1_000).unwrap();
    assert_eq!(board.positions(), [128_000; 4]);
    assert_eq!(value(&mut board, &mut host, "stv"), 0.0, "late segments");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn directions_of_a_picocnc_stand_before_and_behind_pulses() {
    for (pulse_us, setup_us) in [(0, 1), (2, 5)] {
        let (mut board, mut host) = started(&PICOCNC);
        let fast = "{x:{vm:20000,fr:20000,ac:3000,jm:1e6},y:{vm:20000,fr:20000,ac:3000,jm:1e6}}";
        for line in [fast, &format!("{{spw:{pulse_us},dsu:{setup_us}}}")] {
            set(&mut board, &mut host, line);
        }
        let mut lines = String::from("g1 f20000 x9 y5\n");
        for _ in 0..2 {
            lines += "g2 x1 i-4\ng3 x9 i4\nx9.01\nx9\ny0 x0\nx9 y5\n";
        }
        board.send_to(USB, lines.as_bytes());
        let recorded = board.record_for_ms(4_000).unwrap();
        let [hold, setup] = [recorded.hold, recorded.setup].map(|least| least.unwrap() / 128.0);
        let pulse = recorded.shortest.unwrap() / 128.0;
        println!("{pulse:.2} us, {hold:.2} us behind, {setup:.2} us before");
        assert!(hold >= 1.0 && setup >= f64::from(setup_us), "{hold} {setup}");
        assert_eq!(board.positions()[..2], [11_520, 6_400]);
    }
}

/// A PicoCNC that can make 900,000 steps a second, with limits and an emergency stop.
fn fast_cnc() -> (Emulated, Host) {
    let (mut board, mut host) = started(&PICOCNC);
    for line in FAST.iter().chain(&["{xsn:2,est:1}"]) {
        set(&mut board, &mut host, line);
    }
    (board, host)
}

/// Sends it to X100 Y70 with spindle and flood on, up to where X makes 900,000 steps a second.
fn hurry(board: &mut Emulated, host: &mut Host) {
    for line in ["m3 s24000", "m8", "g0 x100 y70"] {
        set(board, host, line);
    }
    host.run_for_ms(board, 100).unwrap();
    assert_eq!(outputs(board), 1 << 5 | 1 << 7, "drivers, spindle and flood are on");
    assert_eq!(board.share(SPEED), 0.0, "full speed");
}

/// Whether the spindle, its speed and flood are off.
fn is_off(board: &Emulated) -> bool {
    !board.is_high(SPINDLE) && !board.is_high(FLOOD) && board.share(SPEED) == 1.0
}

/// Stops at `input` on the way. Returns the time from its edge to the last step, us. `offset` is where X
/// stands at 0.
fn stops(board: &mut Emulated, host: &mut Host, input: Pin, offset: i64) -> f64 {
    let edge = board.cycle();
    board.drive(input, false);
    board.run_for_ms(30).unwrap();
    let after = board.last_step().unwrap().saturating_sub(edge) as f64 / 128.0;
    assert!(is_off(board), "outputs are off");
    board.drive(input, true);
    host.run_for_ms(board, 50).unwrap();
    set(board, host, "{clear:1}");
    let steps = [board.positions()[0] - offset, board.positions()[1]];
    for (steps, token) in steps.into_iter().zip(["mpox", "mpoy"]) {
        let said = value(board, host, token) * 1_280.0;
        assert!((said - steps as f64).abs() < 0.7, "{token}: {said} and {steps}");
    }
    assert!(steps[0] > 20_000, "{steps:?}");
    set(board, host, "g0 x0 y0");
    ended(board, host);
    assert_eq!(board.positions(), [offset, 0, 0, 0], "back from where it stood");
    after
}

/// Stops come at any instruction of the program that shifts bits out: a step takes 142 cycles.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_picocnc_stops_at_once_and_counts_its_steps() {
    let (limit, stop) = (PICOCNC.inputs[X_MIN].unwrap(), PICOCNC.inputs[STOP].unwrap());
    let (mut board, mut host) = fast_cnc();
    let mut slowest = 0.0_f64;
    for moment in 0..9 {
        hurry(&mut board, &mut host);
        let until = board.cycle() + 130 + moment * 77;
        host.run_until(&mut board, until).unwrap();
        let input = if moment % 3 == 2 { stop } else { limit };
        slowest = slowest.max(stops(&mut board, &mut host, input, 0));
    }
    println!("{slowest:.1} us");
    assert!(slowest <= STOP_US, "{slowest}");
    // A pulse that was cut short by a stop ends when the motors have settled, so that its last edge comes later.
    set(&mut board, &mut host, "{1sp:1}");
    host.run_for_ms(&mut board, 10).unwrap();
    let offset = board.positions()[0];
    assert_eq!(offset, -1, "the edge at which X begins to rest high, towards lower X");
    for moment in 0..4 {
        hurry(&mut board, &mut host);
        let until = board.cycle() + moment * 33;
        host.run_until(&mut board, until).unwrap();
        stops(&mut board, &mut host, limit, offset);
    }
    assert!(board.is_high(pin(Port::Steps, 0)) && !board.is_high(pin(Port::Steps, 1)));
}

/// A panic, a fault of the CPU, and what only the watchdog ends: the register would keep its outputs.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn faults_of_a_picocnc_switch_its_outputs_off() {
    for fault in ["panic", "address", "stack", "stuck", "reset"] {
        let (mut board, mut host) = fast_cnc();
        hurry(&mut board, &mut host);
        match fault {
            "panic" => board.panic("src/some.rs"),
            "stuck" => board.stick(),
            "reset" => board.reset(),
            _ => board.crash(fault),
        }
        // Half a second, if only the watchdog ends it.
        board.run_for_ms(1).unwrap();
        if ["stack", "stuck"].contains(&fault) {
            board.run_for_ms(519).unwrap();
            assert_eq!(board.resets(), 1, "{fault}");
        }
        let stands = board.positions().to_vec();
        assert!(!board.is_high(SPINDLE) && !board.is_high(FLOOD), "{fault}");
        assert_eq!(outputs(&board), SAFE, "{fault}");
        board.run_for_ms(300).unwrap();
        assert!(is_off(&board) && board.positions() == stands, "{fault}");
    }
}
