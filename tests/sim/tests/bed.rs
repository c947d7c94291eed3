//! A tilted bed on the image: G29 finds it to the step, and Z follows it at the pins.

use kerf::boards::{Board, RAMPS14};
use kerf_sim::Machine;
use kerf_sim::mechanics::Build;

use crate::common::{firmware, printing};

/// Steps in a millimetre of X, Y and Z, as `{mch:3}` sets them.
const STEPS: [f64; 3] = [80.0, 80.0, 400.0];
/// Position of the carriages when the machine is at 0: off their switches by the hysteresis and the zero back-off.
const ZERO: f64 = 2.0 + 0.2 + 1.0;
/// The bed: its height at 0, and how much it rises along X and along Y.
const BED: [f64; 3] = [0.3, 0.004, -0.006];

/// Returns the height of a plane at a place.
fn height(plane: [f64; 3], x: f64, y: f64) -> f64 {
    plane[0] + plane[1] * x + plane[2] * y
}

/// How X and Y are driven.
#[derive(Clone, Copy, PartialEq)]
enum Drive {
    /// By one motor each.
    Alone,
    /// By the sum and the difference of two motors.
    CoreXy,
}

struct Printer {
    machine: Machine,
    drive: Drive,
    said: String,
}

impl Printer {
    /// A printer of 200 mm that is homed, with the image of a board.
    fn homed(board: &'static Board, drive: Drive) -> Self {
        let mut machine = printing::booted(board);
        printing::set(&mut machine, "{mch:3}");
        if drive == Drive::CoreXy {
            printing::set(&mut machine, "{1ma:6,2ma:7}");
        }
        let kept = *machine.eeprom();
        let mut machine = firmware(board);
        machine.set_eeprom(&kept);
        let mut build = Build::of(board);
        for ((axis, steps), start) in build.axes.iter_mut().zip(STEPS).zip([15.0, 12.0, 9.0]) {
            (axis.steps_per_mm, axis.start, axis.travel, axis.max) = (steps, start, 220.0, None);
        }
        if drive == Drive::CoreXy {
            build = build.core_xy(STEPS[0]);
        }
        machine.build(&build);
        let mut printer = Self { machine, drive, said: String::new() };
        printer.run(1_000);
        assert!(printer.ask_all("M105").starts_with("ok T:"));
        assert_eq!(printer.ask("M302 P1"), "");
        assert_eq!(printer.ask("G28"), "");
        printer
    }

    fn run(&mut self, ms: u64) {
        self.machine.run_for_ms(ms).unwrap();
        self.said += &String::from_utf8(self.machine.receive()).unwrap();
    }

    /// Sends a line and waits for `ok`. Returns the lines before that.
    fn ask(&mut self, line: &str) -> String {
        let said = self.ask_all(line);
        said.trim_end_matches("ok\n").to_owned()
    }

    /// Sends a line and waits for a line that begins with `ok`. Returns all lines.
    fn ask_all(&mut self, line: &str) -> String {
        self.said.clear();
        self.machine.send(format!("{line}\n").as_bytes());
        for _ in 0..60_000 {
            let last = self.said.lines().next_back().unwrap_or_default();
            if self.said.ends_with('\n') && last.starts_with("ok") {
                return self.said.replace("echo:busy: processing\n", "");
            }
            self.run(1);
        }
        panic!("no answer to {line}: {:?}", self.said);
    }

    fn steps(&self) -> [i64; 3] {
        [0, 1, 2].map(|motor| self.machine.recorder().motors()[motor].position)
    }

    /// Returns the positions of X, Y and Z, in steps of an axis, from the positions of the motors.
    fn axes(&self, [a, b, z]: [i64; 3]) -> [f64; 3] {
        let [a, b, z] = [a, b, z].map(|steps| steps as f64);
        match self.drive {
            Drive::Alone => [a, b, z],
            Drive::CoreXy => [(a + b) / 2.0, (a - b) / 2.0, z],
        }
    }

    /// Returns the place whose position is 0, in steps.
    fn zero(&mut self) -> [i64; 3] {
        let told = self.ask("M114");
        let count = told.split("Count ").nth(1).unwrap();
        let mut counts = count.split([' ', '\n']).map(|of| of[2..].parse::<i64>().unwrap());
        let steps = self.steps();
        [0, 1, 2].map(|n| steps[n] - counts.next().unwrap())
    }

    fn place_bed(&mut self) {
        // The plate tilts about the lower hard ends.
        let at = ZERO + height(BED, -ZERO, -ZERO);
        self.machine.tamper(|mechanics, now| {
            mechanics.tilt_plate([BED[1], BED[2]]);
            mechanics.place_plate(Some(at), now);
        });
    }

    /// Executes lines, with the machine at the first corner. Returns the largest distance of Z from a plane, in
    /// steps.
    fn off(&mut self, zero: [i64; 3], plane: [f64; 3], lines: &[&str]) -> f64 {
        self.machine.recorder_mut().keep_log();
        let mut at = self.steps();
        for line in lines {
            assert_eq!(self.ask(line), "", "{line}");
        }
        assert_eq!(self.ask("M400"), "");
        self.run(50);
        let mut worst = 0.0f64;
        for step in self.machine.recorder().log() {
            if let Some(at) = at.get_mut(usize::from(step.motor)) {
                *at += if step.positive { 1 } else { -1 };
            }
            let from_zero = self.axes([0, 1, 2].map(|n| at[n] - zero[n]));
            let place = [0, 1, 2].map(|n| from_zero[n] / STEPS[n]);
            let off = place[2] - height(plane, place[0], place[1]);
            worst = worst.max(off.abs() * STEPS[2]);
        }
        assert_eq!(at, self.steps());
        worst
    }
}

/// Returns the plane through the points of an answer to G29.
fn plane(told: &str) -> [f64; 3] {
    let points: Vec<[f64; 3]> = told
        .lines()
        .filter_map(|line| {
            let mut words = line.split("G29 S1 X").nth(1)?.split([' ', 'Y', 'Z']);
            let mut next = || words.by_ref().find(|word| !word.is_empty())?.parse::<f64>().ok();
            Some([next()?, next()?, next()?])
        })
        .collect();
    let [p, q, r] = points[..] else { panic!("{told}") };
    let way = |to: [f64; 3]| [0, 1, 2].map(|n| to[n] - p[n]);
    let (u, v) = (way(q), way(r));
    let area = u[0] * v[1] - u[1] * v[0];
    let along = [(u[2] * v[1] - u[1] * v[2]) / area, (u[0] * v[2] - u[2] * v[0]) / area];
    [p[2] - along[0] * p[0] - along[1] * p[1], along[0], along[1]]
}

#[test]
fn a_square_and_a_circle_follow_a_tilted_bed() {
    follow(Printer::homed(&RAMPS14, Drive::Alone));
}

#[test]
fn a_core_xy_machine_follows_a_tilted_bed() {
    follow(Printer::homed(&RAMPS14, Drive::CoreXy));
}

/// Finds the bed, follows it and homes again.
fn follow(mut printer: Printer) {
    printer.place_bed();
    let told = printer.ask("G29");
    println!("{told}");
    assert!(told.starts_with("Bed leveling status: active (3) positions registered\n"), "{told}");
    let found = plane(&told);
    for (x, y) in [(20.0, 20.0), (180.0, 20.0), (100.0, 180.0)] {
        let off = (height(found, x, y) - height(BED, x, y)) * STEPS[2];
        println!("the bed is found {off:.2} steps off");
        assert!(off.abs() <= 1.6, "{off} steps at {x} {y}");
    }
    let zero = printer.zero();
    // A Z of 0.2 is 0.2 mm above the bed.
    let raised = [found[0] + 0.2, found[1], found[2]];
    printer.ask("G1 X30 Y30 Z0.2 F6000");
    printer.ask("M400");
    printer.run(100);
    let square = ["G1 X170 Y30 F6000", "G1 X170 Y170", "G1 X30 Y170", "G1 X30 Y30"];
    let off = printer.off(zero, raised, &square);
    println!("a square: {off:.2} steps off");
    // A step, plus the error of three decimals in the points.
    assert!(off < 1.3, "{off}");
    let circle = ["G2 X30 Y30 I20 J20", "G91", "G1 X12.34 Y5.67", "G90"];
    let off = printer.off(zero, raised, &circle);
    println!("a circle: {off:.2} steps off");
    assert!(off < 1.8, "{off}");
    let told = printer.ask("M114");
    assert!(told.starts_with("X:42.340 Y:35.670 Z:0.200 "), "{told}");
    // G92 counts on top of the plane. When the plane is switched off no motor moves.
    let steps = printer.steps();
    printer.ask("G92 Z5");
    assert!(printer.ask("M114").starts_with("X:42.340 Y:35.670 Z:5.000 "));
    printer.ask("M420 S0");
    printer.ask("M420 S1");
    assert!(printer.ask("M114").starts_with("X:42.340 Y:35.670 Z:5.000 "));
    assert_eq!(printer.steps(), steps);
    // Homing ends where it ended before.
    assert_eq!(printer.ask("G28"), "");
    let again = printer.zero();
    assert!((0..3).all(|n| (again[n] - zero[n]).abs() <= 1), "{zero:?} {again:?}");
}

#[test]
fn the_limits_of_z_hold_for_what_it_really_does() {
    let mut printer = Printer::homed(&RAMPS14, Drive::Alone);
    for line in ["G29 S1 X0 Y0 Z0", "G29 S1 X200 Y0 Z8", "G29 S1 X0 Y200 Z0", "M203 Z1"] {
        assert_eq!(printer.ask(line), "", "{line}");
    }
    printer.ask("G1 X10 Y10 Z5 F12000");
    printer.ask("M400");
    printer.machine.recorder_mut().keep_log();
    // Z is limited to 1 mm/s and rises by 1 in 25, so X moves at 25 mm/s instead of 200, for 2 s.
    printer.ask("G1 X60 F12000");
    printer.ask("M400");
    printer.run(50);
    let seconds = |motor: u8| {
        let steps = printer.machine.recorder().steps_of(motor);
        let fastest = steps.windows(21).map(|steps| steps[20] - steps[0]).min().unwrap();
        20.0 / printer.machine.seconds(fastest)
    };
    let (x, z) = (seconds(0) / STEPS[0], seconds(2) / STEPS[2]);
    println!("X at {x:.3} mm/s, Z at {z:.3} mm/s");
    assert!((0.97..1.02).contains(&z) && (24.3..25.5).contains(&x), "{x} {z}");
}

#[test]
fn a_stop_within_it_and_a_probe_that_never_closes_leave_no_plane() {
    let mut printer = Printer::homed(&RAMPS14, Drive::Alone);
    // Without a bed Z goes down to its end, and no further.
    let told = printer.ask("G29 Z2");
    assert!(told.contains("Error:probing failed") && told.contains("Error:alarm"), "{told}");
    assert!(printer.ask("G1 X1").contains("Error:alarm"));
    printer.ask("M999");
    assert!(printer.ask("M420 S1").contains("fewer than three points"));
    printer.ask("G28");
    printer.place_bed();
    printer.said.clear();
    printer.machine.send(b"G29\n");
    printer.run(3_000);
    printer.machine.send(b"M112\n");
    printer.run(500);
    let rests = printer.steps();
    printer.run(2_000);
    assert_eq!(printer.steps(), rests, "{}", printer.said);
    let stopped = printer.said.contains("Error:stopped; M999 goes on\n");
    assert!(stopped && printer.said.matches("ok\n").count() == 2, "{}", printer.said);
    printer.ask("M999");
    assert!(printer.ask("M420").starts_with("Bed leveling status: not active ("));
}
