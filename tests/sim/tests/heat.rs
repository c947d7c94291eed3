//! The heaters on the chip: the converter, the pins, faults, and motion at the same time.

use kerf::boards::{Heater, Heaters, Pin, RAMPS14};
use kerf::heat::sensor::{Kind, share};
use kerf_sim::{Machine, by_name};

use crate::common::{firmware, printing};
use crate::plant::Plant;

/// The board's heaters.
fn heaters() -> Heaters {
    RAMPS14.heaters.expect("RAMPS has heaters")
}

/// Returns the pin that selects the hot end's MAX6675.
fn select() -> Pin {
    heaters().heaters[0].select.expect("RAMPS has a pin for it")
}

/// A printer on the chip.
struct Printer {
    machine: Machine,
    /// What the machine has sent without being asked.
    said: String,
    hot_end: Plant,
    bed: Plant,
    noise: u32,
    /// The voltage of the hot end's sensor if its wire is open or shorted; `None` for a sensor that works.
    broken: Option<u32>,
    /// Whether the hot end's sensor is a MAX6675.
    digital: bool,
}

impl Printer {
    fn new() -> Self {
        Self::at(22.0)
    }

    /// A printer whose hot end has this temperature.
    fn at(degrees: f64) -> Self {
        let (mut hot_end, bed) = (Plant::hot_end(), Plant::bed());
        (hot_end.block, hot_end.sensor) = (degrees, degrees);
        let mut machine = firmware(&RAMPS14);
        let [first, second] = heaters().heaters;
        for (heater, degrees) in [(first, degrees), (second, bed.sensor)] {
            let millivolts = share(Kind::Semitec, degrees) * 5_000.0;
            machine.set_millivolts(heater.channel, millivolts.round() as u32);
        }
        by_name::boot(&mut machine).unwrap();
        machine.build_max6675(select());
        let mut printer = Self {
            machine,
            said: String::new(),
            hot_end,
            bed,
            noise: 1,
            broken: None,
            digital: false,
        };
        printer.run(500, |_| {});
        printer
    }

    fn is_on(&self, heater: Heater) -> bool {
        self.machine.power_at(heater.pin) > 0.0
    }

    /// Returns the voltage of a sensor, with noise.
    fn millivolts(&mut self, degrees: f64) -> u32 {
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(self.noise >> 16) / 65_536.0 - 0.5;
        (share(Kind::Semitec, degrees) * 5_000.0 + noise * 8.0).round().clamp(0.0, 5_000.0) as u32
    }

    /// Runs for `ms` milliseconds, and calls `look` after each.
    fn run(&mut self, ms: u64, mut look: impl FnMut(&Self)) {
        let Heaters { heaters: [hot_end, bed], fan, .. } = heaters();
        for _ in 0..ms {
            let fan = self.machine.power_at(fan);
            self.hot_end.pass(0.001, self.machine.power_at(hot_end.pin), fan);
            self.bed.pass(0.001, self.machine.power_at(bed.pin), fan);
            let read = self.millivolts(self.hot_end.sensor);
            self.machine.set_millivolts(hot_end.channel, self.broken.unwrap_or(read));
            if let Some(chip) = self.machine.max6675(select()).filter(|_| self.digital) {
                chip.degrees = self.broken.is_none().then_some(self.hot_end.sensor);
            }
            let read = self.millivolts(self.bed.sensor);
            self.machine.set_millivolts(bed.channel, read);
            self.machine.run_for_ms(1).unwrap();
            self.said += &String::from_utf8_lossy(&self.machine.receive());
            look(self);
        }
    }

    /// Sends a line that must be carried out, or sets what `{he1k:6}` sets in TinyG's dialect.
    fn ask(&mut self, line: &str) {
        match line.starts_with('{') {
            true => printing::set(&mut self.machine, line),
            false => drop(printing::take(&mut self.machine, line)),
        }
    }

    /// Sends a line, and does not wait for its answer.
    fn send(&mut self, line: &str) {
        self.machine.send(format!("{line}\n").as_bytes());
    }

    /// Returns a number of M105: `T` and `B` are temperatures, `@` is the power of the hot end, 127 for full.
    fn value(&mut self, name: &str) -> f64 {
        let told = printing::take(&mut self.machine, "M105").pop().unwrap();
        let behind = told.split_once(&format!(" {name}:")).unwrap_or_else(|| panic!("{told}")).1;
        behind.split(' ').next().unwrap().parse().unwrap()
    }

    /// Whether steps came late.
    fn was_late(&self) -> bool {
        self.said.contains("steps came late")
    }

    /// Breaks the wire. Returns how long it takes until the hot end is off for good, ms.
    fn off_after(&mut self, millivolts: u32) -> u64 {
        self.broken = Some(millivolts);
        let (mut ms, mut off) = (0, None);
        let [hot_end, bed] = heaters().heaters;
        self.run(1_000, |printer| {
            ms += 1;
            match printer.is_on(hot_end) || printer.is_on(bed) {
                true => off = None,
                false => off = off.or(Some(ms)),
            }
        });
        off.expect("it goes off")
    }
}

#[test]
fn temperatures_are_those_of_the_sensors() {
    let mut printer = Printer::new();
    for (hot_end, bed) in [(22.0, 22.0), (60.0, 100.0), (200.0, 60.0), (250.0, 110.0)] {
        printer.hot_end.block = hot_end;
        printer.hot_end.sensor = hot_end;
        printer.bed.block = bed;
        printer.bed.sensor = bed;
        printer.run(450, |_| {});
        let (is, wanted) = (printer.value("T"), printer.hot_end.sensor);
        assert!((is - wanted).abs() < 1.0, "hot end {is}, not {wanted}");
        let (is, wanted) = (printer.value("B"), printer.bed.sensor);
        assert!((is - wanted).abs() < 1.0, "bed {is}, not {wanted}");
    }
}

#[test]
fn it_heats_to_200_degrees_and_keeps_to_them() {
    let mut printer = Printer::at(150.0);
    printer.ask("m104 s200");
    let mut most = 0f64;
    printer.run(60_000, |printer| most = most.max(printer.hot_end.sensor));
    let (mut low, mut high) = (1e9f64, 0f64);
    printer.run(20_000, |printer| {
        low = low.min(printer.hot_end.sensor);
        high = high.max(printer.hot_end.sensor);
    });
    println!("at most {most:.2}, then {low:.2} to {high:.2}");
    assert!(
        most < 202.0 && low > 199.5 && high < 200.5,
        "at most {most}, {low} to {high}: {}",
        printer.said
    );
}

#[test]
fn a_broken_wire_switches_off_in_100_ms() {
    for (millivolts, status) in [(5_000, "sensor open"), (0, "sensor shorted")] {
        let mut printer = Printer::new();
        printer.ask("m104 s200");
        printer.ask("m140 s60");
        printer.run(3_000, |_| {});
        let [hot_end, bed] = heaters().heaters;
        assert!(printer.is_on(hot_end) && printer.is_on(bed));
        let ms = printer.off_after(millivolts);
        println!("off after {ms} ms");
        assert!(ms <= 100, "off after {ms} ms");
        assert!(printer.said.contains(status), "{}", printer.said);
    }
}

#[test]
fn a_broken_wire_switches_off_in_100_ms_while_motors_move_fast() {
    let mut printer = Printer::new();
    for line in ["{xvm:30000}", "{xfr:30000}", "{xjm:5000000}"] {
        printer.ask(line);
    }
    printer.ask("m104 s200");
    printer.send("g1 x1000 y300 z20 f20000");
    printer.run(2_000, |_| {});
    let ms = printer.off_after(5_000);
    println!("off after {ms} ms while motors move");
    assert!(ms <= 100, "off after {ms} ms");
}

#[test]
fn a_reset_and_a_stuck_machine_leave_heaters_off() {
    let mut printer = Printer::new();
    printer.ask("m104 s200");
    printer.run(1_000, |_| {});
    let [hot_end, _] = heaters().heaters;
    assert!(printer.is_on(hot_end));
    // Thread mode gets no further turn, because no tick wakes it.
    printer.machine.withhold(21, true);
    let (mut ms, mut off) = (0, None);
    printer.run(1_200, |printer| {
        ms += 1;
        if !printer.is_on(hot_end) {
            off = off.or(Some(ms));
        }
    });
    assert!(off.is_some_and(|ms| ms < 700), "off after {off:?} ms");
    assert!(printer.machine.resets() >= 1);
}

#[test]
fn no_step_is_late_while_heaters_work() {
    let mut printer = Printer::new();
    for line in ["m104 s200", "m140 s60", "m106 s128"] {
        printer.ask(line);
    }
    printer.send("g1 x40 y30 f4000");
    printer.run(4_000, |_| {});
    assert!(!printer.was_late(), "{}", printer.said);
}

#[test]
fn cold_filament_is_not_moved() {
    let mut printer = Printer::new();
    let is_cold = |printer: &mut Printer, line: &str| {
        let said = printing::take(&mut printer.machine, line);
        said.iter().any(|line| line == "echo: cold extrusion prevented")
    };
    for line in ["G0 E1", "G1 E2 F100", "G1 X1 E3 F1000", "G2 X1 I1 J1 E4 F1000"] {
        assert!(is_cold(&mut printer, line), "{line}");
    }
    assert!(!is_cold(&mut printer, "G1 X1 F1000"));
    printer.ask("{he1mn:20}");
    assert!(!is_cold(&mut printer, "G1 X1 E5 F1000"));
    printer.ask("{he1mn:170}");
    assert!(is_cold(&mut printer, "G1 X1 E6 F1000"));
    // A board without a hot end moves filament.
    printer.ask("{he1k:0}");
    assert!(!is_cold(&mut printer, "G1 X1 E7 F1000"));
}

/// A MAX6675 takes 220 ms for a conversion and is read every 240 ms. No conversion is spoilt, and an open
/// thermocouple is noticed at the second reading.
#[test]
fn a_thermocouple_over_spi_is_read_and_its_break_is_seen() {
    let mut printer = Printer::new();
    printer.digital = true;
    printer.ask("{he1k:6}");
    for degrees in [22.0, 30.0, 38.0] {
        (printer.hot_end.block, printer.hot_end.sensor) = (degrees, degrees);
        printer.run(700, |_| {});
        let (is, wanted) = (printer.value("T"), printer.hot_end.sensor);
        assert!((is - wanted).abs() < 1.5, "{is}, not {wanted}");
    }
    let chip = printer.machine.max6675(select()).expect("it is there");
    assert!(chip.read >= 6 && chip.spoilt == 0, "{} read, {} spoilt", chip.read, chip.spoilt);
    for line in ["{xvm:30000}", "{xfr:30000}", "m104 s200"] {
        printer.ask(line);
    }
    printer.send("g1 x1000 y300 f20000");
    printer.run(2_000, |_| {});
    assert!(printer.is_on(heaters().heaters[0]), "{}", printer.said);
    let ms = printer.off_after(5_000);
    println!("off after {ms} ms");
    assert!(ms <= 500, "off after {ms} ms");
    assert!(printer.said.contains("sensor open"), "{}", printer.said);
    assert!(!printer.was_late(), "{}", printer.said);
}

/// Without a chip the line is high.
#[test]
fn a_missing_thermocouple_does_not_heat() {
    let mut printer = Printer::new();
    printer.ask("{he1k:6}");
    printer.machine.max6675(select()).expect("it is there").unplug();
    printer.run(500, |_| {});
    printer.ask("m104 s200");
    printer.run(500, |_| {});
    assert!(!printer.is_on(heaters().heaters[0]));
    assert!(printer.said.contains("sensor open"), "{}", printer.said);
}

/// Timer 2 makes the pulses of the hot end and the fan. The bits of their ports stay low, so that the pins are low
/// when the timer has released them.
#[test]
fn power_is_pulses_of_a_timer_and_off_lets_go_of_the_pin() {
    let mut printer = Printer::at(60.0);
    let Heaters { heaters: [hot_end, bed], fan, .. } = heaters();
    let connected = |printer: &Printer| printer.machine.peek(0xB0) & 0xF0;
    assert_eq!(connected(&printer), 0);
    for line in ["m104 s65", "m140 s60", "m106 s64"] {
        printer.ask(line);
    }
    printer.run(50, |_| {});
    // The fan gets full power at first, so that it begins to turn.
    assert_eq!(printer.machine.power_at(fan), 1.0, "{}", printer.said);
    printer.run(30_000, |printer| {
        assert!(!printer.machine.is_high(hot_end.pin) && !printer.machine.is_high(fan));
    });
    assert!((printer.machine.power_at(fan) - 64.0 / 255.0).abs() < 1e-9);
    let (mut low, mut high) = (1f64, 0f64);
    printer.run(2_000, |printer| {
        let power = printer.machine.power_at(hot_end.pin);
        (low, high) = (low.min(power), high.max(power));
    });
    assert!(low > 0.0 && high < 1.0, "{low} to {high}");
    let told = printer.value("@") / 127.0;
    assert!((told - printer.machine.power_at(hot_end.pin)).abs() < 0.05, "{told}");
    assert_eq!(printer.machine.power_at(bed.pin), 1.0);
    for line in ["m104 s0", "m107", "m140 s0"] {
        printer.ask(line);
    }
    printer.run(100, |_| {});
    assert_eq!(connected(&printer), 0);
    assert!(!printer.is_on(hot_end) && !printer.is_on(bed));
}

/// A fault, an alarm and anything that makes the machine safe releases the pins.
#[test]
fn every_way_off_lets_go_of_the_pins() {
    type Way = (&'static str, fn(&mut Printer));
    let ways: [Way; 4] = [
        ("a sensor", |printer| printer.broken = Some(5_000)),
        ("an alarm", |printer| printer.send("M112")),
        ("the end of the program", |printer| printer.send("m2")),
        ("the watchdog", |printer| printer.machine.withhold(21, true)),
    ];
    for (name, way) in ways {
        let mut printer = Printer::new();
        for line in ["m104 s200", "m106 s128", "m140 s60"] {
            printer.ask(line);
        }
        printer.run(500, |_| {});
        let [hot_end, bed] = heaters().heaters;
        assert!(printer.is_on(hot_end) && printer.is_on(bed), "{name}");
        way(&mut printer);
        let (mut ms, mut off) = (0u64, None);
        printer.run(900, |printer| {
            ms += 1;
            let pins = [hot_end.pin, bed.pin, heaters().fan];
            let connected = printer.machine.peek(0xB0) & 0xF0 != 0;
            match connected || pins.iter().any(|pin| printer.machine.power_at(*pin) > 0.0) {
                true => off = None,
                false => off = off.or(Some(ms)),
            }
        });
        println!("{name}: off after {off:?} ms");
        let most = if name == "the watchdog" { 700 } else { 100 };
        assert!(off.is_some_and(|ms| ms <= most), "{name}: off after {off:?} ms");
    }
}

/// What is wrong with a hot end.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Defect {
    /// The sensor has fallen out and reads 28 degrees.
    Loose,
    /// The heater gets no current.
    Dead,
    /// The transistor stays on.
    Stuck,
}

/// A host changes the target again and again: the fault comes within the time that a constant target gives. Lines of a
/// printing host, on its own image.
#[test]
fn no_change_of_target_hides_a_fault() {
    let rises: &[(&str, u64)] = &[("M104 S200", 9_000), ("M104 S201", 9_000)];
    let falls: &[(&str, u64)] = &[("M104 S200", 8_000), ("M104 S0", 500)];
    let around: &[(&str, u64)] = &[("M104 S200", 9_000), ("M104 S30", 1_000)];
    let off: &[(&str, u64)] = &[("M104 S0", 8_000), ("M104 S160", 500)];
    for (defect, at, targets, seconds, text) in [
        (Defect::Loose, 200.0, rises, 25, "heater does not heat"),
        (Defect::Loose, 200.0, falls, 30, "heater does not heat"),
        (Defect::Loose, 200.0, around, 30, "heater does not heat"),
        (Defect::Dead, 28.0, falls, 30, "heater does not heat"),
        (Defect::Stuck, 120.0, off, 25, "heater out of control"),
    ] {
        let mut machine = printing::booted(&RAMPS14);
        let Heaters { heaters: [hot_end, bed], .. } = RAMPS14.heaters.expect("it has heaters");
        let mut plant = Plant::hot_end();
        (plant.block, plant.sensor) = (at, at);
        let millivolts = |degrees| (share(Kind::Semitec, degrees) * 5_000.0).round() as u32;
        machine.set_millivolts(bed.channel, millivolts(22.0));
        let (mut turns, mut left) = (targets.iter().cycle(), 1_000);
        let (mut said, mut told, mut most) = (String::new(), None, at);
        for ms in 0..seconds * 1_000 + 1_000 {
            if left == 0 {
                let (line, lasts) = turns.next().expect("it is endless");
                machine.send(format!("{line}\n").as_bytes());
                left = *lasts;
            }
            left -= 1;
            let power = match defect {
                Defect::Loose => machine.power_at(hot_end.pin),
                Defect::Dead => 0.0,
                Defect::Stuck => 1.0,
            };
            plant.pass(0.001, power, 0.0);
            most = most.max(plant.block);
            let reads = if defect == Defect::Loose { 28.0 } else { plant.sensor };
            machine.set_millivolts(hot_end.channel, millivolts(reads));
            machine.run_for_ms(1).unwrap();
            said += &String::from_utf8_lossy(&machine.receive());
            if said.contains(text) {
                told = told.or(Some(ms));
            }
            if told.is_some_and(|told| ms > told + 200) {
                assert_eq!(machine.power_at(hot_end.pin), 0.0, "{defect:?}, {targets:?}");
                break;
            }
        }
        println!("{defect:?}, {targets:?}: after {told:?} ms, at most {most:.0}");
        assert!(told.is_some(), "{defect:?}, {targets:?}: block {most:.0}, {said}");
        assert!(most < 290.0, "{defect:?}, {targets:?}: {most:.0}");
    }
}
