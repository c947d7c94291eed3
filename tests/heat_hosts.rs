//! Printing hosts and broken sensors while a printer heats, at many moments. Every output that must be off is off, and
//! hosts get their answers.

use kerf::capability::Capability;
use kerf::hal::imp::{self, Machine};
use kerf::heat::sensor::{Kind, SAMPLES, reading};

use crate::plant::Plant;

/// Time between two computations of the plants, ms.
const STEP: u64 = 10;

/// A printer whose port speaks to a printing host.
struct Printer {
    machine: Machine,
    plants: [Plant; 2],
    /// What each sensor with a broken wire reads; `None` for a whole wire.
    broken: [Option<u16>; 2],
    said: String,
}

impl Printer {
    fn new() -> Option<Self> {
        if !Capability::Printer.is_built_in() {
            return None;
        }
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        let plants = [Plant::hot_end(), Plant::bed()];
        let mut printer = Self { machine, plants, broken: [None; 2], said: String::new() };
        printer.run(1_000);
        assert!(printer.ask("N0 M110 N0*125").ends_with("ok\n"));
        printer.ask("M302 P1");
        Some(printer)
    }

    fn is_on(&self) -> bool {
        self.machine.heaters_on() & 3 != 0
    }

    fn run(&mut self, ms: u64) {
        for _ in 0..ms / STEP {
            let on = self.machine.heaters_on();
            for (n, plant) in self.plants.iter_mut().enumerate() {
                plant.pass(STEP as f64 / 1e3, on & 1 << n != 0, on & 4 != 0);
                let felt = reading(Kind::Semitec, plant.sensor) as u16;
                self.machine.set_sensor(n, self.broken[n].unwrap_or(felt));
            }
            self.machine.run_ms(STEP);
            self.said += &String::from_utf8(self.machine.received()).expect("ASCII");
        }
    }

    fn send(&mut self, line: &str) {
        self.machine.send(line.as_bytes());
        self.machine.send(b"\n");
    }

    /// Sends a line, and returns what is heard within 200 ms.
    fn ask(&mut self, line: &str) -> String {
        self.said.clear();
        self.send(line);
        self.run(200);
        self.said.clone()
    }

    /// Whether everything is off within 100 ms, and stays off for some seconds.
    fn goes_off(&mut self) -> bool {
        self.run(100);
        (0..300).all(|_| {
            self.run(STEP);
            !self.is_on()
        })
    }
}

/// Runs a test in a thread of its own, because each thread has one machine.
fn alone(test: impl FnOnce() + Send + 'static) {
    std::thread::spawn(test).join().expect("no panic");
}

/// What a printer is doing when a wire breaks, as lines that are sent before.
const DOINGS: [&[&str]; 6] = [
    &["M104 S200"],
    &["M140 S60", "M104 S40"],
    &["M109 S200", "G1 X5 F600"],
    &["M104 S60", "G1 X20 F300", "G1 X0"],
    &["M140 S60", "M190 S60", "M106 S255", "G28"],
    &["M109 S60", "M104 S200", "M400"],
];

#[test]
fn a_wire_that_breaks_at_any_moment_switches_off_for_good() {
    let mut moment = 7u64;
    for doing in DOINGS.iter().cycle().take(24) {
        moment = moment.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let (ms, which, short) = (moment >> 40 & 0x7FFF, moment >> 33 & 1, moment >> 34 & 1);
        alone(move || {
            let Some(mut printer) = Printer::new() else { return };
            doing.iter().for_each(|line| printer.send(line));
            printer.run(ms + 500);
            let codes = [["M104", "M109"], ["M140", "M190"]][which as usize];
            let heats = doing.iter().any(|line| codes.iter().any(|code| line.starts_with(code)));
            let broken = if short == 1 { 0 } else { SAMPLES * 1_023 };
            printer.broken[which as usize] = Some(broken);
            printer.said.clear();
            let label = format!("{doing:?} for {ms} ms, sensor {which} short {short}");
            if !heats {
                // The sensor of a heater that is off is not watched.
                printer.run(3_000);
                assert!(!printer.said.contains("Error:"), "{label}: {}", printer.said);
                return;
            }
            assert!(printer.goes_off(), "{label}");
            assert!(printer.said.contains("Error:temperature sensor"), "{label}: {}", printer.said);
            // The wire is mended, and still nothing heats before M999.
            printer.broken = [None; 2];
            printer.ask("M104 S200");
            assert!(printer.said.contains("Error:"), "{label}: {}", printer.said);
            assert!(printer.goes_off(), "{label}");
            printer.ask("M999");
            assert!(printer.ask("M104 S200").ends_with("ok\n"), "{label}: {}", printer.said);
            printer.run(1_000);
            assert!(printer.is_on(), "{label}: M999 unlocks: {}", printer.said);
        });
    }
}

#[test]
fn hosts_get_through_while_a_line_waits_for_a_temperature() {
    alone(|| {
        let Some(mut printer) = Printer::new() else { return };
        for line in ["M109 S200", "G1 X2 F3000", "G1 X4"] {
            printer.send(line);
        }
        printer.run(3_000);
        assert!(printer.ask("M105").contains("ok T:"), "{}", printer.said);
        assert!(printer.ask("M114").contains("X:0.000"), "{}", printer.said);
        printer.said.clear();
        printer.run(10_000);
        assert!(printer.said.matches("echo:busy").count() >= 3, "{}", printer.said);
        assert!(printer.plants[0].sensor < 150.0);
        printer.send("M108");
        printer.run(60_000);
        assert!(printer.ask("M114").contains("X:4.000"), "M108 ends the wait: {}", printer.said);
        assert!(printer.is_on() || printer.plants[0].sensor > 150.0, "it heats on");
    });
}

/// Short lines may still wait to be blended when the line behind them begins to wait.
#[test]
fn lines_before_a_wait_for_a_temperature_run_before_it() {
    for lines in [1, 2, 5] {
        alone(move || {
            imp::set_blends(true);
            let Some(mut printer) = Printer::new() else { return };
            for n in 1..=lines {
                printer.send(&format!("G1 X{} F600", f64::from(n) * 0.1));
            }
            printer.send("M109 S60");
            printer.run(3_000);
            assert!(printer.ask("M114").contains(&format!("X:0.{lines}00")), "{}", printer.said);
            printer.said.clear();
            printer.run(60_000);
            assert!(printer.said.ends_with("ok\n"), "{}", printer.said);
        });
    }
}

/// An `ok` tells a host that the temperature is reached, so it must not come too early.
#[test]
fn a_wait_for_a_temperature_is_answered_when_it_is_over() {
    alone(|| {
        let Some(mut printer) = Printer::new() else { return };
        printer.said.clear();
        printer.send("M109 S60");
        printer.run(2_000);
        assert!(!printer.said.contains("ok"), "{}", printer.said);
        printer.run(60_000);
        assert!(printer.said.ends_with("ok\n"), "{}", printer.said);
        assert!(printer.plants[0].sensor > 57.0);
        // Homing behind M109 delays nothing: M105 is answered, and M108 ends the wait.
        printer.send("M109 S200");
        printer.send("G28");
        printer.run(1_000);
        printer.said.clear();
        assert!(printer.ask("M105").contains("ok T:"), "{}", printer.said);
        printer.send("M108");
        printer.run(500);
        assert_eq!(printer.said.matches("ok").count(), 3, "{}", printer.said);
        printer.run(120_000);
        assert_eq!(printer.said.matches("ok").count(), 4, "{}", printer.said);
    });
}

#[test]
fn m112_in_a_wait_switches_off_and_m999_goes_on() {
    for stop in ["M112", "N5 M112*36", "m112 ; now"] {
        alone(move || {
            let Some(mut printer) = Printer::new() else { return };
            for line in ["M140 S60", "M109 S200", "G1 X5 F600", "M400"] {
                printer.send(line);
            }
            printer.run(5_000);
            assert!(printer.is_on());
            printer.said.clear();
            printer.send(stop);
            assert!(printer.goes_off(), "{stop}: {}", printer.said);
            assert!(printer.said.contains("Error:stopped"), "{stop}: {}", printer.said);
            assert!(printer.ask("M104 S200").contains("Error:"), "{stop}: {}", printer.said);
            printer.ask("M999");
            assert_eq!(printer.ask("M104 S200"), "ok\n", "{stop}");
            printer.run(1_000);
            assert!(printer.is_on(), "{stop}");
            assert!(printer.ask("M114").contains("X:0.000"), "{stop}: {}", printer.said);
        });
    }
}

#[test]
fn a_quick_stop_that_is_not_known_and_a_reset_character_change_nothing() {
    alone(|| {
        let Some(mut printer) = Printer::new() else { return };
        printer.send("M109 S200");
        printer.run(2_000);
        printer.machine.send(b"\x18");
        printer.machine.send(b"\x04");
        printer.run(2_000);
        assert!(printer.is_on(), "damage of a wire switches nothing off: {}", printer.said);
        // M410 is answered in its turn.
        printer.ask("M410");
        assert!(printer.is_on() && !printer.said.contains("Error"), "{}", printer.said);
    });
}
