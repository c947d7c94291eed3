//! Prints from an SD card on the chip: files on a card that another program has formatted, steps at the pins, faults
//! of the card.

use fatfs::FatType;
use kerf::boards::RAMPS14;
use kerf_sim::Machine;

use crate::common::{firmware, printing};
use kerf_sim::sd_image::{BLOCK, FIRST, image, names};

struct Printer {
    machine: Machine,
    said: String,
}

impl Printer {
    fn new(fat: FatType, is_high: bool, files: &[(&str, String)]) -> Self {
        let mut machine = firmware(&RAMPS14);
        machine.insert_card(image(fat, files), is_high);
        Self::started(machine)
    }

    fn started(machine: Machine) -> Self {
        let mut printer = Self { machine, said: String::new() };
        printer.run(1_000);
        printer
    }

    fn run(&mut self, ms: u64) {
        self.machine.run_for_ms(ms).unwrap();
        self.said += &String::from_utf8(self.machine.receive()).unwrap();
    }

    fn until(&mut self, text: &str, ms: u64) -> u64 {
        for n in 0..ms {
            if self.said.contains(text) {
                return n;
            }
            self.run(1);
        }
        panic!("no {text:?} in {ms} ms: {:?}", self.said);
    }

    /// Sends a line and waits for `ok`. Returns the lines before that.
    fn ask(&mut self, line: &str) -> String {
        self.said.clear();
        self.machine.send(line.as_bytes());
        self.machine.send(b"\n");
        self.until("ok", 5_000);
        // Time for the rest of the line that begins with `ok`.
        self.run(2);
        let said = std::mem::take(&mut self.said);
        said.trim_end().trim_end_matches("ok").to_owned()
    }

    fn begin(&mut self, name: &str) {
        for (line, answer) in [("M21", "echo:SD card ok\n"), ("M302 P1", "")] {
            assert_eq!(self.ask(line), answer, "{line}");
        }
        let opened = self.ask(&format!("M23 {name}"));
        assert!(opened.ends_with("File selected\n"), "{opened}");
    }

    fn steps(&self) -> [i64; 4] {
        self.machine.recorder().motors().each_ref().map(|motor| motor.position)
    }
}

/// A zigzag of `moves` moves of 0.2 mm, with E and comments.
fn zigzag(moves: usize) -> String {
    let mut text = String::from("; a slicer's\nG90\nM83\nG92 X0 Y0 E0\nG1 F3600\n");
    for n in 1..=moves {
        let (x, y) = (n as f64 * 0.2, (n / 50 % 2) as f64);
        text += &format!("G1 X{x:.3} Y{y:.3} E0.01000 ; {n}\r\n");
    }
    text + "M73 P100\nG4 P10\n"
}

#[test]
fn a_card_is_listed_printed_and_told() {
    for (fat, is_high) in [(FatType::Fat16, false), (FatType::Fat32, true)] {
        let moves = 300;
        let files = [("RING.GCO", zigzag(moves)), ("a long name.gcode", "G4 P1\n".into())];
        let mut printer = Printer::new(fat, is_high, &files);
        assert!(printer.ask("M20").contains("SD card cannot be read"), "M21 comes first");
        assert_eq!(printer.ask("M27"), "Not SD printing\n");
        printer.begin("ring.gco");
        let list = printer.ask("M20");
        let size = files[0].1.len();
        assert_eq!(
            list,
            format!("Begin file list\nRING.GCO {size}\nALONGN~1.GCO 6\nEnd file list\n")
        );
        assert_eq!(printer.ask("M27"), "Not SD printing\n");
        assert_eq!(printer.ask("M24"), "");
        let told = printer.ask("M27");
        assert!(
            told.starts_with("SD printing byte ") && told.ends_with(&format!("/{size}\n")),
            "{told}"
        );
        let ms = printer.until("Done printing file\n", 60_000);
        assert!(printer.said.contains("echo:Unknown command: \"M73 P100\"\n"), "{}", printer.said);
        assert!(!printer.said.contains("ok"), "{}", printer.said);
        println!("{fat:?}: {moves} moves in {ms} ms");
        let place = printer.ask("M114");
        assert!(place.contains("X:60.000 Y:0.000") && place.contains("E:3.00"), "{place}");
        assert_eq!(printer.ask("M27"), "Not SD printing\n");
        assert!(printer.ask("M23 none.gco").contains("open failed, File: none.gco."));
        assert_eq!(printer.ask("M30 /ALONGN~1.GCO"), "File deleted:ALONGN~1.GCO\n");
        let names = names(printer.machine.card().unwrap().image());
        assert!(!names.contains(&"a long name.gcode".to_owned()), "{names:?}");
        assert!(printer.ask("M22").is_empty());
    }
}

/// Moves of 0.2 mm with E along a circle of 40 mm, at 60 mm/s.
fn circle(moves: usize) -> String {
    let mut text = String::from("G90\nM83\nG92 X40 Y0 E0\nG1 F3600\n");
    for n in 1..=moves {
        let (y, x) = (n as f64 * 0.2 / 40.0).sin_cos();
        text += &format!("G1 X{:.3} Y{:.3} E0.00900\n", x * 40.0, y * 40.0);
    }
    text
}

/// Returns what is in EEPROM after these settings.
fn settings(lines: &[&str]) -> [u8; 4096] {
    let mut machine = printing::booted(&RAMPS14);
    lines.iter().for_each(|line| printing::set(&mut machine, line));
    *machine.eeprom()
}

/// Returns how long a file takes from a host that has four lines in flight, s.
fn over_the_wire(kept: &[u8; 4096], text: &str) -> f64 {
    let mut machine = firmware(&RAMPS14);
    machine.set_eeprom(kept);
    let mut printer = Printer::started(machine);
    printer.ask("M302 P1");
    printer.said.clear();
    for (sent, line) in text.lines().enumerate() {
        while sent - printer.said.matches("ok").count() >= 4 {
            printer.run(1);
        }
        printer.machine.send(format!("{line}\n").as_bytes());
    }
    printer.run(2_000);
    let ((first, _), (last, _)) = printer.machine.recorder().span().unwrap();
    printer.machine.seconds(last - first)
}

/// A print from a card is as fast as a print from a host at 115,200 baud, unless the card is slow. A host that asks
/// for temperatures is answered.
#[test]
fn a_print_from_a_card_is_as_fast_as_the_planner() {
    let kept = settings(&[
        "{mch:3}",
        "{xjm:100000}",
        "{yjm:100000}",
        "{zjm:100000}",
        "{ajm:100000}",
        "{he1k:6}",
    ]);
    let moves = 1_000;
    let wire = over_the_wire(&kept, &circle(moves));
    println!("over the wire {wire:.2} s");
    for (access_us, most) in [(100, 1.05), (2_000, 1.05), (20_000, 1.6), (90_000, 3.5)] {
        let mut machine = firmware(&RAMPS14);
        machine.set_eeprom(&kept);
        machine.insert_card(image(FatType::Fat16, &[("A.G", circle(moves))]), true);
        let select = RAMPS14.heaters.unwrap().heaters[0].select.unwrap();
        machine.build_max6675(select);
        let mut printer = Printer::started(machine);
        let settings = printer.ask("M503");
        assert!(settings.contains("M92 X80.000 Y80.000"), "{settings}");
        printer.begin("A.G");
        printer.ask("M104 S30");
        printer.machine.card().unwrap().access_us = access_us;
        printer.ask("M24");
        let mut slowest = 0;
        for _ in 0..20 {
            printer.run(50);
            printer.said.clear();
            printer.machine.send(b"M105\n");
            slowest = slowest.max(printer.until("ok T:", 1_000));
        }
        printer.until("Done printing file\n", 60_000);
        let ((first, _), (last, _)) = printer.machine.recorder().span().unwrap();
        let seconds = printer.machine.seconds(last - first);
        let ratio = seconds / wire;
        println!("{access_us} us: {seconds:.2} s, {ratio:.3} of the wire; M105 after {slowest} ms");
        assert!(slowest <= 20, "M105 is answered after {slowest} ms");
        assert!(ratio < most, "{access_us} us: {seconds:.2} s, {ratio:.3}");
        assert!(
            !printer.said.contains("Error") && !printer.said.contains("late"),
            "{}",
            printer.said
        );
        let chip = printer.machine.max6675(select).unwrap();
        // The first conversion is read before the chip has been on for long enough.
        assert!(chip.read > 10 && chip.spoilt <= 1, "{} read, {} spoilt", chip.read, chip.spoilt);
        let place = printer.ask("M114");
        let x = 40.0 * (moves as f64 * 0.2 / 40.0).cos();
        assert!(place.contains(&format!("X:{x:.3} ")) && place.contains("E:9.00"), "{place}");
    }
}

#[test]
fn a_pause_a_flush_and_a_card_that_is_pulled_end_it() {
    let mut printer = Printer::new(FatType::Fat16, true, &[("A.G", zigzag(1_000))]);
    printer.begin("A.G");
    printer.ask("M24");
    printer.run(500);
    printer.ask("M25");
    printer.run(2_000);
    let (paused, at) = (printer.steps(), printer.ask("M27"));
    printer.run(1_000);
    assert_eq!((printer.steps(), printer.ask("M27")), (paused, at));
    for line in ["M20", "M24"] {
        assert!(!printer.ask(line).contains("Error"), "{line}");
    }
    for line in ["M20", "M21", "M22", "M23 A.G", "M30 A.G"] {
        assert!(printer.ask(line).contains("echo:not possible now"), "{line}");
    }
    printer.run(300);
    assert_ne!(printer.steps(), paused);
    // Lines of the host come between.
    printer.ask("M117 hello");
    printer.ask("M112");
    printer.run(500);
    let stopped = printer.steps();
    printer.ask("M999");
    printer.run(500);
    assert_eq!(printer.steps(), stopped);
    // The print begins again from the start, and the card is pulled.
    printer.begin("A.G");
    printer.ask("M24");
    printer.run(500);
    printer.machine.card().unwrap().is_there = false;
    printer.until("Error:SD card cannot be read\n", 2_000);
    assert!(printer.ask("M21").contains("cannot be read"));
    printer.machine.card().unwrap().is_there = true;
    printer.begin("A.G");
    assert!(printer.ask("M24").is_empty());
    printer.until("Done printing file\n", 60_000);
}

#[test]
fn a_print_begins_at_a_byte_of_the_file_or_at_once() {
    let text = format!("G91\nG1 F3000\n{}", "G1 X1\n".repeat(10));
    let at = text.len() - 3 * 6;
    let mut printer = Printer::new(FatType::Fat16, true, &[("A.G", text)]);
    printer.begin("A.G");
    for line in ["G91", "G1 F3000"] {
        assert_eq!(printer.ask(line), "", "{line}");
    }
    assert_eq!(printer.ask(&format!("M26 S{at}")), "");
    assert_eq!(printer.ask("M27"), "Not SD printing\n");
    printer.ask("M24");
    printer.until("Done printing file\n", 5_000);
    let place = printer.ask("M114");
    assert!(place.contains("X:3.000"), "{place}");
    let opened = printer.ask("M32 A.G");
    assert!(opened.contains("File selected\n"), "{opened}");
    printer.until("Done printing file\n", 10_000);
    let place = printer.ask("M114");
    assert!(place.contains("X:13.000"), "{place}");
}

/// Lines that a host sends during a print have their turn, even those that are answered at rest: the print waits for
/// them.
#[test]
fn a_host_waits_for_rest_while_a_card_prints() {
    let mut printer = Printer::new(FatType::Fat16, true, &[("A.GCO", zigzag(3_000))]);
    printer.begin("A.GCO");
    printer.ask("M24");
    for line in ["M400", "M109 S0", "G4 P10", "M84"] {
        printer.run(500);
        printer.ask(line);
        assert!(printer.ask("M27").contains("SD printing byte"), "{line}");
    }
    // A paused print is not reported as a print, because OctoPrint would take it for one that was started at the
    // printer.
    printer.ask("M25");
    printer.ask("M400");
    assert_eq!(printer.ask("M27"), "Not SD printing\n");
    printer.ask("M24");
    assert!(printer.ask("M27").contains("SD printing byte"));
}

/// Lines are longer than a read, and blocks must be waited for, so that pauses come in the middle of many lines.
#[test]
fn a_pause_within_a_line_loses_none_of_it() {
    let line = format!("G1 X0.1 Y0.1 F3600 ; {}\r\n", "long ".repeat(30));
    let mut printer =
        Printer::new(FatType::Fat16, true, &[("A.G", format!("G91\n{}", line.repeat(120)))]);
    printer.begin("A.G");
    printer.machine.card().unwrap().access_us = 20_000;
    let mut pauses = 0;
    while printer.ask("M24").is_empty() {
        printer.run(11);
        printer.ask("M25");
        pauses += 1;
    }
    let place = printer.ask("M114");
    assert!(place.contains("X:12.000 Y:12.000"), "{pauses} pauses: {place}");
}

/// A boot sector that says 0 blocks per cluster, a file name, and a directory that has no end: each is answered, and
/// so are the host's questions and its stop.
#[test]
fn a_damaged_card_is_refused_and_the_machine_goes_on() {
    let mut image = image(FatType::Fat16, &[("A.G", zigzag(3))]);
    image[FIRST * BLOCK + 13] = 0;
    let mut machine = firmware(&RAMPS14);
    machine.insert_card(image, true);
    let mut printer = Printer::started(machine);
    for line in ["M21", "M20", "M23 A.G", "M21"] {
        let said = printer.ask(line);
        assert!(said.contains("echo:SD card cannot be read"), "{line}: {said}");
    }
    let said = printer.ask("M24");
    assert!(said.contains("echo:no file selected; M23"), "{said}");
    printer.ask("M105");
    let said = printer.ask("M112");
    assert!(said.contains("Error:stopped"), "{said}");
}

/// A file longer than 64 KiB is printed to its end.
#[test]
fn a_file_of_more_than_64_kib_is_printed_to_its_end() {
    let comments = format!(";{}\n", "-".repeat(198)).repeat(2 * 65_536 / 200);
    let text = format!("G91\nG1 X1 F3000\n{comments}G1 X1\n{}G1 X1\n", ";\n".repeat(50));
    let mut printer = Printer::new(FatType::Fat32, true, &[("A.G", text)]);
    printer.begin("A.G");
    printer.ask("M24");
    printer.until("Done printing file\n", 60_000);
    let place = printer.ask("M114");
    assert!(place.contains("X:3.000"), "{place}");
}
