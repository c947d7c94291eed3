//! SD cards that hold anything: damaged partitions, boot sectors, tables and directories. Each command is answered
//! within bounded work, and the machine goes on.

use std::thread;

use kerf::hal::imp::{Machine, card::Blocks};
use kerf::heat::sensor::{Kind, reading};

use crate::seeds::seeds;

/// Where the partition begins, and the first cluster of the file `A.G`.
const FIRST: u32 = 63;
const FILE: u32 = 3;
/// The cluster of the file `B.G`.
const OTHER: u32 = 2_000;
/// The most blocks that a command may read: a list has 254 files, and a directory 128 blocks.
const READS: u32 = 255 * 130;

/// A card with a partition that has two files.
struct Card {
    blocks: Blocks,
    is_32: bool,
    /// The first block of the table, and that of the root directory.
    table: u32,
    root: u32,
    seed: u64,
}

impl Card {
    fn new(is_32: bool, seed: u64) -> Self {
        let moves = "G1 X0.01 F600 ; a slicer's comment, which is long\n".repeat(40);
        Self::with(is_32, seed, &format!("G91\n{moves}"))
    }

    /// Returns a card whose file `A.G` has this text.
    fn with(is_32: bool, seed: u64, text: &str) -> Self {
        let (kind, reserved, entries, in_all, tables) =
            if is_32 { (0x0C, 32, 0, 80_000, 620) } else { (0x06, 1, 64, 20_000, 79) };
        let table = FIRST + reserved;
        let root = table + 2 * tables;
        let mut card = Self { blocks: Blocks::new(), is_32, table, root, seed };
        card.put(0, 446, &[0, 0, 0, 0, kind]);
        card.put(0, 454, &FIRST.to_le_bytes());
        card.put(0, 458, &u32::to_le_bytes(in_all));
        card.put(0, 510, &[0x55, 0xAA]);
        card.put(FIRST, 11, &[0, 2, 1, reserved as u8, 0, 2, entries, 0]);
        card.put(
            FIRST,
            if is_32 { 32 } else { 19 },
            &in_all.to_le_bytes()[..if is_32 { 4 } else { 2 }],
        );
        card.put(
            FIRST,
            if is_32 { 36 } else { 22 },
            &tables.to_le_bytes()[..if is_32 { 4 } else { 2 }],
        );
        if is_32 {
            card.put(FIRST, 44, &2u32.to_le_bytes());
            card.link(2, u32::MAX);
        }
        card.put(FIRST, 510, &[0x55, 0xAA]);
        card.file(0, b"A       G  ", 0x20, FILE, text.len() as u32);
        card.file(1, b"FOLDER     ", 0x10, 20, 0);
        card.file(2, b"B       G  ", 0x20, OTHER, 5);
        for (n, part) in (0..).zip(text.as_bytes().chunks(512)) {
            card.put(card.data(FILE + n), 0, part);
            let is_last = (n as usize + 1) * 512 >= text.len();
            card.link(FILE + n, if is_last { u32::MAX } else { FILE + n + 1 });
        }
        card.link(OTHER, u32::MAX);
        card
    }

    fn random(&mut self, below: u64) -> u64 {
        self.seed = self
            .seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.seed >> 33) % below
    }

    /// Returns a number that is often an extreme one.
    fn number(&mut self) -> u32 {
        let extremes = [
            0,
            1,
            2,
            3,
            0x7F,
            0x80,
            0xFF,
            0x100,
            0xFFF7,
            0xFFFF,
            0x0FFF_FFF7,
            1 << 30,
            1 << 31,
            u32::MAX,
        ];
        let at = self.random(2 * extremes.len() as u64) as usize;
        extremes.get(at).copied().unwrap_or_else(|| self.random(1 << 31) as u32)
    }

    fn put(&mut self, block: u32, at: usize, bytes: &[u8]) {
        let contents = self.blocks.entry(block).or_insert([0; 512]);
        contents[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// Returns the block of a cluster.
    fn data(&self, cluster: u32) -> u32 {
        self.root + cluster - 2 + if self.is_32 { 0 } else { 4 }
    }

    fn link(&mut self, cluster: u32, to: u32) {
        let size = if self.is_32 { 4 } else { 2 };
        let at = cluster as usize * size;
        self.put(self.table + (at / 512) as u32, at % 512, &to.to_le_bytes()[..size]);
    }

    fn file(&mut self, n: usize, name: &[u8; 11], attributes: u8, cluster: u32, size: u32) {
        let (block, at) = (self.root + (n / 16) as u32, n % 16 * 32);
        self.put(block, at, name);
        self.put(block, at + 11, &[attributes]);
        self.put(block, at + 20, &cluster.to_le_bytes()[2..]);
        self.put(block, at + 26, &cluster.to_le_bytes()[..2]);
        self.put(block, at + 28, &size.to_le_bytes());
    }

    /// Damages one part of the card.
    fn damage(&mut self) {
        let number = self.number();
        let place = self.random(4);
        match self.random(9) {
            0 => {
                let at = 446 + self.random(66) as usize;
                self.put(0, at, &[number as u8]);
            }
            1 | 2 => {
                let at = 11 + self.random(53) as usize;
                self.put(FIRST, at, &[number as u8]);
            }
            3 => {
                let at = [19, 22, 32, 36][place as usize];
                self.put(FIRST, at, &number.to_le_bytes());
                self.put(0, 454 + (place as usize & 1) * 4, &number.to_le_bytes());
            }
            4 => {
                let cluster = 2 + self.random(12) as u32;
                let to = if place == 0 { cluster } else { number };
                self.link(cluster, to);
                self.link(cluster + 1, cluster);
            }
            5 => {
                let attributes = self.random(256) as u8;
                self.file(0, b"A       G  ", attributes & 0xEF, number, u32::MAX >> (8 * place));
            }
            6 => {
                let name = core::array::from_fn(|_| self.random(256) as u8);
                self.file(place as usize, &name, number as u8, number, number);
            }
            // A directory without an end: of files, of deleted ones, of hidden ones, of names' parts.
            7 => {
                let (first, attributes) =
                    [(b'A', 0x20), (0xE5, 0x20), (b'A', 0x02), (b'A', 0x0F)][place as usize];
                for n in 0..64 {
                    self.file(n, &[first; 11], attributes, number, number);
                }
                self.link(2, 2);
                self.put(FIRST, 13, &[4]);
                self.put(FIRST, if self.is_32 { 17 } else { 18 }, &[0xFF]);
            }
            _ => {
                let block = [0, FIRST, self.table, self.root][place as usize];
                let noise: [u8; 510] = core::array::from_fn(|_| self.random(256) as u8);
                self.put(block, 0, &noise);
            }
        }
    }
}

struct Printer {
    machine: Machine,
}

impl Printer {
    /// Sends a line and returns what is heard up to `ok`.
    fn ask(&mut self, line: &str, seed: u64) -> String {
        let reads = self.machine.card_reads();
        self.machine.send(format!("{line}\n").as_bytes());
        let mut heard = String::new();
        for _ in 0..3_000 {
            self.machine.run_ms(1);
            heard += &String::from_utf8_lossy(&self.machine.received());
            if heard.ends_with('\n') && heard.lines().any(|line| line.starts_with("ok")) {
                let reads = self.machine.card_reads() - reads;
                assert!(reads <= READS, "seed {seed}: {line} reads {reads} blocks");
                return heard;
            }
        }
        panic!("seed {seed}: no answer to {line}, but {heard:?}");
    }

    /// Pauses the print. Without a file, because it could not be read, this pauses the program.
    fn pause(&mut self, seed: u64) {
        self.ask("M25", seed);
        self.machine.run_ms(500);
        self.ask("M108", seed);
    }

    /// Prints from a card, and does all that a host may ask of it.
    fn use_card(&mut self, card: Card, seed: u64) -> [bool; 2] {
        self.machine.insert_card(Some(card.blocks));
        let mounts = self.ask("M21", seed).contains("echo:SD card ok");
        for line in ["M20", "M27"] {
            self.ask(line, seed);
        }
        let mut prints = false;
        for select in ["M23 A.G", "M32 A.G"] {
            let selects = self.ask(select, seed).contains("File selected");
            prints |= selects;
            for line in ["M24", "M27", "M105"] {
                self.ask(line, seed);
            }
            self.machine.run_ms(20);
            if selects {
                self.pause(seed);
                for line in ["M26 S1500", "M24", "M105"] {
                    self.ask(line, seed);
                }
                self.pause(seed);
            }
        }
        for line in ["M30 B.G", "M30 A.G", "M20", "M22", "M20", "M105"] {
            self.ask(line, seed);
        }
        assert!(self.ask("M112", seed).contains("Error:stopped"), "seed {seed}");
        assert!(self.ask("M999", seed).ends_with("ok\n"), "seed {seed}");
        [mounts, prints]
    }

    fn boot() -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        machine.run_ms(100);
        machine.received();
        let mut printer = Self { machine };
        printer.ask("M105", 0);
        printer.ask("M302 P1", 0);
        printer
    }
}

#[test]
fn a_sound_card_is_listed_printed_and_changed() {
    let mut printer = Printer::boot();
    for is_32 in [false, true] {
        printer.machine.insert_card(Some(Card::new(is_32, 0).blocks));
        for (line, answer) in [
            ("M21", "echo:SD card ok\nok\n"),
            ("M20", "Begin file list\nA.G 2004\nB.G 5\nEnd file list\nok\n"),
            ("M23 /a.g", "File opened: a.g Size: 2004\nFile selected\nok\n"),
            ("M30 A.G", "echo:not possible now\nok\n"),
            ("M30 folder", "Deletion failed, File: folder.\nok\n"),
            ("M30 B.G", "File deleted:B.G\nok\n"),
            ("M20", "Begin file list\nA.G 2004\nEnd file list\nok\n"),
            ("G92 X0", "ok\n"),
            ("M24", "ok\n"),
        ] {
            assert_eq!(printer.ask(line, 0), answer, "{line}");
        }
        printer.machine.run_ms(10_000);
        assert_eq!(printer.machine.received(), b"Done printing file\n");
        let place = printer.ask("M114", 0);
        assert!(place.contains("X:0.400 "), "{place}");
    }
}

impl Printer {
    /// Puts a card into the slot whose file has this text, and begins to print it.
    fn print(&mut self, text: &str) {
        self.machine.insert_card(Some(Card::with(false, 0, text).blocks));
        for line in ["M21", "M23 A.G"] {
            assert!(self.ask(line, 0).ends_with("ok\n"), "{line}");
        }
        self.machine.send(b"M24\n");
    }

    /// Returns what is heard until nothing comes for some time.
    fn hear(&mut self) -> String {
        let (mut heard, mut silent) = (String::new(), 0);
        while silent < 30_000 {
            self.machine.run_ms(10);
            let more = String::from_utf8_lossy(&self.machine.received()).into_owned();
            silent = if more.is_empty() { silent + 10 } else { 0 };
            heard += &more;
        }
        heard
    }
}

/// What only the answer to a line of the host may begin with.
const ANSWERS: [&str; 5] = ["ok", "Resend", "rs", "start", "wait"];

/// A line number of a file on the card has no effect on the line numbers of the host.
#[test]
fn a_file_answers_nothing() {
    let mut printer = Printer::boot();
    let sum = |text: &str| {
        let sum = text.bytes().fold(0, |sum, byte| sum ^ byte);
        format!("{text}*{sum}\n")
    };
    let mut text = String::from("G91\n\n");
    for number in (0..1_000)
        .filter(|number| !matches!(number, 0..=32 | 60 | 112 | 226 | 303 | 502 | 600 | 601))
    {
        text += &format!("M{number}\n");
    }
    for line in [
        "M20",
        "M21",
        "M23 B.G",
        "M27",
        "M110 N5",
        "M105",
        "M114",
        "M118 ok",
        "M118 E1 ok",
        "M118 A1 x",
    ] {
        text += &format!("{line}\n{}", sum(&format!("N7 {line}")));
    }
    for line in [
        "M118 Resend: 5",
        "T0",
        "T1",
        "$xvm",
        "$$",
        "G28 X",
        "G29",
        "G4 P1",
        "G1 X1.2.3",
        "M105 ; a*5",
    ] {
        text += &format!("{line}\n{}", sum(&format!("N9 {line}")));
    }
    text += "G92 X0\n";
    // One step of 0.1 mm each: lines with a number, in no order, with a right checksum or none.
    for number in [5, 3, 8, 9, 9, 0] {
        text += &sum(&format!("N{number} G1 X0.1 F6000"));
        text += &format!("N{number} G1 X0.1\n");
    }
    // Damaged lines are not carried out.
    text += "N3 G1 X10*55\nN4 G1 X10*5N5 G1 X10*7\nN3 M105*1\nG1 X0.1\n";
    printer.ask("G92 X0", 0);
    printer.print(&text);
    let heard = printer.hear();
    // That of M24.
    let heard = heard.replacen("ok\n", "", 1);
    for line in heard.lines() {
        assert!(!ANSWERS.iter().any(|answer| line.starts_with(answer)), "{line} in {heard}");
        assert!(line != "Error:", "{heard}");
    }
    assert!(heard.contains("echo:ok\n") && heard.contains("echo:Resend: 5\n"), "{heard}");
    assert!(heard.contains("\n T:") && heard.contains("X:0.000 Y:0.000"), "{heard}");
    assert_eq!(heard.matches("Error:checksum mismatch\n").count(), 3, "{heard}");
    assert!(heard.ends_with("Done printing file\n"), "{heard}");
    let place = printer.ask("M114", 0);
    assert!(place.contains("X:1.300 "), "{place}");
}

/// A host presses pause while the file heats.
#[test]
fn a_file_is_paused_while_it_heats() {
    for pause in ["M25", "N1 M25*21"] {
        thread::spawn(|| pause_while_heating(pause)).join().unwrap();
    }
}

fn pause_while_heating(pause: &str) {
    let mut printer = Printer::boot();
    printer.machine.set_sensor(0, reading(Kind::Semitec, 25.0) as u16);
    printer.machine.run_ms(1_000);
    printer.ask("M110 N0", 0);
    printer.print("M109 S50\nG1 X10 F6000\n");
    printer.machine.run_ms(1_000);
    printer.machine.received();
    printer.machine.send(format!("{pause}\n").as_bytes());
    printer.machine.run_ms(100);
    assert_eq!(printer.machine.received(), b"//action:paused\nok\n", "{pause}");
    printer.machine.set_sensor(0, reading(Kind::Semitec, 50.0) as u16);
    printer.machine.run_ms(10_000);
    let place = printer.ask("M114", 0);
    assert!(place.contains("X:0.000 "), "{place}");
    assert_eq!(printer.ask("M24", 0), "ok\n");
    printer.machine.run_ms(3_000);
    let place = printer.ask("M114", 0);
    assert!(place.contains("X:10.000 "), "{place}");
}

/// What is missing is named: a file, the selection of one, or the card.
#[test]
fn what_is_missing_is_named() {
    let mut printer = Printer::boot();
    printer.machine.insert_card(None);
    for line in ["M21", "M20", "M23 A.G", "M32 A.G", "M30 A.G"] {
        assert_eq!(printer.ask(line, 0), "echo:SD card cannot be read\nok\n", "{line}");
    }
    let none = "echo:no file selected; M23\nok\n";
    assert_eq!(printer.ask("M24", 0), none);
    assert_eq!(printer.ask("M26 S1", 0), none);
    printer.machine.insert_card(Some(Card::new(false, 0).blocks));
    for (line, answer) in [
        ("M21", "echo:SD card ok\nok\n"),
        ("M24", none),
        ("M26 S1", none),
        ("M23 NIX.G", "open failed, File: NIX.G.\nok\n"),
        ("M32 /nix.g#", "open failed, File: nix.g.\nok\n"),
        ("M23 FOLDER", "open failed, File: FOLDER.\nok\n"),
        ("M23", "open failed, File: .\nok\n"),
        ("M30 NIX.G", "Deletion failed, File: NIX.G.\nok\n"),
        ("M24", none),
        ("M27", "Not SD printing\nok\n"),
        ("M23 A.G", "File opened: A.G Size: 2004\nFile selected\nok\n"),
        ("M26 S9999", "echo:number out of range, not carried out\nok\n"),
        ("M26 S-5", "echo:number out of range, not carried out\nok\n"),
        ("M26 S99999999999", "echo:number out of range, not carried out\nok\n"),
        ("M26", "echo:number out of range, not carried out\nok\n"),
        ("M26 S5", "ok\n"),
    ] {
        assert_eq!(printer.ask(line, 0), answer, "{line}");
    }
}

/// Each byte of the boot sector that describes the volume, 0 and extreme, alone.
#[test]
fn no_byte_of_a_boot_sector_stops_the_machine() {
    let mut printer = Printer::boot();
    for (at, value) in (11..64).flat_map(|at| [0, 0xFF, 0x80].map(|value| (at, value))) {
        for is_32 in [false, true] {
            let mut card = Card::new(is_32, 0);
            card.put(FIRST, at, &[value]);
            let [mounts, _] = printer.use_card(card, at as u64);
            let needed = matches!((at, value), (13, 0 | 0xFF) | (11 | 12, 0xFF | 0x80) | (16, _));
            assert!(!(mounts && needed), "byte {at} = {value} is accepted");
        }
    }
}

#[test]
fn cards_that_hold_anything_are_answered() {
    let mut printer = Printer::boot();
    let (mut mounted, mut printed, seeds) = (0, 0, seeds(1_000));
    let count = seeds.end - seeds.start;
    for seed in seeds {
        let mut card = Card::new(seed & 1 != 0, seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        for _ in 0..1 + card.random(3) {
            card.damage();
        }
        let [mounts, prints] = printer.use_card(card, seed);
        mounted += u64::from(mounts);
        printed += u64::from(prints);
    }
    println!("{count} cards: {mounted} mounted, {printed} printed from");
    assert!(count < 100 || (mounted > count / 3 && printed > count / 5));
}
