//! Crowded ports: ports that are full of lines, stopped by their senders, or both. Control lines and real-time
//! characters must still be handled in time.
//!
//! Each test starts with a machine that has just booted. They run on the host and on the simulated chip.

use std::thread;

use crate::side::Side;

mod stops;
pub use stops::{
    a_long_way_does_not_hold_up_control, a_report_is_of_one_moment_whoever_asks_on_the_other_port,
    a_stop_acts_behind_what_is_no_line, a_stop_acts_once, a_stop_acts_when_it_arrives,
};

/// Makes a test of each kind of crowd, with the machine that a function boots.
macro_rules! tests {
    ($boot:ident) => {
        crowd::tests!($boot: xon_gets_through, all_that_has_come_is_dropped, data_does_not_hold_up_control,
            a_stopped_port_does_not_stop_the_other, questions_leave_nothing_behind, nothing_starves_control,
            a_percent_sign_before_a_hold_is_none, a_stop_acts_when_it_arrives, a_stop_acts_once,
            a_report_is_of_one_moment_whoever_asks_on_the_other_port, a_stop_acts_behind_what_is_no_line,
            a_long_way_does_not_hold_up_control);
    };
    ($boot:ident: $($name:ident),+) => {
        $(#[test]
        fn $name() {
            crowd::$name($boot);
        })+
    };
}
pub(crate) use tests;

/// Longest time until the machine must answer or act, ms, counted from the last bit of the request.
const PROMPT_MS: u64 = 20;
/// Longest time until the means of motion are empty, ms, which the spindle waits for.
const MEANS_MS: u64 = 60;
/// Bytes that arrive in a ms: a byte takes less than a tenth of a ms.
const BYTES_MS: usize = 11;

/// A slow move.
const MOVE: &str = "g91g1x.1f10\n";

pub const USB: usize = 0;
pub const AUX: usize = 1;
pub const XOFF: char = '\x13';
pub const XON: char = '\x11';

/// A machine, and what its two ports have sent.
pub struct Crowd<S> {
    side: S,
    heard: [String; 2],
}

impl<S: Side> Crowd<S> {
    /// Waits for the greeting and sets both ports to TinyG's dialect.
    pub fn new(mut side: S) -> Self {
        side.wire(&[], 0);
        let mut crowd = Crowd { side, heard: Default::default() };
        let greeted = crowd.hears(USB, "SYSTEM READY", 3_000) && crowd.hears(AUX, "READY", 1_000);
        assert!(greeted, "no greeting");
        // A line of JSON settles the dialect of a port. A question mark would settle it, too.
        (USB..=AUX).for_each(|port| crowd.send(port, "{fv:n}\n"));
        crowd.pass(50);
        crowd.forget();
        crowd
    }

    /// Sends text on the line of a port, and waits until it has arrived.
    pub fn send(&mut self, port: usize, text: &str) {
        self.put(port, text);
        self.pass((text.len() / BYTES_MS + 1) as u64);
    }

    fn put(&mut self, port: usize, text: &str) {
        match port {
            USB => self.side.send(text.as_bytes()),
            _ => self.side.send_aux(text.as_bytes()),
        }
    }

    /// Sends a setting and waits for its answer.
    pub fn set(&mut self, port: usize, line: &str) {
        self.send(port, &format!("{line}\n"));
        assert!(self.hears(port, "\"f\":[", 500), "no answer to {line}: {:?}", self.heard);
        self.pass(20);
        self.forget();
    }

    pub fn pass(&mut self, ms: u64) {
        self.side.run_ms(ms);
        for (port, heard) in [self.side.heard(), self.side.heard_aux()].iter().enumerate() {
            // The machine may have sent XOFF and XON.
            let heard = String::from_utf8_lossy(heard).replace([XOFF, XON], "");
            self.heard[port] += &heard;
        }
    }

    pub fn forget(&mut self) {
        self.heard.iter_mut().for_each(String::clear);
    }

    /// Whether a port sends this text within `ms` milliseconds.
    pub fn hears(&mut self, port: usize, text: &str, ms: u64) -> bool {
        self.comes(ms, |crowd| crowd.heard[port].contains(text))
    }

    /// Whether a port sends a whole line that contains this text within `ms` milliseconds.
    fn hears_line(&mut self, port: usize, text: &str, ms: u64) -> bool {
        self.comes(ms, |crowd| {
            let mut lines = crowd.heard[port].split_inclusive('\n');
            lines.any(|line| line.contains(text) && line.ends_with('\n'))
        })
    }

    /// Whether a condition becomes true within `ms` milliseconds.
    fn comes(&mut self, ms: u64, is_so: impl Fn(&Self) -> bool) -> bool {
        (0..=ms).any(|_| {
            let is_so = is_so(self);
            if !is_so {
                self.pass(1);
            }
            is_so
        })
    }

    /// Number of responses with this status that a port has sent.
    pub fn responses(&self, port: usize, status: u16) -> usize {
        self.heard[port].matches(&format!("\"f\":[1,{status},")).count()
    }

    /// Checks that a line on a port is answered promptly, with this answer.
    pub fn prompt(&mut self, port: usize, line: &str, answer: &str) {
        self.forget();
        self.send(port, line);
        let begun = self.heard[port].len();
        let hears = self.hears_line(port, answer, PROMPT_MS);
        let (heard, asked) =
            (&self.heard[port][begun.min(self.heard[port].len())..], line.trim_end());
        assert!(hears, "{asked} on port {port} is not answered: {heard:?}");
    }

    pub fn steps(&self) -> [i64; 4] {
        self.side.steps()
    }

    /// Whether the spindle turns.
    pub fn turns(&self) -> bool {
        self.side.outputs().0 & 1 != 0
    }

    /// Fills the planner with slow moves until a line has to wait.
    fn fill_planner(&mut self, port: usize) {
        let mut taken = true;
        while taken {
            self.forget();
            self.send(port, MOVE);
            taken = self.hears(port, "\"f\":[", 200);
        }
    }

    /// Makes a sender stop taking answers, or take them again.
    fn hold_back(&mut self, port: usize, holds: bool) {
        self.send(port, if holds { "\x13" } else { "\x11" });
        self.pass(60);
    }

    /// Checks that the spindle stops promptly.
    fn stops(&mut self, what: &str) {
        let turns = |crowd: &mut Self| {
            crowd.pass(1);
            crowd.turns()
        };
        let most = PROMPT_MS + MEANS_MS;
        assert!((0..most).any(|_| !turns(self)), "{what:?} does nothing: {:?}", self.heard);
    }
}

/// Runs a test with a machine of its own in a thread of its own, because on the host each thread has one machine.
fn alone<S: Side>(boot: &(impl Fn() -> S + Sync), play: impl Fn(Crowd<S>) + Sync) {
    thread::scope(|scope| {
        let played = scope.spawn(|| play(Crowd::new(boot()))).join();
        played.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
}

/// A sender asks for settings while it holds the machine back. It gets its answers when it lets the machine go on.
pub fn xon_gets_through<S: Side>(boot: impl Fn() -> S + Sync) {
    let many = format!("{{{}xvm:n}}", "xvm:n,xfr:n,".repeat(11));
    let pool = format!("{{{}xvm:n}}\n", "xvm:n,".repeat(5));
    for (port, setting, lines, answers) in [
        (USB, "{ex:1}", format!("{many}\n").repeat(4), 4),
        (USB, "{rxm:0}", "{xvm:n,xfr:n,xac:n,xjm:n}\n".repeat(9), 9),
        (USB, "{ex:1}", "{xvm:n}\n".repeat(10), 10),
        (AUX, "{ex:1}", pool.repeat(3), 3),
    ] {
        alone(&boot, |mut crowd| {
            crowd.set(USB, setting);
            crowd.send(port, &XOFF.to_string());
            // The sender ignores the XOFF that the machine sends because its ring is short.
            for line in lines.split_inclusive('\n') {
                crowd.send(port, line);
                crowd.pass(if port == AUX { 15 } else { 0 });
            }
            crowd.pass(200);
            assert_eq!(crowd.heard[port], "", "held back");
            crowd.prompt(USB + AUX - port, "{stat:n}\n", "{\"stat\":1}");
            crowd.send(port, &XON.to_string());
            crowd.pass(400);
            assert_eq!(crowd.responses(port, 0), answers, "{lines:?}: {:?}", crowd.heard);
            crowd.prompt(port, "{stat:n}\n", "{\"stat\":1}");
        });
    }
}

/// A kill or a flush on one port drops all that has arrived on the other port, wherever it waits.
pub fn all_that_has_come_is_dropped<S: Side>(boot: impl Fn() -> S + Sync) {
    for (cut, ends) in [("\x04", false), ("!%", true)] {
        alone(&boot, |mut crowd| {
            crowd.set(USB, "{psw:1,jv:2}");
            crowd.send(USB, "m3 s1000\nm0\n");
            crowd.pass(100);
            crowd.send(USB, &"g91g1x.1f500\n".repeat(12));
            crowd.pass(100);
            assert!(crowd.turns());
            crowd.forget();
            crowd.send(AUX, cut);
            crowd.pass(1_000);
            assert_eq!(
                (crowd.responses(USB, 5), crowd.responses(USB, 0)),
                (12, 0),
                "{:?}",
                crowd.heard
            );
            assert_eq!((crowd.steps(), crowd.turns()), ([0; 4], ends), "{cut:?}");
            // What comes later is executed.
            crowd.send(USB, "g91g1x.1f500\n");
            crowd.pass(500);
            assert_eq!(crowd.steps(), [128, 0, 0, 0]);
        });
    }
}

/// Waiting lines do not hold up control, however many and however long they are.
pub fn data_does_not_hold_up_control<S: Side>(boot: impl Fn() -> S + Sync) {
    let long = |n: usize| format!("g91g1x.1f10({})\n", "x".repeat(n - 14));
    let crowds =
        [long(170).repeat(3), "g4p9\n".repeat(50), format!("g4p1\n{}", long(254).repeat(2))];
    for stopped in [false, true] {
        for lines in &crowds {
            alone(&boot, |mut crowd| {
                crowd.set(USB, "{psw:1}");
                crowd.set(USB, "{rxm:0,sv:0}");
                crowd.send(USB, "m3 s1000\n");
                match stopped {
                    true => crowd.send(USB, "m0\n"),
                    false => crowd.fill_planner(USB),
                }
                crowd.pass(200);
                crowd.send(USB, lines);
                crowd.pass(200);
                let stat = if stopped { "{\"stat\":3}" } else { "{\"stat\":5}" };
                crowd.prompt(USB, "{stat:n}\n", stat);
                crowd.prompt(USB, "{fb:null}\r\n", "{\"fb\":440.20}");
                crowd.prompt(AUX, "{stat:n}\n", stat);
                crowd.prompt(USB, "{alarm:1}\n", "{\"alarm\":1}");
                crowd.pass(5);
                assert!(!crowd.turns());
            });
        }
    }
}

/// A port whose sender holds the machine back does not hold up the other port.
pub fn a_stopped_port_does_not_stop_the_other<S: Side>(boot: impl Fn() -> S + Sync) {
    for (stopped, by_pin) in [(AUX, false), (AUX, true), (USB, false)] {
        alone(&boot, |mut crowd| {
            let free = USB + AUX - stopped;
            crowd.set(USB, "{sv:0}");
            if by_pin {
                crowd.set(USB, "{ex:2}");
                crowd.side.set_aux_cts(true);
            } else {
                crowd.send(stopped, &XOFF.to_string());
            }
            crowd.send(stopped, &"{xvm:n}\n".repeat(6));
            crowd.send(stopped, "\x05");
            crowd.pass(100);
            crowd.prompt(free, "{stat:n}\n", "{\"stat\":1}");
            crowd.prompt(free, "\x05", "{\"ack\":true}");
            crowd.send(free, "g91g1x.1f500\n");
            crowd.pass(500);
            assert_eq!(crowd.steps(), [128, 0, 0, 0], "{:?}", crowd.heard);
            assert_eq!(crowd.responses(free, 0), 1, "{stopped} {by_pin} {:?}", crowd.heard);
            if by_pin {
                crowd.side.set_aux_cts(false);
            } else {
                crowd.send(stopped, &XON.to_string());
            }
            crowd.pass(300);
            assert_eq!(crowd.responses(stopped, 0), 6, "{:?}", crowd.heard);
            assert_eq!(crowd.heard[stopped].matches("{\"ack\":true}").count(), 1);
        });
    }
}

/// The room of a line that has overtaken is free again, so a sender that counts may ask any number of times.
pub fn questions_leave_nothing_behind<S: Side>(boot: impl Fn() -> S + Sync) {
    for (port, waiting, ends) in [(USB, 48, "\n"), (USB, 48, "\r"), (AUX, 18, "\n")] {
        alone(&boot, |mut crowd| {
            crowd.set(USB, "{psw:1,rxm:0,sv:0}");
            crowd.set(port, "m0");
            crowd.send(port, &format!("g4p0{ends}").repeat(waiting));
            for _ in 0..12 {
                crowd.prompt(port, &format!("{{stat:n}}{ends}"), "{\"stat\":3}");
            }
            crowd.prompt(port, "{alarm:1}\n", "{\"alarm\":1}");
            crowd.pass(200);
            assert_eq!(crowd.heard[port].matches("[1,203,").count(), waiting, "{:?}", crowd.heard);
        });
    }
}

/// Everything at once: the planner is full or waits for a tilde, the pool and the ring of the port that feeds it are
/// full, and one of the ports is held back with answers pending. Questions, holds, kills and alarms must get through
/// on the other port, whichever that is.
pub fn nothing_starves_control<S: Side>(boot: impl Fn() -> S + Sync) {
    for (feeder, waiting) in [(USB, 24), (AUX, 8)] {
        for (waits, speaker) in [(false, USB), (false, AUX), (true, USB), (true, AUX)] {
            for stop in ["\x04", "{alarm:1}\n", "!\x04"] {
                alone(&boot, |mut crowd| {
                    let silent = USB + AUX - speaker;
                    crowd.set(USB, "{psw:1,sv:0}");
                    crowd.set(feeder, "m3 s1000");
                    if waits {
                        crowd.set(feeder, "m0");
                    } else {
                        crowd.fill_planner(feeder);
                    }
                    crowd.hold_back(silent, true);
                    crowd.send(silent, &"{xvm:n}\n".repeat(2));
                    crowd.send(feeder, &MOVE.repeat(waiting));
                    crowd.pass(100);
                    let stat = if waits { "{\"stat\":3}" } else { "{\"stat\":5}" };
                    crowd.prompt(speaker, "{stat:n}\n", stat);
                    crowd.prompt(speaker, "\x05", "{\"ack\":true}");
                    if !waits {
                        crowd.send(speaker, "!");
                        crowd.prompt(speaker, "{stat:n}\n", "{\"stat\":6}");
                    }
                    assert!(crowd.turns());
                    crowd.send(speaker, stop);
                    crowd.stops(stop);
                    crowd.prompt(speaker, "{stat:n}\n", "{\"stat\":");
                    // All lines are answered in the end.
                    crowd.forget();
                    crowd.hold_back(silent, false);
                    crowd.pass(1_000);
                    let answers = if silent == feeder { waiting + 2 } else { 2 };
                    let heard = crowd.heard[silent].matches("{\"r\":").count();
                    assert!(heard >= answers, "{heard} of {answers}: {:?}", crowd.heard);
                });
            }
        }
    }
}

/// Programs end with a percent sign. A percent sign that waits in the ring when a hold begins has no effect; one that
/// comes during the hold drops the queue.
pub fn a_percent_sign_before_a_hold_is_none<S: Side>(boot: impl Fn() -> S + Sync) {
    for (flush, steps) in [("", 12 * 128), ("%", 0)] {
        alone(&boot, |mut crowd| {
            crowd.set(USB, "{psw:1,sv:0}");
            crowd.send(USB, "m0\n");
            crowd.send(USB, &"g91g1x.1f500\n".repeat(12));
            crowd.send(USB, "%\n");
            crowd.pass(100);
            crowd.send(AUX, "!");
            crowd.pass(100);
            crowd.send(USB, flush);
            crowd.pass(100);
            let dropped = if steps == 0 { 12 } else { 0 };
            assert_eq!(crowd.responses(USB, 5), dropped, "{:?}", crowd.heard);
            for _ in 0..2 {
                crowd.send(USB, "~");
                crowd.pass(2_000);
            }
            assert_eq!(crowd.steps(), [steps, 0, 0, 0], "{:?}", crowd.heard);
        });
    }
}
