//! Programs of printing hosts on a machine that follows its bed. Whatever moves, and whatever ends a move, Z is on
//! the step that the plane gives.

use std::thread;

use kerf::boards::inputs::{PROBE, X_MIN, Y_MIN, Z_MIN};
use kerf::config::StepRatio;
use kerf::config::bed::Bed;
use kerf::hal::imp::Machine;
use kerf::units::Length;
use proptest::prelude::*;

use crate::cases::cases;

/// Steps in a unit of length of X, Y and Z, as `{mch:3}` sets them: 80, 80 and 400 in a mm.
const RATIOS: [StepRatio; 3] =
    [StepRatio { num: 1, den: 125 }, StepRatio { num: 1, den: 125 }, StepRatio { num: 1, den: 25 }];
/// 10 um, in units of length.
const HUNDREDTH: i32 = 100;

/// A printer whose first port speaks to a printing host, and whose second port speaks TinyG's dialect.
struct Printer {
    machine: Machine,
    heard: String,
    /// Whether its first two motors drive X and Y together.
    shared: bool,
}

impl Printer {
    fn boot(shared: bool) -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        let mut printer = Self { machine, heard: String::new(), shared };
        printer.machine.run_ms(100);
        printer.control("{mch:3}");
        // These settings make the tests fast.
        printer.control("{zvm:6000,zfr:6000,zjm:5000,zac:1000}");
        if shared {
            printer.control("{1ma:6}");
            printer.control("{2ma:7}");
        }
        printer.machine.received();
        assert!(printer.ask("M105").starts_with("ok T:"));
        assert_eq!(printer.ask("M302 P1"), "ok\n");
        printer
    }

    /// A printer that is homed, with a bed 0.1 mm below position 0.
    fn homed() -> Self {
        let mut printer = Self::boot(false);
        for (switch, step) in [(X_MIN, -80), (Y_MIN, -80), (Z_MIN, -400), (PROBE, -40)] {
            printer.machine.set_near(switch, step, false);
        }
        assert_eq!(printer.ask("G28"), "ok\n");
        printer
    }

    /// Sends a line on the second port and returns the answer.
    fn control(&mut self, line: &str) -> String {
        self.machine.received_aux();
        self.machine.send_aux(format!("{line}\n").as_bytes());
        self.machine.run_ms(60);
        String::from_utf8(self.machine.received_aux()).expect("ASCII")
    }

    fn send(&mut self, line: &str) {
        self.machine.send(format!("{line}\n").as_bytes());
    }

    /// Returns what is heard up to the next `ok`, including that.
    fn hear(&mut self) -> String {
        for _ in 0..600_000 {
            if let Some(end) = self.heard.find("ok")
                && let Some(line) = self.heard[end..].find('\n')
            {
                let rest = self.heard.split_off(end + line + 1);
                let said = std::mem::replace(&mut self.heard, rest);
                return said.replace("echo:busy: processing\n", "");
            }
            self.machine.run_ms(1);
            self.heard += &String::from_utf8(self.machine.received()).expect("ASCII");
        }
        panic!("no answer, but {:?}", self.heard);
    }

    fn ask(&mut self, line: &str) -> String {
        self.send(line);
        self.hear()
    }

    fn steps(&mut self) -> [i64; 3] {
        assert_eq!(self.ask("M400"), "ok\n");
        self.machine.run_ms(50);
        let at = self.machine.emitted().position;
        [at[0], at[1], at[2]]
    }

    /// Returns the positions of the motors when the nozzle is at a place.
    fn steps_at(&self, [x, y, z]: [i32; 3]) -> [i64; 3] {
        let drives = if self.shared { [x + y, x - y, z] } else { [x, y, z] };
        [0, 1, 2].map(|n| i64::from(RATIOS[n].steps(Length(drives[n]))))
    }

    /// Returns X, Y and Z that the second port reports, in units of length; exact to 1 um.
    fn told(&mut self) -> [i32; 3] {
        let told = self.control("{mpo:n}");
        ["\"x\":", "\"y\":", "\"z\":"].map(|name| {
            let (_, rest) = told.split_once(name).unwrap_or_else(|| panic!("{told}"));
            let mm: f64 = rest.split([',', '}']).next().unwrap().parse().unwrap();
            (mm * f64::from(Length::PER_MM)).round() as i32
        })
    }
}

/// Runs a test in a thread of its own, because each thread has one machine. Returns whether it passed.
fn alone(play: impl FnOnce() + Send + 'static) -> bool {
    thread::spawn(play).join().is_ok()
}

/// An action of a program.
#[derive(Clone, Debug)]
enum Op {
    /// Moves to a place, in hundredths of a mm, at a speed in mm/s.
    Go([i32; 3], u32),
    /// Moves by a distance, with G91.
    By([i32; 3]),
    /// Moves to a place in X and Y on a half circle, with Z on the way.
    Arc([i32; 3], bool),
    /// Gives the place other coordinates, with G92.
    Name([i32; 3]),
    /// Follows the bed or not: M420 S.
    Follow(bool),
    /// Sets the plane: G29 S5 and three points, with heights at the corners and the corner that comes first.
    Bed([i32; 3], usize),
    /// After some ms, holds for 300 ms.
    Hold(u64),
    /// After some ms, drops what is queued.
    Flush(u64),
    /// Gives the place of X another machine coordinate, with G28.3.
    Rename(i32),
    Inches,
    /// Draws filament back and pushes it forward, with the nozzle lifted meanwhile.
    Hop,
    /// Switches the motors off at rest.
    Off,
}

fn place() -> impl Strategy<Value = [i32; 3]> {
    (-3_000..3_000, -3_000..3_000, 0..300).prop_map(|(x, y, z)| [x, y, z])
}

fn any_op() -> impl Strategy<Value = Op> {
    prop_oneof![
        5 => (place(), 10u32..200).prop_map(|(to, feed)| Op::Go(to, feed)),
        2 => (prop::array::uniform3(-30..30)).prop_map(Op::By),
        2 => (place(), any::<bool>()).prop_map(|(to, left)| Op::Arc(to, left)),
        1 => place().prop_map(Op::Name),
        1 => any::<bool>().prop_map(Op::Follow),
        1 => (prop::array::uniform3(-150..150), 0usize..3).prop_map(|(z, first)| Op::Bed(z, first)),
        1 => (0u64..400).prop_map(Op::Hold),
        1 => (0u64..400).prop_map(Op::Flush),
        1 => (-1_000..1_000).prop_map(Op::Rename),
        1 => Just(Op::Inches),
        1 => Just(Op::Hop),
        1 => Just(Op::Off),
    ]
}

/// The expected state of a machine.
struct Model {
    at: [i32; 3],
    /// The shift of coordinates by G92: the coordinate minus the place.
    shift: [i32; 3],
    /// How far motors are off the position that G28.3 has set, in X.
    base: i32,
    /// How many steps X may be off: G28.3 is exact to a step only.
    slack: i64,
    bed: Bed,
}

impl Model {
    /// Returns the place of the motors.
    fn motors(&self) -> [i32; 3] {
        let [x, y, z] = self.at.map(Length);
        let lifted = if self.bed.follows() { self.bed.lifted_z(x, y, z) } else { z };
        [x.0, y.0, lifted.0]
    }

    fn follow(&mut self, follows: bool) {
        let [.., z] = self.motors();
        self.bed.follow(follows);
        let [x, y, _] = self.at.map(Length);
        self.at[2] = if self.bed.follows() { self.bed.lowered_z(x, y, Length(z)).0 } else { z };
    }

    /// Returns the words of a place.
    fn words(&self, at: [i32; 3]) -> String {
        let called = [0, 1, 2].map(|n| f64::from(at[n] + self.shift[n]) / 1e4);
        format!("X{:.4} Y{:.4} Z{:.4}", called[0], called[1], called[2])
    }
}

/// The corners that define a bed, in hundredths of a mm.
const CORNERS: [[i32; 2]; 3] = [[0, 0], [3_000, 0], [0, 3_000]];

fn carry_out(printer: &mut Printer, model: &mut Model, op: &Op) {
    let units = |place: [i32; 3]| place.map(|at| at * HUNDREDTH);
    match op {
        Op::Go(to, feed) => {
            model.at = units(*to);
            let line = format!("G1 {} F{}", model.words(model.at), feed * 60);
            assert_eq!(printer.ask(&line), "ok\n", "{line}");
        }
        Op::By(by) => {
            let mm = by.map(|by| f64::from(by) / 100.0);
            printer.ask("G91");
            printer.ask(&format!("G1 X{:.2} Y{:.2} Z{:.2}", mm[0], mm[1], mm[2]));
            printer.ask("G90");
            for (at, by) in model.at.iter_mut().zip(by) {
                *at += by * HUNDREDTH;
            }
        }
        Op::Arc(to, left) => {
            // The distances are even, so that the centre is a whole unit.
            let to = to.map(|at| at * HUNDREDTH);
            let half = [0, 1].map(|n| f64::from(to[n] - model.at[n]) / 2e4);
            if half == [0.0; 2] {
                return;
            }
            model.at = to;
            let code = if *left { "G3" } else { "G2" };
            let line = format!("{code} {} I{:.5} J{:.5}", model.words(to), half[0], half[1]);
            assert_eq!(printer.ask(&line), "ok\n", "{line}");
        }
        Op::Name(called) => {
            let called = units(*called);
            model.shift = [0, 1, 2].map(|n| called[n] - model.at[n]);
            assert_eq!(printer.ask(&format!("G92 {}", model.words(model.at))), "ok\n");
        }
        Op::Follow(follows) => {
            let answer = printer.ask(&format!("M420 S{}", u8::from(*follows)));
            if *follows && !model.bed.is_known() {
                assert!(answer.contains("fewer than three points"), "{answer}");
            } else {
                assert_eq!(answer, "ok\n");
                model.follow(*follows);
            }
        }
        Op::Bed(heights, first) => {
            assert_eq!(printer.ask("G29 S5"), "ok\n");
            model.follow(false);
            model.bed.forget();
            for n in 0..3 {
                let corner = (first + n) % 3;
                let [x, y] = CORNERS[corner].map(|at| at * HUNDREDTH);
                let z = heights[corner] * HUNDREDTH / 2;
                let [mx, my, mz] = [x, y, z].map(|at| f64::from(at) / 1e4);
                let line = format!("G29 S1 X{mx:.4} Y{my:.4} Z{mz:.4}");
                let refused = model.bed.add([x, y, z].map(Length)).is_err();
                let answer = printer.ask(&line);
                assert_eq!(answer != "ok\n", refused, "{line}: {answer}");
            }
            model.follow(true);
        }
        Op::Hold(ms) => {
            printer.machine.run_ms(*ms);
            printer.control("!");
            printer.machine.run_ms(300);
            printer.control("~");
        }
        Op::Flush(ms) => {
            printer.machine.run_ms(*ms);
            printer.control("!");
            printer.machine.run_ms(500);
            printer.control("%");
            printer.machine.run_ms(500);
            printer.control("~");
            let steps = printer.steps();
            // The report is exact to 1 um, which is less than half a step.
            model.at = printer.told();
            near(printer, model, steps);
        }
        Op::Rename(x) => {
            let x = x * HUNDREDTH;
            let (from, mut to) = (model.at, model.at);
            to[0] = x;
            let all = |at: [i32; 3]| [at[0], at[1], at[2], 0, 0, 0].map(Length);
            // A flush drops the line if it waits, so M400 comes first.
            printer.ask("M400");
            assert_eq!(printer.ask(&format!("G28.3 X{:.4}", f64::from(x) / 1e4)), "ok\n");
            printer.ask("M400");
            // G28.3 sets machine coordinates.
            model.bed.rename(&all(from), &all(to));
            model.base += from[0] - x;
            model.slack += 1;
            model.at = to;
        }
        Op::Hop => {
            for line in ["G10", "G91", "G1 Z1.5", "G1 X2 Y-3", "G1 Z-1.5", "G90", "G11"] {
                assert_eq!(printer.ask(line), "ok\n", "{line}");
            }
            model.at[0] += 20_000;
            model.at[1] -= 30_000;
        }
        Op::Off => {
            assert_eq!(printer.ask("M84"), "ok\n");
            printer.machine.run_ms(100);
        }
        Op::Inches => {
            assert_eq!(printer.ask("G20"), "ok\n");
            assert_eq!(printer.ask("G91"), "ok\n");
            assert_eq!(printer.ask("G1 X0.1 Z0.01"), "ok\n");
            assert_eq!(printer.ask("G21"), "ok\n");
            assert_eq!(printer.ask("G90"), "ok\n");
            model.at[0] += 25_400;
            model.at[2] += 2_540;
        }
    }
}

/// Checks that the motors are where the model has them.
fn near(printer: &Printer, model: &Model, steps: [i64; 3]) {
    let [x, y, z] = model.motors();
    let wanted = printer.steps_at([x + model.base, y, z]);
    let slacks = [model.slack, model.slack, 1];
    let near = (0..3).all(|n| (wanted[n] - steps[n]).abs() <= slacks[n]);
    assert!(near, "{steps:?} instead of {wanted:?}, {:?}", model.bed);
}

fn play(ops: &[Op], shared: bool) {
    let mut printer = Printer::boot(shared);
    let mut model = Model { at: [0; 3], shift: [0; 3], base: 0, slack: 1, bed: Bed::NONE };
    carry_out(&mut printer, &mut model, &Op::Bed([0, 150, -120], 0));
    for op in ops {
        carry_out(&mut printer, &mut model, op);
    }
    let steps = printer.steps();
    near(&printer, &model, steps);
    // The reported position is the true one.
    let told = printer.told();
    let off = [0, 1, 2].map(|n| (told[n] - model.at[n]).abs());
    assert!(off.iter().all(|off| *off <= 150), "{told:?} {:?}", model.at);
    // When the plane is switched off no motor moves, and the move to Z 0 has its full length.
    model.follow(false);
    assert_eq!(printer.ask("M420 S0"), "ok\n");
    assert_eq!(printer.steps(), steps);
    carry_out(&mut printer, &mut model, &Op::Go([500, 500, 0], 100));
    let steps = printer.steps();
    near(&printer, &model, steps);
}

/// Time of a G29, and a little more.
const LEVELING_MS: u64 = 5_500;

/// Ends G29 `ms` milliseconds after its beginning.
fn end_leveling(ms: u64, by: &str) {
    let mut printer = Printer::homed();
    printer.send("G29 L0 R20 F0 B20 Z2");
    printer.machine.run_ms(ms);
    if by == "M112" {
        printer.send(by);
    } else {
        by.bytes().for_each(|byte| {
            printer.machine.send_aux(&[byte]);
            printer.machine.run_ms(500);
        });
    }
    let told = printer.hear();
    let is_over = told.contains("Bed leveling status: active (3)");
    if by == "M112" {
        printer.hear();
    }
    printer.ask("M999");
    let follows = printer.ask("M420 S1");
    assert_eq!(follows.contains("fewer than three points"), !is_over, "{ms} {by}: {told}{follows}");
}

#[test]
fn whatever_ends_g29_early_leaves_no_plane() {
    for by in ["M112", "!%~"] {
        let all = (0..LEVELING_MS).step_by(230);
        for ms in all.chain((LEVELING_MS - 900..LEVELING_MS).step_by(25)) {
            assert!(alone(move || end_leveling(ms, by)), "{by} after {ms} ms");
        }
    }
}

/// Makes the machine do something else, by a line on the second port, `ms` milliseconds after the beginning of G29.
fn interfere(ms: u64, line: &str) {
    let mut printer = Printer::homed();
    printer.send("G29 L0 R20 F0 B20 Z2");
    printer.machine.run_ms(ms);
    printer.control(line);
    let told = printer.hear();
    printer.control("{clear:n}");
    printer.control("{chk:0}");
    let points = printer.ask("M420");
    for z in points.split(" Z").skip(1).filter_map(|rest| rest.lines().next()) {
        let z: f64 = z.parse().unwrap();
        assert!((z + 0.103).abs() < 0.005, "{line} {ms}: {told}{points}");
    }
    let is_known = points.contains("(3)");
    assert_eq!(is_known, told.contains("active (3)"), "{line} {ms}: {told}{points}");
    let follows = printer.ask("M420 S1");
    assert_eq!(follows == "ok\n", is_known, "{line} {ms}: {follows}");
}

#[test]
fn another_port_within_g29_leaves_the_plane_or_none() {
    let lines = [
        "g1 x5 f3000",
        "g1 z1 f300",
        "g0 z9",
        "g28.3 x3",
        "{home:1}",
        "g28.2 z0",
        "g30",
        "g55",
        "{jogx:7}",
        "{chk:1}",
        "g38.2 z-3 f100",
        "\x04",
        "{xtm:15}",
        "{ztm:1}",
        "m2",
        "g92 x7",
    ];
    for line in lines {
        for ms in (0..LEVELING_MS).step_by(330) {
            assert!(alone(move || interfere(ms, line)), "{line} after {ms} ms");
        }
    }
}

#[test]
fn codes_of_a_host_begin_where_another_port_has_fed_the_machine() {
    for line in ["G29 S5", "M420 S0", "G10", "M900 K0.05", "M303 E0 S60 C3"] {
        assert!(alone(move || {
            let mut printer = Printer::homed();
            printer.control("g0 x1");
            printer.machine.run_ms(2_000);
            assert!(printer.ask(line).ends_with("ok\n"), "{line}");
        }));
    }
}

#[test]
fn a_height_beyond_the_travel_of_z_is_refused() {
    assert!(alone(|| {
        let mut printer = Printer::homed();
        printer.control("{ztm:10}");
        let told = printer.ask("G29 L0 R20 F0 B20 Z12");
        assert!(told.contains("Error:beyond a soft limit"), "{told}");
        let told = printer.ask("G29 L0 R20 F0 B20 Z8");
        assert!(told.contains("active (3)"), "{told}");
    }));
}

/// A printer that follows a bed which rises by 1 in 50 along X and falls by 1 in 40 along Y.
fn following(shared: bool) -> Printer {
    // Simulated switches follow motors, not axes, so a CoreXY cannot home here.
    let mut printer = if shared { Printer::boot(true) } else { Printer::homed() };
    for line in ["G29 S1 X0 Y0 Z0", "G29 S1 X100 Y0 Z2", "G29 S1 X0 Y100 Z-2.5"] {
        assert_eq!(printer.ask(line), "ok\n", "{line}");
    }
    assert_eq!(printer.ask("G1 X10 Y10 Z1 F6000"), "ok\n");
    printer.steps();
    printer
}

#[test]
fn reports_say_how_high_it_is_above_the_bed_on_the_way_too() {
    for shared in [false, true] {
        assert!(alone(move || {
            let mut printer = following(shared);
            assert_eq!(printer.ask("G1 X90 Y70 F1800"), "ok\n");
            assert_eq!(printer.ask("G2 X50 Y30 I-40 J0"), "ok\n");
            for _ in 0..60 {
                let [x, y, z] = printer.told();
                assert!((z - 10_000).abs() <= 60, "{x} {y} {z}");
            }
            printer.ask("M400");
            assert_eq!(printer.told(), [500_000, 300_000, 10_000]);
        }));
    }
}

#[test]
fn a_probe_tells_how_high_the_contact_is_above_the_plane() {
    assert!(alone(|| {
        let mut printer = following(false);
        printer.machine.set_near(PROBE, 100, false);
        assert_eq!(printer.ask("G1 X60 Y0 Z0.5"), "ok\n");
        assert_eq!(printer.ask("G38.2 X50 Z-3 F100"), "ok\n");
        let [.., z] = printer.steps();
        let [x, y, told] = printer.told();
        assert_eq!(y, 0);
        // Homing has left Z 1 step off 0.
        let wanted = (z - 1) * 25 - i64::from(x) / 50;
        assert!((i64::from(told) - wanted).abs() <= 60, "{told} {wanted}");
        assert!((z - 100).abs() <= 1, "{z}");
    }));
}

#[test]
fn z_of_other_steps_follows_by_those() {
    assert!(alone(|| {
        let mut printer = following(false);
        let before = printer.steps();
        assert_eq!(printer.ask("M92 Z800"), "ok\n");
        assert_eq!(printer.steps(), before);
        assert_eq!(printer.told(), [100_000, 100_000, 10_000]);
        printer.ask("G1 X60 Y30 Z1");
        let after = printer.steps();
        // 1 mm up along X, half a mm down along Y.
        assert!((after[2] - before[2] - 400).abs() <= 1, "{before:?} {after:?}");
    }));
}

#[test]
fn a_hold_keeps_g29_and_m420_waiting() {
    for line in ["G29 L0 R20 F0 B20 Z2", "M420 S0", "G29 S5", "G29 S1 X0 Y0 Z1"] {
        assert!(alone(move || {
            let mut printer = following(false);
            assert_eq!(printer.ask("G1 X90 F600"), "ok\n");
            printer.machine.run_ms(300);
            printer.control("!");
            printer.send(line);
            printer.machine.run_ms(1_000);
            let held = printer.machine.emitted().position;
            printer.machine.run_ms(3_000);
            assert_eq!(printer.machine.emitted().position, held);
            let heard = String::from_utf8(printer.machine.received()).unwrap();
            assert_eq!(heard.replace("echo:busy: processing\n", ""), "", "{line}");
            printer.control("~");
            assert!(!printer.hear().contains("Error"), "{line}");
        }));
    }
}

proptest! {
    #![proptest_config(cases(40))]

    #[test]
    fn any_program_ends_on_the_step_that_the_plane_says(
        ops in prop::collection::vec(any_op(), 1..25),
        shared: bool,
    ) {
        let done = alone(move || play(&ops, shared));
        prop_assert!(done);
    }
}
