//! The image of `pico` on the emulated RP2040. `cargo xtask test` runs these tests, and installs the emulator.
//! They also run with `cargo test -p kerf-sim-tests pico -- --ignored`, after a `cargo xtask sim --board pico`.

use std::path::Path;

use kerf::boards::inputs::{ENDS, PROBE};
use kerf::boards::{Board, PICO, PICO6, PICOCNC, SKR_PICO, gp};
use kerf_sim::bench::{ideal, spiral};
use kerf_sim::emulated::even::{FAST, evenness};
use kerf_sim::emulated::heat::Heat;
use kerf_sim::emulated::{Emulated, Near, job};
use kerf_sim::job::{Options, lines_of};
use kerf_sim::thermal::{HOT_END, Plant};
use kerf_sim::{AUX, Host, LINES_IN_FLIGHT, Runs, USB};

use crate::common::share::{is_long, share_of};
use crate::common::{image, kerf_sim};
use crate::side::Side;
use crate::transcript::{self, Transcript};
use crate::transcripts::ELSEWHERE;

fn board() -> Emulated {
    Emulated::load(&image(&PICO), &PICO).unwrap()
}

impl Side for Emulated {
    // Bytes are sent at the rate of other boards' serial lines. USB would bring two lines at once, and one of them
    // may overtake the other.
    fn send(&mut self, bytes: &[u8]) {
        self.send_to(USB, bytes);
        self.run_for_ms(1 + bytes.len() as u64 * 87 / 1_000).unwrap();
    }

    fn send_aux(&mut self, bytes: &[u8]) {
        self.send_to(AUX, bytes);
    }

    // The board has no handshake pins.
    fn set_aux_cts(&mut self, _stop: bool) {}

    fn stops_aux(&self) -> bool {
        false
    }

    fn set_baud(&mut self, baud: u32) {
        Runs::set_baud(self, baud);
    }

    fn run_ms(&mut self, ms: u64) {
        self.run_for_ms(ms).unwrap();
    }

    fn heard(&mut self) -> Vec<u8> {
        self.receive_from(USB)
    }

    fn heard_aux(&mut self) -> Vec<u8> {
        self.receive_from(AUX)
    }

    fn set_input(&mut self, input: usize, closed: bool) {
        if let Some(pin) = self.board().inputs[input] {
            self.drive(pin, !closed);
        }
    }

    fn wire(&mut self, switches: &[(usize, i64, bool)], pulses: u32) {
        let inputs = self.board().inputs;
        let near = |(input, step, opens): &(usize, i64, bool)| {
            Some(Near {
                gpio: inputs[*input]?.bit,
                motor: if *input == PROBE { 2 } else { input / 2 },
                step: *step,
                above: *input < ENDS && input % 2 == 1,
                back: 0,
                opens: *opens,
            })
        };
        Emulated::wire(self, &switches.iter().filter_map(near).collect::<Vec<_>>());
        if pulses > 0 {
            self.fit_spindle(pulses).unwrap();
        }
    }

    fn turn_spindle(&mut self, rpm: f64, pulses: u32) {
        if pulses > 0 {
            self.set_marks(pulses);
        }
        Emulated::turn_spindle(self, rpm);
    }

    fn steps(&self) -> [i64; 4] {
        Emulated::steps(self)
    }

    fn outputs(&self) -> (u8, f64) {
        let Board { outputs, pwm, .. } = *self.board();
        let high = |(bit, pin): (usize, &Option<_>)| {
            u8::from(pin.is_some_and(|pin| self.is_high(pin))) << bit
        };
        let share = pwm.map_or(0.0, |pwm| self.share(pwm.pin()));
        (outputs.iter().enumerate().map(high).sum(), share)
    }
}

/// Runs a job, which must end on its exact steps.
fn run(name: &str, text: &str, settings: &[&str]) -> String {
    run_on(&mut board(), name, text, settings)
}

/// As [`run`], on a board that has just been powered up.
pub fn run_on(board: &mut Emulated, name: &str, text: &str, settings: &[&str]) -> String {
    let settings: Vec<_> = settings.iter().map(ToString::to_string).collect();
    let options = Options { settings, ..Options::default() };
    let report = job::run(board, &lines_of(text), &options, |_| ());
    let report = report.unwrap();
    assert!(report.problems.is_empty(), "{name}: {report}");
    report.to_string()
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn jobs_end_on_their_steps() {
    for name in share_of(&["square", "spiral"], 2) {
        let text = std::fs::read_to_string(format!("../../../examples/{name}.gcode")).unwrap();
        print!("{}", run(name, &text, &[]));
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_whole_job_ends_in_its_summary() {
    for name in share_of(&["engraving", "square"], 2) {
        let mut run = kerf_sim();
        run.args(["run", "--board", "skr-pico", "--elf"]).arg(image(&SKR_PICO));
        let output = run.arg(format!("../../../examples/{name}.gcode")).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        print!("{said}");
        assert!(output.status.success() && said.contains("result: OK"), "{said}");
        assert_eq!(said.matches(" as expected").count(), 3, "{said}");
    }
}

fn booted() -> (Emulated, Host) {
    started(&PICO)
}

/// A board that has been powered up, and a sender.
pub fn started(board: &'static Board) -> (Emulated, Host) {
    let mut board = Emulated::load(&image(board), board).unwrap();
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut board, 1_000).unwrap();
    (board, host)
}

/// Sends a line that must be accepted.
pub fn set(board: &mut Emulated, host: &mut Host, line: &str) {
    let response = host.ask(board, line, 5_000).unwrap();
    assert_eq!(response.status, 0, "{line} is answered by {}", response.raw);
}

/// The value of a token.
pub fn value(board: &mut Emulated, host: &mut Host, token: &str) -> f64 {
    let response = host.ask(board, &format!("{{{token}:n}}"), 5_000).unwrap();
    response.body[token].as_f64().unwrap_or_else(|| panic!("{}", response.raw))
}

/// Checks that the reported X and Y agree with the pins, at 1,280 steps a millimetre.
fn assert_counted(board: &mut Emulated, host: &mut Host) {
    let steps = Emulated::steps(board);
    for (m, token) in ["mpox", "mpoy"].into_iter().enumerate() {
        let said = value(board, host, token) * 1_280.0;
        assert!((said - steps[m] as f64).abs() < 0.7, "{token}: {said} and {} steps", steps[m]);
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_hold_loses_no_step_and_a_flush_counts_them() {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "g1 x20 y13 f800");
    host.run_for_ms(&mut board, 400).unwrap();
    board.send_now(b'!');
    host.run_for_ms(&mut board, 300).unwrap();
    let held = Emulated::steps(&board);
    host.run_for_ms(&mut board, 200).unwrap();
    assert_eq!(Emulated::steps(&board), held, "it stands still");
    assert!(held[0] > 1_000 && held[0] < 25_600);
    board.send_now(b'~');
    host.run_for_ms(&mut board, 3_000).unwrap();
    assert_eq!(Emulated::steps(&board), [25_600, 16_640, 0, 0]);

    set(&mut board, &mut host, "g1 x0 y0");
    host.run_for_ms(&mut board, 500).unwrap();
    board.send_now(b'!');
    host.run_for_ms(&mut board, 300).unwrap();
    board.send_now(b'%');
    host.run_for_ms(&mut board, 100).unwrap();
    assert_counted(&mut board, &mut host);
    set(&mut board, &mut host, "g1 x0 y0");
    host.run_for_ms(&mut board, 3_000).unwrap();
    assert_eq!(Emulated::steps(&board), [0; 4], "from where it stood");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_million_steps_a_second_of_each_motor() {
    // Checks how far the motors go, and the rate of the leading one.
    let moves = ["g0 x100", "g0 x100 y100 z100 a100", "g0 x100 y87.3 z-61.8 a29", "g0 x71 y-100"];
    for line in moves {
        let (mut board, mut host) = booted();
        FAST.iter().for_each(|line| set(&mut board, &mut host, line));
        set(&mut board, &mut host, line);
        host.run_for_ms(&mut board, 105).unwrap();
        let asleep = board.asleep();
        let recorded = board.record_for_ms(6).unwrap();
        let busy = 1.0 - (board.asleep() - asleep) / (6.0 * 128e3);
        let motors = recorded.times.iter().filter(|times| times.len() > 1);
        let motors: Vec<_> = motors.map(|times| evenness(times)).collect();
        println!("{line}: {motors:?}, {:?} cycles, {:.0} % busy", recorded.shortest, 100.0 * busy);
        let leading = motors.iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        assert!(leading.0 > 995e3, "{leading:?}");
        assert!(leading.1 == 0, "the leading motor is even to the cycle: {leading:?}");
        assert!(motors.iter().all(|motor| motor.2 <= 1.0), "{motors:?}");
        assert!(recorded.shortest >= Some(64.0));
        host.run_for_ms(&mut board, 1_000).unwrap();
        assert_counted(&mut board, &mut host);
    }
}

/// Six motors: X, A, and two motors each of Y and Z.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn half_a_million_steps_a_second_of_six_motors() {
    let (mut board, mut host) = started(&PICO6);
    FAST.iter().for_each(|line| set(&mut board, &mut host, line));
    for line in ["{5ma:1,5tr:1.25,6ma:2,6tr:1.25}", "g1 f46400 x60 y60 z60 a52"] {
        set(&mut board, &mut host, line);
    }
    host.run_for_ms(&mut board, 110).unwrap();
    let asleep = board.asleep();
    let recorded = board.record_for_ms(4).unwrap();
    let busy = 1.0 - (board.asleep() - asleep) / (4.0 * 128e3);
    let motors: Vec<_> = recorded.times.iter().map(|times| evenness(times)).collect();
    println!("{motors:?}, {:.0} % busy", 100.0 * busy);
    assert_eq!(motors.len(), 6);
    assert!(motors.iter().all(|motor| motor.0 > 490e3 && motor.2 <= 1.0), "{motors:?}");
    assert!(motors[0].0 > 560e3 && motors[0].1 == 0, "{motors:?}");
    host.run_for_ms(&mut board, 1_000).unwrap();
    assert_eq!(board.positions(), [76_800, 76_800, 76_800, 66_560, 76_800, 76_800]);
}

/// Six motors of six rates, the leading one at a million steps a second. Nearly all of the time goes to the feeder, which
/// writes a word for each microsecond.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn six_unlike_motors_leave_time() {
    let (mut board, mut host) = started(&PICO6);
    FAST.iter().for_each(|line| set(&mut board, &mut host, line));
    for line in ["{5ma:1,5tr:1.47,6ma:2,6tr:1.93}", "g0 x100 y87.3 z61.8 a79"] {
        set(&mut board, &mut host, line);
    }
    host.run_for_ms(&mut board, 105).unwrap();
    let asleep = board.asleep();
    let recorded = board.record_for_ms(6).unwrap();
    let idle = (board.asleep() - asleep) / (6.0 * 128e3);
    let rates = recorded.times.iter().map(|times| evenness(times).0);
    println!("{:.0?}, {:.0} % idle", rates.collect::<Vec<_>>(), 100.0 * idle);
    assert!(evenness(&recorded.times[0]).0 > 995e3 && idle >= 0.12, "{idle}");
    host.run_for_ms(&mut board, 1_000).unwrap();
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_stuck_chip_is_bitten_and_says_so() {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "m3 s1000");
    set(&mut board, &mut host, "g1 x100 f1000");
    host.run_for_ms(&mut board, 300).unwrap();
    board.stick();
    board.run_for_ms(490).unwrap();
    assert_eq!(board.resets(), 0);
    board.run_for_ms(30).unwrap();
    assert_eq!(board.resets(), 1, "half a second has passed");
    assert!(!board.is_high(PICO.outputs[0].unwrap()));
    board.run_for_ms(300).unwrap();
    let said = String::from_utf8(board.receive_from(USB)).unwrap();
    assert!(said.contains("SYSTEM READY") && said.contains("ALARM:3\r\n"), "{said}");
    host = Host::new(LINES_IN_FLIGHT);
    assert_eq!(value(&mut board, &mut host, "rst"), 3.0);
}

/// The boot ROM starts a new image by the watchdog. That is no fault: the machine is ready.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn the_first_start_of_a_new_image_is_no_alarm() {
    let (mut board, _) = booted();
    board.start_loaded();
    board.run_for_ms(300).unwrap();
    let said = String::from_utf8(board.receive_from(USB)).unwrap();
    assert!(said.contains("SYSTEM READY") && !said.contains("ALARM"), "{said}");
    let mut host = Host::new(LINES_IN_FLIGHT);
    assert!(value(&mut board, &mut host, "rst") < 2.0);
    set(&mut board, &mut host, "g0 x1");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_panic_stops_everything_and_is_told_after_the_reset() {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "m3 s1000");
    set(&mut board, &mut host, "g1 x100 f1000");
    host.run_for_ms(&mut board, 300).unwrap();
    board.panic("src/some.rs");
    board.run_for_ms(1).unwrap();
    let stands = Emulated::steps(&board);
    board.run_for_ms(2_000).unwrap();
    assert_eq!((Emulated::steps(&board), board.resets()), (stands, 0), "it waits");
    assert!(!board.is_high(PICO.outputs[0].unwrap()));
    board.reset();
    board.run_for_ms(300).unwrap();
    let said = String::from_utf8(board.receive_from(USB)).unwrap();
    assert!(said.contains("{\"er\":{\"panic\":\"") && said.contains("src/some.rs:7:9"), "{said}");
    board.reset();
    board.run_for_ms(300).unwrap();
    let said = String::from_utf8(board.receive_from(USB)).unwrap();
    assert!(said.contains("SYSTEM READY") && !said.contains("panic"), "once: {said}");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn outputs_are_strong_and_none_of_them_floats() {
    for board in [&PICO, &SKR_PICO] {
        let mut machine = Emulated::load(&image(board), board).unwrap();
        machine.run_for_ms(300).unwrap();
        let motors = board.motors.iter().flat_map(|m| [Some(m.step), Some(m.dir), m.enable]);
        let outputs = motors.chain(board.outputs).chain([board.enable_all]).flatten();
        for pin in outputs.chain(board.hazards.iter().copied()) {
            assert!(machine.is_strong(pin), "{pin:?} of {}", board.name);
        }
        let spindle = board.outputs[0].unwrap();
        assert!(!machine.floated(spindle) && !machine.is_high(spindle), "{}", board.name);
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn directions_stand_before_and_behind_pulses() {
    for (pulse_us, setup_us) in [(0, 1), (1, 0), (2, 1), (5, 20)] {
        let (mut board, mut host) = booted();
        let fast = "{x:{vm:20000,fr:20000,ac:3000,jm:1e6},y:{vm:20000,fr:20000,ac:3000,jm:1e6}}";
        for line in [fast, &format!("{{spw:{pulse_us},dsu:{setup_us}}}")] {
            set(&mut board, &mut host, line);
        }
        let mut lines = String::from("g1 f20000 x9 y5\n");
        for _ in 0..4 {
            lines += "g2 x1 i-4\ng3 x9 i4\nx9.01\nx9\ny0 x0\nx9 y5\n";
        }
        board.send_to(USB, lines.as_bytes());
        let recorded = board.record_for_ms(3_000).unwrap();
        let [hold, setup] = [recorded.hold, recorded.setup].map(|least| least.unwrap() / 128.0);
        println!("pulses of {pulse_us} us: {hold:.2} us behind, {setup:.2} us before");
        assert!(hold >= 1.0 && setup >= f64::from(setup_us), "{hold} {setup}");
    }
}

/// Returns what the converter reads from a thermistor of this resistance with 4,700 ohms to the supply.
fn reading(ohms: f64) -> u16 {
    (4_095.0 * ohms / (ohms + 4_700.0)) as u16
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn an_skr_pico_heats() {
    let mut board = Emulated::load(&image(&SKR_PICO), &SKR_PICO).unwrap();
    // A bed of 25 degrees, and a hot end of 150 (beta 4,267).
    board.sense(0, reading(100_000.0));
    board.sense(1, reading(100_000.0 * (4_267.0 * (1.0 / 423.15 - 1.0 / 298.15_f64)).exp()));
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut board, 1_000).unwrap();
    // The board has no pins for the sensors of a spindle.
    assert_eq!(host.ask(&mut board, "g33 z-1 k1", 1_000).unwrap().status, 45);
    for line in ["{he1k:1,he3k:1}", "m104 s200", "m106 s255"] {
        set(&mut board, &mut host, line);
    }
    host.run_for_ms(&mut board, 1_000).unwrap();
    let is = [value(&mut board, &mut host, "he1t"), value(&mut board, &mut host, "he3t")];
    assert!((is[0] - 150.0).abs() < 1.0 && (is[1] - 25.0).abs() < 1.0, "{is:?}");
    let on = [23, 21, 17].map(|pin| board.is_high(gp(pin)));
    assert_eq!(on, [true, false, true], "hot end, bed, fan");
    // A wire of the sensor is open.
    board.sense(1, 4_095);
    host.run_for_ms(&mut board, 500).unwrap();
    assert!(!board.is_high(gp(23)), "a fault switches it off");
    assert_eq!(value(&mut board, &mut host, "stat"), 2.0);
}

/// Runs an SKR Pico with its heaters for a time. Returns whether the fan of the heatbreak, FAN2, turns.
fn cools_after(board: &mut Emulated, heat: &mut Heat, ms: u64) -> bool {
    let until = board.cycle() + board.cycles(ms);
    heat.run_until(board, until).unwrap();
    board.is_high(gp(18))
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn the_heatbreak_is_cooled_while_the_hot_end_is_hot_or_may_be() {
    let mut board = Emulated::load(&image(&SKR_PICO), &SKR_PICO).unwrap();
    let mut heat = Heat::of(&mut board);
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut board, 1_000).unwrap();
    set(&mut board, &mut host, "{he1k:1,he3k:1}");
    assert!(!cools_after(&mut board, &mut heat, 500), "cold");
    set(&mut board, &mut host, "m104 s60");
    assert!(cools_after(&mut board, &mut heat, 500), "with a target, before it is hot");
    assert!(cools_after(&mut board, &mut heat, 17_000));
    let felt = value(&mut board, &mut host, "he1t");
    assert!(felt > 51.0, "{felt}");
    for line in ["m104 s0", "{alarm:n}", "{alarm:1}"] {
        host.ask(&mut board, line, 1_000).unwrap();
        assert!(cools_after(&mut board, &mut heat, 300), "still hot after {line}");
    }
    let thermal = heat.thermal_mut().unwrap();
    // The sensor's wire breaks, and the hot end cools down: nobody knows.
    thermal.break_wire(HOT_END, Some(5_000));
    *thermal.plant_mut(HOT_END) = Plant::hot_end();
    assert!(cools_after(&mut board, &mut heat, 1_000), "its sensor is broken");
    heat.thermal_mut().unwrap().break_wire(HOT_END, None);
    assert!(!cools_after(&mut board, &mut heat, 200), "cool");
    assert!(!board.is_high(gp(23)), "the heater is off");
    // After a panic it turns at full speed, whatever was before.
    board.panic("src/some.rs");
    board.run_for_ms(100).unwrap();
    let on = [18, 17, 20, 23, 21].map(|pin| board.is_high(gp(pin)));
    assert_eq!(on, [true, false, false, false, false]);
}

/// Longest time from the edge of a limit switch to the last step, us: two samples, the entry of the interrupt, which
/// may find others, and the step under way.
pub const STOP_US: f64 = 12.0;

/// Moments of the edge in a millisecond, us. `KERF_LONG=1` tries 300.
fn moments() -> Vec<u64> {
    match is_long() {
        true => (0..900).step_by(3).collect(),
        false => vec![0, 3, 7, 10, 11, 15, 19, 23, 27, 31, 170, 411, 772, 783],
    }
}

/// A board whose X switch is a limit, and moves of 60 and 40 mm as one line or as lines of 0.05 mm.
fn stops_at_once(is_streamed: bool) {
    let mut slowest = 0.0_f64;
    let (mut board, mut host) = booted();
    for line in ["{x:{vm:2340,jm:1e5,ac:2000},y:{vm:2340,jm:1e5,ac:2000},sv:0}", "{xsn:2}"] {
        set(&mut board, &mut host, line);
    }
    for wait_us in moments() {
        if is_streamed {
            let lines = (1..=1_200).map(|n| {
                let at = f64::from(n) * 0.05;
                format!("g1 f2340 x{at:.3} y{:.3}\n", at * 2.0 / 3.0)
            });
            board.send_to(USB, lines.collect::<String>().as_bytes());
        } else {
            board.send_to(USB, b"g0 x60 y40\n");
        }
        board.run_for_ms(200).unwrap();
        let until = board.cycle() + wait_us * 128;
        host.run_until(&mut board, until).unwrap();
        let edge = board.cycle();
        board.drive(PICO.inputs[0].unwrap(), false);
        board.run_for_ms(100).unwrap();
        let after = board.last_step().unwrap().saturating_sub(edge) as f64 / 128.0;
        slowest = slowest.max(after);
        assert!(after <= STOP_US, "{after} us, {wait_us} us behind a millisecond");
        board.drive(PICO.inputs[0].unwrap(), true);
        // What was sent comes to its end: it is refused.
        board.run_for_ms(700).unwrap();
        board.receive_from(USB);
        set(&mut board, &mut host, "{clear:1}");
        assert_counted(&mut board, &mut host);
        set(&mut board, &mut host, "g0 x0 y0");
        host.run_for_ms(&mut board, 600).unwrap();
        assert_eq!(Emulated::steps(&board), [0; 4], "back from where it stood");
    }
    println!("{slowest:.1} us");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_limit_stops_at_once_and_steps_are_counted() {
    stops_at_once(false);
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_limit_stops_as_soon_while_lines_are_streamed() {
    stops_at_once(true);
}

/// Half of the time went to waits for flash when the code was there.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn what_runs_for_each_line_is_in_ram() {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "{x:{vm:20000,fr:20000,ac:3000},y:{vm:20000,fr:20000,ac:3000}}");
    let line = |n| format!("g1 f20000 x{:.2} y{:.2}\n", f64::from(n) * 0.05, f64::from(n) * 0.05);
    board.send_to(USB, (1..=2_000).map(line).collect::<String>().as_bytes());
    board.run_for_ms(20).unwrap();
    let (cycle, waited) = (board.cycle(), board.waited());
    board.run_for_ms(100).unwrap();
    let share = (board.waited() - waited) / (board.cycle() - cycle) as f64;
    println!("{:.3} % of the time waits for flash", 100.0 * share);
    assert!(board.waiting() > 0 && share < 0.01, "{share}");
}

/// The longest time for which interrupts are off, us. Switches, steps and bytes wait for as long.
const MASKED_US: f64 = 6.0;

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn interrupts_are_never_off_for_long() {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "{x:{vm:20000,fr:20000,ac:3000},si:50}");
    board.forget_masked();
    let lines = (1..=1_500).map(|n| format!("g1 f20000 x{:.2}\n", f64::from(n) * 0.05));
    board.send_to(USB, lines.collect::<String>().as_bytes());
    board.run_for_ms(100).unwrap();
    // Bytes that act, within lines and between them, and what does not fit.
    for bytes in [&b"!"[..], b"~", b"{fb:n}\n$$\n", b"\x91\x90\x05", &[b'x'; 400], b"\n?\n%"] {
        board.send_to(USB, bytes);
        board.run_for_ms(50).unwrap();
    }
    let masked = board.masked() / 128.0;
    println!("interrupts were off for {masked:.2} us at most");
    assert!(masked > 0.1 && masked <= MASKED_US, "{masked} us");
}

/// An arc that is asked for more than its axes can do has one velocity: that of an axis, or that at which it is off by P.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn an_arc_at_the_limit_of_its_axes_is_even() {
    for (mode, from, to) in [("g61", 775.0, 787.0), ("g64 p0.05", 280.0, 292.0)] {
        let (mut board, mut host) = booted();
        FAST.iter().for_each(|line| set(&mut board, &mut host, line));
        set(&mut board, &mut host, mode);
        set(&mut board, &mut host, "g2 x0 y0 i100 j0.001 f60000");
        host.run_for_ms(&mut board, 150).unwrap();
        let mut velocities = Vec::new();
        for _ in 0..50 {
            let before = Emulated::steps(&board);
            board.run_for_ms(10).unwrap();
            let now = Emulated::steps(&board);
            let way = |m: usize| (now[m] - before[m]) as f64 / 1_280.0;
            velocities.push(way(0).hypot(way(1)) * 100.0);
        }
        let (least, most) =
            velocities.iter().fold((f64::MAX, 0f64), |(a, b), v| (a.min(*v), b.max(*v)));
        println!("{mode}: {least:.0} to {most:.0} mm/s");
        assert!(least > from && most < to, "{mode}: {velocities:.0?}");
    }
}

/// 200 kHz at the probe's input, and around it, take no step of a million a second out of its place.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn noise_at_a_switch_does_not_delay_motors() {
    let (mut board, mut host) = booted();
    FAST.iter().for_each(|line| set(&mut board, &mut host, line));
    set(&mut board, &mut host, "g0 x100 y100 z100 a100");
    host.run_for_ms(&mut board, 105).unwrap();
    let probe = PICO.inputs[PROBE].unwrap().bit;
    for period in [640, 700, 173, 2_560] {
        board.disturb(probe, period);
        let recorded = board.record_for_ms(2).unwrap();
        let (rate, spread, worst) = evenness(&recorded.times[0]);
        println!(
            "{:.0} kHz: {rate:.0} steps/s, jitter {spread} cycles, {worst:.3} us",
            128e3 / f64::from(period)
        );
        assert!(spread <= 1 && rate > 999_000.0, "{period}: {rate} {spread}");
    }
    board.disturb(probe, 0);
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_fault_of_the_cpu_stops_everything_and_is_told_after_the_reset() {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "m3 s1000");
    set(&mut board, &mut host, "g1 x100 f1000");
    host.run_for_ms(&mut board, 300).unwrap();
    board.crash("address");
    board.run_for_ms(1).unwrap();
    let stands = Emulated::steps(&board);
    assert!(!board.is_high(PICO.outputs[0].unwrap()));
    board.run_for_ms(2_000).unwrap();
    assert_eq!((Emulated::steps(&board), board.resets()), (stands, 0), "it waits");
    board.reset();
    board.run_for_ms(300).unwrap();
    let said = String::from_utf8(board.receive_from(USB)).unwrap();
    assert!(said.contains("{\"er\":{\"panic\":\"fault at 0x2004"), "{said}");
}

/// A stack that is too deep leaves the CPU without a place for the fault's frame: the watchdog resets it.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_stack_that_is_too_deep_is_a_reset() {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "m3 s1000");
    set(&mut board, &mut host, "g1 x100 f1000");
    host.run_for_ms(&mut board, 300).unwrap();
    board.crash("stack");
    board.run_for_ms(520).unwrap();
    let stands = Emulated::steps(&board);
    assert!(!board.is_high(PICO.outputs[0].unwrap()) && board.resets() == 1);
    board.run_for_ms(1_000).unwrap();
    assert_eq!(Emulated::steps(&board), stands);
}

/// Bytes of the stack that nothing has used when everything has been used. `memory.x` has 12 KiB.
const STACK_LEFT: usize = 4 << 10;

/// Answers in both dialects, lists, homing, probing, arcs, cycles, jobs, the worst of streams, stops: all that is deep.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn the_stack_is_not_deep() {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "{x:{vm:20000,fr:20000,ac:3000},si:50,sv:2}");
    let stream = |n| {
        format!(
            "g1 f{} x{:.2} y{:.2} z{:.3}\n",
            19_000 + n % 7,
            f64::from(n) * 0.05,
            f64::from(n % 9) * 0.05,
            f64::from(n % 5) * 0.01
        )
    };
    board.send_to(USB, (1..=1_000).map(stream).collect::<String>().as_bytes());
    board.run_for_ms(200).unwrap();
    for bytes in [
        &b"{sys:n}\n{sr:n}\n{x:n}\n$$\n?\n"[..],
        b"{qr:n}\n!\n~\n{sr:{posx:t,posy:t,stat:t}}\n$h\n$sys\n",
        b"g2 x10 i5 f6000\ng81 x1 y1 z-1 r1\ng76 p1 z-1 i-0.2 j0.1 k0.5\ng38.3 z-1 f100\ng28.2 x0\n",
        b"g10 l2 p1 x1\ng92 x0\n{gc:\"g1 x1 (msg here)\"}\n{x:{vm:12000,ac:1000}}\n{defa:1}\n",
        b"{job:{1:\"g0 x1\"}}\n\x18",
        b"!%",
        b"{clear:n}\n{prf:n}\n{er:n}\n{kept:n}\n",
    ] {
        board.send_to(USB, bytes);
        board.run_for_ms(1_000).unwrap();
    }
    board.reset();
    board.run_for_ms(500).unwrap();
    for bytes in [
        &b"$$\n$#\n$G\n$I\n$N\n?"[..],
        b"$100=250\n$J=G91X1F600\n\x85$C\n$C\n$H\n$X\n",
        b"G91 G2 X5 I2.5 F3000\nG38.2 Z-1 F100\n$RST=*\n",
    ] {
        board.send_to(AUX, bytes);
        board.run_for_ms(1_000).unwrap();
    }
    assert_shallow(&board);
    // The most of an image: printing, drivers, the dialect of printing hosts.
    let mut board = Emulated::load(&image(&SKR_PICO), &SKR_PICO).unwrap();
    board.run_for_ms(300).unwrap();
    for bytes in [
        &b"M115\nM105\nM114\nM503\nM119\n"[..],
        b"N1 M110*51\nM302 P1\nG28 X\nM303 E0 S50 C1\nM112\n",
        b"M999\nG91\nG1 X5 E1 F3000\nG2 X5 I2.5 E1\nM600\nM108\nM500\nM301 P10\n",
    ] {
        board.send_to(USB, bytes);
        board.run_for_ms(1_000).unwrap();
    }
    let said = String::from_utf8(board.receive_from(USB)).unwrap();
    assert!(said.contains("FIRMWARE_NAME:Kerf") && said.matches("ok").count() > 8, "{said}");
    assert_shallow(&board);
}

fn assert_shallow(board: &Emulated) {
    let used = board.stack();
    println!("{used} bytes of stack were used");
    assert!(used > 2_000 && used + STACK_LEFT <= 12 << 10, "{used}");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn settings_survive_a_power_cut_and_a_reset() {
    let (mut board, mut host) = booted();
    for line in ["{xvm:1234}", "{4mi:32}", "g10 l2 p3 x1.5 y-2"] {
        set(&mut board, &mut host, line);
    }
    host.run_for_ms(&mut board, 500).unwrap();
    assert_eq!(value(&mut board, &mut host, "kept"), 1.0);
    for cut in [true, false] {
        match cut {
            true => board.cut_power(),
            false => board.send_now(0x18),
        }
        host.boot(&mut board, 2_000).unwrap();
        assert_eq!(value(&mut board, &mut host, "xvm"), 1_234.0);
        assert_eq!(value(&mut board, &mut host, "4mi"), 32.0);
        set(&mut board, &mut host, "g56");
        assert_eq!(value(&mut board, &mut host, "ofsy"), -2.0);
        assert_eq!(value(&mut board, &mut host, "rst"), if cut { 0.0 } else { 4.0 });
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn settings_may_change_often() {
    let (mut board, mut host) = booted();
    for n in 0..20 {
        set(&mut board, &mut host, &format!("{{xvm:{}}}", 500 + n));
        host.run_for_ms(&mut board, 30).unwrap();
    }
    host.run_for_ms(&mut board, 500).unwrap();
    board.cut_power();
    host.boot(&mut board, 2_000).unwrap();
    assert_eq!(value(&mut board, &mut host, "xvm"), 519.0);
}

/// Transcripts that do not hold here, by the beginnings of their names. More rates of the line are possible (`baud`),
/// steps may come faster (`rates`, `settings-motor`, `grbl-settings`), no port has RTS and CTS (`ports-pins`), the
/// sensors of a spindle have pins of their own (`encoder`, `grbl-lathe-probe`) and no second sensor tells the direction
/// (`thread-direction`, `lathe-tap-fails`, `grbl-lathe-cycles`), settings are stored sooner (`stored`), USB loses
/// no byte (`grbl-contract-full`), and the boot loader, which is in ROM, is not emulated (`boot-loader`).
const DIFFERS: [&str; 13] = [
    "baud",
    "boot-loader",
    "encoder",
    "grbl-contract-full",
    "grbl-lathe-cycles",
    "grbl-lathe-probe",
    "grbl-settings",
    "lathe-tap-fails",
    "ports-pins",
    "rates",
    "settings-motor",
    "stored",
    "thread-direction",
];
/// Transcripts in which motors go far, which takes the emulator minutes. The simulated board plays them, and nothing
/// in them depends on the chip.
const LONG: [&str; 2] = ["axis-modes", "far"];
/// Transcripts of a printer, and of drivers that are set up by UART.
const PRINTING: [&str; 4] = ["bed", "drivers", "heat", "reprap"];

/// Returns an answer of a machine with 61 blocks as this machine, with 768, gives it.
fn with_more_room(line: &str) -> String {
    let text = [
        ("Bf:61,", "Bf:768,"),
        ("A,61,", "A,768,"),
        ("qr:                 61", "qr:                768"),
    ];
    let mut line = text.iter().fold(line.to_string(), |line, (few, more)| line.replace(few, more));
    let is_refused = line.contains("\"f\":") && !line.contains("\"f\":[1,0,");
    let before = "\"qr\":";
    let Some(at) = line.find(before).map(|at| at + before.len()).filter(|_| !is_refused) else {
        return line;
    };
    let digits = line[at..].bytes().take_while(u8::is_ascii_digit).count();
    let number = line[at..at + digits].parse().unwrap_or(0);
    if (1..=61).contains(&number) {
        line.replace_range(at..at + digits, &(number + 707).to_string());
    }
    line
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn the_image_keeps_to_the_transcripts() {
    let mut all = transcript::read_all(Path::new("../../transcripts"));
    let begins =
        |names: &[&str], one: &Transcript| names.iter().any(|name| one.name.starts_with(name));
    all.retain(|one| !begins(&DIFFERS, one) && !begins(&LONG, one));
    all.iter_mut().for_each(|one| one.expect(with_more_room));
    // Of those that images for AVR play too, a share.
    let (mut due, also): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|one| begins(&ELSEWHERE, one));
    due.extend(share_of(&also, 4).cloned());
    let (printing, others): (Vec<_>, Vec<_>) =
        due.into_iter().partition(|one| begins(&PRINTING, one));
    let (carded, others): (Vec<_>, Vec<_>) =
        others.into_iter().partition(|one| begins(&["card"], one));
    transcript::play_all(others, 2, || greeted(&PICO));
    transcript::play_all(printing, 2, || greeted(&SKR_PICO));
    transcript::play_all(carded, 1, || greeted(&PICOCNC));
}

/// A board that has greeted on both ports: a greeting takes 10 ms on the slower port.
fn greeted(board: &'static Board) -> Emulated {
    let mut board = Emulated::load(&image(board), board).unwrap();
    board.run_for_ms(300).unwrap();
    board
}

/// Moves of 0.03 mm at 100 mm/s: 3,333 blocks a second. With a jerk limit the board makes as many, and none comes
/// late. Turning takes two thirds of the acceleration: ramps have 420 of 500 mm/s^2, which makes 1.10 of the ideal time.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn tiny_moves_are_as_fast_as_could_be() {
    let [free, limited] = [1e6, 5e3].map(tiny_moves);
    println!("{free:.3}, {limited:.3}");
    assert!(free < 1.15 && limited < 1.15, "{free}, {limited}");
}

/// Returns the time of the moves under a jerk limit, over the ideal time without a limit.
fn tiny_moves(jerk: f64) -> f64 {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "{ja:1800000,sv:0,qv:0}");
    set(&mut board, &mut host, "{1:{tr:20},2:{tr:20}}");
    for axis in ["x", "y"] {
        let line = format!("{{{axis}:{{vm:16000,fr:16000,jd:0.01,jm:{jerk},ac:500}}}}");
        set(&mut board, &mut host, &line);
    }
    board.send_to(USB, spiral(0.03).as_bytes());
    while Emulated::totals(&board) == [0; 4] {
        board.run_for_ms(1).unwrap();
    }
    let begun = board.cycle();
    board.run_for_ms(2_500).unwrap();
    let over = (board.last_step().unwrap() - begun) as f64 / 128e6 / ideal(0.03);
    let heard = String::from_utf8(board.receive_from(USB)).unwrap();
    let taken = heard.lines().filter(|line| line.contains("\"f\":[1,0,")).count();
    assert_eq!(taken, spiral(0.03).lines().count(), "lines are refused");
    assert_eq!(value(&mut board, &mut host, "stv"), 0.0, "late segments");
    let steps = Emulated::steps(&board);
    for (m, token) in ["mpox", "mpoy"].into_iter().enumerate() {
        let said = value(&mut board, &mut host, token) * 80.0;
        assert!((said - steps[m] as f64).abs() < 0.7, "{token}: {said} and {} steps", steps[m]);
    }
    over
}

/// Four motors, each at its own rate of up to 700,000 steps a second, in blocks of a quarter of a millisecond.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn tiny_moves_of_fast_motors_come_in_time() {
    let (mut board, mut host) = booted();
    FAST.iter().for_each(|line| set(&mut board, &mut host, line));
    set(&mut board, &mut host, "g1f33000");
    let place = |n: usize| {
        let turn = (n as f64 * 0.01).sin();
        [0.14 * n as f64, 5.0 * turn, 0.09 * n as f64, 3.0 * turn * turn]
    };
    let line = |n: usize| {
        let [x, y, z, a] = place(n);
        format!("x{x:.3}y{y:.3}z{z:.3}a{a:.3}\n")
    };
    board.send_to(USB, (1..=1_500).map(line).collect::<String>().as_bytes());
    board.run_for_ms(4_000).unwrap();
    board.receive_from(USB);
    let end = place(1_500).map(|at| ((at * 1e3).round() * 1.28).round() as i64);
    assert_eq!(Emulated::steps(&board), end);
    assert_eq!(value(&mut board, &mut host, "stv"), 0.0, "late segments");
    println!("{:?} s between steps", board.gaps());
}
