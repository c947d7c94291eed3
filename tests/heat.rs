//! The heaters of the whole firmware, on simulated plants in mocked time.

use kerf::capability::Capability;
use kerf::hal::imp::Machine;
use kerf::heat::sensor::{Kind, SAMPLES, reading};

use crate::plant::{AIR, Plant};

/// The state of a sensor's wire.
#[derive(Clone, Copy, PartialEq)]
pub enum Wire {
    Well,
    Open,
    Short,
    /// The sensor has fallen out of its heater.
    Loose,
    /// The sensor reads the same for ever.
    Frozen,
}

/// A printer whose firmware runs in mocked time.
pub struct Printer {
    pub machine: Machine,
    pub hot_end: Plant,
    pub bed: Plant,
    pub wire: Wire,
    /// Whether the transistor of the hot end conducts whatever the firmware does.
    pub stuck: bool,
    noise: u32,
    /// What the loose sensor reads.
    pub loose: f64,
    /// The kind of the hot end's sensor.
    kind: Kind,
    word: u16,
    pub ms: u64,
    pub said: String,
}

/// Time between two computations of the plants, ms.
pub const STEP: u64 = 10;
/// Time that a MAX6675 takes for a conversion, ms.
const CONVERTS: u64 = 220;

impl Printer {
    fn new() -> Option<Self> {
        Self::at(AIR)
    }

    /// A printer in TinyG's dialect whose hot end has this temperature at power-up; `None` without the capability.
    pub fn at(degrees: f64) -> Option<Self> {
        let mut printer = Self::open_at(degrees)?;
        printer.ask("{}");
        printer.said.clear();
        Some(printer)
    }

    /// A printer whose hot end has this temperature at power-up, and whose port no line has decided yet.
    pub fn open_at(degrees: f64) -> Option<Self> {
        if !Capability::Printer.is_built_in() {
            return None;
        }
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        let (mut hot_end, bed) = (Plant::hot_end(), Plant::bed());
        (hot_end.block, hot_end.sensor) = (degrees, degrees);
        let mut printer = Self {
            machine,
            hot_end,
            bed,
            wire: Wire::Well,
            stuck: false,
            noise: 1,
            loose: AIR,
            kind: Kind::Semitec,
            word: 0,
            ms: 0,
            said: String::new(),
        };
        printer.run(1_000, |_| {});
        printer.said.clear();
        Some(printer)
    }

    fn noise(&mut self) -> f64 {
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.noise >> 16) / 65_536.0 - 0.5
    }

    /// Returns the reading of the converter. Each conversion has half a count of noise, of which the sum keeps a
    /// sixth.
    fn read(&mut self, kind: Kind, degrees: f64) -> u16 {
        if kind == Kind::Max6675 {
            if self.ms.is_multiple_of(CONVERTS) {
                self.word = reading(kind, degrees) as u16;
            }
            return self.word;
        }
        let (full, noise) = (f64::from(SAMPLES) * 1_023.0, self.noise() * 6.0);
        (reading(kind, degrees) + noise).clamp(0.0, full) as u16
    }

    /// Runs for a time, and calls `look` at each step.
    pub fn run(&mut self, ms: u64, mut look: impl FnMut(&Self)) {
        for _ in 0..ms / STEP {
            let on = self.machine.heaters_on();
            let (seconds, fan) = (STEP as f64 / 1_000.0, on & 4 != 0);
            self.hot_end.pass(seconds, on & 1 != 0 || self.stuck, fan);
            self.bed.pass(seconds, on & 2 != 0, fan);
            if self.wire == Wire::Loose {
                self.loose += (AIR - self.loose) * seconds / 5.0;
            }
            let hot_end = match self.wire {
                Wire::Well => self.read(self.kind, self.hot_end.sensor),
                Wire::Loose | Wire::Frozen => self.read(self.kind, self.loose),
                Wire::Open => SAMPLES * 1_023,
                Wire::Short => 0,
            };
            let bed = self.read(Kind::Semitec, self.bed.sensor);
            self.machine.set_sensor(0, hot_end);
            self.machine.set_sensor(1, bed);
            self.machine.run_ms(STEP);
            self.ms += STEP;
            self.said += &String::from_utf8(self.machine.received()).expect("ASCII");
            look(self);
        }
    }

    pub fn send(&mut self, line: &str) {
        self.machine.send(line.as_bytes());
        self.machine.send(b"\n");
    }

    /// Sends a line and runs until it is answered.
    pub fn ask(&mut self, line: &str) -> String {
        self.said.clear();
        self.send(line);
        self.run(200, |_| {});
        self.said.clone()
    }

    /// Returns how long it takes until all heaters are off; `None` if it takes longer than `ms`.
    fn off_after(&mut self, ms: u64) -> Option<u64> {
        let (from, mut off) = (self.ms, None);
        self.run(ms, |printer| match printer.machine.heaters_on() & 3 {
            0 => off = off.or(Some(printer.ms - from)),
            _ => off = None,
        });
        off
    }

    /// A printer with the hot end at 200 degrees.
    fn hot() -> Option<Self> {
        let mut printer = Self::new()?;
        let answer = printer.ask("m104 s200");
        assert!(answer.contains("\"f\":[1,0,"), "{answer}");
        printer.run(240_000, |_| {});
        assert!((printer.hot_end.block - 200.0).abs() < 1.0, "{}", printer.hot_end.block);
        Some(printer)
    }
}

#[test]
fn the_hot_end_comes_to_its_temperature_and_keeps_it() {
    let Some(mut printer) = Printer::new() else { return };
    printer.ask("m104 s200");
    let (mut most, mut reached) = (0f64, None);
    printer.run(240_000, |printer| {
        most = most.max(printer.hot_end.sensor);
        if printer.hot_end.sensor > 199.0 {
            reached = reached.or(Some(printer.ms));
        }
    });
    assert!(reached.is_some_and(|ms| ms < 150_000), "200 degrees after {reached:?} ms");
    assert!(most < 202.0, "overshoot to {most}");
    let (mut low, mut high) = (1e9f64, 0f64);
    printer.run(600_000, |printer| {
        low = low.min(printer.hot_end.sensor);
        high = high.max(printer.hot_end.sensor);
    });
    println!("reached after {reached:?} ms, most {most:.2}, held from {low:.2} to {high:.2}");
    assert!(low > 199.5 && high < 200.5, "held from {low} to {high}");
}

#[test]
fn the_fan_at_full_is_made_up_for() {
    let Some(mut printer) = Printer::hot() else { return };
    printer.ask("m106");
    let (mut low, mut below) = (1e9f64, 0);
    printer.run(180_000, |printer| {
        low = low.min(printer.hot_end.sensor);
        below += if printer.hot_end.sensor < 199.0 { STEP } else { 0 };
    });
    println!("fan: down to {low:.2}, below 199 for {below} ms");
    assert!(low > 198.0 && below < 25_000, "down to {low}, below 199 for {below} ms");
}

#[test]
fn the_bed_is_switched_within_its_hysteresis() {
    let Some(mut printer) = Printer::new() else { return };
    printer.ask("m140 s60");
    printer.run(600_000, |_| {});
    let (mut low, mut high) = (1e9f64, 0f64);
    printer.run(600_000, |printer| {
        low = low.min(printer.bed.sensor);
        high = high.max(printer.bed.sensor);
    });
    println!("bed from {low:.2} to {high:.2}");
    assert!(low > 58.0 && high < 62.5, "from {low} to {high}");
}

#[test]
fn broken_wires_switch_off_within_100_ms() {
    for (wire, code) in [(Wire::Open, 48), (Wire::Short, 49)] {
        let join = std::thread::spawn(move || {
            let Some(mut printer) = Printer::hot() else { return };
            printer.send("m140 s60");
            printer.run(2_000, |_| {});
            printer.said.clear();
            printer.wire = wire;
            let off = printer.off_after(10_000);
            assert!(off.is_some_and(|ms| ms <= 100), "off after {off:?} ms");
            assert!(printer.said.contains(&format!("\"st\":{code}")), "{}", printer.said);
            printer.wire = Wire::Well;
            printer.ask("{clear:n}");
            let answer = printer.ask("m104 s200");
            assert!(answer.contains("\"f\":[1,54,"), "{answer}");
            let answer = printer.ask("m140 s60");
            assert!(answer.contains("\"f\":[1,54,"), "{answer}");
            assert!(printer.ask("m104 s0").contains("\"f\":[1,0,"));
            assert_eq!(printer.off_after(5_000), Some(STEP));
        });
        join.join().expect("no panic");
    }
}

#[test]
fn a_sensor_that_has_come_loose_is_noticed_by_the_rule() {
    let Some(mut printer) = Printer::hot() else { return };
    printer.said.clear();
    printer.loose = printer.hot_end.sensor;
    printer.wire = Wire::Loose;
    let off = printer.off_after(60_000);
    println!("loose: off after {off:?} ms, block at {:.0}", printer.hot_end.block);
    assert!(off.is_some_and(|ms| ms < 40_000), "{off:?}");
    assert!(printer.said.contains("\"st\":50"), "{}", printer.said);
}

/// The reading freezes just below the target, at which a weak heater might need full power for ever.
#[test]
fn a_sensor_that_is_frozen_below_its_target_is_noticed() {
    let Some(mut printer) = Printer::hot() else { return };
    printer.said.clear();
    (printer.wire, printer.loose) = (Wire::Frozen, 198.6);
    let mut most = 0f64;
    printer.run(400_000, |printer| most = most.max(printer.hot_end.block));
    println!("frozen: at most {most:.0}, {}", printer.said);
    assert!(most < 290.0, "{most}");
    assert!(printer.said.contains("\"st\":50"), "{}", printer.said);
    assert_eq!(printer.machine.heaters_on() & 3, 0);
}

#[test]
fn a_heater_that_does_not_heat_is_noticed_by_the_rule() {
    let Some(mut printer) = Printer::new() else { return };
    printer.hot_end.watts = 0.0;
    printer.ask("m104 s200");
    printer.said.clear();
    let off = printer.off_after(60_000);
    assert!(off.is_some_and(|ms| ms < 25_000), "{off:?}");
    assert!(printer.said.contains("\"st\":51"), "{}", printer.said);
}

#[test]
fn a_transistor_that_stays_on_is_told() {
    let Some(mut printer) = Printer::new() else { return };
    printer.stuck = true;
    printer.run(120_000, |_| {});
    assert!(printer.said.contains("\"st\":50"), "{}", printer.said);
    printer.said.clear();
    // When the hot end has become too hot, no heater works any more: they are locked.
    printer.run(120_000, |_| {});
    assert!(printer.hot_end.block > 275.0);
}

#[test]
fn an_alarm_switches_off_and_a_wait_keeps_nobody_waiting() {
    let Some(mut printer) = Printer::new() else { return };
    printer.send("m109 s200");
    printer.send("g0 x5");
    printer.run(20_000, |_| {});
    assert!(printer.said.matches("\"f\":[1,0,").count() >= 1, "{}", printer.said);
    printer.said.clear();
    printer.send("{sr:n}");
    printer.run(100, |_| {});
    assert!(!printer.said.is_empty(), "a question is answered while a line waits");
    printer.send("{alarm:n}");
    let off = printer.off_after(1_000);
    assert!(off.is_some_and(|ms| ms <= 50), "{off:?}: {}", printer.said);
    printer.ask("{clear:n}");
    assert!(printer.ask("g0 x1").contains("\"f\":[1,0,"), "the wait is over: {}", printer.said);
    assert_eq!(printer.off_after(5_000), Some(STEP));
}

#[test]
fn nothing_is_waited_for_where_nothing_is_to_be_hot() {
    for line in ["m109", "m109 s0", "m190 r0", "m116"] {
        let join = std::thread::spawn(move || {
            let Some(mut printer) = Printer::new() else { return };
            // Nothing waits even if the sensor is broken, because that is no fault while its heater is off.
            printer.wire = Wire::Open;
            printer.send(line);
            printer.send("g0 x1");
            printer.run(1_000, |_| {});
            assert_ne!(printer.machine.emitted().steps[0], 0, "{line}: {}", printer.said);
        });
        join.join().expect("no panic");
    }
}

#[test]
fn motion_goes_on_when_the_temperature_is_there() {
    let Some(mut printer) = Printer::new() else { return };
    for line in ["{sv:0}", "m140 s40", "m109 s200", "g0 x5"] {
        printer.send(line);
    }
    let mut moved_at = None;
    printer.run(200_000, |printer| {
        if printer.machine.emitted().steps[0] != 0 && moved_at.is_none() {
            moved_at = Some((printer.ms, printer.hot_end.sensor));
        }
    });
    let Some((_, degrees)) = moved_at else { panic!("no step: {}", printer.said) };
    assert!((198.0..202.0).contains(&degrees), "moved at {degrees}");
}

#[test]
fn the_end_of_a_program_switches_off() {
    let Some(mut printer) = Printer::hot() else { return };
    printer.ask("m106 s255");
    assert!(printer.machine.heaters_on() & 4 != 0);
    printer.ask("m2");
    printer.run(100, |_| {});
    let mut on = 0;
    printer.run(5_000, |printer| on |= printer.machine.heaters_on());
    assert_eq!(on, 0);
}

/// A printer in the dialect of printing hosts, with the hot end at this temperature.
fn prints(at: f64) -> Option<Printer> {
    let mut printer = Printer::open_at(at)?;
    printer.ask("M105");
    printer.ask("M92 E100");
    Some(printer)
}

#[test]
fn filament_moves_where_it_is_hot_enough() {
    for (at, steps) in [(167.0, 0), (176.0, -100)] {
        let join = std::thread::spawn(move || {
            let Some(mut printer) = prints(at) else { return };
            let answer = printer.ask("G1 E-1 F600");
            assert_eq!(answer.contains("cold extrusion prevented"), steps == 0, "{answer}");
            printer.run(1_000, |_| {});
            assert_eq!(printer.machine.emitted().position[3], steps, "at {at} degrees");
        });
        join.join().expect("no panic");
    }
}

/// A move that was planned while the hot end was hot is stopped if the hot end is cold when the move begins.
#[test]
fn filament_that_gets_cold_in_the_queue_is_not_moved() {
    let Some(mut printer) = prints(180.0) else { return };
    printer.send("G1 X50 F10");
    printer.send("G1 X51 F3000");
    printer.send("G1 E300 F600");
    printer.run(310_000, |_| {});
    let said = printer.said.clone();
    assert!(said.contains("Error:too cold to extrude"), "{said}");
    let steps = printer.machine.emitted().position;
    assert_eq!(steps[0], 51 * 1_280);
    assert!(steps[3] < 400, "{steps:?}");
    printer.ask("M999");
    assert!(printer.ask("G1 X2").contains("ok"));
}

/// A temperature that swings around the limit does not stop a move under way.
#[test]
fn a_few_degrees_less_stop_nothing() {
    let Some(mut printer) = prints(174.0) else { return };
    printer.send("G1 E200 F600");
    printer.run(10_000, |printer| {
        assert!(!printer.said.contains("cold"), "{}", printer.said);
    });
    assert!(printer.hot_end.sensor < 168.0, "{}", printer.hot_end.sensor);
    assert!(printer.machine.emitted().position[3] > 9_000);
}

/// Runs until a text has come, at most `ms`. Returns whether it has come.
fn until(printer: &mut Printer, text: &str, ms: u64) -> bool {
    for _ in 0..ms / 100 {
        if printer.said.contains(text) {
            return true;
        }
        printer.run(100, |_| {});
    }
    false
}

#[test]
fn an_autotune_finds_factors_that_keep_to_the_temperature() {
    let Some(mut printer) = prints(AIR) else { return };
    printer.said.clear();
    printer.send("M303 E0 S200 C8 U1");
    printer.send("M301");
    assert!(until(&mut printer, "echo:busy: processing", 30_000), "{}", printer.said);
    // Questions are answered meanwhile.
    assert!(!printer.said.contains("M301"), "{}", printer.said);
    printer.send("M105");
    assert!(until(&mut printer, "ok T:", 1_000), "{}", printer.said);
    assert!(until(&mut printer, "PID Autotune finished!", 600_000), "{}", printer.said);
    printer.run(500, |_| {});
    let said = printer.said.clone();
    assert_eq!(said.matches(" bias: ").count(), 8, "{said}");
    let told: Vec<_> = said.lines().filter(|line| line.starts_with("echo:  M301")).collect();
    assert!(told.len() == 2 && told[0] == told[1] && !told[0].contains("P20.00"), "{said}");
    assert_eq!(printer.off_after(10_000), Some(STEP), "it is off then");
    printer.run(400_000, |_| {});
    printer.ask("M104 S200");
    let mut most = 0f64;
    printer.run(240_000, |printer| most = most.max(printer.hot_end.sensor));
    assert!(most < 202.0, "overshoot to {most}");
    let (mut low, mut high) = (1e9f64, 0f64);
    printer.run(600_000, |printer| {
        low = low.min(printer.hot_end.sensor);
        high = high.max(printer.hot_end.sensor);
    });
    println!("{told:?}: most {most:.2}, held from {low:.2} to {high:.2}");
    assert!(low > 199.5 && high < 200.5, "held from {low} to {high}");
}

#[test]
fn an_autotune_ends_by_m108_an_alarm_and_a_fault() {
    for (ends, said) in [
        ("M108", "PID Autotune stopped"),
        ("M112", "PID Autotune stopped"),
        ("open", "PID Autotune stopped"),
    ] {
        let join = std::thread::spawn(move || {
            let Some(mut printer) = prints(AIR) else { return };
            printer.send("M303 E0 S200 C8 U1");
            printer.send("G1 X1 F3000");
            printer.run(60_000, |_| {});
            assert!(printer.machine.heaters_on() & 1 != 0, "{}", printer.said);
            printer.said.clear();
            match ends {
                "open" => printer.wire = Wire::Open,
                line => printer.send(line),
            }
            let off = printer.off_after(5_000);
            assert!(off.is_some_and(|ms| ms <= 300), "{ends}: off after {off:?} ms");
            assert!(printer.said.contains(said), "{ends}: {}", printer.said);
            printer.wire = Wire::Well;
            printer.ask("M999");
            printer.run(500, |_| {});
            let answer = printer.ask("M301");
            assert!(answer.contains("M301 P20.00 I0.80 D80.00"), "{ends}: {answer}");
            let answer = printer.ask("G1 X2 F3000");
            assert!(answer.starts_with("ok"), "{ends}: {answer}");
        });
        join.join().expect("no panic");
    }
}

#[test]
fn a_bed_is_tuned_as_well() {
    let Some(mut printer) = prints(AIR) else { return };
    printer.said.clear();
    printer.send("M303 E-1 S60 C5");
    assert!(until(&mut printer, "PID Autotune finished!", 1_200_000), "{}", printer.said);
    printer.run(500, |_| {});
    assert!(printer.said.contains("echo:  M304 P"), "{}", printer.said);
    // The result is not used, because no U1 was given.
    assert!(printer.ask("M304").contains("M304 P0.00 I0.00 D0.00"), "{}", printer.said);
}

/// A line behind an autotune that is ended takes effect: the heater that the tuning leaves off is off before that
/// line.
#[test]
fn what_comes_behind_an_ended_autotune_heats() {
    let Some(mut printer) = prints(AIR) else { return };
    for line in ["M303 E0 S150 C8", "M104 S100"] {
        printer.send(line);
    }
    printer.run(10_000, |_| {});
    printer.send("M108");
    printer.run(1_000, |_| {});
    let answer = printer.ask("M105");
    assert!(answer.contains("/100.00"), "{answer}");
}

/// With every kind of sensor the hot end reaches and holds the temperature that it reaches with a thermistor.
#[test]
fn every_sensor_holds_the_temperature() {
    let kinds = [Kind::Epcos, Kind::Ad595, Kind::Pt100, Kind::Ad8495, Kind::Max6675];
    // One machine for each thread.
    std::thread::scope(|scope| kinds.map(|kind| scope.spawn(move || holds(kind))).map(drop));
}

fn holds(kind: Kind) {
    let Some(mut printer) = Printer::new() else { return };
    printer.kind = kind;
    let answer = printer.ask(&format!("{{he1k:{}}}", kind as u8));
    assert!(answer.contains("\"f\":[1,0,"), "{answer}");
    printer.run(2_000, |_| {});
    printer.ask("m104 s200");
    let mut most = 0f64;
    printer.run(240_000, |printer| most = most.max(printer.hot_end.block));
    let (mut low, mut high) = (1e9f64, 0f64);
    printer.run(120_000, |printer| {
        low = low.min(printer.hot_end.block);
        high = high.max(printer.hot_end.block);
    });
    println!("{kind:?}: at most {most:.2}, then {low:.2} to {high:.2}");
    // The first asks whether the sensor is alive let it cool by a degree, and it comes back.
    assert!(most < 202.0 && low > 199.5 && high < 200.6, "{kind:?}: {most}, {low} to {high}");
}
