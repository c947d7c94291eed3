//! A CoreXY machine: its first motor drives the sum of X and Y, the second their difference. Whatever moves, and
//! whatever ends a move, both motors are where the position says.

use kerf::boards::inputs::X_MIN;
use kerf::hal::imp::Machine;
use proptest::prelude::*;

use crate::cases::cases;

/// Steps in a mm with the default setup of motors.
const STEPS: f64 = 1_280.0;

struct Sender {
    machine: Machine,
    heard: String,
}

impl Sender {
    fn boot() -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        let mut sender = Sender { machine, heard: String::new() };
        sender.run(100);
        sender.say("{1ma:6}");
        sender.say("{2ma:7}");
        sender
    }

    fn run(&mut self, ms: u64) {
        self.machine.run_ms(ms);
        self.heard += &String::from_utf8(self.machine.received()).expect("ASCII");
    }

    fn say(&mut self, line: &str) {
        self.machine.send(format!("{line}\n").as_bytes());
        self.run(100);
    }

    fn at(&self) -> [i64; 3] {
        let position = self.machine.emitted().position;
        [position[0], position[1], position[2]]
    }

    /// Runs until nothing moves any more.
    fn rest(&mut self) -> [i64; 3] {
        loop {
            let before = self.at();
            self.run(500);
            if self.at() == before {
                return before;
            }
        }
    }

    /// Returns the position of X and Y that the machine reports.
    fn told(&mut self) -> [f64; 2] {
        self.heard.clear();
        self.say("{pos:n}");
        let value = |name: &str| {
            let (_, rest) = self.heard.split_once(name).expect("a position");
            rest.split([',', '}']).next().unwrap_or("").parse().expect("a number")
        };
        [value("\"x\":"), value("\"y\":")]
    }
}

/// Returns where the motors must be.
fn steps([x, y, z]: [f64; 3]) -> [i64; 3] {
    [x + y, x - y, z].map(|mm| (mm * STEPS).round() as i64)
}

/// Runs a test in a thread of its own, because each thread has one machine. Returns whether it passed.
fn alone(play: impl FnOnce() + Send + 'static) -> bool {
    std::thread::spawn(play).join().is_ok()
}

#[test]
fn both_motors_turn_with_either_axis() {
    assert!(alone(|| {
        let mut sender = Sender::boot();
        for (line, place) in [
            ("g1 f800 x2", [2.0, 0.0, 0.0]),
            ("y3", [2.0, 3.0, 0.0]),
            ("x-1 y-1 z0.5", [-1.0, -1.0, 0.5]),
            ("g2 x1 y1 i1 j1", [1.0, 1.0, 0.5]),
            ("g92 x0 y0", [1.0, 1.0, 0.5]),
            ("g1 x1 y-1", [2.0, 0.0, 0.5]),
        ] {
            sender.say(line);
            assert_eq!(sender.rest(), steps(place), "{line}: {}", sender.heard);
        }
    }));
}

#[test]
fn an_axis_homes_with_both_motors() {
    assert!(alone(|| {
        let mut sender = Sender::boot();
        // The simulated switch follows the first motor, which moves like X while Y is at 0.
        sender.machine.set_near(X_MIN, -5_120, false);
        sender.say("g28.2 x0");
        let home = sender.rest();
        // The switch opens one step away from where it closes. From there the axis moves 1 mm.
        assert_eq!(home, [-5_119 + 1_280, -5_119 + 1_280, 0], "{}", sender.heard);
        assert_eq!(sender.told(), [0.0, 0.0]);
        sender.say("g0 x1 y1");
        assert_eq!(sender.rest(), [home[0] + 2_560, home[1], 0]);
    }));
}

#[test]
fn places_whose_sum_cannot_be_counted_are_refused() {
    assert!(alone(|| {
        let mut sender = Sender::boot();
        sender.say("g28.3 x107000 y100000");
        assert!(sender.heard.contains("[1,0,"), "{}", sender.heard);
        for line in ["g28.3 x108000", "g91 g0 x500", "g91 g0 x500 (slow)", "g0 y108000"] {
            sender.heard.clear();
            sender.say(line);
            assert!(sender.heard.contains("[1,110,"), "{line}: {}", sender.heard);
        }
        sender.say("g91 g0 x-1 y1");
        assert_eq!(sender.rest(), [0, -2_560, 0], "{}", sender.heard);
    }));
}

#[test]
fn the_velocity_of_either_axis_is_what_both_motors_can_follow() {
    assert!(alone(|| {
        let mut sender = Sender::boot();
        for line in ["{xvm:50000}", "{yfr:50000}", "{1mi:64}"] {
            sender.heard.clear();
            sender.say(line);
            assert!(sender.heard.contains("WARNING"), "{line}: {}", sender.heard);
        }
    }));
}

#[test]
fn an_axis_that_stands_still_keeps_both_motors() {
    assert!(alone(|| {
        let mut sender = Sender::boot();
        sender.say("{yam:2}");
        sender.say("g0 x1 z1");
        assert_eq!(sender.rest(), [0, 0, 1_280], "{}", sender.heard);
    }));
}

fn any_place() -> impl Strategy<Value = [i32; 3]> {
    let mm = prop_oneof![-20i32..20, -20_000i32..20_000];
    prop::array::uniform3(mm)
}

/// Runs a job of many places, and checks that it ends at the last.
fn run_through(places: &[[i32; 3]]) {
    let mut sender = Sender::boot();
    sender.say("{xvm:5000,yvm:5000,zvm:3000}");
    for [x, y, z] in places {
        sender.say(&format!("g0 x{:.3} y{:.3} z{:.3}", mm(*x), mm(*y), mm(*z)));
    }
    let end = places.last().expect("a place").map(mm);
    assert_eq!(sender.rest(), steps(end), "{}", sender.heard);
    assert_eq!(sender.told(), [end[0], end[1]]);
}

/// Runs moves that are held or ended at any moment, and checks that the way back to 0 is as long as the way there.
fn come_back(places: &[([i32; 3], u64)], by: &str) {
    let mut sender = Sender::boot();
    for ([x, y, _], ms) in places {
        sender.say(&format!("g1 f1200 x{:.3} y{:.3}", mm(*x), mm(*y)));
        sender.run(*ms);
        sender.machine.send(by.as_bytes());
        let stands = sender.rest();
        let [x, y] = sender.told();
        // The report is rounded to 0.001 mm, which is more than a step.
        let told = steps([x, y, 0.0]);
        let near = told.iter().zip(stands).all(|(told, is)| (told - is).abs() <= 3);
        assert!(near, "{x} {y}: {stands:?}, {}", sender.heard);
        sender.say("~");
    }
    sender.rest();
    sender.say("g0 x0 y0");
    assert_eq!(sender.rest(), [0; 3], "{}", sender.heard);
}

fn mm(thousandths: i32) -> f64 {
    f64::from(thousandths) / 1000.0
}

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn any_job_ends_on_its_steps(places in prop::collection::vec(any_place(), 1..12)) {
        let done = alone(move || run_through(&places));
        prop_assert!(done);
    }

    #[test]
    fn no_step_is_lost_where_a_move_was_ended(
        places in prop::collection::vec((any_place(), 0u64..1_500), 1..6),
        by in prop::sample::select(vec!["!%", "\u{4}\n{clear:n}\n", "!"]),
    ) {
        let done = alone(move || come_back(&places, by));
        prop_assert!(done);
    }
}
