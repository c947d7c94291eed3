//! Files of an SD card on the emulated RP2040, in all dialects: steps at the pins, and what another program reads on the
//! card. `cargo xtask test` runs these tests, and installs the emulator.

use fatfs::FatType;
use kerf::boards::PICOCNC;
use kerf_sim::emulated::Emulated;
use kerf_sim::{Runs, USB};

use crate::common::image as firmware;
use kerf_sim::sd_image::{image, lost, names, text};

/// Steps of a motor in a mm, by default.
const PER_MM: i64 = 1_280;

struct Session {
    board: Emulated,
    heard: String,
}

impl Session {
    fn new(card: &[u8]) -> Self {
        let mut board = Emulated::load(&firmware(&PICOCNC), &PICOCNC).unwrap();
        board.insert_card(card).unwrap();
        board.run_for_ms(300).unwrap();
        Self { board, heard: String::new() }
    }

    fn run(&mut self, ms: u64) {
        self.board.run_for_ms(ms).unwrap();
        self.heard += &String::from_utf8_lossy(&self.board.receive_from(USB));
    }

    /// Sends a line, and returns what is heard up to a line with this in it.
    fn ask(&mut self, line: &str, end: &str) -> String {
        self.heard.clear();
        self.board.send_to(USB, format!("{line}\n").as_bytes());
        for _ in 0..20_000 {
            self.run(1);
            if self.heard.ends_with('\n') && self.heard.contains(end) {
                return std::mem::take(&mut self.heard);
            }
        }
        panic!("no {end:?} behind {line}, but {:?}", self.heard);
    }
}

/// A zigzag of `moves` moves of 0.2 mm that ends 100 mm farther.
fn zigzag(moves: usize) -> String {
    let mut text = String::from("G91\nG1 F3000\n");
    for n in 0..moves {
        text += &format!("G1 X{} Y0.1 (line {n})\n", if n % 2 == 0 { 0.2 } else { -0.2 });
    }
    text + "G1 X10 Y10\n"
}

/// Where the motors of X and Y are, steps.
fn ends(board: &Emulated) -> [i64; 2] {
    let [x, y, ..] = board.steps();
    [x, y]
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_file_is_written_and_run_over_usb() {
    for fat in [FatType::Fat16, FatType::Fat32] {
        let card = image(fat, &[("KEEP.NC", zigzag(50))]);
        let mut session = Session::new(&card);
        let file = zigzag(60);
        session.ask("{sdw:\"part.nc\"}", "\"f\":[1,0,");
        let lines: Vec<_> = file.lines().collect();
        for some in lines.chunks(4) {
            session.heard.clear();
            let bytes: String = some.iter().map(|line| format!("{line}\n")).collect();
            session.board.send_to(USB, bytes.as_bytes());
            while session.heard.matches("\"f\":[1,0,").count() < some.len() {
                session.run(1);
            }
        }
        session.ask("{sdw:t}", "\"f\":[1,0,");
        let now = session.board.card().unwrap();
        assert_eq!(text(&now, "PART.NC").as_deref(), Some(&*file));
        assert_eq!(text(&now, "KEEP.NC"), Some(zigzag(50)));
        assert_eq!((lost(&now), names(&now).len()), (0, 3));
        assert_eq!(ends(&session.board), [0, 0], "nothing has moved");
        // The file is run from the card. Below, the same lines come over USB, to compare the times.
        session.ask("{sdr:\"PART.NC\"}", "\"f\":[1,0,");
        let began = session.board.cycle();
        session.heard.clear();
        while !session.heard.contains("End of file") {
            session.run(10);
        }
        let seconds = (session.board.cycle() - began) as f64 / 128e6;
        let wanted = [10 * PER_MM, 16 * PER_MM];
        assert_eq!(ends(&session.board), wanted);
        assert!(session.ask("{stv:n}", "\"stv\":").contains("\"stv\":0"));
        session.heard.clear();
        let began = session.board.cycle();
        session.board.send_to(USB, file.as_bytes());
        while ends(&session.board) != wanted.map(|steps| 2 * steps) {
            session.run(10);
        }
        let over_usb = (session.board.cycle() - began) as f64 / 128e6;
        assert!(
            (seconds - over_usb).abs() < 0.1,
            "{seconds} s from the card, {over_usb} s over USB"
        );
        session.run(300);
        session.ask("{sdd:\"PART.NC\"}", "\"f\":[1,0,");
        assert_eq!(lost(&session.board.card().unwrap()), 0);
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn grbl_lists_runs_holds_and_goes_on() {
    let part = format!("%\nG21\n{}M30\n%\n", zigzag(100));
    // More moves than the queue holds.
    let card = image(FatType::Fat32, &[("PART.NC", part), ("LONG.NC", zigzag(3_000))]);
    let mut session = Session::new(&card);
    let list = session.ask("$F", "ok\r\n");
    assert!(list.contains("[FILE:/PART.NC|SIZE:"), "{list}");
    session.ask("$F=PART.NC", "ok\r\n");
    session.run(600);
    session.board.send_to(USB, b"!");
    session.run(300);
    let held = ends(&session.board);
    session.board.send_to(USB, b"?");
    session.run(500);
    assert!(
        session.heard.contains("<Hold:0|") && session.heard.contains("|SD:"),
        "{}",
        session.heard
    );
    assert_eq!(ends(&session.board), held);
    assert_ne!(held, [0, 0]);
    session.heard.clear();
    session.board.send_to(USB, b"~");
    while !session.heard.contains("[MSG:Pgm End]") {
        session.run(10);
    }
    let end = ends(&session.board);
    // A card that is pulled ends the file, and nothing waits.
    session.ask("$F=LONG.NC", "ok\r\n");
    session.run(200);
    session.board.put_card(false);
    session.run(3_000);
    assert!(!session.ask("?", ">").contains("|SD:"));
    session.board.send_to(USB, b"\x18");
    session.run(500);
    assert!(session.ask("$F", "error:").contains("error:60"));
    session.board.put_card(true);
    session.ask("$FM", "ok\r\n");
    assert_ne!(ends(&session.board), end);
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_printing_host_uploads_numbered_lines() {
    let card = image(FatType::Fat16, &[]);
    let mut session = Session::new(&card);
    let numbered = |number: usize, line: &str| {
        let text = format!("N{number} {line}");
        let sum = text.bytes().fold(0, |sum, byte| sum ^ byte);
        format!("{text}*{sum}")
    };
    session.ask("M110 N0", "ok");
    session.ask("M21", "ok");
    session.ask("M28 part.g", "ok");
    let file = "G91\nM105\nG1 X5 F6000\nM400\nG28 X\nM104 S50\n";
    for (number, line) in (1..).zip(file.lines()) {
        // Each line is damaged first, and comes again.
        let whole = numbered(number, line);
        assert!(session.ask(&whole.replace('G', "H").replace('M', "W"), "ok").contains("Resend: "));
        session.ask(&whole, "ok");
    }
    assert!(session.ask("M105", "ok").contains("T:") || !session.heard.contains("Error"));
    session.ask(&numbered(7, "M29"), "Done saving file.");
    let now = session.board.card().unwrap();
    assert_eq!(text(&now, "PART.G").as_deref(), Some(file));
    assert_eq!(ends(&session.board), [0, 0]);
}
