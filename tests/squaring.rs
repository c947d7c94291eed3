//! Axes with two motors and a switch for each. Homing squares the axis, however askew the motors stand. If homing ends
//! early, no motor jumps in the next move.

use kerf::boards::inputs::{X_MIN, Y_MIN};
use kerf::hal::imp::Machine;
use proptest::prelude::*;

use crate::cases::cases;

/// Steps in a mm with the default setup of motors.
const STEPS: i64 = 1_280;

struct Sender {
    machine: Machine,
    heard: String,
}

impl Sender {
    /// A machine whose motors 1 and 2 drive X, each with a switch at its own step.
    fn with_switches(switches: [i64; 2]) -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        machine.set_near(X_MIN, switches[0], false);
        machine.set_near(Y_MIN, switches[1], false);
        let mut sender = Sender { machine, heard: String::new() };
        sender.run(100);
        sender.say("{2ma:0}");
        sender.say("{sqsw:3}");
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

    /// Runs until nothing moves any more.
    fn rest(&mut self) -> [i64; 2] {
        let mut still = 0;
        let mut before = self.at();
        while still < 5 {
            self.run(100);
            let now = self.at();
            still = if now == before { still + 1 } else { 0 };
            before = now;
        }
        before
    }

    fn at(&self) -> [i64; 2] {
        let position = self.machine.emitted().position;
        [position[0], position[1]]
    }
}

/// The steps at which the switches close, below 0.
fn any_switches() -> impl Strategy<Value = [i64; 2]> {
    // The other switch is within the 5 mm that a motor may move alone.
    (-20_000i64..-100, -6_300i64..6_300).prop_map(|(one, more)| [one, (one + more).min(-1)])
}

fn home(switches: [i64; 2], speed: u32) {
    let mut sender = Sender::with_switches(switches);
    sender.say(&format!("{{x:{{fr:5000,vm:5000,sv:{speed}}}}}"));
    sender.say("g28.2 x0");
    let ends = sender.rest();
    // A switch opens one step away from where it closes. From there the axis moves 1 mm.
    assert_eq!(ends, switches.map(|at| at + 1 + STEPS), "{}", sender.heard);
    assert!(!sender.heard.contains("\"er\""), "{}", sender.heard);
    sender.say("g0 x2");
    assert_eq!(sender.rest(), ends.map(|at| at + 2 * STEPS));
}

/// Homes with switches so far apart that the other motor does not find its switch within the distance that it may
/// move alone.
fn fail(switches: [i64; 2]) {
    let mut sender = Sender::with_switches(switches);
    sender.say("g28.2 x0");
    let before = sender.rest();
    assert!(sender.heard.contains("\"st\":240"), "{}", sender.heard);
    sender.say("g91 g0 x2");
    assert_eq!(sender.rest(), before.map(|at| at + 2 * STEPS), "{}", sender.heard);
}

fn end_it(switches: [i64; 2], ms: u64, by: &'static str) {
    let mut sender = Sender::with_switches(switches);
    sender.say("g28.2 x0");
    sender.run(ms);
    sender.machine.send(by.as_bytes());
    sender.run(300);
    let before = sender.rest();
    sender.say("{clear:n}");
    sender.say("g91 g0 x2");
    assert_eq!(sender.rest(), before.map(|at| at + 2 * STEPS), "{}", sender.heard);
}

#[test]
fn motors_of_axes_that_stand_still_are_not_a_pair() {
    let play = || {
        let mut sender = Sender::with_switches([-2_000, -2_500]);
        sender.say("{zam:2,aam:2}");
        sender.say("g28.2 x0");
        assert_eq!(sender.rest(), [-2_000, -2_500].map(|at| at + 1 + STEPS));
    };
    assert!(alone(play));
}

/// Runs a test in a thread of its own, because each thread has one machine. Returns whether it passed.
fn alone(play: impl FnOnce() + Send + 'static) -> bool {
    std::thread::spawn(play).join().is_ok()
}

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn homing_squares(switches in any_switches(), speed in 100u32..3_000) {
        prop_assert!(alone(move || home(switches, speed)));
    }

    #[test]
    fn nothing_jumps_where_squaring_has_failed(one in -20_000i64..-100, more in 12_000i64..20_000, which: bool) {
        let far = one - more;
        let switches = if which { [one, far] } else { [far, one] };
        prop_assert!(alone(move || fail(switches)));
    }

    #[test]
    fn nothing_jumps_behind_a_cycle_that_was_ended(
        switches in any_switches(),
        ms in 0u64..5_000,
        by in prop::sample::select(vec!["!%", "{alarm:n}\n", "{shutd:n}\n", "\u{4}"]),
    ) {
        prop_assert!(alone(move || end_it(switches, ms, by)));
    }
}
